//! Messages of the libraries on stderr: printable, and limited in number. Peers in a ROS domain can cause any number of
//! middleware messages, with names that they choose.

use std::io::{Result, Write};
use std::sync::atomic::{AtomicUsize, Ordering};

use armcal_core::text::printable;
use tracing_subscriber::fmt::MakeWriter;

/// Largest number of written lines.
const MAX_LINES: usize = 50;
/// Largest number of written characters of a line.
const MAX_CHARS: usize = 1000;

/// Writes lines to `W`, up to a limit.
pub(super) struct LogLines<W> {
    to: fn() -> W,
    n_written: AtomicUsize,
    max_lines: usize,
}

/// Writes one line.
pub(super) struct LogLine<'a, W> {
    lines: &'a LogLines<W>,
    /// True for an error of our own: a failed stop command is written even after many lines.
    is_own_error: bool,
}

impl<W> LogLines<W> {
    /// A writer for `level`: it writes all lines if the level includes more than warnings.
    pub fn new(level: tracing::Level, to: fn() -> W) -> Self {
        let max_lines = if level > tracing::Level::WARN { usize::MAX } else { MAX_LINES };
        Self { to, n_written: AtomicUsize::new(0), max_lines }
    }
}

impl<'a, W: Write + 'a> MakeWriter<'a> for LogLines<W> {
    type Writer = LogLine<'a, W>;

    fn make_writer(&'a self) -> Self::Writer {
        LogLine { lines: self, is_own_error: false }
    }

    fn make_writer_for(&'a self, event: &tracing::Metadata<'_>) -> Self::Writer {
        let is_own_error = *event.level() == tracing::Level::ERROR && event.target().starts_with("armcal");
        LogLine { lines: self, is_own_error }
    }
}

impl<W: Write> Write for LogLine<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let LogLines { to, n_written, max_lines } = self.lines;
        let n_written = if self.is_own_error { 0 } else { n_written.fetch_add(1, Ordering::Relaxed) };
        if n_written < *max_lines {
            let line = String::from_utf8_lossy(bytes);
            let shown: String = printable(line.trim_end()).replace(['\n', '\t'], " ").chars().take(MAX_CHARS).collect();
            writeln!(to(), "{shown}")?;
        } else if n_written == *max_lines {
            writeln!(to(), "further lines of the libraries are left out; -v prints them")?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        (self.lines.to)().flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    static WRITTEN: Mutex<Vec<u8>> = Mutex::new(Vec::new());

    struct Kept;

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            WRITTEN.lock().expect("whole").write(bytes)
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_are_printable_and_end_at_a_limit() {
        let lines = LogLines::new(tracing::Level::WARN, || Kept);
        let steering = format!(" WARN \u{1b}[2J\u{202e}\r{}\nerror: mine\n", "x".repeat(5000));
        for _ in 0..MAX_LINES + 10 {
            assert_eq!(lines.make_writer().write(steering.as_bytes()).expect("it is written"), steering.len());
        }
        LogLine { lines: &lines, is_own_error: true }.write_all(b"ERROR no stop").expect("it is written");
        let written = String::from_utf8(std::mem::take(&mut *WRITTEN.lock().expect("whole"))).expect("text");
        assert_eq!(written.lines().count(), MAX_LINES + 2);
        assert!(written.ends_with("\nERROR no stop\n"));
        assert!(written.chars().all(|c| c == '\n' || matches!(c, ' '..='~')));
        assert!(written.lines().all(|line| line.len() <= MAX_CHARS));
        let all = LogLines::new(tracing::Level::INFO, || Kept);
        assert_eq!(all.max_lines, usize::MAX);
    }
}
