//! The batch of all views, to compare a belief with that took in the same views one by one.

use crate::batch::marked_calibrations::calibrate_bundle;
use crate::file::calibration::Calibration;
use crate::follow::estimator::OnlineEstimator;
use crate::follow::event::OnlineEvent;
use crate::follow::filter::Filter;
use crate::follow::follower::Follower;
use crate::follow::settings::{DriftModel, FaultSearch, OnlineSettings};
use crate::solve::estimate::Estimate;
use crate::solve::input::BundleInput;
use crate::views::calibration_data::CalibrationData;
use crate::views::error::CalibError;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::streams::ReachTask;

/// What `bundle` made of all views, and from what.
pub struct Batch {
    /// Its result and verdict.
    pub calibration: Calibration,
    task: Option<ReachTask>,
    used: Used,
}

/// What an estimate was made from, and what it came to.
struct Used {
    /// With the tags and the drawing that it ended with.
    robot: Robot,
    /// In the order of time, failed sensors marked.
    views: Vec<View>,
    /// Its model and scales, nothing drifting.
    settings: OnlineSettings,
    belief: Filter,
}

impl Batch {
    /// Calibrates by `bundle`.
    ///
    /// # Errors
    /// [`CalibError`] where the views determine nothing.
    pub fn of(data: CalibrationData) -> Result<Self, CalibError> {
        let (recording, task) = (data.name.clone(), data.data.task.clone());
        let mut used = None;
        let calibration = calibrate_bundle(data, &mut |input, estimate| used = Used::of(input, estimate))?;
        let used = used.ok_or(CalibError::NothingObservable { recording })?;
        Ok(Self { calibration, task, used })
    }

    /// Takes the same views in one by one, under the batch's model and scales; `hear` is told after each.
    pub fn follow(&self, hear: &mut dyn FnMut(&Follower, Vec<OnlineEvent>)) -> Follower {
        let Used { robot, views, settings, .. } = &self.used;
        let mut follower = Follower::new(robot.clone(), settings.clone());
        self.task.iter().for_each(|task| follower.set_task(task));
        for view in views {
            let events = follower.add(vec![view.clone()]);
            hear(&follower, events);
        }
        follower
    }

    /// Largest difference between a belief and this batch over all that both estimate (sensors, links, mount, lens,
    /// tags), in sigmas of the batch; `None` before the belief's first view, or where a difference is not a number.
    #[must_use]
    pub fn largest_difference_sigmas(&self, online: &OnlineEstimator) -> Option<f64> {
        let off = online.best_filter()?.sigmas_from(&self.used.belief)?;
        off.iter().all(|off| off.is_finite()).then(|| off.amax())
    }
}

impl Used {
    fn of(input: &BundleInput<'_>, estimate: &Estimate<'_>) -> Option<Self> {
        let settings = OnlineSettings {
            model: Some(estimate.model.clone()),
            scales: Some(estimate.problem.scales.clone()),
            guess: Some(estimate.guess),
            drift: DriftModel::Stationary,
            faults: FaultSearch::Off,
        };
        let mut views = input.views.to_vec();
        views.sort_by_key(|view| view.end);
        let belief = Filter::of_estimate(estimate, input.robot)?;
        Some(Self { robot: input.robot.clone(), views, settings, belief })
    }
}
