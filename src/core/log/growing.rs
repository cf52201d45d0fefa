//! Reader of a recording that another program is still writing.

use std::fs::{File, metadata};
use std::path::{Path, PathBuf};

use super::error::LogError;
use super::raw::{FileIdentity, GrowingScan, Growth, begin_growing, identity, of_scan};
use super::reader::{Collector, Recording, TopicMap};
use crate::streams::Message;
use crate::time::Stamp;

/// A recording that may still grow, read up to its last complete record.
///
/// Each message is passed on once, in the order of the file, with the checks of `scan_recording`. An incomplete record
/// is left for later. Memory does not grow with the file. The file may be renamed meanwhile, as at the end of a run.
pub struct GrowingRecording<'a> {
    path: PathBuf,
    identity: Option<FileIdentity>,
    raw: GrowingScan<File>,
    collector: Collector<'a>,
}

impl<'a> GrowingRecording<'a> {
    /// Opens a regular file, which may still be empty.
    ///
    /// # Errors
    /// [`LogError::Read`].
    pub fn open(path: impl AsRef<Path>, map: &'a TopicMap) -> Result<Self, LogError> {
        let path = path.as_ref().to_owned();
        let (raw, identity) = begin_growing(&path)?;
        Ok(Self { path, identity, raw, collector: Collector::new(map) })
    }

    /// Passes on the messages completed since the last call, at most one chunk or a few hundred kilobytes.
    ///
    /// # Errors
    /// [`LogError::Read`], [`LogError::NotMcap`]; [`LogError::Truncated`], [`LogError::Replaced`] if the bytes read are
    /// no longer in the file. Damage is no error; the result of [`Self::finish`] reports it.
    pub fn poll(&mut self, mut hear: impl FnMut(Stamp, &Message)) -> Result<Growth, LogError> {
        // Checked before reading: data written to the old file before its replacement is read first.
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

    /// Passes on the rest of a file that no longer grows, including the beginning of a cut chunk. The counts of the
    /// result cover all messages; it holds none.
    ///
    /// # Errors
    /// The errors of [`Self::poll`], and [`LogError::Empty`].
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

    /// Returns the summary of a recording that goes on; its end does not count as missing.
    #[must_use]
    pub fn stop(self) -> Recording {
        self.collector.finish(&self.path, &self.raw.stop())
    }

    /// Path of the file, as given.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file as last seen, and number of its bytes that were read. If neither changes, the file did not
    /// grow.
    #[must_use]
    pub fn seen(&self) -> (u64, u64) {
        self.raw.seen()
    }

    /// Names of the joints in the sensors' messages; `None` before the first message.
    #[must_use]
    pub fn joint_names(&self) -> Option<&[String]> {
        self.collector.sensor_joints()
    }

    /// Returns true if chunks are not in the order of time, or occur twice. `scan_recording` sorts a finished file; a
    /// growing file is read in the order of the file.
    #[must_use]
    pub fn is_out_of_order(&self) -> bool {
        self.raw.is_out_of_order()
    }

    /// Returns true if the name belongs to another file now. A missing name does not count: the file may have been
    /// renamed.
    fn is_replaced(&self) -> bool {
        self.identity.is_some() && metadata(&self.path).is_ok_and(|now| identity(&now) != self.identity)
    }
}
