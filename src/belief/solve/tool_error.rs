//! Covariance of the tool's position and orientation, from the covariance of the sensors' parameters.
//!
//! `J P J^T + sum_j (dx/dtheta_j) (dx/dtheta_j)^T s_j^2`: P the covariance of the estimated parameters, J the tool's
//! derivative by them, and s_j^2 what each joint has besides: the datasheet's variance of what was not estimated, and
//! of what no parameter describes.

use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

use crate::model::parameters::{Parameter, ParameterKind};
use crate::solve::covariance::ParameterCovariance;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, ConditionChange, Conditions};
use armcal_core::streams::JointAngles;

impl ParameterCovariance {
    /// Covariance of the tool's position (base frame, m^2) for an arm at `angles` under the sensors' reference
    /// conditions.
    #[must_use]
    pub fn tool_position_m2(&self, robot: &Robot, sensors: &ArmSensors, angles: &JointAngles) -> Matrix3<f64> {
        self.tool_position_under_m2(robot, sensors, angles, &sensors.reference)
    }

    /// Covariance of the tool's position (base frame, m^2) for an arm at `angles` under `conditions`.
    ///
    /// Estimated parameters enter with their covariance, the others with the datasheet's sigma, and every sensor with
    /// what its parameters leave (`residual_std_rad`) and its play.
    #[must_use]
    pub fn tool_position_under_m2(
        &self,
        robot: &Robot,
        sensors: &ArmSensors,
        angles: &JointAngles,
        conditions: &Conditions,
    ) -> Matrix3<f64> {
        let at = Posture::new(robot, sensors, angles, conditions);
        self.propagated(&at, |moved, _| moved)
    }

    /// Covariance of the tool's pose: position (m) in the first three rows, then orientation (rad, a small turn about
    /// the axes of the base frame), both in the base frame.
    #[must_use]
    pub fn tool_pose(
        &self,
        robot: &Robot,
        sensors: &ArmSensors,
        angles: &JointAngles,
        conditions: &Conditions,
    ) -> Matrix6<f64> {
        let at = Posture::new(robot, sensors, angles, conditions);
        self.propagated(&at, |moved, turned| Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z))
    }

    /// To what `of_twist` makes of the tool's motion: of its point, and about the base's axes.
    fn propagated<const R: usize>(
        &self,
        at: &Posture<'_>,
        of_twist: impl Fn(Vector3<f64>, Vector3<f64>) -> SVector<f64, R>,
    ) -> SMatrix<f64, R, R> {
        let mut estimated = DMatrix::zeros(R, self.parameters.len());
        let mut covariance = SMatrix::<f64, R, R>::zeros();
        for joint in 0..at.robot.tool.mount.n_joints {
            let by_angle = of_twist(at.poses.point_jacobian(joint, &at.tool_m), at.poses.turn_jacobian(joint));
            let model = &at.sensors.models[joint];
            let travel_rad = model.travel_under_rad(at.angles[joint], &at.departure);
            for kind in ParameterKind::all() {
                let parameter = Parameter { joint, kind };
                let row = self.parameters.iter().position(|p| *p == parameter);
                let prior_std = parameter.prior_std(at.robot);
                if row.is_none() && prior_std == 0.0 {
                    continue;
                }
                let by_parameter = by_angle * kind.angle_derivative(&model.spec, travel_rad, &at.departure, 0.0);
                match row {
                    Some(column) => estimated.fixed_view_mut::<R, 1>(0, column).copy_from(&by_parameter),
                    None => covariance += outer(&(by_parameter * prior_std)),
                }
            }
            covariance += outer(&(by_angle * self.residual_std_rad(at.robot, joint)));
            let wandered_rad2 = self.wandered_rad2(at, joint) + model.correction.terms.half_backlash_rad.powi(2);
            if wandered_rad2 > 0.0 {
                covariance += outer(&by_angle) * wandered_rad2;
            }
        }
        for (column, parameter) in self.parameters.iter().enumerate() {
            if let Some([moved, turned]) = at.by_body(*parameter) {
                estimated.fixed_view_mut::<R, 1>(0, column).copy_from(&of_twist(moved, turned));
            }
        }
        let full = &estimated * &self.matrix * estimated.transpose();
        covariance + full.fixed_view::<R, R>(0, 0)
    }

    /// One sigma of what the parameters leave of the error of `joint`'s sensor.
    fn residual_std_rad(&self, robot: &Robot, joint: usize) -> f64 {
        self.residual_std_rad.map_or(robot.sensors[joint].linearity_std_rad, |std_rad| std_rad[joint])
    }

    /// Variance of the datasheet's random walk since the reference, where no drift was estimated.
    fn wandered_rad2(&self, at: &Posture<'_>, joint: usize) -> f64 {
        let drift = Parameter { joint, kind: ParameterKind::DriftPerH };
        if self.parameters.contains(&drift) {
            return 0.0;
        }
        at.robot.sensors[joint].drift_std_rad_per_sqrt_h.powi(2) * at.departure.elapsed_h.abs()
    }
}

/// An arm at angles under conditions.
struct Posture<'a> {
    robot: &'a Robot,
    sensors: &'a ArmSensors,
    angles: &'a JointAngles,
    departure: ConditionChange,
    poses: LinkPoses,
    /// Base frame.
    tool_m: Vector3<f64>,
}

impl<'a> Posture<'a> {
    fn new(robot: &'a Robot, sensors: &'a ArmSensors, angles: &'a JointAngles, conditions: &Conditions) -> Self {
        let poses = robot.chain.link_poses(angles);
        let tool_m = poses.frame(&robot.tool.mount).translation.vector;
        Self { robot, sensors, angles, departure: conditions.departure_from(&sensors.reference), poses, tool_m }
    }

    /// The tool's motion by a parameter of the arm's body; `None` for others.
    fn by_body(&self, parameter: Parameter) -> Option<[Vector3<f64>; 2]> {
        parameter.body_motion(&self.robot.chain, &self.poses, 0..self.robot.tool.mount.n_joints, &self.tool_m)
    }
}

fn outer<const R: usize>(v: &SVector<f64, R>) -> SMatrix<f64, R, R> {
    v * v.transpose()
}

#[cfg(test)]
mod tests;
