//! k-fold cross-validation (Stone 1974), by views: all tags of one view share errors.

use crate::calib::angles_by_camera::set_by_camera;
use crate::calib::methods::position_problem::PositionProblem;
use crate::calib::parameters::JointParameters;
use crate::calib::result::metrics::HeldOutMetrics;
use crate::calib::views::view::View;
use armcal_core::robot::Robot;

/// Every fifth view in the order of time is one fold.
pub(crate) const FOLDS: usize = 5;

/// The views that a fold fits, and those that it holds out.
pub(crate) fn fold_of(views: &[View], fold: usize) -> (Vec<View>, Vec<View>) {
    let of = |wanted: bool| -> Vec<View> {
        let views = views.iter().enumerate();
        views.filter(|(k, _)| (k % FOLDS == fold) == wanted).map(|(_, view)| view.clone()).collect()
    };
    (of(false), of(true))
}

/// Each view by the parameters that `fit` estimates from the views of the other folds; a fold without an estimate does
/// not count.
pub(crate) fn cross_validate(
    robot: &Robot,
    views: &[View],
    fit: impl Fn(&[View]) -> Option<JointParameters>,
) -> HeldOutMetrics {
    let mut sums = FoldSums::default();
    for fold in 0..FOLDS {
        let (fitted, held_out) = fold_of(views, fold);
        if fitted.is_empty() || held_out.is_empty() {
            continue;
        }
        if let Some(at) = fit(&fitted) {
            sums.add(&held_out, robot, &at, robot);
        }
    }
    sums.metrics()
}

/// Sums over the folds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FoldSums {
    n_views: usize,
    /// Landmarks seen, and squares and sizes of their distances.
    n: usize,
    sum_m2: f64,
    sum_m: f64,
    nominal_m2: f64,
    /// Of those, the ones with corners.
    n_corners: usize,
    sum_px2: f64,
    /// And the ones with poses.
    n_poses: usize,
    camera_sum_m: f64,
}

/// The views with the angles that their tags show where a sensor says nothing.
fn by_camera(views: &[View], robot: &Robot, at: &JointParameters) -> Vec<View> {
    let mut views = views.to_vec();
    for view in &mut views {
        set_by_camera(robot, view, at);
    }
    views
}

impl FoldSums {
    /// Adds views left out, by what was found without them: the arm as found, and its parameters; `nominal` is the
    /// drawing.
    pub fn add(&mut self, held_out: &[View], as_found: &Robot, at: &JointParameters, nominal: &Robot) {
        let (by_found, by_drawing) =
            (by_camera(held_out, as_found, at), by_camera(held_out, nominal, &JointParameters::default()));
        let problem = PositionProblem::new(as_found, &by_found);
        problem.each(at, |o| {
            self.n += 1;
            self.sum_m2 += o.residual_m.norm_squared();
            self.sum_m += o.residual_m.norm();
            self.n_corners += usize::from(o.tag.corners().is_some());
            if let Some(off_m) = problem.camera_off_m(o) {
                self.n_poses += 1;
                self.camera_sum_m += off_m;
            }
        });
        let seen = held_out.iter().flat_map(|view| &view.tags).filter(|tag| tag.corners().is_some()).count() as f64;
        self.sum_px2 += problem.reprojection_rms_px(at).map_or(0.0, |rms_px| rms_px * rms_px * seen);
        PositionProblem::new(nominal, &by_drawing)
            .each(&JointParameters::default(), |o| self.nominal_m2 += o.residual_m.norm_squared());
        self.n_views += held_out.iter().filter(|view| !view.tags.is_empty()).count();
    }

    pub fn metrics(&self) -> HeldOutMetrics {
        let mean = |sum: f64, n: usize| (n > 0).then(|| sum / n as f64);
        HeldOutMetrics {
            views: self.n_views,
            cross_validated: true,
            rms_m: mean(self.sum_m2, self.n).map(f64::sqrt),
            mean_m: mean(self.sum_m, self.n),
            camera_mean_m: mean(self.camera_sum_m, self.n_poses),
            rms_px: mean(self.sum_px2, self.n_corners).map(f64::sqrt),
            nominal_rms_m: mean(self.nominal_m2, self.n).map(f64::sqrt),
        }
    }
}
