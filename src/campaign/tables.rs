//! A campaign's summary for people: millimetres, seconds, seeds.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, Table as Grid};

use crate::campaign::{CampaignSummary, FigureStatistics, SettingStatistics};

/// A figure that people look at first; the JSON has all of them.
struct Shown {
    name: &'static str,
    what: &'static str,
    scale: f64,
    unit: &'static str,
}

const fn mm(name: &'static str, what: &'static str) -> Shown {
    Shown { name, what, scale: 1e3, unit: "mm" }
}

const fn plain(name: &'static str, what: &'static str, unit: &'static str) -> Shown {
    Shown { name, what, scale: 1.0, unit }
}

const SHOWN: [Shown; 14] = [
    mm("tool_error_before_median_m", "tool error before, median over the targets"),
    mm("tool_error_after_median_m", "tool error after, median over the targets"),
    mm("tool_error_after_p95_m", "tool error after, 95 % of the targets"),
    mm("tool_error_after_max_m", "tool error after, worst target"),
    plain("tool_error_improvement", "tool error, before over after", "x"),
    mm("reach_error_after_median_m", "miss after, median over the targets"),
    mm("reach_error_after_max_m", "miss after, worst target"),
    mm("min_clearance_m", "nearest to anything"),
    plain("residual_rms_px", "residual of the fit", "px"),
    plain("corner_scatter_px", "scatter of a tag's corners", "px"),
    mm("held_out_rms_m", "held-out tags off by"),
    mm("predicted_tool_error_p95_m", "tool error predicted, 95 %"),
    plain("nees", "NEES (3 is right)", ""),
    plain("simulated_s", "simulated time", "s"),
];

const HEADER: [&str; 6] =
    ["figure over the seeds", "n", "median", "its 95 % interval", "95 % of seeds", "worst (seed)"];

fn rows(setting: &SettingStatistics) -> Vec<[String; 6]> {
    let row = |shown: &Shown| {
        let figure = setting.figures.iter().find(|figure| figure.name == shown.name)?;
        let show = |value: f64| format!("{:.2} {}", value * shown.scale, shown.unit).trim_end().to_owned();
        let FigureStatistics { n, median, median_low, median_high, p95, worst, worst_seed, .. } = figure;
        Some([
            shown.what.to_owned(),
            n.to_string(),
            show(*median),
            format!("{:.2} .. {:.2}", median_low * shown.scale, median_high * shown.scale),
            show(*p95),
            format!("{} ({worst_seed})", show(*worst)),
        ])
    };
    SHOWN.iter().filter_map(row).collect()
}

fn title(setting: &SettingStatistics) -> String {
    let SettingStatistics { settings, runs, accepted, missed, refused, failed, with_contacts, .. } = setting;
    let which = if settings.is_empty() { String::new() } else { format!("{settings}: ") };
    format!(
        "{which}{runs} runs: {accepted} accepted, {missed} missed a limit, {refused} refused, {failed} failed; {with_contacts} with contacts"
    )
}

/// Lays a summary out for a terminal.
#[must_use]
pub fn table(summary: &CampaignSummary) -> String {
    let mut text = String::new();
    for setting in &summary.settings {
        text.push_str(&title(setting));
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
    text
}

/// The same as Markdown.
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
    text.push_str(
        "\nIntervals by the percentile bootstrap over the seeds. All figures are in the JSON beside this file.\n",
    );
    text
}
