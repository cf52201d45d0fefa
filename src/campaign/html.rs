//! The report of a campaign or of a regression as one page, in the look of a run's report.

use std::collections::BTreeSet;

use armcal_charts::{Panel, Series, Style};
use maud::{Markup, html as markup};

use crate::campaign::origin::Named;
use crate::campaign::regress::{Comparison, Verdict};
use crate::campaign::regress_report::{check_rows, conclusion};
use crate::campaign::statistics::{CampaignSummary, FailureLine};
use crate::campaign::table_file::Table;
use crate::campaign::tables::{HEADER, over_all, rows, title};
use crate::campaign::worst::worst_rows;
use crate::campaign::{Metric, Row};
use crate::report::{chart, page, panel};

/// Figures that are drawn over the seeds, with the titles of their axes.
const DRAWN: [(Metric, &str); 4] = [
    (Metric::ToolErrorAfterMedian, "tool error after, median over the targets"),
    (Metric::ToolErrorAfterMax, "tool error after, worst target"),
    (Metric::PredictedToolErrorP95, "tool error predicted, 95 %"),
    (Metric::MinClearance, "nearest to anything"),
];

/// Page of a campaign: one file that needs no network.
#[must_use]
pub(super) fn campaign_page(table: &Table, summary: &CampaignSummary) -> String {
    let body = markup! {
        (verdict(table, summary))
        (facts(table, summary))
        div.figures { @for (metric, what) in DRAWN { (shares(table, metric, what)) } }
        @for setting in &summary.settings {
            h2 { (title(setting)) }
            div.wide {
                table {
                    tr { @for name in HEADER { th { (name) } } }
                    @for row in rows(setting) { tr { @for cell in row { td { (cell) } } } }
                }
            }
            (failures(&setting.failures))
        }
        @for line in over_all(summary) { p { (line) } }
        p { small {
            "Intervals by the percentile bootstrap over the seeds. All rows are in the table beside this file."
        } }
    };
    page(&format!("Campaign of {}", summary.routine), &body)
}

fn verdict(table: &Table, summary: &CampaignSummary) -> Markup {
    let sum = |of: fn(&crate::campaign::SettingStatistics) -> usize| summary.settings.iter().map(of).sum::<usize>();
    let (runs, accepted, missed) = (sum(|s| s.runs), sum(|s| s.accepted), sum(|s| s.missed));
    let (refused, failed, touched) = (sum(|s| s.refused), sum(|s| s.failed), sum(|s| s.with_contacts));
    let class = match () {
        () if failed + touched > 0 => "red",
        () if accepted < runs => "amber",
        () => "green",
    };
    markup! {
        div class={ "verdict " (class) } {
            strong { (accepted) " of " (runs) " runs accepted" }
            p {
                (missed) " missed a limit of the script, " (refused) " refused, " (failed) " failed; "
                (touched) " with contacts."
            }
            p { b { "What to do next" } }
            ul {
                @if let Some(worst) = worst_rows(table, 1).first() {
                    li { "Look at the worst run (seed " (worst.seed) "): " code { (worst.command) } }
                }
                @if class == "green" {
                    li {
                        "Hold later versions against this table: "
                        code { "armcal regress ROUTINE.toml --baseline TABLE.csv" }
                    }
                }
                @if summary.settings.iter().any(|setting| !setting.failures.is_empty()) {
                    li { "Act on the reasons below; each has the command that repeats its run." }
                }
            }
        }
    }
}

/// Table with the origin of the rows.
fn facts(table: &Table, summary: &CampaignSummary) -> Markup {
    let seeds: BTreeSet<u64> = table.rows.iter().map(|row| row.seed).collect();
    let is_whole = table.rows.len() == seeds.len() * summary.settings.len();
    let span = match (seeds.first(), seeds.last()) {
        (Some(first), Some(last)) if is_whole && last - first + 1 == seeds.len() as u64 => {
            format!("{first} to {last}, none left out")
        }
        (Some(first), Some(last)) => format!("{} from {first} to {last}", seeds.len()),
        _ => "none".to_owned(),
    };
    let named = |of: &[Named]| of.iter().map(Named::in_words).collect::<Vec<_>>().join(", ");
    let origin = summary.origin.as_ref();
    let rows = [
        ("routine", origin.map(|origin| origin.routine.in_words())),
        ("arm", origin.map(|origin| named(&origin.robots))),
        ("vehicle", origin.map(|origin| named(&origin.vehicles))),
        ("seeds", Some(span)),
        ("settings", Some(summary.settings.len().to_string())),
        ("program", Some(format!("armcal {}", env!("CARGO_PKG_VERSION")))),
    ];
    markup! {
        h2 { "Details" }
        table.notes {
            @for (what, value) in rows.into_iter().filter_map(|(what, value)| Some((what, value?))) {
                tr { th scope="row" { (what) } td { code { (value) } } }
            }
        }
    }
}

fn failures(failures: &[FailureLine]) -> Markup {
    markup! {
        @if !failures.is_empty() {
            table.notes {
                tr { th { "seed" } th { "result" } th { "reason and command to repeat" } }
                @for FailureLine { seed, status, failure, command } in failures {
                    tr { td { (seed) } td { (status) } td { (failure) br; code { (command) } } }
                }
            }
        }
    }
}

/// Chart of the share of the seeds up to each value of a figure, one line per setting.
fn shares(table: &Table, metric: Metric, what: &str) -> Markup {
    let Some(place) = table.place(metric) else { return Markup::default() };
    let line = |rows: &[Row]| {
        let values = rows.iter().filter_map(|row| row.figures[place]).filter(|value| value.is_finite());
        let mut values: Vec<f64> = values.map(|value| value * metric.unit().scale()).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len() as f64;
        let step = |(k, value): (usize, f64)| [[value, k as f64 / n], [value, (k + 1) as f64 / n]];
        let points = values.into_iter().enumerate().flat_map(step).collect();
        Series { name: rows[0].settings.clone(), color: None, style: Style::Line, points }
    };
    let all: Vec<Series> = table.rows.chunk_by(|a, b| a.setting == b.setting).map(line).collect();
    let shown: Vec<Series> = all.into_iter().filter(|series| !series.points.is_empty()).collect();
    if shown.is_empty() {
        return Markup::default();
    }
    let x = format!("{what}, {}", metric.unit().symbol());
    chart(&Panel { title: what.to_owned(), ..panel(what, &x, "share of the seeds", shown) }, "")
}

/// Page of a comparison with a baseline: one file that needs no network.
#[must_use]
pub fn regress_page(comparison: &Comparison, routine: &str) -> String {
    let class = match comparison.verdict {
        Verdict::NotWorse => "green",
        Verdict::Inconclusive => "amber",
        Verdict::Worse => "red",
    };
    let body = markup! {
        div class={ "verdict " (class) } {
            strong { (conclusion(comparison)) }
            p { (comparison.pairs) " pairs of runs, each of one seed." }
            p { b { "What to do next" } }
            ul { li {
                @match comparison.verdict {
                    Verdict::NotWorse => "Nothing: the change may go in.",
                    Verdict::Inconclusive => "Run more seeds: the pairs fit both no change and more than the budget.",
                    Verdict::Worse => {
                        "Repeat one of the worst pairs below with the program of before and this one, and compare "
                        "their replays."
                    }
                }
            } }
        }
        h2 { "Checks" }
        div.wide {
            table {
                @for (number, cells) in check_rows(comparison).iter().enumerate() {
                    tr {
                        @for cell in cells {
                            @if number == 0 { th { (cell) } } @else { td { (cell) } }
                        }
                    }
                }
            }
        }
        @if !comparison.worst.is_empty() {
            h2 { "Worst pairs" }
            table.notes {
                @for pair in &comparison.worst { tr { td { (pair.in_words()) br; code { (pair.command) } } } }
            }
        }
    };
    page(&format!("Regression of {routine}"), &body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::{names, row};
    use crate::campaign::{RunStatus, compare, statistics};
    use armcal_core::routine::RegressSettings;

    /// Text of a page, one line per element.
    fn words(page: &str) -> String {
        let (_, body) = page.split_once("</style>").expect("a page");
        let parts = body.split('<').filter_map(|part| Some(part.split_once('>')?.1.trim()));
        let text = parts.filter(|text| !text.is_empty()).collect::<Vec<_>>().join("\n");
        text.replace(env!("CARGO_PKG_VERSION"), "VERSION")
    }

    #[test]
    fn a_campaign_that_went_well_is_green_and_one_with_failures_is_not() {
        let page_of = |rows: Vec<Row>| {
            let table = Table { names: names(), rows };
            campaign_page(&table, &statistics(&table, "<r>", "f"))
        };
        let untouched = |seed| Row { figures: vec![Some(1.0), Some(0.0), Some(0.004)], ..row(0, seed) };
        let failed = Row { status: RunStatus::Failed, failure: "<why>".to_owned(), ..untouched(7) };
        let refused = Row { status: RunStatus::Refused, ..untouched(7) };
        for (name, last, grade) in
            [("green", untouched(7), "green"), ("failed", failed, "red"), ("refused", refused, "amber")]
        {
            let page = page_of((1..=6).map(untouched).chain([last]).collect());
            assert!(page.contains(&format!("verdict {grade}")) && !page.contains("<r>"), "{page}");
            insta::assert_snapshot!(format!("campaign_{name}"), words(&page));
        }
    }

    #[test]
    fn a_worse_program_is_red_and_says_how_to_repeat_it() {
        let table = |factor: f64| {
            let of = |seed| Row { figures: vec![Some(1.0), Some(0.0), Some(0.004 * factor)], ..row(0, seed) };
            Table { names: names(), rows: (1..=6).map(of).collect() }
        };
        let page_of = |factor| regress_page(&compare(&table(1.0), &table(factor), &RegressSettings::default()), "r");
        for (name, factor, grade) in [("same", 1.0, "green"), ("worse", 1.5, "red")] {
            let page = page_of(factor);
            assert!(page.contains(&format!("verdict {grade}")), "{page}");
            insta::assert_snapshot!(format!("regress_{name}"), words(&page));
        }
    }
}
