//! Value of a view: the reduction of the logarithm of the design criterion.
//!
//! A view with `G = twists basis` and unit noise takes `P G^T S^-1 G P` off the covariance P. Here `S = I + G P G^T` (6
//! x 6). With the criterion's rows L, let `Y = L P G^T S^(-T/2)` (6 columns). The tool's variance, and the sum of
//! variances, fall by `|Y|^2`. The volume falls by the factor `det(I - Y^T Y)`. The largest variance becomes that of `L
//! P L^T - Y Y^T`. G is never computed: P is first projected on the few directions.

use nalgebra::{Cholesky, DMatrix, Matrix6, SMatrix, SymmetricEigen};

use crate::model::ParameterKind;
use crate::plan::constants::view_planning_criterion::MAX_LINEAR;
use crate::plan::view_planning::parameter_prior::{N_COMMON, N_DIRECTIONS, ParameterPrior, WIDTH, columns};
use crate::plan::view_planning::view_information::{Twists, WhitenedView};
use armcal_core::routine::PoseCriterion;
use armcal_core::streams::MAX_JOINTS;

type Linear = SMatrix<f64, MAX_LINEAR, MAX_LINEAR>;

/// Variance to be minimised.
#[derive(Clone, Debug)]
pub(crate) struct DesignObjective {
    criterion: PoseCriterion,
    /// Rows L: tool position at the targets over the root of their number, or gains and offsets in units of their
    /// priors.
    rows: DMatrix<f64>,
    /// Variance that no view lowers.
    floor: f64,
}

/// Covariance after the views captured so far.
#[derive(Clone, Debug)]
pub(crate) struct DesignState {
    measure: DesignObjective,
    n_joints: usize,
    covariance: DMatrix<f64>,
    /// Matrix `L P`; for the volume `C^-1 L P`, where `C C^T = L P L^T`.
    reach: DMatrix<f64>,
    /// Matrix `L P L^T` of gains and offsets; beyond them zero.
    linear: Linear,
    /// Logarithm of the criterion, a variance.
    pub ln_value: f64,
}

/// Selection of rows of `P E^T`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rows {
    All,
    /// Rows that `E P E^T` needs.
    OfProducts,
}

/// Memory for [`DesignState::gain`].
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Matrix `P E^T`, one column for each joint.
    by_joint: DMatrix<f64>,
    /// Matrix `L P E^T`.
    reached: DMatrix<f64>,
    /// Matrix Y.
    told: DMatrix<f64>,
}

impl DesignObjective {
    pub(crate) fn of_tool(rows: DMatrix<f64>, floor: f64) -> Self {
        Self { criterion: PoseCriterion::ToolError, rows, floor }
    }

    /// Returns the criterion of the sensors' gains and offsets, in units of their priors.
    pub(crate) fn of_sensors(criterion: PoseCriterion, unknowns: &ParameterPrior) -> Self {
        let is_linear = |kind: ParameterKind| matches!(kind, ParameterKind::Gain | ParameterKind::Offset);
        let linear: Vec<usize> = columns(unknowns.n_joints)
            .enumerate()
            .filter(|(column, p)| is_linear(p.kind) && unknowns.covariance[(*column, *column)] > 0.0)
            .map(|(column, _)| column)
            .collect();
        let mut rows = DMatrix::zeros(linear.len(), unknowns.n());
        for (row, &column) in linear.iter().enumerate() {
            rows[(row, column)] = unknowns.covariance[(column, column)].sqrt().recip();
        }
        Self { criterion, rows, floor: 0.0 }
    }
}

impl DesignState {
    pub(crate) fn new(measure: DesignObjective, unknowns: &ParameterPrior) -> Self {
        let mut state = Self {
            measure,
            n_joints: unknowns.n_joints,
            covariance: unknowns.covariance.clone(),
            reach: DMatrix::zeros(0, 0),
            linear: Linear::zeros(),
            ln_value: 0.0,
        };
        state.renew();
        state
    }

    /// Returns the state after `captured` views.
    pub(crate) fn after(measure: DesignObjective, unknowns: &ParameterPrior, captured: &[WhitenedView]) -> Self {
        let mut state = Self::new(measure, unknowns);
        let mut scratch = state.scratch();
        captured.iter().for_each(|view| state.add(view, &mut scratch));
        state.renew();
        state
    }

    pub(crate) fn scratch(&self) -> Scratch {
        let (n_rows, n) = self.reach.shape();
        Scratch {
            by_joint: DMatrix::zeros(n, MAX_JOINTS),
            reached: DMatrix::zeros(n_rows, N_DIRECTIONS),
            told: DMatrix::zeros(n_rows, 6),
        }
    }

    /// Returns the logarithm of the criterion now less that after `view`: not negative.
    pub(crate) fn gain(&self, view: &WhitenedView, scratch: &mut Scratch) -> f64 {
        let Some(half) = self.whitened(view, &mut scratch.by_joint, Rows::OfProducts) else { return 0.0 };
        self.reach_along(view, &mut scratch.reached);
        let n_rows = self.reach.nrows();
        let reached = scratch.reached.as_slice();
        for k in 0..6 {
            let mut terms = [(0, 0.0); N_DIRECTIONS];
            for (term, direction) in terms.iter_mut().zip(self.directions()) {
                *term = (direction * n_rows, half[(k, direction)]);
            }
            let told = &mut scratch.told.as_mut_slice()[k * n_rows..][..n_rows];
            combine(told, reached, &terms[..self.n_joints + N_COMMON]);
        }
        let after = self.ln_after(&scratch.told);
        (self.ln_value - after).max(0.0)
    }

    fn ln_after(&self, told: &DMatrix<f64>) -> f64 {
        let n_rows = told.nrows().max(1) as f64;
        match self.measure.criterion {
            PoseCriterion::ToolError | PoseCriterion::Random | PoseCriterion::AOptimal => {
                let lowered: f64 = told.iter().map(|y| y * y).sum();
                // A variance below this floor is rounding error.
                (self.ln_value.exp() - lowered).max(1e-24).ln()
            }
            PoseCriterion::DOptimal => {
                let inner = Matrix6::identity() - Matrix6::from_fn(|i, k| told.column(i).dot(&told.column(k)));
                self.ln_value + inner.determinant().max(1e-300).ln() / n_rows
            }
            PoseCriterion::EOptimal => {
                let mut linear = self.linear;
                for k in 0..6 {
                    for column in 0..told.nrows() {
                        let by = told[(column, k)];
                        for row in 0..told.nrows() {
                            linear[(row, column)] -= by * told[(row, k)];
                        }
                    }
                }
                largest(&linear)
            }
        }
    }

    /// Adds `view`: its rank-6 update of the covariance, and the derived matrices.
    pub(crate) fn take(&mut self, view: &WhitenedView, scratch: &mut Scratch) {
        self.add(view, scratch);
        self.renew();
    }

    /// Adds `view` to the covariance only. More views may follow; [`Self::renew`] must precede any query.
    pub(crate) fn add(&mut self, view: &WhitenedView, scratch: &mut Scratch) {
        let Some(half) = self.whitened(view, &mut scratch.by_joint, Rows::All) else { return };
        let n = self.covariance.nrows();
        let mut moved = DMatrix::zeros(n, 6);
        let at = self.n_joints * WIDTH;
        for direction in self.directions() {
            let from = if direction < MAX_JOINTS {
                scratch.by_joint.column(direction)
            } else {
                self.covariance.column(at + direction - MAX_JOINTS)
            };
            for k in 0..6 {
                moved.column_mut(k).axpy(half[(k, direction)], &from, 1.0);
            }
        }
        self.covariance.gemm(-1.0, &moved, &moved.transpose(), 1.0);
    }

    /// Recomputes the matrices and the value of the criterion from the covariance.
    pub(crate) fn renew(&mut self) {
        self.reach = &self.measure.rows * &self.covariance;
        let linear = &self.reach * self.measure.rows.transpose();
        let n_rows = linear.nrows().max(1) as f64;
        self.ln_value = match self.measure.criterion {
            PoseCriterion::ToolError | PoseCriterion::Random | PoseCriterion::AOptimal => {
                (linear.trace() + self.measure.floor).max(1e-24).ln()
            }
            PoseCriterion::DOptimal => match Cholesky::new(linear) {
                Some(factor) => {
                    factor.l_dirty().solve_lower_triangular_mut(&mut self.reach);
                    2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>() / n_rows
                }
                None => f64::NEG_INFINITY,
            },
            PoseCriterion::EOptimal => {
                let n = linear.nrows().min(MAX_LINEAR);
                self.linear.view_mut((0, 0), (n, n)).copy_from(&linear.view((0, 0), (n, n)));
                largest(&self.linear)
            }
        };
    }

    fn directions(&self) -> impl Iterator<Item = usize> + use<> {
        (0..self.n_joints).chain(MAX_JOINTS..N_DIRECTIONS)
    }

    /// Returns `S^(-1/2) twists`, and writes these rows of `P E^T` of the joints to `by_joint`; `None` if S overflows.
    fn whitened(&self, view: &WhitenedView, by_joint: &mut DMatrix<f64>, rows: Rows) -> Option<Twists> {
        let n = self.covariance.nrows();
        let at = self.n_joints * WIDTH;
        let mut along = SMatrix::<f64, N_DIRECTIONS, N_DIRECTIONS>::zeros();
        let p = self.covariance.as_slice();
        for joint in 0..self.n_joints {
            let out = &mut by_joint.as_mut_slice()[joint * n..][..n];
            let mut terms = weighted(&view.basis[joint], joint * WIDTH * n, n);
            match rows {
                Rows::All => combine(out, p, &terms),
                Rows::OfProducts => {
                    combine(&mut out[..(joint + 1) * WIDTH], p, &terms);
                    terms.iter_mut().for_each(|(from, _)| *from += at);
                    combine(&mut out[at..], p, &terms);
                }
            }
            for other in 0..=joint {
                let dot = dot(&view.basis[other], &out[other * WIDTH..][..WIDTH]);
                along[(joint, other)] = dot;
                along[(other, joint)] = dot;
            }
            for common in 0..N_COMMON {
                along[(joint, MAX_JOINTS + common)] = out[at + common];
                along[(MAX_JOINTS + common, joint)] = out[at + common];
            }
        }
        let common = self.covariance.fixed_view::<N_COMMON, N_COMMON>(at, at);
        along.fixed_view_mut::<N_COMMON, N_COMMON>(MAX_JOINTS, MAX_JOINTS).copy_from(&common);
        let spread = Matrix6::identity() + view.twists * along * view.twists.transpose();
        Cholesky::new(spread)?.l().solve_lower_triangular(&view.twists)
    }

    /// Computes `L P E^T`, a column for each direction.
    fn reach_along(&self, view: &WhitenedView, reached: &mut DMatrix<f64>) {
        let n_rows = self.reach.nrows();
        let at = self.n_joints * WIDTH;
        let reach = self.reach.as_slice();
        for direction in self.directions() {
            let out = &mut reached.as_mut_slice()[direction * n_rows..][..n_rows];
            if direction >= MAX_JOINTS {
                let column = at + direction - MAX_JOINTS;
                out.copy_from_slice(&reach[column * n_rows..][..n_rows]);
                continue;
            }
            combine(out, reach, &weighted(&view.basis[direction], direction * WIDTH * n_rows, n_rows));
        }
    }

    #[cfg(test)]
    pub(crate) fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }
}

/// Returns the logarithm of the largest eigenvalue.
fn largest(matrix: &Linear) -> f64 {
    let values = SymmetricEigen::new(*matrix).eigenvalues;
    values.max().max(1e-24).ln()
}

/// Returns the start of each column of `n_rows` from `start` on, with its weight.
fn weighted(weights: &[f64; WIDTH], start: usize, n_rows: usize) -> [(usize, f64); WIDTH] {
    std::array::from_fn(|k| (start + k * n_rows, weights[k]))
}

/// Computes the sum of weighted columns, in the order of the terms: each has the start of its column in `columns`, and
/// its weight.
fn combine(out: &mut [f64], columns: &[f64], terms: &[(usize, f64)]) {
    let n_wide = combine_lanes::<8>(out, 0, columns, terms);
    let n_pairs = combine_lanes::<2>(out, n_wide, columns, terms);
    combine_lanes::<1>(out, n_pairs, columns, terms);
}

/// Computes the sum for all whole lanes from row `first` on, with sums in registers. Returns the first row left.
fn combine_lanes<const N: usize>(out: &mut [f64], first: usize, columns: &[f64], terms: &[(usize, f64)]) -> usize {
    let (lanes, _) = out[first..].as_chunks_mut::<N>();
    let mut row = first;
    for lane in lanes {
        let mut sum = [0.0; N];
        for &(start, weight) in terms {
            for (sum, from) in sum.iter_mut().zip(&columns[start + row..][..N]) {
                *sum += weight * from;
            }
        }
        *lane = sum;
        row += N;
    }
    row
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
