//! URDFs as found in practice. Calibration skips unused elements with a warning that names link or joint. It refuses
//! wrong elements that it needs, with line, column and name. Each kind of problem is tried on three arms.

use std::path::{Path, PathBuf};

use armcal::joints::JointAngles;
use armcal::robot::{Robot, load};

use crate::support::texts::Texts;
use crate::support::{Answer, answer, program, temp, write};

/// Parts of an arm's URDF that a test sets.
#[derive(Clone)]
struct Parts {
    base: String,
    tool: String,
    /// Type of the second joint.
    kind: String,
    origin: String,
    axis: String,
    limit: String,
    /// Elements at the end of the second joint.
    joint_more: String,
    /// Links and joints after all others.
    more: String,
    head: String,
}

impl Default for Parts {
    fn default() -> Self {
        Self {
            base: String::new(),
            tool: String::new(),
            kind: "revolute".into(),
            origin: "<origin xyz=\"0.08 0 0.12\"/>".into(),
            axis: "<axis xyz=\"0 1 0\"/>".into(),
            limit: "<limit lower=\"-1.6\" upper=\"1.9\" effort=\"100\" velocity=\"2\"/>".into(),
            joint_more: String::new(),
            more: String::new(),
            head: "<?xml version=\"1.0\"?>\n".into(),
        }
    }
}

/// Numbers of joints of the arms on which each kind is tried; the arm with 4 has a slide.
const ARMS: [usize; 3] = [4, 6, 7];

/// An arm of `n` joints `j1` and following, from `base_link` over `l1` and following to `tool`.
fn arm(n: usize, parts: &Parts) -> String {
    let link = |k: usize| if k == 0 { "base_link".to_owned() } else { format!("l{k}") };
    let mut text = format!("{}<robot name=\"arm_{n}\">\n<link name=\"base_link\">{}</link>\n", parts.head, parts.base);
    for k in 1..=n {
        let kind = if n == 4 && k == 3 { "prismatic" } else { "revolute" };
        let axis = ["1 0 0", "0 0 1", "0 1 0"][(k + n) % 3];
        let of_joint = match k {
            2 => format!("{}{}{}{}", parts.origin, parts.axis, parts.limit, parts.joint_more),
            _ => format!(
                "<origin xyz=\"0.0{k} 0 0.{n}\" rpy=\"0.{k} 0 0.1\"/><axis xyz=\"{axis}\"/>\
                 <limit lower=\"-0.{k}\" upper=\"2.{n}\" effort=\"50\" velocity=\"3\"/>"
            ),
        };
        let (kind, parent, child) = (if k == 2 { &parts.kind } else { kind }, link(k - 1), link(k));
        text += &format!(
            "<link name=\"{child}\"/>\n<joint name=\"j{k}\" type=\"{kind}\"><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/>{of_joint}</joint>\n"
        );
    }
    text += &format!(
        "<link name=\"tool\">{}</link>\n<joint name=\"fix\" type=\"fixed\"><parent link=\"l{n}\"/>\
         <child link=\"tool\"/><origin xyz=\"0.12 0 0\" rpy=\"0 1.5707963 0\"/></joint>\n{}</robot>\n",
        parts.tool, parts.more
    );
    text
}

fn joint(name: &str, kind: &str, [parent, child]: [&str; 2], more: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{more}</joint>\n"
    )
}

/// A URDF and the folder made from it.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(urdf: &str) -> Self {
        let folder = temp();
        write(&folder.path().join("arm.urdf"), urdf);
        Self { folder }
    }

    fn robot_folder(&self) -> PathBuf {
        self.folder.path().join("robot")
    }

    fn new_robot(&self, options: &[&str]) -> Answer {
        let mut command = program();
        command.arg("new-robot").arg(self.folder.path().join("arm.urdf")).arg("--out").arg(self.robot_folder());
        answer(command.args(options))
    }

    /// The robot, after `new-robot` and `check` passed with `words` in their output.
    #[track_caller]
    fn made(&self, options: &[&str], words: &[&str]) -> Robot {
        let what = std::fs::read_to_string(self.folder.path().join("arm.urdf")).expect("the URDF");
        self.new_robot(options).expect(&what, 0, words);
        answer(program().arg("check").arg(self.robot_folder())).expect(&what, 0, words);
        load(&self.robot_folder()).expect("it reads")
    }

    #[track_caller]
    fn refused(&self, options: &[&str], words: &[&str]) {
        let what = std::fs::read_to_string(self.folder.path().join("arm.urdf")).expect("the URDF");
        self.new_robot(options).expect(&what, 2, words);
        assert!(!self.robot_folder().exists(), "nothing is written");
    }
}

/// Expects every arm with each of `values`, set by `edit`, to load with all its joints and a warning with `words`.
#[track_caller]
fn skipped(values: &[&str], edit: fn(&mut Parts, &str), words: &[&str]) -> Vec<Robot> {
    let mut robots = Vec::new();
    for n in ARMS {
        for value in values {
            let mut parts = Parts::default();
            edit(&mut parts, value);
            let robot = Bench::new(&arm(n, &parts)).made(&[], &[&["urdf_skipped", "arm.urdf"], words].concat());
            assert_eq!((robot.n_joints(), robot.base_link.as_str()), (n, "base_link"), "{value}");
            robots.push(robot);
        }
    }
    robots
}

/// Expects every arm with each of `values`, set by `edit`, to be refused with `words` and a line.
#[track_caller]
fn refused(values: &[&str], edit: fn(&mut Parts, &str), words: &[&str]) {
    for n in ARMS {
        for value in values {
            let mut parts = Parts::default();
            edit(&mut parts, value);
            Bench::new(&arm(n, &parts)).refused(&[], &[&["arm.urdf:", "column"], words].concat());
        }
    }
}

#[test]
fn masses_that_are_none_are_left_out() {
    let edit = |parts: &mut Parts, mass: &str| {
        parts.tool = format!("<inertial><mass value=\"{mass}\"/><inertia ixx=\"0\" iyy=\"0\" izz=\"0\"/></inertial>");
    };
    let robots = skipped(&["1e-9", "4e-8", "-2.5", "nan", "inf", "1e12", "light"], edit, &["`tool`", "mass"]);
    assert!(robots.iter().all(|robot| robot.bodies.iter().all(|body| body.mass_kg == 0.0)));
    let edit = |parts: &mut Parts, inertia: &str| {
        parts.tool = format!("<inertial><mass value=\"1.5\"/><inertia {inertia}/></inertial>");
    };
    let robots = skipped(&["ixx=\"nan\"", "iyy=\"inf\"", "izz=\"a\""], edit, &["`tool`", "inertia"]);
    assert!(robots.iter().all(|robot| robot.bodies.iter().any(|body| body.mass_kg == 1.5)), "its mass is known");
}

#[test]
fn shapes_and_materials_that_are_none_are_left_out() {
    let shape = |kind: &str, geometry: &str| format!("<{kind}><geometry>{geometry}</geometry></{kind}>");
    let edit = |parts: &mut Parts, geometry: &str| {
        parts.base = format!("<collision><geometry>{geometry}</geometry></collision>");
    };
    let empty = ["<box size=\"0 0 0\"/>", "<sphere radius=\"0\"/>", "<cylinder radius=\"0\" length=\"0\"/>", ""];
    for robot in skipped(&empty, edit, &["`base_link`"]) {
        assert!(robot.planning_issues.iter().all(|issue| !issue.key.contains("collision")), "nothing to keep clear of");
    }
    let lost =
        ["<box size=\"0.1 0 0.1\"/>", "<sphere radius=\"-1\"/>", "<cylinder radius=\"1\"/>", "<box size=\"1 nan 1\"/>"];
    for robot in skipped(&lost, edit, &["`base_link`"]) {
        assert!(robot.planning_issues.iter().any(|issue| issue.key.contains("base_link")), "paths may hit it");
    }
    let visual = shape("visual", "<mesh filename=\"package://none/a.stl\" scale=\"0 0 0\"/>");
    let bench = Bench::new(&arm(6, &Parts { base: visual, ..Parts::default() }));
    bench.made(&[], &["`base_link`", "urdf_skipped"]);
    let edit = |parts: &mut Parts, materials: &str| {
        parts.base = format!("<visual><geometry><box size=\"1 1 1\"/></geometry>{materials}</visual>");
    };
    let two = ["<material name=\"a\"/><material name=\"b\"/>", "<material name=\"\"/><material/><material/>"];
    skipped(&two, edit, &["`base_link`", "material"]);
    skipped(&["<material name=\"a\"><color rgba=\"red\"/></material>"], edit, &["`base_link`", "colour"]);
}

/// One message of each kind, for people to read.
#[test]
fn messages_about_a_urdf_name_place_value_and_remedy() {
    let _texts = Texts::of("messages_about_a_urdf_name_place_value_and_remedy");
    let shape = "<collision><geometry><box size=\"0.1 0 0.1\"/></geometry></collision>";
    let edits: [fn(&mut Parts); 8] = [
        |parts| parts.tool = "<inertial><mass value=\"1e-9\"/></inertial>".into(),
        |parts| parts.limit = "<limit lower=\"-999999\" upper=\"999999\" effort=\"1\"/>".into(),
        |parts| parts.limit = "<limit lower=\"2\" upper=\"-2\" effort=\"1\" velocity=\"1\"/><limit/>".into(),
        |parts| (parts.axis, parts.origin) = ("<axis/>".into(), "<origin/>".into()),
        |parts| parts.axis = "<axis xyz=\"0 0 0\"/>".into(),
        |parts| parts.joint_more = "<mimic joint=\"j1\"/>".into(),
        |parts| parts.more = joint("back", "fixed", ["l3", "l1"], ""),
        |parts| parts.more = joint("lost", "fixed", ["nowhere", "cover"], "") + "<link name=\"cover\"/>",
    ];
    for edit in edits {
        let mut parts = Parts { base: shape.into(), ..Parts::default() };
        edit(&mut parts);
        Bench::new(&arm(6, &parts)).new_robot(&[]);
    }
}

#[test]
fn a_collision_element_may_have_a_material() {
    let base = "<collision><geometry><box size=\"1 1 1\"/></geometry><material name=\"\"/></collision>";
    let robot = Bench::new(&arm(6, &Parts { base: base.into(), ..Parts::default() })).made(&[], &[]);
    assert_eq!((robot.bodies[0].collisions.len(), robot.urdf_warnings.len()), (1, 0));
}

/// An arm without shapes can be calibrated, but each of its paths would count as clear.
#[test]
fn links_without_a_collision_shape_are_named() {
    const BOX: &str = "<geometry><box size=\"0.1 0.1 0.1\"/></geometry>";
    let lacks_all = |robot: &Robot| robot.planning_issues.iter().any(|issue| issue.key == "links");
    let bench = Bench::new(&arm(6, &Parts::default()));
    let robot = bench.made(&[], &["links: "]);
    answer(program().arg("check").arg(bench.robot_folder())).expect("check", 0, &["links", "[planning_incomplete]"]);
    assert!(lacks_all(&robot) && robot.require_planning().is_err());
    let tool = format!("<collision>{BOX}</collision>");
    let robot = Bench::new(&arm(6, &Parts { tool: tool.clone(), ..Parts::default() })).made(&[], &[]);
    assert_eq!((lacks_all(&robot), robot.urdf_warnings.len()), (false, 0));
    // A cover that is drawn on the second link has no shape, while the tool has one.
    let more = joint("screws", "fixed", ["l2", "cover"], "")
        + &format!("<link name=\"cover\"><visual>{BOX}</visual></link>\n");
    let robot = Bench::new(&arm(6, &Parts { tool, more, ..Parts::default() })).made(&[], &["`l2`", "[urdf_skipped]"]);
    assert_eq!((lacks_all(&robot), robot.urdf_warnings.len()), (false, 1));
}

#[test]
fn limits_need_neither_velocity_nor_effort() {
    let edit = |parts: &mut Parts, more: &str| parts.limit = format!("<limit lower=\"-1\" upper=\"1.2\" {more}/>");
    let values = ["effort=\"9\"", "", "effort=\"9\" velocity=\"-1\"", "effort=\"9\" velocity=\"fast\""];
    for robot in skipped(&values, edit, &["`j2`", "velocity"]) {
        assert!(robot.chain.joints()[1].limits.is_some(), "the range is known");
    }
    skipped(&["velocity=\"1\"", "velocity=\"1\" effort=\"nan\"", ""], edit, &["`j2`", "effort"]);
}

#[test]
fn axis_and_origin_may_leave_out_their_xyz() {
    let edit = |parts: &mut Parts, axis: &str| parts.axis = axis.into();
    for robot in skipped(&["<axis/>", "<axis rpy=\"0 0 1\"/>", "<axis xy=\"0 1\"/>"], edit, &["`j2`", "axis"]) {
        assert_eq!(robot.chain.joints()[1].axis.into_inner(), nalgebra::Vector3::x());
    }
    let edit = |parts: &mut Parts, origin: &str| parts.origin = origin.into();
    let values = ["<origin rpy=\"0 0 0.5\"/>", "<origin/>", "<origin rpy=\"1 2 3\"></origin>"];
    skipped(&values, edit, &["`j2`", "origin"]);
}

#[test]
fn limits_beyond_any_joint_mean_none() {
    let edit = |parts: &mut Parts, limits: &str| {
        let (lower, upper) = limits.split_once(',').expect("two");
        parts.limit = format!("<limit lower=\"{lower}\" upper=\"{upper}\" effort=\"1\" velocity=\"1\"/>");
    };
    let values = ["-999999,999999", "-1e16,1e16", "-inf,inf", "0,99999.9", "-180,180"];
    for robot in skipped(&values, edit, &["`j2`", "continuous", "degrees"]) {
        assert!(robot.chain.joints()[1].limits.is_none());
        assert!(robot.planning_issues.iter().all(|issue| !issue.key.contains("j2")), "it may turn on");
    }
    // Limits of several turns.
    for limits in ["-6.2831853,6.2831853", "-12.566,12.566", "-18.85,18.85", "0,25.1"] {
        let mut parts = Parts::default();
        edit(&mut parts, limits);
        let robot = Bench::new(&arm(6, &parts)).made(&[], &[]);
        assert!(robot.chain.joints()[1].limits.is_some() && robot.urdf_warnings.is_empty(), "{limits}");
    }
}

#[test]
fn a_range_that_is_missing_or_empty_stops_planning_alone() {
    let edit = |parts: &mut Parts, limit: &str| parts.limit = limit.into();
    let values = [
        "",
        "<limit effort=\"1\" velocity=\"1\"/>",
        "<limit lower=\"2\" upper=\"-2\" effort=\"1\" velocity=\"1\"/>",
        "<limit lower=\"0\" upper=\"0\" effort=\"1\" velocity=\"1\"/>",
        "<limit lower=\"nan\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
        "<limit lower=\"low\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
    ];
    for robot in skipped(&values, edit, &["`j2`"]) {
        assert!(robot.chain.joints()[1].limits.is_none());
        assert!(robot.planning_issues.iter().any(|issue| issue.key.contains("j2")), "planning needs it");
    }
}

#[test]
fn elements_that_are_not_urdf_are_skipped() {
    for (edit, owner) in [
        ((|parts, name| parts.more = format!("<{name}/>")) as fn(&mut Parts, &str), "robot"),
        (|parts, name| parts.tool = format!("<{name} a=\"1\"><b/></{name}>"), "`tool`"),
        (|parts, name| parts.joint_more = format!("<{name}>1</{name}>"), "`j2`"),
    ] {
        for name in ["wheel", "Gains", "self_collide"] {
            skipped(&[name], edit, &[owner, &format!("`{name}`")]);
        }
    }
}

#[test]
fn files_of_every_look_read_without_a_word() {
    let other_tools = "<transmission name=\"t\"><joint name=\"j1\"/></transmission><gazebo reference=\"l1\">\
        <mu1>1</mu1></gazebo><ros2_control name=\"a\" type=\"system\"><joint name=\"j1\"/></ros2_control>\
        <x:y xmlns:x=\"z\"/><!-- <joint name=\"no\"/> --><material name=\"m\"><color rgba=\"1 1 1 1\"/></material>";
    let zero = "<inertial><mass value=\"0\"/><inertia ixx=\"0\" iyy=\"0\" izz=\"0\"/></inertial>";
    for n in ARMS {
        for head in ["", "\u{feff}<?xml version=\"1.0\"?>\n", "<!DOCTYPE robot>\n<!-- a -->\n"] {
            let parts = Parts { head: head.into(), more: other_tools.into(), tool: zero.into(), ..Parts::default() };
            let robot = Bench::new(&arm(n, &parts)).made(&[], &[]);
            assert_eq!((robot.n_joints(), robot.urdf_warnings.as_slice()), (n, &[][..]));
        }
    }
}

#[test]
fn what_kinematics_need_and_is_wrong_is_refused_with_its_place() {
    let axes = ["0 0 0", "nan 0 1", "0 1e-9 0", "0 1", "0 inf 0", "0, 1, 0"];
    refused(&axes, |parts, xyz| parts.axis = format!("<axis xyz=\"{xyz}\"/>"), &["`j2`:", "axis"]);
    let origins = ["xyz=\"nan 0 0\"", "xyz=\"0 0\"", "xyz=\"0 0 1e300\"", "rpy=\"0 inf 0\"", "rpy=\"a b c\""];
    refused(&origins, |parts, origin| parts.origin = format!("<origin {origin}/>"), &["`j2`:", "origin"]);
    let options = |n: usize| ["--base".to_owned(), "base_link".to_owned(), "--tip".to_owned(), format!("l{n}")];
    for n in ARMS {
        for kind in ["planar", "floating", "spherical", ""] {
            let bench = Bench::new(&arm(n, &Parts { kind: kind.into(), ..Parts::default() }));
            let options = options(n);
            let options: Vec<&str> = options.iter().map(String::as_str).collect();
            bench.refused(&options, &["column", "`j2`", if kind.is_empty() { "type" } else { kind }]);
        }
    }
    // An axis need not have the length 1.
    let robot =
        Bench::new(&arm(6, &Parts { axis: "<axis xyz=\"0 0 -250\"/>".into(), ..Parts::default() })).made(&[], &[]);
    assert_eq!(robot.chain.joints()[1].axis.into_inner(), -nalgebra::Vector3::z());
}

#[test]
fn what_is_wrong_next_to_the_chain_is_skipped() {
    for (more, words) in [
        (joint("flap", "revolute", ["l1", "flap"], "<axis xyz=\"0 0 0\"/>"), &["`flap`", "axis"][..]),
        (joint("flap", "fixed", ["l1", "flap"], "<origin xyz=\"nan 0 0\"/>"), &["`flap`", "origin"]),
        (joint("flap", "planar", ["base_link", "flap"], "<axis xyz=\"0 x 0\"/>"), &["`flap`", "axis"]),
        (joint("flap", "floating", ["base_link", "flap"], ""), &[]),
        (joint("flap", "fixed", ["base_link", "flap"], "") + "<link name=\"flap\"/>", &["`flap`", "urdf_skipped"]),
        ("<link name=\"loose\"/>".into(), &["`loose`", "urdf_skipped"]),
        ("<link/>".into(), &["link"]),
        (joint("arm", "fixed", ["l1", "new"], ""), &["`new`", "urdf_skipped"]),
        (
            joint("rod", "fixed", ["l1", "rod"], "")
                + &joint("bar", "fixed", ["rod", "end"], "")
                + &joint("back", "fixed", ["base_link", "end"], "")
                + "<link name=\"rod\"/><link name=\"end\"/>",
            &["`back`", "`end`"],
        ),
    ] {
        let is_loose = more.contains("loose") || more.contains("\"new\"");
        let flap = if is_loose { "" } else { "<link name=\"flap\"/>" };
        let flap = if more.contains("\"flap\"") { flap } else { "" };
        for n in ARMS {
            let robot =
                Bench::new(&arm(n, &Parts { more: flap.to_owned() + &more, ..Parts::default() })).made(&[], words);
            assert_eq!(robot.n_joints(), n, "{more}");
        }
    }
}

#[test]
fn loops_wrong_names_and_torn_trees_are_refused_by_name() {
    for n in ARMS {
        for (more, words) in [
            (joint("back", "fixed", ["l3", "l1"], ""), &["loop", "`l1`", "`back`"][..]),
            (joint("again", "revolute", ["tool", "base_link"], ""), &["loop"]),
            (joint("lost", "fixed", ["nowhere", "cover"], "") + "<link name=\"cover\"/>", &["`lost`", "`nowhere`"]),
            (joint("typo", "fixed", ["l1", "covr"], "") + "<link name=\"cover\"/>", &["`typo`", "`covr`"]),
            (joint("j1", "fixed", ["l1", "cover"], "") + "<link name=\"cover\"/>", &["`j1`", "twice"]),
            ("<joint name=\"half\" type=\"fixed\"><parent link=\"l1\"/></joint>".into(), &["`half`", "child"]),
            (
                "<link name=\"a\"/><link name=\"b\"/>".to_owned() + &joint("other", "revolute", ["a", "b"], ""),
                &["base_link", "--base"],
            ),
        ] {
            Bench::new(&arm(n, &Parts { more, ..Parts::default() })).refused(&[], words);
        }
    }
}

#[test]
fn xacro_is_named_with_the_command_that_expands_it() {
    let words = ["file_syntax", "xacro", "column"];
    for n in ARMS {
        let text = arm(n, &Parts::default());
        for (from, to) in [
            ("lower=\"-1.6\"", "lower=\"${-pi / 2}\""),
            ("<joint name=\"j1\"", "<joint name=\"${prefix}j1\""),
            ("</robot>", "<xacro:include filename=\"hand.xacro\"/></robot>"),
            ("</robot>", "<xacro:macro name=\"hand\"/><xacro:hand parent=\"tool\"/></robot>"),
        ] {
            Bench::new(&text.replacen(from, to, 1)).refused(&[], &words);
        }
        let unused = "<xacro:property name=\"a\" value=\"1\"/></robot>";
        Bench::new(&text.replacen("</robot>", unused, 1)).made(&[], &[]);
        let left_over = "<xacro:sensors/></robot>";
        Bench::new(&text.replacen("</robot>", left_over, 1)).made(&[], &["urdf_skipped", "sensors"]);
    }
}

/// A chain joint that follows another has no sensor of its own.
#[test]
fn a_mimic_joint_in_the_chain_is_refused_by_its_name() {
    for n in ARMS {
        for mimic in ["<mimic joint=\"j1\"/>", "<mimic joint=\"j3\" multiplier=\"-1\" offset=\"0.2\"/>", "<mimic/>"] {
            let bench = Bench::new(&arm(n, &Parts { joint_more: mimic.into(), ..Parts::default() }));
            let words = ["`j2`", "mimic", "--base", "--tip", "column"];
            bench.refused(&[], &words);
            bench.refused(&["--base", "base_link"], &words);
            bench.refused(&["--base", "base_link", "--tip", "tool"], &words);
            // The message proposes these remedies.
            let robot = bench.made(&["--base", "l2", "--tip", "tool"], &[]);
            assert_eq!((robot.n_joints(), robot.base_link.as_str()), (n - 2, "l2"));
        }
    }
}

#[test]
fn balancers_next_to_the_chain_are_no_fingers() {
    let rod = |parent: &str, more: &str| {
        "<link name=\"rod\"/><link name=\"bar\"/>".to_owned()
            + &joint("rod", "revolute", [parent, "rod"], &format!("<axis xyz=\"0 1 0\"/>{more}"))
            + &joint("bar", "fixed", ["rod", "bar"], "")
    };
    for n in [6, 7] {
        for at in ["base_link", "l1", "l2", "l3"] {
            for more in ["", "<mimic joint=\"j2\" multiplier=\"-1\"/>", "<mimic joint=\"j3\"/>"] {
                let bench = Bench::new(&arm(n, &Parts { more: rod(at, more), ..Parts::default() }));
                assert_eq!(bench.made(&[], &[]).n_joints(), n, "{n} {at} {more}");
            }
        }
    }
}

#[test]
fn fingers_are_left_out_and_named() {
    for n in ARMS {
        for mimic in ["", "<mimic joint=\"left\"/>"] {
            let more = "<link name=\"left\"/><link name=\"right\"/>".to_owned()
                + &joint("left", "revolute", ["tool", "left"], "")
                + &joint("right", "revolute", ["tool", "right"], mimic);
            let bench = Bench::new(&arm(n, &Parts { more, ..Parts::default() }));
            let answer = bench.new_robot(&[]);
            answer.expect("fingers", 0, &["left", "--tip"]);
            assert_eq!(load(&bench.robot_folder()).expect("it reads").n_joints(), n);
        }
    }
}

/// A joint that moves in several ways is named as the reason, and so are origins that are turned by degrees.
#[test]
fn a_planar_joint_and_angles_in_degrees_are_named() {
    for kind in ["planar", "floating"] {
        let bench = Bench::new(&arm(6, &Parts { kind: kind.into(), ..Parts::default() }));
        bench.new_robot(&[]).expect(kind, 0, &["`j2`", kind, "j1"]);
    }
    for (origin, is_named) in [("<origin rpy=\"90 0 0\"/>", true), ("<origin rpy=\"0 6.2832 -6.2832\"/>", false)] {
        let bench = Bench::new(&arm(6, &Parts { origin: origin.into(), ..Parts::default() }));
        let answer = bench.new_robot(&[]);
        answer.expect(origin, 0, &[]);
        assert_eq!(answer.stdout.contains("rpy"), is_named, "{}", answer.stdout);
    }
}

#[test]
fn options_are_obeyed_or_refused() {
    let text = arm(6, &Parts::default());
    let robot = Bench::new(&text).made(&["--base", "l1", "--tip", "l5"], &[]);
    assert_eq!((robot.base_link.as_str(), robot.joint_names().join(" ")), ("l1", "j2 j3 j4 j5".to_owned()));
    Bench::new(&text).refused(&["--base", "l5", "--tip", "l2"], &["`l5`", "`l2`", "urdf_structure"]);
    Bench::new(&text).refused(&["--base", "tool"], &["`tool`"]);
    Bench::new(&text).refused(&["--tip", "base_link"], &["`base_link`"]);
    // A root called world that moves belongs to the arm.
    let world = text.replace("base_link", "world");
    assert_eq!(Bench::new(&world).made(&[], &[]).base_link, "world");
    // A root that only joints name is valid if it is the only one.
    let implied = text.replace("<link name=\"base_link\"></link>", "");
    assert_eq!(Bench::new(&implied).made(&[], &["`base_link`", "urdf_skipped"]).n_joints(), 6);
    // A static root does not belong to the arm, unless it is named.
    let on_world =
        text.replace("</robot>", &(joint("w", "fixed", ["world", "base_link"], "") + "<link name=\"world\"/></robot>"));
    assert_eq!(Bench::new(&on_world).made(&[], &[]).base_link, "base_link");
    assert_eq!(Bench::new(&on_world).made(&["--base", "world"], &[]).base_link, "world");
}

/// A map's frame hundreds of metres away does not reduce the precision of the arm's own motion.
#[test]
fn frames_far_from_the_base_lose_no_precision() {
    for (n, at) in ARMS.into_iter().zip([[640.0, -310.0, 12.5], [-1250.5, 77.0, 0.25], [50_000.0, 4_800_000.0, 96.0]]) {
        let near = arm(n, &Parts::default());
        let [x, y, z] = at;
        let held = joint("map", "fixed", ["map", "base_link"], &format!("<origin xyz=\"{x} {y} {z}\"/>"));
        let far = near.replace("</robot>", &(held + "<link name=\"map\"/></robot>"));
        let near = Bench::new(&near).made(&["--tip", "tool"], &[]);
        let far = Bench::new(&far).made(&["--base", "map", "--tip", "tool"], &[]);
        for seed in 0..10 {
            let angles = JointAngles::from_fn(n, |joint| (f64::from(seed) * 1.3 + joint as f64).sin());
            let [near, far] = [&near, &far].map(|robot| robot.chain.frame(&angles, &robot.tool.mount));
            let off = far.translation.vector - near.translation.vector - nalgebra::Vector3::from(at);
            // A few times a double's last digit at that distance.
            let smallest_m = 8.0 * f64::EPSILON * x.abs().max(y.abs());
            assert!(off.norm() < smallest_m, "{n}: {}", off.norm());
            assert!(far.rotation.angle_to(&near.rotation) < 1e-7);
        }
    }
}

#[test]
fn a_pose_of_a_task_in_degrees_is_named_as_such() {
    let check = |robot: &Path, task: &str| {
        let file = robot.with_file_name("task.toml");
        write(&file, &format!("version = 1\nkind = \"task\"\ntolerance_m = 0.01\n{task}\n"));
        answer(program().arg("check").arg(robot).arg(&file))
    };
    let bench = Bench::new(&arm(6, &Parts::default()));
    bench.new_robot(&[]).expect("made", 0, &[]);
    let robot = bench.robot_folder();
    for (pose, angle) in
        [("10, -30, 40, 0, 60, 0", "10"), ("20, 45, 90, -10, 0, 60", "20"), ("0, 80, 1, 2, 3, 4", "80")]
    {
        let words = ["task.toml:", "poses_rad[0]:", angle, "limits", "degrees", "joint_limit"];
        check(&robot, &format!("poses_rad = [[{pose}]]")).expect(pose, 2, &words);
    }
    let beyond = check(&robot, "poses_rad = [[0, 0, 0, 0, 0, 0], [0, 3.5, 0, 0, 0, 2]]");
    beyond.expect("no degrees", 2, &["poses_rad[1]:", "3.5", "`j2`", "-1.6", "1.9", "joint_limit"]);
    assert!(!beyond.stderr.contains("degrees") && !beyond.stdout.contains("degrees"));
    check(&robot, "poses_rad = [[0.1, 0.2, 0.3, 0, 0, 0]]").expect("within", 0, &["ok:"]);
    check(&robot, "poses_rad = [[0.1, 0.2]]").expect("too few", 2, &["poses_rad[0]:", "value_count"]);
}
