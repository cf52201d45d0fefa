//! Bound on the memory that peers can make the program take. The DDS middleware has none: a fragment may claim a sample
//! of 4 GB, and a heartbeat any number of samples.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::LiveError;

/// Largest growth of the program while peers can reach it. A whole run takes 60 MB.
const MAX_GROWTH_BYTES: u64 = 256_000_000;
/// Further growth at which the program ends at once, regardless of unfinished work.
const FURTHER_BYTES: u64 = 128_000_000;
/// Time between two looks at the memory.
const LOOK: Duration = Duration::from_millis(5);
/// Time that the program has to stop the arm and to finish its files once it has grown too much.
const GRACE: Duration = Duration::from_secs(5);

/// Watches the program's memory on a thread of its own, as long as it lives. Systems without /proc are not watched.
pub struct MemoryWatch(Arc<Shared>);

struct Shared {
    limit_bytes: u64,
    /// Growth that exceeded the limit; zero if none did.
    grown_bytes: AtomicU64,
    is_over: AtomicBool,
}

impl MemoryWatch {
    /// Watches from now on; the program's own work may take `own_bytes` more than it has now. `emergency` is to end the
    /// program: it is called where the program does not end by itself soon after it grew too much.
    ///
    /// # Errors
    /// [`LiveError::Thread`].
    pub fn start(own_bytes: u64, emergency: impl FnOnce(LiveError) + Send + 'static) -> Result<Self, LiveError> {
        Self::watching(MAX_GROWTH_BYTES.saturating_add(own_bytes), resident_bytes, emergency)
    }

    /// Watches what `resident` says.
    fn watching(
        limit_bytes: u64,
        resident: impl Fn() -> Option<u64> + Send + 'static,
        emergency: impl FnOnce(LiveError) + Send + 'static,
    ) -> Result<Self, LiveError> {
        let (grown_bytes, is_over) = (AtomicU64::new(0), AtomicBool::new(false));
        let shared = Arc::new(Shared { limit_bytes, grown_bytes, is_over });
        let theirs = Arc::clone(&shared);
        let watch = move || {
            if let Some(error) = theirs.watch(resident) {
                emergency(error);
            }
        };
        std::thread::Builder::new().name("memory".to_owned()).spawn(watch).map_err(LiveError::Thread)?;
        Ok(Self(shared))
    }

    /// Fails from the moment on in which the program has grown too much.
    ///
    /// # Errors
    /// [`LiveError::Memory`].
    pub fn check(&self) -> Result<(), LiveError> {
        match self.0.grown_bytes.load(Ordering::SeqCst) {
            0 => Ok(()),
            grown_bytes => Err(self.0.too_much(grown_bytes)),
        }
    }
}

impl Drop for MemoryWatch {
    fn drop(&mut self) {
        self.0.is_over.store(true, Ordering::SeqCst);
    }
}

impl Shared {
    /// Returns the error that the program did not end with in time; `None` once it is over.
    fn watch(&self, resident: impl Fn() -> Option<u64>) -> Option<LiveError> {
        let first_bytes = resident()?;
        let mut since: Option<Instant> = None;
        while !self.is_over.load(Ordering::SeqCst) {
            let grown_bytes = resident()?.saturating_sub(first_bytes);
            if grown_bytes > self.limit_bytes && since.is_none() {
                self.grown_bytes.store(grown_bytes, Ordering::SeqCst);
                since = Some(Instant::now());
            }
            let is_hopeless = grown_bytes > self.limit_bytes.saturating_add(FURTHER_BYTES);
            if since.is_some_and(|since| is_hopeless || since.elapsed() > GRACE) {
                return Some(self.too_much(grown_bytes));
            }
            std::thread::sleep(LOOK);
        }
        None
    }

    fn too_much(&self, grown_bytes: u64) -> LiveError {
        LiveError::Memory { grown_mb: grown_bytes / 1_000_000, limit_mb: self.limit_bytes / 1_000_000 }
    }
}

/// Memory of this process that is in use.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.strip_suffix("kB"))?;
    kilobytes.trim().parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::codes::{Code, Coded};
    use std::sync::mpsc::{Receiver, channel};

    const START_BYTES: u64 = 50_000_000;
    const LIMIT_BYTES: u64 = 300_000_000;

    /// Figures instead of a process.
    #[derive(Default)]
    struct Figures {
        grown_bytes: AtomicU64,
        n_looks: AtomicU64,
    }

    impl Figures {
        fn set(&self, grown_bytes: u64) {
            self.grown_bytes.store(grown_bytes, Ordering::SeqCst);
        }

        /// Waits for two looks: the first may have begun before.
        fn wait(&self) {
            let seen = self.n_looks.load(Ordering::SeqCst);
            let start = Instant::now();
            while self.n_looks.load(Ordering::SeqCst) < seen + 2 && start.elapsed().as_secs() < 20 {
                std::thread::sleep(LOOK);
            }
        }
    }

    /// A watch that has seen the start, and what it ends the program with.
    fn watch(figures: &Arc<Figures>) -> (MemoryWatch, Receiver<LiveError>) {
        let (told, ended) = channel();
        let theirs = Arc::clone(figures);
        let resident = move || {
            theirs.n_looks.fetch_add(1, Ordering::SeqCst);
            Some(START_BYTES + theirs.grown_bytes.load(Ordering::SeqCst))
        };
        let tell = move |error| told.send(error).expect("the test hears it");
        let watch = MemoryWatch::watching(LIMIT_BYTES, resident, tell).expect("a thread");
        figures.wait();
        (watch, ended)
    }

    #[test]
    fn a_program_that_grows_too_much_is_told_and_then_ended() {
        let figures = Arc::<Figures>::default();
        let (watch, ended) = watch(&figures);
        let grow = |bytes: u64| {
            figures.set(bytes);
            figures.wait();
            watch.check().err().map(|error| error.code())
        };
        assert_eq!(grow(LIMIT_BYTES), None);
        assert_eq!(grow(LIMIT_BYTES + 1), Some(Code::ArmConnection));
        assert!(ended.try_recv().is_err(), "it has time to end by itself");
        assert_eq!(grow(0), Some(Code::ArmConnection), "it has grown once");
        figures.set(LIMIT_BYTES + FURTHER_BYTES + 1);
        let error = ended.recv_timeout(Duration::from_secs(20)).expect("it is ended");
        assert!(matches!(error, LiveError::Memory { grown_mb: 428, limit_mb: 300 }), "{error}");
    }

    #[test]
    fn nobody_is_ended_after_the_watch_is_over() {
        let figures = Arc::<Figures>::default();
        let (watch, ended) = watch(&figures);
        drop(watch);
        // The look that is under way ends first.
        std::thread::sleep(20 * LOOK);
        figures.set(2 * (LIMIT_BYTES + FURTHER_BYTES));
        assert!(ended.recv_timeout(Duration::from_secs(1)).is_err());
    }

    #[test]
    fn this_process_has_a_size() {
        let bytes = resident_bytes().expect("/proc");
        assert!((1_000_000..10_000_000_000).contains(&bytes), "{bytes}");
    }
}
