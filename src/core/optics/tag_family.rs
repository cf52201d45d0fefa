//! The printed patterns of the square AprilTag families (Olson 2011; Wang and Olson 2016).
//!
//! The codes come from OpenCV's dictionaries (tests/oracle/make_tag_families.py), turned upright: OpenCV holds them
//! turned by half a turn against the AprilTag project's images. The AprilTag library reads every tag back, id and
//! corners.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

/// Most cells along a side of a tag with its black border.
pub const MAX_TAG_CELLS: usize = 8;
/// Most cells along a side of a printed board: the tag and a white ring of one cell around it.
pub const MAX_BOARD_CELLS: usize = MAX_TAG_CELLS + 2;

/// A family of square tags with a black border, on whose outer edge a tag's size is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TagFamily {
    /// 30 tags of 4 x 4 cells. Ids differ in 5 bits: what is no tag is often read as one.
    Tag16h5,
    /// 35 tags of 5 x 5 cells.
    Tag25h9,
    /// 587 tags of 6 x 6 cells.
    #[default]
    Tag36h11,
}

/// The cells of one tag as printed, its black border included; true is white.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TagCells {
    n: usize,
    rows: [[bool; MAX_TAG_CELLS]; MAX_TAG_CELLS],
}

impl TagCells {
    /// Rows from the top, each from the left.
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = &[bool]> {
        self.rows[..self.n].iter().map(|row| &row[..self.n])
    }

    /// Cells along a side.
    #[must_use]
    pub fn n(&self) -> usize {
        self.n
    }

    /// Whether a cell is white; `None` beside the tag.
    #[must_use]
    pub fn get(&self, row: usize, column: usize) -> Option<bool> {
        (row < self.n && column < self.n).then(|| self.rows[row][column])
    }
}

/// Codes by id, row by row from the top left, the first cell the highest bit; 1 is white.
type Codes = LazyLock<Vec<u64>>;

fn codes(lines: &str) -> Vec<u64> {
    lines.lines().filter_map(|line| u64::from_str_radix(line.trim(), 16).ok()).collect()
}

static TAG_16H5: Codes = LazyLock::new(|| codes(include_str!("tag_family/tag16h5.txt")));
static TAG_25H9: Codes = LazyLock::new(|| codes(include_str!("tag_family/tag25h9.txt")));
static TAG_36H11: Codes = LazyLock::new(|| codes(include_str!("tag_family/tag36h11.txt")));

impl TagFamily {
    /// All that are supported.
    pub const ALL: [Self; 3] = [Self::Tag16h5, Self::Tag25h9, Self::Tag36h11];

    /// As files call it: 36h11.
    #[must_use]
    pub fn name(self) -> &'static str {
        &self.long_name()["tag".len()..]
    }

    /// As messages and frames call it: tag36h11.
    #[must_use]
    pub fn long_name(self) -> &'static str {
        match self {
            Self::Tag16h5 => "tag16h5",
            Self::Tag25h9 => "tag25h9",
            Self::Tag36h11 => "tag36h11",
        }
    }

    /// How many tags the family has.
    #[must_use]
    pub fn n_tags(self) -> usize {
        self.codes().len()
    }

    /// Cells along a side of a tag with its black border.
    #[must_use]
    pub fn n_cells(self) -> usize {
        match self {
            Self::Tag16h5 => 6,
            Self::Tag25h9 => 7,
            Self::Tag36h11 => 8,
        }
    }

    /// The cells of tag `id`; `None` for an id that the family does not have.
    #[must_use]
    pub fn cells(self, id: u32) -> Option<TagCells> {
        let code = *self.codes().get(id as usize)?;
        let n = self.n_cells();
        let inner = n - 2;
        let mut rows = [[false; MAX_TAG_CELLS]; MAX_TAG_CELLS];
        for (row, line) in rows[1..=inner].iter_mut().enumerate() {
            for (column, cell) in line[1..=inner].iter_mut().enumerate() {
                *cell = code >> (inner * inner - 1 - (inner * row + column)) & 1 == 1;
            }
        }
        Some(TagCells { n, rows })
    }

    fn codes(self) -> &'static [u64] {
        match self {
            Self::Tag16h5 => &TAG_16H5,
            Self::Tag25h9 => &TAG_25H9,
            Self::Tag36h11 => &TAG_36H11,
        }
    }
}

impl fmt::Display for TagFamily {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for TagFamily {
    type Err = String;

    /// With or without `tag` in front.
    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|family| text == family.name() || text == family.long_name());
        found.ok_or_else(|| format!("`{text}` is not supported; use \"16h5\", \"25h9\" or \"36h11\""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes of a family, turned in all ways, differ in as many bits as its name says.
    #[test]
    fn any_two_tags_of_a_family_differ_in_the_bits_of_its_name() {
        let turned = |cells: &TagCells| {
            let last = cells.n() - 1;
            let mut out = *cells;
            for row in 0..=last {
                for column in 0..=last {
                    out.rows[row][column] = cells.rows[last - column][row];
                }
            }
            out
        };
        let bits = |cells: &TagCells| cells.rows().flatten().fold(0_u64, |bits, cell| bits << 1 | u64::from(*cell));
        for (family, n_tags, distance) in
            [(TagFamily::Tag16h5, 30, 5), (TagFamily::Tag25h9, 35, 9), (TagFamily::Tag36h11, 587, 11)]
        {
            assert_eq!(family.n_tags(), n_tags);
            assert!(family.cells(n_tags as u32).is_none());
            let all: Vec<TagCells> = (0..n_tags as u32).map(|id| family.cells(id).expect("an id")).collect();
            let mut least = u32::MAX;
            for (a, first) in all.iter().enumerate() {
                let mut other = *first;
                for turn in 0..4 {
                    let from = a + usize::from(turn == 0);
                    least = all[from..]
                        .iter()
                        .map(|second| (bits(&other) ^ bits(second)).count_ones())
                        .fold(least, u32::min);
                    other = turned(&other);
                }
            }
            assert_eq!(least, distance, "{family}");
        }
    }

    #[test]
    fn a_name_is_read_with_and_without_tag_before_it() {
        for family in TagFamily::ALL {
            assert_eq!(family.name().parse(), Ok(family));
            assert_eq!(family.long_name().parse(), Ok(family));
        }
        let problem = "36h10".parse::<TagFamily>().expect_err("no such family");
        assert!(problem.contains("`36h10`") && problem.contains("\"25h9\""), "{problem}");
    }
}
