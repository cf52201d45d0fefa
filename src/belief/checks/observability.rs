//! Observability of the parameters from the data, before the solve.
//!
//! The normal equations are those at the robust start, without the priors of joints, mount, gripper tag and clock. The
//! tags' poses (about their survey), the sensors' nonlinearity (a process of its prior's size) and the views' own
//! parameters are marginalised. In units of the priors' standard deviations, an eigenvalue below 1 is a direction that
//! the prior dominates; the others count for the indices.
//!
//! Indices of observability, of the singular values s_1 >= .. >= s_L of the scaled, whitened Jacobian (roots of those
//! eigenvalues) and m views: O1 = (prod s)^(1/L) / sqrt(m) (Borm and Menq 1991), O2 = s_L / s_1 (Driels and Pathre
//! 1990), O3 = s_L and O4 = s_L^2 / s_1 (Nahvi, Hollerbach and Hayward 1994; Nahvi and Hollerbach 1996), O5 = 1 / sum(1
//! / s) (Sun and Hollerbach 2008).

use crate::checks::constants::observability::{DETERMINED, NAMED, UNKNOWN, WALL};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use crate::model::blocks::Block;
use crate::model::layout::Layout;
use crate::model::parameters::{Parameter, ParameterKind};
use crate::model::prior::{Prior, at_least};
use crate::solve::input::BundleInput;
use crate::solve::linearize::NormalEquations;
use crate::solve::problem::BundleProblem;
use crate::solve::robust_start::robust_start;
use armcal_core::numeric::Loss;
use armcal_core::robot::Robot;

/// Observability of the parameters before the solve.
#[derive(Clone, Debug)]
pub struct Observability {
    /// Number of directions, among `n_parameters`, on which the data have more information than the prior.
    pub rank: usize,
    /// Number of tested parameters: joints without nonlinearity, mount, gripper tag, clock and lens, where estimated.
    pub n_parameters: usize,
    /// Ratio of the largest to the smallest singular value, among those directions; the indices use the same ones.
    pub condition_number: f64,
    /// Indices O1 to O5, see the module; all 0 if the rank is 0.
    pub o: [f64; 5],
    /// Directions that the prior dominates, in words.
    pub null_space: Vec<NullDirection>,
}

/// Direction on which the data have less information than the prior.
#[derive(Clone, Debug)]
pub struct NullDirection {
    pub words: String,
    /// Gains and offsets that are named; absent where a block such as the mount takes part.
    pub parameters: Option<Vec<Parameter>>,
    /// True if only the sensors' terms take part: temperature, pressure, drift, backlash.
    pub is_of_terms: bool,
}

impl NullDirection {
    /// Returns true if the estimate knows each parameter of this direction much better than its prior does. `shares`:
    /// the standard deviation of each parameter over its prior's.
    pub(crate) fn is_determined(&self, shares: &[(Parameter, f64)]) -> bool {
        let is_known = |p: &Parameter| shares.iter().any(|(of, share)| of == p && *share < DETERMINED);
        self.parameters.as_ref().is_some_and(|parameters| parameters.iter().all(is_known))
    }
}

/// Column as it is named in texts.
struct Name {
    text: String,
    parameter: Option<Parameter>,
    /// Prior standard deviation, in the parameter's unit.
    sigma: f64,
    is_term: bool,
    /// True for an offset or a rotation, rad.
    is_angle: bool,
}

/// Computes the observability at the robust start of `input`; `None` if nothing has a column.
#[must_use]
pub fn observability(input: &BundleInput<'_>) -> Option<Observability> {
    let start = robust_start(input);
    let (mut prior, layout) = (input.prior(), input.layout());
    let kept = |column: usize| {
        layout.parameters.get(column).map_or_else(
            || !layout.block_of(column).is_some_and(|(block, _)| matches!(block, Block::Tag(_))),
            |p| !matches!(p.kind, ParameterKind::Shape(_)) && !p.is_past() && !p.kind.is_of_body(),
        )
    };
    let wanted: Vec<usize> = (0..layout.n).filter(|&column| kept(column)).collect();
    if wanted.is_empty() {
        return None;
    }
    let sigma = sigmas(&layout, input, &prior);
    // The prior of a warm start also covers the mount.
    let with_mount = layout.n_joint()..prior.n_covered();
    for column in (0..layout.n_joint()).filter(|&column| kept(column)).chain(with_mount) {
        prior.information.matrix.row_mut(column).fill(0.0);
        prior.information.matrix.column_mut(column).fill(0.0);
    }
    prior.forget(|block| !matches!(block, Block::Tag(_)));
    let problem = BundleProblem::new(input, prior);
    let mut normal = NormalEquations::new(&problem);
    let mut state = problem.start(&start.parameters);
    problem.set_steps(&mut state, &start.steps);
    normal.update(&problem, &state, Loss::Square);
    let information = information(&problem, &normal, &wanted, &sigma)?;
    let is_term = |column: usize| {
        let kind = layout.parameters.get(column).map(|p| p.kind);
        kind.is_some_and(|kind| !matches!(kind, ParameterKind::Gain | ParameterKind::Offset))
    };
    let is_angle = |column: usize| match layout.parameters.get(column) {
        Some(p) => p.kind == ParameterKind::Offset,
        None => layout.block_of(column).is_some_and(|(block, k)| block.is_pose() && k >= 3),
    };
    let named = |&column: &usize| Name {
        text: name(input.robot, &layout, column),
        parameter: layout.parameters.get(column).copied(),
        sigma: sigma[column],
        is_term: is_term(column),
        is_angle: is_angle(column),
    };
    let names: Vec<Name> = wanted.iter().map(named).collect();
    (!names.is_empty()).then(|| summarized(information, &names, input.views.len()))
}

/// Prior standard deviation of each column.
fn sigmas(layout: &Layout, input: &BundleInput<'_>, prior: &Prior) -> Vec<f64> {
    let mut sigma = vec![1.0; layout.n];
    for (column, p) in layout.parameters.iter().enumerate() {
        sigma[column] = input.scales.prior_std(&input.robot.sensors[p.joint], p.joint, p.kind);
    }
    for (block, at) in layout.blocks().filter(|(block, _)| !matches!(block, Block::Tag(_))) {
        let n = block.n_columns();
        sigma[at..at + n].copy_from_slice(&prior.std[block][..n]);
    }
    for std in &mut sigma {
        *std = if std.is_finite() { at_least(*std) } else { UNKNOWN };
    }
    sigma
}

/// Information on the wanted columns in units of `sigma`, with the others marginalised.
fn information(
    problem: &BundleProblem<'_>,
    normal: &NormalEquations,
    wanted: &[usize],
    sigma: &[f64],
) -> Option<DMatrix<f64>> {
    let n = problem.layout.n;
    let at = |i: usize, k: usize| normal.matrix[(i.max(k), i.min(k))] * sigma[i] * sigma[k];
    let others: Vec<usize> = (0..n).filter(|column| !wanted.contains(column)).collect();
    let mut block = DMatrix::from_fn(wanted.len(), wanted.len(), |i, k| at(wanted[i], wanted[k]));
    if !others.is_empty() {
        let wall = |i: usize, k: usize| if i == k { WALL } else { 0.0 };
        let rest = DMatrix::from_fn(others.len(), others.len(), |i, k| at(others[i], others[k]) + wall(i, k));
        let cross = DMatrix::from_fn(others.len(), wanted.len(), |i, k| at(others[i], wanted[k]));
        block -= cross.tr_mul(&Cholesky::new(rest)?.solve(&cross));
    }
    Some(block)
}

fn summarized(information: DMatrix<f64>, names: &[Name], n_views: usize) -> Observability {
    let n = names.len();
    let eigen = SymmetricEigen::new(information);
    let (null, told): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| eigen.eigenvalues[k] < 1.0);
    let singular: Vec<f64> = told.iter().map(|&k| eigen.eigenvalues[k].sqrt()).collect();
    let (most, least) = singular.iter().fold((0.0_f64, f64::INFINITY), |(high, low), s| (high.max(*s), low.min(*s)));
    let product = (singular.iter().map(|s| s.ln()).sum::<f64>() / told.len().max(1) as f64).exp();
    let o5 = 1.0 / singular.iter().map(|s| 1.0 / s).sum::<f64>();
    let mut space = DMatrix::from_fn(n, null.len(), |row, k| eigen.eigenvectors[(row, null[k])]);
    let o = [product / (n_views.max(1) as f64).sqrt(), least / most, least, least * least / most, o5];
    Observability {
        rank: told.len(),
        n_parameters: n,
        condition_number: most / least,
        o: if told.is_empty() { [0.0; 5] } else { o },
        null_space: in_words(&mut space, names),
    }
}

/// Directions that span the column space of `space`. Elimination with the largest pivots leaves few parameters in each.
fn in_words(space: &mut DMatrix<f64>, names: &[Name]) -> Vec<NullDirection> {
    let n = space.ncols();
    for k in 0..n {
        let (row, column) = largest_entry(space, k);
        space.swap_columns(k, column);
        let pivot = space[(row, k)];
        space.column_mut(k).unscale_mut(pivot);
        for other in (0..n).filter(|&other| other != k) {
            let factor = space[(row, other)];
            let by = space.column(k) * factor;
            let mut column = space.column_mut(other);
            column -= by;
        }
    }
    let mut all: Vec<NullDirection> =
        space.column_iter().map(|direction| spoken(&direction.into_owned(), names)).collect();
    all.sort_by(|a, b| a.words.cmp(&b.words));
    all
}

/// Describes a direction by its entries that are large in units of their priors. If the largest entry is an angle,
/// angles that are large in rad count, too. A rotation of a well-known mount and an uncertain offset move the camera
/// alike.
fn spoken(direction: &DVector<f64>, names: &[Name]) -> NullDirection {
    let own = DVector::from_fn(names.len(), |k, _| direction[k] * names[k].sigma);
    let first = direction.iamax();
    let goes_along = |k: usize| {
        let is_alike = names[first].is_angle && names[k].is_angle && own[k].abs() > NAMED * own[first].abs();
        direction[k].abs() > NAMED * direction[first].abs() || is_alike
    };
    let named: Vec<usize> = (0..names.len()).filter(|&k| goes_along(k)).collect();
    let list: Vec<&str> = named.iter().map(|&k| names[k].text.as_str()).collect();
    let words = match named.as_slice() {
        [one] => format!("{}: not determined", names[*one].text),
        [a, b] => {
            let how = if own[*a] * own[*b] < 0.0 { "sum" } else { "difference" };
            format!("{}: only their {how}", list.join(" and "))
        }
        _ => format!("{}: not each by itself", list.join(", ")),
    };
    let parameters = named.iter().map(|&k| names[k].parameter).collect();
    NullDirection { words, parameters, is_of_terms: named.iter().all(|&k| names[k].is_term) }
}

/// Row and column of the largest entry from column `from` on.
fn largest_entry(space: &DMatrix<f64>, from: usize) -> (usize, usize) {
    let mut best = (0, from);
    for column in from..space.ncols() {
        for row in 0..space.nrows() {
            if space[(row, column)].abs() > space[best].abs() {
                best = (row, column);
            }
        }
    }
    best
}

fn name(robot: &Robot, layout: &Layout, column: usize) -> String {
    if let Some(parameter) = layout.parameters.get(column) {
        return parameter.name(robot);
    }
    layout.block_of(column).map_or_else(String::new, |(block, k)| block.name(robot, k))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_estimate_knows_well_is_determined() {
        let gain = |joint: usize| Parameter { joint, kind: ParameterKind::Gain };
        let shares = [(gain(0), 0.19), (gain(1), 0.13), (gain(2), 0.98)];
        let of = |parameters: Option<Vec<Parameter>>| {
            NullDirection { words: String::new(), parameters, is_of_terms: false }.is_determined(&shares)
        };
        assert!(of(Some(vec![gain(0)])) && of(Some(vec![gain(0), gain(1)])));
        assert!(!of(Some(vec![gain(2)])) && !of(Some(vec![gain(0), gain(2)])) && !of(Some(vec![gain(3)])));
        assert!(!of(None), "a mount takes part");
    }
}
