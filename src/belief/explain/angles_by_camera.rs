//! Angles of joints without a sensor reading, from the tags of a view.

use crate::explain::constants::angles_by_camera::{CANDIDATES, FINEST_STEP_RAD, KNOWN_MOUNT, SEARCH_WIDTH_M};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;

use crate::model::parameters::JointParameters;
use crate::views::view::{TagObservation, View};

/// Sets the travel of the view's free joints from its tags under `at`; leaves it unchanged if the view shows no tag.
pub fn set_by_camera(robot: &Robot, view: &mut View, at: &JointParameters) {
    let joints: Vec<usize> = (0..robot.n_seen_joints()).filter(|&joint| view.is_free[joint]).collect();
    if joints.is_empty() {
        return;
    }
    let angles = seen_angles(robot, view, &joints, at);
    for &joint in &joints {
        let center_rad = robot.sensors[joint].center_rad;
        view.travel_rad[joint] = if view.tags.is_empty() { 0.0 } else { angles[joint] - center_rad };
    }
}

/// All angles of a view; those of `joints` are where the tags are closest to their survey (sum of Cauchy losses). The
/// search uses a grid over the joints' ranges, then smaller and smaller steps.
pub(crate) fn seen_angles(robot: &Robot, view: &View, joints: &[usize], at: &JointParameters) -> JointAngles {
    let departure = view.conditions.departure_from(&at.reference);
    let mut best = JointAngles::from_fn(robot.n_joints(), |j| {
        at.correction(j).angle_rad(&robot.sensors[j], view.travel_rad[j], &departure, view.approach[j])
    });
    let n = CANDIDATES[joints.len().min(CANDIDATES.len()) - 1];
    let step_rad = |joint: usize| 2.0 * robot.sensors[joint].half_range_rad / n as f64;
    let mut least = f64::INFINITY;
    let on_grid = joints.len().min(CANDIDATES.len());
    let mut trial = best;
    for mut index in 0..n.pow(on_grid as u32) {
        for &joint in &joints[..on_grid] {
            let spec = &robot.sensors[joint];
            trial[joint] = spec.center_rad - spec.half_range_rad + ((index % n) as f64 + 0.5) * step_rad(joint);
            index /= n;
        }
        let cost = distance_cost(robot, view, &trial);
        if cost < least {
            (least, best) = (cost, trial);
        }
    }
    let mut share = 0.5;
    while joints.iter().any(|&joint| share * step_rad(joint) > FINEST_STEP_RAD) {
        let mut improved = false;
        for (&joint, sign) in joints.iter().flat_map(|joint| [(joint, -1.0), (joint, 1.0)]) {
            let mut trial = best;
            trial[joint] += sign * share * step_rad(joint);
            let cost = distance_cost(robot, view, &trial);
            if cost < least {
                (least, best, improved) = (cost, trial, true);
            }
        }
        if !improved {
            share *= 0.5;
        }
    }
    best
}

/// Sum over the tags of Cauchy losses of their distances from the survey.
pub(crate) fn distance_cost(robot: &Robot, view: &View, angles: &JointAngles) -> f64 {
    let base_from_camera = robot.tags_from(robot.camera_at(view.camera), angles);
    let of_tag = |tag: &TagObservation| {
        let predicted_m = base_from_camera * nalgebra::Point3::from(tag.center_in_camera_m);
        let off_m = predicted_m.coords - robot.tags[tag.tag_idx].base_from_tag.origin().vector();
        (off_m.norm_squared() / SEARCH_WIDTH_M.powi(2)).ln_1p()
    };
    view.tags.iter().map(of_tag).sum()
}

/// Returns true if the stated sigmas of the camera mount are within [`KNOWN_MOUNT`].
pub(crate) fn has_known_mount(robot: &Robot) -> bool {
    robot.camera.mount_std_m <= KNOWN_MOUNT[0] && robot.camera.mount_std_rad <= KNOWN_MOUNT[1]
}
