//! The one way out for text: results to stdout, notes to stderr.
//!
//! A reader that has gone away (`| head`) is no error: the command works on, writes its files, and exits as it would
//! have. A stdout that cannot be written (a full disk) is one error, told after the files are in place. Neither is a
//! panic, as `println!` would make it; clippy denies that everywhere.

use std::fmt::Display;
use std::io::{ErrorKind, Result as IoResult, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use armcal_core::codes::Code;
use armcal_core::text::printable;

/// Writes `text`, printable, to stdout and ends the line.
pub fn say(text: &str) -> Result<()> {
    say_as_it_is(&printable(text))
}

/// The same of text that was made printable before it got its colors.
pub(super) fn say_as_it_is(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    is_written(writeln!(stdout, "{text}").and_then(|()| stdout.flush()))
}

/// Whether stdout took what it was given.
pub(super) fn is_written(written: IoResult<()>) -> Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("stdout: cannot be written"),
    }
}

/// Whether `--quiet` was given.
static QUIET: AtomicBool = AtomicBool::new(false);

/// From now on notes and progress are left out.
pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether notes and progress are left out.
pub(super) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes a line of what goes on or is doubtful to stderr, unless `--quiet` was given.
pub fn note(text: impl Display) {
    if !is_quiet() {
        complain(text);
    }
}

/// Writes a warning with its code to stderr, unless `--quiet` was given.
pub fn warn(code: Code, text: impl Display) {
    note(format_args!("warning: {text} [{code}]"));
}

/// Writes a line that must be read, printable, to stderr: errors and questions. Where that cannot be written nobody can
/// be told, and the work goes on.
pub fn complain(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable(&text.to_string()));
}
