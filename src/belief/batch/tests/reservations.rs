//! Unobservable parameters move the tool by as much as their reservations predict.

use nalgebra::{Isometry3, Vector3};

use crate::batch::tests::data::{Noise, Truth, reference, rng, titan, titan_with_gripper_tag, views, watched_titan};
use crate::batch::tests::statistics;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::say::reservation::Reservation;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::model_for_views::model_for;
use crate::views::view::View;
use armcal_core::joints::{JointAngles, MAX_JOINTS};
use armcal_core::kinematics::Chain;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;

const N_VIEWS: usize = 25;
const AXES: [&str; 3] = ["x", "y", "z"];

/// One change of the nominal model, within a sigma of its prior.
#[derive(Clone, Copy, Debug)]
enum Change {
    MountShift,
    MountTurn,
    LinkShift(usize),
    LinkTurn(usize),
    Tool,
}

const SHIFT_M: f64 = 5e-4;
const TURN_RAD: f64 = 5e-4;

impl Change {
    /// Name of the change in a reservation.
    fn name(self, robot: &Robot, axis: usize) -> String {
        let joint = |joint: usize| &robot.chain.joints()[joint].name;
        match self {
            Self::MountShift => format!("camera mount, shift along {}", AXES[axis]),
            Self::MountTurn => format!("camera mount, rotation about {}", AXES[axis]),
            Self::LinkShift(at) => format!("pose of {}, shift along {}", joint(at), AXES[axis]),
            Self::LinkTurn(at) => format!("pose of {}, rotation about {}", joint(at), AXES[axis]),
            Self::Tool => format!("tool point, shift along {}", AXES[axis]),
        }
    }

    fn size(self) -> f64 {
        if matches!(self, Self::MountTurn | Self::LinkTurn(_)) { TURN_RAD } else { SHIFT_M }
    }

    fn pose(self, axis: usize) -> Isometry3<f64> {
        let along = Vector3::ith(axis, self.size());
        match self {
            Self::MountTurn | Self::LinkTurn(_) => Isometry3::rotation(along),
            _ => Isometry3::translation(along.x, along.y, along.z),
        }
    }

    /// The true arm, and its camera's mount.
    fn apply(self, robot: &Robot, axis: usize) -> (Robot, Isometry3<f64>) {
        let mut real = robot.clone();
        let mut mount = robot.camera.mount.link_from_frame;
        match self {
            Self::MountShift | Self::MountTurn => mount *= self.pose(axis),
            Self::Tool => real.tool.mount.link_from_frame *= self.pose(axis),
            Self::LinkShift(joint) | Self::LinkTurn(joint) => {
                let mut joints = robot.chain.joints().to_vec();
                let place = &mut joints[joint].parent_from_joint;
                let changed = self.pose(axis);
                place.translation.vector += changed.translation.vector;
                place.rotation = changed.rotation * place.rotation;
                real.chain = Chain::new(joints);
            }
        }
        (real, mount)
    }
}

fn task(robot: &Robot) -> Vec<JointAngles> {
    let at = |k: usize| JointAngles::from_fn(robot.n_joints(), |j| 0.5 * ((k * 7 + j * 3) as f64).sin());
    (0..6).map(at).collect()
}

/// Runs `of` on the estimate by the nominal model `robot` from views of the arm `real`.
fn with_estimate<T>(robot: &Robot, real: &Robot, mount: Isometry3<f64>, of: impl FnOnce(&Estimate<'_>) -> T) -> T {
    let mut rng = rng(3, "reservations");
    let scales = Hyperparameters::datasheet(robot);
    let tags = robot.tags.iter().map(|tag| *tag.base_from_tag.isometry()).collect();
    let gripper_tag = robot.gripper_tag.map(|tag| tag.mount.link_from_frame);
    let parameters = JointParameters { reference: reference(), ..JointParameters::default() };
    let truth = Truth { parameters, mount, further_mounts: Vec::new(), tags, gripper_tag, lean_rad: 0.0 };
    let noise = Noise { corner_px: 0.3, n_frames: 8, joint_rad: [1e-4; MAX_JOINTS] };
    let views: Vec<View> = views(real, &truth, &noise, N_VIEWS, &mut rng);
    let model = model_for(robot, &views);
    let input = BundleInput {
        robot,
        views: &views,
        model,
        scales,
        guess: JointParameters { reference: reference(), ..JointParameters::default() },
        joint_prior: None,
        evidence: HyperparameterMode::Given,
    };
    of(&estimate(&input).expect("solved"))
}

/// Estimated minus true tool position, base frame, m.
fn tool_errors(robot: &Robot, real: &Robot, found: &Estimate<'_>) -> Vec<Vector3<f64>> {
    let (nominal, sensors) = (ArmSensors::nominal(robot), found.parameters().sensors(robot));
    let tool_m =
        |robot: &Robot, at: &JointAngles| robot.chain.link_poses(at).frame(&robot.tool.mount).translation.vector;
    let error = |at: &JointAngles| tool_m(robot, &sensors.angles(&nominal.counts(at))) - tool_m(real, at);
    task(robot).iter().map(error).collect()
}

fn rms(vectors: impl Iterator<Item = Vector3<f64>>) -> f64 {
    let squares: Vec<f64> = vectors.map(|v| v.norm_squared()).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn all_reservations(robot: &Robot) -> (Vec<Reservation>, Vec<Vector3<f64>>) {
    let mount = robot.camera.mount.link_from_frame;
    with_estimate(robot, robot, mount, |found| {
        (found.prior_impact(&task(robot), 0.0).reservations, tool_errors(robot, robot, found))
    })
}

#[test]
fn an_unseen_change_moves_the_tool_as_its_reservation_says() {
    let robot = titan();
    let (reservations, as_drawn) = all_reservations(&robot);
    let mut changes = vec![Change::MountShift, Change::MountTurn, Change::Tool];
    changes.extend((0..robot.n_joints()).flat_map(|joint| [Change::LinkShift(joint), Change::LinkTurn(joint)]));
    let mut n_checked = 0;
    for (change, axis) in changes.into_iter().flat_map(|change| (0..3).map(move |axis| (change, axis))) {
        let name = change.name(&robot, axis);
        let (stem, letter) = name.split_at(name.len() - 1);
        let expected = reservations.iter().find_map(|found| {
            let axes = found.what.strip_prefix(stem)?;
            let at = axes.split(", ").position(|of| of == letter || of == "any axis")?;
            Some(found.by_axis_m.get(at).copied().unwrap_or(found.tool_error_m) / found.prior_std)
        });
        let Some(per_unit) = expected else { continue };
        let expected_m = per_unit * change.size();
        // If the joints absorb the whole change, there is nothing to compare.
        if expected_m < 2e-5 {
            continue;
        }
        let (real, mount) = change.apply(&robot, axis);
        let errors = with_estimate(&robot, &real, mount, |found| tool_errors(&robot, &real, found));
        let moved_m = rms(errors.iter().zip(&as_drawn).map(|(with, without)| with - without));
        println!("{name}: {:.2} mm, expected {:.2} mm", moved_m * 1e3, expected_m * 1e3);
        assert!((moved_m / expected_m - 1.0).abs() < 0.1, "{name}: {moved_m} m, expected {expected_m} m");
        n_checked += 1;
    }
    assert!(n_checked >= 8, "only {n_checked} changes were unseen");
}

/// A turn of the last joint before the camera and a turn of the camera about its axis look alike.
#[test]
fn a_gripper_tag_shows_the_turn_that_nothing_else_shows() {
    let turns = |robot: &Robot| {
        let (reservations, _) = all_reservations(robot);
        let of_mount = |reservation: &&Reservation| reservation.what.starts_with("camera mount, rotation");
        reservations.iter().filter(of_mount).map(|reservation| reservation.tool_error_m).fold(0.0, f64::max)
    };
    let (without, with) = (turns(&titan()), turns(&titan_with_gripper_tag()));
    println!("turn of the mount by its prior: {:.2} mm without, {:.2} mm with", without * 1e3, with * 1e3);
    assert!(without > 5e-4 && with < 0.3 * without, "{without} m without, {with} m with");
}

/// Views determine the lens, so that only a narrow prior makes it unobservable.
#[test]
fn a_lens_that_is_off_moves_the_tool_as_its_reservation_says() {
    const LONGER: f64 = 1e-3;
    let mut robot = titan();
    robot.camera.lens_priors.focal_std = 1e-6;
    let (reservations, as_drawn) = all_reservations(&robot);
    let reservation = reservations.iter().find(|r| r.what == "camera lens, focal length").expect("unseen");
    let mut real = robot.clone();
    let mut at = real.camera.lens.intrinsics();
    at[..2].iter_mut().for_each(|focal_px| *focal_px *= 1.0 + LONGER);
    real.camera.lens = real.camera.lens.with_intrinsics(at);
    let mount = robot.camera.mount.link_from_frame;
    let errors = with_estimate(&robot, &real, mount, |found| tool_errors(&robot, &real, found));
    let moved_m = rms(errors.iter().zip(&as_drawn).map(|(with, without)| with - without));
    let expected_m = reservation.tool_error_per_unit() * LONGER;
    println!("{reservation}; by 0.1 %: {:.3} mm, expected {:.3} mm", moved_m * 1e3, expected_m * 1e3);
    assert!((moved_m / expected_m - 1.0).abs() < 0.1, "{moved_m} m, expected {expected_m} m");
}

/// With robot.toml's sigmas, good views leave little of the lens to its priors.
#[test]
fn views_that_tell_the_lens_have_no_reservation_about_it() {
    let (reservations, _) = all_reservations(&titan());
    let of_lens: Vec<_> = reservations.iter().filter(|r| r.what.starts_with("camera lens")).collect();
    assert!(of_lens.iter().all(|r| r.what.contains(", k")), "{of_lens:?}");
}

/// A camera at any fixed place does not determine the first joint's zero: both turn the arm about one axis.
#[test]
fn the_keys_that_hold_the_tool_are_those_of_the_standing_camera() {
    for seed in 0..4 {
        let mut robot = watched_titan();
        robot.sensors[0].offset_std_rad = 0.02;
        let zero = format!("offset_std_rad of {}", robot.sensors[0].joint);
        for (mount_std, is_held) in [([0.1, 0.1], true), ([1e-4, 1e-4], false)] {
            [robot.camera.mount_std_m, robot.camera.mount_std_rad] = mount_std;
            let keys = keys_that_hold(&robot, seed);
            let named = [zero.as_str(), "mount_std_rad"].map(|key| keys.iter().any(|one| one == key));
            assert_eq!(named, [is_held; 2], "seed {seed}, {mount_std:?}: {keys:?}");
        }
    }
}

fn keys_that_hold(robot: &Robot, seed: u64) -> Vec<String> {
    let case = statistics::case(robot, seed, N_VIEWS);
    let input = statistics::input(&case, &case.views, HyperparameterMode::Given);
    let found = estimate(&input).expect("solved");
    let at = task(robot)[0];
    let tool = &found.tool_jacobians(&[at])[0];
    let covariance = found.joint_covariance();
    let column = |k: usize| tool.moved_by(&covariance.column(k).into_owned());
    let tool_m2 = (0..covariance.ncols()).map(|k| column(k).dot(&tool.by_parameters[k])).sum();
    found.keys_that_hold(&at, tool_m2)
}
