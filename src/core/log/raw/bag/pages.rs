//! Pages of an SQLite file.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek};

use super::numbers::{be_u16, be_u32};
use super::write_ahead_log;
use crate::log::raw::file_type::SQLITE;
use crate::log::raw::scan::ScanError;
use crate::log::raw::window::Window;

/// Length of the file's header at the beginning of the first page.
pub const HEADER_BYTES: usize = 100;
/// Maximum number of pages of a file that is read: one bit of memory each. 1 TiB of usual pages.
const MAX_PAGES: u64 = 1 << 28;
/// Newest known format of reading: 2 has a log of writes.
const NEWEST_FORMAT: u8 = 2;
/// Code of texts in UTF-8; 0 in a file without tables.
const UTF_8: u32 = 1;

/// Reason why a page cannot be used.
#[derive(Debug)]
pub enum PageError {
    Read(io::Error),
    /// The page lies beyond the end of the file.
    Missing,
    /// The page is malformed; the text states the fault.
    Broken(&'static str),
}

impl From<io::Error> for PageError {
    fn from(error: io::Error) -> Self {
        Self::Read(error)
    }
}

/// Pages of a file, each of which is read only once in a pass.
pub struct Pages<R> {
    window: Window<R>,
    page_bytes: usize,
    /// Usable bytes of each page, without the reserved end.
    pub usable_bytes: usize,
    /// Number of pages that the file declares.
    pub declared: u64,
    /// Later versions of pages in the log, with their positions.
    newer: Option<(Window<R>, BTreeMap<u32, u64>)>,
    /// Flags of the pages that were read, one bit per page.
    is_used: Vec<u64>,
}

impl<R: Read + Seek> Pages<R> {
    /// Opens the pages of a file. `log` is the file next to it whose name ends with `-wal`.
    pub fn open(source: R, log: Option<R>) -> Result<Self, ScanError> {
        let mut window = Window::new(source)?;
        let refused = |found: &str| ScanError::NotBag { found: found.to_owned() };
        let bytes = window.len();
        let head = window.bytes(0, (HEADER_BYTES as u64).min(bytes) as usize)?.to_vec();
        let Some(form) = Form::of(&head) else { return Err(refused("its header is cut or no SQLite header")) };
        if let Some(problem) = form.problem() {
            return Err(refused(problem));
        }
        let mut pages = bytes / form.page_bytes as u64;
        let mut declared = form.declared.map_or(pages, u64::from);
        let newer = match log {
            Some(log) => write_ahead_log::newer_pages(log, form.page_bytes)?,
            None => None,
        };
        let newer = newer.map(|found| {
            declared = u64::from(found.pages);
            pages = pages.max(declared);
            (found.log, found.places)
        });
        if pages > MAX_PAGES {
            return Err(refused("it has more pages than are read, 2^28"));
        }
        let is_used = vec![0; (pages as usize).div_ceil(64)];
        let usable_bytes = form.page_bytes - usize::from(form.reserved);
        Ok(Self { window, page_bytes: form.page_bytes, usable_bytes, declared, newer, is_used })
    }

    /// Length of the file, without its log.
    pub fn file_bytes(&self) -> u64 {
        self.window.len()
    }

    /// Returns true if the file is shorter than it declares.
    pub fn is_cut(&self) -> bool {
        self.newer.is_none() && self.declared.saturating_mul(self.page_bytes as u64) > self.window.len()
    }

    /// Begins another pass, in which all pages can be read again.
    pub fn forget(&mut self) {
        self.is_used.fill(0);
    }

    /// Returns a page without its reserved end, by its number from 1.
    pub fn page(&mut self, number: u32) -> Result<&[u8], PageError> {
        let idx = u64::from(number).checked_sub(1).ok_or(PageError::Broken("page 0 is named"))?;
        let Some(word) = self.is_used.get_mut((idx / 64) as usize) else { return Err(PageError::Missing) };
        let bit = 1 << (idx % 64);
        if *word & bit != 0 {
            return Err(PageError::Broken("a page is used twice"));
        }
        *word |= bit;
        let usable = self.usable_bytes;
        if let Some((log, places)) = &mut self.newer
            && let Some(at) = places.get(&number)
        {
            return Ok(log.bytes(*at, usable)?);
        }
        let at = idx * self.page_bytes as u64;
        if at + self.page_bytes as u64 > self.window.len() {
            return Err(PageError::Missing);
        }
        Ok(self.window.bytes(at, usable)?)
    }
}

/// Properties that the file's header states.
struct Form {
    page_bytes: usize,
    reserved: u8,
    read_format: u8,
    encoding: u32,
    /// Number of pages; `None` if a program older than the field wrote last.
    declared: Option<u32>,
}

impl Form {
    fn of(head: &[u8]) -> Option<Self> {
        if head.len() < HEADER_BYTES || !head.starts_with(SQLITE) {
            return None;
        }
        let page_bytes = match be_u16(head, 16)? {
            1 => 1 << 16,
            bytes => usize::from(bytes),
        };
        let is_current = be_u32(head, 24)? == be_u32(head, 92)?;
        let declared = be_u32(head, 28).filter(|pages| *pages > 0 && is_current);
        Some(Self { page_bytes, reserved: head[20], read_format: head[19], encoding: be_u32(head, 56)?, declared })
    }

    fn problem(&self) -> Option<&'static str> {
        if !self.page_bytes.is_power_of_two() || self.page_bytes < 512 {
            return Some("its pages have no size that SQLite knows");
        }
        if self.page_bytes - usize::from(self.reserved) < 480 {
            return Some("its pages are reserved for something else, such as a cipher");
        }
        if self.read_format > NEWEST_FORMAT {
            return Some("its format is newer than what is known");
        }
        (self.encoding > UTF_8).then_some("its texts are UTF-16; rosbag2 writes UTF-8")
    }
}
