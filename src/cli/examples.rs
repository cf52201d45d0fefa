//! Examples for the help of each command. A test parses them all.

use clap::Command;

/// Examples by the names of command and subcommand.
pub(super) const EXAMPLES: &[(&str, &[&str])] = &[
    (
        "run",
        &[
            "armcal run routines/titan4-quickstart.toml",
            "armcal run routines/titan4-quickstart.toml --seed 2 --out dive-2 --details",
            "armcal run routines/titan4-quickstart.toml --set capture.poses=20 --json",
        ],
    ),
    (
        "drive",
        &[
            "armcal drive routines/my-arm.toml --arm arm.toml --no-motion",
            "armcal drive routines/my-arm.toml --arm arm.toml --nudge --speed 0.2",
        ],
    ),
    ("serve", &["armcal serve routines/titan4-quickstart.toml --factor 5 --for 600"]),
    ("discover", &["armcal discover --domain 7 --robot my-arm --out arm.toml"]),
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
            "armcal regress routines/regression.toml --baseline baseline.csv --report regress.xml",
        ],
    ),
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
        ],
    ),
    ("schema", &["armcal schema robot", "armcal schema"]),
    ("explain", &["armcal explain value_out_of_range", "armcal explain"]),
    (
        "watch",
        &[
            "armcal watch recordings/dive/run.mcap --robot robots/titan4 --json",
            "armcal watch field.mcap --robot my-arm --input map.toml --tag-map tags.toml --out belief",
        ],
    ),
    (
        "tagmap",
        &[
            "armcal tagmap run.mcap --robot robots/titan4 --out tags.toml --out tags.html",
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
    (
        "new-robot",
        &[
            "armcal new-robot arm.urdf --out my-arm --tip tool0 --camera-link camera_optical",
            "armcal new-robot --self-collision my-arm",
        ],
    ),
    (
        "check",
        &[
            "armcal check robots/titan4 routines/titan4-quickstart.toml",
            "armcal check result/calibration.toml map.toml tags.toml --json",
        ],
    ),
    ("completions", &["armcal completions bash"]),
    ("man", &["armcal man share/man/man1"]),
];

/// Adds the examples to the help of `command` and of all its subcommands.
#[must_use]
pub fn with_examples(command: Command, examples: &[(&str, &[&str])]) -> Command {
    let mut command = command;
    let names: Vec<String> = command.get_subcommands().map(|below| below.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(&name, |below| named(below, &name, examples));
    }
    command
}

fn named(command: Command, name: &str, examples: &[(&str, &[&str])]) -> Command {
    let mut command = command;
    let below: Vec<String> = command.get_subcommands().map(|below| below.get_name().to_owned()).collect();
    for below in below {
        command = command.mut_subcommand(&below, |command| named(command, &format!("{name} {below}"), examples));
    }
    match examples.iter().find(|(of, _)| *of == name) {
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
