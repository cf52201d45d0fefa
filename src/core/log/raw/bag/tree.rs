//! Rows of a table, in the order of their numbers.

use std::collections::BTreeSet;
use std::io::{self, Read, Seek};
use std::ops::Range;

use super::numbers::{be_u16, be_u32, varint};
use super::pages::{HEADER_BYTES, PageError, Pages};

const TABLE_INNER: u8 = 5;
const TABLE_LEAF: u8 = 13;
const INNER_HEAD_BYTES: usize = 12;
const LEAF_HEAD_BYTES: usize = 8;

/// A row of a table.
pub struct Row<'a> {
    /// Page on which the row begins.
    pub leaf: u32,
    /// Number of the row in the table.
    pub number: i64,
    /// Encoded columns of the row.
    pub payload: &'a [u8],
}

/// Selection of the rows of a table that are read.
pub struct Wanted<'a> {
    /// Page on which the table begins.
    pub root: u32,
    /// Maximum length of a row that is read; longer rows count as lost.
    pub max_bytes: u64,
    /// Pages whose rows are read; `None`: all.
    pub leaves: Option<&'a BTreeSet<u64>>,
}

/// Rows and pages that could not be read.
#[derive(Debug, Default)]
pub struct Losses {
    /// Reason of the first loss.
    pub reason: Option<String>,
    pub pages: u64,
    /// Number of lost rows on pages that were read.
    pub rows: u64,
    /// Number of pages beyond the end of the file.
    pub missing_pages: u64,
}

impl Losses {
    pub fn lose_row(&mut self, leaf: u32, what: &str) {
        self.rows += 1;
        self.reason.get_or_insert_with(|| format!("on page {leaf}: {what}"));
    }

    fn lose_page(&mut self, number: u32, error: PageError) -> io::Result<()> {
        let what = match error {
            PageError::Read(error) => return Err(error),
            PageError::Missing => {
                self.missing_pages += 1;
                "it lies behind the end of the file"
            }
            PageError::Broken(what) => what,
        };
        self.pages += 1;
        self.reason.get_or_insert_with(|| format!("page {number}: {what}"));
        Ok(())
    }
}

/// Positions of a row's bytes.
struct Cell {
    number: i64,
    bytes: u64,
    /// Range of the bytes on the row's leaf.
    local: Range<usize>,
    /// First page of the remaining bytes.
    overflow: Option<u32>,
}

/// Passes every readable row of a table to `visit`.
pub fn for_each_row<R: Read + Seek>(
    pages: &mut Pages<R>,
    wanted: &Wanted<'_>,
    losses: &mut Losses,
    mut visit: impl FnMut(&Row<'_>, &mut Losses),
) -> io::Result<()> {
    // Each page is read only once, so the loop ends.
    let mut open = vec![wanted.root];
    let mut payload = Vec::new();
    while let Some(number) = open.pop() {
        let page = match pages.page(number) {
            Ok(page) => page.to_vec(),
            Err(error) => {
                losses.lose_page(number, error)?;
                continue;
            }
        };
        let page = Page { bytes: &page, start: if number == 1 { HEADER_BYTES } else { 0 } };
        match page.kind() {
            Some(TABLE_INNER) => match page.children() {
                Some(children) => open.extend(children.into_iter().rev()),
                None => losses.lose_page(number, PageError::Broken("its children cannot be read"))?,
            },
            Some(TABLE_LEAF) if wanted.leaves.is_some_and(|leaves| !leaves.contains(&u64::from(number))) => {}
            Some(TABLE_LEAF) => {
                for cell in page.cells() {
                    let read = match cell {
                        Some(cell) => {
                            read_row(pages, &cell, (page.bytes, wanted.max_bytes), &mut payload)?.map(|()| cell.number)
                        }
                        None => Err("a row cannot be read"),
                    };
                    match read {
                        Ok(row) => visit(&Row { leaf: number, number: row, payload: &payload }, losses),
                        Err(what) => losses.lose_row(number, what),
                    }
                }
            }
            _ => losses.lose_page(number, PageError::Broken("it is no page of a table with numbered rows"))?,
        }
    }
    Ok(())
}

/// Assembles a row from its leaf and the following pages.
fn read_row<R: Read + Seek>(
    pages: &mut Pages<R>,
    cell: &Cell,
    (leaf, max_bytes): (&[u8], u64),
    payload: &mut Vec<u8>,
) -> io::Result<Result<(), &'static str>> {
    payload.clear();
    if cell.bytes > max_bytes {
        return Ok(Err("a row is longer than what is read"));
    }
    payload.extend_from_slice(&leaf[cell.local.clone()]);
    let (bytes, mut next) = (cell.bytes as usize, cell.overflow);
    while payload.len() < bytes {
        let Some(number) = next.filter(|number| *number > 0) else {
            return Ok(Err("a row ends before its length"));
        };
        let page = match pages.page(number) {
            Ok(page) => page,
            Err(PageError::Read(error)) => return Err(error),
            Err(PageError::Missing) => return Ok(Err("a row goes on behind the end of the file")),
            Err(PageError::Broken(what)) => return Ok(Err(what)),
        };
        next = be_u32(page, 0);
        let n = (bytes - payload.len()).min(page.len() - 4);
        payload.extend_from_slice(&page[4..4 + n]);
    }
    Ok(Ok(()))
}

/// A page of a table.
struct Page<'a> {
    bytes: &'a [u8],
    /// Start of the page's head: on the first page the file's header precedes it.
    start: usize,
}

impl Page<'_> {
    fn kind(&self) -> Option<u8> {
        self.bytes.get(self.start).copied()
    }

    /// Returns the start of each cell.
    fn cell_places(&self, head_bytes: usize) -> Option<Vec<usize>> {
        let n = usize::from(be_u16(self.bytes, self.start + 3)?);
        let at = self.start + head_bytes;
        let places = self.bytes.get(at..at + 2 * n)?;
        Some(places.chunks_exact(2).map(|two| usize::from(u16::from_be_bytes([two[0], two[1]]))).collect())
    }

    fn children(&self) -> Option<Vec<u32>> {
        let places = self.cell_places(INNER_HEAD_BYTES)?;
        let last = be_u32(self.bytes, self.start + 8)?;
        let children: Option<Vec<u32>> = places.into_iter().map(|at| be_u32(self.bytes, at)).collect();
        children.map(|mut children| {
            children.push(last);
            children
        })
    }

    /// Returns the cells; `None` for each that cannot be read. Together they are no longer than the page.
    fn cells(&self) -> Vec<Option<Cell>> {
        let Some(places) = self.cell_places(LEAF_HEAD_BYTES) else { return vec![None] };
        let mut left = self.bytes.len();
        let mut fits = |cell: &Cell| {
            let room = left.checked_sub(cell.local.len());
            left = room.unwrap_or(left);
            room.is_some()
        };
        places.into_iter().map(|at| self.cell(at).filter(|cell| fits(cell))).collect()
    }

    fn cell(&self, at: usize) -> Option<Cell> {
        let rest = self.bytes.get(at..)?;
        let (bytes, rest) = varint(rest)?;
        let (number, rest) = varint(rest)?;
        let start = self.bytes.len() - rest.len();
        let local_bytes = local_bytes(bytes, self.bytes.len())?;
        let local = start..start.checked_add(local_bytes)?;
        self.bytes.get(local.clone())?;
        let overflow = if bytes > local_bytes as u64 { Some(be_u32(self.bytes, local.end)?) } else { None };
        Some(Cell { number: number as i64, bytes, local, overflow })
    }
}

/// Returns the number of a row's bytes on its leaf, by "Database File Format", section 1.6.
fn local_bytes(bytes: u64, usable: usize) -> Option<usize> {
    let most = usable.checked_sub(35)?;
    if bytes <= most as u64 {
        return Some(bytes as usize);
    }
    let least = (usable - 12) * 32 / 255 - 23;
    let filling = least + ((bytes - least as u64) % (usable as u64 - 4)) as usize;
    Some(if filling <= most { filling } else { least })
}
