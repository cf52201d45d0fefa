//! The columns of a campaign's table: the metrics, then the joints' errors, then each target's.

use crate::campaign::metric::Metric;
use crate::report::RunSummary;
use crate::run::Finished;
use armcal_core::units::Unit;

const JOINT_BEFORE: &str = "joint_error_before_rad.";
const JOINT_AFTER: &str = "joint_error_after_rad.";
const TARGET_U95: &str = "u95_m.";
const TARGET_ERROR: &str = "tool_error_after_m.";
const TARGET_P_LARGER: &str = "p_larger_error.";

/// Figures of a campaign: the same ones for every run, then two for each joint and three for each target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    joints: Vec<String>,
    n_targets: usize,
}

impl Columns {
    /// Builds the columns. `joints` are the names over all robots of the campaign; a run whose robot lacks a joint has
    /// no value there. `n_targets` is that of the longest task.
    #[must_use]
    pub fn new(joints: Vec<String>, n_targets: usize) -> Self {
        Self { joints, n_targets }
    }

    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let fixed = Metric::ALL.iter().map(|metric| metric.name().to_owned());
        let joints =
            self.joints.iter().flat_map(|joint| [JOINT_BEFORE, JOINT_AFTER].map(|what| format!("{what}{joint}")));
        let of_target = [TARGET_U95, TARGET_ERROR, TARGET_P_LARGER];
        let targets = (0..self.n_targets).flat_map(|target| of_target.map(|what| format!("{what}{target}")));
        fixed.chain(joints).chain(targets).collect()
    }

    /// Unit of a column, by its name; columns of other versions are numbers without a unit.
    #[must_use]
    pub fn unit(name: &str) -> Unit {
        let begins = |all: &[&str]| all.iter().any(|what| name.starts_with(what));
        Metric::of_name(name).map_or_else(
            || match name {
                _ if begins(&[JOINT_BEFORE, JOINT_AFTER]) => Unit::Radians,
                _ if begins(&[TARGET_U95, TARGET_ERROR]) => Unit::Metres,
                _ => Unit::None,
            },
            Metric::unit,
        )
    }

    /// The figures of a run, in the order of [`Self::names`].
    #[must_use]
    pub fn figures(&self, finished: &Finished) -> Vec<Option<f64>> {
        let joints = self.joints.iter().flat_map(|joint| joint_errors_rad(&finished.summary, joint));
        let targets = (0..self.n_targets).flat_map(|target| target_figures(&finished.summary, target));
        Metric::ALL.iter().map(|metric| metric.of(finished)).chain(joints).chain(targets).collect()
    }
}

fn joint_errors_rad(summary: &RunSummary, name: &str) -> [Option<f64>; 2] {
    let joint = summary.score.as_ref().and_then(|score| score.joints.iter().find(|joint| joint.name == name));
    joint.map_or([None, None], |joint| [joint.angle_error_before_rad, joint.angle_error_after_rad])
}

/// U95 at the target, true tool error after calibration, predicted probability of a larger one.
fn target_figures(summary: &RunSummary, target: usize) -> [Option<f64>; 3] {
    let u95 = summary.u95_m.targets.iter().find(|u95| u95.index == target);
    let truth = summary.score.iter().flat_map(|score| &score.targets).find(|truth| truth.target == target);
    let (error_m, p_larger) = truth.map_or((None, None), |truth| (truth.tool_error_after_m, truth.p_larger_error));
    [u95.and_then(|u95| u95.u95_m), error_m, p_larger]
}
