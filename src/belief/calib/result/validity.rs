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

/// Names, joint by joint, the targets whose postures go beyond the angles that the views covered, and by how much.
pub(crate) fn not_covered(calibration: &Calibration, postures: &[(u32, JointAngles)]) -> Vec<String> {
    let joints = calibration.joint.iter().enumerate().filter(|(_, j)| j.gain_estimated || j.offset_estimated);
    let of_joint = |(joint, result): (usize, &JointResult)| {
        let [low, high] = ordered(result.covered_rad);
        let beyond = postures.iter().map(|(index, angles)| (index, past(angles[joint], [low, high])));
        let beyond: Vec<(&u32, f64)> = beyond.filter(|(_, by)| *by > MARGIN_RAD).collect();
        let most = beyond.iter().map(|(_, by)| *by).reduce(f64::max)?;
        let numbers: Vec<String> = beyond.iter().map(|(index, _)| (*index + 1).to_string()).collect();
        let unit = result.moves.unit();
        let [most, low, high] = [unit.shown(most, 0), unit.number(low, 0), unit.shown(high, 0)];
        let (name, n) = (&result.name, numbers.len());
        let (targets, lies) = if n == 1 { ("target", "lies") } else { ("targets", "lie up to") };
        let numbers = numbers.join(", ");
        Some(format!("{targets} {numbers} {lies} {most} beyond the captured range of {name}, {low} to {high}"))
    };
    joints.filter_map(of_joint).collect()
}
