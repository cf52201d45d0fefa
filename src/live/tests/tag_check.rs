//! Tags in view against the datasheet, on arms whose sensors err within their bounds, and beyond.

use super::titan4;
use crate::tag_check::check_tags;
use armcal_core::codes::{Code, Coded};
use armcal_core::optics::square_corners;
use armcal_core::robot::{Robot, load_vehicle};
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{JointAngles, TagDetection};
use rand_distr::{Distribution, Uniform};

fn with_tags() -> Robot {
    let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let vehicle = load_vehicle(&root.join("robots/vehicles/work-class-front.toml")).expect("it reads");
    titan4().mounted_on(&vehicle).expect("it fits")
}

/// Returns the camera's detections at these true angles.
fn seen(robot: &Robot, angles: &JointAngles) -> Vec<TagDetection> {
    let camera_from_tags = robot.tags_from_camera(angles).inverse();
    let of = |tag: &armcal_core::robot::SurveyedTag| {
        let place = camera_from_tags * tag.base_from_tag.isometry();
        let faces = (place.rotation * nalgebra::Vector3::z()).dot(&place.translation.vector) < 0.0;
        let corners = square_corners(tag.size_m).map(|corner| robot.camera.lens.project(&(place * corner).coords));
        let [Some(a), Some(b), Some(c), Some(d)] = corners else { return None };
        let corners_px = [a, b, c, d].map(Into::into);
        faces.then_some(TagDetection { id: tag.id, corners_px, decision_margin: 50.0 })
    };
    robot.tags.iter().filter_map(of).collect()
}

/// Angles of the whole joint ranges, and sensors that err by `share` of their bounds.
fn angles(robot: &Robot, share: f64, seed: u64) -> [JointAngles; 2] {
    let mut rng = stream_rng(seed, "tag check");
    let mut draw = || Uniform::new(-1.0, 1.0).expect("a range").sample(&mut rng);
    let true_angles = JointAngles::from_fn(robot.n_joints(), |j| {
        robot.sensors[j].center_rad + 0.9 * robot.sensors[j].half_range_rad.min(2.0) * draw()
    });
    let read =
        JointAngles::from_fn(robot.n_joints(), |j| true_angles[j] + share * draw() * robot.sensors[j].offset_bound_rad);
    [true_angles, read]
}

#[test]
fn sensors_within_their_bounds_are_let_pass() {
    let robot = with_tags();
    let (mut n_checked, mut largest_share) = (0, 0.0_f64);
    for seed in 0..400 {
        let [true_angles, read] = angles(&robot, 1.0, seed);
        let counts = ArmSensors::nominal(&robot).counts(&read);
        let check = check_tags(&robot, &counts, &seen(&robot, &true_angles));
        if let Some(check) = check.unwrap_or_else(|error| panic!("seed {seed}: {error}")) {
            n_checked += 1;
            largest_share = largest_share.max(check.largest_rad / check.bound_rad);
        }
    }
    assert!(n_checked > 40 && largest_share > 0.3, "{n_checked} with tags, {largest_share}");
}

#[test]
fn a_sensor_that_slipped_by_half_a_turn_and_another_vehicle_are_refused() {
    let robot = with_tags();
    let (mut n, mut n_refused) = (0, 0);
    for seed in 0..400 {
        let [true_angles, mut read] = angles(&robot, 0.5, seed);
        let detections = seen(&robot, &true_angles);
        if detections.is_empty() {
            continue;
        }
        // The first joint turns the whole arm about: every direction changes.
        read[0] = (read[0] + 1.5 - robot.sensors[0].center_rad).rem_euclid(2.0) - 1.0 + robot.sensors[0].center_rad;
        n += 1;
        let refused = check_tags(&robot, &ArmSensors::nominal(&robot).counts(&read), &detections);
        n_refused += u32::from(refused.is_err_and(|error| error.code() == Code::ArmNotReady));
    }
    assert!(n > 40 && n_refused * 10 >= n * 6, "{n_refused} of {n}");
}

#[test]
fn without_a_known_tag_nothing_is_said() {
    let mut robot = with_tags();
    let [true_angles, read] = angles(&robot, 0.0, 3);
    let counts = ArmSensors::nominal(&robot).counts(&read);
    assert_eq!(check_tags(&robot, &counts, &[]).expect("nothing is wrong"), None);
    let detections = seen(&robot, &true_angles);
    robot.tags.iter_mut().for_each(|tag| tag.position_std_m = f64::INFINITY);
    assert_eq!(check_tags(&robot, &counts, &detections).expect("nothing is wrong"), None);
}
