//! Is it worse than it was? New rows against a baseline's, pair by pair: the same setting, the same seed.
//!
//! A pair shares its world, so that what differs is the program or the setting under test, not luck with a seed. The
//! median of new over baseline is too much when it reaches the budget AND the ratios lie above 1 beyond doubt: the
//! lower end of the bootstrap's interval (one-sided 95 %) is above 1. Noise alone moves ratios both ways and fails the
//! second condition in one case of twenty at most; a worsening of the budget's size in all pairs meets both.

use comfy_table::Table as Grid;
use comfy_table::presets::UTF8_FULL_CONDENSED;

use crate::campaign::{Metric, Row, RunStatus, Table};
use armcal_core::routine::RegressSettings;
use armcal_core::stats::{median_interval, quantile};

/// What came out of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    pub pairs: usize,
    pub checks: Vec<Check>,
    /// Every figure of every pair is the same.
    pub identical: bool,
    /// The repeat commands of the worst pairs of the checks that failed, each once.
    pub worst: Vec<WorstPair>,
}

impl Comparison {
    #[must_use]
    pub fn is_worse(&self) -> bool {
        self.checks.iter().any(|check| check.worse)
    }
}

/// One thing that was compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    pub what: &'static str,
    /// Pairs with the figure on both sides.
    pub n: usize,
    pub value: String,
    pub certainty: String,
    pub budget: String,
    pub worse: bool,
}

/// A pair to look at.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstPair {
    pub what: &'static str,
    pub seed: u64,
    pub settings: String,
    pub detail: String,
    pub command: String,
}

/// Pairs named for each check that failed.
const WORST_NAMED: usize = 3;
/// Two-sided coverage whose lower end is the one-sided 95 % bound.
const COVERAGE: f64 = 0.90;
/// A ratio of the budget's size meets it in spite of rounding.
const ROUNDING: f64 = 1e-9;

struct Pair<'a> {
    baseline: &'a Row,
    now: &'a Row,
}

/// Compares `now` with `baseline`. Rows without a partner are left out.
#[must_use]
pub fn compare(baseline: &Table, now: &Table, budgets: &RegressSettings) -> Comparison {
    let partner = |row: &&Row| baseline.rows.iter().find(|b| b.seed == row.seed && b.settings == row.settings);
    let pairs: Vec<Pair<'_>> =
        now.rows.iter().filter_map(|row| Some(Pair { baseline: partner(&row)?, now: row })).collect();
    let mut judge = Judge { baseline, now, pairs: &pairs, checks: Vec::new(), worst: Vec::new() };
    judge.endings();
    judge.contacts();
    judge.ratio("tool error", Metric::ToolErrorAfterMedian, budgets.tool_error_ratio);
    judge.ratio("miss at the target", Metric::ReachErrorAfterMedian, budgets.reach_error_ratio);
    judge.ratio("residual", Metric::ResidualRmsPx, budgets.residual_ratio);
    judge.ratio("held-out tags", Metric::HeldOutRms, budgets.held_out_ratio);
    judge.ratio("corner scatter", Metric::CornerScatterPx, budgets.corner_scatter_ratio);
    judge.ratio("simulated time", Metric::SimulatedTime, budgets.time_ratio);
    judge.limit("tool error, itself", Metric::ToolErrorAfterMedian, budgets.tool_error_m);
    judge.limit("miss, itself", Metric::ReachErrorAfterMedian, budgets.reach_error_m);
    let identical = baseline.names == now.names && pairs.iter().all(|p| p.baseline.figures == p.now.figures);
    Comparison { pairs: pairs.len(), checks: judge.checks, worst: judge.worst, identical }
}

struct Judge<'a> {
    baseline: &'a Table,
    now: &'a Table,
    pairs: &'a [Pair<'a>],
    checks: Vec<Check>,
    worst: Vec<WorstPair>,
}

impl Judge<'_> {
    /// Any run that ended worse than its partner.
    fn endings(&mut self) {
        let rank = |status| match status {
            RunStatus::Accepted => 0,
            RunStatus::Missed => 1,
            RunStatus::Refused => 2,
            RunStatus::Failed => 3,
        };
        let worse = |pair: &&Pair<'_>| rank(pair.now.status) > rank(pair.baseline.status);
        let detail = |pair: &Pair<'_>| {
            format!("{}, was {}: {}", pair.now.status.name(), pair.baseline.status.name(), pair.now.failure)
        };
        let found = self.pairs.iter().filter(worse).map(|pair| (pair, detail(pair))).collect();
        self.any("missed, refused or failed, new", self.pairs.len(), found);
    }

    /// Any contact in a run that had none.
    fn contacts(&mut self) {
        let touched = |pair: &Pair<'_>| {
            let was = figure(self.baseline, pair.baseline, Metric::Contacts);
            let is = figure(self.now, pair.now, Metric::Contacts).filter(|n| *n > 0.0)?;
            was.is_none_or(|n| n == 0.0).then(|| format!("{is:.0} contacts, had none"))
        };
        let found: Vec<_> = self.pairs.iter().filter_map(|pair| Some((pair, touched(pair)?))).collect();
        self.any("contacts, new", self.pairs.len(), found);
    }

    fn any(&mut self, what: &'static str, n: usize, found: Vec<(&Pair<'_>, String)>) {
        let (value, worse) = (found.len().to_string(), !found.is_empty());
        self.checks.push(Check { what, n, value, certainty: String::new(), budget: "0".to_owned(), worse });
        self.name_worst(what, found);
    }

    fn name_worst(&mut self, what: &'static str, found: Vec<(&Pair<'_>, String)>) {
        self.worst.extend(found.into_iter().take(WORST_NAMED).map(|(pair, detail)| WorstPair {
            what,
            seed: pair.now.seed,
            settings: pair.now.settings.clone(),
            detail,
            command: pair.now.command.clone(),
        }));
    }

    /// New over baseline.
    fn ratio(&mut self, what: &'static str, metric: Metric, budget: f64) {
        let mut ratios: Vec<(&Pair<'_>, f64)> = self
            .pairs
            .iter()
            .filter_map(|pair| {
                Some((pair, ratio(figure(self.baseline, pair.baseline, metric)?, figure(self.now, pair.now, metric)?)))
            })
            .collect();
        let values: Vec<f64> = ratios.iter().map(|(_, ratio)| *ratio).collect();
        let (median, interval) = (quantile(&values, 0.5), median_interval(&values, COVERAGE));
        let worse = median.is_some_and(|median| median >= budget * (1.0 - ROUNDING))
            && interval.is_some_and(|interval| interval.low > 1.0);
        self.checks.push(Check {
            what,
            n: values.len(),
            value: median.map_or_else(|| "-".to_owned(), |median| format!("x {median:.3}")),
            certainty: interval.map_or_else(String::new, |i| format!("{:.3} .. {:.3}", i.low, i.high)),
            budget: format!("below x {budget:.3}"),
            worse,
        });
        if worse {
            ratios.sort_by(|a, b| b.1.total_cmp(&a.1));
            self.name_worst(what, ratios.into_iter().map(|(pair, ratio)| (pair, format!("x {ratio:.3}"))).collect());
        }
    }

    /// The new figure itself.
    fn limit(&mut self, what: &'static str, metric: Metric, budget: Option<f64>) {
        let Some(budget) = budget else { return };
        let unit = metric.unit();
        let mut found: Vec<(&Pair<'_>, f64)> =
            self.pairs.iter().filter_map(|pair| Some((pair, figure(self.now, pair.now, metric)?))).collect();
        let values: Vec<f64> = found.iter().map(|(_, value)| *value).collect();
        let (median, interval) = (quantile(&values, 0.5), median_interval(&values, COVERAGE));
        let worse = median.is_some_and(|median| median > budget);
        self.checks.push(Check {
            what,
            n: values.len(),
            value: unit.shown_if(median, 2),
            certainty: interval
                .map_or_else(String::new, |i| format!("{} .. {}", unit.number(i.low, 2), unit.number(i.high, 2))),
            budget: unit.shown(budget, 2),
            worse,
        });
        if worse {
            found.sort_by(|a, b| b.1.total_cmp(&a.1));
            self.name_worst(what, found.into_iter().map(|(pair, value)| (pair, unit.shown(value, 2))).collect());
        }
    }
}

fn figure(table: &Table, row: &Row, metric: Metric) -> Option<f64> {
    table.place(metric).and_then(|place| row.figures.get(place).copied().flatten())
}

/// Nothing over nothing is no change.
fn ratio(was: f64, is: f64) -> f64 {
    if was == is { 1.0 } else { is / was }
}

/// Lays a comparison out for a terminal.
#[must_use]
pub fn regress_table(comparison: &Comparison) -> String {
    let mut grid = Grid::new();
    grid.load_preset(UTF8_FULL_CONDENSED);
    grid.set_header(["new over baseline, by seed", "pairs", "median", "90 % interval", "budget", ""]);
    for check in &comparison.checks {
        let verdict = match (check.worse, check.n) {
            (true, _) => "WORSE",
            (false, 0) => "no pairs",
            (false, _) => "ok",
        };
        grid.add_row([check.what, &check.n.to_string(), &check.value, &check.certainty, &check.budget, verdict]);
    }
    let mut text = grid.to_string();
    if comparison.identical && comparison.pairs > 0 {
        text.push_str("\nevery figure of every run is the same as in the baseline");
    }
    for pair in &comparison.worst {
        let setting = if pair.settings.is_empty() { String::new() } else { format!(" ({})", pair.settings) };
        text.push_str(&format!("\n{}: seed {}{setting}: {}\n  {}", pair.what, pair.seed, pair.detail, pair.command));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::row;
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, LogNormal};

    fn table(errors_m: impl IntoIterator<Item = f64>) -> Table {
        let names = [Metric::ToolErrorAfterMedian, Metric::Contacts].map(|metric| metric.name().to_owned()).to_vec();
        let row = |(seed, error_m): (u64, f64)| Row { figures: vec![Some(error_m), Some(0.0)], ..row(0, seed) };
        Table { names, rows: (1..).zip(errors_m).map(row).collect() }
    }

    fn is_worse(baseline: &Table, now: &Table) -> bool {
        compare(baseline, now, &RegressSettings::default()).is_worse()
    }

    #[test]
    fn a_table_against_itself_is_the_same() {
        let base = table([0.004, 0.005, 0.006]);
        let comparison = compare(&base, &base, &RegressSettings::default());
        assert!(comparison.identical && !comparison.is_worse() && comparison.pairs == 3);
        assert!(regress_table(&comparison).contains("x 1.000"));
        assert!(regress_table(&comparison).contains("is the same"));
    }

    #[test]
    fn ten_percent_in_every_pair_is_worse_and_nine_is_not() {
        let errors = [0.004, 0.005, 0.007, 0.003, 0.006];
        let base = table(errors);
        assert!(is_worse(&base, &table(errors.map(|e| e * 1.10))));
        assert!(!is_worse(&base, &table(errors.map(|e| e * 1.09))));
        assert!(!is_worse(&base, &table(errors.map(|e| e / 1.5))), "better is not worse");
    }

    /// Each run draws anew, 30 % about the same mean: at most one comparison in twenty may fail, by the interval's own
    /// meaning. With 25 % worse on top of it nearly all must.
    #[test]
    fn noise_alone_seldom_fails_and_a_real_worsening_nearly_always() {
        let noise = LogNormal::new(0.0, 0.2).expect("a distribution");
        let failed = |n: usize, factor: f64| {
            (0..200)
                .filter(|trial| {
                    let mut rng = stream_rng(*trial, "noise");
                    let mut draw =
                        |factor: f64| (0..n).map(|_| 0.005 * factor * noise.sample(&mut rng)).collect::<Vec<_>>();
                    let (base, now) = (table(draw(1.0)), table(draw(factor)));
                    is_worse(&base, &now)
                })
                .count()
        };
        for n in [5, 20] {
            let by_noise = failed(n, 1.0);
            assert!(by_noise <= 20, "{n} pairs: {by_noise} of 200 by noise alone");
        }
        let found = failed(20, 1.3);
        assert!(found >= 180, "{found} of 200 found");
    }

    #[test]
    fn new_failures_and_new_contacts_are_worse_and_old_ones_are_not() {
        let base = table([0.004, 0.005]);
        let mut failed = base.clone();
        failed.rows[1] = Row {
            status: RunStatus::Failed,
            figures: vec![None, None],
            failure: "why".to_owned(),
            ..failed.rows[1].clone()
        };
        let comparison = compare(&base, &failed, &RegressSettings::default());
        assert!(comparison.is_worse());
        assert_eq!(comparison.worst[0].seed, 2);
        assert!(regress_table(&comparison).contains("--seed 2"), "{comparison:?}");
        assert!(!is_worse(&failed, &failed) && !is_worse(&failed, &base));
        let mut touched = base.clone();
        touched.rows[0].figures[1] = Some(2.0);
        assert!(is_worse(&base, &touched));
        assert!(!is_worse(&touched, &touched) && !is_worse(&touched, &base));
    }

    #[test]
    fn a_limit_judges_the_new_figure_itself() {
        let base = table([0.004, 0.005, 0.006]);
        let budgets = |m| RegressSettings { tool_error_m: Some(m), ..RegressSettings::default() };
        assert!(!compare(&base, &base, &budgets(0.0051)).is_worse());
        assert!(compare(&base, &base, &budgets(0.0049)).is_worse());
    }
}
