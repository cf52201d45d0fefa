//! What input maps are taken, and what is named of the others.

use super::*;

const GOOD: &str = "version = 1\n[joint_sensors]\ntopic = \"/joint_states\"\n[tags]\ntopic = \"/tf\"\n\
    camera_frame = \"/fisheye\"\nchild_frame = \"tag36h11:{id}\"\nuse = \"position\"\n";

fn parse(text: &str) -> Result<InputMap, String> {
    parse_input_map(Path::new("map.toml"), text).map_err(|error| error.to_string())
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
    let faults: [(&str, &str, &[&str]); 17] = [
        ("[tags]", "[conditions]\nattitude = \"/tf\"\n[tags]", &["conditions", "twice"]),
        (
            "[tags]",
            "[conditions]\nattitude = \"/imu\"\nattitude_in_base_wxyz = [1.0, 1.0, 0.0, 0.0]\n[tags]",
            &["conditions.attitude_in_base_wxyz", "length 1"],
        ),
        (
            "[tags]",
            "[conditions]\nattitude_in_base_wxyz = [1.0, 0.0, 0.0, 0.0]\n[tags]",
            &["conditions.attitude_in_base_wxyz", "conditions.attitude"],
        ),
        ("[tags]", "[conditions]\noil_temperature = \"/tf\"\n[tags]", &["conditions", "twice"]),
        ("[tags]", "[conditions]\nwater = \"/w\"\n[tags]", &["water", "oil_temperature", "pressure"]),
        ("[tags]", "[tags]\nfamily = \"36h10\"", &["tags.family", "36h10", "25h9"]),
        ("[tags]", "[tags]\nimage_period_s = -1.0", &["tags.image_period_s", "3600"]),
        ("version = 1", "version = 2", &["version", "1 .. 1"]),
        ("version = 1", "version = 1\nmax_gap_s = -1.0", &["max_gap_s", "60"]),
        ("version = 1", "version = 1\nmax_gap_s = nan", &["max_gap_s", "NaN"]),
        ("[tags]", "[tags]\nframe = \"x\"", &["frame", "unknown field"]),
        ("\"position\"", "\"posiiton\"", &["posiiton", "position", "pose", "corners"]),
        ("{id}", "{ids}", &["tags.child_frame", "{ids}"]),
        ("{id}", "{id}{id}", &["tags.child_frame"]),
        ("camera_frame = \"/fisheye\"\n", "", &["tags.camera_frame", "missing"]),
        ("child_frame = \"tag36h11:{id}\"\n", "", &["tags.child_frame", "missing"]),
        ("topic = \"/tf\"", "topic = \"/joint_states\"", &["tags.topic"]),
    ];
    for (from, to, words) in faults {
        assert!(GOOD.contains(from), "{from}");
        let problem = parse(&GOOD.replacen(from, to, 1)).expect_err(to);
        for word in words.iter().chain(&["map.toml"]) {
            assert!(problem.contains(word), "{to}: no `{word}` in {problem}");
        }
    }
}

#[test]
fn corners_need_no_frames() {
    let text = "version = 1\nmax_gap_s = 0.1\nwhile_moving = \"use\"\nnot_finite = \"leave_out\"\n\
        [joint_sensors]\ntopic = \"/a\"\nnames = { elbow = \"j3\" }\n[tags]\ntopic = \"/b\"\nuse = \"corners\"\n";
    let map = parse(text).expect("good");
    let Source::Topics(topics) = &map.source else { panic!("topics") };
    assert_eq!((&topics.camera_frame, &map.child_frame, map.max_gap_s), (&None, &None, 0.1));
    assert_eq!((map.while_moving, map.not_finite), (WhileMoving::Use, NotFinite::LeaveOut));
    assert_eq!(map.joint_names["elbow"], "j3");
}
