//! One calibration by `bundle`: rounds of an estimate and its stages, which the lists in `BundleCalibration` name.

mod wrong_inputs;

use crate::batch::constants::rounds::MIN_VIEWS_FOR_EVIDENCE;
use crate::batch::failure_impact::FailureImpact;
use crate::batch::tables::{
    add_clock, camera_mount_table, covariance_with_mount, further_camera_tables, lens_tables, map_table, model_table,
    outlier_name, prior_table, unobservable, with_datasheets,
};
use crate::checks::assemble::{Evidence, Fit, Provenance, assemble, is_near, noise_dof, refusal_by_priors};
use crate::checks::block_measurements::{LengthInnovation, length_innovations};
use crate::checks::consistency::VerdictInput;
use crate::checks::cross_validation::{FoldSums, cross_validate_with_innovations};
use crate::checks::innovations::Innovations;
use crate::checks::touch_term::TouchUpdate;
use crate::explain::calibration_prior::PriorConsistency;
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::{FailureSearch, is_suspicious};
use crate::explain::failures::Failure;
use crate::explain::model_selection::{OptionalTerm, Selection};
use crate::explain::other_lens::{lens_that_fits, of_better_model};
use crate::explain::setup::{BundleSetup, Clocks, declared};
use crate::explain::tags::freed::MovedTags;
use crate::file::calibration::Calibration;
use crate::file::map_table::MapResult;
use crate::file::metrics::HeldOutMetrics;
use crate::judge::{TargetError, U95Table};
use crate::model::parameters::JointParameters;
use crate::model::shared_survey_error::count_as_independent;
use crate::positions::position_problem::PositionProblem;
use crate::positions::solution::Solution;
use crate::positions::unobservable::grouped_names;
use crate::say::reading_error::MisreadReadings;
use crate::say::refusal::Refusal;
use crate::solve::covariance::ParameterCovariance;
use crate::solve::details::TargetPrediction;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::task_angles::task_angles;
use crate::tagmap::tag_mapping::map_unknown_tags;
use crate::views::calibration_data::CalibrationData;
use crate::views::error::CalibError;
use crate::views::view::{ObservationRejection, View};
use armcal_core::codes::Code;
use armcal_core::joints::JointAngles;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::routine::Method;
use armcal_core::stats::Summary;
use nalgebra::Matrix3;
use std::collections::BTreeSet;

/// Purpose of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EstimatePurpose {
    /// The complete estimate, with all data that a verdict needs.
    Final,
    /// The estimate and its covariance, for use while views are still being captured.
    Interim,
}

/// A calibration by `bundle` in progress.
pub(crate) struct BundleCalibration<'a> {
    /// Data of the calibration; all views are fitted, including the held-out ones.
    data: CalibrationData,
    prior: Option<&'a Calibration>,
    map: Option<MapResult>,
    /// The tags as surveyed.
    surveyed: Vec<SurveyedTag>,
    purpose: EstimatePurpose,
    /// Tags that are no longer tied to their survey.
    moved: MovedTags,
    /// Terms of the nominal model that are estimated.
    drawing: Drawing,
    /// Offset that moved the readings of moving joints to the camera's clock, s, and the decision for it.
    clock: Option<(f64, Selection)>,
    /// Receives the last estimate by the views.
    listener: Option<&'a mut EstimateListener<'a>>,
    /// The views with the readings as they were read.
    as_read: Vec<View>,
    /// Readings of other instants than the tags: then no lens or link is searched for.
    unpaired: Option<MisreadReadings>,
}

/// Result of a round of the calibration.
enum Round {
    /// Clock, survey or nominal model changed: the views for the next round.
    Revised(Vec<View>),
    Done(Box<Calibration>),
}

/// A change of the views for the next round.
enum Otherwise {
    /// Joint readings are shifted by the offset of their clock.
    ReadLater { offset_s: f64 },
    /// Survey or nominal model changed, and with them the tags' sizes.
    Resized,
}

/// Callback that receives an estimate and its input.
pub(crate) type EstimateListener<'a> = dyn FnMut(&BundleInput<'_>, &Estimate<'_>) + 'a;

/// An estimate, and the setup and failures that it was made under.
struct Estimated<'a> {
    setup: &'a BundleSetup,
    failures: &'a [Failure],
    estimate: Estimate<'a>,
    selections: Vec<Selection>,
    /// Innovations of the measured lengths against the views.
    lengths: Vec<LengthInnovation>,
    touches: Option<Touched<'a>>,
}

/// Effect of touches on an estimate.
struct Touched<'a> {
    /// The estimate by the views only.
    before: Estimate<'a>,
    update: TouchUpdate,
}

impl<'a> Estimated<'a> {
    fn by_views(&self) -> &Estimate<'a> {
        self.touches.as_ref().map_or(&self.estimate, |touched| &touched.before)
    }
}

/// Derived results of an estimate, before the verdict.
struct Diagnosis {
    /// The views, with estimated angles where no sensor reads them.
    views: Vec<View>,
    held_out: HeldOutMetrics,
    innovations: Vec<Innovations>,
    /// The arm with camera, tags and sensors as estimated.
    robot: Robot,
    covariance: ParameterCovariance,
}

impl<'a> BundleCalibration<'a> {
    /// Maps the tags whose place nobody surveyed.
    ///
    /// # Errors
    /// [`CalibError::Map`] where the views make no map.
    pub(crate) fn new(
        mut data: CalibrationData,
        prior: Option<&'a Calibration>,
        purpose: EstimatePurpose,
    ) -> Result<Self, CalibError> {
        let surveyed = data.robot.tags.clone();
        let views = data.data.fit.iter().chain(&data.data.held_out);
        let seen: BTreeSet<usize> = views.flat_map(|view| view.tags.iter().map(|tag| tag.tag_idx)).collect();
        count_as_independent(&mut data.robot, |tag| seen.contains(&tag));
        // `bundle` estimates the tags itself: the map is only its initial guess.
        let mapped = map_unknown_tags(&data.name, &mut data.data, &data.robot)?;
        let map = mapped.map(|mapped| {
            data.robot = mapped.start(&data.robot);
            mapped.result
        });
        let held_out = std::mem::take(&mut data.data.held_out);
        data.data.fit.extend(held_out);
        let moved = MovedTags::new(&data.robot);
        Ok(Self {
            data,
            prior,
            map,
            surveyed,
            purpose,
            moved,
            drawing: Drawing::default(),
            clock: None,
            listener: None,
            as_read: Vec::new(),
            unpaired: None,
        })
    }

    pub(crate) fn with_listener(self, listener: &'a mut EstimateListener<'a>) -> Self {
        Self { listener: Some(listener), ..self }
    }

    /// # Errors
    /// [`CalibError`] where the views determine nothing, or an interim estimate contradicts itself.
    pub(crate) fn calibrate(mut self) -> Result<Calibration, CalibError> {
        let mut views = std::mem::take(&mut self.data.data.fit);
        loop {
            match self.round(views)? {
                Round::Revised(otherwise) => views = otherwise,
                Round::Done(calibration) => return Ok(*calibration),
            }
        }
    }

    /// Runs one round: the first estimate, then the stages in their order.
    fn round(&mut self, mut views: Vec<View>) -> Result<Round, CalibError> {
        let sizes_m: Vec<f64> = self.data.robot.tags.iter().map(|tag| tag.size_m).collect();
        let declared = declared(&self.data.robot, &views);
        let setup = |failures: &[Failure]| self.setup(&views, failures);
        let first = setup(&declared);
        self.check_observable(&first, &declared)?;
        self.check_declared(&views, &declared)?;
        let estimated = self.first_estimate(&first);
        let found = estimated.as_ref().map(|(estimate, _)| estimate);
        let unpaired = found.and_then(|found| self.find_unpaired(found, &views));
        let searched = found.filter(|_| unpaired.is_none());
        if let Some(drawing) = searched.and_then(|found| self.lens_that_fits(&first.input(), found)) {
            self.drawing = drawing;
            return Ok(Round::Revised(views));
        }
        let failures = self.failures(&views, &declared, found);
        let second;
        let (setup, estimated) = if failures == declared {
            (&first, estimated)
        } else {
            second = setup(&failures);
            (&second, second.estimate())
        };
        let (estimate, selections) = estimated.ok_or_else(|| self.nothing_observable())?;
        // A dead sensor explains readings without any relation to the camera, too.
        let unpaired = unpaired.filter(|_| is_suspicious(&estimate));
        let mut estimated =
            Estimated { setup, failures: &failures, estimate, selections, lengths: Vec::new(), touches: None };
        if self.purpose == EstimatePurpose::Final {
            let revisions: &[_] = if unpaired.is_none() { &Self::REVISIONS } else { &[] };
            if let Some(otherwise) = revisions.iter().find_map(|revise| revise(self, &estimated)) {
                drop(estimated);
                otherwise.take(&mut views, &sizes_m, &self.data.robot);
                return Ok(Round::Revised(views));
            }
            for refine in Self::REFINEMENTS {
                estimated = refine(self, estimated);
            }
        }
        (self.as_read, self.unpaired) = (views, unpaired);
        self.finish(estimated).map(|calibration| Round::Done(Box::new(calibration)))
    }

    /// Searches for a cause that needs a new estimate. The first one with a result ends the round.
    const REVISIONS: [fn(&mut Self, &Estimated<'_>) -> Option<Otherwise>; 2] =
        [Self::find_clock, Self::revise_survey_and_drawing];

    /// Additions to the estimate of the last round.
    const REFINEMENTS: [for<'e> fn(&Self, Estimated<'e>) -> Estimated<'e>; 3] =
        [Self::add_walks, Self::add_lengths, Self::add_touches];

    /// Checks and reports. Each one reads the results of those before it; the last may put another cause first.
    const STATEMENTS: [fn(&Self, &Estimated<'_>, &Diagnosis, &mut Calibration); 6] = [
        Self::judge_by_views,
        Self::judge_by_touches,
        Self::state_reservations,
        Self::report_moved_tags,
        Self::report_drawing,
        Self::blame_input,
    ];

    fn setup(&self, views: &[View], failures: &[Failure]) -> BundleSetup {
        let setup = BundleSetup::new(&self.data.robot, views, failures, self.prior);
        setup.with_drawing(&self.drawing).with_clocks(self.clocks())
    }

    fn clocks(&self) -> Clocks {
        if self.clock.is_some() { Clocks::Aligned } else { Clocks::AsStamped }
    }

    fn failures(&self, views: &[View], declared: &[Failure], first: Option<&Estimate<'_>>) -> Vec<Failure> {
        match self.purpose {
            EstimatePurpose::Final => {
                let (robot, prior, drawing) = (&self.data.robot, self.prior, &self.drawing);
                FailureSearch { robot, views, prior, drawing }.failures(declared, first)
            }
            EstimatePurpose::Interim => declared.to_vec(),
        }
    }

    fn add_walks<'e>(&self, mut estimated: Estimated<'e>) -> Estimated<'e> {
        let setup = estimated.setup;
        let (estimate, walks) = estimated.estimate.with_walks(&setup.input(), |joint| !setup.has_no_sensor(joint));
        estimated.selections.extend(walks);
        Estimated { estimate, ..estimated }
    }

    fn add_lengths<'e>(&self, estimated: Estimated<'e>) -> Estimated<'e> {
        let lengths = length_innovations(&estimated.estimate);
        let estimate = estimated.estimate.with_lengths(&estimated.setup.input(), &lengths);
        Estimated { estimate, lengths, ..estimated }
    }

    /// Adds the touches, if there are enough and every joint up to the tool has a sensor.
    fn add_touches<'e>(&self, mut estimated: Estimated<'e>) -> Estimated<'e> {
        let (robot, touches) = (&self.data.robot, &self.data.data.touches);
        let has_sensors = (0..robot.tool.mount.n_joints).all(|joint| !estimated.setup.has_no_sensor(joint));
        if let Some(update) = estimated.estimate.touch_update(touches).filter(|_| has_sensors) {
            let updated = estimated.estimate.with_touches(&update);
            let before = std::mem::replace(&mut estimated.estimate, updated);
            estimated.touches = Some(Touched { before, update });
        }
        estimated
    }

    fn finish(&mut self, mut estimated: Estimated<'_>) -> Result<Calibration, CalibError> {
        if let Some(listener) = self.listener.take() {
            listener(&estimated.setup.input(), estimated.by_views());
        }
        // Joints that no sensor read at a rest keep their stowed angle.
        for failure in estimated.failures.iter().filter(|failure| failure.has_no_sensor_now()) {
            let stowed_rad = self.data.robot.stowed[failure.joint];
            self.data.data.rests.values_mut().for_each(|rest| rest[failure.joint] = stowed_rad);
        }
        let diagnosis = self.diagnose(&mut estimated);
        let estimated = &estimated;
        self.data.data.fit.clone_from(&diagnosis.views);
        let mut calibration = self.report(estimated, &diagnosis);
        self.judge_failures_and_prior(estimated, &diagnosis, &mut calibration);
        match self.purpose {
            EstimatePurpose::Interim if !estimated.estimate.is_consistent() => {
                let problem = "the views contradict each other or the prior".to_owned();
                return Err(CalibError::NoInterimEstimate { recording: self.data.name.clone(), problem });
            }
            EstimatePurpose::Interim => {}
            EstimatePurpose::Final => {
                Self::STATEMENTS.iter().for_each(|state| state(self, estimated, &diagnosis, &mut calibration));
            }
        }
        Ok(calibration)
    }

    /// Checks the estimate by the views.
    fn judge_by_views(&self, estimated: &Estimated<'_>, diagnosis: &Diagnosis, calibration: &mut Calibration) {
        let input = &BundleInput { views: &diagnosis.views, ..estimated.setup.input() };
        let (found, innovations, lengths) = (estimated.by_views(), &diagnosis.innovations[..], &estimated.lengths[..]);
        let (task, tag_noise) = (self.data.data.task_rests(), self.data.data.tag_noise);
        VerdictInput { input, found, innovations, lengths, task, tag_noise }.judge(calibration);
    }

    fn judge_by_touches(&self, estimated: &Estimated<'_>, _: &Diagnosis, calibration: &mut Calibration) {
        if let Some(touched) = &estimated.touches {
            touched.update.judge(&self.data.robot, calibration);
        }
    }

    fn report_moved_tags(&self, estimated: &Estimated<'_>, _: &Diagnosis, calibration: &mut Calibration) {
        self.moved.report(&estimated.estimate, calibration);
    }

    fn report_drawing(&self, estimated: &Estimated<'_>, diagnosis: &Diagnosis, calibration: &mut Calibration) {
        let found = estimated.by_views();
        let task = self.data.data.task_rests();
        let targets = task.map(|task| task_angles(&diagnosis.robot, task)).unwrap_or_default();
        let at = if targets.is_empty() { found.view_angles() } else { targets };
        let input = estimated.setup.input();
        let of_better_model = |&camera: &usize| Some((camera, of_better_model(&input, camera)?));
        let models: Vec<_> = self.drawing.lenses.iter().filter_map(of_better_model).collect();
        found.report_drawing(&self.drawing, &models, &at, calibration);
    }

    fn lens_that_fits(&self, input: &BundleInput<'_>, found: &Estimate<'_>) -> Option<Drawing> {
        let is_final = self.purpose == EstimatePurpose::Final;
        is_final.then(|| lens_that_fits(&self.drawing, input, found)).flatten()
    }

    /// Takes the offset between the clocks when an estimate has it for the first time. From then on the readings of all
    /// views are at the times of the images.
    fn find_clock(&mut self, estimated: &Estimated<'_>) -> Option<Otherwise> {
        if self.clock.is_some() {
            return None;
        }
        let [offset_s, _] = estimated.estimate.time_offset_s()?;
        let mut selections = estimated.selections.iter();
        let decided = selections.find(|selection| selection.term == OptionalTerm::TimeOffset)?;
        self.clock = Some((offset_s, *decided));
        Some(Otherwise::ReadLater { offset_s })
    }

    /// Revises survey or nominal model, if a change explains the views better.
    fn revise_survey_and_drawing(&mut self, estimated: &Estimated<'_>) -> Option<Otherwise> {
        let Estimated { setup, estimate, .. } = estimated;
        let by_moved_tag = self.moved.gain_nats(estimate);
        if let Some(better) = self.drawing.better(&setup.input(), estimate, by_moved_tag) {
            self.drawing.apply_new_faults(&better, &mut self.data.robot);
            self.moved.resurveyed(&mut self.data.robot, &better);
            self.drawing = better;
            return Some(Otherwise::Resized);
        }
        let is_revised = self.moved.revise(estimate, setup.input().views, &mut self.data.robot);
        is_revised.then_some(Otherwise::Resized)
    }

    fn nothing_observable(&self) -> CalibError {
        CalibError::nothing_observable(&self.data.name, &self.data.robot)
    }

    fn check_observable(&self, setup: &BundleSetup, declared: &[Failure]) -> Result<(), CalibError> {
        let n = self.data.robot.n_seen_joints();
        let has_columns = setup.input().model.joints.iter().take(n).any(|kinds| !kinds.is_empty());
        if has_columns || !declared.is_empty() { Ok(()) } else { Err(self.nothing_observable()) }
    }

    /// Checks that no joint is declared locked which the views show in motion.
    fn check_declared(&self, views: &[View], declared: &[Failure]) -> Result<(), CalibError> {
        let (robot, prior, drawing) = (&self.data.robot, self.prior, &self.drawing);
        let search = FailureSearch { robot, views, prior, drawing };
        let is_final = self.purpose == EstimatePurpose::Final;
        let found = is_final.then(|| search.moves_though_locked(declared)).flatten();
        found.map_or(Ok(()), |(joint, moved_rad)| {
            let sensor = &robot.sensors[joint];
            let (recording, joint) = (self.data.name.clone(), sensor.joint.clone());
            Err(CalibError::DeclaredLocked { recording, joint, moved: sensor.unit().shown(moved_rad, 0) })
        })
    }

    fn first_estimate<'b>(&self, setup: &'b BundleSetup) -> Option<(Estimate<'b>, Vec<Selection>)> {
        if self.purpose == EstimatePurpose::Final {
            return setup.estimate();
        }
        let has_evidence = setup.applied.views.len() >= MIN_VIEWS_FOR_EVIDENCE;
        let evidence = if has_evidence { HyperparameterMode::Fitted } else { HyperparameterMode::Given };
        estimate(&BundleInput { evidence, ..setup.input() }).map(|estimate| (estimate, Vec::new()))
    }

    /// Computes the held-out figures, the arm as estimated, and the covariance of its sensors.
    fn diagnose(&self, estimated: &mut Estimated<'_>) -> Diagnosis {
        let Estimated { setup, estimate, .. } = estimated;
        let robot = &self.data.robot;
        let without_failed = setup.without_failed(&estimate.parameters());
        let mut with_steps = setup.with_estimated_angles(estimate, &without_failed);
        let mut datasheet = setup.applied.robot.clone();
        estimate.give_lenses(&mut datasheet);
        with_steps.iter_mut().for_each(|view| estimate.see_through_found_lens(view, &datasheet));
        let input = BundleInput { views: &with_steps, ..setup.input() };
        let (held_out, innovations) = match self.purpose {
            EstimatePurpose::Final => cross_validate_with_innovations(&input, estimate, &datasheet),
            EstimatePurpose::Interim => (FoldSums::default().metrics(), Vec::new()),
        };
        let views = estimate.as_read_now(&with_steps);
        estimate.widen(&innovations, &setup.input().scales);
        estimate.widen_unusual();
        let parameters = estimate.joint_parameters().to_vec();
        let residual_std_rad = std::array::from_fn(|joint| match robot.sensors.get(joint) {
            // A joint distal to the camera has only its datasheet.
            Some(spec) if parameters.iter().all(|p| p.joint != joint) => spec.linearity_std_rad,
            _ => estimate.residual_std_rad(joint),
        });
        let matrix = estimate.joint_covariance();
        let all = ParameterCovariance { parameters, matrix, residual_std_rad: Some(residual_std_rad) };
        let covariance = all.without(|parameter| parameter.is_past());
        Diagnosis { robot: estimate.as_found(&setup.applied.robot), views, held_out, innovations, covariance }
    }

    /// Returns the tables of the result, with the verdict from the checks that all methods share.
    fn report(&mut self, estimated: &Estimated<'_>, diagnosis: &Diagnosis) -> Calibration {
        let Estimated { setup, estimate, selections, .. } = estimated;
        for outlier in &estimate.outliers {
            if outlier.corner.is_none() {
                self.data.data.reject(ObservationRejection::Outlier, 1);
            }
            tracing::debug!("view {}: tag {} rejected, corner {:?}", outlier.view_idx, outlier.tag_id, outlier.corner);
        }
        let datasheet = &self.data.robot;
        let robot = Robot { sensors: with_datasheets(&diagnosis.robot, datasheet, setup), ..diagnosis.robot.clone() };
        let solution = Solution {
            parameters: setup.without_failed(&estimate.parameters()),
            outcome: estimate.outcome(),
            evaluations: estimate.iterations,
            cost_initial: estimate.cost_initial,
            cost_final: estimate.cost_final,
        };
        let covariance = setup.without_failed_rows(&diagnosis.covariance);
        let problem = PositionProblem::new(&robot, &diagnosis.views);
        let source = self.provenance(&robot);
        let fit = Fit { problem: &problem, solution: &solution, covariance: &covariance, linearity_scale: 1.0 };
        let parameters = estimate.parameters();
        let evidence = Evidence {
            held_out: diagnosis.held_out.clone(),
            predicted: self.impact(estimated, diagnosis, &parameters).prediction(),
            n_parameters: setup.n_wanted(datasheet),
            has_failed_joint: !estimated.failures.is_empty(),
        };
        let mut model = model_table(datasheet, estimate, selections);
        if let Some((offset_s, decided)) = &self.clock {
            add_clock(&mut model, *offset_s, decided);
        }
        let mut calibration = assemble(&source, &fit, evidence);
        let n_corners = estimate.outliers.iter().filter(|outlier| outlier.corner.is_some()).count();
        calibration.fit.rejected_corners = (n_corners > 0).then_some(n_corners);
        estimate.complete(&mut calibration.details);
        let kept = &calibration.covariance.parameters;
        let with_mount = covariance_with_mount(&robot, estimate, kept);
        Calibration {
            unobservable: grouped_names(&robot, &unobservable(datasheet, setup, estimate)),
            camera_mount: Some(camera_mount_table(datasheet, estimate, &diagnosis.views)),
            further_camera: further_camera_tables(datasheet, estimate, &diagnosis.views),
            lens: lens_tables(datasheet, estimate),
            model: Some(model),
            map: self.map.clone().map(|map| map_table(map, datasheet, estimate)),
            outliers: estimate.outliers.iter().map(|outlier| outlier_name(outlier, &diagnosis.views)).collect(),
            covariance: with_mount.unwrap_or_else(|| calibration.covariance.clone()),
            ..calibration
        }
    }

    fn provenance<'b>(&'b self, robot: &'b Robot) -> Provenance<'b> {
        Provenance {
            messages_hash: &self.data.messages_hash,
            robot,
            method: Method::Bundle,
            data: &self.data.data,
            prior: self.prior,
            identified: &self.data.identified,
        }
    }

    fn impact<'b>(
        &'b self,
        estimated: &'b Estimated<'_>,
        diagnosis: &'b Diagnosis,
        parameters: &'b JointParameters,
    ) -> FailureImpact<'b> {
        FailureImpact {
            datasheet: &self.data.robot,
            robot: &diagnosis.robot,
            views: &diagnosis.views,
            as_read: &self.as_read,
            failures: estimated.failures,
            found: &estimated.estimate,
            parameters,
            covariance: &diagnosis.covariance,
            task: self.data.data.task_rests(),
        }
    }

    /// Writes failed joints and prior to the result, and refuses it where they ask for it.
    fn judge_failures_and_prior(
        &self,
        estimated: &Estimated<'_>,
        diagnosis: &Diagnosis,
        calibration: &mut Calibration,
    ) {
        let parameters = estimated.estimate.parameters();
        let impact = self.impact(estimated, diagnosis, &parameters);
        calibration.failed_joint = impact.tables();
        calibration.findings.extend(impact.findings());
        estimated.setup.forget_failed(calibration, &self.data.robot);
        let (consistency, mut refusals) = self.prior_consistency(estimated.setup);
        calibration.prior = self.prior.zip(consistency).map(|(prior, consistency)| {
            prior_table(prior, estimated.setup.elapsed_h(), &consistency, &self.data.robot)
        });
        refusals.extend(impact.refusals());
        calibration.refuse_first_for(refusals);
    }

    /// Writes the parts that depend on priors only, and refuses the result where they may exceed the task's tolerance.
    fn state_reservations(&self, estimated: &Estimated<'_>, diagnosis: &Diagnosis, calibration: &mut Calibration) {
        let parameters = estimated.estimate.parameters();
        let touches = estimated.touches.as_ref().map(|touched| &touched.update);
        let dof = noise_dof(&diagnosis.views, estimated.setup.n_wanted(&self.data.robot));
        let by_priors =
            |at: &[JointAngles], median_m: f64| estimated.by_views().prior_impact_with(touches, at, median_m);
        let Some(by_data) = self.impact(estimated, diagnosis, &parameters).prediction() else {
            if self.data.data.task.is_some() {
                // No target is within reach: all of them are reported.
                return;
            }
            // Without a task the configurations of the views replace it, and there is no limit.
            let views = estimated.estimate.view_angles();
            let sensors = parameters.sensors(&diagnosis.robot);
            let by_data = views.iter().map(|at| diagnosis.covariance.tool_position_m2(&diagnosis.robot, &sensors, at));
            let by_data: Vec<Matrix3<f64>> = by_data.collect();
            let errors: Vec<f64> = by_data.iter().map(|m2| m2.trace().max(0.0).sqrt()).collect();
            let median_m = Summary::of(&errors).map_or(0.0, |summary| summary.median);
            let by_priors = by_priors(&views, median_m);
            let both = by_data.into_iter().zip(&by_priors.covariances_m2).enumerate();
            let errors = both.map(|(index, (by_data_m2, by_priors_m2))| TargetError {
                index,
                by_data_m2,
                by_priors_m2: *by_priors_m2,
            });
            calibration.u95 =
                U95Table::of_configurations(&errors.collect::<Vec<_>>(), dof).without(&by_priors.not_included);
            calibration.reservations = by_priors.told();
            return;
        };
        let targets: Vec<JointAngles> = by_data.targets.iter().map(|target| target.angles).collect();
        let by_priors = by_priors(&targets, by_data.error_m.median);
        let both = by_data.targets.iter().zip(&by_priors.covariances_m2);
        let errors = both.map(|(at, by_priors_m2)| TargetError {
            index: at.target_idx,
            by_data_m2: at.covariance_m2,
            by_priors_m2: *by_priors_m2,
        });
        let errors: Vec<TargetError> = errors.collect();
        let not_included = by_priors.not_included.clone();
        calibration.predicted_tool_error_with_priors_m = calibration.details.keep_with_priors(&errors, dof);
        calibration.reservations = by_priors.told();
        let Some(task) = &self.data.data.task else { return };
        let by_data_alone = std::mem::replace(
            &mut calibration.u95,
            U95Table::of_task(task.targets_m.len(), task.tolerance_m, (&errors, dof), |index| {
                let is_kept = !estimated.failures.is_empty() && is_near(&diagnosis.robot, &task.targets_m[index]);
                if is_kept { Code::SensorFailed } else { Code::TargetOutOfReach }
            })
            .without(&not_included),
        );
        let most = calibration.reservations.first().map(|reservation| reservation.what.clone());
        calibration.refuse_for(refusal_by_priors(&by_data_alone, &calibration.u95, most));
        calibration.restate_risk();
        let keys_at = |index| {
            let target = by_data.targets.iter().find(|target| target.target_idx == index);
            let keys = |target: &TargetPrediction| {
                estimated.by_views().keys_that_hold(&target.angles, target.covariance_m2.trace())
            };
            target.map_or_else(Vec::new, keys)
        };
        calibration.advise_survey(keys_at, &diagnosis.robot);
    }

    /// Returns the consistency of the views with the prior, and the refusals for it.
    fn prior_consistency(&self, setup: &BundleSetup) -> (Option<PriorConsistency>, Vec<Refusal>) {
        // Another path to the same views, as from several recordings, changes their hash but not their end time.
        let last = self.data.data.fit.iter().map(|view| view.end.nanos).max();
        let is_reused = self.prior.is_some_and(|prior| {
            prior.messages_hash == self.data.messages_hash || Some(prior.valid.time_nanos) == last
        });
        let mut refusals: Vec<Refusal> = is_reused.then_some(Refusal::PriorReused).into_iter().collect();
        let consistency = match setup.prior() {
            None => None,
            Some(Err(refusal)) => {
                refusals.push(refusal.clone());
                None
            }
            Some(Ok(prior)) => {
                let consistency = prior.consistency(&setup.applied.views);
                match &consistency {
                    None => refusals.push(Refusal::PriorUntested),
                    Some(consistency) => refusals.extend(consistency.refusal(&self.data.robot)),
                }
                consistency
            }
        };
        (consistency, refusals)
    }
}

impl Otherwise {
    /// Applies the change to `views`; `sizes_m` are the tags' sizes before the change.
    fn take(self, views: &mut [View], sizes_m: &[f64], robot: &Robot) {
        match self {
            Self::ReadLater { offset_s } => views.iter_mut().for_each(|view| view.read_later(offset_s)),
            Self::Resized => rescale(views, sizes_m, robot),
        }
    }
}

/// Scales the tag centres in the camera's frame from the old sizes, `sizes_m`, to the present sizes.
fn rescale(views: &mut [View], sizes_m: &[f64], robot: &Robot) {
    for seen in views.iter_mut().flat_map(|view| &mut view.tags).filter(|seen| seen.corners().is_some()) {
        seen.center_in_camera_m *= robot.tags[seen.tag_idx].size_m / sizes_m[seen.tag_idx];
    }
}
