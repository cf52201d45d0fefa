//! Columns of the body in the normal equations: joint poses on the parent links, and the arm's compliance.
//!
//! Each joint has six columns for its link: shift along and turn about the parent link's axes. A turn phi acts as a
//! rotation vector, so that a change of it turns the link by `J(phi)`, the left Jacobian of SO(3). They are one dense
//! block, present only if links or sag are estimated.

use nalgebra::Vector6;

use crate::solve::body_twists::BodySums;
use crate::solve::linearize::NormalEquations;
use crate::solve::schur::{BodyTwists, Columns, Directions, N_BODY_COLUMNS, SchurBlock};

impl NormalEquations {
    /// Adds the body's own block, and its coupling to the other columns of the group.
    pub(crate) fn add_body(
        &mut self,
        columns: &Columns<'_>,
        sums: &BodySums,
        own: &SchurBlock,
        directions: &Directions,
    ) {
        let layout = columns.layout();
        let (first, n) = (layout.body().start, layout.body().len());
        let twists = sums.twists.columns(0, n);
        let pushed = RowsOf::new(&(sums.q * sums.twists), n);
        for (b, twist) in twists.column_iter().enumerate() {
            self.right[first + b] += twist.dot(&sums.g);
            let along = pushed.dot(b, &twist.into_owned());
            add(self.cells(first + b, first + b, n - b), &along[b..n], 1.0);
        }
        for direction in columns.directions() {
            let along = pushed.dot(0, &directions.column(direction).into_owned());
            let (column, by_columns) = columns.of(direction);
            for (k, by) in by_columns.iter().enumerate() {
                let column = column + k;
                if column < first {
                    add(self.cells(column, first, n), &along[..n], *by);
                } else {
                    (0..n).for_each(|a| self.matrix[(column, first + a)] += along[a] * by);
                }
            }
        }
        for observation in own.range.clone() {
            let (u, Some(tag)) = self.by_tag[observation] else { continue };
            let cross = if own.has_any { u - sums.m_h_sum.tr_mul(&u) } else { u }.transpose();
            for (a, twist) in twists.column_iter().enumerate() {
                let by = cross * twist;
                self.few_cells::<6>(first + a, tag).iter_mut().zip(&by.data.0[0]).for_each(|(cell, by)| *cell -= by);
            }
        }
        if let Some(lens) = columns.lens {
            let by_lens = (sums.by_lens - sums.h_sum * (sums.m * sums.by_lens)).transpose();
            for (a, twist) in twists.column_iter().enumerate() {
                let by = by_lens * twist;
                self.few_cells::<8>(first + a, lens).iter_mut().zip(&by.data.0[0]).for_each(|(cell, by)| *cell += by);
            }
        }
    }
}

/// A matrix of twists, stored row by row so that products with all its columns become vector instructions.
struct RowsOf {
    rows: [[f64; N_BODY_COLUMNS]; 6],
    n: usize,
}

impl RowsOf {
    fn new(twists: &BodyTwists, n: usize) -> Self {
        Self { rows: std::array::from_fn(|k| std::array::from_fn(|a| twists[(k, a)])), n }
    }

    /// Returns the product of `twist` and each column from `from` on.
    fn dot(&self, from: usize, twist: &Vector6<f64>) -> [f64; N_BODY_COLUMNS] {
        let mut out = [0.0; N_BODY_COLUMNS];
        for (row, by) in self.rows.iter().zip(twist) {
            add(&mut out[from..self.n], &row[from..self.n], *by);
        }
        out
    }
}

#[inline]
fn add(cells: &mut [f64], values: &[f64], by: f64) {
    cells.iter_mut().zip(values).for_each(|(cell, value)| *cell += value * by);
}
