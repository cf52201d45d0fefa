//! Messages of other programs that calibration cannot use directly: skipped and counted, or named with the remedy.

use armcal::log::ros;
use armcal::time::Stamp;

use crate::support::external::header;
use crate::support::read;
use crate::support::scene::{Payload, Recorded, Scene, isaac};
use crate::support::texts::Texts;

const TITAN: [&str; 3] = ["/arm/joint_states", "/wrist/detections", "/wrist/camera_info"];
const KRAFT: [&str; 3] = ["/kraft/joints", "/cam0/tags", "/cam0/camera_info"];

fn titan(seed: u64) -> Scene {
    Scene::of_robot("titan4", TITAN, 3.0, seed)
}

fn kraft(seed: u64) -> Scene {
    Scene::of_robot("kraft-predator", KRAFT, 7.5, seed)
}

fn velocities(joints: &ros::JointState) -> ros::JointState {
    ros::JointState { velocity: vec![0.1; joints.name.len()], position: Vec::new(), ..joints.clone() }
}

#[test]
fn messages_without_positions_are_skipped_and_counted() {
    let mut bench = Scene::bench();
    bench.before_joints(|_, joints| Some(velocities(joints)));
    bench.calibrate().expect("a velocity before each", 0, &["ACCEPTED", ": 40 joint", "messages_rejected"]);
    let mut arm = titan(41);
    arm.before_joints(|n, joints| (n % 3 == 0).then(|| velocities(joints)));
    arm.calibrate().expect("some velocities", 0, &["ACCEPTED", ": 14 joint", "messages_rejected"]);
    let mut arm = kraft(42);
    arm.before_joints(|n, joints| {
        let effort = ros::JointState { effort: vec![2.0], ..ros::JointState::default() };
        (n < 5).then(|| ros::JointState { header: joints.header.clone(), ..effort })
    });
    arm.calibrate().expect("efforts", 0, &["ACCEPTED", ": 5 joint", "messages_rejected"]);
    let (proposed, map) = arm.propose();
    proposed.expect("efforts", 0, &["written"]);
    arm.calibrate_by(&map).expect("as proposed", 0, &["ACCEPTED"]);
}

#[test]
fn messages_without_names_or_of_other_lengths_are_left_out_and_counted() {
    let mut arm = titan(43);
    arm.before_joints(|n, joints| (n % 2 == 0).then(|| ros::JointState { name: Vec::new(), ..joints.clone() }));
    arm.calibrate().expect("nameless", 3, &["ACCEPTED", ": 20 joint", "messages_rejected"]);
    let mut arm = kraft(44);
    arm.before_joints(|n, joints| {
        let position = joints.position[1..].to_vec();
        (n == 7).then(|| ros::JointState { position, ..joints.clone() })
    });
    arm.calibrate().expect("short", 3, &["ACCEPTED", ": 1 joint", "messages_rejected"]);
}

#[test]
fn a_topic_without_any_position_is_refused_with_the_reasons() {
    let _texts = Texts::of("a_topic_without_any_position_is_refused_with_the_reasons");
    for (mut arm, topic) in [(Scene::bench(), "/joint_states"), (titan(45), TITAN[0]), (kraft(46), KRAFT[0])] {
        arm.joints().for_each(|(_, joints)| *joints = velocities(joints));
        let words = [topic, "40 joint", "readings_missing"];
        arm.calibrate().expect("velocities alone", 2, &words);
    }
}

/// Adds joint number `joint` a second time, `by` away from its position.
fn again(joints: &mut ros::JointState, joint: usize, by: f64) {
    joints.name.push(joints.name[joint].clone());
    joints.position.push(joints.position[joint] + by);
}

#[test]
fn a_joint_twice_with_two_positions_is_refused_or_left_out() {
    let _texts = Texts::of("a_joint_twice_with_two_positions_is_refused_or_left_out");
    let mut bench = Scene::bench();
    bench.joints().for_each(|(_, joints)| again(joints, 2, 0.03));
    let words = ["/joint_states", "40 of 40", "`j3`", "message 1", "message_invalid"];
    bench.calibrate().expect("all messages", 2, &words);
    let mut arm = titan(47);
    arm.joints().for_each(|(_, joints)| again(joints, 1, -250.0));
    arm.calibrate().expect("all messages", 2, &[TITAN[0], "`shoulder_pitch`", "message_invalid"]);
    let mut arm = titan(48);
    arm.joints().skip(3).step_by(10).for_each(|(_, joints)| again(joints, 0, 90.0));
    let words = ["ACCEPTED", ": 4 joint", TITAN[0], "`shoulder_yaw`", "message 4"];
    arm.calibrate().expect("four of them", 3, &words);
    // Equal values are no contradiction; joints outside the arm are not checked.
    let mut arm = kraft(49);
    arm.joints().for_each(|(_, joints)| again(joints, 1, 0.0));
    arm.joints().for_each(|(_, joints)| joints.name.extend(["lamp", "lamp"].map(str::to_owned)));
    arm.joints().for_each(|(_, joints)| joints.position.extend([1.0, 2.0]));
    let said = arm.calibrate();
    said.expect("equal numbers", 0, &["ACCEPTED"]);
    assert!(!said.stderr.contains("twice"), "{said:#?}");
}

#[test]
fn detections_of_nvidias_package_are_read() {
    for (name, mut arm) in [("bench", Scene::bench()), ("titan", titan(50)), ("kraft", kraft(51))] {
        arm.retype_tags(isaac);
        arm.calibrate().expect(name, 0, &["ACCEPTED", "40 views"]);
        let (proposed, map) = arm.propose();
        proposed.expect(name, 0, &["isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray"]);
        arm.calibrate_by(&map).expect(name, 0, &["ACCEPTED"]);
    }
}

#[test]
fn types_of_other_packages_with_the_same_last_name_are_refused_by_their_name() {
    let _texts = Texts::of("types_of_other_packages_with_the_same_last_name_are_refused_by_their_name");
    let types = ["apriltag_ros/msg/AprilTagDetectionArray", "my_msgs/msg/AprilTagDetectionArray", "old_tf/TFMessage"];
    for (name, mut arm) in types.into_iter().zip([Scene::bench(), titan(52), kraft(53)]) {
        arm.retype_tags(|tags| Payload::Named(name, tags));
        let topic = arm.topics[1].clone();
        arm.calibrate().expect(name, 2, &[&topic, name, "message_type"]);
        let (proposed, map) = arm.propose();
        proposed.expect(name, 2, &[&topic, name, "topic_missing"]);
        assert!(!map.exists());
    }
}

fn move_stamp(stamp: &mut ros::Header, by_s: f64) {
    let before = Stamp::try_from(stamp.stamp).expect("a stamp");
    *stamp = header(before.plus_s(by_s), &stamp.frame_id);
}

fn start_at(stamp: &ros::Header, start_s: f64) -> f64 {
    start_s - Stamp::try_from(stamp.stamp).expect("a stamp").since_s(Stamp::default())
}

#[test]
fn clocks_that_differ_are_named_with_the_line_that_helps() {
    let _texts = Texts::of("clocks_that_differ_are_named_with_the_line_that_helps");
    let mut bench = Scene::bench();
    let first = bench.tags().next().expect("a message").1.header.clone();
    let by_s = start_at(&first, 12.3);
    bench.tags().for_each(|(_, tags)| move_stamp(&mut tags.header, by_s));
    let words = ["12.300 s", "2023-11-14T22:13:20.000Z", "1699999987.700 s", "stamps = \"log_time\"", "clocks_differ"];
    bench.calibrate().expect("a camera since boot", 2, &words);
    bench.calibrate_by(&bench.map("stamps = \"log_time\"\n", "")).expect("by log time", 0, &["ACCEPTED"]);
    let (_, map) = bench.propose();
    assert!(read(&map).contains("\nstamps = \"log_time\"\n"), "{}", read(&map));
    bench.calibrate_by(&map).expect("as proposed", 0, &["ACCEPTED"]);

    let mut arm = titan(54);
    let first = arm.joints().next().expect("a message").1.header.clone();
    let by_s = start_at(&first, 90_061.5);
    arm.joints().for_each(|(_, joints)| move_stamp(&mut joints.header, by_s));
    let words = [TITAN[0], "90061.500 s", "clocks_differ", "stamps = \"log_time\""];
    arm.calibrate().expect("an arm since boot", 2, &words);
    arm.calibrate_by(&arm.map("stamps = \"log_time\"\n", "")).expect("by log time", 0, &["ACCEPTED"]);

    let mut arm = kraft(55);
    arm.tags().for_each(|(_, tags)| move_stamp(&mut tags.header, 7200.0));
    arm.calibrate().expect("another time zone", 2, &["7200.000 s", "stamps = \"log_time\""]);
    let (_, map) = arm.propose();
    arm.calibrate_by(&map).expect("as proposed", 0, &["ACCEPTED"]);
}

/// A converter that uses the stamps as log times leaves none that both topics share.
#[test]
fn clocks_that_log_times_share_are_brought_together_by_an_offset() {
    for (name, mut arm, start_s) in
        [("bench", Scene::bench(), 12.3), ("titan", titan(56), 0.75), ("kraft", kraft(57), 4.0e4)]
    {
        let first = arm.tags().next().expect("a message").1.header.clone();
        let by_s = start_at(&first, start_s);
        arm.tags().for_each(|(log, tags)| {
            move_stamp(&mut tags.header, by_s);
            *log = log.plus_s(by_s);
        });
        let said = arm.calibrate();
        said.expect(name, 2, &["clock_offset_s = ", "clocks_differ"]);
        let line = format!("clock_offset_s = {:.3}", -by_s);
        assert!(said.stderr.contains(&line), "{line}: {said:#?}");
        arm.calibrate_by(&arm.map("", &format!("{line}\n"))).expect(name, 0, &["ACCEPTED"]);
        let (_, map) = arm.propose();
        arm.calibrate_by(&map).expect(name, 0, &["ACCEPTED"]);
    }
}

#[test]
fn stamps_of_zero_are_replaced_and_counted() {
    let zero = |header: &mut ros::Header| header.stamp = ros::Time::default();
    let mut bench = Scene::bench();
    bench.joints().for_each(|(_, joints)| zero(&mut joints.header));
    bench.tags().for_each(|(_, tags)| zero(&mut tags.header));
    bench.calibrate().expect("no stamps", 0, &["ACCEPTED", "40 of 40", "/detections", "stamps_replaced"]);
    let mut arm = titan(58);
    arm.tags().for_each(|(_, tags)| zero(&mut tags.header));
    arm.calibrate().expect("no stamps of tags", 0, &["ACCEPTED", "40 of 40", "/wrist/detections", "stamps_replaced"]);
    let mut arm = kraft(59);
    arm.joints().take(3).for_each(|(_, joints)| zero(&mut joints.header));
    arm.calibrate().expect("three", 0, &["ACCEPTED", "3 of 40", "/kraft/joints", "stamps_replaced"]);
}

#[test]
fn the_lens_of_a_recording_is_proposed() {
    let bench = Scene::bench();
    let (proposed, map) = bench.propose();
    proposed.expect("bench", 0, &["written"]);
    assert!(read(&map).contains("camera_info = \"/camera_info\""), "{}", read(&map));
    bench.calibrate_by(&map).expect("as proposed", 0, &["ACCEPTED"]);
    // The topic of another camera has a more similar name; the frame decides.
    let mut arm = titan(60).without_lens();
    let others: Vec<Recorded> = arm
        .messages
        .iter()
        .filter_map(|message| match &message.payload {
            Payload::Info(info) => {
                let mut info = info.clone();
                (info.header.frame_id, info.k[0], info.k[4]) = ("depth".to_owned(), 300.0, 300.0);
                let topic = "/wrist/detections_depth/camera_info".to_owned();
                Some(Recorded { topic, payload: Payload::Info(info), ..message.clone() })
            }
            _ => None,
        })
        .collect();
    arm.messages.extend(others);
    let (_, map) = arm.propose();
    assert!(read(&map).contains("camera_info = \"/wrist/camera_info\""), "{}", read(&map));
    arm.calibrate_by(&map).expect("two cameras", 0, &["ACCEPTED"]);
    // The first messages come from a driver that has not read its calibration yet.
    let mut arm = kraft(61).without_lens();
    arm.infos().take(4).for_each(|info| (info.k, info.d) = ([0.0; 9], Vec::new()));
    let (_, map) = arm.propose();
    arm.calibrate_by(&map).expect(
        "zeros first",
        0,
        &["ACCEPTED", "4 of 40", "/cam0/camera_info", "camera_info_invalid"],
    );
}

#[test]
fn lenses_that_are_of_no_use_are_named_with_what_helps() {
    let _texts = Texts::of("lenses_that_are_of_no_use_are_named_with_what_helps");
    let told = |change: fn(&mut ros::CameraInfo), words: &[&str]| {
        let mut arm = titan(62).without_lens();
        arm.infos().for_each(change);
        arm.calibrate().expect(
            "no lens",
            2,
            &[&["/wrist/camera_info", "robot.toml", "camera_info_invalid"], words].concat(),
        );
        let (proposed, map) = arm.propose();
        proposed.expect("no lens", 0, &["written"]);
        assert!(read(&map).contains("camera_info"), "{}", read(&map));
    };
    told(|info| info.k = [0.0; 9], &["k "]);
    told(
        |info| (info.binning_x, info.binning_y) = (2, 2),
        &["2 x 2", "1224 x 1024", "612 x 512", "resolution_px = [612, 512]", "focal_px = [193.665, 193.530]"],
    );
    told(|info| info.roi = roi([200, 100], [800, 600]), &["200, 100", "800 x 600", "center_px = [433.605, 410.900]"]);
    told(|info| (info.width, info.height) = (0, 0), &["0 x 0"]);
    // Two sizes on one topic: the first is used and the other named.
    let mut arm = kraft(63).without_lens();
    arm.infos().skip(30).for_each(|info| (info.width, info.height) = (612, 512));
    arm.calibrate().expect("two sizes", 0, &["10 of 40", "1224 x 1024", "message 31", "612 x 512"]);
}

fn roi([x_offset, y_offset]: [u32; 2], [width, height]: [u32; 2]) -> ros::RegionOfInterest {
    ros::RegionOfInterest { x_offset, y_offset, height, width, do_rectify: false }
}

/// Halves the pixel coordinates of every corner, as in images of half the size.
#[test]
fn images_of_half_the_size_are_refused_with_both_sizes() {
    for (name, mut arm) in [("bench", Scene::bench()), ("titan", titan(64)), ("kraft", kraft(65))] {
        for corner in arm.tags().flat_map(|(_, tags)| &mut tags.detections).flat_map(|tag| &mut tag.corners) {
            (corner.x, corner.y) = (0.5 * corner.x - 0.25, 0.5 * corner.y - 0.25);
        }
        arm.calibrate().expect(name, 4, &["REFUSED", "input_image_size"]);
    }
}
