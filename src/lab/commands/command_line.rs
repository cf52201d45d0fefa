//! Parsing and dispatch of the command line.

use std::process::ExitCode;

use armcal::cli::{Loudness, carry_out, parsed, with_examples};
use clap::{CommandFactory, Parser, Subcommand};

use super::{bound, detection, dive, dive_faults, falsified, paper, planning, poses, sensitivity, worlds};

/// Measure parts of armcal against known truth, and make the paper's tables and figures.
#[derive(Debug, Parser)]
#[command(name = "armcal-lab", version, about, max_term_width = 100)]
struct Lab {
    #[command(flatten)]
    loudness: Loudness,
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, Subcommand)]
enum Study {
    /// Compare the paper's methods with least squares and with the bound, on landmark positions with noise
    Paper(paper::PaperArgs),
    /// Show the effect of one wrong joint offset on the paper's two objectives and on the tool
    Sensitivity(sensitivity::SensitivityArgs),
    /// Render tags at set ranges and incidences in three kinds of water, detect them, and compare with the truth
    Detection(detection::DetectionArgs),
    /// Certify random edges of an arm and scan each by brute force
    Edges(planning::EdgesArgs),
    /// Plan between random poses at several sites, under wide and narrow bounds
    Paths(planning::PathsArgs),
    /// Choose poses by each criterion and at random, and compare the tool error that they leave
    Poses(poses::PosesArgs),
    /// Falsify drawing, survey or a sensor after a capture, and compare the verdict with the truth
    Falsified(falsified::FalsifiedArgs),
    /// Run a routine in worlds drawn from all that `[world]` allows, and look for what must not be
    Worlds(worlds::WorldsArgs),
    /// Run a closed loop for several seeds, and compare the tool error with the Bayesian bound of the views
    Bound(bound::BoundArgs),
    /// Run a dive for several seeds, follow each recording online, and compare the belief with the truth at each task
    Dive(dive::DiveArgs),
    /// Run dives with each kind of fault, and compare when it is named with when an oracle could tell it
    DiveFaults(dive_faults::DiveFaultsArgs),
}

/// Examples by the names of the commands.
const EXAMPLES: &[(&str, &[&str])] = &[
    ("paper", &["armcal-lab paper --quick"]),
    ("sensitivity", &["armcal-lab sensitivity routines/titan4-quickstart.toml --poses 40 --out sensitivity"]),
    ("detection", &["armcal-lab detection --repeats 10 --out detection"]),
    ("edges", &["armcal-lab edges --n 1000"]),
    ("paths", &["armcal-lab paths --n 100"]),
    ("poses", &["armcal-lab poses --seeds 5"]),
    ("falsified", &["armcal-lab falsified --kind tag --seeds 10"]),
    ("worlds", &["armcal-lab worlds --runs 100 --first-seed 1 --timeout-s 300"]),
    ("dive", &["armcal-lab dive --seeds 10 --keep"]),
    ("bound", &["armcal-lab bound --routine routines/titan4-pinhole.toml --seeds 20"]),
    ("dive-faults", &["armcal-lab dive-faults --seeds 5 --kind sensor"]),
];

pub(crate) fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|word| word == "run") {
        return armcal::cli::main(std::env::args_os()).into();
    }
    let lab: Lab = match parsed(with_examples(Lab::command(), EXAMPLES), std::env::args_os()) {
        Ok(lab) => lab,
        Err(exit) => return exit.into(),
    };
    carry_out(&lab.loudness, || match &lab.study {
        Study::Paper(args) => paper::paper(args),
        Study::Sensitivity(args) => sensitivity::sensitivity(args),
        Study::Detection(args) => detection::detection(args),
        Study::Edges(args) => planning::edges(args),
        Study::Paths(args) => planning::paths(args),
        Study::Poses(args) => poses::poses(args),
        Study::Falsified(args) => falsified::falsified(args),
        Study::Worlds(args) => worlds::worlds(args),
        Study::Bound(args) => bound::bound(args),
        Study::Dive(args) => dive::dive(args),
        Study::DiveFaults(args) => dive_faults::dive_faults(args),
    })
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_has_examples_and_each_example_is_understood() {
        let command = with_examples(Lab::command(), EXAMPLES);
        for below in command.get_subcommands() {
            let name = below.get_name();
            assert!(EXAMPLES.iter().any(|(of, _)| *of == name), "{name} has no example");
        }
        for line in EXAMPLES.iter().flat_map(|(_, lines)| *lines) {
            let understood = command.clone().try_get_matches_from(line.split_whitespace());
            assert!(understood.is_ok(), "{line}: {understood:?}");
        }
    }
}
