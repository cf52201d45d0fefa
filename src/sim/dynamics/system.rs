//! Small dense symmetric system: the joint-space inertia and its factor.

use armcal_core::streams::MAX_JOINTS;

/// Largest number of coordinates: six of a free base, then the joints.
pub const MAX_DOF: usize = 6 + MAX_JOINTS;

/// A vector of generalised coordinates; only the first `n` of a system count.
pub type Coordinates = [f64; MAX_DOF];

/// A symmetric positive definite matrix of `n` rows; only the lower triangle is kept.
#[derive(Clone, Copy, Debug)]
pub struct Symmetric {
    n: usize,
    lower: [[f64; MAX_DOF]; MAX_DOF],
}

impl Symmetric {
    /// Returns a matrix of zeros with `n` rows.
    #[must_use]
    pub fn zeros(n: usize) -> Self {
        debug_assert!(n <= MAX_DOF);
        Self { n, lower: [[0.0; MAX_DOF]; MAX_DOF] }
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn n(&self) -> usize {
        self.n
    }

    /// Returns an entry of either triangle.
    #[must_use]
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.lower[row.max(column)][row.min(column)]
    }

    /// Sets an entry and its mirror image.
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        self.lower[row.max(column)][row.min(column)] = value;
    }

    /// Adds to an entry and its mirror image.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        self.lower[row.max(column)][row.min(column)] += value;
    }

    /// Adds `weight v v'`.
    pub fn add_outer(&mut self, weight: f64, v: &Coordinates) {
        for row in 0..self.n {
            for column in 0..=row {
                self.lower[row][column] += weight * v[row] * v[column];
            }
        }
    }

    /// Returns the quadratic form `v' M v`.
    #[must_use]
    pub fn quadratic(&self, v: &Coordinates) -> f64 {
        (0..self.n).map(|i| v[i] * (0..self.n).map(|j| self.get(i, j) * v[j]).sum::<f64>()).sum()
    }

    /// Solves `M x = b` by a factor L L' (Cholesky). A matrix that is not positive definite gives NaN, which the world
    /// reports as a state that is not finite. The factor overwrites the matrix.
    #[must_use]
    #[allow(clippy::needless_range_loop, reason = "indices name rows and columns of several arrays at once")]
    pub fn solve(&mut self, b: &Coordinates) -> Coordinates {
        let n = self.n;
        let l = &mut self.lower;
        let mut x = *b;
        for row in 0..n {
            for column in 0..=row {
                let mut sum = l[row][column];
                for k in 0..column {
                    sum -= l[row][k] * l[column][k];
                }
                l[row][column] = if row == column { sum.sqrt() } else { sum / l[column][column] };
            }
            let known: f64 = (0..row).map(|k| l[row][k] * x[k]).sum();
            x[row] = (x[row] - known) / l[row][row];
        }
        for row in (0..n).rev() {
            let known: f64 = (row + 1..n).map(|k| l[k][row] * x[k]).sum();
            x[row] = (x[row] - known) / l[row][row];
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_solves_what_it_multiplies() {
        let mut m = Symmetric::zeros(7);
        for i in 0..7 {
            m.add(i, i, 0.5 + i as f64);
        }
        for k in 0..5 {
            let v: Coordinates = std::array::from_fn(|i| ((3 * i + 5 * k) as f64).sin());
            m.add_outer(2.0, &v);
        }
        let x: Coordinates = std::array::from_fn(|i| if i < 7 { (i as f64).cos() } else { 0.0 });
        let b: Coordinates =
            std::array::from_fn(|i| if i < 7 { (0..7).map(|j| m.get(i, j) * x[j]).sum() } else { 0.0 });
        let solved = m.solve(&b);
        for i in 0..7 {
            assert!((solved[i] - x[i]).abs() < 1e-12, "{i}");
        }
    }
}
