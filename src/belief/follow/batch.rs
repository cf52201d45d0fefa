//! The batch estimate of all views, for comparison with an online estimate that took in the same views one by one.

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

/// Result of `bundle` over all views, with its inputs.
pub struct Batch {
    /// Result and verdict of the batch.
    pub calibration: Calibration,
    task: Option<ReachTask>,
    used: Used,
}

/// Inputs of an estimate, and the resulting filter.
struct Used {
    /// The robot with the final tags and nominal model.
    robot: Robot,
    /// Views in the order of time, with failed sensors marked.
    views: Vec<View>,
    /// Model and scales of the batch, without drift.
    settings: OnlineSettings,
    belief: Filter,
}

impl Batch {
    /// Calibrates by `bundle`.
    ///
    /// # Errors
    /// [`CalibError`] if the views determine nothing.
    pub fn of(data: CalibrationData) -> Result<Self, CalibError> {
        let (recording, task) = (data.name.clone(), data.data.task.clone());
        let mut used = None;
        let calibration = calibrate_bundle(data, &mut |input, estimate| used = Used::of(input, estimate))?;
        let used = used.ok_or(CalibError::NothingObservable { recording })?;
        Ok(Self { calibration, task, used })
    }

    /// Takes in the same views one by one, under the batch's model and scales; calls `hear` after each.
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

    /// Returns the largest difference between an online estimate and this batch, in sigmas of the batch. It covers all
    /// parameters that both estimate: sensors, links, mount, lens, tags. `None` before the first view, or if a
    /// difference is not finite.
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
