//! Joint readings that do not mean what robot.toml says: the error is named, with the joints concerned.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use crate::batch::tests::failures::{Case, case};
use crate::say::reading_error::{ReadingError, SignedJoint};
use crate::say::refusal::Refusal;
use crate::say::wrong_input::{WrongInput, WrongInputKind};
use crate::views::view::View;
use armcal_core::input::{InputMap, parse_input_map};
use armcal_core::robot::Robot;
use armcal_core::spatial::Pose;
use armcal_core::streams::JointAngles;

/// Changes the angles that robot.toml yields, view by view.
fn changed(case: &mut Case, change: impl Fn(&Robot, &JointAngles, &mut JointAngles)) {
    for view in &mut case.views {
        let center = |joint: usize| case.robot.sensors[joint].center_rad;
        let angles = JointAngles::from_fn(view.travel_rad.len(), |joint| center(joint) + view.travel_rad[joint]);
        let mut read = angles;
        change(&case.robot, &angles, &mut read);
        view.travel_rad = JointAngles::from_fn(view.travel_rad.len(), |joint| read[joint] - center(joint));
    }
}

/// Angle that joint `a` reads where its input gets the counts of joint `b`.
fn counts_as(robot: &Robot, a: usize, b: usize, angle_rad: f64) -> f64 {
    let (own, other) = (&robot.sensors[a], &robot.sensors[b]);
    (other.offset_counts + other.counts_per_rad * angle_rad - own.offset_counts) / own.counts_per_rad
}

fn found(case: Case) -> ReadingError {
    let name = |refusal: Option<&Refusal>| format!("{refusal:?}");
    let calibration = case.calibrated();
    match calibration.refusals.first() {
        Some(Refusal::MisreadReadings(misread)) => misread.found.clone(),
        other => panic!("{}", name(other)),
    }
}

#[test]
fn exchanged_readings_are_named() {
    for (seed, [a, b]) in [(0, [0, 1]), (1, [1, 3]), (2, [3, 4]), (3, [0, 4])] {
        let mut case = case(seed, None);
        changed(&mut case, |robot, angles, read| {
            (read[a], read[b]) = (counts_as(robot, a, b, angles[b]), counts_as(robot, b, a, angles[a]));
        });
        let names = [a, b].map(|joint| case.robot.sensors[joint].joint.clone());
        assert_eq!(found(case), ReadingError::Exchanged { joints: names }, "seed {seed}");
    }
}

#[test]
fn a_reading_that_contains_the_angle_of_a_neighbour_is_named() {
    for (seed, [of, with], of_sign) in [(4, [2, 1], 1.0), (5, [1, 2], -1.0), (6, [4, 3], 1.0)] {
        let mut case = case(seed, None);
        changed(&mut case, |_, angles, read| read[of] += of_sign * angles[with]);
        match found(case) {
            ReadingError::Coupled { joint, with: other, sign } => {
                let names = crate::batch::tests::data::titan().joint_names();
                assert_eq!((joint, other, sign), (names[of].clone(), names[with].clone(), of_sign), "seed {seed}");
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

#[test]
fn three_columns_in_a_circle_are_named_with_the_names_that_put_them_right() {
    for (seed, joints, from) in [(70, [0, 1, 2], [1, 2, 0]), (71, [0, 2, 4], [4, 0, 2]), (72, [1, 3, 4], [3, 4, 1])] {
        let mut case = case(seed, None);
        changed(&mut case, |robot, angles, read| {
            // The column with the corrected name `from` has that joint's angles.
            for (joint, from) in joints.into_iter().zip(from) {
                read[from] = counts_as(robot, from, joint, angles[joint]);
            }
        });
        let name = |joint: usize| case.robot.sensors[joint].joint.clone();
        let expected = ReadingError::InCircle { joints: joints.map(name).to_vec(), recorded: from.map(name).to_vec() };
        assert_eq!(found(case), expected, "seed {seed}");
    }
}

/// Sums relative to the base over two joints, with the other sign, and of a joint that is no neighbour.
#[test]
fn a_reading_that_is_a_sum_of_angles_is_named_with_its_terms() {
    let sums = [
        (3, 1.0, vec![(1, 1.0), (2, 1.0)]),
        (2, -1.0, vec![(1, -1.0)]),
        (4, 1.0, vec![(2, -1.0)]),
        (2, -1.0, vec![(0, 1.0), (1, -1.0)]),
    ];
    for (seed, (of, own, with)) in (73..).zip(sums) {
        let mut case = case(seed, None);
        changed(&mut case, |_, angles, read| {
            read[of] = own * angles[of] + with.iter().map(|(other, sign)| sign * angles[*other]).sum::<f64>();
        });
        let name = |joint: usize| case.robot.sensors[joint].joint.clone();
        let others = with.iter().map(|(other, sign)| SignedJoint { joint: name(*other), sign: *sign });
        let expected = ReadingError::Sum { joint: name(of), own, with: others.collect() };
        assert_eq!(found(case), expected, "seed {seed}");
    }
}

/// Rows of a table that were sorted separately, so that no joint's readings belong to the tags of their row.
#[test]
fn readings_in_another_order_than_the_tags_are_named() {
    let mut n_named = 0;
    for seed in 80..84 {
        let mut case = case(seed, None);
        let read: Vec<JointAngles> = case.views.iter().map(|view| view.travel_rad).collect();
        let n = read.len();
        for (k, view) in case.views.iter_mut().enumerate() {
            view.travel_rad = read[(7 * k + 3) % n];
        }
        let calibration = case.calibrated();
        let first = calibration.refusals.first().expect("a refusal");
        match first {
            Refusal::MisreadReadings(misread) => {
                assert!(matches!(misread.found, ReadingError::Unpaired { .. }), "seed {seed}: {misread:?}");
                n_named += 1;
            }
            other => {
                assert!(matches!(other, Refusal::Outliers { .. } | Refusal::NotSolved { .. }), "seed {seed}: {other:?}")
            }
        }
    }
    assert!(n_named >= 2, "{n_named} of 4");
}

#[test]
fn zeros_by_another_convention_are_named_with_their_size() {
    for (seed, joint, by_rad) in [(7, 1, FRAC_PI_2), (8, 3, -FRAC_PI_2), (9, 2, 0.6), (10, 0, PI)] {
        let mut case = case(seed, None);
        changed(&mut case, |_, _, read| read[joint] += by_rad);
        let name = case.robot.sensors[joint].joint.clone();
        let ReadingError::Zeros { joints } = found(case) else { panic!("seed {seed}: no zeros") };
        let [zero] = &joints[..] else { panic!("seed {seed}: {joints:?}") };
        let off_rad = armcal_core::sensor::wrap_symmetric(zero.off_rad + by_rad, 2.0 * PI);
        // The sensor's own offset is part of it.
        assert!(zero.joint == name && off_rad.abs() < 0.15, "seed {seed}: {zero:?}");
    }
}

/// An input map that states angles in degrees, with further keys of its joints.
fn map_of_degrees(keys: &[String]) -> InputMap {
    let text = format!(
        "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\nunit = \"deg\"\n{}\n[tags]\ntopic = \
         \"/t\"\nuse = \"corners\"\n",
        keys.join("\n")
    );
    parse_input_map(Path::new("map.toml"), &text).expect("the keys are of an input map")
}

/// The keys of the input map in a remedy.
fn keys_in(advice: &str) -> Vec<String> {
    let words: Vec<&str> = advice.split_whitespace().collect();
    let lines = words.windows(3).filter(|three| three[1] == "=");
    let of_map = lines.filter(|three| three[0].starts_with("factor.") || three[0].starts_with("zero."));
    of_map.map(|three| three.join(" ").trim_end_matches([',', ';']).to_owned()).collect()
}

/// Records the angles of `joint` by `recorded_rad`, and applies the remedy of the refusal. Returns the largest error of
/// the angles that the corrected map reads, rad.
fn left_by_advice(seed: u64, joint: usize, recorded_rad: impl Fn(f64) -> f64) -> f64 {
    let mut case = case(seed, None);
    let map = map_of_degrees(&[]);
    case.robot.sensors.iter_mut().for_each(|spec| spec.stated = map.stated(spec));
    let spec = case.robot.sensors[joint].clone();
    let angle_rad = |view: &View| spec.center_rad + view.travel_rad[joint];
    let angles_rad: Vec<f64> = case.views.iter().map(angle_rad).collect();
    changed(&mut case, |_, angles, read| read[joint] = recorded_rad(angles[joint]));
    let calibration = case.calibrated();
    let keys: Vec<String> = calibration.refusals.iter().flat_map(|refusal| keys_in(&refusal.remedy())).collect();
    assert!(!keys.is_empty(), "seed {seed}: {:?}", calibration.refusals);
    let line = map_of_degrees(&keys).stated(&spec).expect("angles are stated");
    let error_rad = |angle_rad: f64| line.angle_rad(recorded_rad(angle_rad).to_degrees()) - angle_rad;
    angles_rad.into_iter().map(|angle_rad| error_rad(angle_rad).abs()).fold(0.0, f64::max)
}

/// The keys found include the sensor's own gain and offset.
#[test]
fn the_keys_that_are_advised_for_stated_angles_put_them_right() {
    for (seed, joint, slope) in [(60, 0, -1.0), (62, 2, 0.5), (63, 3, 1.5), (62, 2, 1f64.to_degrees())] {
        let left_rad = left_by_advice(seed, joint, |angle_rad| slope * angle_rad);
        assert!(left_rad < 0.15, "seed {seed}, slope {slope}: {left_rad}");
    }
    for (seed, joint, by_rad) in [(7, 1, FRAC_PI_2), (8, 3, -FRAC_PI_2), (9, 2, 0.6)] {
        let left_rad = left_by_advice(seed, joint, |angle_rad| angle_rad + by_rad);
        assert!(left_rad < 0.15, "seed {seed}, zero {by_rad}: {left_rad}");
    }
}

/// Stated angles are exchanged unscaled: the scales of the two sensors in robot.toml do not matter.
#[test]
fn exchanged_angles_are_named() {
    for (seed, [a, b]) in [(0, [0, 1]), (2, [3, 4])] {
        let mut case = case(seed, None);
        let map = map_of_degrees(&[]);
        case.robot.sensors.iter_mut().for_each(|spec| spec.stated = map.stated(spec));
        let spec = &mut case.robot.sensors[a];
        (spec.counts_per_rad, spec.wrap_counts) = (-3.0 * spec.counts_per_rad, 3.0 * spec.wrap_counts);
        spec.noise_std_counts *= 3.0;
        changed(&mut case, |_, angles, read| (read[a], read[b]) = (angles[b], angles[a]));
        let names = [a, b].map(|joint| case.robot.sensors[joint].joint.clone());
        assert_eq!(found(case), ReadingError::Exchanged { joints: names }, "seed {seed}");
    }
}

/// The camera cannot distinguish whole turns: an offset of one would explain all views.
#[test]
fn angles_a_turn_beyond_the_limits_are_not_accepted() {
    for (seed, joint, turn_rad) in [(18, 0, 2.0 * PI), (19, 3, -2.0 * PI), (33, 4, 2.0 * PI)] {
        let mut case = case(seed, None);
        assert!(case.robot.sensors[joint].is_limited());
        changed(&mut case, |_, _, read| read[joint] += turn_rad);
        let name = case.robot.sensors[joint].joint.clone();
        match found(case) {
            ReadingError::OtherTurns { joints, .. } => assert_eq!(joints, [name], "seed {seed}"),
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

/// The scale error is so large that nothing fits, and the search finds no line for the sensor.
#[test]
fn a_scale_that_is_far_off_is_named_with_its_size() {
    for (seed, joint, scale) in [(23, 1, 0.01), (24, 3, 0.004), (25, 2, 0.02), (26, 0, 70.0)] {
        let mut case = case(seed, None);
        changed(&mut case, |_, angles, read| read[joint] = scale * angles[joint]);
        let name = case.robot.sensors[joint].joint.clone();
        let calibration = case.calibrated();
        let (of, factor) = match calibration.refusals.first() {
            Some(Refusal::MisreadReadings(misread)) => match &misread.found {
                ReadingError::Scaled { joint, factor, .. } => (joint.clone(), *factor),
                other => panic!("seed {seed}: {other:?}"),
            },
            Some(Refusal::SensorLine { joint, slope, .. }) => (joint.clone(), *slope),
            Some(Refusal::SensorUnit { joint, gain, .. }) => (joint.clone(), *gain),
            other => panic!("seed {seed}: {other:?}"),
        };
        assert!(of == name && (factor * scale - 1.0).abs() < 0.2, "seed {seed}: {of} {factor}");
    }
}

#[test]
fn readings_of_the_next_or_the_previous_view_are_named() {
    for (seed, by) in [(27, 1), (28, -1), (29, 1)] {
        let mut case = case(seed, None);
        let read: Vec<JointAngles> = case.views.iter().map(|view| view.travel_rad).collect();
        let n = read.len() as isize;
        for (k, view) in case.views.iter_mut().enumerate() {
            // After correction, the readings are those of the view `by` later.
            view.travel_rad = read[(k as isize - by).rem_euclid(n) as usize];
        }
        assert_eq!(found(case), ReadingError::Shifted { views: by as i32 }, "seed {seed}");
    }
}

/// A link before or after the stated one, and the axes of a body's frame instead of an optical one.
#[test]
fn a_camera_on_another_link_or_with_other_axes_is_named() {
    let optical = UnitQuaternion::new_normalize(Quaternion::new(0.5, -0.5, 0.5, -0.5));
    for (seed, less, turn) in [(30, 1, UnitQuaternion::identity()), (31, 0, optical), (32, 2, optical)] {
        let mut case = case(seed, None);
        let mount = &mut case.robot.camera.mount;
        let (carrier, stated) = (mount.n_joints, mount.link_from_frame.rotation);
        mount.n_joints -= less;
        mount.link_from_frame.rotation = stated * turn.inverse();
        let link = case.robot.chain.joints()[carrier - 1].child_link.clone();
        let ReadingError::Camera { link: on, turn: by } = found(case) else { panic!("seed {seed}: no camera") };
        let by = UnitQuaternion::new_normalize(Quaternion::new(by[0], by[1], by[2], by[3]));
        assert!(on == (less > 0).then_some(link) && by.angle_to(&turn) < 1e-6, "seed {seed}: {on:?} {by}");
    }
}

/// Moves all tags of the case's map as one.
fn with_map_in(case: &mut Case, map_from_base: &Isometry3<f64>) {
    for tag in &mut case.robot.tags {
        tag.base_from_tag = Pose::from_isometry(map_from_base * tag.base_from_tag.isometry());
    }
}

fn is_near(position_m: [f64; 3], [w, x, y, z]: [f64; 4], map_from_base: &Isometry3<f64>) -> bool {
    let turn = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let left = Isometry3::from_parts(position_m.into(), turn) * map_from_base;
    // A turn about the first joint's axis is shared with its offset.
    left.translation.vector.norm() < 0.06 && left.rotation.angle() < 0.1
}

#[test]
fn a_tag_map_in_another_frame_is_named_with_shift_and_turn() {
    let motions = [
        (Vector3::new(0.0, 0.0, -0.35), Vector3::zeros()),
        (Vector3::new(0.3, 0.0, 0.0), Vector3::zeros()),
        (Vector3::new(2.0, -1.2, 0.4), Vector3::new(0.0, 0.0, 0.6)),
        (Vector3::new(0.0, 0.0, 0.1), Vector3::new(0.3, 0.0, 0.0)),
    ];
    for (seed, (shift_m, turn)) in (33..).zip(motions) {
        let (mut case, map_from_base) = (case(seed, None), Isometry3::new(shift_m, turn));
        with_map_in(&mut case, &map_from_base);
        match found(case) {
            ReadingError::MapFrame { position_m, turn } => {
                assert!(is_near(position_m, turn, &map_from_base), "seed {seed}: {position_m:?} {turn:?}");
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

/// Tags of another size than stated, in a map that was made with the stated one and hangs on its first tag.
#[test]
fn sizes_and_distances_that_are_wrong_by_one_factor_are_named() {
    for (seed, factor) in [(40, 1.25), (41, 0.8), (42, 1.08), (43, 0.7)] {
        let mut case = case(seed, None);
        let first_m = case.robot.tags[0].base_from_tag.origin().vector();
        for tag in &mut case.robot.tags {
            let mut pose = *tag.base_from_tag.isometry();
            pose.translation.vector = first_m + (pose.translation.vector - first_m) / factor;
            (tag.base_from_tag, tag.size_m) = (Pose::from_isometry(pose), tag.size_m / factor);
        }
        for seen in case.views.iter_mut().flat_map(|view| &mut view.tags) {
            seen.center_in_camera_m /= factor;
        }
        match found(case) {
            ReadingError::MapScale { factor: found, is_in_pixels: true, hint } => {
                assert!((found / factor - 1.0).abs() < 0.01, "seed {seed}: {found}");
                assert_eq!(hint.is_some(), [0.8, 1.25].contains(&factor), "seed {seed}: {hint:?}");
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

/// No view distinguishes a turn of all tags about the first joint's axis from that joint's zero.
#[test]
fn a_map_that_is_turned_about_the_first_joint_is_named_beside_its_zero() {
    for (seed, by_rad) in [(37, FRAC_PI_2), (38, -0.6)] {
        let mut case = case(seed, None);
        let (place, axis) = (case.robot.chain.first_place(), case.robot.chain.joints()[0].axis);
        let turn = Isometry3::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&axis, by_rad));
        let map_from_base = place * turn * place.inverse();
        with_map_in(&mut case, &map_from_base);
        let name = case.robot.sensors[0].joint.clone();
        let calibration = case.calibrated();
        let Some(Refusal::MisreadReadings(misread)) = calibration.refusals.first() else {
            panic!("seed {seed}: {:?}", calibration.refusals.first())
        };
        let all = || std::iter::once(&misread.found).chain(&misread.alternatives);
        let is_zero = |error: &ReadingError| matches!(error, ReadingError::Zeros { joints } if joints[0].joint == name);
        let is_frame = |error: &ReadingError| match error {
            ReadingError::MapFrame { position_m, turn } => is_near(*position_m, *turn, &map_from_base),
            _ => false,
        };
        assert!(all().any(is_zero) && all().any(is_frame), "seed {seed}: {misread:?}");
    }
}

#[test]
fn readings_of_0_to_360_deg_are_named() {
    for (seed, joint) in [(18, 0), (19, 3)] {
        let mut case = case(seed, None);
        changed(&mut case, |_, _, read| read[joint] = read[joint].rem_euclid(2.0 * PI));
        match found(case) {
            ReadingError::OtherTurns { joints, .. } => assert_eq!(joints.len(), 1, "seed {seed}: {joints:?}"),
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

/// A lens measured in air and used in water, one measured in water and used in air, and another lens.
#[test]
fn a_lens_of_another_focal_length_is_named() {
    for (seed, ratio) in [(20, 1.333), (21, 0.75), (22, 1.1)] {
        let mut case = case(seed, None);
        let [fx, fy, rest @ ..] = case.robot.camera.lens.intrinsics();
        let [cx, cy, k1, k2, k3, k4] = rest;
        let stated = [fx / ratio, fy / ratio, cx, cy, k1, k2, k3, k4];
        case.robot.camera.lens = case.robot.camera.lens.with_intrinsics(stated);
        let calibration = case.calibrated();
        let found = match calibration.refusals.first() {
            Some(Refusal::Lens { ratio, .. }) => *ratio,
            Some(Refusal::WrongInput(WrongInput { input: WrongInputKind::FocalLength(ratio), .. })) => *ratio,
            other => panic!("seed {seed}: {other:?}"),
        };
        assert!((found / ratio - 1.0).abs() < 0.03, "seed {seed}: {found}");
    }
}

/// Readings are correct; the arms have faults with other names.
#[test]
fn other_faults_are_not_called_misread() {
    for seed in 11..17 {
        let mut case = case(seed, None);
        if seed % 2 == 0 {
            let joint = (seed % 5) as usize;
            let first_rad = case.views[0].travel_rad[joint];
            case.views.iter_mut().for_each(|view| view.travel_rad[joint] = first_rad);
        }
        let calibration = case.calibrated();
        let misread = calibration.refusals.iter().find(|refusal| matches!(refusal, Refusal::MisreadReadings(_)));
        assert_eq!(misread, None, "seed {seed}");
    }
}
