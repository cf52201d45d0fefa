//! Candidates, and the choice among them.

use crate::plan::constants::view_planning_pool::{ANCHORED_EVERY, CANDIDATES_PER_POSE, MIN_CANDIDATES};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::PlanError;
use crate::plan::motion::timing::{SETTLE_S, Timing};
use crate::plan::view_planning::candidates::{Candidate, InfeasibleCounts, Search};
use crate::plan::view_planning::criterion::{DesignObjective, DesignState};
use crate::plan::view_planning::forecast::{Forecast, Task};
use crate::plan::view_planning::parameter_prior::ParameterPrior;
use crate::plan::view_planning::request::{CapturedView, PlannedPose, PosePlan, PoseRequest};
use crate::plan::view_planning::selection::ViewSelector;
use crate::plan::view_planning::view_information::{CornerModel, ViewJacobian, WhitenedView};
use crate::plan::view_planning::visit_order::Tour;
use armcal_core::routine::PoseCriterion;
use armcal_core::streams::{CaptureSet, JointAngles};

/// Candidate poses: they show enough tags and keep clear.
#[derive(Clone, Debug)]
pub struct PosePool {
    candidates: Vec<Candidate>,
    refused: InfeasibleCounts,
}

/// Models on which the value of poses depends.
pub(crate) struct DesignInputs {
    unknowns: ParameterPrior,
    optics: CornerModel,
    timing: Timing,
}

impl DesignInputs {
    pub(crate) fn new(request: &PoseRequest<'_>) -> Self {
        let unknowns = ParameterPrior::of(request);
        let optics = CornerModel::new(request.capture.dwell_s, unknowns.noise);
        Self { unknowns, optics, timing: Timing::new(request.robot) }
    }

    /// Returns the captured views, linearized.
    fn taken(&self, request: &PoseRequest<'_>) -> Vec<ViewJacobian> {
        let look = |view: &CapturedView| {
            let tags: Vec<(usize, f64)> = view.tags.iter().map(|&tag| (tag, 1.0)).collect();
            ViewJacobian::new(request.robot, self.optics, &view.angles, &tags)
        };
        request.taken.iter().map(look).collect()
    }
}

impl PosePool {
    /// Draws until there are `enough`, or no more are found.
    ///
    /// # Errors
    /// [`PlanError::NoUsefulPose`] if there is none, [`PlanError::TooFewTags`] if there can be none.
    pub fn gather(request: &PoseRequest<'_>, enough: usize, rng: &mut ChaCha8Rng) -> Result<Self, PlanError> {
        let (min_tags, n_tags) = (request.capture.min_tags, request.robot.tags.len());
        if n_tags > 0 && min_tags as usize > n_tags {
            return Err(PlanError::TooFewTags { min_tags, n_tags });
        }
        let mut search = Search::new(request);
        let candidates = search.gather(enough, rng);
        let refused = std::mem::take(&mut search.refused);
        if candidates.is_empty() {
            return Err(refused.no_pose(request));
        }
        Ok(Self { candidates, refused })
    }

    /// Number of candidates.
    #[must_use]
    pub fn len(&self) -> usize {
        self.candidates.len()
    }

    /// Returns false: [`Self::gather`] fails instead.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.candidates.is_empty()
    }

    /// Chooses `request.n_fit` views for the fit and `n_held_out` for the verdict, by `request.capture.choose`. It
    /// returns fewer if there are fewer and the capture replans anyway (`capture.replan_every`).
    ///
    /// # Errors
    /// [`PlanError::TooFewPoses`].
    pub fn choose(&self, request: &PoseRequest<'_>, rng: &mut ChaCha8Rng) -> Result<PosePlan, PlanError> {
        let (found, wanted) = (self.candidates.len(), request.n_fit + request.n_held_out);
        if found < wanted && request.capture.replan_every == 0 {
            let (min_tags, hint) = (request.capture.min_tags, self.refused.hint(request));
            return Err(PlanError::TooFewPoses { found, wanted, min_tags, hint });
        }
        let setup = DesignInputs::new(request);
        let tour = Tour { timing: &setup.timing, start: *request.start };
        if request.capture.criterion == PoseCriterion::Random {
            let chosen = self.drawn_evenly(request.n_fit, rng);
            let order = self.ordered(&tour, &chosen, &self.drawn(request.n_held_out, &chosen, rng), Vec::new());
            return Ok(self.plan(request, &setup, order));
        }
        let picker = self.picker(request, &setup);
        let chosen = picker.pick(request.n_fit);
        // If the capture replans soon, the most informative views for their time come first; the rest is a short tour.
        let first = picker.most_informative_first(&chosen, request.capture.replan_every as usize);
        let order = self.ordered(&tour, &chosen, &self.drawn(request.n_held_out, &chosen, rng), first);
        Ok(self.plan(request, &setup, order))
    }

    #[cfg(test)]
    pub(crate) fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    /// Returns the whitened Jacobians of each candidate.
    pub(crate) fn whitened_views(&self, request: &PoseRequest<'_>, setup: &DesignInputs) -> Vec<WhitenedView> {
        let (robot, unknowns) = (request.robot, &setup.unknowns);
        let telling = |Candidate { angles, tags, .. }: &Candidate| {
            ViewJacobian::new(robot, setup.optics, angles, tags)
                .telling(robot, unknowns)
                .unwrap_or_else(WhitenedView::nothing)
        };
        self.candidates.iter().map(telling).collect()
    }

    pub(crate) fn picker<'a>(&'a self, request: &PoseRequest<'_>, setup: &'a DesignInputs) -> ViewSelector<'a> {
        let (robot, unknowns) = (request.robot, &setup.unknowns);
        let anchored_every = if robot.tags.iter().all(|tag| tag.is_known()) { 1 } else { ANCHORED_EVERY };
        let measure = match request.capture.criterion {
            PoseCriterion::ToolError | PoseCriterion::Random => {
                let task = Task::new(request, unknowns);
                let angles: Vec<JointAngles> = self.candidates.iter().map(|candidate| candidate.angles).collect();
                DesignObjective::of_tool(task.with_edges(robot, unknowns.n_joints, &angles), task.floor_m2)
            }
            criterion => DesignObjective::of_sensors(criterion, unknowns),
        };
        let tour = Tour { timing: &setup.timing, start: *request.start };
        let taken: Vec<_> = setup.taken(request).iter().filter_map(|view| view.telling(robot, unknowns)).collect();
        ViewSelector {
            candidates: &self.candidates,
            whitened_views: self.whitened_views(request, setup),
            tour,
            view_s: view_s(request),
            anchored_every,
            design: DesignState::after(measure, unknowns, &taken),
        }
    }

    /// Returns `n` of the candidates drawn uniformly over the joint ranges; of all candidates if these are too few.
    fn drawn_evenly(&self, n: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
        let others: Vec<usize> = (0..self.candidates.len()).filter(|&k| !self.candidates[k].is_even).collect();
        let too_few = self.candidates.len() - others.len() < n;
        self.drawn(n, if too_few { &[] } else { &others }, rng)
    }

    /// Returns `n` candidates at random, none of `but`.
    fn drawn(&self, n: usize, but: &[usize], rng: &mut ChaCha8Rng) -> Vec<usize> {
        let mut left: Vec<usize> = (0..self.candidates.len()).filter(|k| !but.contains(k)).collect();
        (0..n.min(left.len())).map(|_| left.swap_remove(rng.random_range(0..left.len()))).collect()
    }

    /// Returns `first`, then the others by a short tour.
    fn ordered(
        &self,
        tour: &Tour<'_>,
        chosen: &[usize],
        held_out: &[usize],
        first: Vec<usize>,
    ) -> Vec<(CaptureSet, usize)> {
        let set_of = |k: usize| if held_out.contains(&k) { CaptureSet::HeldOut } else { CaptureSet::Fit };
        let rest: Vec<usize> = chosen.iter().chain(held_out).copied().filter(|k| !first.contains(k)).collect();
        let start = first.last().map_or(tour.start, |&k| self.candidates[k].angles);
        let angles: Vec<JointAngles> = rest.iter().map(|&k| self.candidates[k].angles).collect();
        let by_way = Tour { timing: tour.timing, start }.order(&angles);
        first.into_iter().chain(by_way.into_iter().map(|k| rest[k])).map(|k| (set_of(k), k)).collect()
    }

    fn plan(&self, request: &PoseRequest<'_>, setup: &DesignInputs, order: Vec<(CaptureSet, usize)>) -> PosePlan {
        let robot = request.robot;
        let mut forecast = Forecast::new(robot, &setup.unknowns, Task::new(request, &setup.unknowns));
        if let Some(forecast) = &mut forecast {
            setup.taken(request).iter().for_each(|view| forecast.add(view));
        }
        let error_m = |forecast: &Option<Forecast>| {
            forecast.as_ref().map_or(f64::INFINITY, |forecast| forecast.tool_variance_m2().sqrt())
        };
        let tool_error_before_m = error_m(&forecast);
        let (mut predicted_tool_error_m, mut n_fitted, mut needed) = (tool_error_before_m, 0, None);
        let limit_m = request.capture.stop_at_tool_error_m;
        if limit_m.is_some_and(|limit_m| tool_error_before_m <= limit_m) {
            needed = Some(0);
        }
        let mut poses = Vec::with_capacity(order.len());
        for (set, k) in order {
            let Candidate { angles, tags, .. } = &self.candidates[k];
            if set == CaptureSet::Fit {
                if let Some(forecast) = &mut forecast {
                    forecast.add(&ViewJacobian::new(robot, setup.optics, angles, tags));
                }
                predicted_tool_error_m = error_m(&forecast);
                n_fitted += 1;
                if needed.is_none() && limit_m.is_some_and(|limit_m| predicted_tool_error_m <= limit_m) {
                    needed = Some(n_fitted);
                }
            }
            poses.push(PlannedPose { set, angles: *angles, tags: tags.clone(), predicted_tool_error_m });
        }
        let angles: Vec<JointAngles> = poses.iter().map(|pose| pose.angles).collect();
        let tour = Tour { timing: &setup.timing, start: *request.start };
        let arm_time_s = tour.travel_time_s(&angles) + angles.len() as f64 * view_s(request);
        let (candidates, tried) = (self.candidates.len(), self.refused.tried);
        PosePlan { poses, predicted_tool_error_m, tool_error_before_m, needed, arm_time_s, candidates, tried }
    }
}

/// Chooses `n_fit` views for the fit and `n_held_out` for the verdict.
///
/// # Errors
/// [`PlanError::NoUsefulPose`], [`PlanError::TooFewPoses`], [`PlanError::TooFewTags`].
pub fn choose_poses(request: &PoseRequest<'_>, rng: &mut ChaCha8Rng) -> Result<PosePlan, PlanError> {
    let wanted = request.n_fit + request.n_held_out;
    PosePool::gather(request, (wanted * CANDIDATES_PER_POSE).max(MIN_CANDIDATES), rng)?.choose(request, rng)
}

/// Time of a view without the path to it, s.
fn view_s(request: &PoseRequest<'_>) -> f64 {
    SETTLE_S + request.capture.dwell_s
}
