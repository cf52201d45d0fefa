//! Robot folders of any arm: contents of URDFs that are accepted, optional keys of robot.toml, and the folders that
//! `new-robot` writes.

use std::path::{Path, PathBuf};

use armcal::robot::{Shape, load};

use crate::support::external::{AS_IN_2018, INPUT_MAP, RealTitan, TAG_NOISE, write_poses};
use crate::support::texts::Texts;
use crate::support::{Answer, ShortRoutine, answer, edit, program, read, robot_copy, root, run, temp, titan, write};

/// The lens that a user adds to a new robot.toml, for the simulator.
const LENS: &str = "model = \"equidistant\"\nmax_view_angle_rad = 1.4\nresolution_px = [1224, 1024]\n\
                    focal_px = [387.0, 387.0]\ncenter_px = [611.5, 511.5]\ndistortion = [0.0, 0.0, 0.0, 0.0]\n";

/// A tetrahedron of 0.1 m, as OBJ.
const OBJ: &str = "v 0 0 0\nv 0 100 0\nv 100 0 0\nv 0 0 100\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 3 2 4\n";

/// The tetrahedron as COLLADA, with the same scale of 0.001 in the URDF: half as large, doubled by a node, 1 m along z
/// and back.
const DAE: &str = "<COLLADA><asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset><library_geometries>\
    <geometry id=\"g\"><mesh>\
    <source id=\"s\"><float_array>0 0 500 0 50 500 50 0 500 0 0 550</float_array></source>\
    <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices>\
    <triangles><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2 0 2 3 0 3 1 2 1 3</p></triangles>\
    </mesh></geometry></library_geometries><library_visual_scenes><visual_scene id=\"w\">\
    <node><scale>2 2 2</scale><node><translate>0 0 -500</translate><instance_geometry url=\"#g\"/></node></node>\
    </visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#w\"/></scene></COLLADA>";

fn joint(name: &str, kind: &str, parent: &str, child: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
         <origin xyz=\"0 0 0.2\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"2\" effort=\"9\" velocity=\"1.5\"/>\
         </joint>\n"
    )
}

/// A chain of `n` joints, `PREFIX1` and following, from the link `base` to `PREFIX_link1` and following.
fn chain(prefix: &str, base: &str, n: usize) -> String {
    let link = |k: usize| if k == 0 { base.to_owned() } else { format!("{prefix}_link{k}") };
    let one = |k: usize| {
        let of_joint = joint(&format!("{prefix}{k}"), "revolute", &link(k - 1), &link(k));
        format!("<link name=\"{}\"/>\n{of_joint}", link(k))
    };
    (1..=n).map(one).collect()
}

fn urdf(body: &str) -> String {
    format!("<robot name=\"bench\">\n<link name=\"base\"/>\n{body}</robot>\n")
}

/// A link with a collision mesh, fixed to the arm's third link.
fn with_mesh(name: &str) -> String {
    let mesh = format!("<geometry><mesh filename=\"{name}\" scale=\"0.001 0.001 0.001\"/></geometry>");
    let hand = format!("<link name=\"hand\"><collision><origin xyz=\"1 0 0\"/>{mesh}</collision></link>");
    urdf(&(chain("arm", "base", 3) + &hand + &joint("fixed", "fixed", "arm_link3", "hand")))
}

/// Files in a folder, and the robot folder made from them.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(urdf: &str) -> Self {
        let bench = Self { folder: temp() };
        std::fs::create_dir(bench.file("given")).expect("a folder");
        write(&bench.file("given/arm.urdf"), urdf);
        bench
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, text: &str) {
        std::fs::create_dir_all(self.file(name).parent().expect("a folder")).expect("made");
        write(&self.file(name), text);
    }

    fn new_robot(&self, more: &[&str]) -> Answer {
        let mut command = program();
        command.arg("new-robot").arg(self.file("given/arm.urdf")).arg("--out").arg(self.file("robot"));
        answer(command.args(more))
    }

    fn check(&self) -> Answer {
        check(&self.file("robot"))
    }
}

fn check(folder: &Path) -> Answer {
    answer(program().arg("check").arg(folder))
}

/// The folder that `new-robot` writes for this URDF; it loads and passes `check` unchanged.
#[track_caller]
fn made(urdf: &str, more: &[&str]) -> Bench {
    let bench = Bench::new(urdf);
    bench.new_robot(more).expect("new-robot", 0, &["armcal check"]);
    bench.check().expect("check", 0, &["ok: ", "stowed_rad"]);
    bench
}

#[track_caller]
fn joints(bench: &Bench) -> Vec<String> {
    load(&bench.file("robot")).expect("it reads").joint_names()
}

#[test]
fn what_stands_beside_the_chain_is_no_error() {
    let visual = "<link name=\"cover\"><visual><geometry><mesh filename=\"package://none/a.dae\"/></geometry></visual>\
                  </link>";
    let beside = [
        chain("arm", "base", 4),
        visual.to_owned() + &joint("cover", "fixed", "arm_link1", "cover"),
        // A joint with a range of zero, a slide and a joint that follows another.
        "<link name=\"flap\"/><link name=\"slide\"/><link name=\"tail\"/>".to_owned(),
        joint("flap", "revolute", "base", "flap").replace("upper=\"2\"", "upper=\"-1\""),
        joint("slide", "prismatic", "base", "slide"),
        joint("tail", "revolute", "slide", "tail").replace("<axis", "<mimic joint=\"arm1\"/><axis"),
    ];
    let bench = made(&urdf(&beside.concat()), &[]);
    assert_eq!(joints(&bench), ["arm1", "arm2", "arm3", "arm4"]);
    assert!(load(&bench.file("robot")).expect("it reads").bodies.iter().all(|body| body.visuals.is_empty()));
}

/// A chain of `n` joints whose first one slides.
fn on_a_slide(n: usize) -> String {
    chain("arm", "base", n).replacen("revolute", "prismatic", 1)
}

#[test]
fn slides_are_joints_of_the_arm() {
    let bench = made(&urdf(&on_a_slide(4)), &[]);
    assert_eq!(joints(&bench), ["arm1", "arm2", "arm3", "arm4"]);
    bench.check().expect("check", 0, &["warning", "joint `arm1`", "prismatic", "calibrate"]);
    let robot = load(&bench.file("robot")).expect("it reads");
    let slide = &robot.sensors[0];
    assert!(slide.moves.is_slide() && !robot.sensors[1].moves.is_slide());
    // One count is one metre, as it is one radian for joints that turn.
    assert_eq!((slide.counts_per_rad, slide.center_rad, slide.half_range_rad), (1.0, 0.5, 1.5));
    // With this base the arm begins beyond the slide.
    assert_eq!(joints(&made(&urdf(&on_a_slide(4)), &["--base", "arm_link1"])), ["arm2", "arm3", "arm4"]);
    // A link that carries nine joints is not part of the arm.
    let bench = made(&urdf(&on_a_slide(9)), &[]);
    assert_eq!((joints(&bench).len(), joints(&bench)[0].as_str()), (8, "arm2"));
    assert_eq!(load(&bench.file("robot")).expect("it reads").base_link, "arm_link1");
}

#[test]
fn a_gripper_of_one_jaw_that_slides_is_not_the_arm() {
    let jaw = |upper: &str| {
        let slide = joint("jaw", "prismatic", "arm_link4", "jaw");
        "<link name=\"jaw\"/>".to_owned() + &slide.replace("lower=\"-1\" upper=\"2\"", upper)
    };
    let with = |upper: &str| joints(&made(&urdf(&(chain("arm", "base", 4) + &jaw(upper))), &[])).len();
    assert_eq!(with("lower=\"0\" upper=\"0.08\""), 4);
    assert_eq!(with("lower=\"0\" upper=\"0.2\""), 5, "the quill of a SCARA arm");
}

#[test]
fn figures_of_a_slide_in_the_unit_of_an_angle_are_named() {
    let _texts = Texts::of("figures_of_a_slide_in_the_unit_of_an_angle_are_named");
    let text = urdf(&chain("arm", "base", 3));
    let bench = made(&text, &[]);
    write(&bench.file("robot/arm.urdf"), &text.replacen("revolute", "prismatic", 1));
    bench.check().expect(
        "rad",
        2,
        &["robot.toml", "`arm1`: scale_counts_per_deg", "scale_counts_per_mm, offset_std_m"],
    );
    let bench = made(&urdf(&on_a_slide(3)), &[]);
    let robot_toml = bench.file("robot/robot.toml");
    let whole = read(&robot_toml);
    write(&robot_toml, &whole.replacen("offset_std_m", "offset_std_rad", 1));
    bench.check().expect("one key", 2, &["[[joint_sensor]] `arm1`: offset_std_m"]);
    write(&robot_toml, &whole.replacen("wrap_counts = 1e6", "wrap_counts = 2", 1));
    bench.check().expect("a short word", 2, &["`arm1`: wrap_counts"]);
    write(&robot_toml, &whole.replacen("max_rate_m_s = 1.5", "max_rate_m_s = 25.0", 1));
    bench.check().expect("a fast slide", 2, &["`arm1`: max_rate_m_s", "0.001 .. 20"]);
    write(&robot_toml, &whole[..whole.find("[[joint_sensor]]").expect("sensors")]);
    bench.check().expect("none", 2, &["missing", "`arm1` (kind", "scale_counts_per_mm", "`arm2`, `arm3` (kind"]);
}

#[test]
fn collision_meshes_become_hulls_wherever_their_paths_lead() {
    for (name, place) in [
        ("package://bench_description/meshes/hand.obj", "given/bench_description/meshes/hand.obj"),
        ("package://given/meshes/hand.obj", "given/meshes/hand.obj"),
        ("meshes/hand.obj", "given/meshes/hand.obj"),
        ("../hand.OBJ", "hand.OBJ"),
        // A converted file replaces one that is not read.
        ("hand.dae", "given/hand.obj"),
        ("package://given/meshes/hand.dae", "given/meshes/hand.dae"),
    ] {
        let bench = Bench::new(&with_mesh(name));
        bench.put(place, if place.ends_with(".dae") { DAE } else { OBJ });
        bench.new_robot(&[]).expect(name, 0, &["3 files"]);
        bench.check().expect(name, 0, &["ok: "]);
        let robot = load(&bench.file("robot")).expect("it reads");
        let [hull] = &robot.bodies[3].collisions[..] else { panic!("{name}: one shape") };
        assert!(matches!(hull.shape, Shape::Hull(_)), "{hull:?}");
        assert_eq!(hull.color_rgb, [160; 3], "what has no material is grey");
        // The corner at the mesh's origin is at x = 1 m; the opposite face is 0.1 m away along each axis.
        let at = |x: f64, y: f64, z: f64| hull.distance_m(&nalgebra::Point3::new(x, y, z + 0.2));
        assert!(at(1.01, 0.01, 0.01) < 1e-9 && (at(0.9, 0.01, 0.01) - 0.1).abs() < 1e-6, "{name}");
        assert!((at(1.1, 0.1, 0.1) - 0.2 / 3.0_f64.sqrt()).abs() < 1e-6, "{name}: {}", at(1.1, 0.1, 0.1));
    }
}

#[test]
fn a_collision_mesh_that_cannot_be_read_is_named_with_what_to_do() {
    let _texts = Texts::of("a_collision_mesh_that_cannot_be_read_is_named_with_what_to_do");
    let bench = Bench::new(&with_mesh("package://bench/hand.stl"));
    bench.new_robot(&[]).expect("new-robot", 0, &["collision_meshes", "hand"]);
    bench.check().expect("check", 0, &["warning", "hand"]);
    let robot_toml = bench.file("robot/robot.toml");
    edit(&robot_toml, "\ncollision_meshes = \"ignore\"", "");
    bench.check().expect("missing", 2, &["package://bench/hand.stl", "\"ignore\""]);
    bench.put("robot/hand.stl", "no mesh");
    bench.check().expect("broken", 2, &["hand.stl"]);
    std::fs::remove_file(bench.file("robot/hand.stl")).expect("removed");
    bench.put("hand.stl", OBJ);
    std::os::unix::fs::symlink(bench.file("hand.stl"), bench.file("robot/hand.stl")).expect("linked");
    bench.check().expect("a link", 2, &["hand.stl"]);
    let urdf = bench.file("robot/arm.urdf");
    edit(&urdf, "hand.stl", "hand.dae");
    std::fs::remove_file(bench.file("robot/hand.stl")).expect("removed");
    bench.put("robot/hand.dae", "<COLLADA/>");
    bench.check().expect("dae", 2, &["hand.dae"]);
    edit(&urdf, "hand.dae", "hand.ply");
    bench.put("robot/hand.ply", "ply");
    bench.check().expect("ply", 2, &["hand.ply"]);
    let many = format!("<collision>{}</collision>", "<geometry><mesh filename=\"a.stl\"/></geometry>").repeat(65);
    write(&urdf, &with_mesh("a.stl").replace("<collision>", &(many + "<collision>")));
    bench.check().expect("many", 2, &["66 shapes", "0 .. 64"]);
}

#[test]
fn meshes_beyond_what_memory_is_meant_for_are_not_copied() {
    let _texts = Texts::of("meshes_beyond_what_memory_is_meant_for_are_not_copied");
    let names = ["a.stl", "b.stl", "c.stl"];
    let of = |name: &str| format!("<collision><geometry><mesh filename=\"{name}\"/></geometry></collision>");
    let hand = format!("<link name=\"hand\">{}</link>", names.map(of).concat());
    let bench = Bench::new(&urdf(&(chain("arm", "base", 3) + &hand + &joint("fixed", "fixed", "arm_link3", "hand"))));
    for name in names {
        let file = std::fs::File::create(bench.file("given").join(name)).expect("made");
        file.set_len(190_000_000).expect("a file with nothing in it");
    }
    bench.new_robot(&[]).expect("large meshes", 2, &["arm.urdf", "570 MB", "500 MB"]);
    assert!(!bench.file("robot").exists(), "nothing was written");
}

/// Only the simulator uses inertias.
#[test]
fn an_arm_with_a_bad_inertia_records_and_is_not_simulated() {
    let _texts = Texts::of("an_arm_with_a_bad_inertia_records_and_is_not_simulated");
    let folder = temp();
    let robot = robot_copy(folder.path());
    let urdf = read(&robot.join("titan4.urdf"));
    let at = urdf.rfind("ixx=\"").expect("an inertia") + "ixx=\"".len();
    write(&robot.join("titan4.urdf"), &format!("{}-{}", &urdf[..at], &urdf[at..]));
    check(&robot).expect("check", 0, &[]);
    let routine = ShortRoutine { robot, ..ShortRoutine::default() }.write(folder.path());
    run(&routine, &folder.path().join("out")).expect("run", 2, &["inertia"]);
}

#[test]
fn the_arm_ends_before_its_fingers() {
    let fingers = |kind: &str| {
        let links = "<link name=\"left\"/><link name=\"right\"/>";
        let left = joint("left", kind, "arm_link5", "left");
        left + &joint("right", kind, "arm_link5", "right") + links
    };
    for kind in ["revolute", "prismatic"] {
        let bench = made(&urdf(&(chain("arm", "base", 5) + &fingers(kind))), &[]);
        assert_eq!(joints(&bench).len(), 5, "{kind}");
    }
}

#[test]
fn several_arms_in_a_file_are_named_and_one_is_asked_for() {
    let _texts = Texts::of("several_arms_in_a_file_are_named_and_one_is_asked_for");
    let text = urdf(&(chain("left", "base", 6) + &chain("right", "base", 5)));
    let bench = Bench::new(&text);
    bench.new_robot(&[]).expect("two arms", 2, &["left_link6 (6 joints)", "right_link5 (5 joints)", "--tip"]);
    assert!(!bench.file("robot").exists());
    assert_eq!(joints(&made(&text, &["--tip", "right_link5"])).len(), 5);
    let bench = made(&text, &["--tip", "left_link6", "--base", "left_link1", "--camera-link", "left_link4"]);
    let robot = load(&bench.file("robot")).expect("it reads");
    assert_eq!((robot.n_joints(), robot.camera.mount.n_joints), (5, 3));
    assert_eq!((robot.name.as_str(), robot.base_link.as_str()), ("bench", "left_link1"));
    bench.new_robot(&["--tip", "none"]).expect("again", 2, &[]);
    let bench = Bench::new(&text);
    bench.new_robot(&["--tip", "none"]).expect("no such link", 2, &["--tip", "`none`"]);
}

#[test]
fn new_robot_reads_limits_rates_and_the_camera() {
    let _texts = Texts::of("new_robot_reads_limits_rates_and_the_camera");
    let camera = "<link name=\"wrist_optical\"/>".to_owned() + &joint("c", "fixed", "arm_link2", "wrist_optical");
    let text =
        urdf(&(chain("arm", "world", 3) + &camera + &joint("w", "fixed", "world", "base") + "<link name=\"world\"/>"));
    let text = text
        .replacen("revolute", "continuous", 1)
        .replace("parent link=\"world\"/><child link=\"arm", "parent link=\"base\"/><child link=\"arm");
    let bench = made(&text, &[]);
    let robot = load(&bench.file("robot")).expect("it reads");
    assert_eq!((robot.base_link.as_str(), robot.camera.name.as_str()), ("base", "wrist_optical"));
    assert_eq!(robot.camera.mount.n_joints, 2);
    assert!(robot.chain.joints()[0].limits.is_none() && robot.chain.joints()[1].limits.is_some());
    assert!(
        robot.sensors.iter().all(|sensor| sensor.max_rate_rad_s == 1.5 && (sensor.counts_per_rad - 1.0).abs() < 1e-12)
    );
    // A xacro file, a file without an arm, and one that is no URDF.
    for text in [
        "<robot name=\"a\" xmlns:xacro=\"x\"><xacro:macro name=\"b\"/></robot>",
        "<robot name=\"a\"><link name=\"b\"/></robot>",
        "none",
    ] {
        let bench = Bench::new(text);
        bench.new_robot(&[]).expect(text, 2, &["arm.urdf"]);
        assert!(!bench.file("robot").exists());
    }
}

/// Names in a URDF cannot write keys of robot.toml.
#[test]
fn names_of_a_urdf_stay_names() {
    let text = urdf(&chain("arm", "base", 3)).replace("arm2", "a&#10;stowed_rad = [9]&#10;&quot;");
    let bench = made(&text.replacen("<robot name=\"bench\"", "<robot name=\"x&quot;&#10;y = 1\"", 1), &[]);
    let robot = load(&bench.file("robot")).expect("it reads");
    assert_eq!((robot.name.as_str(), robot.joint_names()[1].as_str()), ("x\"\ny = 1", "a\nstowed_rad = [9]\n\""));
}

/// Every key of a robot.toml is optional, or the message names it when it is missing, together with all others.
#[test]
fn all_that_robot_toml_lacks_is_named_at_once() {
    let _texts = Texts::of("all_that_robot_toml_lacks_is_named_at_once");
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    let whole = read(&file);
    let mut n_named = 0;
    for line in whole.lines().filter(|line| line.contains(" = ") && !line.starts_with('#')) {
        let key = line.split(" = ").next().expect("a key");
        write(&file, &whole.replacen(&format!("{line}\n"), "", 1));
        if let Err(error) = load(&robot) {
            let text = error.to_string();
            assert!(text.contains(key) && !text.contains("TOML"), "{key}: {text}");
            n_named += 1;
        }
    }
    assert!(n_named > 15, "{n_named}");
    let short = "version = 1\nkind = \"robot\"\nname = \"a\"\nurdf = \"titan4.urdf\"\nbase_link = \"base_link\"\n\
                 [tool]\nlink = \"manipulator_link\"\n\
                 [camera]\nlink = \"fisheye\"\n[[joint_sensor]]\njoint = \"forearm_pitch\"\nkind = \"encoder\"\n\
                 gain_std = 0.1\n[[tag]]\nid = 7\n";
    write(&file, short);
    let words = [
        "missing: [tool] point_m",
        "mount_std_rad",
        "`forearm_pitch`: offset_counts",
        "[[tag]] 7: family",
        "`shoulder_yaw`, `shoulder_pitch`, `wrist_pitch`, `wrist_yaw`, `wrist_rotate`",
    ];
    check(&robot).expect("check", 2, &words);
    let sensors = whole.replacen("joint = \"wrist_yaw\"", "joint = \"wrist_jaw\"", 1);
    write(&file, &sensors);
    check(&robot).expect("check", 2, &[]);
    write(&file, &whole.replacen("focal_px", "# ", 1).replacen("center_px", "# ", 1));
    check(&robot).expect("check", 2, &["[camera]"]);
}

/// A Titan without lens, stowed pose and tags.
fn bare_titan(folder: &Path) -> PathBuf {
    let robot = robot_copy(folder);
    let text = read(&robot.join("robot.toml"));
    let (tags, geometry) = (text.find("\n# base_from_tag"), text.find("\n[geometry]"));
    let (tags, geometry) = (&text[..tags.expect("the tags")], &text[geometry.expect("the sigmas")..]);
    let text = format!("{tags}{geometry}");
    let dropped = [
        "model",
        "resolution_px",
        "focal_px",
        "center_px",
        "distortion",
        "max_view_angle_rad",
        "corner_std_px",
        "base_tag",
        "stowed_rad",
    ];
    let is_kept = |line: &&str| !dropped.iter().any(|key| line.starts_with(&format!("{key} =")));
    write(&robot.join("robot.toml"), &text.lines().filter(is_kept).map(|line| format!("{line}\n")).collect::<String>());
    robot
}

#[test]
fn a_recording_of_positions_needs_neither_lens_nor_stowed_pose_nor_tags() {
    let folder = temp();
    let bare = bare_titan(folder.path());
    check(&bare).expect("check", 0, &["ok: ", "warning", "stowed_rad", "base_tag", "lens"]);
    let arm = RealTitan::new(&titan(), 30, AS_IN_2018, 1);
    let [recording, map, tags] = ["arm.mcap", "map.toml", "tags.toml"].map(|name| folder.path().join(name));
    write_poses(&recording, &arm.poses);
    write(&map, INPUT_MAP);
    write(&tags, &arm.tag_map());
    let calibrate = |robot: &Path, method: &str, out: &str| {
        let mut command = program();
        command.arg("calibrate").arg("--details").arg(&recording).arg("--robot").arg(robot).arg("--input").arg(&map);
        command.arg("--tag-map").arg(&tags).args(["--method", method]).arg("--out").arg(folder.path().join(out));
        answer(&mut command)
    };
    for method in ["minimum_distance", "bundle"] {
        let with = calibrate(&root().join("robots/titan4"), method, "with");
        let without = calibrate(&bare, method, "without");
        assert_eq!(
            (with.code, &with.stdout.replace("/with", "/out")),
            (without.code, &without.stdout.replace("/without", "/out"))
        );
        let of = |out: &str| read(&folder.path().join(out).join("calibration.toml"));
        assert_eq!(of("with"), of("without"), "{method}");
    }
    write(&map, &INPUT_MAP.replace("\"position\"", "\"corners\"").replace(TAG_NOISE, ""));
    calibrate(&bare, "bundle", "out").expect("corners", 2, &["lens", "model, resolution_px, focal_px"]);
}

#[test]
fn what_plans_names_all_that_the_folder_lacks() {
    let folder = temp();
    let routine = ShortRoutine { robot: bare_titan(folder.path()), ..ShortRoutine::default() }.write(folder.path());
    let words = ["stowed_rad", "base_tag", "lens", "model, resolution_px"];
    run(&routine, &folder.path().join("out")).expect("run", 2, &words);
    answer(program().arg("plan").arg(&routine).arg("--out").arg(folder.path())).expect("plan", 2, &words);
    check(&routine).expect("check", 2, &words);
}

#[test]
fn a_stale_list_of_pairs_stops_planning_alone() {
    let _texts = Texts::of("a_stale_list_of_pairs_stops_planning_alone");
    let folder = temp();
    let robot = robot_copy(folder.path());
    std::fs::copy(root().join("robots/titan4/self_collision.toml"), robot.join("self_collision.toml")).expect("copied");
    let routine = ShortRoutine { robot: robot.clone(), ..ShortRoutine::default() }.write(folder.path());
    check(&routine).expect("fresh", 0, &["ok: "]);
    let urdf = robot.join("titan4.urdf");
    write(&urdf, &(read(&urdf) + "<!-- another -->\n"));
    let stale = "self_collision.toml";
    check(&robot).expect("check", 0, &["ok: ", "warning", stale]);
    check(&routine).expect("check a routine", 2, &[stale]);
    let recording = root().join("fuzz/corpus/recording/views.mcap");
    let found = answer(program().arg("inspect").arg(recording).arg("--robot").arg(&robot));
    found.expect("inspect", 0, &[stale]);
    assert_eq!(found.stderr.matches(stale).count(), 1, "{found:?}");
}

/// From a URDF to a good calibration: the test adds only lens, tags and the arm's pose to the folder.
#[test]
fn an_arm_of_a_urdf_alone_closes_the_loop() {
    let urdf = read(&root().join("robots/titan4/titan4.urdf"));
    let bench = Bench::new(&urdf);
    bench.new_robot(&["--tip", "manipulator_link"]).expect("new-robot", 0, &["6 joints"]);
    let file = bench.file("robot/robot.toml");
    edit(&file, "# model = ", &format!("{LENS}# model = "));
    edit(&file, "# base_tag = 0", "base_tag = 0");
    edit(&file, "# stowed_rad = ", "stowed_rad = ");
    edit(&file, "point_m = [0.0, 0.0, 0.0]", "point_m = [0.0, -0.253, 0.0]");
    let ours = read(&root().join("robots/titan4/robot.toml"));
    let tags = ours.find("[[tag]]").expect("it has tags");
    write(&file, &(read(&file) + &ours[tags..]));
    let routine = ShortRoutine {
        robot: bench.file("robot"),
        vehicle: root().join("robots/vehicles/fixed-base.toml"),
        poses: 16,
        held_out: 0,
        ..ShortRoutine::default()
    };
    let routine = routine.write(bench.folder.path());
    let out = bench.file("run");
    run(&routine, &out).expect("a run", 0, &["ACCEPTED", "contacts     0"]);
    let summary: serde_json::Value = serde_json::from_str(&read(&out.join("summary.json"))).expect("JSON");
    let median_mm = |when: &str| {
        1e3 * summary["score"][when]["tool_error_m"]["median"].as_f64().unwrap_or_else(|| panic!("no {when}"))
    };
    let (before_mm, after_mm) = (median_mm("before"), median_mm("after"));
    assert!(before_mm > 5.0 && after_mm < 2.0, "{before_mm} mm before, {after_mm} mm after");
}
