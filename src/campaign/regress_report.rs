//! A comparison for people and for build systems: table, Markdown, JUnit.

use comfy_table::Table as Grid;
use comfy_table::presets::{ASCII_MARKDOWN, UTF8_FULL_CONDENSED};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use crate::campaign::regress::{Check, Comparison, Verdict, WorstPair};
use crate::report::fit_columns;

impl Verdict {
    fn word(self) -> &'static str {
        match self {
            Self::NotWorse => "ok",
            Self::Inconclusive => "inconclusive",
            Self::Worse => "WORSE",
        }
    }
}

impl Check {
    fn value_text(&self) -> String {
        self.value.map_or_else(|| "-".to_owned(), |value| self.shown(value))
    }

    fn interval_text(&self) -> String {
        let number = |value| self.shown(value).trim_start_matches("x ").to_owned();
        match (self.low, self.high) {
            (Some(low), Some(high)) => format!("{} .. {}", number(low), number(high)),
            (Some(low), None) => format!("from {}", number(low)),
            (None, _) => String::new(),
        }
    }

    fn budget_text(&self) -> String {
        let below = if self.unit == armcal_core::units::Unit::Ratio { "below " } else { "" };
        format!("{below}{}", self.shown(self.budget))
    }

    fn verdict_text(&self) -> &'static str {
        match (self.verdict, self.n) {
            (Verdict::NotWorse, 0) => "no pairs",
            (verdict, _) => verdict.word(),
        }
    }

    fn in_words(&self) -> String {
        let interval = self.interval_text();
        let interval = if interval.is_empty() { interval } else { format!(" ({interval})") };
        format!("{}{interval} in {} pairs, budget {}", self.value_text(), self.n, self.budget_text())
    }
}

impl WorstPair {
    pub(super) fn in_words(&self) -> String {
        let setting = if self.settings.is_empty() { String::new() } else { format!(" ({})", self.settings) };
        format!("{}: seed {}{setting}: {}", self.what, self.seed, self.detail)
    }
}

/// Header and rows of the table.
pub(super) fn check_rows(comparison: &Comparison) -> Vec<[String; 6]> {
    let header = ["new over baseline, by seed", "pairs", "typical", "interval", "budget", "result"];
    let row = |check: &Check| {
        let (value, interval, budget) = (check.value_text(), check.interval_text(), check.budget_text());
        [check.what.to_owned(), check.n.to_string(), value, interval, budget, check.verdict_text().to_owned()]
    };
    [header.map(str::to_owned)].into_iter().chain(comparison.checks.iter().map(row)).collect()
}

fn grid(comparison: &Comparison, preset: &str) -> Grid {
    let mut grid = Grid::new();
    grid.load_preset(preset);
    let mut rows = check_rows(comparison).into_iter();
    grid.set_header(rows.next().unwrap_or_default());
    grid.add_rows(rows);
    grid
}

/// The last line: the overall result.
pub(super) fn conclusion(comparison: &Comparison) -> &'static str {
    match comparison.verdict {
        Verdict::Worse => "WORSE than the baseline",
        Verdict::Inconclusive => {
            "INCONCLUSIVE: the pairs fit both no change and more than the budget; take more seeds, or let it pass with \
             --allow-inconclusive"
        }
        Verdict::NotWorse => "not worse than the baseline",
    }
}

const SAME: &str = "every figure of every run is the same as in the baseline";

/// Lays a comparison out for a terminal with `width` columns, or without a limit of the width.
#[must_use]
pub fn regress_table(comparison: &Comparison, width: Option<usize>) -> String {
    let mut grid = grid(comparison, UTF8_FULL_CONDENSED);
    fit_columns(&mut grid, width);
    let mut text = grid.to_string();
    if comparison.identical && comparison.pairs > 0 {
        text.push_str(&format!("\n{SAME}"));
    }
    for pair in &comparison.worst {
        text.push_str(&format!("\n{}\n  {}", pair.in_words(), pair.command));
    }
    format!("{text}\nregress      {}", conclusion(comparison))
}

/// The comparison as Markdown, for the page of a build.
#[must_use]
pub fn regress_markdown(comparison: &Comparison, routine: &str) -> String {
    let mut text =
        format!("# Regression of `{routine}`\n\n{}\n\n{}\n", conclusion(comparison), grid(comparison, ASCII_MARKDOWN));
    if comparison.identical && comparison.pairs > 0 {
        text.push_str(&format!("\n{SAME}\n"));
    }
    for pair in &comparison.worst {
        text.push_str(&format!("\n- {}; `{}`", pair.in_words(), pair.command));
    }
    if !comparison.worst.is_empty() {
        text.push('\n');
    }
    text
}

/// The comparison as JUnit XML: one test case per check, which fails where the check is worse. `inconclusive` is the
/// treatment of checks that decide nothing.
///
/// # Errors
/// An error if the text cannot be made.
pub fn regress_junit(
    comparison: &Comparison,
    routine: &str,
    inconclusive: Undecided,
) -> Result<String, quick_junit::SerializeError> {
    let mut suite = TestSuite::new(format!("regression of {routine}"));
    for check in &comparison.checks {
        let mut status = match (check.verdict, inconclusive) {
            (Verdict::NotWorse, _) => TestCaseStatus::success(),
            (Verdict::Inconclusive, Undecided::Passes) => TestCaseStatus::skipped(),
            (Verdict::Inconclusive, Undecided::Fails) | (Verdict::Worse, _) => {
                TestCaseStatus::non_success(NonSuccessKind::Failure)
            }
        };
        if check.verdict != Verdict::NotWorse {
            status.set_message(check.in_words()).set_type(check.verdict.word());
            let pairs = comparison.worst.iter().filter(|pair| pair.what == check.what);
            let pairs = pairs.map(|pair| format!("{}\n  {}", pair.in_words(), pair.command));
            status.set_description(pairs.collect::<Vec<_>>().join("\n"));
        }
        let mut case = TestCase::new(check.what, status);
        case.set_classname(routine).set_system_out(check.in_words());
        suite.add_test_case(case);
    }
    let mut report = Report::new("armcal regress");
    report.add_test_suite(suite);
    report.to_string()
}

/// Treatment of a check that decides nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undecided {
    Fails,
    Passes,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::compare;
    use crate::campaign::table_file::tests::{names, row};
    use crate::campaign::{Row, Table};
    use armcal_core::routine::RegressSettings;

    fn comparison(factor: f64) -> Comparison {
        let table = |factor: f64| {
            let of = |seed| Row { figures: vec![Some(1.0), Some(0.0), Some(0.004 * factor)], ..row(0, seed) };
            Table { names: names(), rows: (1..=6).map(of).collect() }
        };
        compare(&table(1.0), &table(factor), &RegressSettings::default())
    }

    #[test]
    fn builds_read_which_check_failed_and_how_to_repeat_it() {
        let worse = comparison(1.5);
        let xml = regress_junit(&worse, "r", Undecided::Fails).expect("XML");
        assert!(xml.contains("failures=\"1\""), "{xml}");
        insta::assert_snapshot!("worse_junit", xml);
        let same = regress_junit(&comparison(1.0), "r", Undecided::Fails).expect("XML");
        assert!(same.contains("failures=\"0\""), "{same}");
        insta::assert_snapshot!("worse_markdown", regress_markdown(&worse, "r"));
        let json = serde_json::to_value(&worse).expect("JSON");
        assert_eq!((&json["verdict"], &json["pairs"]), (&"worse".into(), &6.into()));
    }

    #[test]
    fn what_decides_nothing_fails_or_is_skipped() {
        let mut undecided = comparison(1.0);
        undecided.checks[5].verdict = Verdict::Inconclusive;
        let fails = regress_junit(&undecided, "r", Undecided::Fails).expect("XML");
        assert!(fails.contains("failures=\"1\""), "{fails}");
        let passes = regress_junit(&undecided, "r", Undecided::Passes).expect("XML");
        assert!(passes.contains("failures=\"0\"") && passes.contains("<skipped"), "{passes}");
    }
}
