//! Continuous recordings of real arms: the direction in which joints came to rest, and the direction of up.

use std::path::Path;

use armcal::calib::{Calibration, CalibrationData, ExternalContext, calibrate_data, prepare_external};
use armcal::input::{parse_input_map, read_external};
use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, for_each_raw, ros};
use armcal::robot::Robot;
use armcal::routine::Method;
use armcal::stats::{quantile, stream_rng};
use armcal::streams::JointAngles;
use armcal::tagmap::files::read_landmarks;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use crate::support::external::{
    AS_IN_2018, INPUT_MAP, Noise, RealTitan, at, header, joint_state, transform, way, write_poses, write_stream,
};
use crate::support::synthetic::{N_SEEN, TrueArm, normal};
use crate::support::{temp, titan, write};

/// Views of a recording that `write_to` makes.
fn prepared(robot: &Robot, titan: &RealTitan, map: &str, write_to: impl Fn(&Path)) -> CalibrationData {
    let folder = temp();
    let (path, tags) = (folder.path().join("arm.mcap"), folder.path().join("tags.toml"));
    write_to(&path);
    write(&tags, &titan.tag_map());
    let map = parse_input_map(Path::new("map.toml"), map).expect("a map");
    let named = read_landmarks(&tags).expect("it reads").survey(&tags, robot, map.tag_use).expect("a survey");
    let robot = robot.clone().with_survey(named.survey);
    let recording = read_external(&path, &map, &robot).expect("it reads");
    prepare_external(&[recording], &map, &robot, ExternalContext::default()).expect("views")
}

/// Half of each joint's backlash, rad.
const HALF_BACKLASH_RAD: f64 = 0.006;
/// Noise of a camera on a good mount: the residuals of a view are smaller than the backlash.
const STEADY: Noise = Noise { sensors: 1.0, camera_rad: 0.002, camera_m: 0.001, tag_m: 0.001 };

/// Direction in which each joint came to pose `k`, from the words.
fn came_from(robot: &Robot, titan: &RealTitan, k: usize, joint: usize) -> f64 {
    let word = |k: usize| titan.poses[k].joints[joint].1;
    (way(word(k - 1), word(k)) * robot.sensors[joint].counts_per_rad).signum()
}

/// An arm whose angle lags behind its sensor by half the backlash.
fn with_backlash(robot: &Robot, n: usize, seed: u64) -> RealTitan {
    let straight = RealTitan::new(robot, n, STEADY, seed);
    let mut titan = RealTitan::new(robot, n, STEADY, seed);
    for k in 1..n {
        for joint in 0..robot.n_joints() {
            let by = came_from(robot, &straight, k, joint) * HALF_BACKLASH_RAD * robot.sensors[joint].counts_per_rad;
            let word = &mut titan.poses[k].joints[joint].1;
            *word = (*word - by).round().rem_euclid(65536.0);
        }
    }
    titan
}

#[test]
fn streams_tell_which_way_each_joint_came_to_rest() {
    let robot = titan();
    let titan = RealTitan::new(&robot, 16, AS_IN_2018, 31);
    let views = prepared(&robot, &titan, INPUT_MAP, |path| write_stream(path, &titan.poses, 31)).data.fit;
    assert_eq!(views.len(), 16);
    assert_eq!(views[0].approach, [0.0; 8], "nothing was recorded before");
    for (k, view) in views.iter().enumerate().skip(1) {
        // The last joint does not move.
        for joint in 0..N_SEEN {
            assert_eq!(view.approach[joint], came_from(&robot, &titan, k, joint), "view {k}, joint {joint}");
        }
    }
    // Single readings do not show the motion between them.
    let sparse = prepared(&robot, &titan, INPUT_MAP, |path| write_poses(path, &titan.poses)).data.fit;
    assert!(sparse.len() == 16 && sparse.iter().all(|view| view.approach == [0.0; 8]));
}

/// Half the backlash of each joint that moves the camera, with its sigma, rad.
fn half_backlash(found: &Calibration) -> Vec<(f64, f64)> {
    let of_joint = |joint: &armcal::calib::JointResult| {
        let terms = joint.terms.as_ref()?;
        Some((terms.half_backlash_rad?, terms.half_backlash_rad_std?))
    };
    found.joint.iter().take(N_SEEN).filter_map(of_joint).collect()
}

fn expect_backlash_to_be_found(seeds: u64) {
    let robot = titan();
    let (mut errors_rad, mut in_sigmas) = (Vec::new(), Vec::new());
    for seed in 0..seeds {
        let titan = with_backlash(&robot, 40, seed);
        let data = prepared(&robot, &titan, INPUT_MAP, |path| write_stream(path, &titan.poses, seed));
        let found = calibrate_data(data, Method::Bundle, None).expect("a result");
        let halves = half_backlash(&found);
        assert_eq!(halves.len(), N_SEEN, "seed {seed}: {:?}", found.refusal);
        for (joint, (half_rad, std_rad)) in halves.into_iter().enumerate() {
            // All joints have the same backlash in counts: a gain makes it larger or smaller in rad.
            let error = half_rad - HALF_BACKLASH_RAD * titan.gain[joint];
            errors_rad.push(error.abs());
            in_sigmas.push(error.abs() / std_rad);
        }
    }
    let of = |values: &[f64], q: f64| quantile(values, q).expect("values");
    eprintln!(
        "half backlash of 6 mrad: off by {:.2} mrad in the median, {:.2} (95 %); in sigma {:.2}, {:.2}",
        1e3 * of(&errors_rad, 0.5),
        1e3 * of(&errors_rad, 0.95),
        of(&in_sigmas, 0.5),
        of(&in_sigmas, 0.95)
    );
    assert!(of(&errors_rad, 0.5) < 0.25 * HALF_BACKLASH_RAD, "{errors_rad:?}");
    assert!(of(&in_sigmas, 0.95) < 2.6, "{in_sigmas:?}");
}

#[test]
fn backlash_is_found_from_streams() {
    expect_backlash_to_be_found(3);
}

#[test]
#[ignore = "second tier: 8 arms, 4 s"]
fn backlash_is_found_from_streams_of_eight_arms() {
    expect_backlash_to_be_found(8);
}

/// Delay of the camera's stamps, s; `JITTER_S` is its scatter.
const CAMERA_LATE_S: f64 = 0.04;
const JITTER_S: f64 = 0.003;

/// Writes an arm that never rests: 50 readings and five images with late stamps per second, for 50 s.
fn write_moving(path: &Path, robot: &Robot, landmarks_m: &[Vector3<f64>], seed: u64) {
    let mut rng = stream_rng(seed, "moving");
    let arm = TrueArm::with_sensor_errors(robot, &mut rng);
    let middle = arm.random_angles(&mut rng);
    let phases: Vec<f64> = (0..robot.n_joints()).map(|_| std::f64::consts::TAU * normal(&mut rng)).collect();
    // The joints move with up to 0.28 rad/s, no two in step.
    let angles_at = |t_s: f64| {
        let swing = |joint: usize| 0.5 * ((0.35 + 0.04 * joint as f64) * t_s + phases[joint]).sin();
        JointAngles::from_fn(robot.n_joints(), |joint| middle[joint] + swing(joint))
    };
    let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
    for tick in 0..2500 {
        let t_s = 0.02 * f64::from(tick);
        let words = arm.counts(&angles_at(t_s));
        let words = words.iter().map(|word| (word + normal(&mut rng)).round().rem_euclid(65536.0));
        let joints: Vec<(String, f64)> = robot.joint_names().into_iter().zip(words).collect();
        writer
            .write_ros("/joint_states", &ros::JointState::SCHEMA, at(t_s), &joint_state(at(t_s), &joints))
            .expect("written");
        if tick % 10 == 5 {
            let stamp = at(t_s + CAMERA_LATE_S + JITTER_S * normal(&mut rng));
            let base_from_camera = robot.chain.link_poses(&angles_at(t_s)).frame(&robot.camera.mount);
            let seen = landmarks_m.iter().enumerate().map(|(id, place)| {
                let off = Vector3::from_fn(|_, _| STEADY.tag_m * normal(&mut rng));
                let in_camera = base_from_camera.inverse() * Point3::from(*place) + off;
                transform(
                    stamp,
                    "fisheye",
                    &format!("tag36h11:{id}"),
                    &Isometry3::translation(in_camera.x, in_camera.y, in_camera.z),
                )
            });
            let message = ros::TfMessage { transforms: seen.collect() };
            writer.write_ros("/tf", &ros::TfMessage::SCHEMA, stamp, &message).expect("written");
        }
    }
    writer.finish().expect("finished");
}

fn expect_the_clocks_offset_to_be_found(seeds: std::ops::Range<u64>) {
    let robot = titan();
    let map = format!("while_moving = \"use\"\n{INPUT_MAP}");
    let (mut errors_s, mut in_sigmas, mut held_out_m) = (Vec::new(), Vec::new(), Vec::new());
    for seed in seeds {
        let titan = RealTitan::new(&robot, 1, STEADY, seed);
        let data = prepared(&robot, &titan, &map, |path| write_moving(path, &robot, &titan.landmarks_m, seed));
        assert!(data.data.fit.len() > 200, "seed {seed}: {:?}", data.data.rejected);
        let found = calibrate_data(data, Method::Bundle, None).expect("a result");
        let [offset_s, std_s] = found.model.and_then(|model| model.time_offset_s).expect("an offset");
        let error_s = offset_s + CAMERA_LATE_S;
        errors_s.push(error_s.abs());
        in_sigmas.push(error_s.abs() / std_s);
        held_out_m.push(found.held_out.rms_m.expect("held-out views"));
    }
    eprintln!("clock off by {errors_s:?} s, {in_sigmas:?} sigma; held out {held_out_m:?} m");
    assert!(errors_s.iter().all(|error_s| *error_s < 1e-3), "{errors_s:?}");
    assert!(in_sigmas.iter().filter(|sigmas| **sigmas > 2.0).count() <= 1, "{in_sigmas:?}");
    // The prediction for an image is for its time: 40 ms at 0.2 rad/s are 8 mrad.
    assert!(held_out_m.iter().all(|rms_m| *rms_m < 0.004), "{held_out_m:?}");
}

#[test]
fn the_clocks_offset_is_found_while_the_arm_moves() {
    expect_the_clocks_offset_to_be_found(0..1);
}

#[test]
#[ignore = "second tier: 6 arms that never rest, 30 s"]
fn the_clocks_offset_is_found_while_six_arms_move() {
    expect_the_clocks_offset_to_be_found(0..6);
}

/// Rotation of the attitude sensor in the base: a quarter turn about z, then about y.
fn base_from_sensor() -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.0, 0.4, 1.2)
}

/// Up in the base at pose `k`: the vehicle leans more with each pose, and has turned.
fn up_at(k: usize) -> Vector3<f64> {
    world_from_base(k).inverse() * Vector3::z()
}

fn world_from_base(k: usize) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.02 * k as f64, -0.3, 2.0 + 0.1 * k as f64)
}

/// Writes poses with an attitude half a second before and after each of the first `n_told` images; the frame is `imu`.
fn write_leaning(path: &Path, titan: &RealTitan, n_told: usize, change: impl Fn(&mut ros::Imu)) {
    let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
    for (k, pose) in titan.poses.iter().enumerate() {
        let (now, later) = (at(2.0 * pose.joints_at_s), at(2.0 * pose.joints_at_s + 0.01));
        let joints = joint_state(now, &pose.joints);
        writer.write_ros("/joint_states", &ros::JointState::SCHEMA, now, &joints).expect("written");
        let transforms = pose.tags.iter().map(|(frame, tag)| transform(later, "fisheye", frame, tag)).collect();
        writer.write_ros("/tf", &ros::TfMessage::SCHEMA, later, &ros::TfMessage { transforms }).expect("written");
        let stamp = later.plus_s(if k < n_told { 0.1 } else { 0.7 });
        let q = world_from_base(k) * base_from_sensor();
        let orientation = ros::Quaternion::from_wxyz([q.w, q.i, q.j, q.k]);
        let mut imu = ros::Imu { header: header(stamp, "imu"), orientation, ..ros::Imu::default() };
        change(&mut imu);
        writer.write_ros("/imu", &ros::Imu::SCHEMA, stamp, &imu).expect("written");
    }
    writer.finish().expect("finished");
}

fn map_with_attitude() -> String {
    let q = base_from_sensor();
    let turn = [q.w, q.i, q.j, q.k];
    format!("{INPUT_MAP}[conditions]\nattitude = \"/imu\"\nattitude_in_base_wxyz = {turn:?}\n")
}

#[test]
fn attitudes_tell_each_view_which_way_is_up() {
    let (robot, titan) = (titan(), RealTitan::new(&titan(), 12, AS_IN_2018, 33));
    let of = |map: &str| prepared(&robot, &titan, map, |path| write_leaning(path, &titan, 10, |_| {}));
    let with = of(&map_with_attitude());
    assert_eq!(with.data.fit.len(), 12);
    for (k, view) in with.data.fit.iter().enumerate() {
        // The last two poses are too far from any attitude.
        assert_eq!(view.up.is_some(), k < 10, "view {k}");
        let off = view.up.map_or(0.0, |up| (up - up_at(k)).norm());
        assert!(off < 1e-9, "view {k}: {off}");
    }
    let without = of(INPUT_MAP);
    assert!(without.data.fit.iter().all(|view| view.up.is_none()));
    assert!(without.messages_hash != with.messages_hash, "what is used is in the hash");
}

/// A change to the attitudes.
type Change = &'static dyn Fn(&mut ros::Imu);

#[test]
fn attitudes_that_are_none_are_refused_by_name() {
    let folder = temp();
    let (robot, titan) = (titan(), RealTitan::new(&titan(), 4, AS_IN_2018, 34));
    let path = folder.path().join("arm.mcap");
    let problem = |map: &str, change: &dyn Fn(&mut ros::Imu)| {
        write_leaning(&path, &titan, 4, change);
        let map = parse_input_map(Path::new("map.toml"), map).expect("a map");
        read_external(&path, &map, &robot).map_err(|error| error.to_string())
    };
    let map = map_with_attitude();
    let faults: [(&str, Change, &[&str]); 4] = [
        (&map, &|imu| imu.orientation_covariance[0] = -1.0, &["message 1", "conditions.attitude"]),
        (&map, &|imu| imu.orientation = ros::Quaternion::from_wxyz([0.0; 4]), &["/imu", "length", "not 1"]),
        (&map, &|imu| imu.orientation = ros::Quaternion::from_wxyz([f64::NAN; 4]), &["/imu", "orientation", "NaN"]),
        (&map.replace("\"/imu\"", "\"/tf_static\""), &|_| {}, &["/tf_static"]),
    ];
    for (map, change, words) in faults {
        let found = problem(map, change).expect_err("refused");
        assert!(words.iter().all(|word| found.contains(word)), "{found}");
    }
    let lenient = format!("not_finite = \"leave_out\"\n{map}");
    let left = problem(&lenient, &|imu| imu.orientation = ros::Quaternion::from_wxyz([f64::NAN; 4])).expect("it reads");
    assert_eq!((left.attitudes.len(), left.left_out.values().sum::<u64>()), (0, 4));
    let mut imus = 0;
    for_each_raw(&path, |raw| imus += usize::from(raw.topic() == "/imu")).expect("it reads");
    assert_eq!(imus, 4);
}
