//! Range of validity: excess of a configuration, a task or the conditions over the captured views.

use crate::file::constants::validity::{MARGIN_RAD, MAX_EXTRAPOLATION, MIN_LEVER_M};
use std::collections::BTreeSet;

use crate::file::calibration::{Calibration, JointResult};
use crate::file::valid_range::{ordered, past};
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::sensor::Conditions;
use armcal_core::streams::JointAngles;

impl Calibration {
    /// Returns, in words, the excess of `angles` (one for each joint, base first) and `conditions` over the captured
    /// range; empty within it. Joints without estimated parameters have no range, and unknown conditions count as
    /// inside.
    #[must_use]
    pub fn beyond(&self, angles: &JointAngles, conditions: &Conditions) -> Vec<String> {
        let joints = self.joint.iter().zip(angles.iter()).filter(|(j, _)| j.gain_estimated || j.offset_estimated);
        let of_joint = |(joint, angle_rad): (&JointResult, &f64)| {
            let [low, high] = ordered(joint.covered_rad);
            let by_rad = past(*angle_rad, [low, high]);
            let (name, unit) = (&joint.name, joint.moves.si());
            (by_rad > MARGIN_RAD)
                .then(|| format!("{name} at {angle_rad:.2} {unit} is {by_rad:.2} {unit} beyond {low:.2} .. {high:.2}"))
        };
        let mut beyond: Vec<String> = joints.filter_map(of_joint).collect();
        beyond.extend(self.valid.beyond(conditions));
        beyond
    }

    /// Returns the range of validity in words.
    #[must_use]
    pub fn valid_for(&self) -> Vec<String> {
        let joints = self.joint.iter().filter(|joint| joint.gain_estimated || joint.offset_estimated);
        let one = |joint: &JointResult| {
            let [low, high] = ordered(joint.covered_rad);
            format!("{} {low:.2} .. {high:.2} {}", joint.name, joint.moves.si())
        };
        joints.map(one).chain(self.valid.in_words()).collect()
    }
}

/// Configurations at the targets of a task, by number from 0, compared with the angles that the views covered.
pub(crate) struct Extrapolation<'a> {
    calibration: &'a Calibration,
    postures: &'a [(u32, JointAngles)],
    /// For each configuration: true for each joint that moves the tool there.
    matters: Vec<Vec<bool>>,
}

impl<'a> Extrapolation<'a> {
    pub(crate) fn new(calibration: &'a Calibration, robot: &Robot, postures: &'a [(u32, JointAngles)]) -> Self {
        let tool = |angles: &JointAngles| robot.chain.frame(angles, &robot.tool.mount).translation.vector;
        let moves = |angles: &JointAngles, joint: usize| {
            let (mut moved, by_rad) = (*angles, 1e-3);
            moved[joint] += by_rad;
            robot.sensors[joint].moves.is_slide() || (tool(&moved) - tool(angles)).norm() > by_rad * MIN_LEVER_M
        };
        let of_posture =
            |(_, angles): &(u32, JointAngles)| (0..angles.len()).map(|joint| moves(angles, joint)).collect();
        Self { calibration, postures, matters: postures.iter().map(of_posture).collect() }
    }

    /// Returns the numbers of the targets beyond the range of `joint`, and their excess.
    fn beyond(&self, joint: usize) -> Vec<(u32, f64)> {
        let range = ordered(self.calibration.joint[joint].covered_rad);
        let all = self.postures.iter().zip(&self.matters).filter(|(_, matters)| matters[joint]);
        let beyond = all.map(|((index, angles), _)| (*index, past(angles[joint], range)));
        beyond.filter(|(_, by)| *by > MARGIN_RAD).collect()
    }

    fn joints(&self) -> impl Iterator<Item = (usize, &JointResult)> {
        self.calibration.joint.iter().enumerate().filter(|(_, j)| j.gain_estimated || j.offset_estimated)
    }

    /// Returns the numbers, from 1, of the targets that are too far beyond a joint's range to be judged. None with a
    /// prior, which covers more of the range than these views; joints that are fixed do not count.
    pub(crate) fn not_judged(&self) -> Vec<usize> {
        let mut numbers = BTreeSet::new();
        if self.calibration.prior.is_some() {
            return Vec::new();
        }
        let is_held = |name: &str| {
            let mut failed = self.calibration.failed_joint.iter();
            failed.any(|failed| failed.joint == name && failed.kind != FailedKind::NotMoved)
        };
        for (joint, result) in self.joints().filter(|(_, result)| !is_held(&result.name)) {
            let [low, high] = ordered(result.covered_rad);
            let far = self.beyond(joint).into_iter().filter(|(_, by)| *by > MAX_EXTRAPOLATION * (high - low));
            numbers.extend(far.map(|(index, _)| index as usize + 1));
        }
        numbers.into_iter().collect()
    }

    /// Names, joint by joint, the targets whose configurations exceed the captured angles, and the excess.
    pub(crate) fn in_words(&self) -> Vec<String> {
        let of_joint = |(joint, result): (usize, &JointResult)| {
            let beyond = self.beyond(joint);
            let most = beyond.iter().map(|(_, by)| *by).reduce(f64::max)?;
            let numbers: Vec<String> = beyond.iter().map(|(index, _)| (*index + 1).to_string()).collect();
            let ([low, high], unit) = (ordered(result.covered_rad), result.moves.unit());
            let [most, low, high] = [unit.shown(most, 0), unit.number(low, 0), unit.shown(high, 0)];
            let (name, n) = (&result.name, numbers.len());
            let (targets, lies) = if n == 1 { ("target", "lies") } else { ("targets", "lie up to") };
            let numbers = numbers.join(", ");
            Some(format!("{targets} {numbers} {lies} {most} beyond the captured range of {name}, {low} to {high}"))
        };
        self.joints().filter_map(of_joint).collect()
    }
}
