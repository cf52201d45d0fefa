//! Files of other programs, read and written.

use std::path::Path;

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};

use crate::tagmap::files::written::{WrittenGroup, WrittenTag};
use crate::tagmap::files::{NamedCamera, TagFile, cameras_to_yaml, own, parse_cameras, parse_tags, tagslam};
use armcal_core::optics::{Fisheye, LensModel, Radtan};
use armcal_core::time::Stamp;

fn tags(name: &str, text: &str) -> TagFile {
    parse_tags(Path::new(name), text).unwrap()
}

fn refusal(name: &str, text: &str) -> String {
    parse_tags(Path::new(name), text).unwrap_err().to_string()
}

const TAGSLAM: &str = r#"
tagslam_parameters:
  optimizer_mode: fast # of no interest here
body_defaults:
  position_noise: 0.05
  rotation_noise: 0.01
default_body: hall
bodies:
 - hall:
     is_static: true
     default_tag_size: 0.2
     max_hamming_distance: 1
     ignore_tags: [7, 9]
     type: simple
     tags:
       - id: 2
         size: 0.16
         pose:
           position: {x: 0, y: 1, z: 2.5}
           rotation:
             x: 0
             y: 1.5707963267948966
             z: 0
           position_noise: {x: 0.001, y: 0.002, z: 0.003}
       - id: 3
 - cart:
     is_static: false
     type: board
     board:
       tag_start_id: 20
       tag_size: 0.05
       tag_spacing: 0.5
       tag_rows: 2
       tag_columns: 3
       tag_rotation_noise: 0.002
       tag_position_noise: 0.001
 - wall:
     is_static: true
     type: staggered_board
     staggered_board:
       tag_start_id: 40
       tag_size: 0.1
       tag_spacing: 1.0
       tag_rows: 2
       tag_columns: 3
 - rig:
     is_static: false
     type: simple
     odom_topic: /odom
plane_measurements:
  - plane_1: {tags: [2], distance: 0.0, noise: 0.01, direction: [0.0, 0.0, 1.0]}
squash:
  - time: "1533224423.510462496"
    tags: [26]
tag_id_remap:
  - id: 20
    remaps:
      - remap_id: 420
        camera: cam3
        start_time: 1530000000.000000000
        end_time:   1533224459.556192840
"#;

#[test]
fn a_tagslam_file_is_read_with_bodies_boards_and_rules() {
    let file = tags("tagslam.yaml", TAGSLAM);
    let names: Vec<(&str, bool)> = file.bodies.iter().map(|body| (body.name.as_str(), body.is_static)).collect();
    assert_eq!(names, [("hall", true), ("cart", false), ("wall", true), ("rig", false)]);
    assert_eq!((file.frame.as_str(), file.default_tag, file.max_hamming), ("hall", Some((0.2, 0)), Some(1)));
    assert!(file.ignored.iter().eq(&[7, 9]));
    let tag = |id: u32| file.tags.iter().find(|tag| tag.id == id).unwrap();
    // Axis times angle: a quarter turn about y takes z to x.
    let pose = tag(2).pose.unwrap();
    assert!((pose * Vector3::z() - Vector3::x()).norm() < 1e-12);
    assert_eq!(pose.translation.vector, Vector3::new(0.0, 1.0, 2.5));
    assert_eq!(tag(2).std, Some([0.001, 0.002, 0.003, 0.01, 0.01, 0.01]));
    assert_eq!((tag(3).size_m, tag(3).pose), (0.2, None));
    // Boards have rows upwards; staggered ones have rows downwards with every other place empty.
    let place = |id: u32| tag(id).pose.unwrap().translation.vector;
    assert!((place(24) - Vector3::new(0.075, 0.075, 0.0)).norm() < 1e-12 && tag(24).body == 1);
    assert!((place(42) - Vector3::new(0.2, -0.2, 0.0)).norm() < 1e-12 && tag(42).body == 2);
    assert_eq!(file.tags.iter().filter(|tag| tag.body == 2).count(), 3);
    assert_eq!(file.squashed[0].0, Stamp { nanos: 1_533_224_423_510_462_496 });
    let remap = &file.remaps[0];
    assert_eq!((remap.id, remap.as_id, remap.camera.as_deref()), (20, 420, Some("cam3")));
    assert_eq!(remap.to, Stamp { nanos: 1_533_224_459_556_192_840 });
    assert_eq!(file.ignored_keys, ["bodies.rig.odom_topic", "plane_measurements"]);
}

/// TagSLAM's rule: both are above zero, and tags without a pose stay without one.
#[test]
fn a_body_of_a_tagslam_file_may_replace_the_noise_of_its_tags() {
    let stds = |keys: &str| {
        let file = tags("tagslam.yaml", &TAGSLAM.replacen("     ignore_tags", &format!("{keys}     ignore_tags"), 1));
        [2, 3, 24].map(|id| file.tags.iter().find(|tag| tag.id == id).unwrap().std)
    };
    let position = "     override_tag_position_noise: 0.5\n";
    let both = format!("{position}     override_tag_rotation_noise: 0.1\n");
    let [own, _, of_board] = stds("");
    assert_eq!(stds(&both), [Some([0.5, 0.5, 0.5, 0.1, 0.1, 0.1]), None, of_board]);
    assert_eq!(stds(position)[0], own);
    assert_eq!(stds(&both.replace("0.1", "-1"))[0], own);
    let wrong = TAGSLAM.replacen("     ignore_tags", "     override_tag_position_noise: -3\n     ignore_tags", 1);
    insta::assert_snapshot!("body_noise", refusal("tagslam.yaml", &wrong));
}

#[test]
fn what_is_wrong_with_a_tag_file_is_said_with_file_key_and_range() {
    let with = |from: &str, to: &str| {
        assert!(TAGSLAM.contains(from));
        refusal("tagslam.yaml", &TAGSLAM.replacen(from, to, 1))
    };
    let changes = [
        ("size: 0.16", "size: 0"),
        ("size: 0.16", "size: -0.16"),
        ("default_tag_size: 0.2", "default_tag_size: 0"),
        ("tag_size: 0.05", "tag_size: 0"),
        ("id: 3", "id: 2"),
        ("default_body: hall", "default_body: attic"),
        ("type: board", "type: sphere"),
        ("1533224423.510462496", "noon"),
    ];
    let mut words = changes.map(|(from, to)| with(from, to)).to_vec();
    let own = "version = 1\nkind = \"tag_map\"\nframe = \"base\"\n[[tag]]\nid = 2\nsize_m = 0.0\n";
    words.extend([
        refusal("tagslam.yaml", "bodies: 3"),
        refusal("tags.json", "{}"),
        refusal("map.toml", own),
        refusal("map.toml", &own.replace("= 1\n", "= 3\n")),
        refusal("map.toml", &own.replace("size_m", "sise_m")),
    ]);
    insta::assert_snapshot!("tag_files", words.join("\n"));
}

/// A few lines of a file describe millions of tags.
#[test]
fn boards_of_many_tags_are_refused_before_they_are_laid_out() {
    let board = |k: u32, rows: u32| {
        format!(
            " - b{k}:\n     is_static: true\n     type: board\n     board:\n       tag_start_id: {}\n       \
             tag_size: 0.05\n       tag_spacing: 0.5\n       tag_rows: {rows}\n       tag_columns: 100\n",
            k * 10_000
        )
    };
    let file = |n: u32, rows: u32| format!("bodies:\n{}", (0..n).map(|k| board(k, rows)).collect::<String>());
    assert_eq!(tags("a.yaml", &file(1, 50)).tags.len(), 5000);
    // The second board already exceeds the limit: none of the thousand others is laid out.
    let words = [file(1, 51), file(1000, 50)].map(|text| refusal("a.yaml", &text));
    insta::assert_snapshot!("many_tags", words.join("\n"));
}

#[test]
fn kalibrs_grid_is_a_board_of_known_places() {
    let text = "target_type: 'aprilgrid' # of Kalibr\ntagCols: 6\ntagRows: 2\ntagSize: 0.088\ntagSpacing: 0.3\n";
    let file = tags("april_6x2.yaml", text);
    assert_eq!(file.tags.len(), 12);
    let place = file.tags[7].pose.unwrap().translation.vector;
    assert!((place - Vector3::new(0.044 + 0.1144, 0.044 + 0.1144, 0.0)).norm() < 1e-12, "{place}");
    let changes = [("aprilgrid", "checkerboard"), ("0.088", "0"), ("tagCols: 6\n", "")];
    let words = changes.map(|(from, to)| refusal("a.yaml", &text.replace(from, to)));
    insta::assert_snapshot!("kalibr_grid", words.join("\n"));
}

const CAMERAS: &str = "
cam0:
  camera_model: pinhole
  intrinsics: [465.609, 465.632, 622.637, 513.902]
  distortion_model: equidistant
  distortion_coeffs: [-0.0229515, 0.01625, -0.00961832, 0.00176252]
  resolution: [1280, 1024]
  rostopic: /left/image_raw
  tagtopic: /left/tags
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.16, 0.09, -0.0002, -0.0002]
  distortion_model: radtan
  intrinsics: [1502.4, 1500.6, 1025.7, 1030.5]
  resolution: [2048, 2048]
  rostopic: /right/image_raw
";

#[test]
fn cameras_of_tagslam_and_kalibr_are_read_and_written() {
    let cameras = parse_cameras(Path::new("cameras.yaml"), CAMERAS).unwrap();
    assert_eq!(cameras.len(), 2);
    let LensModel::Equidistant(lens) = cameras[0].model.lens else { panic!("{:?}", cameras[0]) };
    assert_eq!((lens.focal_px, lens.center_px), ([465.609, 465.632], [622.637, 513.902]));
    assert!(lens.is_monotonic() && lens.max_view_angle_rad > 1.6, "{}", lens.max_view_angle_rad);
    assert_eq!(cameras[0].tag_topic.as_deref(), Some("/left/tags"));
    let LensModel::Radtan(lens) = cameras[1].model.lens else { panic!("{:?}", cameras[1]) };
    assert_eq!(lens.distortion, [-0.16, 0.09, -0.0002, -0.0002, 0.0]);
    let again = parse_cameras(Path::new("cameras.yaml"), &cameras_to_yaml(&cameras)).unwrap();
    assert_eq!(again, cameras);
    let plain = NamedCamera {
        model: Radtan::new([900.0; 2], [640.0, 512.0], [0.0; 5], [1280, 1024]).into(),
        ..cameras[0].clone()
    };
    assert_eq!(parse_cameras(Path::new("c"), &cameras_to_yaml(std::slice::from_ref(&plain))).unwrap(), [plain]);
}

#[test]
fn the_camera_file_of_ros_is_read_as_its_message_would_be() {
    let text = "image_width: 800\nimage_height: 600\ncamera_name: wrist\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [410.5, 0, 400.25, 0, 411, 299, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  \
        rows: 1\n  cols: 5\n  data: [-0.2, 0.05, 0.001, -0.002, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  \
        data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";
    let cameras = parse_cameras(Path::new("ost.yaml"), text).expect("it reads");
    let [camera] = &cameras[..] else { panic!("one camera") };
    assert_eq!((camera.name.as_str(), camera.model.resolution_px()), ("wrist", [800, 600]));
    assert_eq!((camera.model.focal_px(), camera.model.center_px()), ([410.5, 411.0], [400.25, 299.0]));
    assert_eq!(camera.model.distortion(), [-0.2, 0.05, 0.001, -0.002, 0.0]);
    // OpenCV's own file states no model; five coefficients have only one.
    let opencv = text.replace("distortion_model: plumb_bob\n", "");
    assert_eq!(parse_cameras(Path::new("ost.yaml"), &opencv).expect("it reads")[0].model, camera.model);
    let changes = [
        ("410.5, 0, 400.25, ", "410.5, "),
        ("plumb_bob", "thin_prism"),
        ("410.5", "0.5"),
        ("image_width: 800\n", ""),
        (
            "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.2, 0.05, 0.001, \
             -0.002, 0]",
            "distortion_coefficients:\n  data: [-0.2, 0.05, 0.001, -0.002]",
        ),
    ];
    let told = changes.map(|(from, to)| {
        assert!(text.contains(from), "{from}");
        parse_cameras(Path::new("ost.yaml"), &text.replace(from, to)).expect_err(to).to_string()
    });
    insta::assert_snapshot!("ros_camera_files", told.join("\n"));
}

#[test]
fn what_is_wrong_with_a_camera_is_said_with_file_key_and_what_is_supported() {
    let with = |from: &str, to: &str| {
        assert!(CAMERAS.contains(from));
        parse_cameras(Path::new("cameras.yaml"), &CAMERAS.replacen(from, to, 1)).unwrap_err().to_string()
    };
    let changes = [
        ("distortion_model: equidistant", "distortion_model: omni"),
        ("camera_model: pinhole", "camera_model: ds"),
        ("0.00176252]", "0.00176252, 0.0]"),
        ("[465.609, ", "["),
        ("[465.609", "[-465.609"),
        ("[1280, 1024]", "[1280]"),
    ];
    let mut words = changes.map(|(from, to)| with(from, to)).to_vec();
    words.push(parse_cameras(Path::new("c.yaml"), "{}").unwrap_err().to_string());
    insta::assert_snapshot!("camera_files", words.join("\n"));
}

fn group(frame: &str, ids: [u32; 2]) -> WrittenGroup {
    let tag = |id: u32| {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.2, 0.1 * f64::from(id)));
        let pose = Isometry3::from_parts(Translation3::new(0.1, -0.2, f64::from(id) / 3.0), turn);
        let std = [1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.03];
        let covariance = Matrix6::from_diagonal(&std.map(|s: f64| s * s).into());
        WrittenTag { id, size_m: 0.16, pose, position_std_m: [1e-3, 2e-3, 3e-3], covariance }
    };
    WrittenGroup { frame: frame.to_owned(), is_static: true, tags: ids.map(tag).to_vec() }
}

#[test]
fn maps_that_are_written_read_back_the_same() {
    let groups = [group("base_link", [2, 5]), WrittenGroup { is_static: false, ..group("seafloor", [11, 12]) }];
    for (name, text) in [("map.toml", own::to_text(&groups, None)), ("map.yaml", tagslam::to_text(&groups))] {
        let file = tags(name, &text);
        assert_eq!(file.frame, "base_link", "{name}");
        let names: Vec<(&str, bool)> = file.bodies.iter().map(|body| (body.name.as_str(), body.is_static)).collect();
        assert_eq!(names, [("base_link", true), ("seafloor", false)], "{name}");
        assert_eq!(file.tags.len(), 4, "{name}");
        for (body, group) in groups.iter().enumerate() {
            for tag in &group.tags {
                let read = file.tags.iter().find(|read| read.id == tag.id).unwrap();
                assert_eq!((read.size_m, read.body), (tag.size_m, body));
                let pose = read.pose.unwrap();
                assert!((pose.to_homogeneous() - tag.pose.to_homogeneous()).norm() < 1e-14, "{name}");
                let [.., c, d, e, f] = read.std.unwrap();
                assert!((c - 3e-3).abs() < 1e-15 && (d - 0.01).abs() < 1e-15, "{name}");
                assert!((e - 0.02).abs() < 1e-15 && (f - 0.03).abs() < 1e-15, "{name}");
            }
        }
    }
}

/// The anchor has half the weight of two tags; tags of another frame do not share its error.
#[test]
fn the_error_of_an_anchor_counts_in_every_tag_of_its_frame() {
    let groups = [group("base_link", [2, 5]), group("seafloor", [11, 12])];
    let [alone, anchored] = [None, Some(2)].map(|anchor| tags("map.toml", &own::to_text(&groups, anchor)));
    let std = |file: &TagFile, id: u32| file.tags.iter().find(|tag| tag.id == id).and_then(|tag| tag.std).unwrap();
    for id in [11, 12] {
        assert_eq!(std(&anchored, id), std(&alone, id));
    }
    for (now, before) in std(&anchored, 2).iter().zip(std(&alone, 2)) {
        let shared: f64 = if before > 5e-3 { 0.03 } else { 3e-3 };
        let expected = (before * before + shared.min(before).powi(2)).sqrt();
        assert!((now / expected - 1.0).abs() < 1e-9, "{now} {expected}");
    }
    assert!((0..6).all(|k| std(&anchored, 5)[k] > 1.5 * std(&alone, 5)[k]));
}

#[test]
fn the_widest_view_of_a_fisheye_ends_where_bearings_are_no_longer_unique() {
    // The function theta - 0.1 theta^3 has its maximum at 1.826.
    let lens = Fisheye::with_widest_view([200.0; 2], [600.0; 2], [-0.1, 0.0, 0.0, 0.0], [1200, 1200]);
    assert!((1.80..1.826).contains(&lens.max_view_angle_rad), "{}", lens.max_view_angle_rad);
}
