//! Figures of a run that a campaign keeps: name, unit, direction of worsening, and source in a finished run.

use crate::run::Finished;
use crate::score::{ScoreSide, TargetScore};
use armcal_core::stats::Summary;
use armcal_core::units::Unit;

/// Direction in which a figure gets worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worsening {
    MoreIsWorse,
    LessIsWorse,
}

use Worsening::{LessIsWorse, MoreIsWorse};

struct Facts {
    name: &'static str,
    unit: Unit,
    worsening: Worsening,
    of: fn(&Finished) -> Option<f64>,
}

/// Definition of all metrics, one line each: the only place that needs to know a new one.
macro_rules! metrics {
    ($($metric:ident = $name:literal, $unit:ident, $worsening:ident, $of:expr;)*) => {
        /// A figure of a run; the same for every robot.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Metric { $($metric),* }

        impl Metric {
            /// All metrics in the order of a table's columns.
            pub const ALL: &[Self] = &[$(Self::$metric),*];

            const fn facts(self) -> Facts {
                match self {
                    $(Self::$metric => Facts { name: $name, unit: Unit::$unit, worsening: $worsening, of: $of },)*
                }
            }
        }
    };
}

metrics! {
    SimulatedTime = "simulated_s", Seconds, MoreIsWorse, |f| f.summary.simulated_s;
    MotionTime = "motion_s", Seconds, MoreIsWorse, |f| f.summary.motion_s;
    ToolErrorBeforeMedian = "tool_error_before_median_m", Metres, MoreIsWorse, |f| Some(tool(before(f)?)?.median);
    ToolErrorBeforeP95 = "tool_error_before_p95_m", Metres, MoreIsWorse, |f| Some(tool(before(f)?)?.p95);
    ToolErrorBeforeMax = "tool_error_before_max_m", Metres, MoreIsWorse, |f| Some(tool(before(f)?)?.max);
    ToolErrorAfterMedian = "tool_error_after_median_m", Metres, MoreIsWorse, |f| Some(tool(after(f)?)?.median);
    ToolErrorAfterP95 = "tool_error_after_p95_m", Metres, MoreIsWorse, |f| Some(tool(after(f)?)?.p95);
    ToolErrorAfterMax = "tool_error_after_max_m", Metres, MoreIsWorse, |f| Some(tool(after(f)?)?.max);
    ToolErrorImprovement = "tool_error_improvement", Ratio, LessIsWorse, |f| {
        let (before, after) = (tool(before(f)?)?.median, tool(after(f)?)?.median);
        (after > 0.0).then_some(before / after)
    };
    ReachErrorBeforeMedian = "reach_error_before_median_m", Metres, MoreIsWorse, |f| {
        Some(before(f)?.reach_error_m?.median)
    };
    ReachErrorBeforeMax = "reach_error_before_max_m", Metres, MoreIsWorse, |f| Some(before(f)?.reach_error_m?.max);
    ReachErrorAfterMedian = "reach_error_after_median_m", Metres, MoreIsWorse, |f| {
        Some(after(f)?.reach_error_m?.median)
    };
    ReachErrorAfterMax = "reach_error_after_max_m", Metres, MoreIsWorse, |f| Some(after(f)?.reach_error_m?.max);
    HitsBefore = "hits_before", Count, LessIsWorse, |f| Some(before(f)?.hits as f64);
    HitsAfter = "hits_after", Count, LessIsWorse, |f| Some(after(f)?.hits as f64);
    Contacts = "contacts", Count, MoreIsWorse, |f| f.summary.capture.collisions.map(|n| n as f64);
    MinClearance = "min_clearance_m", Metres, LessIsWorse, |f| f.summary.capture.min_clearance_m;
    MarginLinks = "margin_links", Count, MoreIsWorse, |f| Some(f.summary.capture.margins.as_ref()?.links as f64);
    MarginExceededQ99 = "margin_exceeded_q99", Count, MoreIsWorse, |f| {
        Some(f.summary.capture.margins.as_ref()?.exceeded_q99 as f64)
    };
    MarginLargest = "margin_largest_m", Metres, MoreIsWorse, |f| Some(f.summary.capture.margins.as_ref()?.largest_m);
    Renewals = "renewals", Count, MoreIsWorse, |f| Some(f.summary.capture.renewals.len() as f64);
    Poses = "poses", Count, MoreIsWorse, |f| Some(f.summary.capture.poses as f64);
    PosesSkipped = "poses_skipped", Count, MoreIsWorse, |f| Some(f.summary.capture.poses_skipped as f64);
    TargetsSkipped = "targets_skipped", Count, MoreIsWorse, |f| Some(f.summary.capture.targets_skipped as f64);
    Views = "views", Count, LessIsWorse, |f| Some(f.summary.capture.views as f64);
    Detections = "detections", Count, LessIsWorse, |f| Some(f.summary.capture.detections as f64);
    Rejected = "rejected", Count, MoreIsWorse, |f| Some(f.summary.capture.rejected as f64);
    ResidualRmsPx = "residual_rms_px", Pixels, MoreIsWorse, |f| f.summary.calibration.residual_rms_px;
    CornerScatterPx = "corner_scatter_px", Pixels, MoreIsWorse, |f| f.corner_scatter_px;
    HeldOutViews = "held_out_views", Count, MoreIsWorse, |f| Some(f.summary.held_out.views as f64);
    HeldOutRmsPx = "held_out_rms_px", Pixels, MoreIsWorse, |f| f.summary.held_out.rms_px;
    HeldOutRms = "held_out_rms_m", Metres, MoreIsWorse, |f| f.summary.held_out.rms_m;
    HeldOutNominalRms = "held_out_nominal_rms_m", Metres, MoreIsWorse, |f| f.summary.held_out.nominal_rms_m;
    PredictedToolErrorMedian = "predicted_tool_error_median_m", Metres, MoreIsWorse, |f| {
        Some(f.summary.calibration.predicted_tool_error_m?.median)
    };
    PredictedToolErrorP95 = "predicted_tool_error_p95_m", Metres, MoreIsWorse, |f| {
        Some(f.summary.calibration.predicted_tool_error_m?.p95)
    };
    PredictedToolErrorMax = "predicted_tool_error_max_m", Metres, MoreIsWorse, |f| {
        Some(f.summary.calibration.predicted_tool_error_m?.max)
    };
    PredictedWithPriorsP95 = "predicted_tool_error_with_priors_p95_m", Metres, MoreIsWorse, |f| {
        Some(f.summary.calibration.predicted_tool_error_with_priors_m?.p95)
    };
    U95Max = "u95_max_m", Metres, MoreIsWorse, |f| f.summary.u95_m.max;
    TargetsWithU95 = "targets_with_u95", Count, LessIsWorse, |f| Some(errors_over_u95(f).len() as f64);
    TargetsBeyondU95 = "targets_beyond_u95", Count, MoreIsWorse, |f| {
        Some(errors_over_u95(f).into_iter().filter(|ratio| *ratio > 1.0).count() as f64)
    };
    TargetsBeyond3U95 = "targets_beyond_3_u95", Count, MoreIsWorse, |f| {
        Some(errors_over_u95(f).into_iter().filter(|ratio| *ratio > 3.0).count() as f64)
    };
    WorstOverU95 = "worst_error_over_u95", None, MoreIsWorse, |f| errors_over_u95(f).into_iter().reduce(f64::max);
    Findings = "findings", Count, MoreIsWorse, |f| Some(f.summary.calibration.findings.len() as f64);
    Reservations = "reservations", Count, MoreIsWorse, |f| Some(f.summary.calibration.reservations.len() as f64);
    Nees = "nees", None, MoreIsWorse, |f| f.summary.score.as_ref()?.nees;
    NeesWithPriors = "nees_with_priors", None, MoreIsWorse, |f| {
        let targets = &f.summary.score.as_ref()?.targets;
        let each: Vec<f64> = targets.iter().filter_map(|target| target.nees_with_priors).collect();
        (!each.is_empty()).then(|| each.iter().sum::<f64>() / each.len() as f64)
    };
}

/// True tool error after calibration over U95, at each target that has both.
fn errors_over_u95(finished: &Finished) -> Vec<f64> {
    let targets = finished.summary.score.iter().flat_map(|score| &score.targets);
    let ratio = |truth: &TargetScore| {
        let u95 = finished.summary.u95_m.targets.iter().find(|u95| u95.index == truth.target)?;
        Some(truth.tool_error_after_m? / u95.u95_m?)
    };
    targets.filter_map(ratio).collect()
}

impl Metric {
    /// Metrics that `armcal regress` compares.
    pub const COMPARED: &[Self] = &[
        Self::Contacts,
        Self::HitsAfter,
        Self::TargetsSkipped,
        Self::Poses,
        Self::ToolErrorAfterMedian,
        Self::ReachErrorAfterMedian,
        Self::ResidualRmsPx,
        Self::HeldOutRms,
        Self::CornerScatterPx,
        Self::SimulatedTime,
        Self::MinClearance,
    ];

    /// Name of the metric in tables and summaries.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.facts().name
    }

    /// Metric of a column; `None` for a column of another version, or of a joint.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|metric| metric.name() == name)
    }

    #[must_use]
    pub const fn unit(self) -> Unit {
        self.facts().unit
    }

    #[must_use]
    pub const fn worsening(self) -> Worsening {
        self.facts().worsening
    }

    /// Value of the metric; `None` where the run has none.
    #[must_use]
    pub fn of(self, finished: &Finished) -> Option<f64> {
        (self.facts().of)(finished)
    }
}

fn before(finished: &Finished) -> Option<&ScoreSide> {
    Some(&finished.summary.score.as_ref()?.before)
}

fn after(finished: &Finished) -> Option<&ScoreSide> {
    finished.summary.score.as_ref()?.after.as_ref()
}

fn tool(side: &ScoreSide) -> Option<Summary> {
    side.tool_error_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_ends_in_its_unit() {
        for metric in Metric::ALL {
            let suffix = match metric.unit() {
                Unit::Metres => "_m",
                Unit::Radians => "_rad",
                Unit::Seconds => "_s",
                Unit::Pixels => "_px",
                Unit::Count | Unit::Ratio | Unit::None => "",
            };
            assert!(metric.name().ends_with(suffix), "{}", metric.name());
            assert_eq!(Metric::of_name(metric.name()), Some(*metric));
        }
    }
}
