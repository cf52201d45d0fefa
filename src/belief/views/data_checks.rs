//! Checks that refuse unusable recordings by name before anything is fitted.

use crate::views::constants::data_checks::{ALIKE_SHARE, MAX_NOT_FINITE_SHARE, MIN_ALIKE_VIEWS, MOVED_SIGMAS};
use crate::views::error::CalibError;
use crate::views::view::{CaptureData, ObservationRejection, View};
use armcal_core::log::{Recording, Stream};
use armcal_core::robot::{JointSensorSpec, Robot};

/// Refuses a recording of another arm.
///
/// # Errors
/// [`CalibError::JointNames`], [`CalibError::NoReadings`].
pub fn check_joints(recording: &Recording, robot: &Robot) -> Result<(), CalibError> {
    if recording.joint_names.is_empty() {
        return Err(CalibError::NoReadings { recording: recording.path.display().to_string() });
    }
    if recording.joint_names != robot.joint_names() {
        return Err(CalibError::JointNames {
            recording: recording.path.display().to_string(),
            robot: robot.name.clone(),
            recorded: recording.joint_names.clone(),
            expected: robot.joint_names(),
        });
    }
    Ok(())
}

/// Refuses stamps that go backwards, which make the assignment of readings to views ambiguous. Refuses too many numbers
/// that are not finite, which mean a failing sensor.
pub(crate) fn check_order(recording: &Recording) -> Result<(), CalibError> {
    let streams = [Stream::JointSensors, Stream::Detections];
    for stream in streams {
        let n_kept = recording.messages.iter().filter(|(_, m)| Stream::of(m) == stream).count() as u64;
        let n_read = n_kept + recording.left_in_file.get(&stream).copied().unwrap_or(0);
        let start = format!("{}: ", stream.topic());
        for (what, &n) in &recording.rejected {
            if what.starts_with(&start)
                && what.ends_with("is not finite")
                && n as f64 > MAX_NOT_FINITE_SHARE * (n_read + n) as f64
            {
                let recording = recording.path.display().to_string();
                return Err(CalibError::NotFinite { recording, what: what.clone(), n, of: n_read + n });
            }
        }
    }
    recording.stamp_regressions.iter().next().map_or(Ok(()), |(topic, disorder)| {
        let (recording, topic) = (recording.path.display().to_string(), topic.clone());
        Err(CalibError::Disorder { recording, topic, disorder: *disorder })
    })
}

/// Returns the reason why no view shows a tag: the one that rejected most detections. Motion counts only if there is no
/// other reason, because each arm moves between its poses.
pub(crate) fn no_views(recording: String, robot: &Robot, data: &CaptureData) -> CalibError {
    if let Err(error) = check_corner_order(&recording, data) {
        return error;
    }
    let known = data.rejected.iter().filter(|(why, _)| **why != ObservationRejection::UnknownTag);
    let most = known.max_by_key(|(why, n)| (**why != ObservationRejection::ArmMoving, **n));
    if let Some((most, _)) = most {
        let reasons = data.rejected_by_reason();
        let reasons: Vec<String> = reasons.iter().map(|(why, n)| format!("{n} {}", why.replace('_', " "))).collect();
        let reasons = reasons.join(", ");
        // No joint moves camera and tags against each other.
        return if robot.n_seen_joints() == 0 && robot.gripper_tag.is_none() {
            CalibError::StandingTags { recording, reasons }
        } else {
            CalibError::AllRejected { recording, reasons, todo: most.remedy() }
        };
    }
    let known = robot.tags.iter().map(|tag| tag.id).collect();
    CalibError::NoTags { recording, robot: robot.name.clone(), known, seen: data.ids_seen.clone() }
}

/// Refuses corners most of which run the wrong way round: the rest of them are squares seen from their edge.
pub(crate) fn check_corner_order(name: &str, data: &CaptureData) -> Result<(), CalibError> {
    let n = data.rejected.get(&ObservationRejection::CornerOrder).copied().unwrap_or(0);
    let views = data.fit.iter().chain(&data.held_out);
    let kept = views.flat_map(|view| &view.tags).filter(|tag| tag.corners().is_some()).count();
    if n <= kept {
        return Ok(());
    }
    let todo = ObservationRejection::CornerOrder.remedy();
    Err(CalibError::CornerOrder { recording: name.to_owned(), n, of: n + kept, todo })
}

/// Refuses an arm that did not move: its sensors cannot be calibrated.
pub(crate) fn check_pose_variation(name: &str, data: &CaptureData, robot: &Robot) -> Result<(), CalibError> {
    let views = || data.fit.iter().chain(&data.held_out).filter(|view| !view.tags.is_empty());
    let mut most: Option<(usize, f64)> = None;
    for (joint, spec) in robot.sensors.iter().enumerate().take(robot.n_seen_joints()) {
        let travel = views().map(|view| view.travel_rad[joint]);
        let (low, high) = travel.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
        if high - low > least_motion_rad(spec) {
            return Ok(());
        }
        if most.is_none_or(|(_, moved)| high - low > moved) {
            most = Some((joint, high - low));
        }
    }
    let Some((joint, moved_rad)) = most else { return Ok(()) };
    Err(CalibError::OnePose {
        recording: name.to_owned(),
        views: views().count(),
        joint: robot.sensors[joint].joint.clone(),
        moved: robot.sensors[joint].unit().shown(moved_rad, 3),
    })
}

/// Returns the least span of a sensor's readings if its joint moved.
fn least_motion_rad(spec: &JointSensorSpec) -> f64 {
    MOVED_SIGMAS * spec.noise_std_counts / spec.counts_per_rad.abs()
}

/// Returns the joint with the same readings as `joint`, possibly in another unit. They lie on one straight line in all
/// views, which the noise of two sensors would prevent.
pub(crate) fn joint_with_same_readings(views: &[View], robot: &Robot, joint: usize) -> Option<usize> {
    (0..robot.n_seen_joints()).find(|&other| other != joint && are_alike(views, robot, [joint, other]))
}

fn are_alike(views: &[View], robot: &Robot, [a, b]: [usize; 2]) -> bool {
    let at = |view: &View| [a, b].map(|joint| view.travel_rad[joint]);
    let by_first = |one: &&View, other: &&View| at(one)[0].total_cmp(&at(other)[0]);
    let (Some(low), Some(high)) = (views.iter().min_by(by_first), views.iter().max_by(by_first)) else { return false };
    let (low, high) = (at(low), at(high));
    let span = [0, 1].map(|k| high[k] - low[k]);
    let moved = [(span[0], a), (span[1], b)];
    let is_still = moved.iter().any(|(span, joint)| span.abs() <= least_motion_rad(&robot.sensors[*joint]));
    if is_still || views.len() < MIN_ALIKE_VIEWS {
        return false;
    }
    let off = |[x, y]: [f64; 2]| (y - low[1] - span[1] / span[0] * (x - low[0])).abs();
    views.iter().all(|view| off(at(view)) < ALIKE_SHARE * span[1].abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::titan;
    use armcal_core::joints::JointAngles;
    use armcal_core::kinematics::Attachment;
    use armcal_core::stats::stream_rng;
    use armcal_core::time::SIMULATION_EPOCH;
    use rand::RngExt;

    /// Returns views in which the third joint's readings are `third` of the second's.
    fn views(seed: u64, third: impl Fn(f64, f64) -> f64) -> Vec<View> {
        let mut rng = stream_rng(seed, "alike");
        let one = |number: u32| {
            let mut travel_rad = JointAngles::from_fn(titan().n_joints(), |_| rng.random_range(-1.0..1.0));
            travel_rad[2] = third(travel_rad[1], rng.random_range(-1.0..1.0));
            View::of_reading(number, SIMULATION_EPOCH.plus_s(f64::from(number)), travel_rad)
        };
        (0..20).map(one).collect()
    }

    /// Tags of the base before a camera on the base, and before one on the arm.
    #[test]
    fn tags_that_no_joint_moves_before_the_camera_are_told() {
        let mut data = CaptureData::default();
        data.reject(ObservationRejection::InconsistentFrame, 400);
        let mut robot = titan();
        robot.gripper_tag = None;
        let refused = |robot: &Robot| no_views("run".to_owned(), robot, &data);
        assert!(matches!(refused(&robot), CalibError::AllRejected { .. }));
        robot.camera.mount = Attachment { n_joints: 0, ..robot.camera.mount };
        assert!(matches!(refused(&robot), CalibError::StandingTags { .. }));
        robot.tag_frame = Attachment { n_joints: 3, ..robot.tag_frame };
        assert!(matches!(refused(&robot), CalibError::AllRejected { .. }));
    }

    #[test]
    fn readings_of_one_sensor_are_told_from_those_of_two() {
        let robot = titan();
        for seed in 0..8 {
            let same = |third: &dyn Fn(f64, f64) -> f64| joint_with_same_readings(&views(seed, third), &robot, 2);
            assert_eq!(same(&|second, _| second), Some(1));
            // The readings differ in zero, unit or sign.
            assert_eq!(same(&|second, _| 0.3 - 1e-3 * second.to_degrees()), Some(1));
            // The joint moved alike with its own noise; it moved by itself; it did not move.
            assert_eq!(same(&|second, noise| second + 1e-4 * noise), None);
            assert_eq!(same(&|_, own| own), None);
            assert_eq!(same(&|_, _| 0.2), None);
        }
    }
}
