//! Our solver compared with NLopt and Ceres on the same numbers, one core, in one run; see README.md in this folder.
//!
//! Run `cargo bench --no-default-features --bench peers -- BUILD_FOLDER`. Without the folder of the built C++ programs
//! only our solver runs.

#![allow(clippy::print_stdout, reason = "a small program, for a terminal")]

#[path = "../problems.rs"]
mod problems;
mod text;

use std::path::{Path, PathBuf};
use std::process::Command;

use armcal::calib::bundle::{HyperparameterMode, least_squares};
use armcal::calib::{PositionMethod, PositionProblem, SearchOptions};
use armcal::model::JointParameters;
use comfy_table::Table;

const RELATIVE_GAIN: f64 = 1e-10;
const RHO: [f64; 2] = [0.5, 1e-6];
/// Half-width of the search's box in prior sigma.
const BOX_SIGMAS: f64 = 6.0;
/// Number of rounds: ours and theirs alternate, so that both run on the same machine state.
const N_ROUNDS: usize = 5;
const RUNS_A_ROUND: usize = 3;

/// Runs of one solver.
struct Contender {
    name: String,
    times_ms: Vec<f64>,
    evaluations: usize,
    cost: f64,
}

#[derive(Default)]
struct Contest {
    contenders: Vec<Contender>,
}

impl Contest {
    fn add(&mut self, name: &str, time_ms: f64, evaluations: usize, cost: f64) {
        if let Some(known) = self.contenders.iter_mut().find(|c| c.name == name) {
            known.times_ms.push(time_ms);
            return;
        }
        self.contenders.push(Contender { name: name.to_owned(), times_ms: vec![time_ms], evaluations, cost });
    }

    /// Adds the results of a program for the problem in `file`: lines `name, time ms, evaluations, cost`.
    fn add_program(&mut self, program: &Path, file: &Path) {
        let output = Command::new(program).arg(file).arg(RUNS_A_ROUND.to_string()).output();
        let output = output.unwrap_or_else(|error| panic!("{}: {error}", program.display()));
        assert!(output.status.success(), "{}: {}", program.display(), String::from_utf8_lossy(&output.stderr));
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            let fields: Vec<&str> = line.split(',').map(str::trim).collect();
            let [name, time_ms, evaluations, cost] = fields[..] else { panic!("not understood: {line}") };
            let (time_ms, cost) = (time_ms.parse().expect("a time"), cost.parse().expect("a cost"));
            self.add(name, time_ms, evaluations.parse().expect("a count"), cost);
        }
    }

    /// Table of the contenders; the first one is our solver, to which ratios refer.
    fn table(&mut self) -> Table {
        let mut table = Table::new();
        table.set_header(["solver", "least ms", "median ms", "least/ours", "evaluations", "cost", "cost/ours - 1"]);
        for contender in &mut self.contenders {
            contender.times_ms.sort_by(f64::total_cmp);
        }
        let (ours_ms, our_cost) = (self.contenders[0].times_ms[0], self.contenders[0].cost);
        for c in &self.contenders {
            table.add_row([
                c.name.clone(),
                format!("{:.3}", c.times_ms[0]),
                format!("{:.3}", c.times_ms[c.times_ms.len() / 2]),
                format!("{:.2}", c.times_ms[0] / ours_ms),
                c.evaluations.to_string(),
                format!("{:.12e}", c.cost),
                format!("{:+.1e}", c.cost / our_cost - 1.0),
            ]);
        }
        table
    }
}

/// Processor time of this thread, ms. Linux updates its account when a thread yields.
fn processor_ms() -> f64 {
    std::thread::yield_now();
    let account =
        std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux keeps an account of each thread");
    let ns = account.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
    ns.expect("the first number is the time on a processor, ns") * 1e-6
}

fn timed<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let start = processor_ms();
    let out = run();
    (processor_ms() - start, out)
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let file = folder.join(name);
    std::fs::write(&file, text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    file
}

fn main() {
    let programs = std::env::args().skip(1).find(|arg| !arg.starts_with("--")).map(PathBuf::from);
    let folder = programs.clone().unwrap_or_else(std::env::temp_dir);
    let bundle = problems::corners(40, 0.0);
    let bundle_file = write(&folder, "bundle.txt", &text::bundle(&bundle, RELATIVE_GAIN));
    let whole = problems::corners_of_all(40);
    let whole_file = write(&folder, "bundle_whole.txt", &text::bundle(&whole, RELATIVE_GAIN));
    let distance = problems::positions(40, 6);
    let distance_file = write(&folder, "distance.txt", &text::distance(&distance, BOX_SIGMAS, RHO));
    let straight = distance.straight();
    let views = PositionProblem::new(&distance.robot, &distance.views);
    let options = SearchOptions { rho_begin: RHO[0], rho_end: RHO[1], ..SearchOptions::default() };

    let (mut of_bundle, mut of_whole, mut of_distance) = (Contest::default(), Contest::default(), Contest::default());
    for _ in 0..N_ROUNDS {
        for _ in 0..RUNS_A_ROUND {
            for (problem, contest) in [(&bundle, &mut of_bundle), (&whole, &mut of_whole)] {
                let (ms, solved) = timed(|| least_squares(&problem.input(HyperparameterMode::Given), RELATIVE_GAIN));
                contest.add("bundle (ours)", ms, solved.iterations, solved.cost_final);
            }
            let guess = JointParameters::default();
            let (ms, solved) = timed(|| PositionMethod::MinimumDistance.solve(&views, &straight, &guess, &options));
            of_distance.add("minimum distance (ours)", ms, solved.evaluations, solved.cost_final);
        }
        if let Some(programs) = &programs {
            of_bundle.add_program(&programs.join("bundle_ceres"), &bundle_file);
            of_whole.add_program(&programs.join("bundle_ceres"), &whole_file);
            of_distance.add_program(&programs.join("distance_nlopt"), &distance_file);
        }
    }
    println!("Minimum distance, 40 poses x 6 tags, rho {} to {}; cost m", RHO[0], RHO[1]);
    println!("{}", of_distance.table());
    println!("Bundle, 40 views x 8 tags, 84 parameters, relative gain {RELATIVE_GAIN:e}; cost: sum of squares");
    println!("{}", of_bundle.table());
    println!("The same with links, sag and lens, 131 parameters");
    println!("{}", of_whole.table());
}
