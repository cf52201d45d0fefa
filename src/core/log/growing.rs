//! Reader of a recording that another program is still writing.

use std::fs::{File, metadata};
use std::path::{Path, PathBuf};

use super::error::LogError;
use super::raw::{FileIdentity, GrowingScan, Growth, begin_growing, identity, of_scan};
use super::reader::{Collector, Recording, TopicMap};
use crate::streams::Message;
use crate::time::Stamp;

/// A recording that may still grow, read as far as it is complete.
///
/// Each message is heard once, in the order of the file, by the checks of `scan_recording`. A record that is not
/// written to its end is left for later. Memory does not grow with the file. The file may be renamed meanwhile, as a
/// run does when it ends.
pub struct GrowingRecording<'a> {
    path: PathBuf,
    identity: Option<FileIdentity>,
    raw: GrowingScan<File>,
    collector: Collector<'a>,
}

impl<'a> GrowingRecording<'a> {
    /// Opens a regular file, which may be empty as yet.
    ///
    /// # Errors
    /// [`LogError::Read`].
    pub fn open(path: impl AsRef<Path>, map: &'a TopicMap) -> Result<Self, LogError> {
        let path = path.as_ref().to_owned();
        let (raw, identity) = begin_growing(&path)?;
        Ok(Self { path, identity, raw, collector: Collector::new(map) })
    }

    /// Hears what has become complete since the last call, a chunk or some hundred kilobytes at most.
    ///
    /// # Errors
    /// [`LogError::Read`], [`LogError::NotMcap`]; [`LogError::Truncated`], [`LogError::Replaced`] where what was read
    /// does not lie there any more. Damage is no error; the result of [`Self::finish`] tells of it.
    pub fn poll(&mut self, mut hear: impl FnMut(Stamp, &Message)) -> Result<Growth, LogError> {
        // Before reading: what was written to the old file before the new one came is read first.
        let is_replaced = self.is_replaced();
        let growth = self.raw.poll(|raw| {
            self.collector.take(raw, |raw, message| {
                hear(raw.log_time(), message);
                false
            });
        });
        match growth.map_err(|error| of_scan(&self.path, error))? {
            Growth::Waiting if is_replaced => Err(LogError::Replaced { path: self.path.clone() }),
            growth => Ok(growth),
        }
    }

    /// Hears what is left where no more comes: of a cut chunk the beginning. The counts of the result are of all
    /// messages; it holds none.
    ///
    /// # Errors
    /// As [`Self::poll`], and [`LogError::Empty`].
    pub fn finish(mut self, mut hear: impl FnMut(Stamp, &Message)) -> Result<Recording, LogError> {
        let collector = &mut self.collector;
        let summary = self.raw.finish(|raw| {
            collector.take(raw, |raw, message| {
                hear(raw.log_time(), message);
                false
            });
        });
        Ok(self.collector.finish(&self.path, &summary.map_err(|error| of_scan(&self.path, error))?))
    }

    /// What was heard of a recording that goes on: its end does not count as missing.
    #[must_use]
    pub fn stop(self) -> Recording {
        self.collector.finish(&self.path, &self.raw.stop())
    }

    /// The file, as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file as last seen, and the bytes of it that were read. Where neither changes, nothing came.
    #[must_use]
    pub fn seen(&self) -> (u64, u64) {
        self.raw.seen()
    }

    /// The joints that the sensors' messages name; `None` before the first.
    #[must_use]
    pub fn joint_names(&self) -> Option<&[String]> {
        self.collector.sensor_joints()
    }

    /// Whether chunks lie in another order than that of time, or twice: a finished file is sorted by `scan_recording`,
    /// a growing one is heard as it lies.
    #[must_use]
    pub fn is_out_of_order(&self) -> bool {
        self.raw.is_out_of_order()
    }

    /// Whether the name belongs to another file now. A name that is gone is none: the file may have been renamed.
    fn is_replaced(&self) -> bool {
        self.identity.is_some() && metadata(&self.path).is_ok_and(|now| identity(&now) != self.identity)
    }
}
