//! Accepted input maps, and the errors of the others.

use super::*;

const GOOD: &str = "version = 1\nkind = \"input\"\n\
    [joint_sensors]\ntopic = \"/joint_states\"\n[tags]\ntopic = \"/tf\"\n\
    camera_frame = \"/fisheye\"\nchild_frame = \"tag36h11:{id}\"\nuse = \"position\"\n";

pub(super) fn parse(text: &str) -> Result<InputMap, String> {
    parse_input_map(Path::new("map.toml"), text).map_err(|error| error.to_string())
}

/// Messages about `good` after each replacement of a text.
pub(super) fn told(good: &str, faults: &[(&str, &str)]) -> String {
    let one = |(from, to): &(&str, &str)| {
        assert!(good.contains(from), "{from}");
        let problem = parse(&good.replacen(from, to, 1)).expect_err(to);
        format!("{from:?} -> {to:?}\n  {problem}\n")
    };
    faults.iter().map(one).collect()
}

#[test]
fn frames_are_told_with_and_without_slash_and_by_number() {
    let map = parse(GOOD).expect("good");
    let Source::Topics(topics) = &map.source else { panic!("topics") };
    assert_eq!(topics.camera_frame.as_deref(), Some("fisheye"));
    let frame = map.child_frame.expect("a frame");
    assert_eq!(frame.id_of("tag36h11:7"), Some(7));
    assert_eq!(frame.id_of("/tag36h11:12"), Some(12));
    for other in ["tag36h11:", "tag36h11:+7", "tag36h11:7b", "tag25h9:7", "tag36h11:99999999999"] {
        assert_eq!(frame.id_of(other), None, "{other}");
    }
    let plain = parse(&GOOD.replace("tag36h11:{id}", "board")).expect("good").child_frame.expect("a frame");
    assert_eq!((plain.id_of("board"), plain.id_of("/board"), plain.id_of("board2")), (Some(0), Some(0), None));
}

#[test]
fn what_is_wrong_is_named_with_file_and_key() {
    let faults = [
        ("[tags]", "[conditions]\nattitude = \"/tf\"\n[tags]"),
        ("[tags]", "[conditions]\nattitude = \"/imu\"\nattitude_in_base_wxyz = [1.0, 1.0, 0.0, 0.0]\n[tags]"),
        ("[tags]", "[conditions]\nattitude_in_base_wxyz = [1.0, 0.0, 0.0, 0.0]\n[tags]"),
        ("[tags]", "[conditions]\noil_temperature = \"/tf\"\n[tags]"),
        ("[tags]", "[conditions]\nwater = \"/w\"\n[tags]"),
        ("[tags]", "[tags]\nfamily = \"36h10\""),
        ("[tags]", "[tags]\nimage_period_s = -1.0"),
        ("version = 1", "version = 2"),
        ("version = 1", "version = 1\nmax_gap_s = -1.0"),
        ("version = 1", "version = 1\nmax_gap_s = nan"),
        ("[tags]", "[tags]\nframe = \"x\""),
        ("\"position\"", "\"posiiton\""),
        ("{id}", "{ids}"),
        ("{id}", "{id}{id}"),
        ("camera_frame = \"/fisheye\"\n", ""),
        ("child_frame = \"tag36h11:{id}\"\n", ""),
        ("topic = \"/tf\"", "topic = \"/joint_states\""),
    ];
    insta::assert_snapshot!("input_map", told(GOOD, &faults));
}

#[test]
fn corners_need_no_frames() {
    let text = "version = 1\nkind = \"input\"\nmax_gap_s = 0.1\nwhile_moving = \"use\"\nnot_finite = \"leave_out\"\n\
        [joint_sensors]\ntopic = \"/a\"\nnames = { elbow = \"j3\" }\n[tags]\ntopic = \"/b\"\nuse = \"corners\"\n";
    let map = parse(text).expect("good");
    let Source::Topics(topics) = &map.source else { panic!("topics") };
    assert_eq!((&topics.camera_frame, &map.child_frame, map.max_gap_s), (&None, &None, 0.1));
    assert_eq!((map.while_moving, map.not_finite), (WhileMoving::Use, NotFinite::LeaveOut));
    assert_eq!(map.joint_names["elbow"], "j3");
}

/// Two equal names of one map, and a name that is another joint's own, are refused. Exchanged names and a distal joint
/// without readings are accepted.
#[test]
fn each_joint_has_a_recorded_name_of_its_own() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
    let robot = crate::robot::load(&folder).expect("the robot reads");
    let joints = robot.joint_names();
    let [a, b] = [&joints[1], &joints[2]];
    let last = joints.last().expect("joints");
    assert!(robot.n_seen_joints() < joints.len(), "the last joint is beyond the camera");
    let checked = |names: String| {
        let map = parse(&GOOD.replace("[tags]", &format!("names = {{ {names} }}\n[tags]"))).expect("a map");
        map.check_robot(Path::new("map.toml"), &robot)
    };
    for shared in [format!("{a} = \"{b}\""), format!("{a} = \"q\", {b} = \"q\""), format!("{last} = \"{b}\"")] {
        let issue = checked(shared.clone()).expect_err(&shared);
        assert_eq!((issue.code, issue.key.as_str()), (Code::ValueDuplicate, "joint_sensors.names"), "{issue}");
    }
    for good in [format!("{a} = \"{b}\", {b} = \"{a}\""), format!("{a} = \"{last}\""), String::new()] {
        assert!(checked(good.clone()).is_ok(), "{good}");
    }
}

#[test]
fn the_order_of_corners_is_for_detections_of_tags() {
    use crate::codes::Coded;
    let code = |text: &str| parse_input_map(Path::new("map.toml"), text).expect_err("refused").code();
    let of_positions = GOOD.replace("use = ", "corner_order = \"opencv\"\nuse = ");
    assert_eq!(code(&of_positions), Code::KeysConflict);
    let of_a_table = "version = 1\nkind = \"input\"\n[table]\n[joint_sensors]\n[tags]\ncorner_order = \"opencv\"\n\
                      use = \"corners\"\n[tags.columns]\nid = \"id\"\n\
                      corners = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\", \"g\", \"h\"]\n";
    assert_eq!(code(of_a_table), Code::KeysConflict);
    assert!(parse(&of_a_table.replace("corner_order = \"opencv\"\n", "")).is_ok());
}
