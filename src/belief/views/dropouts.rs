//! Removal of invalid readings of an arm at rest: momentary drop-outs of a sensor.
//!
//! One reading at the end of the track among a hundred moves their mean by more than the whole error of a calibrated
//! joint. The median is unaffected while fewer than half drop out.

use crate::views::constants::dropouts::AT_REST_RAD;
use armcal_core::stats::quantile;
use armcal_core::streams::JointAngles;

/// Replaces readings that cannot be of a joint at rest by that joint's median; all others stay as they are.
pub(crate) fn replace_dropouts(readings: &mut [JointAngles]) {
    let n_joints = readings.first().map_or(0, |angles| angles.len());
    for joint in 0..n_joints {
        let all: Vec<f64> = readings.iter().map(|angles| angles[joint]).collect();
        let (low, high) =
            all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), a| (low.min(*a), high.max(*a)));
        let Some(median) = (high - low > AT_REST_RAD).then(|| quantile(&all, 0.5)).flatten() else { continue };
        for angles in readings.iter_mut().filter(|angles| (angles[joint] - median).abs() > AT_REST_RAD) {
            angles[joint] = median;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropouts_of_one_joint_leave_its_mean_and_the_others_alone() {
        let rest = |k: usize| JointAngles::from_slice(&[1.0 + 1e-3 * (k % 3) as f64, -0.4]);
        let sound: Vec<JointAngles> = (0..61).map(rest).collect();
        let mut worn = sound.clone();
        (20..45).for_each(|k| worn[k][0] = -3.1);
        replace_dropouts(&mut worn);
        assert!((0..61).all(|k| (worn[k][0] - 1.001).abs() < 1.001e-3 && worn[k][1] == -0.4));
        assert!((0..20).all(|k| worn[k][0] == sound[k][0]));
        let mut same = sound.clone();
        replace_dropouts(&mut same);
        assert_eq!(same, sound);
    }
}
