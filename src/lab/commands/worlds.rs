//! `armcal-lab worlds`: closed loops of this program in worlds drawn from all that is allowed.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use clap::Args;
use rayon::prelude::*;

use armcal::cli::Exit;
use armcal::cli::say;
use armcal::output;
use armcal::report::RunSummary;
use armcal_belief::calib::Status;
use armcal_core::files::{self, FileKind};
use armcal_core::log::read_recording;
use armcal_core::routine;
use armcal_core::streams::Message;
use armcal_lab::{DrawnWorld, drawn_world};

/// Multiple of the rms that bounds 99.9 % of the errors; one dimension, the worst case of their directions.
const SIGMAS_99_9: f64 = 3.29;
/// Settings with fewer views than the routines have, to save time.
const SHORT: [&str; 2] = ["capture.poses=14", "capture.held_out=4"];
/// Time between two checks of a child process.
const LOOK: Duration = Duration::from_millis(20);

#[derive(Debug, Args)]
pub(super) struct WorldsArgs {
    /// Folder for rows.csv and report.md
    #[arg(long, value_name = "DIR", default_value = "recordings/study-worlds")]
    out: PathBuf,
    /// Routines, each with its vehicle; may be given several times
    #[arg(long, value_name = "FILE", default_values = ["routines/titan4-quickstart.toml",
        "routines/kraft-open-frame.toml", "routines/tight-basket.toml", "routines/under-ice.toml"])]
    routine: Vec<PathBuf>,
    /// Arms; may be given several times
    #[arg(long, value_name = "DIR", default_values = ["robots/titan4", "robots/kraft-predator"])]
    robot: Vec<PathBuf>,
    /// Worlds
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    runs: u64,
    /// Number of the first
    #[arg(long, alias = "first", value_name = "N", default_value_t = 1)]
    first_seed: u64,
    /// A run that takes longer hangs, s
    #[arg(long, alias = "timeout", value_name = "SECONDS", default_value_t = 300)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=86_400))]
    timeout_s: u64,
    /// Runs at once; all cores if not given. The results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// Outcome of one world.
struct Row {
    world: DrawnWorld,
    ending: String,
    /// Reason in the program's own words.
    reason: String,
    /// Tolerance of the routine's task, m.
    tolerance_m: f64,
    summary: Option<RunSummary>,
    bumps: usize,
    seconds: f64,
}

pub(super) fn worlds(args: &WorldsArgs) -> Result<Exit> {
    output::make_folder(&args.out)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0).into()).build()?;
    let numbers: Vec<u64> = (args.first_seed..args.first_seed.saturating_add(args.runs)).collect();
    let tolerances_m = args.routine.iter().map(|file| Ok(routine::load(file)?.task.tolerance_m));
    let tolerances_m = tolerances_m.collect::<Result<Vec<f64>>>()?;
    let growing = Growing::begin(args)?;
    let one = |number: &u64| {
        let row = run_one(args, *number, &tolerances_m)?;
        growing.keep(args, &row)?;
        Ok(row)
    };
    let rows: Result<Vec<Row>> = pool.install(|| numbers.par_iter().map(one).collect());
    let rows = rows?;
    let report = report(&rows);
    for (name, text) in [("rows.csv", csv(args, &rows)), ("report.md", report.clone())] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    growing.end()?;
    say(&format!("{report}\nwritten      {}", args.out.display()))?;
    Ok(if rows.iter().all(|row| row.faults().is_empty()) { Exit::Ok } else { Exit::Refused })
}

/// Rows in the order in which the runs ended; they survive an interrupted study.
struct Growing {
    path: PathBuf,
    file: Mutex<File>,
}

impl Growing {
    fn begin(args: &WorldsArgs) -> Result<Self> {
        let path = args.out.join("rows.partial.csv");
        let mut file = File::create(&path).with_context(|| format!("{}: cannot be written", path.display()))?;
        file.write_all(HEADER.as_bytes())?;
        Ok(Self { path, file: Mutex::new(file) })
    }

    fn keep(&self, args: &WorldsArgs, row: &Row) -> Result<()> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line(args, row).as_bytes())
            .with_context(|| format!("{}: cannot be written", self.path.display()))
    }

    /// Removes the partial file: rows.csv now has all rows in their order.
    fn end(self) -> Result<()> {
        Ok(output::remove(&self.path)?)
    }
}

/// Runs one world as a process of its own, so that no failure of it harms the others.
fn run_one(args: &WorldsArgs, number: u64, tolerances_m: &[f64]) -> Result<Row> {
    let world = drawn_world(number, args.robot.len(), args.routine.len());
    let folder = tempfile::tempdir_in(&args.out).context("no folder for a run can be made")?;
    let said = folder.path().join("stderr");
    let mut command = Command::new(std::env::current_exe().context("this program cannot be found")?);
    command.arg("run").arg(&args.routine[world.routine]).arg("--seed").arg(number.to_string());
    command.arg("--robot").arg(&args.robot[world.arm]);
    for setting in SHORT.iter().copied().chain(world.settings.iter().map(String::as_str)) {
        command.arg("--set").arg(setting);
    }
    let out = folder.path().join("run");
    let stderr = File::create(&said).with_context(|| format!("{}: cannot be written", said.display()))?;
    let began = Instant::now();
    let mut child = command
        .arg("--out")
        .arg(&out)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(stderr)
        .spawn()
        .context("this program cannot be started")?;
    let status = wait(&mut child, Duration::from_secs(args.timeout_s))?;
    let seconds = began.elapsed().as_secs_f64();
    let said = String::from_utf8_lossy(&files::read_bytes(&said, FileKind::Table).unwrap_or_default()).into_owned();
    let summary = files::read_text(&out.join("summary.json"), FileKind::Text).ok();
    let summary = summary.and_then(|text| serde_json::from_str(&text).ok());
    let (ending, reason) = ending(status, &said, summary.as_ref());
    let tolerance_m = tolerances_m[world.routine];
    Ok(Row { world, ending, reason, tolerance_m, bumps: bumps_told(&out), summary, seconds })
}

/// Waits for the child; ends it and returns `None` after the limit.
fn wait(child: &mut Child, limit: Duration) -> Result<Option<ExitStatus>> {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if began.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}

/// Ending of a run and its reason, for the table.
fn ending(status: Option<ExitStatus>, said: &str, summary: Option<&RunSummary>) -> (String, String) {
    let last = said.lines().rev().find(|line| line.starts_with("error")).unwrap_or_default().to_owned();
    let Some(status) = status else { return ("hangs".to_owned(), last) };
    let Some(code) = status.code() else { return (format!("killed: {status}"), last) };
    if said.contains("panicked") {
        return (
            "panics".to_owned(),
            said.lines().find(|line| line.contains("panicked")).unwrap_or_default().to_owned(),
        );
    }
    match (code, summary) {
        (0 | 4, Some(summary)) if summary.status == Status::Accepted => {
            let broken: Vec<&str> = summary.asserts.iter().filter(|a| !a.holds).map(|a| a.key.key()).collect();
            let ending = if broken.is_empty() { "accepted" } else { "accepted, an assert does not hold" };
            (ending.to_owned(), broken.join(", "))
        }
        (4, Some(summary)) => ("refused".to_owned(), summary.refusal.clone().unwrap_or_default()),
        (1, _) => ("stopped".to_owned(), last),
        (2, _) => ("cannot be planned or read".to_owned(), last),
        _ => (format!("exit code {code}"), last),
    }
}

/// Number of bumps in the run's log.
fn bumps_told(out: &Path) -> usize {
    let Ok(recording) = read_recording(out.join("run.mcap")) else { return 0 };
    recording.messages.iter().filter(|(_, m)| matches!(m, Message::Log(log) if log.text.starts_with("bump"))).count()
}

impl Row {
    fn contacts(&self) -> usize {
        self.summary.as_ref().and_then(|summary| summary.capture.collisions).unwrap_or(0)
    }

    /// Largest error at a target and the 99.9 % bound of its prediction, m; `None` unless the run is accepted.
    fn error_and_bound_m(&self) -> Option<(f64, f64)> {
        let summary = self.summary.as_ref().filter(|summary| summary.status == Status::Accepted)?;
        let after = summary.score.as_ref()?.after.as_ref()?.tool_error_m?.max;
        let predicted = summary.calibration.predicted_tool_error_with_priors_m?.max;
        Some((after, SIGMAS_99_9 * predicted))
    }

    /// Faults of the program: each is an outcome that no world may cause.
    fn faults(&self) -> Vec<&'static str> {
        let mut faults = Vec::new();
        if ["panics", "hangs"].contains(&self.ending.as_str()) || self.ending.starts_with("killed") {
            faults.push("does not end by itself");
        }
        if self.contacts() > 0 && self.bumps == 0 {
            faults.push("touches something and does not tell");
        }
        let is_good = self.ending.starts_with("accepted");
        if !is_good && self.reason.is_empty() {
            faults.push("fails without a reason");
        }
        if self.error_and_bound_m().is_some_and(|(error_m, bound_m)| error_m > bound_m.max(self.tolerance_m)) {
            faults.push("accepted beyond its bound and its tolerance");
        }
        faults
    }

    fn is_beyond_its_bound(&self) -> bool {
        self.error_and_bound_m().is_some_and(|(error_m, bound_m)| error_m > bound_m)
    }
}

/// The reason without its numbers, names and files, so that equal reasons can be counted.
fn kind_of(reason: &str) -> String {
    let reason = reason.rsplit_once(".mcap: ").map_or(reason, |(_, reason)| reason);
    let reason = reason.rsplit_once(".toml: ").map_or(reason, |(_, reason)| reason);
    let mut kind = String::new();
    let mut quoted = false;
    for c in reason.chars() {
        match c {
            '`' => quoted = !quoted,
            _ if quoted => continue,
            '0'..='9' if kind.ends_with('#') => continue,
            '0'..='9' => kind.push('#'),
            _ => kind.push(c),
        }
    }
    kind.chars().take(110).collect::<String>().replace('|', "/")
}

fn report(rows: &[Row]) -> String {
    let mut text = format!("# {} closed loops in worlds drawn from all that is allowed\n\n", rows.len());
    let mut endings: BTreeMap<(&str, String), Vec<u64>> = BTreeMap::new();
    for row in rows {
        endings.entry((&row.ending, kind_of(&row.reason))).or_default().push(row.world.number);
    }
    let mut endings: Vec<_> = endings.into_iter().collect();
    endings.sort_by_key(|(_, numbers)| std::cmp::Reverse(numbers.len()));
    text.push_str("| runs | ending | reason | first |\n|--:|---|---|--:|\n");
    for ((ending, reason), numbers) in &endings {
        let _ = writeln!(text, "| {} | {ending} | {reason} | {} |", numbers.len(), numbers[0]);
    }
    let mut faults: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
    for row in rows {
        for fault in row.faults() {
            faults.entry(fault).or_default().push(row.world.number);
        }
    }
    let accepted = rows.iter().filter(|row| row.error_and_bound_m().is_some()).count();
    let slowest = rows.iter().map(|row| row.seconds).fold(0.0, f64::max);
    let _ = writeln!(text, "\n{accepted} accepted with a truth to compare; the slowest run took {slowest:.0} s.");
    let beyond: Vec<u64> = rows.iter().filter(|row| row.is_beyond_its_bound()).map(|row| row.world.number).collect();
    let _ = writeln!(text, "Beyond the 99.9 % bound at one target or more: {} ({beyond:?}).", beyond.len());
    for (fault, numbers) in &faults {
        let _ = writeln!(text, "- {fault}: {} ({numbers:?})", numbers.len());
    }
    if faults.is_empty() {
        text.push_str("Nothing that must not be.\n");
    }
    text
}

const HEADER: &str =
    "number,robot,routine,settings,ending,reason,tool_error_max_m,bound_m,tolerance_m,contacts,bumps,faults\n";

fn csv(args: &WorldsArgs, rows: &[Row]) -> String {
    HEADER.to_owned() + &rows.iter().map(|row| line(args, row)).collect::<String>()
}

fn line(args: &WorldsArgs, row: &Row) -> String {
    let quoted = |field: &str| format!("\"{}\"", field.replace('"', "\"\""));
    let (robot, routine) = (&args.robot[row.world.arm], &args.routine[row.world.routine]);
    let [error, bound] = match row.error_and_bound_m() {
        Some((error_m, bound_m)) => [error_m.to_string(), bound_m.to_string()],
        None => [String::new(), String::new()],
    };
    let fields = [
        row.world.number.to_string(),
        quoted(&robot.display().to_string()),
        quoted(&routine.display().to_string()),
        quoted(&row.world.settings.join("; ")),
        quoted(&row.ending),
        quoted(&row.reason),
        error,
        bound,
        row.tolerance_m.to_string(),
        row.contacts().to_string(),
        row.bumps.to_string(),
        quoted(&row.faults().join("; ")),
    ];
    fields.join(",") + "\n"
}
