//! A campaign's summary for people: millimetres, seconds, seeds.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, Table as Grid};

use crate::campaign::statistics::WeightedRate;
use crate::campaign::{CampaignSummary, FigureStatistics, Metric, SettingStatistics};
use crate::report::fit_columns;

/// Figures in the summary for people, with their descriptions; the JSON has all figures.
const SHOWN: [(Metric, &str); 14] = [
    (Metric::ToolErrorBeforeMedian, "tool error before, median over the targets"),
    (Metric::ToolErrorAfterMedian, "tool error after, median over the targets"),
    (Metric::ToolErrorAfterP95, "tool error after, 95 % of the targets"),
    (Metric::ToolErrorAfterMax, "tool error after, worst target"),
    (Metric::ToolErrorImprovement, "tool error, before over after"),
    (Metric::ReachErrorAfterMedian, "miss after, median over the targets"),
    (Metric::ReachErrorAfterMax, "miss after, worst target"),
    (Metric::MinClearance, "nearest to anything"),
    (Metric::ResidualRmsPx, "residual of the fit"),
    (Metric::CornerScatterPx, "scatter of a tag's corners"),
    (Metric::HeldOutRms, "held-out tags off by"),
    (Metric::PredictedToolErrorP95, "tool error predicted, 95 %"),
    (Metric::Nees, "NEES (3 is right)"),
    (Metric::SimulatedTime, "simulated time"),
];

pub(super) const HEADER: [&str; 6] =
    ["figure over the seeds", "n", "median", "its 95 % interval", "95 % of seeds", "worst (seed)"];

pub(super) fn rows(setting: &SettingStatistics) -> Vec<[String; 6]> {
    let row = |&(metric, what): &(Metric, &str)| {
        let figure = setting.figures.iter().find(|figure| figure.name == metric.name())?;
        let unit = metric.unit();
        let FigureStatistics { n, median, median_low, median_high, p95, worst, worst_seed, .. } = figure;
        Some([
            what.to_owned(),
            n.to_string(),
            unit.shown(*median, 2),
            format!("{} .. {}", unit.number(*median_low, 2), unit.number(*median_high, 2)),
            unit.shown(*p95, 2),
            format!("{} ({worst_seed})", unit.shown(*worst, 2)),
        ])
    };
    SHOWN.iter().filter_map(row).collect()
}

pub(super) fn title(setting: &SettingStatistics) -> String {
    let SettingStatistics { settings, runs, accepted, missed, refused, failed, with_contacts, .. } = setting;
    let weight = setting.weight.map_or_else(String::new, |weight| format!(" (weight {weight:.3})"));
    let which = if settings.is_empty() { String::new() } else { format!("{settings}{weight}: ") };
    format!(
        "{which}{runs} runs: {accepted} accepted, {missed} missed a limit, {refused} refused, {failed} failed; \
         {with_contacts} with contacts"
    )
}

/// Lays a summary out for a terminal with `width` columns, or without a limit of the width.
#[must_use]
pub fn table(summary: &CampaignSummary, width: Option<usize>) -> String {
    let mut text = String::new();
    for setting in &summary.settings {
        text.push_str(&title(setting));
        for result in summary.until.iter().filter(|result| result.setting == Some(setting.setting)) {
            text.push_str(&format!("\n{result}"));
        }
        let mut grid = Grid::new();
        grid.load_preset(UTF8_FULL_CONDENSED).set_header(HEADER);
        let rows = rows(setting);
        for row in &rows {
            grid.add_row(row);
        }
        for index in 1..HEADER.len() {
            if let Some(column) = grid.column_mut(index) {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        if !rows.is_empty() {
            fit_columns(&mut grid, width);
            text.push_str(&format!("\n{grid}"));
        }
        for failure in &setting.failures {
            text.push_str(&format!(
                "\nseed {} {}: {}\n  {}",
                failure.seed, failure.status, failure.failure, failure.command
            ));
        }
        text.push('\n');
    }
    for line in over_all(summary) {
        text.push_str(&format!("{line}\n"));
    }
    text
}

/// Rates over all settings by their weights, and the answers to limits on these.
pub(super) fn over_all(summary: &CampaignSummary) -> Vec<String> {
    let rate = |rate: &WeightedRate| {
        let found = rate.rate.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.2e}"));
        format!("{} over all settings by their weights: {found}, {:.2e} .. {:.2e}", rate.event, rate.low, rate.high)
    };
    let answers = summary.until.iter().filter(|result| result.setting.is_none());
    summary.weighted.iter().map(rate).chain(answers.map(ToString::to_string)).collect()
}

/// The summary as Markdown.
#[must_use]
pub fn markdown(summary: &CampaignSummary) -> String {
    let mut text = format!("# Campaign of `{}`\n", summary.routine);
    for setting in &summary.settings {
        text.push_str(&format!("\n{}\n\n| {} |\n|---|--:|--:|--:|--:|--:|\n", title(setting), HEADER.join(" | ")));
        for row in rows(setting) {
            text.push_str(&format!("| {} |\n", row.join(" | ")));
        }
        for failure in &setting.failures {
            let (seed, status, why, command) = (failure.seed, &failure.status, &failure.failure, &failure.command);
            text.push_str(&format!("\n- seed {seed} {status}: {why}; `{command}`"));
        }
        if !setting.failures.is_empty() {
            text.push('\n');
        }
    }
    for line in over_all(summary) {
        text.push_str(&format!("\n- {line}"));
    }
    if !summary.weighted.is_empty() {
        text.push('\n');
    }
    text.push_str(
        "\nIntervals by the percentile bootstrap over the seeds. All figures are in the JSON beside this file.\n",
    );
    text
}
