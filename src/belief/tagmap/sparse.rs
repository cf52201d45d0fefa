//! Sparse symmetric systems of 6x6 blocks, solved by Cholesky factorization.
//!
//! The reduced system of the tags, without cameras, has a block for each pair of tags seen together: few of all (Triggs
//! et al. 2000, sec. 6.1). Blocks are eliminated in the order of least degree; ties go by number, so that the order is
//! reproducible. The fill is found once and used for every iteration.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Matrix6, Vector6};

/// Positions of the nonzero blocks, in the order of elimination.
#[derive(Debug)]
pub(super) struct Pattern {
    /// Position in the order of elimination, for each node.
    place: Vec<usize>,
    /// Rows below the diagonal of each column, ascending positions.
    rows: Vec<Vec<usize>>,
    /// Index of the first block of each column.
    start: Vec<usize>,
}

impl Pattern {
    /// The pattern of `n` nodes where the pairs of `edges` share a block.
    pub(super) fn new(n: usize, edges: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let mut neighbours = vec![BTreeSet::new(); n];
        for (a, b) in edges {
            if a != b {
                neighbours[a].insert(b);
                neighbours[b].insert(a);
            }
        }
        let mut by_degree: BTreeSet<(usize, usize)> = (0..n).map(|node| (neighbours[node].len(), node)).collect();
        let mut place = vec![0; n];
        let mut columns = Vec::with_capacity(n);
        while let Some((_, node)) = by_degree.pop_first() {
            place[node] = columns.len();
            let around: Vec<usize> = std::mem::take(&mut neighbours[node]).into_iter().collect();
            for a in &around {
                by_degree.remove(&(neighbours[*a].len(), *a));
                neighbours[*a].remove(&node);
                neighbours[*a].extend(around.iter().filter(|b| *b != a));
                by_degree.insert((neighbours[*a].len(), *a));
            }
            columns.push(around);
        }
        let mut rows: Vec<Vec<usize>> = Vec::with_capacity(n);
        let mut start = Vec::with_capacity(n);
        let mut n_blocks = 0;
        for column in columns {
            let mut places: Vec<usize> = column.into_iter().map(|node| place[node]).collect();
            places.sort_unstable();
            start.push(n_blocks);
            n_blocks += places.len();
            rows.push(places);
        }
        start.push(n_blocks);
        Self { place, rows, start }
    }

    fn slot(&self, row: usize, column: usize) -> usize {
        match self.rows[column].binary_search(&row) {
            Ok(at) => self.start[column] + at,
            Err(_) => unreachable!("every block of the pattern was announced"),
        }
    }
}

/// A symmetric matrix on a [`Pattern`].
#[derive(Clone, Debug)]
pub(super) struct System {
    pattern: Arc<Pattern>,
    diagonal: Vec<Matrix6<f64>>,
    lower: Vec<Matrix6<f64>>,
}

impl System {
    pub(super) fn zeros(pattern: &Arc<Pattern>) -> Self {
        let n_blocks = pattern.start.last().copied().unwrap_or(0);
        Self {
            pattern: Arc::clone(pattern),
            diagonal: vec![Matrix6::zeros(); pattern.place.len()],
            lower: vec![Matrix6::zeros(); n_blocks],
        }
    }

    /// Adds `block` at (a, b), and its transpose at (b, a) where they differ.
    pub(super) fn add(&mut self, a: usize, b: usize, block: &Matrix6<f64>) {
        let (row, column) = (self.pattern.place[a], self.pattern.place[b]);
        match row.cmp(&column) {
            std::cmp::Ordering::Equal => self.diagonal[row] += block,
            std::cmp::Ordering::Greater => self.lower[self.pattern.slot(row, column)] += block,
            std::cmp::Ordering::Less => self.lower[self.pattern.slot(column, row)] += block.transpose(),
        }
    }

    /// Block by positions in the order of elimination.
    fn at(&self, row: usize, column: usize) -> Matrix6<f64> {
        match row.cmp(&column) {
            std::cmp::Ordering::Equal => self.diagonal[row],
            std::cmp::Ordering::Greater => self.lower[self.pattern.slot(row, column)],
            std::cmp::Ordering::Less => self.lower[self.pattern.slot(column, row)].transpose(),
        }
    }

    /// Factorizes into L of L L^T; `None` if the matrix is not positive definite.
    pub(super) fn factorize(mut self) -> Option<Factor> {
        let pattern = Arc::clone(&self.pattern);
        for column in 0..pattern.rows.len() {
            let pivot = self.diagonal[column].cholesky()?.l();
            self.diagonal[column] = pivot;
            let (from, to) = (pattern.start[column], pattern.start[column + 1]);
            for block in &mut self.lower[from..to] {
                // X L^T = A: solve L X^T = A^T.
                let mut transposed = block.transpose();
                if !pivot.solve_lower_triangular_mut(&mut transposed) {
                    return None;
                }
                *block = transposed.transpose();
            }
            let rows = &pattern.rows[column];
            for (i, &row) in rows.iter().enumerate() {
                let left = self.lower[from + i];
                self.diagonal[row] -= left * left.transpose();
                for (k, &other) in rows[..i].iter().enumerate() {
                    let product = left * self.lower[from + k].transpose();
                    self.lower[pattern.slot(row, other)] -= product;
                }
            }
        }
        Some(Factor { pattern, diagonal: self.diagonal, lower: self.lower })
    }
}

/// A factorized [`System`].
#[derive(Clone, Debug)]
pub(super) struct Factor {
    pattern: Arc<Pattern>,
    diagonal: Vec<Matrix6<f64>>,
    lower: Vec<Matrix6<f64>>,
}

impl Factor {
    /// Solves for a right side given by nodes.
    pub(super) fn solve(&self, right: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let pattern = &*self.pattern;
        let n = pattern.rows.len();
        let mut x = vec![Vector6::zeros(); n];
        for (node, value) in right.iter().enumerate() {
            x[pattern.place[node]] = *value;
        }
        for column in 0..n {
            self.diagonal[column].solve_lower_triangular_mut(&mut x[column]);
            let value = x[column];
            for (i, &row) in pattern.rows[column].iter().enumerate() {
                x[row] -= self.lower[pattern.start[column] + i] * value;
            }
        }
        for column in (0..n).rev() {
            let mut value = x[column];
            for (i, &row) in pattern.rows[column].iter().enumerate() {
                value -= self.lower[pattern.start[column] + i].tr_mul(&x[row]);
            }
            self.diagonal[column].tr_solve_lower_triangular_mut(&mut value);
            x[column] = value;
        }
        pattern.place.iter().map(|&place| x[place]).collect()
    }

    /// Computes the blocks of the inverse in the pattern of the factor, which includes that of the matrix. With `L`,
    /// the inverse `Z` and `U = L_kj L_jj^-1`: `Z_ij = -sum_k Z_ik U_kj` over the rows k of column j. All of these are
    /// in the pattern (Takahashi 1973; Erisman and Tinney 1975). The cost is that of a factorization.
    pub(super) fn selected_inverse(&self) -> SelectedInverse {
        let pattern = Arc::clone(&self.pattern);
        let mut inverse = System::zeros(&pattern);
        for column in (0..pattern.rows.len()).rev() {
            let mut pivot = Matrix6::identity();
            self.diagonal[column].solve_lower_triangular_mut(&mut pivot);
            let (from, rows) = (pattern.start[column], &pattern.rows[column]);
            let scaled: Vec<Matrix6<f64>> = (from..from + rows.len()).map(|at| self.lower[at] * pivot).collect();
            let mut own = pivot.tr_mul(&pivot);
            for (i, &row) in rows.iter().enumerate() {
                let mut block = Matrix6::zeros();
                for (k, &other) in rows.iter().enumerate() {
                    block -= inverse.at(row, other) * scaled[k];
                }
                own -= scaled[i].tr_mul(&block);
                inverse.lower[from + i] = block;
            }
            inverse.diagonal[column] = 0.5 * (own + own.transpose());
        }
        SelectedInverse { inverse }
    }

    /// The six columns of the inverse that belong to `node`, indexed by node.
    pub(super) fn inverse_column(&self, node: usize) -> Vec<Matrix6<f64>> {
        let pattern = &*self.pattern;
        let n = pattern.rows.len();
        let first = pattern.place[node];
        let mut x = vec![Matrix6::zeros(); n];
        x[first] = Matrix6::identity();
        for column in first..n {
            self.diagonal[column].solve_lower_triangular_mut(&mut x[column]);
            let value = x[column];
            for (i, &row) in pattern.rows[column].iter().enumerate() {
                x[row] -= self.lower[pattern.start[column] + i] * value;
            }
        }
        for column in (0..n).rev() {
            let mut value = x[column];
            for (i, &row) in pattern.rows[column].iter().enumerate() {
                value -= self.lower[pattern.start[column] + i].tr_mul(&x[row]);
            }
            self.diagonal[column].tr_solve_lower_triangular_mut(&mut value);
            x[column] = value;
        }
        pattern.place.iter().map(|&place| x[place]).collect()
    }
}

/// Blocks of the inverse of a [`System`].
pub(super) struct SelectedInverse {
    inverse: System,
}

impl SelectedInverse {
    /// Block of two nodes that share a block of the matrix, or of one node.
    pub(super) fn block(&self, a: usize, b: usize) -> Matrix6<f64> {
        let place = &self.inverse.pattern.place;
        self.inverse.at(place[a], place[b])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use nalgebra::{DMatrix, DVector};
    use rand::RngExt;

    /// A random sparse positive definite matrix as a system and dense, and its pairs of nodes.
    fn random(n: usize, seed: u64) -> (System, DMatrix<f64>, Vec<(usize, usize)>) {
        let mut rng = stream_rng(seed, "blocks");
        let edges: Vec<(usize, usize)> =
            (0..2 * n).map(|_| (rng.random_range(0..n), rng.random_range(0..n))).filter(|(a, b)| a != b).collect();
        let mut system = System::zeros(&Arc::new(Pattern::new(n, edges.iter().copied())));
        let mut dense = DMatrix::zeros(6 * n, 6 * n);
        let mut add = |a: usize, b: usize, block: &Matrix6<f64>| {
            system.add(a, b, block);
            let mut at = dense.fixed_view_mut::<6, 6>(6 * a, 6 * b);
            at += block;
            if a != b {
                let mut at = dense.fixed_view_mut::<6, 6>(6 * b, 6 * a);
                at += block.transpose();
            }
        };
        for (a, b) in edges.iter().copied() {
            let block = Matrix6::from_fn(|_, _| rng.random_range(-1.0..1.0));
            add(a, b, &block);
        }
        for a in 0..n {
            add(a, a, &(Matrix6::identity() * 80.0));
        }
        (system, dense, edges)
    }

    #[test]
    fn solutions_and_inverses_are_those_of_the_dense_matrix() {
        for (n, seed) in [(1, 1), (2, 2), (7, 3), (30, 4)] {
            let (system, dense, edges) = random(n, seed);
            let factor = system.factorize().expect("diagonally dominant");
            let right: Vec<Vector6<f64>> = (0..n).map(|k| Vector6::repeat(1.0 + k as f64)).collect();
            let solved = factor.solve(&right);
            let dense_right = DVector::from_iterator(6 * n, right.iter().flat_map(|v| v.iter().copied()));
            let expected = dense.clone().cholesky().expect("positive definite").solve(&dense_right);
            let inverse = dense.try_inverse().expect("regular");
            for (a, solved) in solved.iter().enumerate() {
                assert!((solved - expected.fixed_rows::<6>(6 * a)).norm() < 1e-12);
                let column = factor.inverse_column(a);
                for (b, block) in column.iter().enumerate() {
                    assert!((block - inverse.fixed_view::<6, 6>(6 * b, 6 * a)).norm() < 1e-12);
                }
            }
            let selected = factor.selected_inverse();
            for (a, b) in edges.into_iter().chain((0..n).map(|a| (a, a))) {
                assert!((selected.block(a, b) - inverse.fixed_view::<6, 6>(6 * a, 6 * b)).norm() < 1e-12);
            }
        }
    }

    /// A corridor: each node shares a block with the six before it, and the numbers do not reveal their order.
    #[test]
    fn a_chain_has_as_many_blocks_as_it_is_long() {
        const N: usize = 1000;
        // 389 and 1000 have no common factor.
        let number = |k: usize| k * 389 % N;
        let edges =
            (0..N).flat_map(|k| (1..=6).filter(move |back| *back <= k).map(move |back| (number(k), number(k - back))));
        let n_announced = edges.clone().count();
        let pattern = Pattern::new(N, edges);
        assert!(pattern.start[N] <= n_announced + 10, "{} of {n_announced}", pattern.start[N]);
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let mut system = System::zeros(&Arc::new(Pattern::new(1, [])));
        system.add(0, 0, &-Matrix6::identity());
        assert!(system.factorize().is_none());
    }
}
