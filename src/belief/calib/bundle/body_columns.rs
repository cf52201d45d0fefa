//! The body's columns of the normal equations: where joints sit on their parent links, and how the arm bends.
//!
//! Six columns a joint for its link: shift along and turn about the parent link's axes. A turn phi acts as a rotation
//! vector, so that a change of it turns the link by `J(phi)`, the left Jacobian of SO(3). They are one dense block,
//! present only where links or sag are estimated.

use crate::calib::bundle::body_twists::BodySums;
use crate::calib::bundle::linearize::NormalEquations;
use crate::calib::bundle::problem::Layout;
use crate::calib::bundle::schur::{Columns, Directions, SchurBlock};

impl NormalEquations {
    /// The body's own block, and what ties it to the other columns of the group.
    pub(crate) fn add_body(
        &mut self,
        columns: &Columns<'_>,
        sums: &BodySums,
        own: &SchurBlock,
        directions: &Directions,
    ) {
        let layout = columns.layout();
        let by_q = sums.q * sums.twists;
        for (a, at) in body_range(columns, layout) {
            let (twist, pushed) = (sums.twists.column(a), by_q.column(a));
            self.right[at] += twist.dot(&sums.g);
            for (b, other) in body_range(columns, layout).take_while(|(b, _)| *b <= a) {
                self.matrix[(at, other)] += sums.twists.column(b).dot(&pushed);
            }
            for direction in columns.directions() {
                let value = directions.column(direction).dot(&pushed);
                columns.each(direction, |column, by| self.matrix[(at.max(column), at.min(column))] += value * by);
            }
        }
        for observation in own.range.clone() {
            let (u, Some(tag)) = self.by_tag[observation] else { continue };
            let cross = if own.has_any { u - sums.m_h_sum.tr_mul(&u) } else { u };
            for (a, at) in body_range(columns, layout) {
                let mut cells = self.matrix.fixed_view_mut::<6, 1>(tag, at);
                cells -= cross.tr_mul(&sums.twists.column(a));
            }
        }
        if let Some(lens) = layout.lens {
            let by_lens = sums.by_lens - sums.h_sum * (sums.m * sums.by_lens);
            for (a, at) in body_range(columns, layout) {
                let mut cells = self.matrix.fixed_view_mut::<8, 1>(lens, at);
                cells += by_lens.tr_mul(&sums.twists.column(a));
            }
        }
    }
}

/// (column among the body's, column of the matrix) of the links that carry the group, and of sag.
fn body_range(columns: &Columns<'_>, layout: &Layout) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (joints, first, n) = (columns.joints(), layout.links.start, layout.links.len());
    let of_links = (6 * joints.start).min(n)..(6 * joints.end).min(n);
    of_links.chain(n..n + layout.sag.len()).map(move |k| (k, first + k))
}
