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

/// A fit view by view, and its task target by target.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitDetails {
    /// In the order of the fit; those of a map or of end stops alone are none.
    pub views: Vec<ViewResidual>,
    /// Targets of the task that inverse kinematics reaches.
    pub targets: Vec<TargetPrediction>,
}

/// Residuals of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewResidual {
    /// Number in its capture mark.
    pub pose_idx: u32,
    /// End of the view.
    pub end: Stamp,
    /// Angles of its readings by the datasheet, rad.
    pub datasheet_rad: JointAngles,
    /// Joint angles as calibrated, rad.
    pub calibrated_rad: JointAngles,
    /// Error of each joint from its calibrated sensor in this view, rad; only from `bundle`.
    pub joint_error_rad: Option<JointAngles>,
    /// In the order of the recording.
    pub tags: Vec<ObservedTag>,
}

/// One tag in one view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedTag {
    /// As in the image.
    pub id: u32,
    /// Between where the calibrated arm has it and where it is known to be, m.
    pub off_m: f64,
    /// Where the recording has corners; one that is predicted out of the lens's view is absent.
    pub corners: [Option<CornerResidual>; 4],
    /// True if the fit used any of it; false if it rejected all corners.
    pub is_used: bool,
}

/// One corner of a tag, raw pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerResidual {
    /// Mean over the frames of the view.
    pub seen_px: [f64; 2],
    /// Seen less predicted.
    pub off_px: [f64; 2],
    /// True if the fit used it; false if it rejected it.
    pub is_used: bool,
}

/// Predicted error of the tool at one target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetPrediction {
    /// Number of the target in its task, from 0.
    pub target_idx: usize,
    /// The arm's angles there, rad.
    pub angles: JointAngles,
    /// Covariance of the tool's position in the base frame, m^2.
    pub covariance_m2: Matrix3<f64>,
    /// Expected size of the tool's position error: `sqrt(trace(covariance))`, m.
    pub error_m: f64,
    /// Predicted error with the unobservable parameters' stated sigmas, if requested, m.
    pub with_priors_m: Option<f64>,
    /// Covariance with stated sigmas of the unobservable parameters, where that was asked for, m^2.
    pub with_priors_m2: Option<Matrix3<f64>>,
    /// Distribution of the error's size, from which U95 follows.
    pub distribution: Option<ErrorDistribution>,
}

impl FitDetails {
    pub(crate) fn of(problem: &PositionProblem<'_>, at: &JointParameters, targets: Vec<TargetPrediction>) -> Self {
        Self { views: ViewResidual::all(problem, at), targets }
    }

    /// Keeps the errors with stated sigmas included, target by target in the same order; returns their sizes.
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
    /// Residuals of each view of the problem at its solution.
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

    /// Root mean square over the corners that are used, px.
    #[must_use]
    pub fn rms_px(&self) -> Option<f64> {
        let used = self.corners.iter().flatten().filter(|corner| corner.is_used && self.is_used);
        let squares: Vec<f64> = used.map(|corner| Vector2::from(corner.off_px).norm_squared()).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}
