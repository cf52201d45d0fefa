//! Tags that were found moved: freed of their survey, estimated with the rest, and reported.

use crate::explain::constants::tags_freed::{FREED_STD, MIN_TRUSTED};
use nalgebra::{Isometry3, Translation3};

use crate::explain::drawing::Drawing;
use crate::explain::tags::identity::{NEARER, SAME_PLACE_M, TagFault};
use crate::file::calibration::Calibration;
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use crate::solve::estimate::Estimate;
use crate::views::view::View;
use armcal_core::codes::{Coded, Warning};
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::spatial::{Pose, log};
use armcal_core::stats::quantile;

/// Tags that were freed, and the survey as it was.
pub(crate) struct MovedTags {
    surveyed: Vec<SurveyedTag>,
    freed: Vec<usize>,
    /// Tags that were moved together.
    group: Vec<usize>,
    /// True if more tags do not fit than may have moved: the survey stands, and other tests name the cause.
    has_given_up: bool,
}

impl MovedTags {
    pub(crate) fn new(robot: &Robot) -> Self {
        Self { surveyed: robot.tags.clone(), freed: Vec::new(), group: Vec::new(), has_given_up: false }
    }

    /// Predicted evidence gain of freeing the next tag, nats: half of its chi-square; zero if none was moved.
    pub(crate) fn gain_nats(&self, estimate: &Estimate<'_>) -> f64 {
        let moved = (!self.has_given_up).then(|| estimate.moved_tag()).flatten();
        moved.map_or(0.0, |moved| 0.5 * moved.chi2)
    }

    /// Number of tags that are estimated because they are not where the survey has them.
    pub(crate) fn n_moved(&self) -> usize {
        self.freed.iter().chain(&self.group).collect::<std::collections::BTreeSet<_>>().len()
    }

    /// Applies the tag faults in `drawing` to the survey, from which a freed tag's distance is counted.
    pub(crate) fn resurveyed(&mut self, robot: &mut Robot, drawing: &Drawing) {
        for fault in &drawing.tags {
            if let TagFault::Swapped(pair) = fault {
                pair.iter().for_each(|&tag| self.surveyed[tag].base_from_tag = robot.tags[tag].base_from_tag);
            }
            self.group.extend(fault.moved_tag().filter(|tag| !self.group.contains(tag)));
        }
        free(robot, &self.group);
    }

    /// Frees the next tag of `robot` that `estimate` displaces, or returns all of them to the survey. Returns true if
    /// it did either.
    pub(crate) fn revise(&mut self, estimate: &Estimate<'_>, views: &[View], robot: &mut Robot) -> bool {
        if self.has_given_up {
            return false;
        }
        let trusted = robot.tags.iter().filter(|tag| tag.position_std_m < FREED_STD).count();
        let has_room = self.freed.len() < robot.tags.len() / 4 && trusted > MIN_TRUSTED;
        let Some(moved) = estimate.moved_tag() else {
            return has_room && self.free_rejected(estimate, views, robot);
        };
        if !has_room {
            self.has_given_up = true;
            let had_any = !self.freed.is_empty();
            self.freed.clear();
            robot.tags.clone_from(&self.surveyed);
            free(robot, &self.group);
            return had_any;
        }
        free(robot, &[moved.tag_idx]);
        self.freed.push(moved.tag_idx);
        true
    }

    /// Frees a tag whose observations the estimate rejects altogether, starting from where they have it.
    fn free_rejected(&mut self, estimate: &Estimate<'_>, views: &[View], robot: &mut Robot) -> bool {
        let rejected = estimate.rejected_tag(views);
        let is_held = |tag: &usize| !self.freed.contains(tag) && !self.group.contains(tag);
        let Some((tag_idx, place)) = rejected.filter(|(tag_idx, _)| is_held(tag_idx)) else { return false };
        let tag = &mut robot.tags[tag_idx];
        let turn = tag.base_from_tag.isometry().rotation;
        tag.base_from_tag = Pose::from_isometry(Isometry3::from_parts(Translation3::from(place), turn));
        free(robot, &[tag_idx]);
        self.freed.push(tag_idx);
        true
    }

    /// Reports the freed tags as findings, which refuse nothing. Tags in one another's places share one, and so do
    /// those that were moved together. A tag that is left out has its own finding.
    pub(crate) fn report(&self, estimate: &Estimate<'_>, calibration: &mut Calibration) {
        let rings = self.rings(estimate);
        let is_left = |tag: &&usize| !rings.iter().flatten().any(|of_ring| of_ring == *tag);
        let group: Vec<usize> = self.group.iter().filter(is_left).copied().collect();
        let left_out: Vec<usize> = estimate.left_out_tags().map(|(tag, _)| tag).collect();
        let is_alone = |tag: &&usize| !self.group.contains(tag) && !left_out.contains(tag);
        let alone = self.freed.iter().filter(is_alone).filter(is_left).map(std::slice::from_ref);
        let moved = (!group.is_empty()).then_some(&group[..]).into_iter().chain(alone);
        let moved = moved.map(|tags| self.finding(estimate, tags));
        for (finding, words) in rings.iter().map(|ring| self.ring_finding(ring)).chain(moved) {
            if let Some(verdict) = &mut calibration.verdict {
                verdict.warnings.push(Warning::new(finding.code(), words));
            }
            calibration.findings.push(finding);
        }
    }

    /// Freed tags in one another's places: each where the next one is surveyed, the last where the first is.
    pub(crate) fn rings(&self, estimate: &Estimate<'_>) -> Vec<Vec<usize>> {
        let mut left: Vec<usize> = self.group.iter().chain(&self.freed).copied().collect();
        left.sort_unstable();
        left.dedup();
        let surveyed = |tag: usize| self.surveyed[tag].base_from_tag.isometry().translation.vector;
        let next = |tag: usize, of: &[usize]| {
            let found = estimate.tag(tag).0.translation.vector;
            let near_m = |other: &usize| (found - surveyed(*other)).norm();
            let place = of.iter().copied().min_by(|a, b| near_m(a).total_cmp(&near_m(b)))?;
            (near_m(&place) < SAME_PLACE_M && near_m(&place) < NEARER * near_m(&tag)).then_some(place)
        };
        let mut rings = Vec::new();
        while let Some(&first) = left.first() {
            let all = left.clone();
            let ring: Vec<usize> =
                std::iter::successors(Some(first), |tag| next(*tag, &all).filter(|tag| *tag != first))
                    .take(all.len())
                    .collect();
            let is_closed = ring.len() > 1 && ring.last().is_some_and(|last| next(*last, &all) == Some(first));
            left.retain(|tag| *tag != first && !(is_closed && ring.contains(tag)));
            rings.extend(is_closed.then_some(ring));
        }
        rings
    }

    fn ring_finding(&self, ring: &[usize]) -> (Finding, String) {
        let ids: Vec<String> = ring.iter().map(|&tag| self.surveyed[tag].id.to_string()).collect();
        let places = ids.iter().zip(ids.iter().cycle().skip(1)).map(|(id, place)| format!("{id} at {place}'s"));
        let words = format!(
            "tags {} are exchanged ({}); the estimate includes it. Correct the survey",
            list(&ids),
            places.collect::<Vec<_>>().join(", "),
        );
        let (kind, name) = (FindingKind::TagSwapped, list(&ids));
        (Finding { kind, name, size: None, unit: None, tool_error_m: None, time_s: None, repaired: true }, words)
    }

    /// Finding and text on moved tags, with their median distance from the survey. It does not say whether several
    /// moved as one: each is estimated separately.
    fn finding(&self, estimate: &Estimate<'_>, tags: &[usize]) -> (Finding, String) {
        let by = |&tag: &usize| log(&self.surveyed[tag].base_from_tag.isometry().inv_mul(&estimate.tag(tag).0));
        let of_each =
            |first: usize| -> Vec<f64> { tags.iter().map(|tag| by(tag).fixed_rows::<3>(first).norm()).collect() };
        let (shifts_m, turns_rad) = (of_each(0), of_each(3));
        let shift_m = quantile(&shifts_m, 0.5).unwrap_or(0.0);
        let name = list(&tags.iter().map(|&tag| self.surveyed[tag].id.to_string()).collect::<Vec<_>>());
        let (kind, what) = match tags {
            [_] => (FindingKind::TagMoved, format!("tag {name} is")),
            _ => (FindingKind::TagsMoved, format!("tags {name} are")),
        };
        let (shift_mm, turn_deg) = (range(&shifts_m, 1e3), range(&turns_rad, 1f64.to_degrees()));
        let words = format!("{what} {shift_mm} mm and {turn_deg} deg from the survey: estimated with the rest");
        let (size, unit) = (Some(shift_m), Some(FindingUnit::Metre));
        (Finding { kind, name, size, unit, tool_error_m: None, time_s: None, repaired: true }, words)
    }
}

/// Removes the survey's constraint on `tags`.
fn free(robot: &mut Robot, tags: &[usize]) {
    for &tag in tags {
        let tag = &mut robot.tags[tag];
        (tag.position_std_m, tag.rotation_std_rad) = (FREED_STD, FREED_STD);
    }
}

/// Text of a range: `0.3`, or `0.3 to 4.1` if the values differ at that precision.
fn range(values: &[f64], unit: f64) -> String {
    let least = format!("{:.1}", unit * values.iter().copied().fold(f64::INFINITY, f64::min));
    let most = format!("{:.1}", unit * values.iter().copied().fold(0.0, f64::max));
    if least == most { most } else { format!("{least} to {most}") }
}

/// Text of a list: `1, 2 and 3`.
fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
