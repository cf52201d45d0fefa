//! Every arm on every vehicle; tags that belong to the vehicle; meshes that are obstacles and are stored in a
//! recording.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use armcal::kinematics::LinkPoses;
use armcal::log::{RecordingHeader, RecordingWriter, read_attachments, read_recording, strip};
use armcal::plan::{ClearanceModel, JointErrorBounds, VisibilityModel};
use armcal::robot::{Robot, Vehicle, load, load_vehicle};
use armcal::routine::{Scene, load_scene};
use armcal::sensor::ArmSensors;
use armcal::sim::truth::{TruthRecorder, read_truth};
use armcal::sim::{World, WorldInput, WorldSpec};
use armcal::stats::stream_rng;
use armcal::streams::{Arm, JointAngles, Message, Sink};
use nalgebra::{Point3, Vector3};
use rand::RngExt;

use crate::support::texts::Texts;
use crate::support::{
    Nowhere, ShortRoutine, answer, calibrate, edit, finished, program, read, root, temp, titan, vehicle_file, write,
};

const ARMS: [&str; 2] = ["titan4", "kraft-predator"];
const VEHICLES: [&str; 4] = ["work-class-front", "open-frame", "tight-basket", "under-ice"];

fn arm_folder(name: &str) -> PathBuf {
    root().join("robots").join(name)
}

fn vehicle(name: &str) -> Vehicle {
    load_vehicle(&root().join("robots/vehicles").join(format!("{name}.toml"))).expect("the vehicle reads")
}

fn mounted(arm: &str, vehicle: &Vehicle) -> Robot {
    load(&arm_folder(arm)).and_then(|robot| robot.mounted_on(vehicle)).expect("the arm fits")
}

#[test]
fn every_arm_starts_clear_of_every_vehicle_with_tags_in_view() {
    for name in VEHICLES {
        let vehicle = vehicle(name);
        for arm in ARMS {
            let robot = mounted(arm, &vehicle);
            let clearance = ClearanceModel::new(&robot, &vehicle, &Scene::default());
            let prior = JointErrorBounds::datasheet(&robot);
            let nearest = clearance.nearest_under(&robot.stowed, &prior, 0.0);
            let seen = VisibilityModel::default().visible(&robot, &clearance, &robot.stowed);
            eprintln!("{arm} on {name}: {:.3} m, {nearest}, {} tags", nearest.distance_m, seen.len());
            assert!(nearest.distance_m > 0.06, "{arm} on {name}: {nearest} {}", nearest.distance_m);
            assert!(seen.len() >= 4, "{arm} on {name}: {seen:?}");
        }
    }
}

/// With the nominal shapes, no moving link begins in contact with anything, for any of these seeds.
#[test]
fn no_world_begins_in_contact() {
    for name in VEHICLES {
        let vehicle = vehicle(name);
        for arm in ARMS {
            let robot = mounted(arm, &vehicle);
            for seed in 1..=3 {
                let (scene, spec) = (Scene::default(), WorldSpec::default());
                let input = WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed };
                let contacts = contacts_of(input, &robot.stowed, 1.0);
                assert!(contacts.is_empty(), "{arm} on {name}, seed {seed}: {contacts:?}");
            }
        }
    }
}

/// Pairs of parts that touched while the arm was commanded to `angles` by the datasheet.
fn contacts_of(input: WorldInput<'_>, angles: &JointAngles, seconds: f64) -> Vec<(String, String)> {
    let counts = ArmSensors::nominal(input.robot).counts(angles);
    let folder = temp();
    let file = folder.path().join("truth.mcap");
    let mut world = World::new(input).expect("a world");
    world.set_truth_sink(Box::new(TruthRecorder::create(&file).expect("a file"))).expect("accepted");
    world.command(&counts).expect("accepted");
    Nowhere::watch(&mut world, seconds);
    world.finish_truth().expect("finished");
    read_truth(&file).expect("it reads").contacts.into_iter().map(|c| (c.part_a, c.part_b)).collect()
}

/// The tags of a vehicle have poses in its own frame, on its own plates.
#[test]
fn tags_of_a_vehicle_lie_on_its_plates() {
    for name in &VEHICLES[1..] {
        let vehicle = vehicle(name);
        let robot = mounted("titan4", &vehicle);
        assert_eq!(robot.tags.len(), 8, "{name}");
        for tag in &robot.tags {
            let behind = tag.base_from_tag.isometry() * Point3::new(0.0, 0.0, -0.0115);
            let behind = vehicle.vehicle_from_base.isometry() * behind;
            let is_near = |center: Vector3<f64>| (center - behind.coords).norm() < 1e-5;
            assert!(
                vehicle.parts.iter().any(|part| is_near(part.placed.owner_from_shape.translation.vector)),
                "{name}: tag {}",
                tag.id
            );
        }
    }
}

/// A box of 0.6 x 0.4 x 0.5 m about its centre, in mm, as OBJ.
fn box_obj() -> String {
    let mut text = String::new();
    for x in [-300, 300] {
        for y in [-200, 200] {
            for z in [-250, 250] {
                writeln!(text, "v {x} {y} {z}").expect("text");
            }
        }
    }
    text + "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
}

/// The same box at `at_m` (world frame), as a box and as a mesh.
fn box_and_mesh(folder: &Path, at_m: [f64; 3]) -> [Scene; 2] {
    write(&folder.join("block.obj"), &box_obj());
    let place = format!("position_m = {at_m:?}\nquaternion_wxyz = [0.9238795325, 0.0, 0.0, 0.3826834324]\n");
    ["shape = \"box\"\nsize_m = [0.6, 0.4, 0.5]\n", "shape = \"mesh\"\nfile = \"block.obj\"\nscale_m = 0.001\n"].map(
        |shape| {
            let file = folder.join("scene.toml");
            write(&file, &format!("version = 1\nkind = \"scene\"\n[[obstacle]]\nname = \"rock\"\n{shape}{place}"));
            load_scene(&file).expect("the scene reads")
        },
    )
}

#[test]
fn a_mesh_stands_in_the_way_like_the_box_that_it_is() {
    let folder = temp();
    let (robot, vehicle) = (titan(), load_vehicle(&vehicle_file()).expect("it reads"));
    let scenes = box_and_mesh(folder.path(), [2.7, -0.3, -0.3]);
    let models = scenes.each_ref().map(|scene| ClearanceModel::new(&robot, &vehicle, scene));
    let free = ClearanceModel::new(&robot, &vehicle, &Scene::default());
    let prior = JointErrorBounds::datasheet(&robot).safe_limits(&robot);
    let (mut rng, mut near, mut hidden) = (stream_rng(1, "poses"), 0, 0);
    for _ in 0..600 {
        let angles = JointAngles::from_fn(6, |j| rng.random_range(prior[j].lower_rad..prior[j].upper_rad));
        let [as_box, as_mesh] = models.each_ref().map(|model| model.nearest(&angles));
        assert!((as_box.distance_m - as_mesh.distance_m).abs() < 1e-6, "{as_box:?} {as_mesh:?}");
        near += u32::from(as_mesh.second == "rock" && as_mesh.distance_m > 0.0);
        let seen = |model| VisibilityModel::default().visible(&robot, model, &angles);
        let [with_box, with_mesh] = models.each_ref().map(seen);
        assert_eq!(with_box, with_mesh);
        hidden += seen(&free).len() - with_mesh.len();
    }
    eprintln!("nearest to the rock {near} times, {hidden} tags hidden by it");
    assert!(near > 10 && hidden > 10, "{near} {hidden}");
}

#[test]
fn an_arm_driven_into_a_mesh_is_in_the_truth_file() {
    let (robot, vehicle) = (titan(), load_vehicle(&vehicle_file()).expect("it reads"));
    let mut angles = robot.stowed;
    angles[0] -= 0.8;
    let poses: LinkPoses = robot.chain.link_poses(&angles);
    let tool = vehicle.vehicle_from_base.isometry() * poses.frame(&robot.tool.mount) * Point3::origin();
    let folder = temp();
    for scene in box_and_mesh(folder.path(), tool.coords.into()) {
        let input = WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec: WorldSpec::default(), seed: 1 };
        let contacts = contacts_of(input, &angles, 6.0);
        assert!(contacts.iter().any(|(a, b)| a == "rock" || b == "rock"), "{contacts:?}");
    }
}

fn calibration_of(recording: &Path, robot: &Path) -> String {
    let out = temp();
    calibrate(recording, robot, out.path()).expect("calibrate", 0, &["ACCEPTED"]);
    read(&out.path().join("calibration.toml"))
}

/// A copy of an arm's folder for editing.
fn copy_of(arm: &str, folder: &Path) -> PathBuf {
    let copy = folder.join(arm);
    fs::create_dir_all(&copy).expect("a folder");
    for entry in fs::read_dir(arm_folder(arm)).expect("a folder").flatten() {
        fs::copy(entry.path(), copy.join(entry.file_name())).expect("copied");
    }
    copy
}

/// The whole loop with the second arm, on a vehicle with its own tags, next to a mesh. The recording's messages have
/// all inputs of the calibration, and its attachments have all shapes of the replay.
#[test]
fn tags_of_the_vehicle_and_meshes_travel_with_the_recording() {
    const ARM: &str = "kraft-predator";
    let folder = temp();
    let start = folder.path().join("start");
    fs::create_dir_all(&start).expect("a folder");
    write(&start.join("block.obj"), &box_obj());
    let routine = ShortRoutine {
        robot: arm_folder(ARM),
        vehicle: root().join("robots/vehicles/open-frame.toml"),
        targets_m: vec![[1.074, 0.001, -0.008], [1.012, 0.595, 0.147], [0.820, -0.755, 0.793], [0.867, -1.068, 0.076]],
        tail: "[[obstacle]]\nname = \"rock\"\nshape = \"mesh\"\nfile = \"block.obj\"\nscale_m = 0.002\n\
            position_m = [3.4, 0.0, -1.4]\n"
            .to_owned(),
        ..ShortRoutine::default()
    };
    let run = finished(&routine, &start);
    let summary = run.summary();
    assert_eq!((summary.capture.collisions, summary.capture.targets_skipped), (Some(0), 0));
    let expected = read(&run.file("calibration.toml"));

    // A copy without other files in its folder, and without attachments and metadata.
    let alone = folder.path().join("alone.mcap");
    fs::copy(run.file("run.mcap"), &alone).expect("copied");
    assert!(calibration_of(&alone, &arm_folder(ARM)) == expected);
    let bare = folder.path().join("bare.mcap");
    strip(&alone, &bare).expect("stripped");
    assert!(calibration_of(&bare, &arm_folder(ARM)) == expected, "without attachments");

    // The robot's own tags do not matter, because the recording has the survey.
    let robot = copy_of(ARM, folder.path());
    edit(&robot.join("robot.toml"), "position_m = [-0.4785, 0.45, -0.4]", "position_m = [0.0, 0.0, 5.0]");
    assert!(calibration_of(&alone, &robot) == expected, "with other tags in robot.toml");

    // The robot's own tags matter if the recording has no survey.
    let recording = read_recording(&alone).expect("it reads");
    let unsurveyed = folder.path().join("unsurveyed.mcap");
    let mut writer =
        RecordingWriter::create(&unsurveyed, RecordingHeader::new(recording.joint_names.clone())).expect("a file");
    let mut n_surveys = 0;
    for (log_time, message) in &recording.messages {
        match message {
            Message::Survey(_) => n_surveys += 1,
            message => writer.record(*log_time, message).expect("recorded"),
        }
    }
    writer.finish().expect("finished");
    assert_eq!(n_surveys, 1);
    let out = temp();
    calibrate(&unsurveyed, &arm_folder(ARM), out.path()).expect("by the tags of another vehicle", 4, &["REFUSED"]);

    // The replay needs neither the mesh nor the vehicle's file.
    let scene = read_attachments(&alone).expect("it reads").into_iter().find(|(name, _)| name == "scene.toml");
    let scene = String::from_utf8(scene.expect("attached").1).expect("text");
    assert!(scene.contains("\"hull\"") && !scene.contains("block.obj"), "{scene}");
    fs::remove_dir_all(&start).expect("removed");
    let shown = folder.path().join("alone.rrd");
    answer(program().arg("replay").arg(&alone).arg("--save").arg(&shown)).expect("replay", 0, &["alone.rrd"]);
    assert!(fs::metadata(&shown).expect("written").len() > 10_000);
}

#[test]
fn what_is_wrong_with_a_vehicles_tags_is_named() {
    let _texts = Texts::of("what_is_wrong_with_a_vehicles_tags_is_named");
    let folder = temp();
    let file = folder.path().join("v.toml");
    let check = |from: &str, to: &str, words: &[&str]| {
        write(&file, &read(&root().join("robots/vehicles/open-frame.toml")));
        edit(&file, from, to);
        answer(program().arg("check").arg(&file)).expect(to, 2, words);
    };
    check("base_tag = 0\n", "", &["v.toml", "base_tag"]);
    check("base_tag = 0\n", "base_tag = 9\n", &["v.toml", "base_tag", "tag 9"]);
    check("id = 1\n", "id = 0\n", &["v.toml", "tag 0: id", "twice"]);
    check("size_m = 0.15\n", "size_m = -0.15\n", &["v.toml", "tag 0: size_m", "0.001 .. 10"]);
    check("family = \"36h11\"", "family = \"36h10\"", &["v.toml", "tag 0: family", "36h10", "\"25h9\""]);
    check("id = 1\nfamily = \"36h11\"", "id = 1\nfamily = \"16h5\"", &["v.toml", "tag 1: family", "16h5", "36h11"]);

    write(&file, &read(&root().join("robots/vehicles/open-frame.toml")));
    edit(&file, "titan4 = [", "titan4 = [0.0, ");
    let error = titan().mounted_on(&load_vehicle(&file).expect("it reads")).expect_err("seven angles").to_string();
    assert!(error.contains("v.toml") && error.contains("stowed_rad.titan4") && error.contains("6 angles"), "{error}");
}

#[test]
fn what_is_wrong_with_a_mesh_of_a_routine_is_named() {
    let _texts = Texts::of("what_is_wrong_with_a_mesh_of_a_routine_is_named");
    let folder = temp();
    let tail = |file: &str| {
        format!("[[obstacle]]\nname = \"rock\"\nshape = \"mesh\"\nfile = \"{file}\"\nposition_m = [0.0, 3.0, 0.0]\n")
    };
    write(&folder.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write(&folder.path().join("text.stl"), "no mesh");
    for name in ["none.stl", "text.stl", "flat.obj"] {
        let routine = ShortRoutine { tail: tail(name), ..ShortRoutine::default() }.write(folder.path());
        answer(program().arg("check").arg(&routine)).expect(name, 2, &["short.toml", name]);
    }
}
