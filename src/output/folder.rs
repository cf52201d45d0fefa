//! Output folder of a run: one run at a time, all results at once or none, and no recording lost.
//!
//! All files are written to `NAME.partial`. [`OutputFolder::commit`] puts all of them in place at the end. The old
//! summary.json is removed first and the new one comes last, so a folder with a summary.json holds the files of one
//! run. Recordings of a killed or failed run are moved to `run-cut-N.mcap` and `truth-cut-N.mcap`.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use crate::output::{FolderLock, OutputError, as_written, check_replaceable, complete, make_folder, partial, remove};
use armcal_core::log::{LogError, for_each_raw, topics};

/// Result files of a run, in the order in which they are put in place.
pub(crate) const RESULTS: [&str; 9] = [
    "truth.mcap",
    "run.rrd",
    "tagmap.toml",
    "belief.jsonl",
    "calibration.covariance.toml",
    "calibration.toml",
    "report.html",
    "run.mcap",
    SUMMARY,
];
/// File whose presence shows that the files next to it belong to one run.
const SUMMARY: &str = "summary.json";
const RECORDINGS: [&str; 2] = ["run", "truth"];

/// An output folder that is locked for this run while the value lives.
#[derive(Debug)]
pub struct OutputFolder {
    folder: PathBuf,
    _lock: FolderLock,
}

impl OutputFolder {
    /// Makes the folder, locks it, and moves aside the recordings that a killed run left in it; returns their new path.
    ///
    /// # Errors
    /// When the folder cannot be made or written to, belongs to another run, or an obstacle is at the path of a result.
    pub fn open(folder: &Path) -> Result<(Self, Option<PathBuf>), OutputError> {
        let output = Self { folder: folder.to_owned(), _lock: FolderLock::take(folder)? };
        for name in RESULTS {
            check_replaceable(&folder.join(name))?;
            check_replaceable(&output.partial(name))?;
        }
        let kept = output.set_aside()?;
        Ok((output, kept))
    }

    /// Path at which the result `name` is written until it is complete.
    pub fn partial(&self, name: &str) -> PathBuf {
        partial(&self.folder.join(name))
    }

    /// Writes a small result, to be put in place by [`Self::commit`].
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let path = self.partial(name);
        let bytes = as_written(&self.folder.join(name), bytes);
        fs::write(&path, bytes).map_err(OutputError::of(&path, "cannot be written"))
    }

    /// Removes the parts of a result that could not be written.
    ///
    /// # Errors
    /// When it cannot be removed.
    pub fn leave_out(&self, name: &str) -> Result<(), OutputError> {
        remove(&self.partial(name))
    }

    /// Error that names the folder, if it was removed during the run.
    #[must_use]
    pub fn is_gone(&self) -> Option<OutputError> {
        let problem = "the output folder was removed while the run was going on";
        (!self.folder.is_dir()).then(|| OutputError::new(&self.folder, problem))
    }

    #[must_use]
    pub fn path(&self) -> &Path {
        &self.folder
    }

    /// Puts every result in place and removes those of an earlier run that this one does not have.
    ///
    /// # Errors
    /// When a file cannot be written to disk or renamed.
    pub fn commit(&self) -> Result<(), OutputError> {
        self.commit_into(&self.folder)
    }

    /// Puts every result into `folder`, which is made if need be, as [`Self::commit`] does into the run's own.
    ///
    /// # Errors
    /// When a file cannot be written to disk or renamed.
    pub fn commit_into(&self, folder: &Path) -> Result<(), OutputError> {
        make_folder(folder)?;
        let has: Vec<bool> = RESULTS.iter().map(|name| self.partial(name).is_file()).collect();
        for (name, _) in RESULTS.iter().zip(&has).filter(|(_, has)| **has) {
            // The data must be on disk before the file takes a name that promises so.
            let path = self.partial(name);
            File::open(&path)
                .and_then(|file| file.sync_all())
                .map_err(OutputError::of(&path, "cannot be written to disk"))?;
        }
        remove(&folder.join(SUMMARY))?;
        for (name, has) in RESULTS.iter().zip(&has) {
            let path = folder.join(name);
            if *has { complete(&self.partial(name), &path)? } else { remove(&path)? }
        }
        Ok(())
    }

    /// Removes all that this run wrote.
    pub fn discard(&self) {
        for name in RESULTS {
            // The files have no value; if they cannot be removed they do no harm.
            let _ = fs::remove_file(self.partial(name));
        }
    }

    /// Moves unfinished recordings to names of their own and removes unfinished results; returns the new path of the
    /// run's recording.
    ///
    /// # Errors
    /// When a file cannot be renamed or removed.
    pub fn set_aside(&self) -> Result<Option<PathBuf>, OutputError> {
        let run = self.partial("run.mcap");
        let mut kept = None;
        if run.is_file() && is_worth_keeping(&run) {
            let number = (1_u32..)
                .find(|n| RECORDINGS.iter().all(|name| !self.cut(name, *n).exists()))
                .ok_or_else(|| OutputError::new(&run, "no name is left for the unfinished recording"))?;
            for name in RECORDINGS {
                let (from, to) = (self.partial(&format!("{name}.mcap")), self.cut(name, number));
                if from.is_file() {
                    let problem = format!("cannot be renamed to {}", to.display());
                    fs::rename(&from, &to).map_err(OutputError::of(&from, problem))?;
                }
            }
            kept = Some(self.cut("run", number));
        }
        for name in RESULTS {
            remove(&self.partial(name))?;
        }
        Ok(kept)
    }

    fn cut(&self, name: &str, number: u32) -> PathBuf {
        self.folder.join(format!("{name}-cut-{number}.mcap"))
    }
}

/// True for a recording with any reading of the arm, and for one that cannot be read and might hold some.
fn is_worth_keeping(path: &Path) -> bool {
    let mut readings = 0_u64;
    match for_each_raw(path, |message| readings += u64::from(message.topic() == topics::JOINT_SENSORS)) {
        Ok(_) => readings > 0,
        Err(LogError::Empty { .. }) => false,
        Err(_) => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::log::{RecordingHeader, RecordingWriter};
    use armcal_core::streams::{JointCounts, JointSensorSample, Message, Sink};
    use armcal_core::time::SIMULATION_EPOCH;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn record(path: &Path, readings: usize) {
        let mut writer = RecordingWriter::create(path, RecordingHeader::new(vec!["a".to_owned()])).unwrap();
        for n in 0..readings {
            let stamp = SIMULATION_EPOCH.plus_s(n as f64);
            let sample = JointSensorSample { stamp, counts: JointCounts::from_slice(&[1.0]) };
            writer.record(stamp, &Message::JointSensors(sample)).unwrap();
        }
    }

    #[test]
    fn leftovers_with_readings_are_kept_under_new_names_and_others_go() {
        let dir = tempfile::tempdir().unwrap();
        for round in 1..=2 {
            record(&dir.path().join("run.mcap.partial"), 5);
            record(&dir.path().join("truth.mcap.partial"), 5);
            fs::write(dir.path().join("summary.json.partial"), "{").unwrap();
            let output = OutputFolder::open(dir.path()).unwrap().0;
            drop(output);
            assert_eq!(names(dir.path()).len(), 2 * round, "{:?}", names(dir.path()));
        }
        assert_eq!(names(dir.path()), ["run-cut-1.mcap", "run-cut-2.mcap", "truth-cut-1.mcap", "truth-cut-2.mcap"]);
        record(&dir.path().join("run.mcap.partial"), 0);
        fs::write(dir.path().join("truth.mcap.partial"), "").unwrap();
        drop(OutputFolder::open(dir.path()).unwrap().0);
        assert_eq!(names(dir.path()).len(), 4);
        // An unreadable file might be valuable.
        fs::write(dir.path().join("run.mcap.partial"), "scribble").unwrap();
        drop(OutputFolder::open(dir.path()).unwrap().0);
        assert_eq!(fs::read(dir.path().join("run-cut-3.mcap")).unwrap(), b"scribble");
    }

    #[test]
    fn one_run_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let first = OutputFolder::open(dir.path()).unwrap().0;
        let error = OutputFolder::open(dir.path()).unwrap_err().to_string();
        insta::assert_snapshot!("another_run", error.replace(&dir.path().display().to_string(), "FOLDER"));
        drop(first);
        drop(OutputFolder::open(dir.path()).unwrap().0);
        assert!(names(dir.path()).is_empty());
    }

    /// The lock file of the first is removed under the second while it waits between opening and locking.
    #[test]
    fn locks_hold_while_many_come_and_go() {
        let dir = tempfile::tempdir().unwrap();
        use std::sync::atomic::Ordering::SeqCst;
        const ENTRIES: usize = 300;
        let inside = std::sync::atomic::AtomicUsize::new(0);
        let entered = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    // A lock that stayed would keep all others out.
                    for _ in 0..1_000_000 {
                        if entered.load(SeqCst) >= ENTRIES {
                            break;
                        }
                        let Ok((output, _)) = OutputFolder::open(dir.path()) else { continue };
                        assert_eq!(inside.fetch_add(1, SeqCst), 0, "two runs in one folder");
                        entered.fetch_add(1, SeqCst);
                        std::thread::yield_now();
                        inside.fetch_sub(1, SeqCst);
                        drop(output);
                    }
                });
            }
        });
        assert!(entered.into_inner() >= ENTRIES);
    }

    #[test]
    fn results_come_together_and_nothing_old_stays() {
        let dir = tempfile::tempdir().unwrap();
        for name in RESULTS {
            fs::write(dir.path().join(name), "old").unwrap();
        }
        fs::write(dir.path().join("notes.txt"), "mine").unwrap();
        let output = OutputFolder::open(dir.path()).unwrap().0;
        for name in ["run.mcap", "truth.mcap", "calibration.toml", "summary.json"] {
            output.write(name, b"new").unwrap();
        }
        assert_eq!(fs::read(dir.path().join("run.mcap")).unwrap(), b"old");
        output.commit().unwrap();
        drop(output);
        assert_eq!(names(dir.path()), ["calibration.toml", "notes.txt", "run.mcap", "summary.json", "truth.mcap"]);
        assert_eq!(fs::read(dir.path().join("summary.json")).unwrap(), b"new");
    }

    /// A commit interrupted at any point leaves no summary next to a mixture of files.
    #[test]
    fn a_broken_commit_leaves_no_summary() {
        for blocked in ["truth.mcap", "report.html", "run.mcap"] {
            let dir = tempfile::tempdir().unwrap();
            for name in RESULTS {
                fs::write(dir.path().join(name), "old").unwrap();
            }
            let output = OutputFolder::open(dir.path()).unwrap().0;
            for name in RESULTS {
                output.write(name, b"new").unwrap();
            }
            fs::remove_file(dir.path().join(blocked)).unwrap();
            fs::create_dir_all(dir.path().join(blocked).join("full")).unwrap();
            let error = output.commit().unwrap_err().to_string();
            assert!(error.contains(blocked), "{error}");
            assert!(!dir.path().join("summary.json").exists());
        }
    }

    #[test]
    fn a_new_folder_with_nothing_in_it_goes_again() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("out");
        let output = OutputFolder::open(&folder).unwrap().0;
        output.write("run.mcap", b"x").unwrap();
        output.discard();
        drop(output);
        assert!(!folder.exists());
    }

    #[test]
    fn what_is_in_the_way_is_named_before_anything_is_written() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("report.html")).unwrap();
        let error = OutputFolder::open(dir.path()).unwrap_err().to_string();
        assert!(error.contains("report.html"), "{error}");
        assert_eq!(names(dir.path()), ["report.html"]);
    }
}
