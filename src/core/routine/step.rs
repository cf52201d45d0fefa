//! The steps of a script.

use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::assert_figure::AssertLimits;
use super::settings::CaptureSettings;
use crate::streams::PriorSource;

/// One step of a routine's script.
#[derive(Clone, Debug)]
pub enum Step {
    /// Goes somewhere by a certified path.
    Move(MoveGoal),
    /// Reaches for targets of the task under the sensors believed in.
    Reach(ReachSettings),
    /// Works: targets of the task at times, tags seen by chance, rest between.
    Work(WorkSettings),
    /// Opens or closes the gripper: 0 closed, 1 open.
    Grip {
        /// 0..1 of the largest opening.
        opening: f64,
    },
    /// Plans views, visits them and records what is seen.
    Capture(CaptureSettings),
    /// Moves one joint a little and measures with the camera how many counts a radian has.
    Identify(IdentifySettings),
    /// Drives joints to their nominal end stops and records the readings there.
    Stops(StopsSettings),
    /// Touches a surveyed surface with the tool and records where the arm feels it.
    Touch(TouchSettings),
    /// Estimates the sensors from what was captured.
    Calibrate(CalibrateSettings),
    /// The arm rests while the world goes on.
    Wait {
        /// By the arm's clock.
        seconds: f64,
    },
    /// Something breaks: number `number` of the routine's faults, which only the simulator reads.
    Fault {
        /// From 0.
        number: usize,
    },
    /// Notes whether figures of the run keep their limits.
    Assert(AssertLimits),
}

impl Step {
    /// As routines name it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Move(_) => "move",
            Self::Reach(_) => "reach",
            Self::Work(_) => "work",
            Self::Grip { .. } => "grip",
            Self::Capture(_) => "capture",
            Self::Identify(_) => "identify",
            Self::Stops(_) => "stops",
            Self::Touch(_) => "touch",
            Self::Calibrate(CalibrateSettings { prior: PriorSource::Fresh, .. }) => "calibrate",
            Self::Calibrate(CalibrateSettings { prior: PriorSource::Warm, .. }) => "recalibrate",
            Self::Wait { .. } => "wait",
            Self::Fault { .. } => "fault",
            Self::Assert(_) => "assert",
        }
    }
}

/// Where a `move` goes.
#[derive(Clone, Debug, PartialEq)]
pub enum MoveGoal {
    /// The stowed pose of robot.toml.
    Stowed,
    /// Believed joint angles, rad, base first.
    Angles(Vec<f64>),
}

/// Which targets a `reach` tries.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachSettings {
    /// Numbers of the task's targets, from 0.
    pub targets: Vec<usize>,
    /// Whether the jaws close on each of them.
    pub touch: bool,
}

/// What working means.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkSettings {
    /// How many.
    pub tasks: u32,
    /// From the start of one task to that of the next.
    pub every_s: f64,
    /// Numbers of the task's targets, from 0, taken in turn.
    pub targets: Vec<usize>,
    /// Where the arm rests between tasks.
    pub rest: MoveGoal,
    /// Believed joint angles at which the work passes tags, rad, base first, taken in turn.
    pub looks_rad: Vec<Vec<f64>>,
    /// The last of so many tasks goes to its target by the next of them.
    pub look_every: u32,
    /// How long the arm stays there; it does not stop where this is 0.
    pub look_s: f64,
    /// Since the start of the step: what begins in one of these spans passes no tags.
    pub gaps_s: Vec<[f64; 2]>,
    /// No joint is driven faster.
    pub rate_rad_s: Option<f64>,
    /// What it works by.
    pub belief: WorkBelief,
    /// Calibration poses that are asked for at once where a task would miss its tolerance; none for 0.
    pub poses: u32,
}

/// What sensors a work step believes in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WorkBelief {
    /// Those of the last accepted calibration.
    #[default]
    Calibration,
    /// The online belief, by all that was recorded until then.
    Online,
}

impl WorkSettings {
    /// Time of the whole step.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        f64::from(self.tasks) * self.every_s
    }

    /// Number of the target of task `number` (from 0).
    #[must_use]
    pub fn target_of(&self, number: u32) -> usize {
        self.targets[number as usize % self.targets.len()]
    }

    /// Number of the posture by which task `number` (from 0) passes tags, if it does.
    #[must_use]
    pub fn look_of(&self, number: u32) -> Option<usize> {
        let at_s = f64::from(number) * self.every_s;
        let is_in_gap = self.gaps_s.iter().any(|[from_s, to_s]| (*from_s..*to_s).contains(&at_s));
        let is_due = (number + 1).is_multiple_of(self.look_every);
        (is_due && !is_in_gap && !self.looks_rad.is_empty())
            .then(|| (number / self.look_every) as usize % self.looks_rad.len())
    }
}

/// How the scale of one sensor is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifySettings {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// The joint turns at most this many times as far as the datasheet's scale says, either way round.
    pub gain_max: f64,
    /// First excursion, raw counts either way.
    pub travel_counts: f64,
    /// Excursion once the scale is roughly known, rad either way.
    pub swing_rad: f64,
    /// Views of the second excursion.
    pub views: u32,
}

/// Which joints are driven to their end stops.
#[derive(Clone, Debug, PartialEq)]
pub struct StopsSettings {
    /// By name; all that have stops where none is named.
    pub joints: Vec<String>,
    /// How long the readings at a stop are averaged.
    pub dwell_s: f64,
}

/// A plane that the tool's tip touches.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchSettings {
    /// The vehicle's part that carries it.
    pub part: String,
    /// Where it is touched, base frame.
    pub point_m: [f64; 3],
    /// Out of the surface, unit length, base frame.
    pub normal: [f64; 3],
    /// One sigma along the normal: of the survey and of what is felt.
    pub std_m: f64,
    /// From this far on the tip comes slowly.
    pub approach_m: f64,
    /// How long the arm rests there.
    pub dwell_s: f64,
}

impl TouchSettings {
    /// The place that is touched, and so far out of the surface, base frame.
    #[must_use]
    pub fn point_at(&self, out_m: f64) -> Point3<f64> {
        Point3::from(self.point_m) + Vector3::from(self.normal) * out_m
    }
}

/// Settings of `calibrate` and `recalibrate`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateSettings {
    /// Fresh for `calibrate`, warm for `recalibrate`.
    pub prior: PriorSource,
    /// Captured views that it uses.
    pub views: CalibrateViews,
    /// What happens if it is refused.
    pub on_refusal: OnRefusal,
}

/// Which captured views a calibration uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CalibrateViews {
    /// Those since the last calibration.
    #[default]
    New,
    /// Every one since the start.
    All,
}

/// What happens after a refused calibration; the arm keeps the sensors that it believed in either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnRefusal {
    /// The script ends there.
    #[default]
    Stop,
    /// The script goes on.
    Continue,
}
