//! Signals SIGINT (Ctrl-C), SIGTERM and SIGHUP: the first asks the work to stop and to finish its files, the second
//! ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Flag of a requested stop. Clones share it.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt {
    requested: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens to signals from now on. The exit code of the second signal is 128 plus its number, as in shells.
    ///
    /// # Errors
    /// An error of the system.
    pub fn install() -> Result<Self> {
        let interrupt = Self::default();
        let mut signals = vec![SIGINT, SIGTERM];
        #[cfg(unix)]
        signals.extend(Some(signal_hook::consts::SIGHUP).filter(|signal| !is_ignored(*signal)));
        for signal in signals {
            // With this order of registration the first signal finds no request yet.
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&interrupt.requested))
                .and_then(|_| flag::register(signal, Arc::clone(&interrupt.requested)))
                .context("signals cannot be listened to")?;
        }
        // Exceeding a limit on file sizes shall be an error that names the file, not a kill.
        #[cfg(unix)]
        flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)))
            .context("signals cannot be listened to")?;
        Ok(interrupt)
    }

    pub fn is_requested(&self) -> bool {
        self.requested.load(Ordering::SeqCst)
    }

    /// The request as a flag.
    #[cfg(feature = "sim")]
    pub fn flag(&self) -> &AtomicBool {
        &self.requested
    }
}

/// True if the program was started to ignore this signal, as `nohup` does with SIGHUP; known only on Linux.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}
