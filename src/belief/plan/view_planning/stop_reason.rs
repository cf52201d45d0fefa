//! Stop criterion of a capture.

use armcal_core::routine::CaptureSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Reason why a capture ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The predicted tool error at the task (root mean square) is at most `capture.stop_at_tool_error_m`.
    ToolError,
    /// `capture.poses` views are captured.
    Poses,
    /// `capture.max_time_s` has passed.
    Time,
    /// No configuration is left that shows enough tags and keeps clear.
    NoPoseLeft,
}

/// Progress of a capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CaptureState {
    /// Number of fitted views captured.
    pub captured: usize,
    /// Number of poses that may still be visited.
    pub left: usize,
    /// Arm time since the start of the capture, s.
    pub elapsed_s: f64,
    /// Predicted root mean square tool error at the task's targets, m; `None` if nothing has been estimated.
    pub predicted_tool_error_m: Option<f64>,
}

impl StopReason {
    /// Returns the reason to end a capture at `state`, the achieved accuracy first; `None`: continue.
    #[must_use]
    pub fn decide(capture: &CaptureSettings, state: &CaptureState) -> Option<Self> {
        if let (Some(limit_m), Some(predicted_m)) = (capture.stop_at_tool_error_m, state.predicted_tool_error_m)
            && predicted_m <= limit_m
        {
            return Some(Self::ToolError);
        }
        if state.captured >= capture.poses as usize {
            return Some(Self::Poses);
        }
        if capture.max_time_s.is_some_and(|limit_s| state.elapsed_s >= limit_s) {
            return Some(Self::Time);
        }
        (state.left == 0).then_some(Self::NoPoseLeft)
    }
}

impl std::fmt::Display for StopReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::ToolError => write!(f, "predicted tool error has reached stop_at_tool_error_m"),
            Self::Poses => write!(f, "all planned views captured"),
            Self::Time => write!(f, "max_time_s has passed"),
            Self::NoPoseLeft => write!(f, "no pose is left that sees enough tags and keeps clear"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(more: &str) -> CaptureSettings {
        toml::from_str(&format!("poses = 10\n{more}")).expect("settings")
    }

    #[test]
    fn the_first_reason_that_holds_is_given() {
        let going = CaptureState { captured: 4, left: 20, elapsed_s: 100.0, predicted_tool_error_m: Some(0.003) };
        let both = settings("stop_at_tool_error_m = 0.002\nmax_time_s = 200.0");
        assert_eq!(StopReason::decide(&both, &going), None);
        let good = CaptureState { predicted_tool_error_m: Some(0.0019), captured: 10, left: 0, elapsed_s: 1e3 };
        assert_eq!(StopReason::decide(&both, &good), Some(StopReason::ToolError));
        assert_eq!(StopReason::decide(&settings(""), &good), Some(StopReason::Poses));
        assert_eq!(StopReason::decide(&settings(""), &CaptureState { captured: 9, left: 1, ..good }), None);
        assert_eq!(StopReason::decide(&both, &CaptureState { elapsed_s: 200.0, ..going }), Some(StopReason::Time));
        assert_eq!(StopReason::decide(&both, &CaptureState { left: 0, ..going }), Some(StopReason::NoPoseLeft));
        let unknown = CaptureState { predicted_tool_error_m: None, ..going };
        assert_eq!(StopReason::decide(&both, &unknown), None);
    }
}
