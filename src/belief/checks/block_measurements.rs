//! Checks of measured lengths against their prediction from the views.
//!
//! Causes are searched by the views without any length. A wrong length would hide in the noise that is fitted with it,
//! or look like a moved tag. If a prediction has the variance v and the length its own s^2, their difference has the
//! variance `s^2 + v`. The last estimate includes the lengths that pass.

use crate::file::verdict_tables::{Check, VerdictTable};
use crate::judge::constants::FALSE_ALARM;
use crate::measure::BlockMeasurement;
use crate::say::refusal::Refusal;
use crate::solve::estimate::{Estimate, estimate_with_lengths};
use crate::solve::input::BundleInput;
use armcal_core::codes::{Code, Warning};
use armcal_core::stats::chi_square_quantile;
use nalgebra::DVector;

/// Measured length, and its innovation against the views.
pub(crate) struct LengthInnovation {
    pub(crate) measurement: BlockMeasurement,
    measured_m: f64,
    /// Measured less predicted length, m.
    pub(crate) off_m: f64,
    /// Standard deviation of `off_m`, m.
    pub(crate) std_m: f64,
}

impl LengthInnovation {
    pub(crate) fn sigmas(&self) -> f64 {
        self.off_m.abs() / self.std_m
    }
}

/// Innovations of robot.toml's lengths between blocks that the views show.
pub(crate) fn length_innovations(by_views: &Estimate<'_>) -> Vec<LengthInnovation> {
    let innovation = |measurement: BlockMeasurement| {
        let of = measurement.predicted(&by_views.solved.state.blocks);
        let mut row = DVector::zeros(by_views.problem.layout.n);
        for (block, by) in of.by {
            row.fixed_rows_mut::<6>(by_views.problem.layout.at(block)?).copy_from(&by);
        }
        let by_views_m2 = row.dot(&(&by_views.posterior.covariance * &row));
        Some(LengthInnovation {
            measurement,
            measured_m: of.measured_m,
            off_m: of.measured_m - of.predicted_m,
            std_m: (of.std_m.powi(2) + by_views_m2).sqrt(),
        })
    };
    BlockMeasurement::all(by_views.problem.robot).into_iter().flatten().filter_map(innovation).collect()
}

/// Length that the views contradict most, and the largest number of standard deviations by chance.
fn worst(all: &[LengthInnovation]) -> Option<(&LengthInnovation, f64)> {
    let worst = all.iter().max_by(|a, b| a.sigmas().total_cmp(&b.sigmas()))?;
    Some((worst, chi_square_quantile(1.0 - FALSE_ALARM / all.len() as f64, 1).sqrt()))
}

impl<'a> Estimate<'a> {
    /// Returns the estimate that includes these lengths; `self` if the views contradict any.
    pub(crate) fn with_lengths(self, input: &BundleInput<'a>, all: &[LengthInnovation]) -> Self {
        if worst(all).is_none_or(|(worst, limit)| worst.sigmas() > limit) {
            return self;
        }
        let lengths: Vec<BlockMeasurement> = all.iter().map(|of| of.measurement).collect();
        estimate_with_lengths(&self.with_found_terms(input), &lengths).unwrap_or(self)
    }
}

impl Estimate<'_> {
    /// Returns the refusal of the measured length that the views contradict most; warns of those that are not used.
    pub(crate) fn judge_lengths(&self, all: &[LengthInnovation], table: &mut VerdictTable) -> Option<Refusal> {
        for stated in BlockMeasurement::all(self.problem.robot) {
            let has_columns =
                |of: &BlockMeasurement| of.blocks().iter().all(|block| self.problem.layout.at(*block).is_some());
            let what = match stated {
                Ok(measurement) if has_columns(&measurement) => continue,
                Ok(measurement) => measurement.name().0,
                Err(what) => what,
            };
            let text = format!("{what} is not used: the views do not show both ends");
            table.warnings.push(Warning::new(Code::LengthUnused, text));
        }
        let (worst, limit) = worst(all)?;
        let (what, key) = worst.measurement.name();
        let check = Check::at_most(format!("{what}: sigmas from what the views say"), worst.sigmas(), limit);
        let refusal = (!check.holds).then(|| Refusal::Length {
            what,
            key: key.to_owned(),
            measured_m: worst.measured_m,
            by_views_m: worst.measured_m - worst.off_m,
            std_m: worst.std_m,
        });
        table.checks.push(check);
        refusal
    }
}
