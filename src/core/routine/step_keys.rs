//! Keys of the `[[step]]` tables of a routine, by the step's name.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;

use super::assert_figure::AssertLimits;
use super::settings::{CaptureSettings, Margins, PoseCriterion};
use super::step::{CalibrateViews, OnRefusal, WorkBelief};
use crate::schema::tagged;

/// Keys of `move`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct MoveKeys {
    /// Goal: `stowed`.
    #[schemars(extend("const" = "stowed"))]
    pub to: Option<String>,
    /// Estimated joint angles, base first.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub to_rad: Option<Vec<f64>>,
}

/// Keys of `reach`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ReachKeys {
    /// Numbers of the task's targets, from 0; absent: all.
    pub targets: Option<Vec<usize>>,
    /// True if the jaws close on each target.
    #[serde(default)]
    pub touch: bool,
}

/// Keys of `work`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WorkKeys {
    /// Number of tasks.
    #[schemars(range(min = 1, max = 10_000))]
    pub tasks: u32,
    /// Time from the start of one task to that of the next.
    #[serde(default = "ten_minutes")]
    #[schemars(range(min = 1.0, max = 1e5))]
    pub every_s: f64,
    /// Numbers of the task's targets, from 0, taken in turn; absent: all.
    pub targets: Option<Vec<usize>>,
    /// Estimated joint angles between tasks, base first; absent: stowed.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub rest_rad: Option<Vec<f64>>,
    /// Configurations that pass tags, taken in turn.
    #[serde(default)]
    #[schemars(inner(inner(range(min = -100.0, max = 100.0))))]
    pub looks_rad: Vec<Vec<f64>>,
    /// Interval of tasks that pass tags: the last of every `look_every` does.
    #[serde(default = "three")]
    #[schemars(range(min = 1, max = 10_000))]
    pub look_every: u32,
    /// Time that the arm stays at such a configuration; 0: it does not stop.
    #[serde(default = "one_second")]
    #[schemars(range(min = 0.0, max = 600.0))]
    pub look_s: f64,
    /// Spans [from, to] since the start of the step without looks.
    #[serde(default)]
    #[schemars(inner(inner(range(min = 0.0, max = 1e6))))]
    pub gaps_s: Vec<[f64; 2]>,
    /// Largest rate of every joint; absent: their own.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub rate_rad_s: Option<f64>,
    /// Sensor models that the arm works by.
    #[serde(default)]
    pub belief: WorkBelief,
    /// Number of calibration poses before a task that would miss its tolerance.
    #[serde(default = "two")]
    #[schemars(range(min = 0, max = 20))]
    pub poses: u32,
}

/// Keys of `grip`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GripKeys {
    /// Share of the largest width: 0 closed, 1 open.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub opening: f64,
}

/// Keys of `capture`; an absent key has its value in `[capture]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CaptureKeys {
    poses: Option<u32>,
    held_out: Option<u32>,
    min_tags: Option<u32>,
    clearance_m: Option<f64>,
    dwell_s: Option<f64>,
    criterion: Option<PoseCriterion>,
    replan_every: Option<u32>,
    stop_at_tool_error_m: Option<f64>,
    max_time_s: Option<f64>,
    margins: Option<Margins>,
}

impl CaptureKeys {
    /// Returns the settings of the step; `general` are those of `[capture]`.
    pub fn over(self, general: CaptureSettings) -> CaptureSettings {
        CaptureSettings {
            poses: self.poses.unwrap_or(general.poses),
            held_out: self.held_out.unwrap_or(general.held_out),
            min_tags: self.min_tags.unwrap_or(general.min_tags),
            clearance_m: self.clearance_m.unwrap_or(general.clearance_m),
            dwell_s: self.dwell_s.unwrap_or(general.dwell_s),
            criterion: self.criterion.unwrap_or(general.criterion),
            replan_every: self.replan_every.unwrap_or(general.replan_every),
            stop_at_tool_error_m: self.stop_at_tool_error_m.or(general.stop_at_tool_error_m),
            max_time_s: self.max_time_s.or(general.max_time_s),
            margins: self.margins.unwrap_or(general.margins),
        }
    }
}

/// Keys of `identify`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct IdentifyKeys {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Largest ratio of the joint's rotation to that by the datasheet's scale.
    #[serde(default = "four")]
    #[schemars(range(min = 1.0, max = 20.0))]
    pub gain_max: f64,
    /// First excursion either way.
    #[serde(default = "sixty")]
    #[schemars(range(min = 1.0, max = 1e6))]
    pub travel_counts: f64,
    /// Excursion either way once the scale is roughly known.
    #[serde(default = "seven_degrees")]
    #[schemars(range(min = 0.01, max = 0.5))]
    pub swing_rad: f64,
    /// Views of the second excursion.
    #[serde(default = "nine")]
    #[schemars(range(min = 3, max = 100))]
    pub views: u32,
}

/// Keys of `stops`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StopsKeys {
    /// Names of the joints; absent: all that have stops.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Time over which the readings at a stop are averaged.
    #[serde(default = "one_second")]
    #[schemars(range(min = 0.2, max = 60.0))]
    pub dwell_s: f64,
}

/// Keys of `touch`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TouchKeys {
    /// Part of the vehicle that carries the surface.
    pub part: String,
    /// Point of the surface, base frame.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub point_m: [f64; 3],
    /// Direction out of the surface, base frame, of length 1.
    pub normal: [f64; 3],
    /// Standard deviation along the normal, of the survey and the contact together.
    #[serde(default = "one_millimetre")]
    #[schemars(range(min = 1e-5, max = 0.1))]
    pub std_m: f64,
    /// Distance from the surface at which the slow approach begins.
    #[serde(default = "ten_centimetres")]
    #[schemars(range(min = 0.05, max = 0.5))]
    pub approach_m: f64,
    /// Time that the arm rests in contact.
    #[serde(default = "one_second")]
    #[schemars(range(min = 0.2, max = 60.0))]
    pub dwell_s: f64,
}

/// Keys of `calibrate` and `recalibrate`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CalibrateKeys {
    /// Captured views that the calibration uses.
    #[serde(default)]
    pub views: CalibrateViews,
    /// Action after a refusal.
    #[serde(default)]
    pub on_refusal: OnRefusal,
}

/// Keys of `wait`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct WaitKeys {
    /// Time by the arm's clock.
    #[schemars(range(min = 0.01, max = 1e6))]
    pub seconds: f64,
}

fn one_millimetre() -> f64 {
    1e-3
}
fn ten_centimetres() -> f64 {
    0.1
}
fn seven_degrees() -> f64 {
    0.12
}
fn one_second() -> f64 {
    1.0
}
fn ten_minutes() -> f64 {
    600.0
}
fn two() -> u32 {
    2
}
fn three() -> u32 {
    3
}
fn four() -> f64 {
    4.0
}
fn nine() -> u32 {
    9
}
fn sixty() -> f64 {
    60.0
}

/// Returns the schema of the list of steps. Keys of `fault` other than its kind belong to the simulator.
pub(super) fn schema(generator: &mut SchemaGenerator) -> Schema {
    let fault = json_schema!({ "properties": { "kind": { "type": "string" } }, "required": ["kind"] });
    let mut capture = CaptureSettings::json_schema(generator);
    if let Some(keys) = capture.get_mut("properties").and_then(|keys| keys.as_object_mut()) {
        keys.values_mut().filter_map(|key| key.as_object_mut()).for_each(|key| drop(key.remove("default")));
    }
    let steps = [
        ("move", MoveKeys::json_schema(generator), "Goes to a configuration by a certified path."),
        ("reach", ReachKeys::json_schema(generator), "Reaches for targets of the task."),
        ("work", WorkKeys::json_schema(generator), "Works: a target every so often, with looks at tags between."),
        ("grip", GripKeys::json_schema(generator), "Opens or closes the gripper."),
        ("capture", capture, "Chooses views, visits and records them; absent keys are those of [capture]."),
        ("identify", IdentifyKeys::json_schema(generator), "Measures the scale and direction of one sensor."),
        ("stops", StopsKeys::json_schema(generator), "Drives joints to their end stops and records the readings."),
        ("touch", TouchKeys::json_schema(generator), "Touches a surveyed surface with the tool's tip."),
        ("calibrate", CalibrateKeys::json_schema(generator), "Calibrates from the datasheet on."),
        ("recalibrate", CalibrateKeys::json_schema(generator), "Calibrates from the last accepted calibration on."),
        ("wait", WaitKeys::json_schema(generator), "Rests while the world continues."),
        ("fault", fault, "Something breaks in the simulated world."),
        (
            "assert",
            AssertLimits::json_schema(generator),
            "Holds the run against limits, at most unless said otherwise.",
        ),
    ];
    let tables: Vec<Schema> = steps.into_iter().map(|(name, keys, text)| tagged(keys, "do", name, text)).collect();
    json_schema!({ "type": "array", "items": { "type": "object", "oneOf": tables } })
}
