//! The one way out for text: results to stdout, notes to stderr.
//!
//! A reader that has gone away (`| head`) is no error: the command works on, writes its files, and exits as it would
//! have. A stdout that cannot be written (a full disk) is one error, told after the files are in place. Neither is a
//! panic, as `println!` would make it; clippy denies that everywhere.

use std::fmt::Display;
use std::io::{ErrorKind, Result as IoResult, Write};

use anyhow::{Context, Result};
use armcal_core::text::printable;

/// Writes `text`, printable, to stdout and ends the line.
pub(super) fn say(text: &str) -> Result<()> {
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

/// Writes a line, printable, to stderr. Where that cannot be written nobody can be told, and the work goes on.
pub(super) fn note(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable(&text.to_string()));
}
