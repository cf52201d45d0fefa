//! A summary as Markdown, for the replay's summary panel, which is narrow.

use crate::report::summary::RunSummary;
use crate::report::table::{check_lines, labelled, score_rows};
use crate::report::verdict::{Grade, Verdict, verdict};

/// Lays a summary out as Markdown.
#[must_use]
pub fn markdown(summary: &RunSummary) -> String {
    // The verdict comes first, and is seen without scrolling.
    let mut text = colored(&verdict(summary));
    if let Some(score) = &summary.score {
        text.push_str("| simulated truth | before | after |\n|---|--:|--:|\n");
        for [what, before, after, _] in score_rows(&score.before, score.after.as_ref()) {
            text.push_str(&format!("| {what} | {before} | {after} |\n"));
        }
        text.push('\n');
    }
    // The first check line is the verdict, which is already in the text.
    for line in check_lines(summary).iter().skip(1).filter(|line| !line.starts_with("time ")) {
        let (label, rest) = labelled(line);
        text.push_str(&format!("- **{label}** {rest}\n"));
    }
    text
}

/// Markdown quotation of the kind that the viewer draws in green, amber or red, by the verdict's grade.
fn colored(Verdict { grade, headline, reasons, next, .. }: &Verdict) -> String {
    let kind = match grade {
        Grade::Green => "TIP",
        Grade::Amber => "WARNING",
        Grade::Red => "CAUTION",
    };
    let mut text = format!("> [!{kind}]\n> **{headline}**\n");
    for (title, lines) in [("", reasons), ("Next steps", next)].iter().filter(|(_, lines)| !lines.is_empty()) {
        text.push_str(&if title.is_empty() { ">\n".to_owned() } else { format!(">\n> **{title}**\n>\n") });
        lines.iter().for_each(|line| text.push_str(&format!("> - {line}\n")));
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_has_its_color_and_is_whole() {
        let lines = |text: &str| vec![text.to_owned()];
        let (reasons, next) = (lines("elbow slipped."), lines("Fasten it."));
        for (grade, kind) in [(Grade::Green, "TIP"), (Grade::Amber, "WARNING"), (Grade::Red, "CAUTION")] {
            let (reasons, next, codes) = (reasons.clone(), next.clone(), Vec::new());
            let verdict = Verdict { grade, headline: "So it is", reasons, next, codes };
            let expected = format!(
                "> [!{kind}]\n> **So it is**\n>\n> - elbow slipped.\n>\n> **Next steps**\n>\n> - Fasten it.\n\n"
            );
            assert_eq!(colored(&verdict), expected);
        }
    }
}
