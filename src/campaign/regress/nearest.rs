//! Smallest clearance of all runs: a change of a path's required clearance shows in the few runs that come near
//! anything.
//!
//! The required clearance is a floor that most runs never reach. Less of it hardly moves the typical run, and moves the
//! nearest runs by its whole size. The test is that of precedence (Nelson, *Tables for a precedence life test*,
//! Technometrics 5, 1963), for pairs. Where both sides of an unchanged program differ by chance, either run of a pair
//! is equally likely the nearer one. Then the k nearest runs are all new ones with a probability of at most 1/2^k.

use super::{Check, Judge, Pair, Verdict};
use crate::campaign::Metric;
use armcal_core::units::Unit;

const WHAT: &str = "nearest run, nearer by";

impl<'a> Judge<'a> {
    /// Checks for runs that are nearer than the baseline ever was; the verdict is never inconclusive. `tail` is the
    /// probability that an unchanged program fails.
    pub(super) fn nearest(&mut self, budget_m: f64, tail: f64) {
        let mut pairs: Vec<(&'a Pair<'a>, f64, f64)> = self
            .figures(Metric::MinClearance)
            .into_iter()
            .filter_map(|one| Some((one.pair, one.was?, one.is?)))
            .filter(|(_, was, is)| was.is_finite() && is.is_finite())
            .collect();
        pairs.sort_by(|a, b| a.2.total_cmp(&b.2));
        let floor_m = pairs.iter().map(|(_, was, _)| *was).fold(f64::INFINITY, f64::min);
        let nearer_by = |k: usize| pairs.get(k).map(|(_, _, is)| floor_m - is);
        // The `n_needed` nearest runs are new by chance with a probability of 1/2^n_needed.
        let n_needed = (-tail.log2()).ceil().max(1.0) as usize;
        let (value, low) = (nearer_by(0), nearer_by(n_needed - 1));
        let is_worse = value.is_some_and(|nearer_m| nearer_m >= budget_m) && low.is_some_and(|low| low > 0.0);
        let verdict = if is_worse { Verdict::Worse } else { Verdict::NotWorse };
        let n = pairs.len();
        if is_worse {
            let shown = |m| Unit::Metres.shown(m, 2);
            let detail = |(pair, was, is)| (pair, format!("{}, was {}", shown(is), shown(was)));
            self.name_worst(WHAT, pairs.into_iter().map(detail).collect());
        }
        self.checks.push(Check {
            what: WHAT,
            n,
            unit: Unit::Metres,
            value,
            low,
            high: None,
            budget: budget_m,
            verdict,
        });
    }
}

#[cfg(test)]
mod tests {
    use crate::campaign::regress::{Verdict, compare};
    use crate::campaign::table_file::tests::row;
    use crate::campaign::{Metric, Row, Table};
    use armcal_core::routine::RegressSettings;
    use armcal_core::stats::stream_rng;
    use rand::RngExt;

    /// A table in which three quarters of the runs have 70 to 170 mm of clearance for any floor. A quarter has a detour
    /// and keeps `floor_m` and up to 10 mm more.
    fn table(floor_m: f64, rng: &mut impl rand::Rng) -> Table {
        let mut clearance_m = || {
            let by_chance_m = rng.random_range(0.07..0.17);
            let led_around = rng.random_bool(0.25);
            if led_around { floor_m + rng.random_range(0.0..0.01) } else { by_chance_m }
        };
        let rows = (1..=50).map(|seed| Row { figures: vec![Some(clearance_m())], ..row(0, seed) });
        Table { names: vec![Metric::MinClearance.name().to_owned()], rows: rows.collect() }
    }

    /// Counts among 200 comparisons: those with worse nearest runs, and those with a worse typical run.
    fn found(floor_m: f64) -> [usize; 2] {
        let mut found = [0; 2];
        for trial in 0..200 {
            let mut rng = stream_rng(trial, "nearest");
            let (base, now) = (table(0.05, &mut rng), table(floor_m, &mut rng));
            let comparison = compare(&base, &now, &RegressSettings::default());
            let is_worse = |what| comparison.checks.iter().any(|c| c.what == what && c.verdict == Verdict::Worse);
            found[0] += usize::from(is_worse(super::WHAT));
            found[1] += usize::from(is_worse("clearance, nearer by"));
        }
        found
    }

    #[test]
    fn a_lower_floor_shows_in_the_nearest_runs_and_not_in_the_typical_one() {
        let [nearest, typical] = found(0.04);
        assert!(nearest >= 160 && typical <= 60, "{nearest} and {typical} of 200");
    }

    /// A failure needs 5 mm, the budget, and significance: chance seldom causes both.
    #[test]
    fn the_same_floor_is_seldom_found_worse() {
        let [nearest, _] = found(0.05);
        assert!(nearest <= 2, "{nearest} of 200");
        let [nearest, _] = found(0.06);
        assert_eq!(nearest, 0, "more clearance is not worse");
    }

    #[test]
    fn few_pairs_and_one_near_run_find_nothing() {
        let of = |clearances_m: &[f64]| Table {
            names: vec![Metric::MinClearance.name().to_owned()],
            rows: (1..).zip(clearances_m).map(|(seed, m)| Row { figures: vec![Some(*m)], ..row(0, seed) }).collect(),
        };
        let nearest = |was: &[f64], is: &[f64]| {
            let comparison = compare(&of(was), &of(is), &RegressSettings::default());
            comparison.checks.into_iter().find(|c| c.what == super::WHAT).expect("the check")
        };
        assert_eq!(nearest(&[0.06; 5], &[0.03; 5]).verdict, Verdict::NotWorse, "five pairs: 1 of 32 by chance");
        assert_eq!(nearest(&[0.06; 20], &[0.03; 20]).verdict, Verdict::Worse);
        let mut one = [0.06; 20];
        one[7] = 0.01;
        assert_eq!(nearest(&[0.06; 20], &one).verdict, Verdict::NotWorse);
        assert_eq!(nearest(&[0.06; 20], &[0.056; 20]).verdict, Verdict::NotWorse, "4 mm are within the budget of 5");
        assert_eq!(nearest(&[], &[]).n, 0);
    }
}
