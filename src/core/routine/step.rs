//! The steps of a script.

use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::assert_figure::AssertLimits;
use super::settings::CaptureSettings;
use crate::streams::PriorSource;

/// A step of a routine's script.
#[derive(Clone, Debug)]
pub enum Step {
    /// Moves the arm to a goal by a certified path.
    Move(MoveGoal),
    /// Reaches for targets of the task by the present sensor models.
    Reach(ReachSettings),
    /// Works: reaches targets of the task at times, detects tags by chance, and rests in between.
    Work(WorkSettings),
    /// Opens or closes the gripper: 0 closed, 1 open.
    Grip {
        /// Share of the largest opening, 0..1.
        opening: f64,
    },
    /// Plans views, visits them and records the detections.
    Capture(CaptureSettings),
    /// Moves one joint a little and measures with the camera the counts per radian.
    Identify(IdentifySettings),
    /// Drives joints to their nominal end stops and records the readings there.
    Stops(StopsSettings),
    /// Touches a surveyed surface with the tool and records where the arm feels it.
    Touch(TouchSettings),
    /// Estimates the sensors from the captured views.
    Calibrate(CalibrateSettings),
    /// Rests the arm while the world goes on.
    Wait {
        /// Time by the arm's clock.
        seconds: f64,
    },
    /// Triggers number `number` of the routine's faults, which only the simulator reads.
    Fault {
        /// Number of the fault, from 0.
        number: usize,
    },
    /// Records whether figures of the run keep their limits.
    Assert(AssertLimits),
}

impl Step {
    /// Returns the name that routines use.
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

/// Goal of a `move`.
#[derive(Clone, Debug, PartialEq)]
pub enum MoveGoal {
    /// The stowed pose of robot.toml.
    Stowed,
    /// Estimated joint angles, rad, base first.
    Angles(Vec<f64>),
}

/// Targets of a `reach`.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachSettings {
    /// Numbers of the task's targets, from 0.
    pub targets: Vec<usize>,
    /// True if the jaws close on each target.
    pub touch: bool,
}

/// Settings of a `work` step.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkSettings {
    /// Number of tasks.
    pub tasks: u32,
    /// Time from the start of one task to that of the next.
    pub every_s: f64,
    /// Numbers of the task's targets, from 0, taken in turn.
    pub targets: Vec<usize>,
    /// Configuration of the arm between tasks.
    pub rest: MoveGoal,
    /// Estimated joint angles of configurations that pass tags, rad, base first, taken in turn.
    pub looks_rad: Vec<Vec<f64>>,
    /// Interval of tasks that pass tags: the last of every `look_every` tasks goes to its target by the next
    /// configuration.
    pub look_every: u32,
    /// Time that the arm stays at such a configuration; 0: it does not stop.
    pub look_s: f64,
    /// Spans [from, to] since the start of the step; tasks that begin in one of them pass no tags.
    pub gaps_s: Vec<[f64; 2]>,
    /// Largest rate of every joint.
    pub rate_rad_s: Option<f64>,
    /// Sensor models that the arm works by.
    pub belief: WorkBelief,
    /// Number of calibration poses requested at once if a task would miss its tolerance; 0: none.
    pub poses: u32,
}

/// Source of the sensor models of a work step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WorkBelief {
    /// The last accepted calibration.
    #[default]
    Calibration,
    /// The online estimate from everything recorded until then.
    Online,
}

impl WorkSettings {
    /// Returns the duration of the whole step.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        f64::from(self.tasks) * self.every_s
    }

    /// Returns the number of the target of task `number` (from 0).
    #[must_use]
    pub fn target_of(&self, number: u32) -> usize {
        self.targets[number as usize % self.targets.len()]
    }

    /// Returns the index of the configuration by which task `number` (from 0) passes tags, if it does.
    #[must_use]
    pub fn look_of(&self, number: u32) -> Option<usize> {
        let at_s = f64::from(number) * self.every_s;
        let is_in_gap = self.gaps_s.iter().any(|[from_s, to_s]| (*from_s..*to_s).contains(&at_s));
        let is_due = (number + 1).is_multiple_of(self.look_every);
        (is_due && !is_in_gap && !self.looks_rad.is_empty())
            .then(|| (number / self.look_every) as usize % self.looks_rad.len())
    }
}

/// Settings of the measurement of one sensor's scale.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifySettings {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Largest ratio of the joint's rotation to that by the datasheet's scale, in either direction.
    pub gain_max: f64,
    /// First excursion in either direction, raw counts.
    pub travel_counts: f64,
    /// Excursion in either direction once the scale is roughly known, rad.
    pub swing_rad: f64,
    /// Views of the second excursion.
    pub views: u32,
}

/// Settings of the joints' motion to their end stops.
#[derive(Clone, Debug, PartialEq)]
pub struct StopsSettings {
    /// Names of the joints; empty: all that have stops.
    pub joints: Vec<String>,
    /// Time over which the readings at a stop are averaged.
    pub dwell_s: f64,
}

/// A plane that the tool's tip touches.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchSettings {
    /// Part of the vehicle that carries the plane.
    pub part: String,
    /// Point of contact, base frame.
    pub point_m: [f64; 3],
    /// Unit normal out of the surface, base frame.
    pub normal: [f64; 3],
    /// Standard deviation along the normal, of the survey and the contact together.
    pub std_m: f64,
    /// Distance from the surface at which the slow approach begins.
    pub approach_m: f64,
    /// Time that the arm rests in contact.
    pub dwell_s: f64,
}

impl TouchSettings {
    /// Returns the point at distance `out_m` out of the surface from the point of contact, base frame.
    #[must_use]
    pub fn point_at(&self, out_m: f64) -> Point3<f64> {
        Point3::from(self.point_m) + Vector3::from(self.normal) * out_m
    }
}

/// Settings of `calibrate` and `recalibrate`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateSettings {
    /// Prior of the calibration: fresh for `calibrate`, warm for `recalibrate`.
    pub prior: PriorSource,
    /// Captured views that the calibration uses.
    pub views: CalibrateViews,
    /// Action after a refusal.
    pub on_refusal: OnRefusal,
}

/// Captured views that a calibration uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CalibrateViews {
    /// Views since the last calibration.
    #[default]
    New,
    /// All views since the start.
    All,
}

/// Action after a refused calibration; in either case the arm keeps its previous sensor models.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnRefusal {
    /// The script ends.
    #[default]
    Stop,
    /// The script continues.
    Continue,
}
