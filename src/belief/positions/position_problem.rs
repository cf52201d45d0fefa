//! The geometry that all methods share: parameters, predicted tag positions, residuals and Jacobians.
//!
//! `theta_j = center_j + gain_j * travel_j + offset_j` (the paper's equation 2), and a tag seen at `z_c` in the camera
//! lies in the base frame at `z_b = base_from_camera(theta) * z_c`. Residual = predicted base position - survey, m.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Vector2, Vector3};

use crate::model::parameters::{JointParameters, Parameter};
use crate::views::view::{TagMeasurement, TagObservation, View};
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::sensor::ConditionChange;
use armcal_core::spatial::skew;
use armcal_core::streams::JointAngles;

/// Views with known landmarks.
#[derive(Clone, Debug)]
pub struct PositionProblem<'a> {
    /// Nominal arm with surveyed landmarks.
    pub robot: &'a Robot,
    /// Views; those without tags do not count.
    pub views: &'a [View],
}

/// Residual of one observation, with everything that Jacobians need.
pub struct TagResidual<'a> {
    /// Index of the view.
    pub view_idx: usize,
    /// Tag of the view.
    pub tag: &'a TagObservation,
    /// View with the tag.
    pub view: &'a View,
    /// Departure of the view's conditions from the parameters' reference.
    pub departure: ConditionChange,
    /// Predicted links, in the frame of the tags.
    pub poses: &'a LinkPoses,
    /// Predicted pose of the camera, in the same frame.
    pub base_from_camera: &'a Isometry3<f64>,
    /// Predicted centre of the tag in the base frame, m.
    pub predicted_m: Vector3<f64>,
    /// Predicted minus surveyed position, m.
    pub residual_m: Vector3<f64>,
}

impl<'a> PositionProblem<'a> {
    /// Returns the problem of landmarks in `views` against the survey of `robot`.
    #[must_use]
    pub fn new(robot: &'a Robot, views: &'a [View]) -> Self {
        Self { robot, views }
    }

    /// Calls `f` for every tag of every view.
    pub fn each(&self, parameters: &JointParameters, mut f: impl FnMut(&TagResidual<'_>)) {
        let are_straight = parameters.are_linear();
        for (view_idx, view) in self.views.iter().enumerate() {
            if view.tags.is_empty() {
                continue;
            }
            let departure = view.conditions.departure_from(&parameters.reference);
            let angles = if are_straight {
                self.straight_angles(view, parameters)
            } else {
                self.angles(view, &departure, parameters)
            };
            let poses = self.robot.chain.link_poses(&angles).in_frame(&self.robot.tag_frame);
            let base_from_camera = poses.frame(&self.robot.camera_at(view.camera).mount);
            for tag in &view.tags {
                let predicted_m = (base_from_camera * Point3::from(tag.center_in_camera_m)).coords;
                let surveyed = self.robot.tags[tag.tag_idx].base_from_tag.origin().vector();
                f(&TagResidual {
                    view_idx,
                    tag,
                    view,
                    departure,
                    poses: &poses,
                    base_from_camera: &base_from_camera,
                    predicted_m,
                    residual_m: predicted_m - surveyed,
                });
            }
        }
    }

    /// Returns the joint angles without terms, a shortcut because solvers spend most of their time here.
    fn straight_angles(&self, view: &View, parameters: &JointParameters) -> JointAngles {
        JointAngles::from_fn(self.robot.n_joints(), |j| {
            let center_rad = self.robot.sensors[j].center_rad;
            center_rad + parameters.gain[j] * view.travel_rad[j] + parameters.offset_rad[j]
        })
    }

    pub(crate) fn angles(&self, view: &View, departure: &ConditionChange, parameters: &JointParameters) -> JointAngles {
        JointAngles::from_fn(self.robot.n_joints(), |j| {
            let spec = &self.robot.sensors[j];
            parameters.correction(j).angle_rad(spec, view.travel_rad[j], departure, view.approach[j])
        })
    }

    /// Returns the number of tags in all views.
    #[must_use]
    pub fn n_observations(&self) -> usize {
        self.views.iter().map(|view| view.tags.len()).sum()
    }

    /// Returns the paper's objective: the sum of distances between seen and surveyed landmarks, m.
    #[must_use]
    pub fn sum_of_distances_m(&self, parameters: &JointParameters) -> f64 {
        // The residuals are those of `each`, without the parts that only Jacobians need.
        let are_straight = parameters.are_linear();
        let mut sum = 0.0;
        for view in self.views {
            let angles = if are_straight {
                self.straight_angles(view, parameters)
            } else {
                self.angles(view, &view.conditions.departure_from(&parameters.reference), parameters)
            };
            let base_from_camera = self.robot.tags_from(self.robot.camera_at(view.camera), &angles);
            for tag in &view.tags {
                let predicted_m = (base_from_camera * Point3::from(tag.center_in_camera_m)).coords;
                sum += (predicted_m - self.robot.tags[tag.tag_idx].base_from_tag.origin().vector()).norm();
            }
        }
        sum
    }

    /// Returns the root mean square distance between seen and surveyed landmarks, m; `None` without observations.
    #[must_use]
    pub fn rms_m(&self, parameters: &JointParameters) -> Option<f64> {
        let (mut sum, mut n) = (0.0, 0usize);
        self.each(parameters, |o| {
            sum += o.residual_m.norm_squared();
            n += 1;
        });
        (n > 0).then(|| (sum / n as f64).sqrt())
    }

    /// Returns the distance of the camera from its position by a landmark's measured pose, m; `None` without such a
    /// pose.
    pub(crate) fn camera_off_m(&self, o: &TagResidual<'_>) -> Option<f64> {
        let TagMeasurement::Pose(camera_from_tag) = o.tag.measured else { return None };
        let measured = self.robot.tags[o.tag.tag_idx].base_from_tag.isometry() * camera_from_tag.inverse();
        Some((o.base_from_camera.translation.vector - measured.translation.vector).norm())
    }

    /// Returns the root mean square reprojection error per corner (2D), px; corners predicted out of view count as
    /// unseen.
    #[must_use]
    pub fn reprojection_rms_px(&self, parameters: &JointParameters) -> Option<f64> {
        let (mut sum, mut n) = (0.0, 0usize);
        self.each(parameters, |o| {
            let tag: &SurveyedTag = &self.robot.tags[o.tag.tag_idx];
            let camera_from_tag = o.base_from_camera.inverse() * tag.base_from_tag.isometry();
            for (point, measured) in o.tag.points(tag.size_m) {
                if let Some(pixel) = self.robot.camera_at(o.view.camera).lens.project(&(camera_from_tag * point).coords)
                {
                    sum += (Vector2::from(measured) - pixel).norm_squared();
                    n += 1;
                }
            }
        });
        (n > 0).then(|| (sum / n as f64).sqrt())
    }

    /// Returns the residuals (m, three per tag) and their Jacobian by `parameters` in `columns`, in the parameters' own
    /// units.
    #[must_use]
    pub fn linearize(&self, parameters: &JointParameters, columns: &[Parameter]) -> (DVector<f64>, DMatrix<f64>) {
        let rows = 3 * self.n_observations();
        let mut residuals = DVector::zeros(rows);
        let mut jacobian = DMatrix::zeros(rows, columns.len());
        let mut row = 0;
        self.each(parameters, |o| {
            residuals.fixed_rows_mut::<3>(row).copy_from(&o.residual_m);
            for (column, &parameter) in columns.iter().enumerate() {
                let by_parameter = self.derivative(o, parameter);
                jacobian.fixed_view_mut::<3, 1>(row, column).copy_from(&by_parameter);
            }
            row += 3;
        });
        (residuals, jacobian)
    }

    /// Returns d(residual)/d(parameter). A joint turns everything distal to it: `axis x (point - origin)` times
    /// d(angle)/d(parameter).
    #[must_use]
    pub fn derivative(&self, o: &TagResidual<'_>, parameter: Parameter) -> Vector3<f64> {
        if parameter.joint >= self.robot.n_joints_seen_by(self.robot.camera_at(o.view.camera)) {
            return Vector3::zeros();
        }
        // The joint turns the tags' frame if the camera stands still: the point moves the other way in that frame.
        let sign = if self.robot.is_watched() { -1.0 } else { 1.0 };
        let by_angle = o.poses.point_jacobian(parameter.joint, &o.predicted_m) * sign;
        let (travel_rad, approach) = (o.view.travel_rad[parameter.joint], o.view.approach[parameter.joint]);
        let spec = &self.robot.sensors[parameter.joint];
        by_angle * parameter.kind.angle_derivative(spec, travel_rad, &o.departure, approach)
    }

    /// Returns d(residual)/d(camera mount), perturbed on the right of `link_from_camera`: (translation m, rotation
    /// rad).
    #[must_use]
    pub fn mount_derivative(o: &TagResidual<'_>) -> (Matrix3<f64>, Matrix3<f64>) {
        let rotation = *o.base_from_camera.rotation.to_rotation_matrix().matrix();
        (rotation, -rotation * skew(&o.tag.center_in_camera_m))
    }
}
