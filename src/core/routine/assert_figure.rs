//! Figures of a run that an `assert` step can limit.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::units::Unit;

/// A figure of a run, as routines and summary.json name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum AssertFigure {
    /// Root mean square over the held-out views of the last calibration, m.
    #[serde(rename = "held_out_rms_m")]
    HeldOutRms,
    /// Root mean square over the held-out views of the last calibration, px.
    #[serde(rename = "held_out_rms_px")]
    HeldOutReprojection,
    /// 95th percentile of the tool error over the task's targets, as the last calibration predicts it.
    #[serde(rename = "predicted_tool_error_m")]
    PredictedToolError,
    /// Simulated time since the start.
    #[serde(rename = "simulated_s")]
    SimulatedTime,
    /// Median tool error over the targets of the last reach.
    #[serde(rename = "tool_error_m")]
    ToolError,
    /// Median distance between target and tool in the last reach.
    #[serde(rename = "reach_error_m")]
    ReachError,
    /// Largest distance between target and tool in the last reach.
    #[serde(rename = "reach_error_max_m")]
    WorstReachError,
    /// Smallest clearance between the arm and anything else since the start.
    #[serde(rename = "clearance_m")]
    Clearance,
    /// Number of contacts since the start.
    #[serde(rename = "contacts")]
    Contacts,
    /// Targets within the tolerance in the last reach; the limit is a minimum.
    #[serde(rename = "hits")]
    Hits,
    /// Number of targets abandoned since the start.
    #[serde(rename = "targets_skipped")]
    TargetsSkipped,
    /// Views captured since the start; the limit is a minimum.
    #[serde(rename = "poses")]
    Poses,
    /// Number of poses abandoned since the start.
    #[serde(rename = "poses_skipped")]
    PosesSkipped,
}

/// Largest limit, in the unit of its figure.
pub(super) const MAX_LIMIT: f64 = 1e9;

/// Event that must precede a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    Nothing,
    Calibration,
    Reach,
}

impl AssertFigure {
    /// Returns the key that routines use.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::HeldOutRms => "held_out_rms_m",
            Self::HeldOutReprojection => "held_out_rms_px",
            Self::PredictedToolError => "predicted_tool_error_m",
            Self::SimulatedTime => "simulated_s",
            Self::ToolError => "tool_error_m",
            Self::ReachError => "reach_error_m",
            Self::WorstReachError => "reach_error_max_m",
            Self::Clearance => "clearance_m",
            Self::Contacts => "contacts",
            Self::Hits => "hits",
            Self::TargetsSkipped => "targets_skipped",
            Self::Poses => "poses",
            Self::PosesSkipped => "poses_skipped",
        }
    }

    /// Unit of the figure's value and limit.
    #[must_use]
    pub const fn unit(self) -> Unit {
        match self {
            Self::HeldOutReprojection => Unit::Pixels,
            Self::SimulatedTime => Unit::Seconds,
            Self::Contacts | Self::Hits | Self::TargetsSkipped | Self::Poses | Self::PosesSkipped => Unit::Count,
            Self::HeldOutRms
            | Self::PredictedToolError
            | Self::ToolError
            | Self::ReachError
            | Self::WorstReachError
            | Self::Clearance => Unit::Metres,
        }
    }

    /// Returns the event that must precede the figure's value.
    #[must_use]
    pub const fn needs(self) -> Needs {
        match self {
            Self::HeldOutRms | Self::HeldOutReprojection | Self::PredictedToolError => Needs::Calibration,
            Self::ToolError | Self::ReachError | Self::WorstReachError | Self::Hits => Needs::Reach,
            Self::SimulatedTime
            | Self::Clearance
            | Self::Contacts
            | Self::TargetsSkipped
            | Self::Poses
            | Self::PosesSkipped => Needs::Nothing,
        }
    }

    /// Returns true if the limit holds. It is a minimum for clearance, hits and poses, and a maximum for all others.
    #[must_use]
    pub fn holds(self, value: f64, limit: f64) -> bool {
        match self {
            Self::Clearance | Self::Hits | Self::Poses => value >= limit,
            _ => value <= limit,
        }
    }
}

impl fmt::Display for AssertFigure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.key())
    }
}

/// Limits of an `assert` step: figures with their limits, in the order of [`AssertFigure`].
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct AssertLimits(BTreeMap<AssertFigure, f64>);

impl AssertLimits {
    /// Every limit with its figure.
    pub fn each(&self) -> impl Iterator<Item = (AssertFigure, f64)> {
        self.0.iter().map(|(figure, limit)| (*figure, *limit))
    }

    /// Returns true if no figure has a limit.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns true if any of the figures needs the event `what`.
    #[must_use]
    pub fn need(&self, what: Needs) -> bool {
        self.0.keys().any(|figure| figure.needs() == what)
    }
}

/// The schema is a table with one key per figure.
impl JsonSchema for AssertLimits {
    fn schema_name() -> Cow<'static, str> {
        "AssertLimits".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let figures = AssertFigure::json_schema(generator);
        let keys = figures.get("oneOf").and_then(|figures| figures.as_array()).into_iter().flatten();
        let limit = |figure: &Value| {
            let key = figure["const"].as_str()?.to_owned();
            let text = &figure["description"];
            Some((key, json!({ "type": "number", "minimum": 0.0, "maximum": MAX_LIMIT, "description": text })))
        };
        let keys: Map<String, Value> = keys.filter_map(limit).collect();
        json_schema!({ "type": "object", "properties": keys, "additionalProperties": false })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_key_in_code_is_the_key_in_files() {
        let text = "contacts = 0.0\nclearance_m = 0.1\nheld_out_rms_m = 0.01\nsimulated_s = 9.0\nreach_error_m = 1.0\n\
                    reach_error_max_m = 1.0\ntool_error_m = 1.0\npredicted_tool_error_m = 1.0\nheld_out_rms_px = 2.0\n\
                    hits = 4\ntargets_skipped = 0\nposes = 10\nposes_skipped = 2";
        let limits: AssertLimits = toml::from_str(text).expect("all keys");
        assert_eq!(limits.each().count(), 13);
        for (figure, _) in limits.each() {
            assert_eq!(toml::Value::try_from(figure).expect("a name").as_str(), Some(figure.key()));
        }
    }
}
