//! Checksum over the data section of a file: every byte before its end.

use std::io::{Read, Result, Seek};

use super::window::Window;

/// Number of bytes added at once.
const STEP_BYTES: u64 = 1 << 18;

/// Checksum of the file up to the position of the pass.
#[derive(Default)]
pub struct DataChecksum {
    hasher: crc32fast::Hasher,
    end: u64,
}

impl DataChecksum {
    /// Adds the bytes before `end` that are not yet included.
    pub fn add_until<R: Read + Seek>(&mut self, window: &mut Window<R>, end: u64) -> Result<()> {
        while self.end < end {
            let len = (end - self.end).min(STEP_BYTES);
            self.hasher.update(window.bytes(self.end, len as usize)?);
            self.end += len;
        }
        Ok(())
    }

    pub fn value(&self) -> u32 {
        self.hasher.clone().finalize()
    }
}
