//! The same figures as Markdown, for the replay's summary panel, which is narrow.

use crate::report::summary::RunSummary;
use crate::report::table::{check_lines, labelled, score_rows};

/// Lays a summary out as Markdown.
#[must_use]
pub fn markdown(summary: &RunSummary) -> String {
    let lines = check_lines(summary);
    // The verdict comes first, and is seen without scrolling.
    let (verdict, rest) = lines.split_at(lines.len().min(1));
    let mut text: String = verdict.iter().map(|line| format!("**{}**\n\n", in_words(line))).collect();
    if let Some(score) = &summary.score {
        text.push_str("| against the truth | before | after |\n|---|--:|--:|\n");
        for [what, before, after, _] in score_rows(&score.before, score.after.as_ref()) {
            text.push_str(&format!("| {what} | {before} | {after} |\n"));
        }
        text.push('\n');
    }
    for line in rest.iter().filter(|line| !line.starts_with("time ")) {
        let (label, rest) = labelled(line);
        text.push_str(&format!("- **{label}** {rest}\n"));
    }
    text
}

fn in_words(line: &str) -> String {
    let (label, rest) = labelled(line);
    format!("{label} {rest}")
}
