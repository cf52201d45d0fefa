//! Regression test: new rows against a baseline's, pair by pair, with the same setting and seed.
//!
//! A pair shares its world, so differences come from the program or the setting under test, not from the seed. A
//! worsening of the typical pair fails on two conditions. It reaches the budget, and it is significant: the lower end
//! of the interval is on the worse side of no change. Noise moves pairs both ways, and meets the second condition in at
//! most one case of twenty over all figures (Bonferroni's correction). A worsening of the budget's size in all pairs
//! meets both. An interval that holds both no change and the budget decides nothing, and is reported as inconclusive.
//! For the clearance, the nearest runs are compared as well as the typical pair.

mod nearest;
mod paired;

use serde::Serialize;

use crate::campaign::{Metric, Row, RunStatus, Table};
use armcal_core::routine::RegressSettings;
use armcal_core::stats::{median_interval, quantile};
use armcal_core::units::Unit;

/// Result of a comparison.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    pub version: u32,
    pub verdict: Verdict,
    pub pairs: usize,
    /// True if every figure of every pair is the same.
    pub identical: bool,
    pub checks: Vec<Check>,
    /// Repeat commands of the worst pairs of the failed checks, each once.
    pub worst: Vec<WorstPair>,
}

/// Result of a check. The result of several checks is their last one in this list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    NotWorse,
    /// The pairs are consistent with no change, and with more than the budget.
    Inconclusive,
    Worse,
}

/// Result for one compared figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    pub what: &'static str,
    /// Number of pairs that have the figure on both sides.
    pub n: usize,
    #[serde(skip)]
    pub unit: Unit,
    /// Typical change of the pairs (Hodges and Lehmann), median of the new figures, or number of worse pairs.
    pub value: Option<f64>,
    /// Lower end of the interval. At most 5 % of all these intervals together lie above their true value, and 5 % of
    /// each below it. Tests for a worsening only have no `high`.
    pub low: Option<f64>,
    pub high: Option<f64>,
    pub budget: f64,
    pub verdict: Verdict,
}

/// A pair to examine, with the command that repeats it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorstPair {
    pub what: &'static str,
    pub seed: u64,
    pub settings: String,
    pub detail: String,
    pub command: String,
}

/// Number of pairs that are named for each failed check.
const WORST_NAMED: usize = 3;
/// Coverage of the interval that accompanies a limit; its ends do not affect the verdict.
const COVERAGE: f64 = 0.90;

struct Pair<'a> {
    baseline: &'a Row,
    now: &'a Row,
}

/// Compares `now` with `baseline`, without the rows that have no partner.
#[must_use]
pub fn compare(baseline: &Table, now: &Table, budgets: &RegressSettings) -> Comparison {
    let partner = |row: &&Row| baseline.rows.iter().find(|b| b.seed == row.seed && b.settings == row.settings);
    let pairs: Vec<Pair<'_>> =
        now.rows.iter().filter_map(|row| Some(Pair { baseline: partner(&row)?, now: row })).collect();
    let mut judge = Judge { baseline, now, pairs: &pairs, checks: Vec::new(), worst: Vec::new() };
    judge.endings();
    judge.count("contacts, new", Metric::Contacts, |was, is| is > 0.0 && was == 0.0);
    judge.count("targets skipped, more", Metric::TargetsSkipped, |was, is| is > was);
    judge.count("targets hit, fewer", Metric::HitsAfter, |was, is| is < was);
    judge.paired(budgets);
    judge.limit("tool error, itself", Metric::ToolErrorAfterMedian, budgets.tool_error_m);
    judge.limit("miss, itself", Metric::ReachErrorAfterMedian, budgets.reach_error_m);
    let identical = baseline.names == now.names && pairs.iter().all(|p| p.baseline.figures == p.now.figures);
    let verdict = judge.checks.iter().map(|check| check.verdict).max().unwrap_or(Verdict::Inconclusive);
    Comparison { version: 1, verdict, pairs: pairs.len(), identical, checks: judge.checks, worst: judge.worst }
}

struct Judge<'a> {
    baseline: &'a Table,
    now: &'a Table,
    pairs: &'a [Pair<'a>],
    checks: Vec<Check>,
    worst: Vec<WorstPair>,
}

/// A figure of a pair, in the baseline and now.
struct Figures<'a> {
    pair: &'a Pair<'a>,
    was: Option<f64>,
    is: Option<f64>,
}

impl<'a> Judge<'a> {
    fn figures(&self, metric: Metric) -> Vec<Figures<'a>> {
        let figures = |pair| Figures { pair, was: self.was(pair, metric), is: figure(self.now, pair.now, metric) };
        self.pairs.iter().map(figures).collect()
    }

    fn was(&self, pair: &Pair<'_>, metric: Metric) -> Option<f64> {
        figure(self.baseline, pair.baseline, metric)
    }

    /// Checks that no run ended worse than its partner.
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

    /// Checks that no run has a count that `is_worse` than its partner's. A run without a count, though its partner has
    /// one, counts 0.
    fn count(&mut self, what: &'static str, metric: Metric, is_worse: fn(f64, f64) -> bool) {
        let figures = self.figures(metric);
        let detail = |one: &Figures<'a>| {
            let (was, is) = (one.was.unwrap_or(0.0), one.is.unwrap_or(0.0));
            is_worse(was, is).then(|| (one.pair, format!("{is:.0}, was {was:.0}")))
        };
        let found: Vec<_> = figures.iter().filter_map(detail).collect();
        self.any(what, figures.len(), found);
    }

    fn any(&mut self, what: &'static str, n: usize, found: Vec<(&Pair<'_>, String)>) {
        let verdict = if found.is_empty() { Verdict::NotWorse } else { Verdict::Worse };
        let value = Some(found.len() as f64);
        self.checks.push(Check { what, n, unit: Unit::Count, value, low: None, high: None, budget: 0.0, verdict });
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

    /// Checks the median of the new figure against its limit.
    fn limit(&mut self, what: &'static str, metric: Metric, budget: Option<f64>) {
        let Some(budget) = budget else { return };
        let mut found: Vec<(&Pair<'_>, f64)> =
            self.figures(metric).into_iter().filter_map(|one| Some((one.pair, one.is?))).collect();
        let values: Vec<f64> = found.iter().map(|(_, value)| *value).collect();
        let (value, interval) = (quantile(&values, 0.5), median_interval(&values, COVERAGE));
        let verdict = match value {
            None => Verdict::Inconclusive,
            Some(median) if median > budget => Verdict::Worse,
            Some(_) => Verdict::NotWorse,
        };
        let (low, high) = (interval.map(|ends| ends.low), interval.map(|ends| ends.high));
        let check = Check { what, n: found.len(), unit: metric.unit(), value, low, high, budget, verdict };
        if verdict == Verdict::Worse {
            found.sort_by(|a, b| b.1.total_cmp(&a.1));
            let named = found.into_iter().map(|(pair, value)| (pair, check.shown(value))).collect();
            self.name_worst(what, named);
        }
        self.checks.push(check);
    }
}

impl Check {
    /// An empty check with this verdict.
    fn without(verdict: Verdict) -> Self {
        Self { what: "", n: 0, unit: Unit::None, value: None, low: None, high: None, budget: 0.0, verdict }
    }

    /// A value of this check, formatted for people.
    pub(super) fn shown(&self, value: f64) -> String {
        match self.unit {
            Unit::Ratio => format!("x {value:.3}"),
            Unit::Count => format!("{value:.0}"),
            unit => unit.shown(value, 2),
        }
    }
}

fn figure(table: &Table, row: &Row, metric: Metric) -> Option<f64> {
    table.place(metric).and_then(|place| row.figures.get(place).copied().flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::regress_report::regress_table;
    use crate::campaign::table_file::tests::row;
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, LogNormal};

    fn table(errors_m: impl IntoIterator<Item = f64>) -> Table {
        let names = [Metric::ToolErrorAfterMedian, Metric::Contacts].map(|metric| metric.name().to_owned()).to_vec();
        let row = |(seed, error_m): (u64, f64)| Row { figures: vec![Some(error_m), Some(0.0)], ..row(0, seed) };
        Table { names, rows: (1..).zip(errors_m).map(row).collect() }
    }

    fn is_worse(baseline: &Table, now: &Table) -> bool {
        compare(baseline, now, &RegressSettings::default()).verdict == Verdict::Worse
    }

    #[test]
    fn a_table_against_itself_is_the_same() {
        let base = table([0.004, 0.005, 0.006]);
        let comparison = compare(&base, &base, &RegressSettings::default());
        assert!(comparison.identical && comparison.verdict == Verdict::NotWorse && comparison.pairs == 3);
        insta::assert_snapshot!("the_same", regress_table(&comparison, None));
    }

    #[test]
    fn ten_percent_in_every_pair_is_worse_and_nine_is_not() {
        let errors = [0.004, 0.005, 0.007, 0.003, 0.006];
        let base = table(errors);
        assert!(is_worse(&base, &table(errors.map(|e| e * 1.10))));
        assert!(!is_worse(&base, &table(errors.map(|e| e * 1.09))));
        assert!(!is_worse(&base, &table(errors.map(|e| e / 1.5))), "better is not worse");
    }

    /// Each run draws new errors, 30 % about the same mean: by the interval's meaning, at most one comparison in twenty
    /// may fail. With 25 % worsening added, nearly all must fail.
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
        assert_eq!(comparison.verdict, Verdict::Worse);
        assert_eq!(comparison.worst[0].seed, 2);
        insta::assert_snapshot!("a_new_failure", regress_table(&comparison, None));
        assert!(!is_worse(&failed, &failed) && !is_worse(&failed, &base));
        let mut touched = base.clone();
        touched.rows[0].figures[1] = Some(2.0);
        assert!(is_worse(&base, &touched));
        assert!(!is_worse(&touched, &touched) && !is_worse(&touched, &base));
    }

    /// These cases passed in an earlier version: "4 of 4" after "0 of 3" with a skipped target, and lost hits.
    #[test]
    fn lost_hits_skipped_targets_and_fewer_poses_are_worse() {
        let names = [Metric::HitsAfter, Metric::TargetsSkipped, Metric::Poses].map(|metric| metric.name().to_owned());
        let table = |figures: [f64; 3]| {
            let rows = (1..=5).map(|seed| Row { figures: figures.map(Some).to_vec(), ..row(0, seed) });
            Table { names: names.to_vec(), rows: rows.collect() }
        };
        let base = table([4.0, 0.0, 14.0]);
        for worse in [[3.0, 0.0, 14.0], [4.0, 1.0, 14.0], [4.0, 0.0, 12.0]] {
            assert!(is_worse(&base, &table(worse)), "{worse:?}");
            assert!(!is_worse(&table(worse), &base), "{worse:?}");
        }
        assert!(!is_worse(&base, &table([4.0, 0.0, 13.0])), "one pose of 14 is within the budget");
        let mut none = base.clone();
        none.rows[2].figures[0] = None;
        assert!(is_worse(&base, &none), "no reach under a calibration hits nothing");
    }

    #[test]
    fn an_interval_that_holds_no_change_and_too_much_decides_nothing() {
        let base = table([0.004; 6]);
        let verdict = |factors: [f64; 6]| {
            compare(&base, &table(factors.map(|factor| 0.004 * factor)), &RegressSettings::default()).verdict
        };
        assert_eq!(verdict([0.8, 0.9, 1.0, 1.05, 1.3, 1.4]), Verdict::Inconclusive);
        assert_eq!(verdict([0.97, 0.98, 0.99, 1.01, 1.02, 1.03]), Verdict::NotWorse);
        assert_eq!(verdict([0.5, 0.6, 0.7, 0.8, 0.9, 0.95]), Verdict::NotWorse);
        assert_eq!(verdict([1.2, 1.25, 1.3, 1.35, 1.4, 1.45]), Verdict::Worse);
        let mut lost = base.clone();
        lost.rows.iter_mut().for_each(|row| row.figures[0] = None);
        assert_eq!(compare(&base, &lost, &RegressSettings::default()).verdict, Verdict::Inconclusive);
    }

    /// Ten figures that only scatter. With 5 % for each figure, a fifth of such comparisons had one on the worse side.
    #[test]
    fn many_figures_raise_no_more_alarms_than_one() {
        let metrics = [
            Metric::ToolErrorAfterMedian,
            Metric::ReachErrorAfterMedian,
            Metric::ResidualRmsPx,
            Metric::HeldOutRms,
            Metric::CornerScatterPx,
            Metric::SimulatedTime,
        ];
        let names = metrics.map(|metric| metric.name().to_owned()).to_vec();
        let budgets = RegressSettings {
            tool_error_ratio: 1.0,
            reach_error_ratio: 1.0,
            residual_ratio: 1.0,
            held_out_ratio: 1.0,
            corner_scatter_ratio: 1.0,
            time_ratio: 1.0,
            ..RegressSettings::default()
        };
        let noise = LogNormal::new(0.0, 0.2).expect("a distribution");
        let alarms = |trial: u64| {
            let mut rng = stream_rng(trial, "figures");
            let mut table = || Table {
                names: names.clone(),
                rows: (1..=50).map(|seed| Row { figures: drawn(&noise, &mut rng), ..row(0, seed) }).collect(),
            };
            compare(&table(), &table(), &budgets).verdict == Verdict::Worse
        };
        let found = (0..300).filter(|trial| alarms(*trial)).count();
        assert!((1..=27).contains(&found), "{found} of 300; 15 are expected at most");
    }

    fn drawn(noise: &LogNormal<f64>, rng: &mut impl rand::Rng) -> Vec<Option<f64>> {
        (0..6).map(|_| Some(noise.sample(rng))).collect()
    }

    #[test]
    fn ten_millimetres_less_clearance_are_worse_and_one_is_not() {
        let mut rng = stream_rng(3, "clearance");
        let noise = LogNormal::new(-5.0, 0.5).expect("a distribution");
        let mut table = |drop_m: f64| Table {
            names: vec![Metric::MinClearance.name().to_owned()],
            rows: (1..=50)
                .map(|seed| Row { figures: vec![Some(0.08 + noise.sample(&mut rng) - drop_m)], ..row(0, seed) })
                .collect(),
        };
        let base = table(0.0);
        assert!(is_worse(&base, &table(0.010)) && !is_worse(&base, &table(0.001)) && !is_worse(&base, &table(-0.010)));
    }

    #[test]
    fn a_limit_judges_the_new_figure_itself() {
        let base = table([0.004, 0.005, 0.006]);
        let budgets = |m| RegressSettings { tool_error_m: Some(m), ..RegressSettings::default() };
        assert!(compare(&base, &base, &budgets(0.0051)).verdict == Verdict::NotWorse);
        assert!(compare(&base, &base, &budgets(0.0049)).verdict == Verdict::Worse);
    }
}
