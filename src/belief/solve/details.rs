//! Residuals of each view and predicted errors at each target, for reports only (in no file).

use nalgebra::{Matrix3, Point3, Vector2};

use crate::judge::{ErrorDistribution, TargetError};
use crate::model::parameters::JointParameters;
use crate::positions::position_problem::{PositionProblem, TagResidual};
use crate::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::optics::square_corners;
use armcal_core::stats::Summary;
use armcal_core::time::Stamp;

/// Residuals of a fit for each view, and predictions for each target of the task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitDetails {
    /// Residuals of the fitted views in their order; views only for a map or of end stops are not among them.
    pub views: Vec<ViewResidual>,
    /// Targets of the task that inverse kinematics reaches.
    pub targets: Vec<TargetPrediction>,
}

/// Residuals of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewResidual {
    /// Number of the view in its capture mark.
    pub pose_idx: u32,
    /// End of the view.
    pub end: Stamp,
    /// Joint angles of the readings by the datasheet, rad.
    pub datasheet_rad: JointAngles,
    /// Joint angles as calibrated, rad.
    pub calibrated_rad: JointAngles,
    /// Error of each joint from its calibrated sensor in this view, rad; only from `bundle`.
    pub joint_error_rad: Option<JointAngles>,
    /// Tags of the view in the order of the recording.
    pub tags: Vec<ObservedTag>,
}

/// Residual of one tag in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedTag {
    /// Id of the tag in the image.
    pub id: u32,
    /// Distance between the tag's positions by the calibrated arm and by the survey, m.
    pub off_m: f64,
    /// Residuals of the corners, if the recording has corners; absent if predicted outside of the lens's view.
    pub corners: [Option<CornerResidual>; 4],
    /// True if the fit used any of it; false if it rejected all corners.
    pub is_used: bool,
}

/// Residual of one corner of a tag, raw pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerResidual {
    /// Mean position over the frames of the view.
    pub seen_px: [f64; 2],
    /// Seen minus predicted position.
    pub off_px: [f64; 2],
    /// True if the fit used the corner; false if it rejected it.
    pub is_used: bool,
}

/// Predicted error of the tool at one target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetPrediction {
    /// Number of the target in its task, from 0.
    pub target_idx: usize,
    /// Joint angles at the target, rad.
    pub angles: JointAngles,
    /// Covariance of the tool's position in the base frame, m^2.
    pub covariance_m2: Matrix3<f64>,
    /// Expected size of the tool's position error: `sqrt(trace(covariance))`, m.
    pub error_m: f64,
    /// Predicted error with the stated standard deviations of unobservable parameters, if requested, m.
    pub with_priors_m: Option<f64>,
    /// Covariance with the stated standard deviations of unobservable parameters, if requested, m^2.
    pub with_priors_m2: Option<Matrix3<f64>>,
    /// Distribution of the error's size, from which U95 follows.
    pub distribution: Option<ErrorDistribution>,
}

impl FitDetails {
    pub(crate) fn of(problem: &PositionProblem<'_>, at: &JointParameters, targets: Vec<TargetPrediction>) -> Self {
        Self { views: ViewResidual::all(problem, at), targets }
    }

    /// Stores the errors with stated standard deviations included, target by target in the same order; returns their
    /// sizes.
    pub(crate) fn keep_with_priors(&mut self, errors: &[TargetError], dof_of_noise: f64) -> Option<Summary> {
        let size_m = |error: &TargetError| {
            let by_data_m = error.by_data_m2.trace().max(0.0).sqrt();
            (by_data_m * by_data_m + error.by_priors_m2.trace()).max(0.0).sqrt()
        };
        let sizes_m: Vec<f64> = errors.iter().map(size_m).collect();
        for ((target, error), size_m) in self.targets.iter_mut().zip(errors).zip(&sizes_m) {
            target.with_priors_m = Some(*size_m);
            target.with_priors_m2 = Some(error.total_m2());
            target.distribution = error.distribution(dof_of_noise);
        }
        Summary::of(&sizes_m)
    }
}

impl ViewResidual {
    /// Returns the residuals of each view of the problem at its solution.
    pub(crate) fn all(problem: &PositionProblem<'_>, at: &JointParameters) -> Vec<Self> {
        let mut all: Vec<Self> = problem.views.iter().map(|view| Self::without_tags(problem, view, at)).collect();
        problem.each(at, |o| all[o.view_idx].tags.push(ObservedTag::of(problem, o)));
        all
    }

    fn without_tags(problem: &PositionProblem<'_>, view: &View, at: &JointParameters) -> Self {
        let center = |joint: usize| problem.robot.sensors[joint].center_rad;
        let read = |joint: usize| center(joint) + view.travel_rad[joint];
        Self {
            pose_idx: view.pose_idx,
            end: view.end,
            datasheet_rad: JointAngles::from_fn(problem.robot.n_joints(), read),
            calibrated_rad: problem.angles(view, &view.conditions.departure_from(&at.reference), at),
            joint_error_rad: None,
            tags: Vec::new(),
        }
    }
}

impl ObservedTag {
    fn of(problem: &PositionProblem<'_>, o: &TagResidual<'_>) -> Self {
        let tag = &problem.robot.tags[o.tag.tag_idx];
        let camera_from_tag = o.base_from_camera.inverse() * tag.base_from_tag.isometry();
        let residual = |corner: &Point3<f64>, seen_px: [f64; 2]| {
            let pixel = problem.robot.camera_at(o.view.camera).lens.project(&(camera_from_tag * corner).coords)?;
            Some(CornerResidual { seen_px, off_px: (Vector2::from(seen_px) - pixel).into(), is_used: true })
        };
        let corners = o.tag.corners().map_or([None; 4], |seen| {
            let drawn = square_corners(tag.size_m);
            std::array::from_fn(|corner| residual(&drawn[corner], seen.corners_px[corner]))
        });
        Self { id: o.tag.id, off_m: o.residual_m.norm(), corners, is_used: true }
    }

    /// Returns the root mean square over the corners in use, px.
    #[must_use]
    pub fn rms_px(&self) -> Option<f64> {
        let used = self.corners.iter().flatten().filter(|corner| corner.is_used && self.is_used);
        let squares: Vec<f64> = used.map(|corner| Vector2::from(corner.off_px).norm_squared()).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}
