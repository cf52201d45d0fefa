//! A true arm as the world draws it, and its views at given poses; it is placed there, not driven.
//!
//! Readings: `(1 + g + g_T warm)(theta - m) + nonlinearity(theta) + o + o_T warm + drift + play`, as the world's
//! potentiometers have it. The oil warms with the tour's time. Corners: five images of the standard noise, of which
//! some miss the tag.

use nalgebra::{Isometry3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use armcal_belief::calib::{MeanCorners, TagMeasurement, TagObservation, View};
use armcal_belief::plan::{ClearanceModel, PosePlan, VisibilityModel};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::optics::square_corners;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::spatial::{Camera, Link, Pose};
use armcal_core::streams::JointAngles;
use armcal_core::time::SIMULATION_EPOCH;
use armcal_sim::{AsBuilt, WorldSpec};

/// Standard deviation of a joint's rest angle under its controller, rad. Assumed: of the world's 0.05 deg.
const REST_STD_RAD: f64 = 0.0005;
/// Iterations of the fixed point `theta = reading - error(theta)`; the error's slope is a few hundredths.
const STEPS: usize = 20;

pub(super) struct TrueArm<'a> {
    robot: &'a Robot,
    clearance: &'a ClearanceModel<'a>,
    world: &'a WorldSpec,
    built: AsBuilt,
}

/// Conditions other than the angle that the sensors' errors depend on.
#[derive(Clone, Copy)]
struct Moment {
    warm_k: f64,
    extra_rad: [f64; MAX_JOINTS],
}

impl<'a> TrueArm<'a> {
    pub(super) fn draw(robot: &'a Robot, clearance: &'a ClearanceModel<'a>, world: &'a WorldSpec, seed: u64) -> Self {
        Self { robot, clearance, world, built: AsBuilt::draw(robot, world, seed) }
    }

    /// Reading of the true sensor in terms of the datasheet, for a joint at `angle_rad`, rad.
    fn reading_rad(&self, joint: usize, angle_rad: f64, moment: &Moment) -> f64 {
        let built = &self.built.joints[joint];
        let gain = 1.0 + built.gain_error + built.temperature_gain_per_k * moment.warm_k;
        built.center_rad
            + gain * (angle_rad - built.center_rad)
            + built.nonlinearity_rad(angle_rad)
            + built.offset_error_rad
            + built.temperature_offset_rad_per_k * moment.warm_k
            + moment.extra_rad[joint]
    }

    /// The angles at which the sensors read `reading`.
    fn angles(&self, reading: &JointAngles, moment: &Moment) -> JointAngles {
        JointAngles::from_fn(reading.len(), |joint| {
            let mut angle_rad = reading[joint];
            for _ in 0..STEPS {
                angle_rad += reading[joint] - self.reading_rad(joint, angle_rad, moment);
            }
            angle_rad
        })
    }

    fn oil_c(&self, at_s: f64) -> f64 {
        let oil = &self.world.temperature;
        oil.oil_start_c + oil.oil_rise_k * (1.0 - (-at_s / oil.oil_time_constant_s).exp())
    }

    fn warm_k(&self, oil_c: f64) -> f64 {
        oil_c - self.world.joint_sensors.reference_c
    }

    /// Views from those poses of a plan that show any tag.
    pub(super) fn views(&self, plan: &PosePlan, rng: &mut ChaCha8Rng) -> Vec<View> {
        let sensors = &self.world.joint_sensors;
        let step_s = plan.arm_time_s / plan.poses.len().max(1) as f64;
        let (mut views, mut drift_rad) = (Vec::new(), [0.0; MAX_JOINTS]);
        let mut before: Option<JointAngles> = None;
        for (idx, pose) in plan.poses.iter().enumerate() {
            let at_s = step_s * (idx + 1) as f64;
            let oil_c = self.oil_c(at_s);
            let n = pose.angles.len();
            let from = before.unwrap_or(self.robot.stowed);
            let mut moment = Moment { warm_k: self.warm_k(oil_c), extra_rad: [0.0; MAX_JOINTS] };
            let mut approach = [0.0; MAX_JOINTS];
            for joint in 0..n {
                drift_rad[joint] += sensors.drift_rad_per_sqrt_h * (step_s / 3600.0).sqrt() * normal(rng);
                approach[joint] = if pose.angles[joint] >= from[joint] { 1.0 } else { -1.0 };
                // The sensor's shaft lags behind the joint by half of the backlash.
                moment.extra_rad[joint] = drift_rad[joint] - 0.5 * sensors.backlash_rad * approach[joint];
            }
            let reading = JointAngles::from_fn(n, |j| pose.angles[j] + REST_STD_RAD * normal(rng));
            let angles = self.angles(&reading, &moment);
            let travel_rad = JointAngles::from_fn(n, |j| reading[j] - self.robot.sensors[j].center_rad);
            let end = SIMULATION_EPOCH.plus_s(at_s);
            let mut view = View::of_reading(idx as u32, end, travel_rad);
            (view.n_readings, view.approach) = (100, approach);
            view.conditions = Conditions { oil_c: Some(oil_c), pressure_pa: None, stamp: Some(end) };
            self.look(&angles, &mut view, rng);
            before = Some(pose.angles);
            if !view.tags.is_empty() {
                views.push(view);
            }
        }
        views
    }

    fn look(&self, angles: &JointAngles, view: &mut View, rng: &mut ChaCha8Rng) {
        let camera = &self.world.camera;
        let sight = VisibilityModel {
            max_range_m: camera.max_range_m,
            max_incidence_rad: camera.max_incidence_rad,
            edge_rad: 0.0,
            border_px: 0.0,
            ..VisibilityModel::default()
        };
        let mount: Pose<Link, Camera> = self.built.camera_mount.to_pose();
        let base_from_camera =
            self.robot.chain.link_poses(angles).link(self.robot.camera.mount.n_joints) * mount.isometry();
        for tag_idx in sight.visible(self.robot, self.clearance, angles) {
            let tag = &self.robot.tags[tag_idx];
            let camera_from_tag = base_from_camera.inv_mul(self.built.tags[tag_idx].base_from_tag().isometry());
            let Some(seen) = self.corners(&camera_from_tag, tag.size_m, rng) else { continue };
            let center_in_camera_m = camera_from_tag.translation.vector;
            view.tags.push(TagObservation {
                id: tag.id,
                tag_idx,
                center_in_camera_m,
                measured: TagMeasurement::Corners(seen),
            });
        }
    }

    /// Mean and scatter of the corners over the images that show the tag.
    fn corners(&self, camera_from_tag: &Isometry3<f64>, size_m: f64, rng: &mut ChaCha8Rng) -> Option<MeanCorners> {
        let camera = &self.world.camera;
        let lens = &self.robot.camera.lens;
        let center = camera_from_tag.translation.vector;
        let cos_incidence = -(camera_from_tag.rotation * Vector3::z()).dot(&center) / center.norm();
        let std_px = camera.corner_noise_px * (0.8 + 0.2 * center.norm()) / cos_incidence.max(0.05).sqrt();
        let images = (camera.rate_hz as usize).max(1);
        let n_frames = (0..images).filter(|_| rng.random_range(0.0..1.0) >= camera.miss_probability).count();
        let mut corners_px = [[0.0; 2]; 4];
        let mut scatter_px2 = 0.0;
        for (pixel, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
            let exact = lens.project(&(camera_from_tag * corner).coords).filter(|pixel| lens.contains(pixel))?;
            for (value, exact) in pixel.iter_mut().zip([exact.x, exact.y]) {
                let noise: Vec<f64> = (0..n_frames).map(|_| std_px * normal(rng)).collect();
                let mean = noise.iter().sum::<f64>() / n_frames.max(1) as f64;
                scatter_px2 += noise.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
                *value = exact + mean;
            }
        }
        (n_frames > 0).then_some(MeanCorners { corners_px, n_frames, scatter_px2 })
    }

    /// Distance of the tool from its target for a controller that converts angles to counts by `sensors`, at their
    /// reference conditions.
    pub(super) fn tool_error_m(&self, sensors: &ArmSensors, to: &JointAngles) -> f64 {
        let travel = |j: usize| sensors.models[j].travel_under_rad(to[j], &Default::default());
        let reading = JointAngles::from_fn(to.len(), |j| self.robot.sensors[j].center_rad + travel(j));
        let oil_c = sensors.reference.oil_c.unwrap_or(self.world.temperature.oil_start_c);
        let moment = Moment { warm_k: self.warm_k(oil_c), extra_rad: [0.0; MAX_JOINTS] };
        let tool = |angles: &JointAngles| self.robot.chain.frame(angles, &self.robot.tool.mount).translation.vector;
        (tool(&self.angles(&reading, &moment)) - tool(to)).norm()
    }
}

/// Draws a standard normal number.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rand_distr::Distribution::<f64>::sample(&rand_distr::StandardNormal, rng)
}
