//! `armcal plan`: its guarantees tested with random arms, and its refusals.

use armcal::codes::Code;
use std::path::{Path, PathBuf};

use armcal::plan::{ClearanceModel, JointErrorBounds, PlanFile, StopReason};
use armcal::robot::Robot;
use armcal::routine;
use armcal::sensor::ArmSensors;
use armcal::stats::stream_rng;
use armcal::streams::JointAngles;
use rand::RngExt;

use crate::support::texts::Texts;
use crate::support::{Answer, ShortRoutine, answer, edit, program, read, robot_copy, shared_run, temp, write};

fn plan(routine: &Path, out: &Path, more: &[&str]) -> Answer {
    answer(program().arg("plan").arg(routine).arg("--out").arg(out).args(more))
}

/// Plans, and reads the written plan.
#[track_caller]
fn planned(routine: &Path, out: &Path, more: &[&str]) -> PlanFile {
    plan(routine, out, more).expect("a plan", 0, &["predicted after the last pose", "plan"]);
    PlanFile::read(&out.join("plan.toml")).expect("the plan reads")
}

fn short(folder: &Path, tail: &str) -> PathBuf {
    ShortRoutine { tail: tail.to_owned(), ..ShortRoutine::default() }.write(folder)
}

#[test]
fn the_same_input_gives_the_same_bytes_and_check_reads_them() {
    let _texts = Texts::of("the_same_input_gives_the_same_bytes_and_check_reads_them");
    let folder = temp();
    let routine = short(folder.path(), "");
    let outs = ["a", "b", "c"].map(|name| folder.path().join(name));
    planned(&routine, &outs[0], &[]);
    planned(&routine, &outs[1], &[]);
    let other = planned(&routine, &outs[2], &["--set", "seed=2"]);
    for name in ["plan.toml", "plan.md"] {
        assert_eq!(read(&outs[0].join(name)), read(&outs[1].join(name)), "{name}");
    }
    let first = PlanFile::read(&outs[0].join("plan.toml")).expect("reads");
    assert_ne!(first.pose[0].angles_rad, other.pose[0].angles_rad, "another seed, other poses");
    assert_ne!(first.inputs_hash, other.inputs_hash);
    assert_eq!((first.totals.poses, first.totals.stop_reason), (first.pose.len(), StopReason::Poses));
    assert_eq!(first.totals.poses + first.totals.left_out, 16);
    let file = outs[0].join("plan.toml");
    answer(program().arg("check").arg(&file)).expect("check", 0, &["clear"]);
    for (from, to, word) in [
        ("version = 1", "version = 2", "version"),
        ("number = 2", "number = 7", "pose 2: number"),
        ("margin_m = 0.05", "margin_m = nan", "margin_m"),
        ("joints = [", "joints = [\"extra\", ", "start_rad"),
    ] {
        let spoilt = folder.path().join("spoilt.toml");
        std::fs::copy(&file, &spoilt).expect("copied");
        edit(&spoilt, from, to);
        answer(program().arg("check").arg(&spoilt)).expect(word, 2, &["spoilt.toml", word]);
    }
}

/// The counts for the operator are the readings of the estimated sensors at the planned angles.
#[test]
fn counts_belong_to_their_angles() {
    let folder = temp();
    let file = planned(&short(folder.path(), ""), folder.path(), &[]);
    let robot = crate::support::titan();
    let sensors = ArmSensors::nominal(&robot);
    for pose in &file.pose {
        let counts = sensors.counts(&JointAngles::from_slice(&pose.angles_rad));
        for (joint, spec) in robot.sensors.iter().enumerate() {
            let apart = (pose.raw_counts[joint] - counts[joint]).abs();
            let apart = apart.min(spec.wrap_counts - apart);
            // Tolerance from the digits of the file: 1e-6 rad and 1e-3 counts.
            assert!(apart <= 1e-6 * spec.counts_per_rad.abs() + 1e-3, "pose {}: {joint}: {apart}", pose.number);
        }
    }
    for (n, path) in file.path.iter().enumerate() {
        assert_eq!(path.waypoints_rad.last(), Some(&file.pose[n].angles_rad), "a path ends where its pose is");
        assert_eq!(path.waypoints_counts.last(), Some(&file.pose[n].raw_counts));
        let before = if n == 0 { &file.start_rad } else { &file.pose[n - 1].angles_rad };
        assert_eq!(path.waypoints_rad.first(), Some(before), "and begins at the one before");
    }
}

/// An arm whose counts are radians gets set-points in radians, with their sign and as many digits as the angles have.
#[test]
fn set_points_in_radians_are_neither_wrapped_nor_rounded_to_whole_numbers() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    let in_radians = |line: &str| match line.split_once(" = ").map(|(key, _)| key) {
        Some("offset_counts") => "offset_counts = 0.0".to_owned(),
        Some("scale_counts_per_deg") => "scale_counts_per_deg = 0.017453292519943295".to_owned(),
        Some("wrap_counts") => "wrap_counts = 1e6".to_owned(),
        Some("noise_std_counts") => "noise_std_counts = 1e-4".to_owned(),
        _ => line.to_owned(),
    };
    let lines: Vec<String> = read(&robot.join("robot.toml")).lines().map(in_radians).collect();
    write(&robot.join("robot.toml"), &lines.join("\n"));
    let routine = ShortRoutine { robot, ..ShortRoutine::default() }.write(folder.path());
    let file = planned(&routine, &folder.path().join("plan"), &[]);
    let mut shown = 0;
    let table = read(&folder.path().join("plan/plan.md"));
    for pose in &file.pose {
        for (counts, angle) in pose.raw_counts.iter().zip(&pose.angles_rad) {
            assert!((counts - angle).abs() < 2e-6, "pose {}: {counts} for {angle} rad", pose.number);
            shown += usize::from(table.contains(&format!("{counts:.3}")));
        }
    }
    assert_eq!(shown, file.pose.len() * file.joints.len(), "{table}");
}

#[test]
fn totals_that_contradict_their_poses_are_refused() {
    let folder = temp();
    let file = folder.path().join("plan.toml");
    let good = read(&crate::support::root().join("fuzz/corpus/plan/plan.toml"));
    let totals = PlanFile::read(&crate::support::root().join("fuzz/corpus/plan/plan.toml")).expect("it reads").totals;
    for (key, value, edited) in [
        ("least_clearance_m", totals.least_clearance_m.to_string(), "0.35"),
        ("poses", totals.poses.to_string(), "31"),
        ("left_out", totals.left_out.to_string(), "2"),
    ] {
        let (from, to) = (format!("\n{key} = {value}\n"), format!("\n{key} = {edited}\n"));
        assert!(good.contains(&from), "{key}");
        write(&file, &good.replacen(&from, &to, 1));
        answer(program().arg("check").arg(&file)).expect(key, 2, &["[keys_conflict]", "plan.toml", key]);
    }
}

#[test]
fn a_prior_narrows_the_bounds_and_renames_the_angles() {
    let folder = temp();
    let routine = short(folder.path(), "");
    let datasheet = planned(&routine, &folder.path().join("datasheet"), &[]);
    let calibration = shared_run().file("calibration.toml");
    let prior = planned(&routine, &folder.path().join("prior"), &["--prior", calibration.to_str().expect("UTF-8")]);
    assert_eq!(datasheet.prior, "datasheet");
    assert_eq!(prior.prior.len(), 64);
    let mean = |file: &PlanFile, joint: usize| {
        file.pose.iter().map(|pose| pose.error_bound_rad[joint]).sum::<f64>() / file.pose.len() as f64
    };
    for joint in 0..5 {
        let (before, after) = (mean(&datasheet, joint), mean(&prior, joint));
        assert!(after < 0.6 * before, "joint {joint}: {before} {after}");
    }
    // The start is the same estimated pose, but has other readings, because the estimated sensors have errors.
    assert_eq!(prior.start_rad, datasheet.start_rad);
    let robot = crate::support::titan();
    let moved = (0..5).filter(|&j| (prior.start_counts[j] - datasheet.start_counts[j]).abs() > 10.0).count();
    assert!(moved >= 4, "{:?} {:?}", prior.start_counts, datasheet.start_counts);
    // The errors reduce the nominal arm's clearance by less.
    let lost = |file: &PlanFile| {
        file.pose.iter().map(|pose| pose.clearance_m - pose.proven_clearance_m).sum::<f64>() / file.pose.len() as f64
    };
    assert!(lost(&prior) < lost(&datasheet), "{} {}", lost(&prior), lost(&datasheet));
    let other = folder.path().join("other.toml");
    write(&other, &read(&calibration).replace(&robot.name, "other"));
    plan(&routine, folder.path(), &["--prior", other.to_str().expect("UTF-8")]).expect("other arm", 2, &["other.toml"]);
}

/// A routine of the name of a result, and a prior that is the result of an earlier calibration, stay as they are.
#[test]
fn plans_overwrite_no_file_that_they_read() {
    let folder = temp();
    let routine = folder.path().join("plan.toml");
    std::fs::rename(short(folder.path(), ""), &routine).expect("renamed");
    let before = read(&routine);
    plan(&routine, folder.path(), &[]).expect("plan", 2, &["plan.toml", "[file_exists]"]);
    assert_eq!(read(&routine), before);
}

/// Angles of a true arm within the error box about the believed ones. Each joint is at an end of its interval with
/// probability 1/2, otherwise uniform between the ends.
fn random_arm(robot: &Robot, bounds: &JointErrorBounds, believed: &JointAngles, rng: &mut impl RngExt) -> JointAngles {
    JointAngles::from_fn(believed.len(), |joint| {
        // The last joint turns an almost round gripper: its error moves no outline.
        if robot.chain.joints()[joint].limits.is_none() {
            return believed[joint];
        }
        let error_rad = bounds.error_rad(joint, believed[joint]);
        believed[joint] + error_rad * rng.random_range(-2.0..=2.0_f64).clamp(-1.0, 1.0)
    })
}

/// Every arm within the datasheet's bounds keeps the plan's certified clearance, at the poses and on the way.
#[test]
fn every_edge_keeps_its_proven_clearance_for_random_arms() {
    let folder = temp();
    let box_beside =
        "[[obstacle]]\nname = \"rock\"\nshape = \"sphere\"\nradius_m = 0.3\nposition_m = [3.3, -1.6, -0.2]\n";
    let file = short(folder.path(), box_beside);
    let plan = planned(&file, folder.path(), &[]);
    let routine = routine::load(&file).expect("the routine reads");
    let (robot, vehicle) = routine.load_arm().expect("the arm reads");
    let model = ClearanceModel::new(&robot, &vehicle, &routine.scene);
    let bounds = JointErrorBounds::datasheet(&robot);
    let mut rng = stream_rng(3, "arms");
    let (mut least_m, mut spare_m) = (f64::INFINITY, f64::INFINITY);
    for path in &plan.path {
        for edge in path.waypoints_rad.windows(2) {
            for _ in 0..400 {
                let share = rng.random_range(0.0..=1.0);
                let believed =
                    JointAngles::from_fn(robot.n_joints(), |j| edge[0][j] + share * (edge[1][j] - edge[0][j]));
                let found_m = model.nearest(&random_arm(&robot, &bounds, &believed, &mut rng)).distance_m;
                (least_m, spare_m) = (least_m.min(found_m), spare_m.min(found_m - path.proven_clearance_m));
            }
        }
    }
    // The tolerance comes from the digits of the file: 1e-6 rad over 2 m.
    assert!(least_m >= plan.margin_m - 1e-5, "{least_m}");
    assert!(spare_m >= -1e-5, "{spare_m}");
    // Random arms come near to the certified clearance, so the bound is not loose.
    assert!(spare_m < 0.02, "{spare_m}");
}

#[test]
fn what_cannot_be_planned_is_named() {
    let _texts = Texts::of("what_cannot_be_planned_is_named");
    let folder = temp();
    let out = folder.path().join("out");
    let far = ShortRoutine { targets_m: vec![[4.0, 0.0, 0.0], [0.0, 0.0, 5.0]], ..ShortRoutine::default() };
    let refused = |routine: &Path, more: &[&str], words: &[&str]| {
        plan(routine, &out, more).expect("refused", 2, words);
        assert!(!out.join("plan.toml").exists(), "{words:?}");
    };
    refused(&far.write(folder.path()), &[], &["target 1", "4.000"]);
    let rock = "[[obstacle]]\nname = \"rock\"\nshape = \"sphere\"\nradius_m = 0.5\nposition_m = [2.6, -0.6, 0.2]\n";
    refused(&short(folder.path(), rock), &[], &["rock"]);
    let script = "[[step]]\ndo = \"move\"\nto_rad = [-2.4, -0.3, 0.0, 0.0, 0.0, 0.0]\n\
                  [[step]]\ndo = \"capture\"\n[[step]]\ndo = \"calibrate\"\n";
    let file = short(folder.path(), script);
    plan(&file, &folder.path().join("moved"), &[]).expect("a free goal", 0, &[]);
    let robot = crate::support::titan();
    let goal = JointAngles::from_slice(&[-2.4, -0.3, 0.0, 0.0, 0.0, 0.0]);
    let tool = robot.chain.link_poses(&goal).frame(&robot.tool.mount).translation.vector;
    // The base is at (1.7, -0.6, 0.1) of the vehicle, without rotation.
    let [x, y, z] = [tool.x + 1.7, tool.y - 0.6, tool.z + 0.1];
    let rock =
        format!("[[obstacle]]\nname = \"rock\"\nshape = \"sphere\"\nradius_m = 0.1\nposition_m = [{x}, {y}, {z}]\n");
    refused(&short(folder.path(), &format!("{script}{rock}")), &[], &["step 1", "rock"]);
    refused(&short(folder.path(), &script.replace("-0.3", "1.5")), &[], &["step 1", "shoulder_pitch", "stop"]);
    refused(&short(folder.path(), ""), &["--set", "capture.min_tags=60"], &["60", "tags"]);
    refused(&short(folder.path(), ""), &["--prior", "nowhere.toml"], &["nowhere.toml"]);
}

/// Without a shape on any link every path would count as clear.
#[test]
fn an_arm_without_collision_shapes_is_neither_planned_for_nor_run() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    let urdf = robot.join("titan4.urdf");
    let text = read(&urdf);
    let mut parts = text.split("<collision>");
    let before = parts.next().expect("the text before the first shape").to_owned();
    let rest = parts.map(|part| part.split_once("</collision>").expect("the end of a shape").1);
    write(&urdf, &(before + &rest.collect::<String>()));
    let routine = ShortRoutine { robot: robot.clone(), ..ShortRoutine::default() }.write(folder.path());
    let words = ["titan4.urdf", "[key_missing]"];
    plan(&routine, &folder.path().join("plan"), &[]).expect("plan", 2, &words);
    crate::support::run(&routine, &folder.path().join("run")).expect("run", 2, &words);
    answer(program().arg("check").arg(&robot)).expect("check", 0, &["[planning_incomplete]"]);
}

/// A plan that does not suffice is still a plan: warnings in its files and on the terminal say what it lacks.
#[test]
fn too_few_poses_and_too_large_an_error_are_warnings() {
    let folder = temp();
    let routine = ShortRoutine { poses: 4, held_out: 0, ..ShortRoutine::default() }.write(folder.path());
    let told = plan(&routine, folder.path(), &["--set", "task.tolerance_m=0.0002"]);
    told.expect("a poor plan", 0, &["[too_few_views]", "[beyond_tolerance]"]);
    let file = PlanFile::read(&folder.path().join("plan.toml")).expect("the plan reads");
    let codes: Vec<Code> = file.warnings.iter().map(|warning| warning.code).collect();
    assert_eq!(codes, [Code::TooFewViews, Code::BeyondTolerance]);
    assert!(file.totals.predicted_tool_error_m.is_some_and(|error_m| error_m > 0.0002), "{:?}", file.totals);
    let shown = read(&folder.path().join("plan.md"));
    assert!(codes.iter().all(|code| shown.contains(&format!("[{code}]"))), "{shown}");
    let enough = planned(&short(folder.path(), ""), folder.path(), &[]);
    assert_eq!(enough.warnings, []);
    assert!(!read(&folder.path().join("plan.md")).contains("warning"));
}

/// The plan moves neither a joint that cannot follow nor one that nobody can see follow.
#[test]
fn declared_failed_joints_are_held_where_the_arm_is_stowed() {
    let names = crate::support::titan().joint_names();
    for (name, kind) in [("wrist_yaw", "locked"), ("wrist_pitch", "dead")] {
        let folder = temp();
        let failed = format!("[[failed_joint]]\njoint = \"{name}\"\nkind = \"{kind}\"\n");
        let file = planned(&short(folder.path(), &failed), folder.path(), &[]);
        let joint = names.iter().position(|joint| joint == name).expect("a joint of the arm");
        let held_rad = crate::support::titan().stowed[joint];
        let waypoints = file.path.iter().flat_map(|path| &path.waypoints_rad);
        let moved = waypoints.chain(file.pose.iter().map(|pose| &pose.angles_rad));
        assert!(moved.clone().count() > 16, "{name}");
        assert!(moved.into_iter().all(|angles| (angles[joint] - held_rad).abs() < 1e-6), "{name}");
        let of_joint = file.warnings.iter().filter(|warning| warning.code == Code::JointAssumed);
        assert_eq!(of_joint.filter(|warning| warning.text.contains(name)).count(), 1, "{:?}", file.warnings);
    }
}

/// One target of five is out of the arm's reach before calibration: a warning, and a plan for the others.
#[test]
fn a_single_target_out_of_reach_is_a_warning() {
    let folder = temp();
    let mut routine = ShortRoutine::default();
    routine.targets_m[2] = [3.5, 0.0, 0.0];
    let file = planned(&routine.write(folder.path()), folder.path(), &[]);
    assert_eq!(file.warnings.len(), 1, "{:?}", file.warnings);
    assert_eq!(file.warnings[0].code, Code::TargetSkipped);
    assert!(file.warnings[0].text.contains("target 3"), "{:?}", file.warnings);
    assert_eq!(file.totals.poses + file.totals.left_out, 16);
}
