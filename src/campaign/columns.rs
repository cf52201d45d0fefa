//! The columns of a campaign's table: the metrics, then the joints' errors.

use crate::campaign::metric::Metric;
use crate::report::RunSummary;
use crate::run::Finished;
use armcal_core::units::Unit;

const JOINT_BEFORE: &str = "joint_error_before_rad.";
const JOINT_AFTER: &str = "joint_error_after_rad.";

/// The figures of a campaign: the same for every run, then two for each joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    joints: Vec<String>,
}

impl Columns {
    /// `joints`: names over all robots of the campaign; one that a run's robot lacks has no value there.
    #[must_use]
    pub fn new(joints: Vec<String>) -> Self {
        Self { joints }
    }

    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let fixed = Metric::ALL.iter().map(|metric| metric.name().to_owned());
        let joints =
            self.joints.iter().flat_map(|joint| [JOINT_BEFORE, JOINT_AFTER].map(|what| format!("{what}{joint}")));
        fixed.chain(joints).collect()
    }

    /// What a column is measured in, by its name; columns of other versions are numbers without a unit.
    #[must_use]
    pub fn unit(name: &str) -> Unit {
        let of_joint = [JOINT_BEFORE, JOINT_AFTER].iter().any(|what| name.starts_with(what));
        Metric::of_name(name).map_or(if of_joint { Unit::Radians } else { Unit::None }, Metric::unit)
    }

    /// The figures of a run, in the order of [`Self::names`].
    #[must_use]
    pub fn figures(&self, finished: &Finished) -> Vec<Option<f64>> {
        let joints = self.joints.iter().flat_map(|joint| joint_errors_rad(&finished.summary, joint));
        Metric::ALL.iter().map(|metric| metric.of(finished)).chain(joints).collect()
    }
}

fn joint_errors_rad(summary: &RunSummary, name: &str) -> [Option<f64>; 2] {
    let joint = summary.score.as_ref().and_then(|score| score.joints.iter().find(|joint| joint.name == name));
    joint.map_or([None, None], |joint| [joint.angle_error_before_rad, joint.angle_error_after_rad])
}
