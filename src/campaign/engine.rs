//! Runs jobs on some threads, in order of the list, each on one thread from its start to its end.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::campaign::row::one_line;
use crate::campaign::{CampaignError, Job, Row, RunStatus};

/// Settings of the execution of jobs.
#[derive(Clone, Copy, Debug)]
pub struct Engine<'a> {
    /// Number of threads; all cores if not given.
    pub threads: Option<usize>,
    /// Stop request: once set, no further job begins, and running ones finish.
    pub stop: &'a AtomicBool,
    /// Number of figures in a row.
    pub n_figures: usize,
    /// Exit code of the row of a run that panicked.
    pub panic_exit_code: u8,
}

/// Stack size of the main thread: a run needs no more stack here than there.
const STACK_BYTES: usize = 8 << 20;

/// Runs `jobs`; `on_row` gets each row as soon as it is complete, in any order. A runner that panics leaves a row with
/// the reason. Returns false if it was stopped before the last job.
///
/// # Errors
/// The first error of `runner` or `on_row`, after which no further job begins; [`CampaignError::Threads`].
pub fn run_jobs(
    engine: &Engine<'_>,
    jobs: &[Job],
    runner: &(dyn Fn(&Job) -> Result<Row, CampaignError> + Sync),
    on_row: &mut (dyn FnMut(Row) -> Result<(), CampaignError> + Send),
) -> Result<bool, CampaignError> {
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(engine.threads.unwrap_or(0)).stack_size(STACK_BYTES).build()?;
    let next = AtomicUsize::new(0);
    let n_done = AtomicUsize::new(0);
    let rows = Mutex::new((on_row, Ok(())));
    let give = |row: Result<Row, CampaignError>| {
        let Ok(mut rows) = rows.lock() else { return };
        let (on_row, result) = &mut *rows;
        if result.is_ok() {
            *result = row.and_then(on_row);
        }
        if result.is_err() {
            next.store(jobs.len(), Ordering::SeqCst);
        } else {
            n_done.fetch_add(1, Ordering::SeqCst);
        }
    };
    pool.broadcast(|_| {
        while !engine.stop.load(Ordering::SeqCst) {
            let Some(job) = jobs.get(next.fetch_add(1, Ordering::SeqCst)) else { break };
            // Only the row remains of a broken run: every run builds its own world.
            let row = catch_unwind(AssertUnwindSafe(|| runner(job)));
            give(row.unwrap_or_else(|why| Ok(engine.panicked(job, &*why))));
        }
    });
    let (_, result) = rows.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    result?;
    Ok(n_done.into_inner() == jobs.len())
}

impl Engine<'_> {
    fn panicked(&self, job: &Job, why: &(dyn Any + Send)) -> Row {
        let text = why.downcast_ref::<String>().map(String::as_str).or(why.downcast_ref::<&str>().copied());
        let failure = format!("the program panicked: {}", one_line(text.unwrap_or("no message")));
        Row { exit_code: self.panic_exit_code, ..job.failed("panic", failure, self.n_figures) }
    }
}

impl Job {
    /// The row of a run without a result.
    #[must_use]
    pub(super) fn failed(&self, stage: &str, failure: String, n_figures: usize) -> Row {
        Row {
            setting: self.setting,
            settings: self.settings.clone(),
            seed: self.seed,
            status: RunStatus::Failed,
            exit_code: 1,
            stage: stage.to_owned(),
            failure,
            command: self.command.clone(),
            figures: vec![None; n_figures],
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn job(setting: u32, seed: u64) -> Job {
        Job { setting, settings: format!("s={setting}"), seed, command: format!("armcal run r.toml --seed {seed}") }
    }

    pub fn good(job: &Job) -> Result<Row, CampaignError> {
        let figures = vec![Some(job.seed as f64), Some(1.0), None];
        Ok(Row { status: RunStatus::Accepted, exit_code: 0, figures, ..job.failed("", String::new(), 3) })
    }

    fn all(
        threads: usize,
        stop: &AtomicBool,
        runner: &(dyn Fn(&Job) -> Result<Row, CampaignError> + Sync),
    ) -> (Vec<Row>, bool) {
        let jobs: Vec<Job> = (0..40).map(|k| job(k % 2, u64::from(k / 2))).collect();
        let engine = Engine { threads: Some(threads), stop, n_figures: 3, panic_exit_code: 1 };
        let mut rows = Vec::new();
        let mut keep = |row| {
            rows.push(row);
            Ok(())
        };
        let whole = run_jobs(&engine, &jobs, runner, &mut keep).expect("no errors");
        rows.sort_by_key(Row::key);
        (rows, whole)
    }

    #[test]
    fn every_job_gives_one_row_on_any_number_of_threads() {
        let stop = AtomicBool::new(false);
        let (one, whole) = all(1, &stop, &good);
        assert!(whole && one.len() == 40);
        for threads in [2, 7] {
            assert_eq!(all(threads, &stop, &good).0, one);
        }
    }

    #[test]
    fn a_panic_is_a_row_and_the_others_go_on() {
        let stop = AtomicBool::new(false);
        let (rows, whole) = all(2, &stop, &|job: &Job| {
            assert!(job.seed != 7 || job.setting != 1, "seed 7\nis bad");
            good(job)
        });
        assert!(whole);
        let failed: Vec<&Row> = rows.iter().filter(|row| row.status == RunStatus::Failed).collect();
        assert_eq!((rows.len(), failed.len()), (40, 1));
        assert_eq!(failed[0].key(), (1, 7));
        assert_eq!(
            (failed[0].stage.as_str(), failed[0].failure.as_str()),
            ("panic", "the program panicked: seed 7; is bad")
        );
    }

    #[test]
    fn a_stop_lets_the_runs_under_way_finish() {
        let stop = AtomicBool::new(false);
        let (rows, whole) = all(1, &stop, &|job: &Job| {
            stop.store(job.seed == 3, Ordering::SeqCst);
            good(job)
        });
        assert!(!whole);
        assert_eq!(rows.len(), 7, "seeds 0 to 2 under both settings, and seed 3 under the first");
    }

    #[test]
    fn a_row_that_cannot_be_kept_ends_it() {
        let stop = AtomicBool::new(false);
        let jobs: Vec<Job> = (0..40).map(|seed| job(0, seed)).collect();
        let engine = Engine { threads: Some(1), stop: &stop, n_figures: 3, panic_exit_code: 1 };
        let mut n = 0;
        let mut full = |_| {
            n += 1;
            if n < 5 { Ok(()) } else { Err(CampaignError::Usage("the disk is full".to_owned())) }
        };
        assert!(run_jobs(&engine, &jobs, &good, &mut full).is_err());
        assert_eq!(n, 5);
    }
}
