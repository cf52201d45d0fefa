//! Reflectance of a blurred tag: its cells convolved with a Gaussian, with derivatives.
//!
//! Position (u, v) in cells from the bottom left corner of the border square as printed, u right, v up, 0 .. n. Beyond
//! the print, its outermost cells continue; cells within it that are not printed are white. The separable part is a
//! product of normal integrals. The blur's cross term enters to first order: convolution with a Gaussian obeys the heat
//! equation, dP/dC_uv = d2P/(du dv).

use crate::normal::{NormalTable, REACH};

use armcal_core::optics::{MAX_PRINT_CELLS as MAX_CELLS, TagCells, TagFamily};

/// A tag's cells: `[row from the bottom + margin][column + margin]`, 1 = white.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    /// Cells along a side of the border square, and those printed beyond it on each side.
    extent: Extent,
    rows: [[f64; MAX_CELLS]; MAX_CELLS],
    /// True for cells without print, in the order of `rows`; `None` if every cell is printed.
    blank: Option<[[bool; MAX_CELLS]; MAX_CELLS]>,
}

#[derive(Clone, Copy, Debug)]
struct Extent {
    n: usize,
    margin: usize,
}

impl Extent {
    /// Cells of the whole print along a side.
    #[inline]
    fn n_printed(self) -> usize {
        self.n + 2 * self.margin
    }

    /// Index of the printed cell at a position, the outermost beyond the print.
    #[inline]
    fn index(self, position: f64) -> usize {
        (position.floor() + self.margin as f64).clamp(0.0, (self.n_printed() - 1) as f64) as usize
    }
}

/// Reflectance (0 black, 1 white) and its derivatives by u and v, cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Blurred {
    pub p: f64,
    pub u: f64,
    pub v: f64,
    pub uu: f64,
    pub uv: f64,
    pub vv: f64,
}

/// Weights of the cells along one axis at a position, with derivatives.
struct Axis {
    /// Index of the first cell of the print.
    first: usize,
    n: usize,
    weights: [[f64; 3]; MAX_CELLS],
}

impl Axis {
    #[inline]
    fn at(table: &NormalTable, extent: Extent, position: f64, std: f64) -> Self {
        // Edges between printed cells.
        let (low, high) = (1.0 - extent.margin as f64, (extent.n + extent.margin) as f64 - 1.0);
        let first_edge = (position - REACH * std).ceil().clamp(low, high + 1.0);
        let last_edge = (position + REACH * std).floor().clamp(low - 1.0, high);
        let mut axis = Self { first: 0, n: 1, weights: [[0.0; 3]; MAX_CELLS] };
        let n_edges = (last_edge - first_edge + 1.0).max(0.0) as usize;
        if n_edges == 0 {
            axis.first = extent.index(position);
            axis.weights[0] = [1.0, 0.0, 0.0];
            return axis;
        }
        axis.first = (first_edge - low) as usize;
        axis.n = n_edges + 1;
        let mut before = [0.0; 3];
        let inverse = 1.0 / std;
        for k in 0..n_edges {
            let z = (first_edge + k as f64 - position) * inverse;
            let [integral, density] = table.at(z);
            let here = [integral, -density * inverse, -z * density * inverse * inverse];
            axis.weights[k] = [here[0] - before[0], here[1] - before[1], here[2] - before[2]];
            before = here;
        }
        axis.weights[n_edges] = [1.0 - before[0], -before[1], -before[2]];
        axis
    }
}

impl Cells {
    /// The cells of a tag of `family`.
    pub(super) fn new(family: TagFamily, printed: &TagCells) -> Self {
        let extent = Extent { n: family.n_cells(), margin: family.n_margin_cells() };
        let mut rows = [[1.0; MAX_CELLS]; MAX_CELLS];
        let mut blank = [[false; MAX_CELLS]; MAX_CELLS];
        for (k, row) in printed.rows().rev().enumerate() {
            for (column, cell) in row.iter().enumerate() {
                rows[k][column] = f64::from(u8::from(cell.unwrap_or(true)));
                blank[k][column] = cell.is_none();
            }
        }
        Self { extent, rows, blank: blank.as_flattened().contains(&true).then_some(blank) }
    }

    /// Half of the border square's side in cells: s = +-1 at u = 0 and n.
    #[inline]
    pub(super) fn half(&self) -> f64 {
        0.5 * self.extent.n as f64
    }

    /// Cells printed beyond the border square, on each side.
    #[inline]
    pub(super) fn margin(&self) -> f64 {
        self.extent.margin as f64
    }

    /// Blurred reflectance at a position. `covariance`: of the blur, uu, uv, vv, cells squared.
    #[inline]
    pub(super) fn blurred(&self, table: &NormalTable, position: [f64; 2], covariance: [f64; 3]) -> Blurred {
        let along_u = Axis::at(table, self.extent, position[0], covariance[0].sqrt());
        let along_v = Axis::at(table, self.extent, position[1], covariance[2].sqrt());
        let mut out = Blurred::default();
        for j in 0..along_v.n {
            let line = &self.rows[along_v.first + j];
            let mut sums = [0.0; 3];
            for i in 0..along_u.n {
                let cell = line[along_u.first + i];
                for (sum, weight) in sums.iter_mut().zip(along_u.weights[i]) {
                    *sum += cell * weight;
                }
            }
            let [w, w1, w2] = along_v.weights[j];
            out.p += w * sums[0];
            out.u += w * sums[1];
            out.uu += w * sums[2];
            out.v += w1 * sums[0];
            out.uv += w1 * sums[1];
            out.vv += w2 * sums[0];
        }
        out.p += covariance[1] * out.uv;
        out
    }

    /// Returns true if all cells within a rectangle about a position have one colour.
    pub(super) fn is_flat(&self, position: [f64; 2], reach: [f64; 2]) -> bool {
        let [columns, rows] = self.within(position, reach);
        let first = self.rows[*rows.start()][*columns.start()];
        rows.clone().all(|row| columns.clone().all(|column| self.rows[row][column] == first))
    }

    /// Returns true if all cells within a rectangle about a position are printed.
    pub(super) fn is_printed(&self, position: [f64; 2], reach: [f64; 2]) -> bool {
        let Some(blank) = &self.blank else { return true };
        let [columns, mut rows] = self.within(position, reach);
        rows.all(|row| columns.clone().all(|column| !blank[row][column]))
    }

    /// Columns and rows of the cells within a rectangle about a position.
    fn within(&self, position: [f64; 2], reach: [f64; 2]) -> [std::ops::RangeInclusive<usize>; 2] {
        let index = |x: f64| self.extent.index(x);
        std::array::from_fn(|k| index(position[k] - reach[k])..=index(position[k] + reach[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pattern with white inner cells at `(row * 7 + column * 5) % 3 == 0`, rows from the top.
    fn cells() -> Cells {
        let n = 8;
        let mut rows = [[1.0; MAX_CELLS]; MAX_CELLS];
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let is_inner = (1..n - 1).contains(&row) && (1..n - 1).contains(&column);
            rows[n - row][column + 1] = f64::from(u8::from(is_inner && (row * 7 + column * 5) % 3 == 0));
        }
        Cells { extent: Extent { n, margin: 1 }, rows, blank: None }
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let (table, cells) = (NormalTable::new(), cells());
        let h = 1e-3;
        let c = [0.09, 0.0, 0.16];
        for (u, v) in [(0.1, 0.2), (1.1, 3.4), (7.9, 8.2), (2.5, -0.3), (4.0, 5.05)] {
            let at = |du: f64, dv: f64| cells.blurred(&table, [u + du, v + dv], c);
            let b = at(0.0, 0.0);
            let near = |a: f64, b: f64| assert!((a - b).abs() < 3e-3, "{a} {b} at {u} {v}");
            near(b.u, (at(h, 0.0).p - at(-h, 0.0).p) / (2.0 * h));
            near(b.v, (at(0.0, h).p - at(0.0, -h).p) / (2.0 * h));
            near(b.uu, (at(h, 0.0).u - at(-h, 0.0).u) / (2.0 * h));
            near(b.uv, (at(0.0, h).u - at(0.0, -h).u) / (2.0 * h));
            near(b.vv, (at(0.0, h).v - at(0.0, -h).v) / (2.0 * h));
        }
    }

    #[test]
    fn a_sharp_pattern_is_its_cells_and_a_wide_one_their_mean() {
        let (table, cells) = (NormalTable::new(), cells());
        let tiny = [1e-6, 0.0, 1e-6];
        assert_eq!(cells.blurred(&table, [0.5, 0.5], tiny).p, 0.0);
        assert_eq!(cells.blurred(&table, [-0.5, 4.0], tiny).p, 1.0);
        // The top left inner cell, row 1 and column 1, is white.
        assert_eq!(cells.blurred(&table, [1.5, 6.5], tiny).p, 1.0);
        assert_eq!(cells.blurred(&table, [2.5, 6.5], tiny).p, 0.0);
        assert_eq!(cells.blurred(&table, [1.5, 5.5], tiny).p, 0.0);
        let wide = cells.blurred(&table, [4.0, 4.0], [4.0, 0.0, 4.0]);
        assert!((0.1..0.5).contains(&wide.p), "{}", wide.p);
    }
}
