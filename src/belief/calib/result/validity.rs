//! Where a calibration holds: what a configuration, a task or the conditions have beyond the captured views.

use crate::calib::result::calibration::{Calibration, JointResult};
use crate::calib::result::valid_range::{ordered, past};
use armcal_core::sensor::Conditions;
use armcal_core::streams::JointAngles;

/// Excess of an angle that is not reported, rad. Assumed.
const MARGIN_RAD: f64 = 0.05;

impl Calibration {
    /// In words, what `angles` (of as many joints as there are, base first) under `conditions` have beyond what the
    /// calibration saw; nothing where all is within it. Joints of which nothing was estimated have no range, and what
    /// is unknown is not beyond.
    #[must_use]
    pub fn beyond(&self, angles: &JointAngles, conditions: &Conditions) -> Vec<String> {
        let joints = self.joint.iter().zip(angles.iter()).filter(|(j, _)| j.gain_estimated || j.offset_estimated);
        let of_joint = |(joint, angle_rad): (&JointResult, &f64)| {
            let [low, high] = ordered(joint.covered_rad);
            let by_rad = past(*angle_rad, [low, high]);
            (by_rad > MARGIN_RAD).then(|| {
                format!("{} at {angle_rad:.2} rad is {by_rad:.2} rad beyond {low:.2} .. {high:.2}", joint.name)
            })
        };
        let mut beyond: Vec<String> = joints.filter_map(of_joint).collect();
        beyond.extend(self.valid.beyond(conditions));
        beyond
    }

    /// In words, what it is valid for.
    #[must_use]
    pub fn valid_for(&self) -> Vec<String> {
        let joints = self.joint.iter().filter(|joint| joint.gain_estimated || joint.offset_estimated);
        let one = |joint: &JointResult| {
            let [low, high] = ordered(joint.covered_rad);
            format!("{} {low:.2} .. {high:.2} rad", joint.name)
        };
        joints.map(one).chain(self.valid.in_words()).collect()
    }
}

/// Joint by joint, how many of a task's postures go how far beyond what the views covered; nothing where all are within
/// it.
pub(crate) fn not_covered(calibration: &Calibration, postures: &[JointAngles]) -> Vec<String> {
    let joints = calibration.joint.iter().enumerate().filter(|(_, j)| j.gain_estimated || j.offset_estimated);
    let of_joint = |(joint, result): (usize, &JointResult)| {
        let [low, high] = ordered(result.covered_rad);
        let beyond = postures.iter().map(|angles| past(angles[joint], [low, high])).filter(|by| *by > MARGIN_RAD);
        let (n, most) = beyond.fold((0usize, 0.0_f64), |(n, most), by| (n + 1, most.max(by)));
        let (name, all) = (&result.name, postures.len());
        let unit = result.moves.unit();
        let [most, low, high] = [unit.shown(most, 0), unit.number(low, 0), unit.shown(high, 0)];
        let words = || format!("{name}: {n} of {all} targets lie up to {most} beyond {low} .. {high}");
        (n > 0).then(words)
    };
    joints.filter_map(of_joint).collect()
}
