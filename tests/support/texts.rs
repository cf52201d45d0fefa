//! Whole texts for people, kept in tests/snapshots. `INSTA_UPDATE=always cargo test --release` updates them, and a
//! person reviews the difference.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::process::Command;

use super::{Answer, root};

thread_local! {
    /// Output of the program since [`Texts::of`], by thread: a test runs on one.
    static PAGE: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Collector of the program's output for a test; at its end the texts are compared with the snapshot of that name.
#[must_use = "the texts are compared when it is dropped"]
pub struct Texts {
    name: &'static str,
}

impl Texts {
    pub fn of(name: &'static str) -> Self {
        PAGE.with(|page| *page.borrow_mut() = Some(String::new()));
        Self { name }
    }
}

impl Drop for Texts {
    fn drop(&mut self) {
        let page = PAGE.with(|page| page.borrow_mut().take()).unwrap_or_default();
        if std::thread::panicking() {
            return;
        }
        let mut settings = insta::Settings::clone_current();
        settings.set_snapshot_path(root().join("tests/snapshots"));
        settings.set_prepend_module_to_snapshot(false);
        settings.set_omit_expression(true);
        settings.bind(|| insta::assert_snapshot!(self.name, page));
    }
}

/// Number of lines of one text that are kept; later ones are data.
const MOST_LINES: usize = 40;

/// Adds a text to the page of this test, if it has one.
pub fn note(what: &str, text: &str) {
    PAGE.with(|page| {
        if let Some(page) = page.borrow_mut().as_mut() {
            let lines: Vec<&str> = text.trim_end().lines().take(MOST_LINES).collect();
            let _ = write!(page, "--- {}\n{}\n", plain(what), plain(&lines.join("\n")));
        }
    });
}

/// Adds a text whose figures depend on the processor in their last digits.
pub fn note_without_digits(what: &str, text: &str) {
    // Names of folders are replaced first, because they contain digits.
    note(what, &without_digits(&plain(text)));
}

/// Adds an answer: the whole text where it is the same on every machine, else its errors.
pub fn note_answer(command: &Command, answer: &Answer) {
    const OF_FILES_ALONE: [&str; 6] = ["check", "explain", "export", "inspect", "new-robot", "--version"];
    let Answer { code, stdout, stderr } = answer;
    let words: Vec<_> = command.get_args().map(|word| word.to_string_lossy()).collect();
    let what = format!("armcal {}: exit code {code}", words.join(" "));
    if *code == 2 || words.first().is_some_and(|first| OF_FILES_ALONE.contains(&first.as_ref())) {
        note(&what, &format!("{stderr}{stdout}"));
    } else if let Some(error) = stderr.lines().find(|line| line.starts_with("error: ")) {
        note_without_digits(&what, error);
    }
}

/// The text without the parts that depend on the machine: folders, times and the version.
fn plain(text: &str) -> String {
    let text = text.replace(env!("CARGO_PKG_VERSION"), "VERSION");
    let temporary = std::env::temp_dir().display().to_string();
    let mut text = text.replace(env!("CARGO_TARGET_TMPDIR"), "TARGET").replace(&root().display().to_string(), "ROOT");
    // Temporary folders have random names.
    for start in [format!("{temporary}/.tmp"), "TARGET/shared-runs/.tmp".to_owned()] {
        while let Some(at) = text.find(&start) {
            let end = at + start.len();
            let name = text[end..].chars().take_while(|c| c.is_ascii_alphanumeric()).count();
            text.replace_range(at..end + name, "FOLDER");
        }
    }
    text
}

/// Replaces each number of a text by `#`, and removes the widths of columns, because a run's figures differ in their
/// last digits between processors.
fn without_digits(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars() {
        let is_number = plain.ends_with('#') && (c.is_ascii_digit() || c == '.');
        let is_again = [' ', '─', '═'].contains(&c) && plain.ends_with(c);
        match c {
            _ if is_number || is_again => {}
            '0'..='9' => plain.push('#'),
            c => plain.push(c),
        }
    }
    plain
}
