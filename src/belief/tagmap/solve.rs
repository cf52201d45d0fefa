//! Steps from the views to a map.

use std::borrow::Cow;

use crate::tagmap::adjust::{approach, finish, select};
use crate::tagmap::assemble::assemble;
use crate::tagmap::attitude::{self, Wanted};
use crate::tagmap::check::check;
use crate::tagmap::constants::solve::{MAX_ROUNDS, MIN_FREEDOM, MUCH_WORSE};
use crate::tagmap::contradictions::contradictions;
use crate::tagmap::groups::{Group, build};
use crate::tagmap::initial_guess::lay_out;
use crate::tagmap::localize::{localize, place_tag, tag_cost, view_cost};
use crate::tagmap::problem::{MapProblem, Observation};
use crate::tagmap::result::TagMap;
use crate::tagmap::scale::{self, ScaleWarning};
use crate::tagmap::screen::{Screened, screen};
use crate::tagmap::types::{MapInput, MapSettings, NoiseScale, TagMapError};
use crate::tagmap::{adjust, linearize};
use armcal_core::codes::{Code, Warning};
use armcal_core::numeric::Loss;

/// Estimates the poses of the tags by bundle adjustment on the corner pixels of all views (Triggs et al. 2000).
///
/// The only inputs are the views, the tags' sizes and the places of some tags. The result does not depend on the order
/// of views, tags or detections.
///
/// # Errors
/// [`TagMapError`] if the input makes no sense, or shows no tag that could anchor the map.
pub fn solve(input: &MapInput<'_>, settings: &MapSettings) -> Result<TagMap, TagMapError> {
    Ok(Solved::of(input, settings)?.map())
}

/// A problem at its solution.
pub(super) struct Solved<'a> {
    pub(super) input: MapInput<'a>,
    pub(super) problem: MapProblem<'a>,
    pub(super) groups: Vec<Group>,
    /// Factor of the corners' standard deviations.
    pub(super) noise_scale: f64,
    screened: Screened,
    has_converged: bool,
    scale_warnings: Vec<ScaleWarning>,
    warnings: Vec<Warning>,
    contradictions: Vec<Warning>,
}

impl<'a> Solved<'a> {
    pub(super) fn of(input: &MapInput<'a>, settings: &MapSettings) -> Result<Self, TagMapError> {
        check(input, settings)?;
        let mut screened = screen(input, settings);
        if screened.observations.is_empty() {
            return Err(nothing_left(&screened));
        }
        let scale_warnings = scale::check(input, &screened);
        let layout = lay_out(input.cameras, &screened.observations, &screened.tags, input.bodies, settings);
        for (tag, pose) in screened.tags.iter_mut().zip(&layout.pose) {
            tag.pose = *pose;
        }
        let mut problem = MapProblem {
            cameras: Cow::Borrowed(input.cameras),
            observations: std::mem::take(&mut screened.observations),
            tags: std::mem::take(&mut screened.tags),
            blocks: Vec::new(),
            extras: Vec::new(),
            links: Vec::new(),
            n_nodes: 0,
            steps_left: adjust::MAX_STEPS,
        };
        let setting_up = ProblemBuilder { input, settings, screened: &screened, label: &layout.label };
        let (groups, noise_scale, has_converged) = setting_up.adjust(&mut problem);
        if !problem.observations.iter().any(|seen| seen.is_used) {
            return Err(nothing_left(&screened));
        }
        let warnings = layout.warnings.into_iter().chain(contradiction(&problem)).collect();
        let contradictions = contradictions(input, settings, &problem);
        let input = *input;
        Ok(Self {
            contradictions,
            input,
            problem,
            groups,
            noise_scale,
            screened,
            has_converged,
            scale_warnings,
            warnings,
        })
    }

    pub(super) fn map(&self) -> TagMap {
        let mut map = assemble(&self.input, &self.screened, &self.problem, &self.groups, self.noise_scale);
        map.has_converged = self.has_converged;
        map.scale_warnings.clone_from(&self.scale_warnings);
        map.is_contradicted = !self.contradictions.is_empty();
        map.warnings.extend(self.warnings.iter().chain(&self.contradictions).cloned());
        map
    }
}

/// Warning that the steps were used up; `None` if they were not.
fn contradiction(problem: &MapProblem<'_>) -> Option<Warning> {
    let n = adjust::MAX_STEPS;
    let what = format!("the views contradict each other: after {n} steps the map still moved, and no more are made");
    (problem.steps_left == 0).then(|| Warning::new(Code::MapNotConverged, what))
}

fn nothing_left(screened: &Screened) -> TagMapError {
    let mut counts = std::collections::BTreeMap::<_, usize>::new();
    for rejected in &screened.rejected {
        *counts.entry(rejected.reason).or_default() += 1;
    }
    let reasons: Vec<String> = counts.iter().map(|(reason, n)| format!("{} {n}", reason.name())).collect();
    TagMapError::NothingLeft { rejected: screened.n_detections, reasons: reasons.join(", ") }
}

struct ProblemBuilder<'a, 'b> {
    input: &'b MapInput<'a>,
    settings: &'b MapSettings,
    screened: &'b Screened,
    label: &'b [usize],
}

impl ProblemBuilder<'_, '_> {
    /// Solves from the layout; returns the groups, the factor of the corners' noise, and true if the solution
    /// converged.
    fn adjust(&self, problem: &mut MapProblem<'_>) -> (Vec<Group>, f64, bool) {
        let mut groups = self.build(problem);
        approach(problem);
        for _ in 0..3 {
            if problem.steps_left == 0 || !repair(problem) {
                break;
            }
            approach(problem);
        }
        let mut has_converged = false;
        for _ in 0..MAX_ROUNDS {
            let changed = select(problem, self.settings.reject_beyond_sigmas);
            if changed {
                groups = self.build(problem);
            }
            has_converged = finish(problem);
            if !changed || problem.steps_left == 0 {
                break;
            }
        }
        let noise_scale = match self.settings.noise {
            NoiseScale::Given => 1.0,
            NoiseScale::Estimated => rescale(problem),
        };
        if noise_scale != 1.0 {
            has_converged = finish(problem);
        }
        (groups, noise_scale, has_converged)
    }

    /// Builds groups, unknowns and attitude links for the observations in use.
    fn build(&self, problem: &mut MapProblem<'_>) -> Vec<Group> {
        let groups = build(problem, self.label, self.input.bodies, self.settings);
        let Some(moving) = self.settings.attitude_body else { return groups };
        let attitudes: Vec<_> = self.screened.views.iter().map(|view| view.attitude).collect();
        let body_of = |group: &Group| problem.tags[group.tags[0]].body;
        let of_moving = groups.iter().position(|group| body_of(group) == moving);
        let of_static = groups.iter().position(|group| {
            let body = body_of(group);
            body != moving && self.input.bodies[body].is_static
        });
        if let (Some(moving_group), Some(fixed_group)) = (of_moving, of_static) {
            let information = self.settings.attitude_std_rad.powi(-2);
            attitude::link(problem, &attitudes, &Wanted { moving_group, fixed_group, information });
        }
        groups
    }
}

/// Finds cameras and tags that converged to a wrong pose (mostly the mirror image), and moves them where their images
/// fit better. Returns true if there were any.
fn repair(problem: &mut MapProblem<'_>) -> bool {
    let mut changed = false;
    for idx in 0..problem.blocks.len() {
        let block = &problem.blocks[idx];
        let seen: Vec<(&Observation, _)> =
            problem.observations[block.range.clone()].iter().map(|seen| (seen, problem.tags[seen.tag].pose)).collect();
        let now = view_cost(&problem.cameras, &seen, &block.pose);
        if let Some((pose, misfit)) = localize(&problem.cameras, &seen)
            && misfit * MUCH_WORSE < now
        {
            problem.blocks[idx].pose = pose;
            changed = true;
        }
    }
    let mut images = vec![Vec::new(); problem.tags.len()];
    for block in &problem.blocks {
        for at in block.range.clone() {
            images[problem.observations[at].tag].push((&problem.observations[at], block.pose));
        }
    }
    let mut moved = Vec::new();
    for (idx, tag) in problem.tags.iter().enumerate().filter(|(_, tag)| tag.node.is_some()) {
        let now = tag_cost(&problem.cameras, &images[idx], &tag.pose);
        if let Some((pose, misfit)) = place_tag(&problem.cameras, &images[idx])
            && misfit * MUCH_WORSE < now
        {
            moved.push((idx, pose));
        }
    }
    changed |= !moved.is_empty();
    for (idx, pose) in moved {
        problem.tags[idx].pose = pose;
    }
    changed
}

/// Scales the corners' standard deviations to the residuals; returns the factor.
fn rescale(problem: &mut MapProblem<'_>) -> f64 {
    let freedom = adjust::degrees_of_freedom(problem);
    if freedom < MIN_FREEDOM {
        return 1.0;
    }
    let chi_square = linearize::cost(problem, Loss::Square);
    let scale = (chi_square / freedom as f64).sqrt().max(1e-6);
    for seen in &mut problem.observations {
        for whiten in &mut seen.whiten {
            *whiten /= scale;
        }
    }
    scale
}
