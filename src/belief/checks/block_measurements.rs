//! Measured lengths against what the views say of them.
//!
//! A wrong length would hide in the noise that is fitted with it, so the views are solved without any. With the
//! variance v of their prediction and the length's own s^2, measured less predicted has the variance `s^2 + v`.

use crate::checks::consistency::VerdictInput;
use crate::file::verdict_tables::{Check, VerdictTable};
use crate::judge::constants::FALSE_ALARM;
use crate::measure::BlockMeasurement;
use crate::say::refusal::Refusal;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;
use armcal_core::codes::{Code, Warning};
use armcal_core::stats::chi_square_quantile;
use nalgebra::DVector;

/// A measured length, and what the views say of it.
pub(crate) struct LengthInnovation {
    measurement: BlockMeasurement,
    measured_m: f64,
    /// Measured less predicted.
    pub(crate) off_m: f64,
    /// One sigma of it.
    pub(crate) std_m: f64,
}

impl LengthInnovation {
    pub(crate) fn sigmas(&self) -> f64 {
        self.off_m.abs() / self.std_m
    }
}

/// Innovations of the lengths that are in the fit `found`; `None` where the views have no estimate without them.
pub(crate) fn length_innovations(input: &BundleInput<'_>, found: &Estimate<'_>) -> Option<Vec<LengthInnovation>> {
    let lengths = &found.problem.block_measurements;
    if lengths.is_empty() {
        return Some(Vec::new());
    }
    let robot = &BlockMeasurement::none_of(input.robot);
    let by_views = estimate(&BundleInput { robot, model: found.model.clone(), ..input.clone() })?;
    let innovation = |measurement: &BlockMeasurement| {
        let of = measurement.predicted(&by_views.solved.state.blocks);
        let mut row = DVector::zeros(by_views.problem.layout.n);
        for (block, by) in of.by {
            row.fixed_rows_mut::<6>(by_views.problem.layout.at(block)?).copy_from(&by);
        }
        let by_views_m2 = row.dot(&(&by_views.posterior.covariance * &row));
        Some(LengthInnovation {
            measurement: *measurement,
            measured_m: of.measured_m,
            off_m: of.measured_m - of.predicted_m,
            std_m: (of.std_m.powi(2) + by_views_m2).sqrt(),
        })
    };
    Some(lengths.iter().filter_map(innovation).collect())
}

impl VerdictInput<'_> {
    /// Returns the refusal of the measured length that the views contradict most; warns of those that are not used.
    pub(crate) fn block_measurements(&self, table: &mut VerdictTable) -> Option<Refusal> {
        for stated in BlockMeasurement::all(self.input.robot) {
            let has_columns =
                |of: &BlockMeasurement| of.blocks().iter().all(|block| self.found.problem.layout.at(*block).is_some());
            let what = match stated {
                Ok(measurement) if has_columns(&measurement) => continue,
                Ok(measurement) => measurement.name().0,
                Err(what) => what,
            };
            let text = format!("{what} is not used: the views do not show both ends");
            table.warnings.push(Warning::new(Code::LengthUnused, text));
        }
        let Some(all) = length_innovations(self.input, self.found) else {
            let text = "measured lengths are not tested: the views have no estimate without them";
            table.warnings.push(Warning::new(Code::LengthUnused, text));
            return None;
        };
        let worst = all.iter().max_by(|a, b| a.sigmas().total_cmp(&b.sigmas()))?;
        let limit = chi_square_quantile(1.0 - FALSE_ALARM / all.len() as f64, 1).sqrt();
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
