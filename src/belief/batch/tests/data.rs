//! Views of an arm drawn from the estimator's own model.

use std::path::Path;

use nalgebra::{Isometry3, UnitQuaternion, Vector3, Vector6};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::model::blocks::Block;
use crate::model::estimated::Model;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::views::view::{MeanCorners, TagMeasurement, TagObservation, View};
use armcal_core::joints::{JointAngles, MAX_JOINTS};
use armcal_core::kinematics::Attachment;
use armcal_core::optics::square_corners;
use armcal_core::robot::geometry::TagDistance;
use armcal_core::robot::{CameraSpec, Robot, SurveyedTag, TagSurvey, load};
use armcal_core::sensor::Conditions;
use armcal_core::spatial::{Pose, exp};
use armcal_core::stats::stream_rng;
use armcal_core::time::SIMULATION_EPOCH;

pub fn titan() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4")).expect("the robot reads")
}

/// The titan with measured distances between some of its tags, each with a small error.
pub fn titan_with_taped_tags() -> Robot {
    let mut robot = titan();
    for (a, b) in [(0, 3), (3, 5), (1, 4)] {
        let [at_a, at_b] = [a, b].map(|tag: usize| robot.tags[tag].base_from_tag.isometry().translation.vector);
        let tags = [a, b].map(|tag| robot.tags[tag].id);
        let distance_m = (at_a - at_b).norm() + 0.002;
        robot.geometry.tag_distances.push(TagDistance { tags, distance_m, std_m: 5e-4 });
    }
    robot
}

pub fn titan_with_gripper_tag() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4-gripper-tag"))
        .expect("the robot reads")
}

/// The titan with a second camera before its last two joints. In the middle of their ranges it looks from the side at
/// the place that the first one sees.
pub fn titan_with_two_cameras() -> Robot {
    let mut robot = titan();
    let middle = JointAngles::from_fn(robot.n_joints(), |j| robot.sensors[j].center_rad);
    let poses = robot.chain.link_poses(&middle);
    let n_joints = robot.camera.mount.n_joints - 2;
    let beside = Isometry3::translation(0.08, -0.05, 0.0);
    let link_from_frame = poses.link(n_joints).inverse() * poses.frame(&robot.camera.mount) * beside;
    let mount = Attachment { n_joints, link_from_frame };
    robot.further_cameras.push(CameraSpec { name: "elbow".to_owned(), mount, ..robot.camera.clone() });
    robot
}

/// [`watched_titan`] with a second camera next to the first that looks at the same place.
pub fn titan_watched_by_two() -> Robot {
    let mut robot = watched_titan();
    let first = robot.camera.mount.link_from_frame;
    let aside = first * Isometry3::new(Vector3::new(0.5, 0.1, 0.1), Vector3::new(0.0, -0.4, 0.0));
    let mount = Attachment { n_joints: 0, link_from_frame: aside };
    robot.further_cameras.push(CameraSpec { name: "aside".to_owned(), mount, ..robot.camera.clone() });
    robot
}

/// The titan in front of a fixed camera that looks at it, with tags on all sides of its hand.
pub fn watched_titan() -> Robot {
    const N_AROUND: usize = 6;
    let mut robot = titan();
    let hand = robot.tool.mount;
    let mut rng = rng(0, "where the hand goes");
    let travel =
        |j: usize, rng: &mut ChaCha8Rng| rng.random_range(-0.5..0.5) * robot.sensors[j].half_range_rad.min(1.3);
    let places = (0..200).map(|_| {
        let angles = JointAngles::from_fn(robot.n_joints(), |j| robot.sensors[j].center_rad + travel(j, &mut rng));
        robot.chain.frame(&angles, &hand).translation.vector
    });
    let middle = places.sum::<Vector3<f64>>() / 200.0;
    let eye = middle * (1.0 + 1.3 / middle.norm());
    let look = Isometry3::face_towards(&eye.into(), &middle.into(), &Vector3::z());
    robot.camera.mount = Attachment { n_joints: 0, link_from_frame: look };
    let tag = |k: usize| {
        // Rings about the hand's y axis, tilted towards either end.
        let turn = UnitQuaternion::from_euler_angles(0.0, std::f64::consts::TAU * (k % N_AROUND) as f64 / 6.0, 0.0);
        let tilt = UnitQuaternion::from_euler_angles([0.5, -0.5][k / N_AROUND], 0.0, 0.0);
        let rotation = turn * tilt;
        let pose = Isometry3::from_parts((rotation * Vector3::new(0.0, 0.0, 0.12)).into(), rotation);
        SurveyedTag {
            id: k as u32,
            size_m: 0.08,
            base_from_tag: Pose::from_isometry(pose),
            position_std_m: 0.001,
            rotation_std_rad: 0.0035,
        }
    };
    let tags = (0..2 * N_AROUND).map(tag).collect();
    robot.with_survey(TagSurvey { base_tag: Some(0), anchor_tag: None, frame: hand, family: None, tags })
}

pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// The true state of an arm.
#[derive(Clone, Debug)]
pub struct Truth {
    pub parameters: JointParameters,
    pub mount: Isometry3<f64>,
    pub further_mounts: Vec<Isometry3<f64>>,
    pub tags: Vec<Isometry3<f64>>,
    pub gripper_tag: Option<Isometry3<f64>>,
    /// One sigma of the base's lean in each view, about each horizontal axis.
    pub lean_rad: f64,
}

fn moved(pose: &Isometry3<f64>, std_m: f64, std_rad: f64, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    pose * exp(&Vector6::from_fn(|k, _| normal(rng) * if k < 3 { std_m } else { std_rad }))
}

impl Truth {
    /// Draws a truth from the priors of `model` under `scales`.
    pub fn draw(robot: &Robot, model: &Model, scales: &Hyperparameters, rng: &mut ChaCha8Rng) -> Self {
        let mut parameters = JointParameters { reference: reference(), ..JointParameters::default() };
        for parameter in model.parameters() {
            let std = scales.prior_std(&robot.sensors[parameter.joint], parameter.joint, parameter.kind);
            parameters.set(parameter, parameters.get(parameter) + std * normal(rng));
        }
        let camera = &robot.camera;
        let mount = &camera.mount.link_from_frame;
        let mount = if model.has(Block::Mount(0)) {
            moved(mount, camera.mount_std_m, camera.mount_std_rad, rng)
        } else {
            *mount
        };
        let tags = robot.tags.iter().enumerate().map(|(tag_idx, tag)| {
            let pose = tag.base_from_tag.isometry();
            if model.has(Block::Tag(tag_idx)) {
                moved(pose, tag.position_std_m, tag.rotation_std_rad, rng)
            } else {
                *pose
            }
        });
        let tags = tags.collect();
        let gripper_tag = robot
            .gripper_tag
            .filter(|_| model.has(Block::GripperTag))
            .map(|tag| moved(&tag.mount.link_from_frame, tag.position_std_m, tag.rotation_std_rad, rng));
        let further = robot.further_cameras.iter();
        let further_mounts = further
            .map(|camera| moved(&camera.mount.link_from_frame, camera.mount_std_m, camera.mount_std_rad, rng))
            .collect();
        Self { parameters, mount, further_mounts, tags, gripper_tag, lean_rad: 0.0 }
    }

    fn mount_of(&self, camera: usize) -> &Isometry3<f64> {
        camera.checked_sub(1).map_or(&self.mount, |further| &self.further_mounts[further])
    }

    pub fn angles(&self, robot: &Robot, view: &View) -> JointAngles {
        let departure = view.conditions.departure_from(&self.parameters.reference);
        JointAngles::from_fn(robot.n_joints(), |j| {
            let correction = self.parameters.correction(j);
            correction.angle_rad(&robot.sensors[j], view.travel_rad[j], &departure, view.approach[j])
        })
    }
}

pub fn reference() -> Conditions {
    Conditions { oil_c: Some(13.0), pressure_pa: Some(2e7), stamp: Some(SIMULATION_EPOCH) }
}

/// Noise of the measurements in a view.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    pub corner_px: f64,
    pub n_frames: usize,
    /// Noise of each joint in each view, rad.
    pub joint_rad: [f64; MAX_JOINTS],
}

/// Views by the first camera at `n` random poses where it sees at least three tags. Each is followed by the views of
/// the further cameras that see a tag there.
pub fn views(robot: &Robot, truth: &Truth, noise: &Noise, n: usize, rng: &mut ChaCha8Rng) -> Vec<View> {
    let mut out: Vec<View> = Vec::new();
    let mut n_poses = 0;
    while n_poses < n {
        let travel_rad = JointAngles::from_fn(robot.n_joints(), |j| {
            let half = robot.sensors[j].half_range_rad.min(1.3);
            rng.random_range(-0.85..0.85) * half
        });
        let idx = n_poses as u32;
        let mut view = View::of_reading(idx, SIMULATION_EPOCH.plus_s(20.0 * f64::from(idx)), travel_rad);
        view.conditions = Conditions {
            oil_c: Some(10.0 + 6.0 * n_poses as f64 / n as f64),
            pressure_pa: Some(2e7),
            stamp: Some(view.end),
        };
        for (joint, approach) in view.approach.iter_mut().enumerate().take(robot.n_joints()) {
            *approach = if (n_poses + joint).is_multiple_of(2) { 1.0 } else { -1.0 };
        }
        if truth.lean_rad > 0.0 {
            let turn = Vector3::new(truth.lean_rad * normal(rng), truth.lean_rad * normal(rng), 0.0);
            view.up = Some(UnitQuaternion::from_scaled_axis(turn) * robot.chain.loads().up);
        }
        let mut angles = truth.angles(robot, &view);
        for (angle, std) in angles.iter_mut().zip(noise.joint_rad) {
            *angle += std * normal(rng);
        }
        let of_cameras = (0..=robot.further_cameras.len()).map(|camera| {
            let mut view = View { camera, ..view.clone() };
            look(robot, truth, noise, (&mut view, &angles), rng);
            view
        });
        let mut of_pose: Vec<View> = of_cameras.collect();
        if of_pose[0].tags.len() >= 3 {
            n_poses += 1;
            of_pose.retain(|view| !view.tags.is_empty());
            let n_cameras = of_pose.len();
            out.extend(of_pose.into_iter().map(|view| View { n_cameras, ..view }));
        }
    }
    out
}

/// Adds the detections of the view's camera at the arm's true angles.
fn look(robot: &Robot, truth: &Truth, noise: &Noise, (view, angles): (&mut View, &JointAngles), rng: &mut ChaCha8Rng) {
    let loads = view.up.map_or(*robot.chain.loads(), |up| robot.chain.loads().with_up(up));
    let poses = robot.chain.corrected_link_poses_under(angles, &truth.parameters.links, &loads);
    let camera = robot.camera_at(view.camera);
    let base_from_camera = poses.link(camera.mount.n_joints) * truth.mount_of(view.camera);
    // Tags around the arm do not move when its base bends.
    let base_from_tags = if robot.is_watched() { poses.frame(&robot.tag_frame) } else { Isometry3::identity() };
    for (tag_idx, tag) in robot.tags.iter().enumerate() {
        let camera_from_tag = base_from_camera.inv_mul(&(base_from_tags * truth.tags[tag_idx]));
        let center = camera_from_tag.translation.vector;
        let facing = -(camera_from_tag.rotation * Vector3::z()).dot(&center) / center.norm();
        if !(0.25..2.0).contains(&center.norm()) || facing < 0.45 {
            continue;
        }
        if let Some(seen) = seen_corners(camera, &camera_from_tag, tag.size_m, noise, rng) {
            let measured = TagMeasurement::Corners(seen);
            view.tags.push(TagObservation { id: tag.id, tag_idx, center_in_camera_m: center, measured });
        }
    }
    if let (Some(tag), Some(link_from_tag), 0) = (&robot.gripper_tag, &truth.gripper_tag, view.camera) {
        let camera_from_tag = base_from_camera.inv_mul(&(poses.link(tag.mount.n_joints) * link_from_tag));
        view.gripper_tag = seen_corners(camera, &camera_from_tag, tag.size_m, noise, rng);
    }
}

fn seen_corners(
    camera: &CameraSpec,
    camera_from_tag: &Isometry3<f64>,
    size_m: f64,
    noise: &Noise,
    rng: &mut ChaCha8Rng,
) -> Option<MeanCorners> {
    let std_px = noise.corner_px / (noise.n_frames as f64).sqrt();
    let mut corners_px = [[0.0; 2]; 4];
    for (pixel, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
        let seen = camera.lens.project(&(camera_from_tag * corner).coords)?;
        if !camera.lens.contains(&seen) {
            return None;
        }
        *pixel = [seen.x + std_px * normal(rng), seen.y + std_px * normal(rng)];
    }
    let dof = 8 * (noise.n_frames - 1);
    let scatter_px2 = (0..dof).map(|_| (noise.corner_px * normal(rng)).powi(2)).sum();
    Some(MeanCorners { corners_px, n_frames: noise.n_frames, scatter_px2 })
}

pub fn rng(seed: u64, name: &str) -> ChaCha8Rng {
    stream_rng(seed, name)
}
