//! The Titan on its vehicle, for tests.

use std::path::Path;

use nalgebra::{Isometry3, Vector6};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::model::{Hyperparameters, JointParameters};
use crate::plan::view_planning::parameter_prior::columns;
use crate::plan::view_planning::{PosePlan, PosePool, PoseRequest};
use crate::plan::{ClearanceModel, JointErrorBounds, PlanError, VisibilityModel};
use crate::views::view::{MeanCorners, TagMeasurement, TagObservation, View};
use armcal_core::optics::square_corners;
use armcal_core::robot::{Robot, Vehicle, load, load_vehicle};
use armcal_core::routine::{CaptureSettings, PoseCriterion, Scene};
use armcal_core::sensor::ConditionChange;
use armcal_core::spatial::exp;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointAngles;
use armcal_core::time::SIMULATION_EPOCH;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

pub(crate) fn vehicle() -> Vehicle {
    load_vehicle(&root().join("robots/vehicles/work-class-front.toml")).expect("the vehicle reads")
}

pub(crate) fn titan() -> Robot {
    load(&root().join("robots/titan4")).expect("the robot reads").mounted_on(&vehicle()).expect("it fits")
}

/// Returns a Titan before a fixed camera, with tags on its gripper.
pub(crate) fn watched_titan() -> Robot {
    load(&root().join("robots/titan4-watched")).expect("the robot reads").mounted_on(&vehicle()).expect("it fits")
}

pub(crate) fn clearance_of<'a>(robot: &'a Robot, vehicle: &Vehicle) -> ClearanceModel<'a> {
    ClearanceModel::new(robot, vehicle, &Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() })
}

/// Owner of the data that a request refers to.
pub(crate) struct Site {
    pub robot: Robot,
    pub vehicle: Vehicle,
    pub capture: CaptureSettings,
    pub bounds: JointErrorBounds,
    pub task: Vec<JointAngles>,
    pub failed: Vec<JointAngles>,
    pub detection_rate: Vec<f64>,
}

impl Site {
    pub(crate) fn of(robot: Robot) -> Self {
        let bounds = JointErrorBounds::datasheet(&robot);
        let capture: CaptureSettings =
            toml::from_str("poses = 30\nheld_out = 0\nmin_tags = 3\nclearance_m = 0.05").expect("settings");
        let mut rng = stream_rng(7, "task");
        let task = (0..8)
            .map(|_| {
                JointAngles::from_fn(robot.n_joints(), |j| {
                    robot.sensors[j].center_rad + rng.random_range(-0.6..0.6) * robot.sensors[j].half_range_rad.min(1.3)
                })
            })
            .collect();
        let tag_trust = vec![1.0; robot.tags.len()];
        Self { robot, vehicle: vehicle(), capture, bounds, task, failed: Vec::new(), detection_rate: tag_trust }
    }

    pub(crate) fn titan() -> Self {
        Self::of(titan())
    }

    pub(crate) fn watched() -> Self {
        let mut site = Self::of(watched_titan());
        site.capture.min_tags = 2;
        site
    }

    pub(crate) fn clearance(&self) -> ClearanceModel<'_> {
        clearance_of(&self.robot, &self.vehicle)
    }

    pub(crate) fn request<'a>(&'a self, clearance: &'a ClearanceModel<'a>) -> PoseRequest<'a> {
        const VISIBILITY: VisibilityModel = VisibilityModel::USUAL;
        PoseRequest {
            robot: &self.robot,
            clearance,
            bounds: &self.bounds,
            visibility: &VISIBILITY,
            capture: &self.capture,
            n_fit: self.capture.poses as usize,
            n_held_out: self.capture.held_out as usize,
            belief: None,
            taken: &[],
            prior: None,
            known: None,
            detection_rate: &self.detection_rate,
            failed: &self.failed,
            task: &self.task,
            targets_m: &[],
            start: &self.robot.stowed,
        }
    }

    /// Returns the plan of a seed by a criterion, from `enough` candidates.
    pub(crate) fn plan(&mut self, seed: u64, choose: PoseCriterion, enough: usize) -> Result<PosePlan, PlanError> {
        self.capture.criterion = choose;
        let clearance = self.clearance();
        let request = self.request(&clearance);
        let mut rng = stream_rng(seed, "plan");
        PosePool::gather(&request, enough, &mut rng)?.choose(&request, &mut rng)
    }
}

/// A true arm, drawn from the priors.
pub(crate) struct Truth {
    pub parameters: JointParameters,
    mount: Isometry3<f64>,
    tags: Vec<Isometry3<f64>>,
}

/// Number of images of a view.
const N_FRAMES: usize = 5;

pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn moved(pose: &Isometry3<f64>, std_m: f64, std_rad: f64, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    pose * exp(&Vector6::from_fn(|k, _| normal(rng) * if k < 3 { std_m } else { std_rad }))
}

impl Truth {
    pub(crate) fn draw(robot: &Robot, scales: &Hyperparameters, rng: &mut ChaCha8Rng) -> Self {
        let mut parameters = JointParameters::default();
        for p in columns(robot.n_seen_joints()) {
            let std = scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
            parameters.set(p, parameters.get(p) + std * normal(rng));
        }
        let camera = &robot.camera;
        let mount = moved(&camera.mount.link_from_frame, camera.mount_std_m, camera.mount_std_rad, rng);
        let place = |tag: &armcal_core::robot::SurveyedTag| {
            moved(tag.base_from_tag.isometry(), tag.position_std_m, tag.rotation_std_rad, rng)
        };
        let tags = robot.tags.iter().map(place).collect();
        Self { parameters, mount, tags }
    }

    fn angles(&self, robot: &Robot, believed: &JointAngles) -> JointAngles {
        JointAngles::from_fn(robot.n_joints(), |j| {
            let spec = &robot.sensors[j];
            let travel_rad = believed[j] - spec.center_rad;
            self.parameters.correction(j).angle_rad(spec, travel_rad, &ConditionChange::default(), 0.0)
        })
    }

    /// Returns the views that the true arm captures at the poses of a plan.
    pub(crate) fn views(
        &self,
        clearance: &ClearanceModel<'_>,
        plan: &PosePlan,
        scales: &Hyperparameters,
        rng: &mut ChaCha8Rng,
    ) -> Vec<View> {
        let robot = clearance.robot;
        let of = |(idx, pose): (usize, &crate::plan::view_planning::PlannedPose)| {
            let travel_rad = JointAngles::from_fn(robot.n_joints(), |j| pose.angles[j] - robot.sensors[j].center_rad);
            let mut view = View::of_reading(idx as u32, SIMULATION_EPOCH, travel_rad);
            view.n_readings = 1_000_000;
            let mut angles = self.angles(robot, &pose.angles);
            for (angle, std_rad) in angles.iter_mut().zip(scales.joint_std_rad) {
                *angle += std_rad * normal(rng);
            }
            let poses = robot.chain.link_poses(&angles).in_frame(&robot.tag_frame);
            let camera = poses.link(robot.camera.mount.n_joints) * self.mount;
            for tag_idx in VisibilityModel::USUAL.visible(robot, clearance, &angles) {
                let camera_from_tag = camera.inv_mul(&self.tags[tag_idx]);
                let id = robot.tags[tag_idx].id;
                let Some(seen) = corners(robot, &camera_from_tag, robot.tags[tag_idx].size_m, rng) else { continue };
                let center_in_camera_m = camera_from_tag.translation.vector;
                view.tags.push(TagObservation {
                    id,
                    tag_idx,
                    center_in_camera_m,
                    measured: TagMeasurement::Corners(seen),
                });
            }
            view
        };
        plan.poses.iter().enumerate().map(of).filter(|view| !view.tags.is_empty()).collect()
    }

    /// Returns the error of the tool position by `found`, m, for sensors that read as if the arm were at `believed`.
    pub(crate) fn tool_error_m(&self, robot: &Robot, found: &JointParameters, believed: &JointAngles) -> f64 {
        let tool = |parameters: &JointParameters| {
            let angles = Self { parameters: *parameters, mount: self.mount, tags: Vec::new() }.angles(robot, believed);
            robot.chain.frame(&angles, &robot.tool.mount).translation.vector
        };
        (tool(found) - tool(&self.parameters)).norm()
    }
}

fn corners(robot: &Robot, camera_from_tag: &Isometry3<f64>, size_m: f64, rng: &mut ChaCha8Rng) -> Option<MeanCorners> {
    let std_px = robot.camera.corner_std_px;
    let mut corners_px = [[0.0; 2]; 4];
    for (pixel, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
        let seen = robot.camera.lens.project(&(camera_from_tag * corner).coords)?;
        let mut noisy = |x: f64| x + std_px / (N_FRAMES as f64).sqrt() * normal(rng);
        *pixel = [noisy(seen.x), noisy(seen.y)];
    }
    let scatter_px2 = (0..8 * (N_FRAMES - 1)).map(|_| (std_px * normal(rng)).powi(2)).sum();
    Some(MeanCorners { corners_px, n_frames: N_FRAMES, scatter_px2 })
}
