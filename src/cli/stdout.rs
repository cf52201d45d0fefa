//! Text to stdout: a reader that has gone away is no error, a full disk is one, and neither is a panic.

use std::io::{ErrorKind, Write};

use anyhow::{Context, Result};
use armcal_core::text::printable;

/// Writes `text`, printable, and ends the line.
pub(super) fn say(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{}", printable(text)).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("stdout: cannot be written"),
    }
}
