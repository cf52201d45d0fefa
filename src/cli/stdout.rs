//! All text output: results to stdout, notes to stderr.
//!
//! A reader that has gone away (`| head`) is no error: the command continues, writes its files, and keeps its exit
//! code. A stdout that cannot be written (a full disk) is one error, reported after the files are in place. Neither is
//! a panic, which `println!` would cause; clippy denies that macro everywhere.

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

/// Writes text that was made printable before it got its colors.
pub(super) fn say_as_it_is(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    is_written(writeln!(stdout, "{text}").and_then(|()| stdout.flush()))
}

/// Returns an error if stdout could not be written, except for a closed pipe.
pub(super) fn is_written(written: IoResult<()>) -> Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("stdout: cannot be written"),
    }
}

/// True if `--quiet` was given.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Suppresses notes and progress from now on.
pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// True if notes and progress are suppressed.
pub(super) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes a line on progress or doubts to stderr, unless `--quiet` was given.
pub fn note(text: impl Display) {
    if !is_quiet() {
        complain(text);
    }
}

/// Writes a warning with its code to stderr, unless `--quiet` was given.
pub fn warn(code: Code, text: impl Display) {
    note(format_args!("warning: {text} [{code}]"));
}

/// Writes a line that must be read, printable, to stderr: errors and questions. Where stderr cannot be written, the
/// work continues.
pub fn complain(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable(&text.to_string()));
}
