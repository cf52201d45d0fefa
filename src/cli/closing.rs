//! The closing lines of a command: whole lines for programs; wrapped and colored on a terminal.

use std::io::{IsTerminal, stdout};

use anyhow::{Context, Result};
use armcal_core::text::printable;
use clap::Args;

use crate::cli::stdout::{is_quiet, say, say_as_it_is};
use crate::report::{RunSummary, closing, table};

/// Width of the label of every line; continuation lines are indented by it.
const LABEL_WIDTH: usize = 13;
/// Least width of the lines, also on a narrower terminal.
const MIN_WIDTH: usize = 40;
const GREEN: &str = "\u{1b}[32m";
const RED: &str = "\u{1b}[31m";
const DIM: &str = "\u{1b}[2m";
const PLAIN: &str = "\u{1b}[0m";
/// Words of a result, with their colors.
const COLORED: [(&str, &str); 4] = [("ACCEPTED", GREEN), ("REFUSED", RED), ("FAILS", RED), ("CONTRADICTS", RED)];

/// Capabilities of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Look {
    /// Number of columns; `None` where lines have no limit, as in a pipe.
    width: Option<usize>,
    colors: bool,
}

impl Look {
    fn of_stdout() -> Self {
        let is_terminal = stdout().is_terminal();
        let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
        // By https://no-color.org any value but an empty one disables colors.
        let wants_none = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
        Self { width: width.filter(|_| is_terminal), colors: is_terminal && !wants_none && !is_dumb }
    }
}

/// File name after which the closing lines mention further output.
const REPORT: &str = "report.html";

/// What is said at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Args)]
pub(super) struct ClosingArgs {
    /// Print all tables, findings and counts; default: the verdict and its figures
    #[arg(long)]
    details: bool,
    /// Print summary.json instead of text
    #[arg(long, conflicts_with = "details")]
    pub json: bool,
}

impl ClosingArgs {
    /// Writes the verdict and its figures, then `next`: the folder of the files and the next step.
    pub fn say(self, summary: &RunSummary, next: &str) -> Result<()> {
        if self.json {
            return say(&serde_json::to_string_pretty(summary).context("the summary has no JSON form")?);
        }
        let text = if self.details { table(summary) } else { closing(summary) };
        let lines = if is_quiet() { 1 } else { usize::MAX };
        let text = if self.details { text } else { text.lines().take(lines).collect::<Vec<_>>().join("\n") };
        let next = match (is_quiet(), self.details) {
            (true, _) => String::new(),
            (false, true) => format!("\n{next}"),
            (false, false) => {
                format!("\n{}", next.replacen(REPORT, &format!("{REPORT}; print all figures with --details"), 1))
            }
        };
        say_closing(&format!("{text}{next}"))
    }
}

/// Number of columns if stdout is a terminal.
pub(super) fn terminal_width() -> Option<usize> {
    Look::of_stdout().width
}

/// Writes lines to stdout, wrapped where a terminal is narrower.
pub(super) fn say_wrapped(text: &str) -> Result<()> {
    say_as_it_is(&laid_out(&printable(text), Look { colors: false, ..Look::of_stdout() }))
}

/// Writes the closing lines to stdout.
pub(super) fn say_closing(text: &str) -> Result<()> {
    say_as_it_is(&laid_out(&printable(text), Look::of_stdout()))
}

fn laid_out(text: &str, look: Look) -> String {
    let lines = text.lines().map(|line| {
        let wrapped = look.width.map_or_else(|| line.to_owned(), |width| wrapped(line, width.max(MIN_WIDTH)));
        if look.colors { colored(&wrapped) } else { wrapped }
    });
    lines.collect::<Vec<String>>().join("\n")
}

/// True for lines of tables, which are never wrapped because they are short.
fn is_of_table(line: &str) -> bool {
    line.starts_with(|c: char| ('\u{2500}'..='\u{257f}').contains(&c))
}

fn wrapped(line: &str, width: usize) -> String {
    if is_of_table(line) {
        return line.to_owned();
    }
    let indent = " ".repeat(LABEL_WIDTH);
    let options = textwrap::Options::new(width).subsequent_indent(&indent).break_words(false);
    textwrap::fill(line, options)
}

fn colored(line: &str) -> String {
    if is_of_table(line) {
        return line.to_owned();
    }
    let (label, rest) = line.split_at_checked(LABEL_WIDTH).unwrap_or(("", line));
    let shade = |rest: String, (word, color): (&str, &str)| rest.replace(word, &format!("{color}{word}{PLAIN}"));
    let rest = COLORED.into_iter().fold(rest.to_owned(), shade);
    let label = if label.is_empty() { String::new() } else { format!("{DIM}{label}{PLAIN}") };
    label + &rest
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: &str = "│ a table stays │\ncalibration  ACCEPTED\nheld out     30 views, 5-fold cross-validation: tag \
                         position error 6.8 mm rms (datasheet sensors: 161.8 mm)";

    #[test]
    fn a_pipe_gets_whole_lines() {
        assert_eq!(laid_out(LINES, Look { width: None, colors: false }), LINES);
    }

    #[test]
    fn a_terminal_gets_lines_that_fit_and_no_word_is_broken() {
        for width in [80, 120] {
            let shown = laid_out(LINES, Look { width: Some(width), colors: false });
            assert!(shown.lines().all(|line| line.chars().count() <= width), "{shown}");
            let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<String>>();
            assert_eq!(words(&shown), words(LINES));
        }
        let narrow = laid_out(LINES, Look { width: Some(80), colors: false });
        assert!(narrow.lines().nth(3).is_some_and(|line| line.starts_with("             ")), "{narrow}");
    }

    #[test]
    fn the_verdict_has_a_color_where_colors_are_wanted() {
        let shown = laid_out(LINES, Look { width: None, colors: true });
        assert!(shown.contains("\u{1b}[32mACCEPTED\u{1b}[0m") && shown.contains("\u{1b}[2mheld out     \u{1b}[0m"));
        assert!(shown.starts_with("│ a table stays │\n"));
    }
}
