//! Log of writes next to a database (`-wal`): pages that were not written to the file before its writer was killed.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek};

use super::numbers::be_u32;
use crate::log::raw::window::Window;

/// First number of a log; its last bit states the byte order of the checksum's words.
const MAGIC: u32 = 0x377f_0682;
const HEADER_BYTES: usize = 32;
const FRAME_HEAD_BYTES: usize = 24;
/// Maximum number of frames of a log that is read; SQLite restarts the log after 1000.
const MAX_FRAMES: u64 = 1 << 22;

/// Pages in a log.
pub struct NewerPages<R> {
    pub log: Window<R>,
    /// Position of the latest version of each page, by its number.
    pub places: BTreeMap<u32, u64>,
    /// Length of the database with the log, pages.
    pub pages: u32,
}

/// Returns the pages of all finished transactions; `None` if there are none.
pub fn newer_pages<R: Read + Seek>(source: R, page_bytes: usize) -> io::Result<Option<NewerPages<R>>> {
    let mut log = Window::new(source)?;
    let bytes = log.len();
    if bytes < HEADER_BYTES as u64 {
        return Ok(None);
    }
    let head = log.bytes(0, HEADER_BYTES)?.to_vec();
    let number = |at: usize| be_u32(&head, at).unwrap_or(0);
    if number(0) & !1 != MAGIC || number(8) as usize != page_bytes {
        return Ok(None);
    }
    let mut sum = Checksum { is_big_endian: number(0) & 1 == 1, words: [0; 2] };
    sum.add(&head[..24]);
    if sum.words != [number(24), number(28)] {
        return Ok(None);
    }
    let frame_bytes = (FRAME_HEAD_BYTES + page_bytes) as u64;
    let n_frames = ((bytes - HEADER_BYTES as u64) / frame_bytes).min(MAX_FRAMES);
    let (mut places, mut pages) = (BTreeMap::new(), 0);
    let mut unfinished = Vec::new();
    for frame in 0..n_frames {
        let at = HEADER_BYTES as u64 + frame * frame_bytes;
        let frame = log.bytes(at, frame_bytes as usize)?;
        let word = |at: usize| be_u32(frame, at).unwrap_or(0);
        sum.add(&frame[..8]);
        sum.add(&frame[FRAME_HEAD_BYTES..]);
        // Remains of an older log have other salts.
        if [word(8), word(12)] != [number(16), number(20)] || sum.words != [word(16), word(20)] {
            break;
        }
        unfinished.push((word(0), at + FRAME_HEAD_BYTES as u64));
        if word(4) > 0 {
            pages = word(4);
            places.extend(unfinished.drain(..));
        }
    }
    Ok((!places.is_empty()).then_some(NewerPages { log, places, pages }))
}

/// Checksum of SQLite's log, over words of four bytes.
struct Checksum {
    is_big_endian: bool,
    words: [u32; 2],
}

impl Checksum {
    fn add(&mut self, bytes: &[u8]) {
        let word = |bytes: &[u8]| {
            let four = [bytes[0], bytes[1], bytes[2], bytes[3]];
            if self.is_big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) }
        };
        let [mut a, mut b] = self.words;
        for two in bytes.chunks_exact(8) {
            a = a.wrapping_add(word(&two[..4])).wrapping_add(b);
            b = b.wrapping_add(word(&two[4..])).wrapping_add(a);
        }
        self.words = [a, b];
    }
}
