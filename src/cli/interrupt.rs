//! Ctrl-C and SIGTERM: the first asks the run to stop and to finish its recording, the second ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit codes of the second signal, 128 and its number, as shells give them.
const SIGNALS: [(i32, i32); 2] = [(SIGINT, 130), (SIGTERM, 143)];

/// Whether somebody asked the program to stop. Clones share the answer.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt {
    requested: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens to signals from now on.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn install() -> Result<Self> {
        let interrupt = Self::default();
        for (signal, code) in SIGNALS {
            // In this order the first signal finds no request yet.
            flag::register_conditional_shutdown(signal, code, Arc::clone(&interrupt.requested))
                .and_then(|_| flag::register(signal, Arc::clone(&interrupt.requested)))
                .context("signals cannot be listened to")?;
        }
        // A limit on file sizes shall be an error that names the file, not a kill.
        #[cfg(unix)]
        flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)))
            .context("signals cannot be listened to")?;
        Ok(interrupt)
    }

    pub fn is_requested(&self) -> bool {
        self.requested.load(Ordering::SeqCst)
    }
}
