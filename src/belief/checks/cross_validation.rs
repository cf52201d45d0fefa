//! k-fold cross-validation (Stone 1974), by views: all tags of one view share errors.

use crate::checks::consistency::MAX_OUTLIERS;
pub(crate) use crate::checks::constants::cross_validation::FOLDS;
use crate::checks::constants::cross_validation::LEAST_DISTANCE_M;
use crate::checks::innovations::Innovations;
use crate::explain::angles_by_camera::set_by_camera;
use crate::explain::baseline::{Baseline, N_BASELINES};
use crate::file::metrics::{HeldOutMetrics, ViewContainment};
use crate::judge::baseline_comparison::BaselineComparison;
use crate::model::parameters::JointParameters;
use crate::positions::position_problem::{PositionProblem, TagResidual};
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::outliers::Outlier;
use crate::views::view::View;
use armcal_core::robot::Robot;

/// Returns the views that a fold fits, and those that it holds out.
pub(crate) fn fold_of(views: &[View], fold: usize) -> (Vec<View>, Vec<View>) {
    let of = |wanted: bool| -> Vec<View> {
        let views = views.iter().enumerate();
        views.filter(|(k, _)| (k % FOLDS == fold) == wanted).map(|(_, view)| view.clone()).collect()
    };
    (of(false), of(true))
}

/// Computes the held-out metrics of all views, each predicted from the views of the other folds. `fit` estimates the
/// parameters, `baselines` the arms; a fold without an estimate does not count.
pub(crate) fn cross_validate(
    robot: &Robot,
    views: &[View],
    fit: impl Fn(&[View]) -> Option<JointParameters>,
    baselines: impl Fn(&[View]) -> [Option<Robot>; N_BASELINES],
) -> HeldOutMetrics {
    let mut sums = FoldSums::default();
    for fold in 0..FOLDS {
        let (fitted, views) = fold_of(views, fold);
        if fitted.is_empty() || views.is_empty() {
            continue;
        }
        if let Some(at) = fit(&fitted) {
            let baselines = &baselines(&fitted);
            sums.add(&Fold { views: &views, as_found: robot, at: &at, nominal: robot, baselines });
        }
    }
    sums.metrics()
}

/// Computes held-out metrics and innovations. Each fold is predicted from the other folds, with the hyperparameters of
/// all views; the baselines fit only mount and map about `datasheet`. Neither result counts observations that the fit
/// of all views rejected: the error of a wrong tag id says nothing about the arm.
pub(crate) fn cross_validate_with_innovations(
    input: &BundleInput<'_>,
    all: &Estimate<'_>,
    datasheet: &Robot,
) -> (HeldOutMetrics, Vec<Innovations>) {
    let mut sums = FoldSums::default();
    let baseline = Baseline::new(datasheet, input.views);
    let mut innovations = Vec::new();
    for fold in 0..FOLDS {
        let (fitted, held_out) = fold_of(input.views, fold);
        let part = BundleInput {
            views: &fitted,
            model: all.model.clone(),
            scales: all.scales().clone(),
            evidence: HyperparameterMode::Given,
            ..input.clone()
        };
        let Some(found) = estimate(&part) else { continue };
        let as_found = found.as_found(input.robot);
        let places = held_out.into_iter().enumerate().map(|(n, view)| (n * FOLDS + fold, view));
        let mut with_places: Vec<(usize, View)> = places
            .filter_map(|(view_idx, view)| Some((view_idx, without_rejected(view_idx, view, left_out(all))?)))
            .collect();
        // If no sensor measures an angle, only the view's own tags give the linearization point.
        for (_, view) in &mut with_places {
            all.see_through_found_lens(view, &as_found);
            set_by_camera(&as_found, view, &found.parameters());
        }
        let held_out: Vec<View> = with_places.iter().map(|(_, view)| view.clone()).collect();
        innovations.extend(found.innovations(&part, &with_places, &all.outliers));
        sums.add(&Fold {
            views: &found.as_read_now(&held_out),
            as_found: &as_found,
            at: &found.parameters(),
            nominal: datasheet,
            baselines: &baseline.as_ref().map(|baseline| baseline.fit(datasheet, &fitted)).unwrap_or_default(),
        });
    }
    let mut within = ViewContainment::default();
    for fold in &innovations {
        within.views += fold.within_95.views;
        within.within += fold.within_95.within;
    }
    let within_95 = (within.views > 0).then_some(within);
    (HeldOutMetrics { within_95, ..sums.metrics() }, innovations)
}

/// Returns the observations to leave out of the held-out figures: the rejected ones, if they are no more than in good
/// recordings. If they are more, the arm may be wrong, not they.
fn left_out<'b>(all: &'b Estimate<'_>) -> &'b [Outlier] {
    let share = all.outliers.len() as f64 / all.problem.observations.len().max(1) as f64;
    if share <= MAX_OUTLIERS { &all.outliers } else { &[] }
}

/// Returns a view without its wholly rejected observations; `None` if it shows no other.
fn without_rejected(view_idx: usize, mut view: View, outliers: &[Outlier]) -> Option<View> {
    let is_rejected =
        |id: u32| outliers.iter().any(|out| out.view_idx == view_idx && out.tag_id == id && out.corner.is_none());
    view.tags.retain(|tag| !is_rejected(tag.id));
    (!view.tags.is_empty()).then_some(view)
}

/// Held-out views of a fold, and the estimate made without them.
pub(crate) struct Fold<'a> {
    pub views: &'a [View],
    /// Arm as estimated, with its parameters `at`.
    pub as_found: &'a Robot,
    pub at: &'a JointParameters,
    /// Nominal model.
    pub nominal: &'a Robot,
    /// Arms of the baselines, with the joints at the datasheet.
    pub baselines: &'a [Option<Robot>; N_BASELINES],
}

/// Sums over the folds.
#[derive(Clone, Debug, Default)]
pub(crate) struct FoldSums {
    n_views: usize,
    /// Number of landmarks seen; `sum_m2` and `sum_m` sum the squares and sizes of their distances.
    n: usize,
    sum_m2: f64,
    sum_m: f64,
    nominal_m2: f64,
    baselines: [BaselineSums; N_BASELINES],
    /// Number of those landmarks with corners.
    n_corners: usize,
    sum_px2: f64,
    /// Number of those landmarks with poses.
    n_poses: usize,
    camera_sum_m: f64,
}

/// Sums over the folds of one baseline.
#[derive(Clone, Debug, Default)]
struct BaselineSums {
    /// Number of landmarks seen; `sum_m2` sums the squares of their distances.
    n: usize,
    sum_m2: f64,
    /// Mean logarithm of the baseline's distances over the calibration's, one entry per view.
    log_ratios: Vec<f64>,
}

impl BaselineSums {
    fn add(&mut self, by_calibration: &ViewDistances, by_baseline: &ViewDistances) {
        self.n += by_baseline.n.iter().sum::<usize>();
        self.sum_m2 += by_baseline.sum_m2;
        self.log_ratios.extend(by_calibration.log_ratios(by_baseline));
    }

    fn mean_m2(&self) -> f64 {
        self.sum_m2 / self.n as f64
    }
}

/// Compares the calibration with the baseline of the smallest error among those that predict the most landmarks.
fn best_comparison(all: &[BaselineSums]) -> Option<BaselineComparison> {
    let n = all.iter().map(|sums| sums.n).max().filter(|n| *n > 0)?;
    let complete = all.iter().filter(|sums| sums.n == n);
    let best = complete.min_by(|a, b| a.mean_m2().total_cmp(&b.mean_m2()))?;
    BaselineComparison::new(best.mean_m2().sqrt(), &best.log_ratios)
}

/// Returns the views with each angle that no sensor measures set from their tags.
fn by_camera(views: &[View], robot: &Robot, at: &JointParameters) -> Vec<View> {
    let mut views = views.to_vec();
    for view in &mut views {
        set_by_camera(robot, view, at);
    }
    views
}

impl FoldSums {
    pub fn add(&mut self, fold: &Fold<'_>) {
        let Fold { views, as_found, at, nominal, baselines } = *fold;
        let datasheet = JointParameters::default();
        let (by_found, by_drawing) = (by_camera(views, as_found, at), by_camera(views, nominal, &datasheet));
        let problem = PositionProblem::new(as_found, &by_found);
        let mut distances = ViewDistances::new(views.len());
        problem.each(at, |o| {
            distances.add(o);
            self.n += 1;
            self.sum_m2 += o.residual_m.norm_squared();
            self.sum_m += o.residual_m.norm();
            self.n_corners += usize::from(o.tag.is_in_pixels());
            if let Some(off_m) = problem.camera_off_m(o) {
                self.n_poses += 1;
                self.camera_sum_m += off_m;
            }
        });
        let seen = views.iter().flat_map(|view| &view.tags).filter(|tag| tag.is_in_pixels()).count() as f64;
        self.sum_px2 += problem.reprojection_rms_px(at).map_or(0.0, |rms_px| rms_px * rms_px * seen);
        PositionProblem::new(nominal, &by_drawing).each(&datasheet, |o| self.nominal_m2 += o.residual_m.norm_squared());
        self.n_views += views.iter().filter(|view| !view.tags.is_empty()).count();
        for (sums, baseline) in self.baselines.iter_mut().zip(baselines) {
            let Some(baseline) = baseline else { continue };
            let by_baseline = by_camera(views, baseline, &datasheet);
            let mut of_baseline = ViewDistances::new(views.len());
            PositionProblem::new(baseline, &by_baseline).each(&datasheet, |o| of_baseline.add(o));
            sums.add(&distances, &of_baseline);
        }
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
            baseline: best_comparison(&self.baselines),
            within_95: None,
        }
    }
}

/// Compares a calibration on `problem`'s views, which were not fitted, with the best of `baselines`; `None` below two
/// views.
pub(crate) fn compared(
    problem: &PositionProblem<'_>,
    at: &JointParameters,
    baselines: &[Option<Robot>; N_BASELINES],
) -> Option<BaselineComparison> {
    let mut by_calibration = ViewDistances::new(problem.views.len());
    problem.each(at, |o| by_calibration.add(o));
    let sums = baselines.iter().flatten().map(|robot| {
        let mut by_baseline = ViewDistances::new(problem.views.len());
        PositionProblem::new(robot, problem.views).each(&JointParameters::default(), |o| by_baseline.add(o));
        let mut sums = BaselineSums::default();
        sums.add(&by_calibration, &by_baseline);
        sums
    });
    best_comparison(&sums.collect::<Vec<_>>())
}

/// Distances between seen and surveyed landmarks, one entry per view.
struct ViewDistances {
    n: Vec<usize>,
    sum_ln: Vec<f64>,
    sum_m2: f64,
}

impl ViewDistances {
    fn new(n_views: usize) -> Self {
        Self { n: vec![0; n_views], sum_ln: vec![0.0; n_views], sum_m2: 0.0 }
    }

    fn add(&mut self, o: &TagResidual<'_>) {
        let distance_m = o.residual_m.norm();
        self.n[o.view_idx] += 1;
        self.sum_ln[o.view_idx] += distance_m.max(LEAST_DISTANCE_M).ln();
        self.sum_m2 += distance_m * distance_m;
    }

    /// Mean logarithm of the distances in `others` over those in `self`, one entry per view with landmarks.
    fn log_ratios(&self, others: &Self) -> Vec<f64> {
        let views = self.n.iter().zip(self.sum_ln.iter().zip(&others.sum_ln)).filter(|(n, _)| **n > 0);
        views.map(|(n, (own, other))| (other - own) / *n as f64).collect()
    }
}
