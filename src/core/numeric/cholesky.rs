//! Cholesky factors of dense matrices of a hundred columns or so, by blocks: most of the work is products of matrices,
//! which are several times as fast as products of vectors (Golub and Van Loan, Matrix Computations, 4.2.9).

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Columns of a block, and of a part of it that is factored column by column.
const BLOCK: usize = 24;
const PART: usize = 8;
/// Rows that are solved one by one.
const SOLVE_BLOCK: usize = 32;

/// Returns the Cholesky factor of a symmetric matrix, of which only the lower triangle is read. `None` if the matrix is
/// not positive definite.
#[must_use]
pub fn cholesky(mut matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    assert!(matrix.is_square(), "a Cholesky factor is of a square matrix");
    let n = matrix.nrows();
    for first in (0..n).step_by(BLOCK) {
        let end = (first + BLOCK).min(n);
        subtract_before(&mut matrix, 0, first..end);
        for part in (first..end).step_by(PART) {
            let part_end = (part + PART).min(end);
            subtract_before(&mut matrix, first, part..part_end);
            for column in part..part_end {
                factor_column(&mut matrix, part, column)?;
            }
        }
    }
    Some(Cholesky::pack_dirty(matrix))
}

/// Solves `L x = right` in place for each column of `right`, with `L` the lower factor.
pub fn solve_lower(factor: &Cholesky<f64, Dyn>, right: &mut DMatrix<f64>) {
    let lower = factor.l_dirty();
    let n = lower.nrows();
    assert!(right.nrows() == n, "as many rows as the factor has");
    for first in (0..n).step_by(SOLVE_BLOCK) {
        let end = (first + SOLVE_BLOCK).min(n);
        for mut column in right.column_iter_mut() {
            for row in first..end {
                let value = column[row] / lower[(row, row)];
                column[row] = value;
                let below = lower.view((row + 1, row), (end - row - 1, 1));
                column.rows_range_mut(row + 1..end).axpy(-value, &below.column(0), 1.0);
            }
        }
        if end == n {
            break;
        }
        let (done, mut rest) = right.rows_range_pair_mut(first..end, end..n);
        rest.gemm(-1.0, &lower.view((end, first), (n - end, end - first)), &done, 1.0);
    }
}

/// Subtracts the contribution of the finished columns, `from` to the first of `own`, from `own`.
fn subtract_before(matrix: &mut DMatrix<f64>, from: usize, own: Range<usize>) {
    if from == own.start {
        return;
    }
    let (n, first, width) = (matrix.nrows(), own.start, own.len());
    let (done, mut own) = matrix.columns_range_pair_mut(from..first, own);
    let rows = done.rows_range(first..n);
    // Products of matrices with the right one transposed are several times as slow.
    let across = rows.rows_range(..width).transpose();
    own.rows_range_mut(first..n).gemm(-1.0, &rows, &across, 1.0);
}

/// Finishes `column`, from which the contributions of the columns before `first` are already subtracted.
fn factor_column(matrix: &mut DMatrix<f64>, first: usize, column: usize) -> Option<()> {
    let n = matrix.nrows();
    for before in first..column {
        let factor = matrix[(column, before)];
        let (done, mut own) = matrix.columns_range_pair_mut(before, column);
        own.rows_range_mut(column..n).axpy(-factor, &done.rows_range(column..n), 1.0);
    }
    let pivot = matrix[(column, column)];
    // NaN is no pivot.
    if !(pivot > 0.0 && pivot.is_finite()) {
        return None;
    }
    let root = pivot.sqrt();
    let mut own = matrix.view_mut((column, column), (n - column, 1));
    own /= root;
    Some(())
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn random(n: usize, seed: u64) -> DMatrix<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut unit = || f64::from(rng.next_u32()) / f64::from(u32::MAX) - 0.5;
        DMatrix::from_fn(n, n, |_, _| unit())
    }

    #[test]
    fn the_factor_times_its_transpose_is_the_matrix() {
        for (seed, n) in [1, 2, 31, 32, 33, 64, 115, 200].into_iter().enumerate() {
            let square = random(n, seed as u64);
            let matrix = &square * square.transpose() + DMatrix::identity(n, n);
            let mut lower = matrix.clone();
            // The upper triangle is not read.
            lower.fill_upper_triangle(f64::NAN, 1);
            let factor = cholesky(lower).expect("positive definite").l();
            let off = (&factor * factor.transpose() - &matrix).amax();
            assert!(off < 1e-12 * matrix.amax() * n as f64, "{n}: {off}");
        }
    }

    #[test]
    fn columns_are_solved_by_blocks_as_one_by_one() {
        for (seed, n) in [1, 31, 32, 33, 115].into_iter().enumerate() {
            let square = random(n, seed as u64);
            let factor = cholesky(&square * square.transpose() + DMatrix::identity(n, n)).expect("positive definite");
            let right = random(n, 7).columns(0, n.min(5)).into_owned();
            let mut solved = right.clone();
            solve_lower(&factor, &mut solved);
            assert!((factor.l() * solved - right).amax() < 1e-12 * n as f64, "{n}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_none() {
        for at in [0, 20, 40, 69] {
            let square = random(70, 3);
            let mut matrix = &square * square.transpose() + DMatrix::identity(70, 70);
            matrix[(at, at)] = -1.0;
            assert!(cholesky(matrix.clone()).is_none(), "{at}");
            matrix[(at, at)] = f64::NAN;
            assert!(cholesky(matrix).is_none(), "{at}");
        }
        assert!(cholesky(DMatrix::zeros(0, 0)).is_some());
    }
}
