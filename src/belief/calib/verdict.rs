//! Accept or refuse: the held-out views decide, never the fit's own residuals.

use super::methods::SolveOutcome;
use armcal_core::robot::Robot;

/// What the verdict rests on.
#[derive(Clone, Copy, Debug)]
pub struct AcceptanceData {
    pub outcome: SolveOutcome,
    pub held_out_views: usize,
    pub held_out_rms_m: Option<f64>,
    /// The same views with the datasheet's sensors.
    pub held_out_nominal_rms_m: Option<f64>,
    pub fit_rms_m: f64,
    /// Wanted of the sensors that move the camera, whether these views determine them or not.
    pub n_parameters: usize,
    pub fit_views: usize,
    /// 95th percentile over the task's targets; `None` without a task.
    pub predicted_tool_error_m: Option<f64>,
    pub tolerance_m: Option<f64>,
}

/// Fewer views say nothing about views not seen.
pub const MIN_HELD_OUT_VIEWS: usize = 3;
/// Held-out views this much worse than fitted ones mean that the fit learnt its own noise.
const MAX_HELD_OUT_OVER_FIT: f64 = 2.5;
/// Each view adds about three numbers that do not share its camera-pose error; fewer views than parameters overfit.
pub const MIN_VIEWS_PER_PARAMETER: f64 = 1.0;

/// The fewest fitted views that a calibration of all joints before the camera, from the datasheet, is accepted with.
#[must_use]
pub fn fewest_views(robot: &Robot) -> usize {
    (MIN_VIEWS_PER_PARAMETER * 2.0 * robot.camera.mount.n_joints as f64).ceil() as usize
}

/// `None` to accept, else the reason to refuse, with the figures.
#[must_use]
pub fn refusal(e: &AcceptanceData) -> Option<String> {
    if (e.fit_views as f64) < MIN_VIEWS_PER_PARAMETER * e.n_parameters as f64 {
        let (views, n) = (e.fit_views, e.n_parameters);
        return Some(format!("{views} views to fit are too few for {n} parameters, however many tags each shows"));
    }
    if e.outcome != SolveOutcome::Converged {
        return Some(format!("the solver {}", e.outcome.name()));
    }
    if e.held_out_views < MIN_HELD_OUT_VIEWS {
        let seen = e.held_out_views;
        return Some(format!("only {seen} held-out views show a tag; {MIN_HELD_OUT_VIEWS} are needed for a verdict"));
    }
    let (Some(held_out), Some(nominal)) = (e.held_out_rms_m, e.held_out_nominal_rms_m) else {
        return Some("the held-out views hold no usable tag".to_owned());
    };
    if held_out >= nominal {
        let (held_out, nominal) = (held_out * 1e3, nominal * 1e3);
        return Some(format!(
            "held-out views are no better than with the datasheet: {held_out:.1} mm against {nominal:.1} mm"
        ));
    }
    if held_out > MAX_HELD_OUT_OVER_FIT * e.fit_rms_m {
        let (held_out, fit) = (held_out * 1e3, e.fit_rms_m * 1e3);
        return Some(format!("held-out views are off by {held_out:.1} mm, fitted ones by {fit:.1} mm: overfitted"));
    }
    if let (Some(predicted), Some(tolerance)) = (e.predicted_tool_error_m, e.tolerance_m)
        && (predicted > tolerance || predicted.is_nan())
    {
        let (predicted, tolerance) = (predicted * 1e3, tolerance * 1e3);
        return Some(format!(
            "the predicted tool error of {predicted:.1} mm exceeds the task's tolerance of {tolerance:.1} mm"
        ));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> AcceptanceData {
        AcceptanceData {
            outcome: SolveOutcome::Converged,
            held_out_views: 8,
            held_out_rms_m: Some(0.004),
            held_out_nominal_rms_m: Some(0.08),
            fit_rms_m: 0.004,
            n_parameters: 10,
            fit_views: 30,
            predicted_tool_error_m: Some(0.003),
            tolerance_m: Some(0.02),
        }
    }

    #[test]
    fn each_single_fault_refuses_and_none_accepts() {
        assert_eq!(refusal(&good()), None);
        let faults = [
            AcceptanceData { outcome: SolveOutcome::Stalled, ..good() },
            AcceptanceData { fit_views: 8, ..good() },
            AcceptanceData { held_out_views: 2, ..good() },
            AcceptanceData { held_out_rms_m: None, ..good() },
            AcceptanceData { held_out_rms_m: Some(0.09), ..good() },
            AcceptanceData { held_out_rms_m: Some(0.011), ..good() },
            AcceptanceData { predicted_tool_error_m: Some(0.03), ..good() },
            AcceptanceData { predicted_tool_error_m: Some(f64::NAN), ..good() },
        ];
        for fault in faults {
            assert!(refusal(&fault).is_some(), "{fault:?} must be refused");
        }
    }
}
