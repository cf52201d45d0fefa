//! Tags that were found moved: freed of their survey, estimated with the rest, and reported.

use crate::calib::bundle::drawing::Drawing;
use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::tag_identity::TagFault;
use crate::calib::finding::{Finding, FindingKind, FindingUnit};
use crate::calib::result::calibration::Calibration;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::spatial::log;

/// Which tags were freed, and the survey as it was.
pub(crate) struct MovedTags {
    surveyed: Vec<SurveyedTag>,
    freed: Vec<usize>,
    /// More tags than may have moved do not fit: the survey stands, and other tests say what is wrong.
    has_given_up: bool,
}

/// Prior of a freed tag: anywhere.
const FREED_STD_M: f64 = 1.0;
const FREED_STD_RAD: f64 = 1.0;
/// Tags that must stay where the survey has them.
const MIN_TRUSTED: usize = 3;

impl MovedTags {
    pub(crate) fn new(robot: &Robot) -> Self {
        Self { surveyed: robot.tags.clone(), freed: Vec::new(), has_given_up: false }
    }

    /// What freeing the next tag may bring: half of its chi-square, nats; zero where none was moved.
    pub(crate) fn gain_nats(&self, estimate: &Estimate<'_>) -> f64 {
        let moved = (!self.has_given_up).then(|| estimate.moved_tag()).flatten();
        moved.map_or(0.0, |moved| 0.5 * moved.chi2)
    }

    /// Takes over what `drawing` says of tags, so that a freed tag's distance is from there.
    pub(crate) fn resurveyed(&mut self, robot: &Robot, drawing: &Drawing) {
        for fault in &drawing.tags {
            match *fault {
                TagFault::Swapped(pair) => {
                    pair.iter().for_each(|&tag| self.surveyed[tag].base_from_tag = robot.tags[tag].base_from_tag);
                }
                TagFault::Size { .. } | TagFault::AllSizes { .. } => {}
            }
        }
    }

    /// Frees the next tag of `robot` that `estimate` has elsewhere, or takes all of them back; whether it did either.
    pub(crate) fn revise(&mut self, estimate: &Estimate<'_>, robot: &mut Robot) -> bool {
        if self.has_given_up {
            return false;
        }
        let Some(moved) = estimate.moved_tag() else { return false };
        let trusted = robot.tags.iter().filter(|tag| tag.position_std_m < FREED_STD_M).count();
        if self.freed.len() >= robot.tags.len() / 4 || trusted <= MIN_TRUSTED {
            self.has_given_up = true;
            let had_any = !self.freed.is_empty();
            self.freed.clear();
            robot.tags.clone_from(&self.surveyed);
            return had_any;
        }
        let tag = &mut robot.tags[moved.tag_idx];
        (tag.position_std_m, tag.rotation_std_rad) = (FREED_STD_M, FREED_STD_RAD);
        self.freed.push(moved.tag_idx);
        true
    }

    /// Each freed tag as a finding, which refuses nothing.
    pub(crate) fn report(&self, estimate: &Estimate<'_>, calibration: &mut Calibration) {
        for &tag_idx in &self.freed {
            let (pose, _) = estimate.tag(tag_idx);
            let by = log(&self.surveyed[tag_idx].base_from_tag.isometry().inv_mul(&pose));
            let shift_m = by.fixed_rows::<3>(0).norm();
            let id = self.surveyed[tag_idx].id;
            calibration.findings.push(Finding {
                kind: FindingKind::TagMoved,
                name: id.to_string(),
                size: Some(shift_m),
                unit: Some(FindingUnit::Metre),
                tool_error_m: None,
                time_s: None,
                repaired: true,
            });
            let turn_deg = by.fixed_rows::<3>(3).norm().to_degrees();
            let words = format!(
                "tag {id} is {:.1} mm and {turn_deg:.1} deg from its survey: estimated with the rest",
                1e3 * shift_m
            );
            if let Some(verdict) = &mut calibration.verdict {
                verdict.warnings.push(words);
            }
        }
    }
}
