//! Buffered access to any range of a file.

use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};

/// Number of bytes read at once if less is requested.
const READ_AHEAD_BYTES: usize = 1 << 18;

/// A file with one range in memory. Only [`Self::refresh`] notices bytes appended after opening.
pub struct Window<R> {
    source: R,
    len: u64,
    start: u64,
    buffer: Vec<u8>,
}

impl<R: Read + Seek> Window<R> {
    pub fn new(mut source: R) -> Result<Self> {
        let len = source.seek(SeekFrom::End(0))?;
        Ok(Self { source, len, start: 0, buffer: Vec::new() })
    }

    /// Reads the file's length again and drops the buffered bytes.
    pub fn refresh(&mut self) -> Result<()> {
        self.buffer.clear();
        self.len = self.source.seek(SeekFrom::End(0))?;
        Ok(())
    }

    /// Length of the file, bytes.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Returns `len` bytes from `at`, which must lie within the file: no more memory is allocated than the file has
    /// bytes.
    pub fn bytes(&mut self, at: u64, len: usize) -> Result<&[u8]> {
        let end = at.checked_add(len as u64).filter(|&end| end <= self.len);
        let end = end.ok_or_else(|| Error::new(ErrorKind::UnexpectedEof, "range exceeds the file"))?;
        if at < self.start || end > self.start + self.buffer.len() as u64 {
            self.load(at, len)?;
        }
        let offset = (at - self.start) as usize;
        Ok(&self.buffer[offset..offset + len])
    }

    fn load(&mut self, at: u64, len: usize) -> Result<()> {
        let left = usize::try_from(self.len - at).unwrap_or(usize::MAX);
        self.buffer.clear();
        self.buffer.resize(len.max(READ_AHEAD_BYTES).min(left), 0);
        self.start = at;
        self.source.seek(SeekFrom::Start(at))?;
        let read = self.source.read_exact(&mut self.buffer);
        if read.is_err() {
            self.buffer.clear();
        }
        read
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn any_range_is_found_and_none_beyond_the_end() {
        let bytes: Vec<u8> = (0..1_000_000_u32).map(|i| (i % 251) as u8).collect();
        let mut window = Window::new(Cursor::new(&bytes)).unwrap();
        for (at, len) in [(0, 8), (900_000, 100_000), (10, 500_000), (5, 1), (1_000_000, 0)] {
            assert_eq!(window.bytes(at as u64, len).unwrap(), &bytes[at..at + len]);
        }
        assert!(window.bytes(999_999, 2).is_err());
        assert!(window.bytes(u64::MAX, 2).is_err());
    }
}
