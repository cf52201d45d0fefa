//! Winding of the corners of a table's tags in the image.

use std::collections::BTreeMap;

use super::roles::Roles;
use armcal_core::input::{TableContents, tag_number};

/// Counts of the tags in the first rows by the winding of their corners.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Windings {
    pub clockwise: usize,
    pub counter_clockwise: usize,
    /// Tags that are neither: two sides cross.
    pub crossed: usize,
    /// Crossed tags that are clockwise once their last two corners are exchanged.
    pub row_by_row: usize,
}

impl Windings {
    pub fn of(table: &TableContents, roles: &Roles) -> Self {
        let mut found = Self::default();
        for corners in tags(table, roles) {
            let [a, b, c, d] = corners;
            match (way_round(corners), way_round([a, b, d, c])) {
                (Some(Way::Clockwise), _) => found.clockwise += 1,
                (Some(Way::CounterClockwise), _) => found.counter_clockwise += 1,
                (None, exchanged) => {
                    found.crossed += 1;
                    found.row_by_row += usize::from(exchanged == Some(Way::Clockwise));
                }
            }
        }
        found
    }

    fn n(self) -> usize {
        self.clockwise + self.counter_clockwise + self.crossed
    }

    /// The line of the input map for the corners' order, with its reason.
    pub fn corner_order(self) -> String {
        /// Corners of a tag seen from afar may lie on a line.
        const NEARLY_ALL: f64 = 0.9;
        let nearly = |n: usize| n as f64 > NEARLY_ALL * self.n() as f64;
        let Self { clockwise, counter_clockwise, crossed, row_by_row } = self;
        let (order, reason) = match self.n() {
            0 => ("apriltag", "bottom left first, counter-clockwise; or \"opencv\": top left, clockwise".to_owned()),
            n if nearly(clockwise) => ("opencv", first_corner([clockwise, n], ["clockwise", "top left", "bottom"])),
            n if nearly(counter_clockwise) => {
                ("apriltag", first_corner([counter_clockwise, n], ["counter-clockwise", "bottom left", "top"]))
            }
            n if nearly(crossed) => {
                let order = if nearly(row_by_row) { "opencv" } else { "apriltag" };
                (order, format!("the corners of {crossed} of {n} tags cross: exchange the last two"))
            }
            n => {
                let both = format!("clockwise in {clockwise} of {n} tags, counter-clockwise in {counter_clockwise}");
                ("apriltag", format!("{both}: list the corners of all tags the same way round"))
            }
        };
        format!("corner_order = \"{order}\"   # {reason}\n")
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Way {
    Clockwise,
    CounterClockwise,
}

/// Winding of four corners; `None` where they do not form a convex shape.
fn way_round(corners: [[f64; 2]; 4]) -> Option<Way> {
    // v counts downwards, so a turn from u to v is clockwise.
    let turns = [0, 1, 2, 3].map(|k| {
        let [a, b, c] = [0, 1, 2].map(|step| corners[(k + step) % 4]);
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    });
    match turns {
        _ if turns.iter().all(|turn| *turn > 0.0) => Some(Way::Clockwise),
        _ if turns.iter().all(|turn| *turn < 0.0) => Some(Way::CounterClockwise),
        _ => None,
    }
}

/// Text on the start corner, which the cells do not show.
fn first_corner([n, of]: [usize; 2], [way, first, other]: [&str; 3]) -> String {
    format!(
        "{way} in {n} of {of} tags\n# The first corner is taken as {first} as printed. Where it is another one \
         ({other} left or right, for example),\n# the frames of all tags are turned alike about z; `calibrate` names \
         the turn where the views show it."
    )
}

/// Corners of the tags in the first rows.
fn tags(table: &TableContents, roles: &Roles) -> Vec<[[f64; 2]; 4]> {
    let numbers = |name: &String| table.first_cells(name).map(|cell| cell.parse().ok()).collect::<Vec<Option<f64>>>();
    if let Some(columns) = &roles.corners {
        let cells = columns.each_ref().map(numbers);
        let pixel = |row: usize, k: usize| Some([cells[2 * k][row]?, cells[2 * k + 1][row]?]);
        let corners = |row| Some([pixel(row, 0)?, pixel(row, 1)?, pixel(row, 2)?, pixel(row, 3)?]);
        let n_rows = cells.iter().map(Vec::len).min().unwrap_or_default();
        return (0..n_rows).filter_map(corners).collect();
    }
    let (Some(id), Some(corner), Some([u, v])) = (&roles.id, &roles.corner, &roles.pixel) else { return Vec::new() };
    let ids = table.first_cells(id).map(|cell| cell.parse().ok().or_else(|| tag_number(cell)));
    let (corners, [us, vs]) = (numbers(corner), [u, v].map(numbers));
    let mut open: BTreeMap<u32, BTreeMap<u32, [f64; 2]>> = BTreeMap::new();
    let mut found = Vec::new();
    for (((id, corner), u), v) in ids.zip(corners).zip(us).zip(vs) {
        let (Some(id), Some(corner), Some(u), Some(v)) = (id, corner, u, v) else { continue };
        let seen = open.entry(id).or_default();
        seen.insert(corner as u32, [u, v]);
        if let [a, b, c, d] = seen.values().copied().collect::<Vec<_>>()[..] {
            found.push([a, b, c, d]);
            seen.clear();
        }
    }
    found
}
