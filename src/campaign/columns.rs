//! The figures of a row: their names, and where in a finished run they stand.

use crate::report::{RunSummary, ScoreSide};
use crate::run::Finished;
use armcal_core::stats::Summary;

/// What a figure's values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricKind {
    /// Whole, from 0.
    Count,
    Real,
}

struct Metric {
    name: &'static str,
    kind: MetricKind,
    of: fn(&Finished) -> Option<f64>,
}

const fn real(name: &'static str, of: fn(&Finished) -> Option<f64>) -> Metric {
    Metric { name, kind: MetricKind::Real, of }
}

const fn count(name: &'static str, of: fn(&Finished) -> Option<f64>) -> Metric {
    Metric { name, kind: MetricKind::Count, of }
}

const FIGURES: &[Metric] = &[
    real("simulated_s", |f| f.summary.simulated_s),
    real("motion_s", |f| f.summary.motion_s),
    real("tool_error_before_median_m", |f| Some(tool(before(f)?)?.median)),
    real("tool_error_before_p95_m", |f| Some(tool(before(f)?)?.p95)),
    real("tool_error_before_max_m", |f| Some(tool(before(f)?)?.max)),
    real("tool_error_after_median_m", |f| Some(tool(after(f)?)?.median)),
    real("tool_error_after_p95_m", |f| Some(tool(after(f)?)?.p95)),
    real("tool_error_after_max_m", |f| Some(tool(after(f)?)?.max)),
    real("tool_error_improvement", |f| {
        let (before, after) = (tool(before(f)?)?.median, tool(after(f)?)?.median);
        (after > 0.0).then_some(before / after)
    }),
    real("reach_error_before_median_m", |f| Some(before(f)?.reach_error_m?.median)),
    real("reach_error_before_max_m", |f| Some(before(f)?.reach_error_m?.max)),
    real("reach_error_after_median_m", |f| Some(after(f)?.reach_error_m?.median)),
    real("reach_error_after_max_m", |f| Some(after(f)?.reach_error_m?.max)),
    count("hits_before", |f| Some(before(f)?.hits as f64)),
    count("hits_after", |f| Some(after(f)?.hits as f64)),
    count("contacts", |f| f.summary.capture.collisions.map(|n| n as f64)),
    real("min_clearance_m", |f| f.summary.capture.min_clearance_m),
    count("margin_links", |f| Some(f.summary.capture.margins.as_ref()?.links as f64)),
    count("margin_exceeded_q99", |f| Some(f.summary.capture.margins.as_ref()?.exceeded_q99 as f64)),
    real("margin_largest_m", |f| Some(f.summary.capture.margins.as_ref()?.largest_m)),
    count("renewals", |f| Some(f.summary.capture.renewals.len() as f64)),
    count("poses", |f| Some(f.summary.capture.poses as f64)),
    count("poses_skipped", |f| Some(f.summary.capture.poses_skipped as f64)),
    count("targets_skipped", |f| Some(f.summary.capture.targets_skipped as f64)),
    count("views", |f| Some(f.summary.capture.views as f64)),
    count("detections", |f| Some(f.summary.capture.detections as f64)),
    count("rejected", |f| Some(f.summary.capture.rejected as f64)),
    real("residual_rms_px", |f| f.summary.calibration.residual_rms_px),
    real("corner_scatter_px", |f| f.corner_scatter_px),
    count("held_out_views", |f| Some(f.summary.held_out.views as f64)),
    real("held_out_rms_px", |f| f.summary.held_out.rms_px),
    real("held_out_rms_m", |f| f.summary.held_out.rms_m),
    real("held_out_nominal_rms_m", |f| f.summary.held_out.nominal_rms_m),
    real("predicted_tool_error_median_m", |f| Some(f.summary.calibration.predicted_tool_error_m?.median)),
    real("predicted_tool_error_p95_m", |f| Some(f.summary.calibration.predicted_tool_error_m?.p95)),
    real("predicted_tool_error_max_m", |f| Some(f.summary.calibration.predicted_tool_error_m?.max)),
    real("nees", |f| f.summary.score.as_ref()?.nees),
];

fn before(finished: &Finished) -> Option<&ScoreSide> {
    Some(&finished.summary.score.as_ref()?.before)
}

fn after(finished: &Finished) -> Option<&ScoreSide> {
    finished.summary.score.as_ref()?.after.as_ref()
}

fn tool(side: &ScoreSide) -> Option<Summary> {
    side.tool_error_m
}

const JOINT_BEFORE: &str = "joint_error_before_rad.";
const JOINT_AFTER: &str = "joint_error_after_rad.";

/// The figures of a campaign: the same for every run, then two for each joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    joints: Vec<String>,
}

impl Columns {
    /// `joints`: names over all robots of the campaign; one that a run's robot lacks has no value there.
    #[must_use]
    pub fn new(joints: Vec<String>) -> Self {
        Self { joints }
    }

    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let fixed = FIGURES.iter().map(|figure| figure.name.to_owned());
        let joints =
            self.joints.iter().flat_map(|joint| [JOINT_BEFORE, JOINT_AFTER].map(|what| format!("{what}{joint}")));
        fixed.chain(joints).collect()
    }

    /// What a column holds, by its name.
    #[must_use]
    pub fn kind(name: &str) -> MetricKind {
        FIGURES.iter().find(|figure| figure.name == name).map_or(MetricKind::Real, |figure| figure.kind)
    }

    /// The figures of a run, in the order of [`Self::names`].
    #[must_use]
    pub fn figures(&self, finished: &Finished) -> Vec<Option<f64>> {
        let joints = self.joints.iter().flat_map(|joint| joint_errors_rad(&finished.summary, joint));
        FIGURES.iter().map(|figure| (figure.of)(finished)).chain(joints).collect()
    }
}

fn joint_errors_rad(summary: &RunSummary, name: &str) -> [Option<f64>; 2] {
    let joint = summary.score.as_ref().and_then(|score| score.joints.iter().find(|joint| joint.name == name));
    joint.map_or([None, None], |joint| [joint.angle_error_before_rad, joint.angle_error_after_rad])
}
