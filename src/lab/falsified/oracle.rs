//! Observability of a falsification and its effect at the tool, by a capture without noise.
//!
//! The twin of the capture has the same views, at the angles of the estimate with the right model, with exact readings
//! and corners. Fitted with the right model its cost is zero. Fitted with a falsified model z (at the noise, joint
//! errors and priors of that estimate) its cost is `c(z)`. That is the least sum of squares in standard deviations over
//! all other parameters x under their priors. To second order it is `z^T I z`, with I the information of the views
//! about z with x marginalised. It is the non-centrality of any chi-square test of z. The tool error of that fit is `(d
//! tool/dz + d tool/dx dx/dz) z`.

use crate::falsified::capture::Capture;
use crate::falsified::error::FalsifiedError;
use crate::falsified::perturbation::{CaptureHalf, Perturbation, SoundReading, falsified_robot};
use armcal_belief::calib::bundle::{BundleInput, HyperparameterMode, estimate, least_squares, model_for, reference};
use armcal_belief::calib::{MeanCorners, TagMeasurement, TagObservation, View, associate};
use armcal_belief::model::{Hyperparameters, JointParameters, Model};
use armcal_core::kinematics::LinkPoses;
use armcal_core::optics::square_corners;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ConditionChange, SensorModel};
use armcal_core::streams::JointAngles;
use nalgebra::Isometry3;

/// Non-centrality above which the data see an element.
pub(super) const SEEN: f64 = 60.0;
/// Relative gain in cost below which the solver stops.
const RELATIVE_GAIN: f64 = 1e-9;

/// Effect of a falsification on the data and on the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleEffect {
    pub non_centrality: f64,
    /// Distance of the estimated tool from the true one, root mean square over the task, m.
    pub tool_m: f64,
}

impl OracleEffect {
    #[must_use]
    pub fn is_seen(&self) -> bool {
        self.non_centrality > SEEN
    }
}

/// Twin of one capture.
pub(super) struct Oracle<'a> {
    pub capture: &'a Capture,
    views: Vec<View>,
    model: Model,
    scales: Hyperparameters,
    guess: JointParameters,
}

impl<'a> Oracle<'a> {
    pub(super) fn new(capture: &'a Capture) -> Result<Self, FalsifiedError> {
        let robot = &capture.robot;
        let data = associate(&capture.recording, robot);
        let views: Vec<View> = data.fit.into_iter().chain(data.held_out).collect();
        let model = model_for(robot, &views);
        let guess = JointParameters { reference: reference(&views), ..JointParameters::default() };
        let input = BundleInput {
            robot,
            views: &views,
            model: model.clone(),
            scales: Hyperparameters::datasheet(robot),
            guess,
            joint_prior: None,
            evidence: HyperparameterMode::Fitted,
        };
        let found = estimate(&input)
            .ok_or_else(|| FalsifiedError::Scene(format!("seed {}: the views determine nothing", capture.seed)))?;
        let scales = found.scales().clone();
        let exact = views.iter().enumerate().map(|(view_idx, view)| {
            let angles = JointAngles::from_fn(robot.n_joints(), |joint| found.angle(view_idx, joint).0);
            exact_view(robot, view, &angles)
        });
        let exact: Vec<View> = exact.collect();
        Ok(Self { capture, views: exact, model, scales, guess })
    }

    /// The nominal arm with the right survey.
    pub(super) fn robot(&self) -> &Robot {
        &self.capture.robot
    }

    /// Effect of several changes at once.
    pub(super) fn effect(&self, perturbations: &[Perturbation]) -> OracleEffect {
        let falsified = falsified_robot(&self.capture.robot, perturbations);
        let mut views = self.views.clone();
        for view in &mut views {
            view.travel_rad = self.read(perturbations, &view.travel_rad, self.capture.half(view.end));
        }
        let fit = least_squares(
            &BundleInput {
                robot: &falsified,
                views: &views,
                model: self.model.clone(),
                scales: self.scales.clone(),
                guess: self.guess,
                joint_prior: None,
                evidence: HyperparameterMode::Given,
            },
            RELATIVE_GAIN,
        );
        let sensors = fit.parameters.sensors(&falsified);
        let still = ConditionChange::default();
        let square = |angles: &JointAngles| {
            let right = &self.capture.robot;
            let travel = JointAngles::from_fn(angles.len(), |joint| angles[joint] - right.sensors[joint].center_rad);
            let read = self.read(perturbations, &travel, CaptureHalf::Second);
            let believed = JointAngles::from_fn(angles.len(), |joint| {
                let model = &sensors.models[joint];
                model.correction.angle_rad(&model.spec, read[joint], &still, 0.0)
            });
            let tool = |robot: &Robot, at: &JointAngles| robot.chain.frame(at, &robot.tool.mount).translation.vector;
            (tool(&falsified, &believed) - tool(right, angles)).norm_squared()
        };
        let rests = &self.capture.rests;
        let tool_m = (rests.iter().map(|rest| square(&rest.angles)).sum::<f64>() / rests.len().max(1) as f64).sqrt();
        OracleEffect { non_centrality: fit.cost_final, tool_m }
    }

    /// Readings of the sensors under the faults among `perturbations`.
    fn read(&self, perturbations: &[Perturbation], travel_rad: &JointAngles, half: CaptureHalf) -> JointAngles {
        let mut read = *travel_rad;
        for fault in perturbations.iter().filter_map(Perturbation::sensor_fault) {
            let joint = fault.joint;
            let sensor = SensorModel::nominal(&self.capture.robot.sensors[joint]);
            let middle_travel_rad = self.capture.middle_travel_rad[joint];
            let sound = SoundReading { travel_rad: travel_rad[joint], middle_travel_rad, half };
            read[joint] = fault.travel_rad(&sensor, &sound);
        }
        read
    }
}

/// The view of an arm without any error at `angles`; tags that the lens does not map are omitted.
fn exact_view(robot: &Robot, view: &View, angles: &JointAngles) -> View {
    let poses = robot.chain.link_poses(angles);
    let base_from_camera = poses.frame(&robot.camera.mount);
    let tags = view.tags.iter().filter_map(|seen| {
        let tag = &robot.tags[seen.tag_idx];
        let camera_from_tag = base_from_camera.inv_mul(tag.base_from_tag.isometry());
        let corners = exact_corners(robot, &camera_from_tag, tag.size_m, seen.corners()?)?;
        Some(TagObservation {
            center_in_camera_m: camera_from_tag.translation.vector,
            measured: TagMeasurement::Corners(corners),
            ..*seen
        })
    });
    let travel_rad = JointAngles::from_fn(angles.len(), |joint| angles[joint] - robot.sensors[joint].center_rad);
    View {
        travel_rad,
        tags: tags.collect(),
        gripper_tag: exact_gripper_tag(robot, view, &poses, &base_from_camera),
        ..view.clone()
    }
}

fn exact_gripper_tag(
    robot: &Robot,
    view: &View,
    poses: &LinkPoses,
    base_from_camera: &Isometry3<f64>,
) -> Option<MeanCorners> {
    let tag = robot.gripper_tag.as_ref()?;
    let camera_from_tag = base_from_camera.inv_mul(&poses.frame(&tag.mount));
    exact_corners(robot, &camera_from_tag, tag.size_m, view.gripper_tag.as_ref()?)
}

fn exact_corners(
    robot: &Robot,
    camera_from_tag: &Isometry3<f64>,
    size_m: f64,
    seen: &MeanCorners,
) -> Option<MeanCorners> {
    let mut corners_px = [[0.0; 2]; 4];
    for (pixel, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
        let exact = robot.camera.lens.project(&(camera_from_tag * corner).coords)?;
        *pixel = [exact.x, exact.y];
    }
    Some(MeanCorners { corners_px, ..*seen })
}
