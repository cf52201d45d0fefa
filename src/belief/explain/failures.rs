//! Joints without a sensor reading, in all views or in some, as the estimator handles them.
//!
//! An invalid reading is replaced by the angle that the tags show, found by search so that the solver starts near. The
//! joint's error in that view gets a standard deviation that leaves it open ([`View::is_free`]). A locked joint is a
//! sensor that always reads the same, with an unknown offset: one column for all views.

use crate::explain::angles_by_camera::set_by_camera;
pub(crate) use crate::explain::constants::failures::{FAR_RAD, FAR_SIGMAS, MIN_VIEWS};
use crate::explain::constants::failures::{OTHER_GAIN_STD, OTHER_OFFSET_STD_RAD};
use crate::model::estimated::Model;
use crate::model::parameters::{JointParameters, ParameterKind};
use crate::model::scales::Hyperparameters;
use crate::say;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::model_for_views::{model_for, reference};
use crate::views::view::View;
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::stats::quantile;
use armcal_core::units::Unit;

/// Source of the report that a joint failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureSource {
    /// An operator, by a mark in the recording or in the routine.
    Declared,
    /// The estimator, from the tags.
    Detected,
}

/// Use of a failed joint's sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorUse {
    /// The readings are used, except in the failure's `views`.
    Used,
    /// No reading is used.
    Ignored,
}

/// Straight line from a joint's reading to its angle, if the line differs from the datasheet's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorLine {
    /// Slope of the angle over the datasheet's travel; below zero the sensor is reversed.
    pub slope: f64,
    /// Angle at no travel, from mid-range, rad.
    pub offset_rad: f64,
}

/// One failed joint, and the data of it that are not used.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Kind of failure.
    pub kind: FailedKind,
    /// Source of the report.
    pub found: FailureSource,
    /// Use of the sensor's readings.
    pub reading: SensorUse,
    /// Views whose reading is not used, ascending.
    pub views: Vec<usize>,
    /// First view after a lasting slip, in the order of time; before it the sensor had another offset.
    pub since: Option<usize>,
    /// Increase of the reading since the slip, rad.
    pub step_rad: Option<f64>,
    /// First view from which the sensor reads something else up to the end.
    pub lost_since: Option<usize>,
    /// Line of a reversed sensor, whose reading is not used, or of one of another scale, whose gain is estimated.
    pub line: Option<SensorLine>,
    /// Evidence of the failure, in words.
    pub evidence: String,
    /// True if the joint is held at one angle because its sensor says nothing.
    pub is_held: bool,
}

impl Failure {
    /// Failure of a sensor that is ignored in all of `n_views`.
    pub fn without_sensor(joint: usize, kind: FailedKind, found: FailureSource, n_views: usize) -> Self {
        let views = (0..n_views).collect();
        Self {
            joint,
            kind,
            found,
            reading: SensorUse::Ignored,
            views,
            since: None,
            step_rad: None,
            lost_since: None,
            line: None,
            evidence: String::new(),
            is_held: false,
        }
    }

    /// Failure as declared; the view of a jump is still to be found.
    pub fn declared(declared: FailedJoint, n_views: usize) -> Self {
        let FailedJoint { joint, kind } = declared;
        let all = Self::without_sensor(joint, kind, FailureSource::Declared, n_views);
        match kind {
            FailedKind::Jumps => Self { reading: SensorUse::Used, views: Vec::new(), ..all },
            FailedKind::Locked | FailedKind::NotMoved | FailedKind::Dead | FailedKind::Stuck => all,
        }
    }

    /// Slip of a sensor by `step_rad`, shown in `unit`, before the view `since`.
    pub fn slip((joint, unit): (usize, Unit), step_rad: f64, views: &[View], since: usize) -> Self {
        Self {
            reading: SensorUse::Used,
            since: Some(since),
            step_rad: Some(step_rad),
            evidence: slip_in_words(unit.shown(step_rad, 2), views, since),
            ..Self::without_sensor(joint, FailedKind::Jumps, FailureSource::Detected, 0)
        }
    }

    /// Returns true if the joint has one angle in all views.
    pub fn stands_still(&self) -> bool {
        self.kind.stands_still() || self.is_held
    }

    /// Returns true if the sensor slipped once for good.
    pub fn is_step(&self) -> bool {
        self.since.is_some()
    }

    /// Number of `views` with tags from the slip on.
    pub fn n_views_since(&self, views: &[View]) -> Option<usize> {
        let since = views[self.since?].end;
        Some(views.iter().filter(|view| view.end >= since && !view.tags.is_empty()).count())
    }

    /// Returns true if nothing determines the joint's angle any more, after the last view.
    pub fn has_no_sensor_now(&self) -> bool {
        self.leaves_no_sensor() || self.lost_since.is_some()
    }

    /// Returns true if the joint's parameters have no data at all.
    pub fn leaves_no_sensor(&self) -> bool {
        self.reading == SensorUse::Ignored
    }
}

/// Text of a slip: `the sensor slipped by 1.00 deg after 9 of 20 views, before view 10`.
pub(crate) fn slip_in_words(step: String, views: &[View], since: usize) -> String {
    let n_before = views.iter().filter(|view| view.end < views[since].end).count();
    let (n, number) = (views.len(), views[since].pose_idx + 1);
    say::slip(&step, [n_before, n], number)
}

/// Arm and views, adjusted for the failed joints.
pub struct FailureAdjusted {
    /// Robot in which a locked joint has a sensor of unknown offset.
    pub robot: Robot,
    /// Views with unused readings replaced by the angles from the camera.
    pub views: Vec<View>,
    /// The failed joints.
    pub failures: Vec<Failure>,
}

impl FailureAdjusted {
    /// Adjusts arm and views for `failures`. `at`: the estimate of the other joints' sensors.
    pub fn new(robot: &Robot, views: &[View], failures: &[Failure], at: &JointParameters) -> Self {
        let mut applied = Self { robot: robot.clone(), views: views.to_vec(), failures: failures.to_vec() };
        for failure in failures {
            for &view_idx in &failure.views {
                let view = &mut applied.views[view_idx];
                view.is_free[failure.joint] = true;
                view.rate_rad_s[failure.joint] = 0.0;
                view.approach[failure.joint] = 0.0;
            }
        }
        for view in &mut applied.views {
            set_by_camera(robot, view, at);
        }
        for failure in failures.iter().filter(|f| f.stands_still() && f.leaves_no_sensor()) {
            applied.lock(failure.joint);
        }
        for failure in failures.iter().filter(|failure| failure.line.is_some() && !failure.leaves_no_sensor()) {
            let spec = &mut applied.robot.sensors[failure.joint];
            spec.gain_std = spec.gain_std.max(OTHER_GAIN_STD);
            spec.offset_std_rad = spec.offset_std_rad.max(OTHER_OFFSET_STD_RAD);
        }
        applied
    }

    /// Sets one angle in all views, which starts at the median of those that the camera showed.
    fn lock(&mut self, joint: usize) {
        let seen: Vec<f64> =
            self.views.iter().filter(|view| !view.tags.is_empty()).map(|view| view.travel_rad[joint]).collect();
        let travel_rad = quantile(&seen, 0.5).unwrap_or(0.0);
        for view in &mut self.views {
            view.travel_rad[joint] = travel_rad;
            view.is_free[joint] = false;
        }
        let spec = &mut self.robot.sensors[joint];
        // The joint's other errors stay; only its sensor is gone.
        (spec.offset_std_rad, spec.gain_std, spec.noise_std_counts) = (spec.half_range_rad, 0.0, 0.0);
    }

    /// Model of the terms that these views determine, without columns for failed sensors.
    pub fn model(&self) -> Model {
        let mut model = model_for(&self.robot, &self.views);
        self.restrict(&mut model);
        model
    }

    /// Removes the columns of failed sensors from `model`.
    pub fn restrict(&self, model: &mut Model) {
        for failure in self.failures.iter().filter(|failure| failure.leaves_no_sensor()) {
            let is_locked = failure.stands_still();
            model.joints[failure.joint] = if is_locked { vec![ParameterKind::Offset] } else { Vec::new() };
        }
        for (failure, since) in self.failures.iter().filter_map(|failure| Some((failure, failure.since?))) {
            let kinds = &mut model.joints[failure.joint];
            // A sensor without a column of its own is exact, so it needs no step.
            if !kinds.is_empty() {
                kinds.push(ParameterKind::StepBefore(self.views[since].end));
            }
        }
    }

    /// Input of an estimate from the datasheet.
    pub fn input(&self, evidence: HyperparameterMode) -> BundleInput<'_> {
        BundleInput {
            robot: &self.robot,
            views: &self.views,
            model: self.model(),
            scales: Hyperparameters::datasheet(&self.robot),
            guess: self.guess(),
            joint_prior: None,
            evidence,
        }
    }

    /// Initial guess from the datasheet, with the lines of failed sensors.
    fn guess(&self) -> JointParameters {
        let mut guess = JointParameters { reference: reference(&self.views), ..JointParameters::default() };
        for (joint, line) in self.failures.iter().filter_map(|failure| Some((failure.joint, failure.line?))) {
            if !self.failures.iter().any(|failure| failure.joint == joint && failure.leaves_no_sensor()) {
                (guess.gain[joint], guess.offset_rad[joint]) = (line.slope, line.offset_rad);
            }
        }
        guess
    }

    /// Estimates from the datasheet; `None` if the views determine nothing.
    pub fn estimate(&self, evidence: HyperparameterMode) -> Option<Estimate<'_>> {
        estimate(&self.input(evidence))
    }
}
