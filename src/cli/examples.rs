//! Examples for the help of each command. A test parses them all.

use clap::Command;

/// By the names of command and subcommand.
const EXAMPLES: &[(&str, &[&str])] = &[
    (
        "run",
        &[
            "armcal run routines/titan4-quickstart.toml",
            "armcal run routines/titan4-quickstart.toml --seed 2 --out dive-2 --details",
            "armcal run routines/titan4-quickstart.toml --set capture.poses=20 --json",
            "armcal run routines/my-arm.toml --arm ros2:arm.toml --speed 0.2",
            "armcal run routines/my-arm.toml --arm rosbridge:arm.toml --no-motion",
        ],
    ),
    ("serve", &["armcal serve routines/titan4-quickstart.toml --factor 5 --for 600"]),
    ("live", &["armcal live discover --robot my-arm --out arm.toml"]),
    ("live discover", &["armcal live discover --domain 7 --robot my-arm --out arm.toml"]),
    (
        "campaign",
        &[
            "armcal campaign routines/titan4-quickstart.toml --seeds 1..20 --out quick.csv",
            "armcal campaign routines/titan4-quickstart.toml --seeds 1..200 --shard 1/4 --out shard-1.csv",
            "armcal campaign --merge shard-1.csv shard-2.csv --out all.csv",
        ],
    ),
    (
        "regress",
        &[
            "armcal regress routines/regression.toml --write-baseline baseline.csv --seeds 1..10",
            "armcal regress routines/regression.toml --baseline baseline.csv --junit regress.xml",
        ],
    ),
    ("sensitivity", &["armcal sensitivity routines/titan4-quickstart.toml --poses 40 --out sensitivity"]),
    (
        "plan",
        &[
            "armcal plan routines/titan4-quickstart.toml --out plan",
            "armcal plan routines/titan4-quickstart.toml --prior result/calibration.toml --details",
        ],
    ),
    (
        "calibrate",
        &[
            "armcal calibrate run.mcap --robot robots/titan4 --out result",
            "armcal calibrate field.mcap --robot my-arm --input map.toml --tag-map tags.toml --out result",
            "armcal calibrate day-1.mcap day-2.mcap --robot robots/titan4 --prior result/calibration.toml --out new",
            "armcal calibrate dive.mcap --robot robots/titan4 --online --out belief",
        ],
    ),
    ("explain", &["armcal explain value_out_of_range", "armcal explain"]),
    ("watch", &["armcal watch recordings/dive/run.mcap --robot robots/titan4 --json"]),
    (
        "tagmap",
        &[
            "armcal tagmap run.mcap --robot robots/titan4 --out tags.toml --html tags.html",
            "armcal tagmap bag.mcap --camera cameras.yaml --tags tagslam.yaml --mode partly-known",
        ],
    ),
    (
        "inspect",
        &[
            "armcal inspect run.mcap --robot robots/titan4",
            "armcal inspect field.mcap --robot my-arm --write-input map.toml",
        ],
    ),
    (
        "export",
        &[
            "armcal export result/calibration.toml --as ros-parameters --robot robots/titan4",
            "armcal export result/calibration.toml --as table --robot robots/titan4 --points 500",
        ],
    ),
    ("replay", &["armcal replay recordings/dive/run.mcap", "armcal replay recordings/dive/run.mcap --save dive.rrd"]),
    ("new-robot", &["armcal new-robot arm.urdf --out my-arm --tip tool0 --camera-link camera_optical"]),
    (
        "check",
        &[
            "armcal check robots/titan4 routines/titan4-quickstart.toml",
            "armcal check result/calibration.toml map.toml tags.toml --json",
        ],
    ),
    ("completions", &["armcal completions bash"]),
    ("man", &["armcal man share/man/man1"]),
    ("study", &["armcal study detection --repeats 10", "armcal study falsified --quick"]),
    ("study detection", &["armcal study detection --repeats 10 --out detection"]),
    ("study paper", &["armcal study paper --quick"]),
    ("study edges", &["armcal study edges --n 1000"]),
    ("study paths", &["armcal study paths --n 100"]),
    ("study self-collision", &["armcal study self-collision my-arm --n 100000"]),
    ("study tracking-error", &["armcal study tracking-error run.mcap --robot robots/titan4"]),
    ("study poses", &["armcal study poses --seeds 5"]),
    ("study falsified", &["armcal study falsified --kind tag --seeds 10"]),
    ("study worlds", &["armcal study worlds --runs 100 --first-seed 1 --timeout-s 300"]),
    ("study dive", &["armcal study dive --seeds 10 --keep"]),
    ("study bound", &["armcal study bound --routine routines/titan4-pinhole.toml --seeds 20"]),
    ("study dive-faults", &["armcal study dive-faults --seeds 5 --kind sensor"]),
];

/// `command` with the examples in its help and in that of all below it.
pub(super) fn with_examples(command: Command) -> Command {
    let mut command = command;
    let names: Vec<String> = command.get_subcommands().map(|below| below.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(&name, |below| named(below, &name));
    }
    command
}

fn named(command: Command, name: &str) -> Command {
    let mut command = command;
    let below: Vec<String> = command.get_subcommands().map(|below| below.get_name().to_owned()).collect();
    for below in below {
        command = command.mut_subcommand(&below, |command| named(command, &format!("{name} {below}")));
    }
    match EXAMPLES.iter().find(|(of, _)| *of == name) {
        Some((_, lines)) => command.after_help(format!("Examples:\n  {}", lines.join("\n  "))),
        None => command,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(command: &Command, before: &str) -> Vec<String> {
        let below = command.get_subcommands().flat_map(|below| {
            let name = format!("{before}{}", below.get_name());
            let all = names(below, &format!("{name} "));
            std::iter::once(name).chain(all)
        });
        below.collect()
    }

    #[test]
    fn each_command_has_examples_and_each_example_is_understood() {
        let command = crate::cli::command();
        for name in names(&command, "") {
            assert!(EXAMPLES.iter().any(|(of, lines)| *of == name && !lines.is_empty()), "{name} has no example");
        }
        for (name, lines) in EXAMPLES {
            for line in *lines {
                let understood = command.clone().try_get_matches_from(line.split_whitespace());
                assert!(line.starts_with(&format!("armcal {name}")) && understood.is_ok(), "{line}: {understood:?}");
            }
        }
    }
}
