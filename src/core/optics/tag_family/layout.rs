//! Layouts of the families' cells: one text per family, as the AprilTag project draws them.
//!
//! `w` white, `b` black, `d` a bit of the code, `.` not printed. The edge of the border square is where `w` and `b`
//! meet.

use super::TagFamily;

/// Maximum number of cells along a side of a printed tag.
pub const MAX_PRINT_CELLS: usize = 11;

const TAG_16H5: &str = "wwwwwwww wbbbbbbw wbddddbw wbddddbw wbddddbw wbddddbw wbbbbbbw wwwwwwww";
const TAG_25H9: &str = "wwwwwwwww wbbbbbbbw wbdddddbw wbdddddbw wbdddddbw wbdddddbw wbdddddbw wbbbbbbbw wwwwwwwww";
const TAG_36H11: &str = "wwwwwwwwww wbbbbbbbbw wbddddddbw wbddddddbw wbddddddbw wbddddddbw wbddddddbw wbddddddbw \
    wbbbbbbbbw wwwwwwwwww";
const CIRCLE_21H7: &str = "...ddd... .bbbbbbb. .bwwwwwb. dbwdddwbd dbwdddwbd dbwdddwbd .bwwwwwb. .bbbbbbb. ...ddd...";
const CIRCLE_49H12: &str = "....ddd.... ..ddddddd.. .dbbbbbbbd. .dbwwwwwbd. ddbwdddwbdd ddbwdddwbdd ddbwdddwbdd \
    .dbwwwwwbd. .dbbbbbbbd. ..ddddddd.. ....ddd....";
const CUSTOM_48H12: &str = "dddddddddd dbbbbbbbbd dbwwwwwwbd dbwddddwbd dbwd..dwbd dbwd..dwbd dbwddddwbd dbwwwwwwbd \
    dbbbbbbbbd dddddddddd";
const STANDARD_41H12: &str =
    "ddddddddd dbbbbbbbd dbwwwwwbd dbwdddwbd dbwdddwbd dbwdddwbd dbwwwwwbd dbbbbbbbd ddddddddd";
const STANDARD_52H13: &str = "dddddddddd dbbbbbbbbd dbwwwwwwbd dbwddddwbd dbwddddwbd dbwddddwbd dbwddddwbd dbwwwwwwbd \
    dbbbbbbbbd dddddddddd";

/// Content of one cell of a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LayoutCell {
    Fixed(bool),
    Bit,
    Blank,
}

/// The order in which a code's bits fill the cells, the highest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BitOrder {
    /// Row by row from the top left.
    Rows,
    /// A quarter of the tag, then the same turned clockwise by one, two and three quarters; a middle cell is last. The
    /// quarter has the top side of each ring of cells, outermost ring first, without the ring's right corner.
    Quarters,
}

pub(super) fn rows(family: TagFamily) -> impl DoubleEndedIterator<Item = &'static str> {
    let text = match family {
        TagFamily::Tag16h5 => TAG_16H5,
        TagFamily::Tag25h9 => TAG_25H9,
        TagFamily::Tag36h11 => TAG_36H11,
        TagFamily::Circle21h7 => CIRCLE_21H7,
        TagFamily::Circle49h12 => CIRCLE_49H12,
        TagFamily::Custom48h12 => CUSTOM_48H12,
        TagFamily::Standard41h12 => STANDARD_41H12,
        TagFamily::Standard52h13 => STANDARD_52H13,
    };
    text.split(' ')
}

/// Returns the cells row by row from the top, and their number along a side.
pub(super) fn cells(family: TagFamily) -> ([[LayoutCell; MAX_PRINT_CELLS]; MAX_PRINT_CELLS], usize) {
    let mut cells = [[LayoutCell::Blank; MAX_PRINT_CELLS]; MAX_PRINT_CELLS];
    let mut n = 0;
    for (line, text) in cells.iter_mut().zip(rows(family)) {
        n += 1;
        for (cell, letter) in line.iter_mut().zip(text.chars()) {
            *cell = match letter {
                'w' => LayoutCell::Fixed(true),
                'b' => LayoutCell::Fixed(false),
                'd' => LayoutCell::Bit,
                _ => LayoutCell::Blank,
            };
        }
    }
    (cells, n)
}

/// Row and column of each bit, the highest first.
pub(super) fn bit_places(family: TagFamily) -> Vec<[usize; 2]> {
    let (cells, n) = cells(family);
    let is_bit = |place: &[usize; 2]| cells[place[0]][place[1]] == LayoutCell::Bit;
    if bit_order(family) == BitOrder::Rows {
        return (0..n * n).map(|k| [k / n, k % n]).filter(is_bit).collect();
    }
    let top = |ring: usize| (ring..n - 1 - ring).map(move |column| [ring, column]);
    let quarter: Vec<[usize; 2]> = (0..n / 2).flat_map(top).filter(is_bit).collect();
    let turned = |[row, column]: [usize; 2]| [column, n - 1 - row];
    let mut places = quarter.clone();
    let mut last = quarter;
    for _ in 0..3 {
        last = last.into_iter().map(turned).collect();
        places.extend_from_slice(&last);
    }
    let middle = [n / 2, n / 2];
    if n % 2 == 1 && is_bit(&middle) {
        places.push(middle);
    }
    places
}

fn bit_order(family: TagFamily) -> BitOrder {
    match family {
        TagFamily::Tag16h5 | TagFamily::Tag25h9 | TagFamily::Tag36h11 => BitOrder::Rows,
        _ => BitOrder::Quarters,
    }
}
