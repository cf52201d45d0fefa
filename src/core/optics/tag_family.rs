//! The printed patterns of the AprilTag families (Olson 2011; Wang and Olson 2016; Krogius et al. 2019).
//!
//! Older families have their bits within a black border. The border of the newer families has two rings, black around
//! white, with bits within and beyond it. The AprilTag library reads back every tag, id and corners.

mod codes;
mod layout;

use std::fmt;
use std::str::FromStr;

use codes::codes;
pub use layout::MAX_PRINT_CELLS;
use layout::{LayoutCell, bit_places};

/// A family of tags. A tag's size is the side of its border square: the edge between the border's black and white.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TagFamily {
    /// 30 tags of 4 x 4 cells. Ids differ in 5 bits, so false detections are frequent.
    Tag16h5,
    /// 35 tags of 5 x 5 cells.
    Tag25h9,
    /// 587 tags of 6 x 6 cells.
    #[default]
    Tag36h11,
    /// 38 round tags; ids differ in 7 bits.
    Circle21h7,
    /// 65535 round tags.
    Circle49h12,
    /// 42211 tags with a free middle.
    Custom48h12,
    /// 2115 tags.
    Standard41h12,
    /// 48714 tags.
    Standard52h13,
}

/// All printed cells of one tag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TagCells {
    n: usize,
    rows: [[Option<bool>; MAX_PRINT_CELLS]; MAX_PRINT_CELLS],
}

impl TagCells {
    /// Returns the rows from the top, each from the left: white, black, or nothing printed.
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = &[Option<bool>]> {
        self.rows[..self.n].iter().map(|row| &row[..self.n])
    }

    /// Number of cells along a side.
    #[must_use]
    pub fn n(&self) -> usize {
        self.n
    }

    /// Returns true if a cell is white; `None` outside the tag and if nothing is printed.
    #[must_use]
    pub fn get(&self, row: usize, column: usize) -> Option<bool> {
        self.rows.get(row)?.get(column).copied().flatten()
    }
}

impl TagFamily {
    /// All supported families.
    pub const ALL: [Self; 8] = [
        Self::Tag16h5,
        Self::Tag25h9,
        Self::Tag36h11,
        Self::Circle21h7,
        Self::Circle49h12,
        Self::Custom48h12,
        Self::Standard41h12,
        Self::Standard52h13,
    ];

    /// Returns the name in files: 36h11, Standard41h12.
    #[must_use]
    pub fn name(self) -> &'static str {
        &self.long_name()["tag".len()..]
    }

    /// Returns the name in messages, frames and the AprilTag library: tag36h11, tagStandard41h12.
    #[must_use]
    pub fn long_name(self) -> &'static str {
        match self {
            Self::Tag16h5 => "tag16h5",
            Self::Tag25h9 => "tag25h9",
            Self::Tag36h11 => "tag36h11",
            Self::Circle21h7 => "tagCircle21h7",
            Self::Circle49h12 => "tagCircle49h12",
            Self::Custom48h12 => "tagCustom48h12",
            Self::Standard41h12 => "tagStandard41h12",
            Self::Standard52h13 => "tagStandard52h13",
        }
    }

    /// Number of tags of the family.
    #[must_use]
    pub fn n_tags(self) -> usize {
        codes(self).len()
    }

    /// Number of cells along a side of the border square.
    #[must_use]
    pub fn n_cells(self) -> usize {
        match self {
            Self::Circle21h7 | Self::Circle49h12 | Self::Standard41h12 => 5,
            Self::Tag16h5 | Self::Custom48h12 | Self::Standard52h13 => 6,
            Self::Tag25h9 => 7,
            Self::Tag36h11 => 8,
        }
    }

    /// Number of the tag's cells beyond the border square, on each side: one white ring, or black and bits.
    #[must_use]
    pub fn n_margin_cells(self) -> usize {
        match self {
            Self::Tag16h5 | Self::Tag25h9 | Self::Tag36h11 => 1,
            Self::Circle49h12 => 3,
            Self::Circle21h7 | Self::Custom48h12 | Self::Standard41h12 | Self::Standard52h13 => 2,
        }
    }

    /// Returns the cells of tag `id`; `None` for an id that the family does not have.
    #[must_use]
    pub fn cells(self, id: u32) -> Option<TagCells> {
        let code = *codes(self).get(id as usize)?;
        let (layout, n) = layout::cells(self);
        let mut rows = layout.map(|row| {
            row.map(|cell| match cell {
                LayoutCell::Fixed(is_white) => Some(is_white),
                LayoutCell::Bit | LayoutCell::Blank => None,
            })
        });
        let places = bit_places(self);
        for (bit, [row, column]) in places.iter().rev().enumerate() {
            rows[*row][*column] = Some(code >> bit & 1 == 1);
        }
        Some(TagCells { n, rows })
    }
}

impl fmt::Display for TagFamily {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for TagFamily {
    type Err = String;

    /// Parses a family's name, with or without the prefix `tag`.
    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|family| text == family.name() || text == family.long_name());
        found.ok_or_else(|| {
            let names: Vec<String> = Self::ALL.iter().map(|family| format!("\"{}\"", family.name())).collect();
            format!("`{text}` is not supported; use one of {}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(cells: &TagCells) -> u128 {
        cells.rows().flatten().fold(0, |bits, cell| bits << 1 | u128::from(cell.unwrap_or(false)))
    }

    /// Returns the cells turned by a quarter turn.
    fn turned(cells: &TagCells) -> TagCells {
        let last = cells.n() - 1;
        let mut out = *cells;
        for row in 0..=last {
            for column in 0..=last {
                out.rows[row][column] = cells.rows[last - column][row];
            }
        }
        out
    }

    /// Codes of a family, in all four rotations, differ in the number of bits in its name. Of large families every
    /// 499th code is compared with all.
    #[test]
    fn any_two_tags_of_a_family_differ_in_the_bits_of_its_name() {
        for (family, n_tags, distance) in [
            (TagFamily::Tag16h5, 30, 5),
            (TagFamily::Tag25h9, 35, 9),
            (TagFamily::Tag36h11, 587, 11),
            (TagFamily::Circle21h7, 38, 7),
            (TagFamily::Circle49h12, 65535, 12),
            (TagFamily::Custom48h12, 42211, 12),
            (TagFamily::Standard41h12, 2115, 12),
            (TagFamily::Standard52h13, 48714, 13),
        ] {
            assert_eq!(family.n_tags(), n_tags);
            assert!(family.cells(n_tags as u32).is_none());
            let all: Vec<u128> = (0..n_tags as u32).map(|id| bits(&family.cells(id).expect("an id"))).collect();
            let mut least = u32::MAX;
            for id in (0..n_tags).step_by(if n_tags > 1000 { 499 } else { 1 }) {
                let mut other = family.cells(id as u32).expect("an id");
                for turn in 0..4 {
                    let apart = all.iter().enumerate().filter(|(k, _)| turn > 0 || *k != id);
                    let here = bits(&other);
                    least = apart.map(|(_, second)| (here ^ second).count_ones()).fold(least, u32::min);
                    other = turned(&other);
                }
            }
            assert!(
                least == distance || (n_tags > 1000 && least > distance && least < distance + 3),
                "{family}: {least}"
            );
        }
    }

    /// The border square has one colour all around within its edge, and the other colour beyond it.
    #[test]
    fn the_border_is_where_black_and_white_meet() {
        for family in TagFamily::ALL {
            let cells = family.cells(1).expect("an id");
            let (n, margin) = (family.n_cells(), family.n_margin_cells());
            assert_eq!(cells.n(), n + 2 * margin, "{family}");
            let ring = |from: usize, side: usize| {
                let last = from + side - 1;
                let along = (from..=last).flat_map(move |k| [[from, k], [last, k], [k, from], [k, last]]);
                along.map(|[row, column]| cells.get(row, column)).collect::<Vec<_>>()
            };
            let is_classic = margin == 1;
            assert!(ring(margin, n).iter().all(|cell| *cell == Some(!is_classic)), "{family}");
            assert!(ring(margin - 1, n + 2).iter().all(|cell| *cell == Some(is_classic)), "{family}");
        }
        // A round tag has no corners; a custom tag has a free middle.
        let nothing_at = |family: TagFamily, at: usize| family.cells(0).expect("an id").get(at, at).is_none();
        assert!(nothing_at(TagFamily::Circle21h7, 0) && nothing_at(TagFamily::Custom48h12, 5));
    }

    #[test]
    fn a_name_is_read_with_and_without_tag_before_it() {
        for family in TagFamily::ALL {
            assert_eq!(family.name().parse(), Ok(family));
            assert_eq!(family.long_name().parse(), Ok(family));
        }
        insta::assert_snapshot!("no_such_family", "36h10".parse::<TagFamily>().expect_err("no such family"));
    }
}
