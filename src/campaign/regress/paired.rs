//! Figures that are compared pair by pair, as ratios or differences.

use super::{Check, Judge, Pair, Verdict, figure};
use crate::campaign::Metric;
use armcal_core::routine::RegressSettings;
use armcal_core::stats::{Interval, signed_rank_location};
use armcal_core::units::Unit;

/// Probability that any interval of an unchanged program lies on the worse side of no change, over all figures
/// together.
const FALSE_ALARMS: f64 = 0.05;
/// Probability that the interval of a figure ends below its true worsening, for each figure. This end only decides if
/// more pairs are needed.
const OVERLOOKED: f64 = 0.05;
/// Tolerance for rounding, so that a change of the budget's size reaches the budget.
const ROUNDING: f64 = 1e-9;
/// Limit of the logarithm of a ratio with zero on one side.
const LN_MOST: f64 = 700.0;

/// Measure of change between two figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scale {
    /// New over baseline, judged by its logarithm: twice and half are equally far from no change.
    NewOverBaseline,
    BaselineOverNew,
    /// Baseline less new.
    Drop,
}

impl Scale {
    /// Change of a figure, positive if worse, 0 for no change.
    fn worsening(self, was: f64, is: f64) -> f64 {
        match self {
            Self::NewOverBaseline => ln_ratio(was, is),
            Self::BaselineOverNew => ln_ratio(is, was),
            Self::Drop => was - is,
        }
    }

    /// The change in the form of tables and budgets.
    fn shown(self, worsening: f64) -> f64 {
        if self == Self::Drop { worsening } else { worsening.exp() }
    }

    fn unit(self, metric: Metric) -> Unit {
        if self == Self::Drop { metric.unit() } else { Unit::Ratio }
    }
}

/// Logarithm of the ratio; zero over zero is no change.
fn ln_ratio(was: f64, is: f64) -> f64 {
    if was == is { 0.0 } else { (is / was).ln().clamp(-LN_MOST, LN_MOST) }
}

/// One figure of all pairs.
struct Figure<'a> {
    what: &'static str,
    metric: Metric,
    scale: Scale,
    budget: f64,
    pairs: Vec<(&'a Pair<'a>, f64)>,
}

impl<'a> Judge<'a> {
    /// Judges all figures, each so strictly that all together give a false alarm in at most one case of twenty.
    pub(super) fn paired(&mut self, budgets: &RegressSettings) {
        let of =
            |(what, metric, scale, budget)| Figure { what, metric, scale, budget, pairs: self.moved(metric, scale) };
        let figures = compared(budgets).map(of);
        // The clearance has two checks: one of the typical pair, one of the nearest runs.
        let looks = |figure: &Figure<'_>| if figure.metric == Metric::MinClearance { 2 } else { 1 };
        let n_compared: usize = figures.iter().filter(|figure| !figure.pairs.is_empty()).map(looks).sum();
        let tail = FALSE_ALARMS / n_compared.max(1) as f64;
        for figure in figures {
            let check = self.check(&figure, tail);
            if check.verdict == Verdict::Worse {
                self.name_worst_of(&check, figure);
            }
            self.checks.push(check);
        }
        self.nearest(budgets.clearance_drop_m, tail);
    }

    /// Worsening of each pair that has the figure on both sides.
    fn moved(&self, metric: Metric, scale: Scale) -> Vec<(&'a Pair<'a>, f64)> {
        let of = |pair: &'a Pair<'a>| {
            let (was, is) = (figure(self.baseline, pair.baseline, metric)?, figure(self.now, pair.now, metric)?);
            Some((pair, scale.worsening(was, is))).filter(|(_, worsening)| worsening.is_finite())
        };
        self.pairs.iter().filter_map(of).collect()
    }

    fn check(&self, figure: &Figure<'_>, tail: f64) -> Check {
        let Figure { what, metric, scale, budget, ref pairs } = *figure;
        let empty =
            Check { what, n: pairs.len(), unit: scale.unit(metric), budget, ..Check::without(Verdict::NotWorse) };
        let moved: Vec<f64> = pairs.iter().map(|(_, worsening)| *worsening).collect();
        let Some(location) = signed_rank_location(&moved, tail) else {
            let is_lost = self.pairs.iter().any(|pair| self.was(pair, metric).is_some());
            return Check { verdict: if is_lost { Verdict::Inconclusive } else { Verdict::NotWorse }, ..empty };
        };
        let Interval { low, .. } = location.interval;
        let high = signed_rank_location(&moved, OVERLOOKED).map_or(location.interval.high, |own| own.interval.high);
        let [value, low_shown, high_shown] = [location.estimate, low, high].map(|moved| scale.shown(moved));
        let reaches = |value: f64| value >= budget * (1.0 - ROUNDING);
        let verdict = match () {
            () if reaches(value) && low > 0.0 => Verdict::Worse,
            () if reaches(high_shown) && low <= 0.0 => Verdict::Inconclusive,
            () => Verdict::NotWorse,
        };
        Check { value: Some(value), low: Some(low_shown), high: Some(high_shown), verdict, ..empty }
    }

    fn name_worst_of(&mut self, check: &Check, mut figure: Figure<'_>) {
        figure.pairs.sort_by(|a, b| b.1.total_cmp(&a.1));
        let named = figure.pairs.into_iter().map(|(pair, moved)| (pair, check.shown(figure.scale.shown(moved))));
        self.name_worst(check.what, named.collect());
    }
}

fn compared(budgets: &RegressSettings) -> [(&'static str, Metric, Scale, f64); 8] {
    use Scale::{BaselineOverNew, Drop, NewOverBaseline};
    [
        ("poses, baseline over new", Metric::Poses, BaselineOverNew, budgets.poses_ratio),
        ("tool error", Metric::ToolErrorAfterMedian, NewOverBaseline, budgets.tool_error_ratio),
        ("miss at the target", Metric::ReachErrorAfterMedian, NewOverBaseline, budgets.reach_error_ratio),
        ("residual", Metric::ResidualRmsPx, NewOverBaseline, budgets.residual_ratio),
        ("held-out tags", Metric::HeldOutRms, NewOverBaseline, budgets.held_out_ratio),
        ("corner scatter", Metric::CornerScatterPx, NewOverBaseline, budgets.corner_scatter_ratio),
        ("simulated time", Metric::SimulatedTime, NewOverBaseline, budgets.time_ratio),
        ("clearance, nearer by", Metric::MinClearance, Drop, budgets.clearance_drop_m),
    ]
}
