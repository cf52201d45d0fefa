//! The steps of a script.

use serde::Deserialize;

use super::file::CaptureSettings;

/// One step of a routine's script.
#[derive(Clone, Debug)]
pub enum Step {
    /// Goes somewhere by a certified path.
    Move(MoveGoal),
    /// Reaches for targets of the task under the sensors believed in.
    Reach(ReachSettings),
    /// Opens or closes the gripper: 0 closed, 1 open.
    Grip {
        opening: f64,
    },
    /// Plans views, visits them and records what is seen.
    Capture(CaptureSettings),
    /// Moves one joint a little and measures with the camera how many counts a radian has.
    Identify(IdentifySettings),
    /// Drives joints to their nominal end stops and records the readings there.
    Stops(StopsSettings),
    Calibrate(CalibrateSettings),
    /// The arm rests while the world goes on.
    Wait {
        seconds: f64,
    },
    /// Something breaks: number `number` of the routine's faults, which only the simulator reads.
    Fault {
        number: usize,
    },
    Assert(AssertLimits),
}

impl Step {
    /// As routines name it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Move(_) => "move",
            Self::Reach(_) => "reach",
            Self::Grip { .. } => "grip",
            Self::Capture(_) => "capture",
            Self::Identify(_) => "identify",
            Self::Stops(_) => "stops",
            Self::Calibrate(CalibrateSettings { warm: false, .. }) => "calibrate",
            Self::Calibrate(CalibrateSettings { warm: true, .. }) => "recalibrate",
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

/// How the scale of one sensor is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct IdentifySettings {
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

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrateSettings {
    /// Start from the last accepted calibration instead of the datasheet.
    pub warm: bool,
    pub views: CalibrateViews,
    pub on_refusal: OnRefusal,
}

/// Which captured views a calibration uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CalibrateViews {
    /// Those since the last calibration.
    #[default]
    New,
    /// Every one since the start.
    All,
}

/// What happens after a refused calibration; the arm keeps the sensors that it believed in either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnRefusal {
    /// The script ends there.
    #[default]
    Stop,
    Continue,
}

/// Limits that an `assert` holds the run against; absent ones are not looked at.
///
/// The first four are known to the arm itself, the rest to the truth of a simulated arm only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssertLimits {
    /// Held-out views of the last calibration, root mean square, at most.
    pub held_out_rms_m: Option<f64>,
    pub held_out_rms_px: Option<f64>,
    /// 95th percentile over the task's targets, by the last calibration itself, at most.
    pub predicted_tool_error_m: Option<f64>,
    /// Since the start, at most.
    pub simulated_s: Option<f64>,
    /// Median over the targets of the last reach, at most.
    pub tool_error_m: Option<f64>,
    /// Median distance between target and tool in the last reach, at most.
    pub reach_error_m: Option<f64>,
    /// The worst of the last reach, at most.
    pub reach_error_max_m: Option<f64>,
    /// Between the arm and anything else, since the start, at least.
    pub clearance_m: Option<f64>,
    /// Since the start, at most.
    pub contacts: Option<f64>,
}

impl AssertLimits {
    /// Every limit with its key; in the order of the fields.
    pub fn each(&self) -> impl Iterator<Item = (&'static str, f64)> {
        [
            ("held_out_rms_m", self.held_out_rms_m),
            ("held_out_rms_px", self.held_out_rms_px),
            ("predicted_tool_error_m", self.predicted_tool_error_m),
            ("simulated_s", self.simulated_s),
            ("tool_error_m", self.tool_error_m),
            ("reach_error_m", self.reach_error_m),
            ("reach_error_max_m", self.reach_error_max_m),
            ("clearance_m", self.clearance_m),
            ("contacts", self.contacts),
        ]
        .into_iter()
        .filter_map(|(key, limit)| Some((key, limit?)))
    }
}
