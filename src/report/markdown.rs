//! The same figures as Markdown, for the replay's summary panel, which is narrow.

use crate::report::summary::RunSummary;
use crate::report::table::{check_lines, labelled, score_rows};

/// Lays a summary out as Markdown.
#[must_use]
pub fn markdown(summary: &RunSummary) -> String {
    let mut text = String::new();
    if let Some(score) = &summary.score {
        text.push_str("| against the truth | before | after |\n|---|--:|--:|\n");
        for [what, before, after, _] in score_rows(&score.before, score.after.as_ref()) {
            text.push_str(&format!("| {what} | {before} | {after} |\n"));
        }
        text.push('\n');
    }
    for line in check_lines(summary).iter().filter(|line| !line.starts_with("time ")) {
        let (label, rest) = labelled(line);
        text.push_str(&format!("- **{label}** {rest}\n"));
    }
    text
}
