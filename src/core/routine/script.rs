//! Conversion of `[[step]]` tables to checked steps: each alone, then the order of steps that depend on each other.

use crate::codes::Code;
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::assert_figure::{AssertLimits, MAX_LIMIT, Needs};
use super::error::RoutineError;
use super::settings::{CaptureSettings, TaskSettings};
use super::step::{
    CalibrateSettings, CalibrateViews, IdentifySettings, MoveGoal, OnRefusal, ReachSettings, Step, StopsSettings,
    TouchSettings, WorkSettings,
};
use super::step_keys::{
    CalibrateKeys, CaptureKeys, GripKeys, IdentifyKeys, MoveKeys, ReachKeys, StopsKeys, TouchKeys, WaitKeys, WorkKeys,
};
use crate::robot::{FileIssue, from_table, parse_toml};
use crate::streams::PriorSource;
use crate::text::nearest;

/// The script of a routine without `[[step]]`: the standard closed loop.
pub(super) fn standard(capture: CaptureSettings, task: &TaskSettings) -> Vec<Step> {
    let reach = || Step::Reach(ReachSettings { targets: (0..task.targets_m.len()).collect(), touch: false });
    let calibrate =
        CalibrateSettings { prior: PriorSource::Fresh, views: CalibrateViews::New, on_refusal: OnRefusal::Stop };
    vec![reach(), Step::Capture(capture), Step::Calibrate(calibrate), reach()]
}

const NAMES: &str =
    "move, reach, work, grip, capture, identify, stops, touch, calibrate, recalibrate, wait, fault, assert";

/// Returns the lines at which the `[[step]]` tables of a routine begin; none if it is no TOML.
pub(super) fn step_lines(file: &Path, text: &str) -> Vec<usize> {
    #[derive(Deserialize)]
    struct Steps {
        #[serde(default)]
        step: Vec<toml::Spanned<toml::Table>>,
    }
    let steps = parse_toml::<Steps>(file, text).map(|steps| steps.step).unwrap_or_default();
    steps.iter().map(|step| 1 + text[..step.span().start].matches('\n').count()).collect()
}

/// Names of steps in messages: `line 41: step 3`.
#[derive(Clone, Copy)]
struct StepNames<'a>(&'a [usize]);

impl StepNames<'_> {
    /// Returns the name of the step at `index`, from 0.
    fn name(self, index: usize) -> String {
        let line = self.0.get(index).map_or_else(String::new, |line| format!("line {line}: "));
        format!("{line}step {}", index + 1)
    }
}

/// Steps in order, and the unread tables of the faults in order.
pub(super) struct Script {
    pub steps: Vec<Step>,
    pub faults: Vec<toml::Table>,
}

/// Reads `[[step]]` tables, which begin at `lines` of the file.
pub(super) fn read(
    file: &Path,
    (tables, lines): (Vec<toml::Table>, &[usize]),
    capture: CaptureSettings,
    task: &TaskSettings,
) -> Result<Script, RoutineError> {
    let mut script = Script { steps: Vec::new(), faults: Vec::new() };
    let names = StepNames(lines);
    for (index, mut table) in tables.into_iter().enumerate() {
        let step_name = names.name(index);
        let name = match table.remove("do") {
            Some(toml::Value::String(name)) => name,
            Some(other) => {
                let problem = format!("{other} is no text; it is one of {NAMES}");
                return Err(FileIssue::new(Code::ValueType, file, format!("{step_name}: do"), problem).into());
            }
            None => {
                let problem = format!("is missing; it is one of {NAMES}");
                return Err(FileIssue::new(Code::KeyMissing, file, format!("{step_name}: do"), problem).into());
            }
        };
        let reader = StepReader { file, key: format!("{step_name} ({name})"), table };
        let step = match name.as_str() {
            "move" => reader.move_goal()?,
            "reach" => reader.reach(task)?,
            "work" => reader.work(task)?,
            "grip" => reader.grip()?,
            "capture" => reader.capture(capture)?,
            "identify" => reader.identify()?,
            "stops" => reader.stops()?,
            "touch" => reader.touch()?,
            "calibrate" => reader.calibrate(PriorSource::Fresh)?,
            "recalibrate" => reader.calibrate(PriorSource::Warm)?,
            "wait" => reader.wait()?,
            "assert" => reader.assert()?,
            "fault" => {
                script.faults.push(reader.table);
                Step::Fault { number: script.faults.len() - 1 }
            }
            other => {
                let hint = nearest(other, NAMES.split(", ")).map(|name| format!("; did you mean `{name}`?"));
                let problem = format!("`{other}` is none of {NAMES}{}", hint.unwrap_or_default());
                return Err(FileIssue::new(Code::NameUnknown, file, format!("{step_name}: do"), problem).into());
            }
        };
        script.steps.push(step);
    }
    check_order(file, names, &script.steps)?;
    Ok(script)
}

struct StepReader<'a> {
    file: &'a Path,
    key: String,
    table: toml::Table,
}

impl StepReader<'_> {
    fn parse<T: DeserializeOwned>(&self) -> Result<T, FileIssue> {
        from_table(&self.table).map_err(|problem| FileIssue::syntax(self.file, &self.key, problem))
    }

    fn key(&self, name: &str) -> String {
        format!("{}: {name}", self.key)
    }

    fn range(&self, name: &str, value: f64, range: std::ops::RangeInclusive<f64>) -> Result<f64, FileIssue> {
        FileIssue::check_range(self.file, &self.key(name), value, range)
    }

    fn move_goal(&self) -> Result<Step, FileIssue> {
        let raw: MoveKeys = self.parse()?;
        match (raw.to.as_deref(), raw.to_rad) {
            (Some("stowed"), None) => Ok(Step::Move(MoveGoal::Stowed)),
            (None, Some(angles)) => {
                for angle in &angles {
                    self.range("to_rad", *angle, -100.0..=100.0)?;
                }
                Ok(Step::Move(MoveGoal::Angles(angles)))
            }
            _ => Err(FileIssue::new(
                Code::ValueInvalid,
                self.file,
                &self.key,
                "needs either to = \"stowed\" or to_rad = [one angle a joint]",
            )),
        }
    }

    fn reach(&self, task: &TaskSettings) -> Result<Step, FileIssue> {
        let ReachKeys { targets, touch } = self.parse()?;
        Ok(Step::Reach(ReachSettings { targets: self.targets(targets, task)?, touch }))
    }

    /// Returns the numbers of the task's targets; all of them if none are named.
    fn targets(&self, targets: Option<Vec<usize>>, task: &TaskSettings) -> Result<Vec<usize>, FileIssue> {
        let n = task.targets_m.len();
        let targets = targets.unwrap_or_else(|| (0..n).collect());
        if targets.is_empty() {
            return Err(FileIssue::new(Code::ValueCount, self.file, self.key("targets"), "needs one number or more"));
        }
        for &target in &targets {
            self.range("targets", target as f64, 0.0..=(n - 1) as f64)?;
        }
        Ok(targets)
    }

    fn work(&self, task: &TaskSettings) -> Result<Step, FileIssue> {
        let raw: WorkKeys = self.parse()?;
        for angle in raw.looks_rad.iter().flatten() {
            self.range("looks_rad", *angle, -100.0..=100.0)?;
        }
        for angle in raw.rest_rad.iter().flatten() {
            self.range("rest_rad", *angle, -100.0..=100.0)?;
        }
        for [from_s, to_s] in &raw.gaps_s {
            self.range("gaps_s", *from_s, 0.0..=1e6)?;
            self.range("gaps_s (its end)", *to_s, *from_s..=1e6)?;
        }
        let rate_rad_s = raw.rate_rad_s.map(|rate| self.range("rate_rad_s", rate, 0.01..=10.0)).transpose()?;
        Ok(Step::Work(WorkSettings {
            tasks: self.range("tasks", f64::from(raw.tasks), 1.0..=10_000.0)? as u32,
            every_s: self.range("every_s", raw.every_s, 1.0..=1e5)?,
            targets: self.targets(raw.targets, task)?,
            rest: raw.rest_rad.map_or(MoveGoal::Stowed, MoveGoal::Angles),
            looks_rad: raw.looks_rad,
            look_every: self.range("look_every", f64::from(raw.look_every), 1.0..=10_000.0)? as u32,
            look_s: self.range("look_s", raw.look_s, 0.0..=600.0)?,
            gaps_s: raw.gaps_s,
            rate_rad_s,
            belief: raw.belief,
            poses: self.range("poses", f64::from(raw.poses), 0.0..=20.0)? as u32,
        }))
    }

    fn grip(&self) -> Result<Step, FileIssue> {
        Ok(Step::Grip { opening: self.range("opening", self.parse::<GripKeys>()?.opening, 0.0..=1.0)? })
    }

    fn capture(&self, general: CaptureSettings) -> Result<Step, FileIssue> {
        let settings = self.parse::<CaptureKeys>()?.over(general);
        settings.check(self.file, &self.key(""))?;
        Ok(Step::Capture(settings))
    }

    fn identify(&self) -> Result<Step, FileIssue> {
        let raw: IdentifyKeys = self.parse()?;
        Ok(Step::Identify(IdentifySettings {
            joint: raw.joint,
            gain_max: self.range("gain_max", raw.gain_max, 1.0..=20.0)?,
            travel_counts: self.range("travel_counts", raw.travel_counts, 1.0..=1e6)?,
            swing_rad: self.range("swing_rad", raw.swing_rad, 0.01..=0.5)?,
            views: self.range("views", f64::from(raw.views), 3.0..=100.0)? as u32,
        }))
    }

    fn stops(&self) -> Result<Step, FileIssue> {
        let StopsKeys { joints, dwell_s } = self.parse()?;
        Ok(Step::Stops(StopsSettings { joints, dwell_s: self.range("dwell_s", dwell_s, 0.2..=60.0)? }))
    }

    fn touch(&self) -> Result<Step, FileIssue> {
        let raw: TouchKeys = self.parse()?;
        for value in raw.point_m {
            self.range("point_m", value, -10.0..=10.0)?;
        }
        let length = raw.normal.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !(0.99..=1.01).contains(&length) {
            let problem = format!("has the length {length}; it is a direction out of the surface, of length 1");
            return Err(FileIssue::new(Code::ValueInvalid, self.file, self.key("normal"), problem));
        }
        Ok(Step::Touch(TouchSettings {
            part: raw.part,
            point_m: raw.point_m,
            normal: raw.normal.map(|v| v / length),
            std_m: self.range("std_m", raw.std_m, 1e-5..=0.1)?,
            approach_m: self.range("approach_m", raw.approach_m, 0.05..=0.5)?,
            dwell_s: self.range("dwell_s", raw.dwell_s, 0.2..=60.0)?,
        }))
    }

    fn calibrate(&self, prior: PriorSource) -> Result<Step, FileIssue> {
        let raw: CalibrateKeys = self.parse()?;
        Ok(Step::Calibrate(CalibrateSettings { prior, views: raw.views, on_refusal: raw.on_refusal }))
    }

    fn wait(&self) -> Result<Step, FileIssue> {
        Ok(Step::Wait { seconds: self.range("seconds", self.parse::<WaitKeys>()?.seconds, 0.01..=1e6)? })
    }

    fn assert(&self) -> Result<Step, FileIssue> {
        let limits: AssertLimits = self.parse()?;
        if limits.is_empty() {
            return Err(FileIssue::new(
                Code::KeyMissing,
                self.file,
                &self.key,
                "holds the run against nothing: name one limit or more",
            ));
        }
        for (figure, limit) in limits.each() {
            self.range(figure.key(), limit, 0.0..=MAX_LIMIT)?;
        }
        Ok(Step::Assert(limits))
    }
}

/// Checks that each step follows the steps that it depends on.
fn check_order(file: &Path, names: StepNames<'_>, steps: &[Step]) -> Result<(), FileIssue> {
    let (mut captures, mut calibrations, mut reaches, mut moved) = (0, 0, 0, false);
    for (index, step) in steps.iter().enumerate() {
        let wrong = |problem: &str| {
            Err(FileIssue::new(
                Code::ValueInvalid,
                file,
                format!("{} ({})", names.name(index), step.name()),
                problem.to_owned(),
            ))
        };
        match step {
            Step::Move(_) | Step::Stops(_) | Step::Touch(_) => moved = true,
            Step::Reach(_) | Step::Work(_) => (reaches, moved) = (reaches + 1, true),
            Step::Capture(_) => (captures, moved) = (captures + 1, true),
            Step::Identify(_) if moved => {
                return wrong("must come before the first move, reach or capture: none of them is safe before it");
            }
            Step::Calibrate(settings) => {
                if captures == 0 {
                    return wrong(
                        "has no views: no `capture` comes before it (or between it and the last calibration)",
                    );
                }
                if settings.prior == PriorSource::Warm && calibrations == 0 {
                    return wrong("has nothing to start from: no `calibrate` comes before it");
                }
                calibrations += 1;
                captures = if settings.views == CalibrateViews::All { captures } else { 0 };
            }
            Step::Assert(limits) => {
                if limits.need(Needs::Calibration) && calibrations == 0 {
                    return wrong("speaks of a calibration, but no `calibrate` comes before it");
                }
                if limits.need(Needs::Reach) && reaches == 0 {
                    return wrong("speaks of a reach, but no `reach` comes before it");
                }
            }
            Step::Identify(_) | Step::Grip { .. } | Step::Wait { .. } | Step::Fault { .. } => {}
        }
    }
    if calibrations == 0 {
        return Err(FileIssue::new(Code::KeyMissing, file, "step", "a script needs a `calibrate` step"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn script(text: &str) -> Result<Script, RoutineError> {
        #[derive(Deserialize)]
        struct Steps {
            step: Vec<toml::Table>,
        }
        let steps: Steps = toml::from_str(text).expect("valid TOML");
        let task = TaskSettings { tolerance_m: 0.02, targets_m: vec![[1.0, 0.0, 0.0]; 3] };
        read(
            Path::new("r.toml"),
            (steps.step, &step_lines(Path::new("r.toml"), text)),
            CaptureSettings::default(),
            &task,
        )
    }

    fn problem(text: &str) -> String {
        script(text).err().expect("refused").to_string()
    }

    const LOOP: &str = "[[step]]\ndo = \"capture\"\n[[step]]\ndo = \"calibrate\"\n";

    #[test]
    fn steps_come_in_their_order_and_faults_stay_unread() {
        let text =
            format!("{LOOP}[[step]]\ndo = \"fault\"\nkind = \"anything\"\n[[step]]\ndo = \"reach\"\ntargets = [2]\n");
        let script = script(&text).expect("a script");
        let names: Vec<_> = script.steps.iter().map(Step::name).collect();
        assert_eq!(names, ["capture", "calibrate", "fault", "reach"]);
        assert_eq!(script.faults[0]["kind"].as_str(), Some("anything"));
        assert!(matches!(&script.steps[3], Step::Reach(reach) if reach.targets == [2]));
    }

    #[test]
    fn a_capture_takes_what_it_does_not_say_from_the_general_settings() {
        let script = script("[[step]]\ndo = \"capture\"\nposes = 7\n[[step]]\ndo = \"calibrate\"").expect("a script");
        let Step::Capture(capture) = &script.steps[0] else { panic!("a capture") };
        assert_eq!((capture.poses, capture.held_out), (7, CaptureSettings::default().held_out));
    }

    /// The last of every three tasks passes tags, with one configuration after the other, and none does in a gap.
    #[test]
    fn work_passes_tags_in_a_third_of_its_tasks_and_in_no_gap() {
        let text = "[[step]]\ndo = \"work\"\ntasks = 12\nlooks_rad = [[0.1], [0.2]]\ngaps_s = [[1200.0, 3600.0]]\n";
        let script = script(&format!("{LOOP}{text}")).expect("a script");
        let Step::Work(work) = &script.steps[2] else { panic!("work") };
        let looks: Vec<_> = (0..work.tasks).filter_map(|task| Some((task, work.look_of(task)?))).collect();
        assert_eq!(looks, [(8, 0), (11, 1)]);
        assert_eq!((work.duration_s(), &work.targets[..], &work.rest), (7200.0, &[0, 1, 2][..], &MoveGoal::Stowed));
        assert_eq!(WorkSettings { looks_rad: Vec::new(), ..work.clone() }.look_of(8), None);
    }

    /// Each mistake is reported with its line, its step, and the likeliest name.
    #[test]
    fn mistakes_are_named_by_step_key_and_what_would_be_right() {
        let misnamed = format!("# a comment\n{LOOP}\n[[step]]\ndo = \"wait\"\nsecond = 3.0\n");
        let again = format!("{LOOP}[[step]]\ndo = \"calibrate\"");
        let cases = [
            "\n[[step]]\ndo = \"captur\"",
            &misnamed,
            &again,
            "[[step]]\ndo = \"touch\"\npart = \"bar\"",
            "[[step]]\ndo = \"dance\"",
            "[[step]]\nposes = 3",
            "[[step]]\ndo = 3",
            "[[step]]\ndo = \"wait\"",
            "[[step]]\ndo = \"wait\"\nseconds = -1.0",
            "[[step]]\ndo = \"move\"",
            "[[step]]\ndo = \"reach\"\ntargets = [3]",
            "[[step]]\ndo = \"reach\"\ntargets = []",
            "[[step]]\ndo = \"work\"",
            "[[step]]\ndo = \"work\"\ntasks = 0",
            "[[step]]\ndo = \"work\"\ntasks = 2\ntargets = [7]",
            "[[step]]\ndo = \"work\"\ntasks = 2\ngaps_s = [[9.0, 4.0]]",
            "[[step]]\ndo = \"work\"\ntasks = 2\nlook_every = 0",
            "[[step]]\ndo = \"work\"\ntasks = 2\nbelief = \"hope\"",
            "[[step]]\ndo = \"work\"\ntasks = 2\nposes = 21",
            "[[step]]\ndo = \"grip\"",
            "[[step]]\ndo = \"grip\"\nopening = 1.5",
            "[[step]]\ndo = \"touch\"",
            "[[step]]\ndo = \"touch\"\npart = \"bar\"\npoint_m = [1.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 2.0]",
            "[[step]]\ndo = \"touch\"\npart = \"bar\"\npoint_m = [1, 0, 0]\nnormal = [0, 0, 1]\nstd_m = 0.0",
            "[[step]]\ndo = \"capture\"\nposes = 1",
            "[[step]]\ndo = \"capture\"\npose = 30",
            "[[step]]\ndo = \"calibrate\"",
            "[[step]]\ndo = \"capture\"\n[[step]]\ndo = \"recalibrate\"",
            "[[step]]\ndo = \"reach\"",
            "[[step]]\ndo = \"assert\"\ntool_error_m = 0.01",
            "[[step]]\ndo = \"assert\"\nheld_out_rms_m = 0.01",
            "[[step]]\ndo = \"assert\"",
            "[[step]]\ndo = \"assert\"\ntool_eror_m = 0.01",
            "[[step]]\ndo = \"move\"\nto = \"stowed\"\n[[step]]\ndo = \"identify\"\njoint = \"j\"",
        ];
        let told = cases.map(|text| format!("{text:?}\n  {}\n", problem(text)));
        insta::assert_snapshot!("script", told.concat());
        assert!(script(&format!("{LOOP}{LOOP}")).is_ok());
    }
}
