//! Estimate from a tag on the gripper: the camera mount, and the sensors of the joints between camera and tag.
//!
//! `camera_from_tag = mount^-1 * W(theta) * tool_from_tag`: `W` is the motion of the joints between camera and tag with
//! `theta = center + gain * travel + offset`. Levenberg-Marquardt fits the tag's corner pixels in all views. It
//! estimates the camera mount, the tag's pose on the gripper, and gain and offset of these joints, each about its prior
//! (robot.toml). Poses are perturbed on the right. A joint that turns through a wide angle separates the tag's own
//! error, which turns with it, from the mount's, which does not. Along the joint's axis the two stay inseparable, and a
//! turn of the mount about that axis looks like the joint's offset: there the covariance keeps the priors. The joints'
//! nonlinearity is independent in every view: `R = sigma^2 / n_frames * I + sum_j (d u / d theta_j) (d u / d theta_j)^T
//! linearity_j^2` for the eight coordinates `u` of a view.

use crate::methods::constants::gripper_tag::{DAMPING, MAX_PRIOR_SIGMAS, STOP};
use crate::model::constants::prior::MIN_STD;
use crate::solve::constants::model_for_views::MIN_GRIPPER_VIEWS;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, SMatrix, SVector, Vector2, Vector6};

use crate::measure::ImagePoint;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::positions::mount_estimate::MountEstimate;
use crate::views::view::{MeanCorners, View};
use armcal_core::numeric::{LeastSquares, Outcome, Proposal, minimize};
use armcal_core::optics::square_corners;
use armcal_core::robot::{GripperTag, Robot};
use armcal_core::spatial::{adjoint, exp, log};
use armcal_core::streams::JointAngles;

/// Estimates camera mount and joints from the tag on the gripper.
///
/// # Errors
/// The reason why the tag is not used: too few views, no convergence, or a fit that the priors rule out.
pub fn mount_by_gripper_tag(
    robot: &Robot,
    tag: &GripperTag,
    views: &[View],
    guess: &JointParameters,
) -> Result<MountEstimate, String> {
    let seen: Vec<(&JointAngles, &MeanCorners)> =
        views.iter().filter_map(|view| Some((&view.travel_rad, view.gripper_tag.as_ref()?))).collect();
    if seen.len() < MIN_GRIPPER_VIEWS {
        return Err(format!("the tag on the gripper was seen in {} views; {MIN_GRIPPER_VIEWS} are needed", seen.len()));
    }
    let problem = Problem { robot, tag, joints: tag.joints(&robot.camera.mount), seen };
    let (state, normal) = problem.solve(guess).ok_or("the tag on the gripper fits no camera mount")?;
    problem.check(&state)?;
    let covariance = normal.try_inverse().ok_or("the tag on the gripper does not determine the camera's mount")?;
    let (chi2, rms_px) = problem.misfit(&state).ok_or("the tag on the gripper fits no camera mount")?;
    // The residuals contain the errors that the model lacks.
    let scale = (chi2 / (8 * problem.seen.len()) as f64).max(1.0);
    let kept: Vec<usize> = (0..6).chain(12..covariance.nrows()).collect();
    Ok(MountEstimate {
        link_from_camera: state.link_from_camera,
        joints: problem.joints.clone(),
        parameters: state.parameters,
        covariance: DMatrix::from_fn(kept.len(), kept.len(), |i, j| scale * covariance[(kept[i], kept[j])]),
        views: problem.seen.len(),
        rms_px,
    })
}

impl MountEstimate {
    /// Returns the covariance of the mount (translation m, rotation rad), on the right.
    #[must_use]
    pub fn mount_covariance(&self) -> Matrix6<f64> {
        self.covariance.fixed_view::<6, 6>(0, 0).into_owned()
    }

    /// Returns the row of a parameter in the covariance.
    #[must_use]
    pub fn row(&self, parameter: Parameter) -> Option<usize> {
        let offset = usize::from(parameter.kind == ParameterKind::Offset);
        self.joints.contains(&parameter.joint).then(|| 6 + 2 * (parameter.joint - self.joints.start) + offset)
    }

    /// Returns the parameters that the tag determines at least twice as well as the datasheet, in order.
    #[must_use]
    pub fn determined(&self, robot: &Robot) -> Vec<Parameter> {
        let all = self
            .joints
            .clone()
            .flat_map(|joint| [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind }));
        all.filter(|&p| {
            self.row(p).is_some_and(|row| 2.0 * self.covariance[(row, row)].max(0.0).sqrt() < p.prior_std(robot))
        })
        .collect()
    }
}

#[derive(Clone, Copy, Debug)]
struct State {
    link_from_camera: Isometry3<f64>,
    link_from_tag: Isometry3<f64>,
    parameters: JointParameters,
}

struct Problem<'a> {
    robot: &'a Robot,
    tag: &'a GripperTag,
    joints: Range<usize>,
    seen: Vec<(&'a JointAngles, &'a MeanCorners)>,
}

/// Normal matrix, the right side towards lower cost, and the cost.
type NormalEquations = (DMatrix<f64>, DVector<f64>, f64);

struct Search<'a, 'b> {
    problem: &'a Problem<'b>,
    sigma: Vec<f64>,
    state: State,
    here: NormalEquations,
    trial: State,
    there: Option<NormalEquations>,
}

impl LeastSquares for Search<'_, '_> {
    fn cost(&self) -> f64 {
        self.here.2
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        let mut damped = self.here.0.clone();
        for (row, std) in self.sigma.iter().enumerate() {
            damped[(row, row)] += damping / (std * std);
        }
        let step = damped.cholesky()?.solve(&self.here.1);
        let length = step.iter().zip(&self.sigma).map(|(step, std)| (step / std).abs()).fold(0.0, f64::max);
        self.trial = self.problem.stepped(&self.state, &step);
        Some(Proposal { length, predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.there = self.problem.normal_equations(&self.trial);
        self.there.as_ref().map(|there| there.2)
    }

    fn accept(&mut self) {
        if let Some(there) = self.there.take() {
            (self.state, self.here) = (self.trial, there);
        }
    }
}

/// The eight coordinates of one view: measured minus predicted, and their derivatives by the poses and by each joint's
/// angle.
struct Linearized {
    residual_px: SVector<f64, 8>,
    /// Jacobian by the mount, then by the tag's pose.
    by_poses: SMatrix<f64, 8, 12>,
    by_angle: Vec<SVector<f64, 8>>,
}

impl Problem<'_> {
    fn n_parameters(&self) -> usize {
        12 + 2 * self.joints.len()
    }

    fn start(&self, guess: &JointParameters) -> State {
        State {
            link_from_camera: self.robot.camera.mount.link_from_frame,
            link_from_tag: self.tag.mount.link_from_frame,
            parameters: *guess,
        }
    }

    /// Returns the state of least cost and the normal matrix there.
    fn solve(&self, guess: &JointParameters) -> Option<(State, DMatrix<f64>)> {
        let state = self.start(guess);
        let here = self.normal_equations(&state)?;
        let sigma = self.prior_std();
        let mut search = Search { problem: self, sigma, state, here, trial: state, there: None };
        let outcome = minimize(&mut search, &DAMPING, &STOP).outcome();
        (outcome == Outcome::Converged).then_some((search.state, search.here.0))
    }

    /// Returns the standard deviation of every parameter's prior, in the order of the columns.
    fn prior_std(&self) -> Vec<f64> {
        let camera = &self.robot.camera;
        let mut std = [[camera.mount_std_m; 3], [camera.mount_std_rad; 3]].concat();
        std.extend([self.tag.position_std_m; 3]);
        std.extend([self.tag.rotation_std_rad; 3]);
        for sensor in &self.robot.sensors[self.joints.clone()] {
            std.extend([sensor.gain_std, sensor.offset_std_rad]);
        }
        std.into_iter().map(|std| std.max(MIN_STD)).collect()
    }

    /// Returns the deviation of the state from the priors' means, in the order of the columns.
    fn off_prior(&self, state: &State) -> DVector<f64> {
        let mount = log(&(self.robot.camera.mount.link_from_frame.inverse() * state.link_from_camera));
        let tag = log(&(self.tag.mount.link_from_frame.inverse() * state.link_from_tag));
        let joints = self.joints.clone();
        let sensors = joints.flat_map(|j| [state.parameters.gain[j] - 1.0, state.parameters.offset_rad[j]]);
        let values = mount.iter().chain(tag.iter()).copied().chain(sensors);
        DVector::from_iterator(self.n_parameters(), values)
    }

    fn stepped(&self, state: &State, step: &DVector<f64>) -> State {
        let twist = |row: usize| exp(&Vector6::from_fn(|k, _| step[row + k]));
        let mut next = State {
            link_from_camera: state.link_from_camera * twist(0),
            link_from_tag: state.link_from_tag * twist(6),
            ..*state
        };
        for (k, joint) in self.joints.clone().enumerate() {
            next.parameters.gain[joint] += step[12 + 2 * k];
            next.parameters.offset_rad[joint] += step[13 + 2 * k];
        }
        next
    }

    /// Returns the normal equations at `state`; `None` if a corner is outside of the lens's view.
    fn normal_equations(&self, state: &State) -> Option<NormalEquations> {
        let n = self.n_parameters();
        let (mut normal, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let off = self.off_prior(state);
        let mut cost = 0.0;
        for (row, std) in self.prior_std().into_iter().enumerate() {
            normal[(row, row)] += 1.0 / (std * std);
            gradient[row] -= off[row] / (std * std);
            cost += (off[row] / std).powi(2);
        }
        for (travel_rad, seen) in &self.seen {
            let view = self.linearized(state, travel_rad, seen)?;
            let weight = self.weight(&view, seen.n_frames)?;
            let mut jacobian = DMatrix::zeros(8, n);
            jacobian.columns_mut(0, 12).copy_from(&view.by_poses);
            for (k, joint) in self.joints.clone().enumerate() {
                jacobian.column_mut(12 + 2 * k).copy_from(&(view.by_angle[k] * travel_rad[joint]));
                jacobian.column_mut(13 + 2 * k).copy_from(&view.by_angle[k]);
            }
            let weighted = jacobian.transpose() * weight;
            normal += &weighted * &jacobian;
            gradient += &weighted * view.residual_px;
            cost += view.residual_px.dot(&(weight * view.residual_px));
        }
        cost.is_finite().then_some((normal, gradient, cost))
    }

    /// Returns the inverse covariance of a view's coordinates, px^-2.
    fn weight(&self, view: &Linearized, n_frames: usize) -> Option<SMatrix<f64, 8, 8>> {
        let corner_px2 = self.robot.camera.corner_std_px.powi(2) / n_frames.max(1) as f64;
        let mut covariance = SMatrix::<f64, 8, 8>::identity() * corner_px2;
        for (by_angle, sensor) in view.by_angle.iter().zip(&self.robot.sensors[self.joints.clone()]) {
            let by_linearity = by_angle * sensor.linearity_std_rad;
            covariance += by_linearity * by_linearity.transpose();
        }
        Some(covariance.cholesky()?.inverse())
    }

    fn linearized(&self, state: &State, travel_rad: &JointAngles, seen: &MeanCorners) -> Option<Linearized> {
        let (robot, parameters) = (self.robot, &state.parameters);
        // Joints before the camera move camera and tag alike, so that the middle of their range suffices.
        let angles = JointAngles::from_fn(robot.n_joints(), |j| {
            let moved = if self.joints.contains(&j) {
                parameters.gain[j] * travel_rad[j] + parameters.offset_rad[j]
            } else {
                0.0
            };
            robot.sensors[j].center_rad + moved
        });
        let poses = robot.chain.link_poses(&angles);
        let camera_from_base = (poses.link(robot.camera.mount.n_joints) * state.link_from_camera).inverse();
        let camera_from_tag = camera_from_base * poses.link(self.tag.mount.n_joints) * state.link_from_tag;
        // A motion of the tag equals the opposite motion of the camera.
        let by_tag = -adjoint(&camera_from_tag);
        let mut view = Linearized {
            residual_px: SVector::zeros(),
            by_poses: SMatrix::zeros(),
            by_angle: vec![SVector::zeros(); self.joints.len()],
        };
        for (k, corner) in square_corners(self.tag.size_m).iter().enumerate() {
            let in_camera = (camera_from_tag * corner).coords;
            let image = ImagePoint::of(&robot.camera.lens, &in_camera)?;
            let residual = Vector2::from(image.residual_px(&seen.corners_px[k]));
            view.residual_px.fixed_rows_mut::<2>(2 * k).copy_from(&residual);
            let by_camera = image.jacobian();
            view.by_poses.fixed_view_mut::<2, 6>(2 * k, 0).copy_from(&by_camera);
            view.by_poses.fixed_view_mut::<2, 6>(2 * k, 6).copy_from(&(by_camera * by_tag));
            let in_base = camera_from_base.inverse() * nalgebra::Point3::from(in_camera);
            for (n, joint) in self.joints.clone().enumerate() {
                let by_angle = camera_from_base.rotation * poses.point_jacobian(joint, &in_base.coords);
                view.by_angle[n].fixed_rows_mut::<2>(2 * k).copy_from(&(image.by_point * by_angle));
            }
        }
        Some(view)
    }

    fn check(&self, state: &State) -> Result<(), String> {
        let (off, std) = (self.off_prior(state), self.prior_std());
        for (what, rows) in [("camera mount", 0..6), ("tag on the gripper", 6..12)] {
            let sigmas = rows.map(|row| (off[row] / std[row]).abs()).fold(0.0, f64::max);
            if sigmas > MAX_PRIOR_SIGMAS {
                return Err(format!(
                    "by the tag on the gripper the {what} is {sigmas:.0} sigma from where robot.toml has it: knocked, \
                     or another tag"
                ));
            }
        }
        Ok(())
    }

    /// Returns the sum of squared whitened residuals of all views, and the root mean square per corner, px.
    fn misfit(&self, state: &State) -> Option<(f64, f64)> {
        let (mut chi2, mut sum_px2) = (0.0, 0.0);
        for (travel_rad, seen) in &self.seen {
            let view = self.linearized(state, travel_rad, seen)?;
            chi2 += view.residual_px.dot(&(self.weight(&view, seen.n_frames)? * view.residual_px));
            sum_px2 += view.residual_px.norm_squared();
        }
        Some((chi2, (sum_px2 / (4 * self.seen.len()) as f64).sqrt()))
    }
}

#[cfg(test)]
mod tests;
