//! Parameters, rows, JSON, camchain and tagslam.yaml: exported files are read back.

use std::collections::BTreeMap;
use std::path::Path;

use armcal::calib::{Calibration, MapResult, MapTag, SurveyCoverage};
use armcal::robot::SurveyedTag;
use armcal::tagmap::files::{parse_cameras, parse_tags};
use nalgebra::Matrix4;
use serde_json::Value;

use super::{arm_in, as_calibrated, calibration, calibration_file, export, exported};
use crate::support::{answer, program, read, robot_folder, root, temp, titan, write};

fn sample() -> std::path::PathBuf {
    root().join("recordings/sample/calibration.toml")
}

fn yaml(text: &str) -> Value {
    serde_saphyr::from_str(text).expect("YAML")
}

/// ROS takes lists of one type only, and numbers with a point for doubles.
fn expect_ros_types(value: &Value) {
    match value {
        Value::Object(map) => map.values().for_each(expect_ros_types),
        Value::Array(list) => {
            assert!(!list.is_empty(), "ROS refuses an empty list");
            assert!(list.iter().all(Value::is_string) || list.iter().all(Value::is_f64), "{list:?}");
        }
        Value::Number(number) => assert!(number.is_f64() || number.as_i64() > Some(1 << 40), "{number}"),
        other => assert!(other.is_string(), "{other}"),
    }
}

#[test]
fn ros_parameters_hold_sensors_terms_and_covariance() {
    let told = export(&sample(), Some(&robot_folder()), "ros-parameters");
    told.expect("straight", 0, &[]);
    let parameters = &yaml(&told.stdout)["/**"]["ros__parameters"]["calibration"];
    expect_ros_types(parameters);
    let calibration = Calibration::read(&sample()).expect("it reads");
    for (joint, spec) in calibration.joint.iter().zip(&titan().sensors) {
        let of = &parameters[&joint.name];
        assert_eq!(of["gain_rad_per_count"], joint.gain_rad_per_count);
        assert_eq!(of["offset_rad"], joint.offset_rad);
        assert_eq!(of["center_rad"], joint.center_rad);
        assert_eq!(of["center_counts"], spec.offset_counts + spec.counts_per_rad * spec.center_rad);
        assert_eq!(of["wrap_counts"], spec.wrap_counts);
        assert_eq!(of["terms"], Value::Null);
        if !joint.gain_estimated {
            assert_eq!(of["covariance"], Value::Null);
            continue;
        }
        assert_eq!(of["covariance"]["parameters"], serde_json::json!(["gain", "offset"]));
        let matrix = of["covariance"]["matrix"].as_array().expect("a list");
        let std = |k: usize| matrix[k].as_f64().expect("a number").sqrt();
        let gain_std = joint.gain_std_rad_per_count * spec.counts_per_rad;
        assert!((std(0) / gain_std - 1.0).abs() < 1e-9 && (std(3) / joint.offset_std_rad - 1.0).abs() < 1e-9);
        assert!(matrix.len() == 4 && matrix[1] == matrix[2]);
    }
    let bent = yaml(&exported("ros-parameters"));
    let parameters = &bent["/**"]["ros__parameters"]["calibration"];
    expect_ros_types(parameters);
    let terms = super::calibration().joint[2].terms.clone().expect("terms");
    let of = &parameters["forearm_pitch"]["terms"];
    assert_eq!(of["nonlinearity_rad"], serde_json::json!(terms.nonlinearity_rad.expect("a shape")));
    assert!((of["counts_per_rad"].as_f64().expect("a number") - titan().sensors[2].counts_per_rad).abs() < 1e-6);
    assert_eq!(
        parameters["reference"]["time_nanos"],
        super::calibration().reference.expect("one").time_nanos.expect("a time")
    );
}

#[test]
fn rows_hold_each_joint_with_its_deviations() {
    let text = exported("csv");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<BTreeMap<String, String>> = reader.deserialize().collect::<Result<_, _>>().expect("rows");
    assert_eq!(rows.len(), 6);
    let number = |row: &BTreeMap<String, String>, key: &str| row[key].parse::<f64>().ok();
    for (row, joint) in rows.iter().zip(&calibration().joint) {
        assert_eq!(row["joint"], joint.name);
        assert_eq!(number(row, "gain_rad_per_count"), Some(joint.gain_rad_per_count));
        assert_eq!(number(row, "gain_std_rad_per_count"), Some(joint.gain_std_rad_per_count));
        assert_eq!(number(row, "offset_rad"), Some(joint.offset_rad));
        assert_eq!(number(row, "offset_std_rad"), Some(joint.offset_std_rad));
        assert_eq!(row["offset_estimated"], joint.offset_estimated.to_string());
        assert_eq!([number(row, "covered_low_rad"), number(row, "covered_high_rad")], joint.covered_rad.map(Some));
        let terms = joint.terms.clone().unwrap_or_default();
        let shape = |values: &Option<Vec<f64>>| values.as_ref().map(|values| values[11]);
        assert_eq!(number(row, "nonlinearity_rad_12"), shape(&terms.nonlinearity_rad));
        assert_eq!(number(row, "nonlinearity_rad_std_12"), shape(&terms.nonlinearity_rad_std));
        assert_eq!(number(row, "offset_rad_per_k"), terms.offset_rad_per_k);
        assert_eq!(number(row, "offset_rad_per_k_std"), terms.offset_rad_per_k_std);
    }
}

/// Compares values; the JSON reader may differ in a number's last digit.
fn expect_same(a: &Value, b: &Value, key: &str) {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            assert!(a.keys().eq(b.keys()), "{key}: {:?} {:?}", a.keys(), b.keys());
            a.iter().for_each(|(key, value)| expect_same(value, &b[key], key));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{key}");
            a.iter().zip(b).for_each(|(a, b)| expect_same(a, b, key));
        }
        (Value::Number(a), Value::Number(b)) => {
            let [a, b] = [a, b].map(|number| number.as_f64().expect("a double"));
            assert!((a - b).abs() <= 1e-15 * a.abs(), "{key}: {a} {b}");
        }
        _ => assert_eq!(a, b, "{key}"),
    }
}

#[test]
fn json_has_what_yaml_has() {
    for file in [sample(), calibration_file()] {
        let [json, yaml_text] = ["json", "yaml"].map(|form| export(&file, None, form).stdout);
        let json: Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(json["joint"].as_array().map(Vec::len), Some(6));
        expect_same(&json, &yaml(&yaml_text), "");
    }
    let json: Value = serde_json::from_str(&export(&sample(), None, "json").stdout).expect("JSON");
    assert_eq!(json["covariance"]["rows"].as_array().map(Vec::len), Some(10));
}

#[test]
fn the_camchain_is_the_robots_camera_at_its_calibrated_place() {
    let text = exported("kalibr");
    let read = parse_cameras(Path::new("camchain.yaml"), &text).expect("it reads");
    let camera = titan().camera;
    let (found, lens) = (&read[0].model, &camera.lens);
    assert_eq!((read.len(), read[0].name.as_str()), (1, "cam0"));
    assert_eq!((found.focal_px(), found.center_px()), (lens.focal_px(), lens.center_px()));
    assert_eq!(found.resolution_px(), lens.resolution_px());
    let bearing = nalgebra::Vector3::new(0.4, -0.3, 1.0);
    assert_eq!(found.project(&bearing), lens.project(&bearing), "the same distortion");
    let of = &yaml(&text)["cam0"];
    assert_eq!(of["link"], "wrist_yaw_link");
    let written = Matrix4::from_fn(|i, k| of["T_link_camera"][i][k].as_f64().expect("a number"));
    let calibrated = as_calibrated(&titan(), &calibration()).camera.mount.link_from_frame.to_homogeneous();
    assert!((written - calibrated).amax() < 1e-15, "{written}");
    let folder = temp();
    write(&folder.path().join("camchain.yaml"), &text);
    let mut command = program();
    command.current_dir(folder.path()).arg("new-robot").arg(robot_folder().join("titan4.urdf"));
    answer(command.args(["--out", "made", "--lens", "camchain.yaml"])).expect("new-robot", 0, &[]);
    let back = arm_in(&folder.path().join("made")).camera.lens;
    assert_eq!((back.intrinsics(), back.resolution_px()), (lens.intrinsics(), lens.resolution_px()));
    let drawn = yaml(&export(&sample(), Some(&robot_folder()), "kalibr").stdout);
    let x = drawn["cam0"]["T_link_camera"][0][3].as_f64().expect("a number");
    assert!((x + 0.124).abs() < 1e-12, "the drawing's, where the calibration has none");
}

/// The user names one of several cameras in a file; each arm has another one.
#[test]
fn a_camera_of_a_camchain_is_chosen_by_its_name() {
    let folder = temp();
    let camera = |name: &str, focal_px: f64, model: &str| {
        format!(
            "{name}:\n  camera_model: pinhole\n  intrinsics: [{focal_px}, {focal_px}, 320.5, 240.5]\n  \
             distortion_model: {model}\n  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]\n  resolution: [640, 480]\n"
        )
    };
    let cameras = [("cam0", 610.0, "radtan"), ("cam1", 450.5, "equidistant"), ("cam2", 820.25, "radtan")];
    let text: String = cameras.iter().map(|(name, focal_px, model)| camera(name, *focal_px, model)).collect();
    write(&folder.path().join("chain.yaml"), &text);
    write(&folder.path().join("one.yaml"), &camera("left", 500.0, "radtan"));
    let new_robot = |urdf: &str, out: &str, options: &[&str]| {
        let mut command = program();
        command.current_dir(folder.path()).arg("new-robot").arg(root().join("robots").join(urdf));
        answer(command.args(["--out", out]).args(options))
    };
    let urdfs = ["titan4/titan4.urdf", "kraft-predator/kraft-predator.urdf", "../tests/golden/bench/arm.urdf"];
    for (urdf, (name, focal_px, _)) in urdfs.into_iter().zip(cameras) {
        let refused = new_robot(urdf, name, &["--lens", "chain.yaml"]);
        refused.expect("none named", 2, &["chain.yaml", "--lens-camera", "cam0", "cam1", "cam2", "[name_unknown]"]);
        assert!(!folder.path().join(name).exists());
        new_robot(urdf, name, &["--lens", "chain.yaml", "--lens-camera", name]).expect(name, 0, &[]);
        assert_eq!(arm_in(&folder.path().join(name)).camera.lens.focal_px(), [focal_px; 2]);
    }
    let absent = new_robot(urdfs[0], "absent", &["--lens", "chain.yaml", "--lens-camera", "cam3"]);
    absent.expect("absent", 2, &["`cam3`", "cam0", "[name_unknown]"]);
    new_robot(urdfs[0], "alone", &["--lens", "one.yaml"]).expect("its only one", 0, &[]);
    new_robot(urdfs[0], "no-file", &["--lens-camera", "cam0"]).expect("no file", 2, &["--lens"]);
}

#[test]
fn cameras_of_one_link_have_kalibrs_pose_between_them() {
    let mut robot = titan();
    let mut second = robot.camera.clone();
    second.name = "second".to_owned();
    second.mount.link_from_frame *= nalgebra::Translation3::new(0.1, 0.0, 0.0);
    robot.further_cameras.push(second.clone());
    second.mount.n_joints -= 1;
    robot.further_cameras.push(second);
    let sample = Calibration::parse(&sample(), &read(&sample())).expect("it reads");
    let found = yaml(&armcal::export::camchain(Path::new("c.toml"), &sample, &robot).expect("a chain"));
    let between = Matrix4::from_fn(|i, k| found["cam1"]["T_cn_cnm1"][i][k].as_f64().expect("a number"));
    let expected = Matrix4::new_translation(&nalgebra::Vector3::new(-0.1, 0.0, 0.0));
    assert!((between - expected).amax() < 1e-12, "{between}");
    assert!(found["cam2"]["T_cn_cnm1"].is_null(), "on another link it is no constant");
}

fn mapped(tag: &SurveyedTag) -> MapTag {
    MapTag {
        id: tag.id,
        size_m: tag.size_m,
        position_m: [0.1 * f64::from(tag.id), -0.2, 0.3],
        quaternion_wxyz: [0.5, 0.5, -0.5, 0.5],
        position_std_m: [0.001, 0.002, 0.0],
        rotation_std_rad: [0.01, 0.0, 0.02],
        n_views: 3,
    }
}

#[test]
fn tags_of_a_map_are_read_back_from_tagslams_file() {
    let folder = temp();
    let file = folder.path().join("mapped.toml");
    let tag: Vec<MapTag> = titan().tags.iter().map(mapped).collect();
    let map = MapResult {
        known: SurveyCoverage::BaseTagAlone,
        frame: "base_link".to_owned(),
        base_tag: 0,
        views: 3,
        rms_px: 0.2,
        rejected: 0,
        left_out: Vec::new(),
        tag: tag.clone(),
    };
    write(&file, &Calibration { map: Some(map), ..calibration() }.to_toml());
    let told = export(&file, None, "tagslam");
    told.expect("tagslam", 0, &[]);
    let read = parse_tags(Path::new("tagslam.yaml"), &told.stdout).expect("it reads");
    assert_eq!((read.frame.as_str(), read.bodies.len(), read.tags.len()), ("base_link", 1, tag.len()));
    assert!(read.bodies[0].is_static && tag.len() > 3);
    for (found, tag) in read.tags.iter().zip(&tag) {
        assert_eq!((found.id, found.size_m), (tag.id, tag.size_m));
        let pose = found.pose.expect("a pose");
        assert_eq!(<[f64; 3]>::from(pose.translation.vector), tag.position_m);
        let q = pose.rotation.coords;
        let turned = nalgebra::Vector4::from([0.5, -0.5, 0.5, 0.5]);
        assert!((q - turned).norm().min((q + turned).norm()) < 1e-12, "{q}");
        // A tag that was held has the smallest standard deviation for TagSLAM.
        assert_eq!(found.std, Some([0.001, 0.002, 1e-4, 0.01, 1e-5, 0.02]));
    }
    export(&calibration_file(), None, "tagslam").expect("no map", 2, &["calibration.toml", "map", "missing"]);
}
