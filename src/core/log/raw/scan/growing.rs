//! Pass through a file that another program is still writing.

use std::io::{self, Read, Seek};

use mcap::records::op;

use super::{CHUNK_HEAD_BYTES, ChunkHead, ChunkUse, Ending, FOOTER_BYTES, MAGIC, MAX_RECORD_BYTES, Next, PREFIX_BYTES};
use super::{Pass, Prefix, RawMessage, RawSummary, Scan, ScanError, TAIL_BYTES, Window};

/// Number of bytes after which a poll returns although there is more.
const POLL_BYTES: u64 = 1 << 18;
/// Number of bytes before the reading position that must stay unchanged.
const ANCHOR_BYTES: u64 = 64;

/// Progress of a poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Growth {
    /// There is more to read at once.
    Behind,
    /// All complete records were read; the file has no end yet.
    Waiting,
    /// The file's own end was read.
    Finished,
}

/// A pass that waits at the end of the file and continues when it has grown. No record is visited twice.
pub struct GrowingScan<R> {
    scan: Option<Scan<R, ()>>,
    has_begun: bool,
    is_finished: bool,
    /// Position of the next record, and the bytes before it.
    at: u64,
    anchor: Vec<u8>,
}

impl<R: Read + Seek> GrowingScan<R> {
    pub fn new(source: R) -> io::Result<Self> {
        let mut scan = Scan::new(Window::new(source)?, ());
        scan.pass = Pass::new(ChunkUse::Messages, scan.window.len());
        scan.ending = Ending::Open;
        Ok(Self { scan: Some(scan), has_begun: false, is_finished: false, at: 0, anchor: Vec::new() })
    }

    /// Returns the length of the file as last seen, and the number of its bytes that were read.
    pub fn seen(&self) -> (u64, u64) {
        (self.scan.as_ref().map_or(0, |scan| scan.window.len()), self.at)
    }

    /// Returns true if chunks are not in the order of time, or occur twice.
    pub fn is_out_of_order(&self) -> bool {
        self.scan.as_ref().is_some_and(|scan| scan.pass.heads.is_doubtful)
    }

    /// Visits the messages of the records completed since the last poll.
    pub fn poll(&mut self, visit: impl FnMut(&RawMessage<'_>)) -> Result<Growth, ScanError> {
        self.with(visit, |growing, scan| growing.advance(scan, POLL_BYTES))
    }

    /// Visits the rest of a file that no longer grows, as [`super::scan`] does at a cut.
    pub fn finish(mut self, visit: impl FnMut(&RawMessage<'_>)) -> Result<RawSummary, ScanError> {
        self.with(visit, |growing, scan| {
            if !growing.is_finished {
                scan.ending = Ending::Closed;
                growing.advance(scan, u64::MAX)?;
            }
            Ok(())
        })?;
        Ok(self.stop())
    }

    /// Returns the summary of a file that may go on: its end does not count as missing.
    pub fn stop(self) -> RawSummary {
        let Some(mut scan) = self.scan else { return RawSummary::default() };
        if !self.is_finished {
            scan.counted = None;
        }
        scan.summary()
    }

    fn with<F: FnMut(&RawMessage<'_>), T>(
        &mut self,
        visit: F,
        act: impl FnOnce(&mut Self, &mut Scan<R, F>) -> Result<T, ScanError>,
    ) -> Result<T, ScanError> {
        let Some(scan) = self.scan.take() else { return Err(ScanError::Empty) };
        let mut scan = scan.with_visit(visit);
        let done = act(self, &mut scan).map_err(|error| self.explained(error, &mut scan));
        self.scan = Some(scan.with_visit(()));
        done
    }

    /// Returns the error of a file that became shorter during a read.
    fn explained<F>(&mut self, error: ScanError, scan: &mut Scan<R, F>) -> ScanError {
        self.anchor.clear();
        match error {
            ScanError::Read(source) if source.kind() == io::ErrorKind::UnexpectedEof => {
                let refreshed = scan.window.refresh();
                let bytes = scan.window.len();
                refreshed.map_or_else(ScanError::Read, |()| ScanError::Truncated { bytes, read: self.at })
            }
            error => error,
        }
    }

    fn advance<F: FnMut(&RawMessage<'_>)>(
        &mut self,
        scan: &mut Scan<R, F>,
        most_bytes: u64,
    ) -> Result<Growth, ScanError> {
        if self.is_finished {
            return Ok(Growth::Finished);
        }
        self.refresh(scan)?;
        if !self.has_begun && !self.begin(scan)? {
            return Ok(Growth::Waiting);
        }
        let until = self.at.saturating_add(most_bytes);
        let growth = loop {
            match scan.step(self.at)? {
                Next::At(next) => self.at = next,
                Next::Later => break Growth::Waiting,
                Next::End => break Growth::Finished,
            }
            if self.at >= until {
                break Growth::Behind;
            }
        };
        self.is_finished = growth == Growth::Finished;
        let n = self.at.min(ANCHOR_BYTES);
        self.anchor = scan.window.bytes(self.at - n, n as usize)?.to_vec();
        Ok(growth)
    }

    /// Reads the file's length again and checks the bytes already read.
    fn refresh<F>(&mut self, scan: &mut Scan<R, F>) -> Result<(), ScanError> {
        let before = scan.window.len();
        scan.window.refresh()?;
        let bytes = scan.window.len();
        scan.pass.contents.bytes = bytes;
        scan.pass.budget.grow(before, bytes);
        if bytes < self.at {
            return Err(ScanError::Truncated { bytes, read: self.at });
        }
        let n = self.anchor.len();
        if scan.window.bytes(self.at - n as u64, n)? != self.anchor {
            return Err(ScanError::Rewritten);
        }
        Ok(())
    }

    /// Returns true if the file has its opening bytes. A file that is already finished is read like any other.
    fn begin<F: FnMut(&RawMessage<'_>)>(&mut self, scan: &mut Scan<R, F>) -> Result<bool, ScanError> {
        let n = scan.window.len().min(MAGIC.len() as u64) as usize;
        if scan.ending == Ending::Open && n < MAGIC.len() && MAGIC.starts_with(scan.window.bytes(0, n)?) {
            return Ok(false);
        }
        scan.check_start()?;
        scan.read_summary()?;
        if scan.ends_with_magic {
            scan.ending = Ending::Closed;
        }
        (self.has_begun, self.at) = (true, MAGIC.len() as u64);
        Ok(true)
    }
}

impl<R: Read + Seek, F: FnMut(&RawMessage<'_>)> Scan<R, F> {
    /// Returns true if an incomplete record may begin here. A record that contradicts itself is not incomplete.
    pub(super) fn is_unfinished(&mut self, at: u64) -> io::Result<bool> {
        let left = self.window.len() - at;
        let start = self.window.bytes(at, left.min(CHUNK_HEAD_BYTES as u64) as usize)?;
        let Some(Prefix { opcode, len }) = Prefix::parse(start) else { return Ok(true) };
        let is_beyond = len > left - PREFIX_BYTES as u64;
        Ok(match opcode {
            0 => false,
            op::CHUNK => match ChunkHead::parse(start) {
                Some(head) => is_beyond && len <= MAX_RECORD_BYTES && head.is_consistent(u64::MAX),
                None => start.len() < CHUNK_HEAD_BYTES,
            },
            op::FOOTER => len == FOOTER_BYTES && left < TAIL_BYTES,
            op::ATTACHMENT => is_beyond,
            _ => is_beyond && len <= MAX_RECORD_BYTES,
        })
    }
}

#[cfg(test)]
mod tests;
