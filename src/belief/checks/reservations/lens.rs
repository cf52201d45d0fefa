//! Tool error from the priors of a lens that is kept as in robot.toml.
//!
//! One more linearization adds columns y of the lens in units of their priors. It gives their score s, their
//! information I (all estimated parameters x marginalised) and dx/dy. The views determine most of y: it has the
//! covariance `P = (1 + I)^-1` about the mean `m = P s`. An estimate that keeps the lens has the tool error `T y`,
//! `T = d tool/dx dx/dy`, so the tool's covariance gets `T (P + m m^T) T^T`.

use crate::checks::constants::reservations_lens::N;
use nalgebra::{Const, DMatrix, Dyn, Matrix3, OMatrix, SMatrix, SVector};

use crate::checks::reservations::HeldElement;
use crate::explain::score_test::ToolJacobian;
use crate::model::blocks::Block;
use crate::say::finding::FindingUnit;
use crate::solve::estimate::Estimate;
use crate::solve::linearize::NormalEquations;
use armcal_core::numeric::Loss;
use armcal_core::robot::{CameraSpec, LensPriors};

/// Lens that is not estimated, with its priors.
pub(crate) struct HeldLens {
    /// Name of the lens for messages.
    stem: String,
    priors: LensPriors,
    focal_px: f64,
    /// Information on the lens parameters, in units of their priors' standard deviations.
    information: SMatrix<f64, N, N>,
    /// Second moment of the lens parameters in the same units, `P + m m^T`.
    left: SMatrix<f64, N, N>,
    /// Response of the estimate to the lens parameters, dx/dy.
    response: OMatrix<f64, Dyn, Const<N>>,
}

impl Estimate<'_> {
    /// Lenses kept as in robot.toml, of the cameras with views.
    pub(crate) fn held_lenses(&self) -> Vec<HeldLens> {
        self.cameras().filter_map(|number| self.held_lens(number)).collect()
    }

    /// Returns the lens of camera `number`; `None` if it is estimated or unknown. With an unknown lens, no view holds
    /// corners.
    fn held_lens(&self, number: usize) -> Option<HeldLens> {
        let (mut problem, block) = (self.problem.clone(), Block::Lens(number));
        let camera = problem.robot.camera_at(number);
        if self.has(block) || !camera.lens.is_known() {
            return None;
        }
        problem.layout = self.problem.layout.with(block);
        problem.prior.forget(|other| other == block);
        let at = problem.layout.at(block)?;
        let mut normal = NormalEquations::new(&problem);
        normal.update(&problem, &self.solved.state, Loss::Square);
        let units = units(camera);
        // The normal equations fill only the lower triangle.
        let cross = DMatrix::from_fn(self.problem.layout.n, 8, |row, k| {
            if row < at { normal.matrix[(at + k, row)] } else { normal.matrix[(row + 8, at + k)] }
        });
        let own = SMatrix::<f64, 8, 8>::from_fn(|i, k| normal.matrix[(at + i.max(k), at + i.min(k))]);
        let response = -(&self.posterior.covariance * &cross) * units;
        let information = units.transpose() * own * units + units.transpose() * (cross.transpose() * &response);
        let score: SVector<f64, N> = units.transpose() * normal.right.fixed_rows::<8>(at)
            + response.tr_mul(&self.solved.normal.right).fixed_rows::<N>(0);
        let left = (information + SMatrix::identity()).try_inverse()?;
        let mean = left * score;
        let stem = if number == 0 { "camera lens".to_owned() } else { format!("lens of the camera {}", camera.name) };
        Some(HeldLens {
            stem,
            priors: camera.lens_priors,
            focal_px: camera.lens.focal_px()[0],
            left: left + mean * mean.transpose(),
            information,
            response,
        })
    }
}

/// Prior standard deviation of each lens parameter (columns), in the lens's columns (rows).
fn units(camera: &CameraSpec) -> SMatrix<f64, 8, N> {
    let LensPriors { focal_std, center_std_px, distortion_std } = camera.lens_priors;
    let mut units = SMatrix::zeros();
    for (axis, focal_px) in camera.lens.focal_px().iter().enumerate() {
        units[(axis, 0)] = focal_px * focal_std;
        units[(2 + axis, 1 + axis)] = center_std_px;
    }
    (4..8).for_each(|k| units[(k, k - 1)] = distortion_std);
    units
}

impl HeldLens {
    /// Covariance that the lens adds to the tool's, m^2.
    pub(crate) fn covariance_m2(&self, tool: &ToolJacobian) -> Matrix3<f64> {
        let by = SMatrix::<f64, 3, N>::from_columns(&self.shifts(tool));
        by * self.left * by.transpose()
    }

    /// Tool displacement by one prior standard deviation of each lens parameter, m.
    fn shifts(&self, tool: &ToolJacobian) -> [nalgebra::Vector3<f64>; N] {
        std::array::from_fn(|k| tool.moved_by(&self.response.column(k).into_owned()))
    }

    /// Elements of the lens, one per parameter.
    pub(super) fn elements(&self, tool: &[ToolJacobian]) -> impl Iterator<Item = HeldElement> {
        let LensPriors { focal_std, center_std_px, distortion_std } = self.priors;
        // Image centre as an angle at the optical centre.
        let center_rad = center_std_px / self.focal_px;
        let shifts: Vec<_> = tool.iter().map(|at| self.shifts(at)).collect();
        let rest = ["k1", "k2", "k3", "k4"].map(|k| (k, FindingUnit::One, distortion_std));
        let first = [
            ("focal length", FindingUnit::One, focal_std),
            ("centre along x", FindingUnit::Radian, center_rad),
            ("centre along y", FindingUnit::Radian, center_rad),
        ];
        first.into_iter().chain(rest).enumerate().map(move |(k, (what, unit, prior_std))| HeldElement {
            stem: format!("{}, {what}", self.stem),
            axis: "",
            unit,
            prior_std,
            share_left: 1.0 / (1.0 + self.information[(k, k)]),
            touched_std: f64::INFINITY,
            shifts: shifts.iter().map(|of_tool| of_tool[k]).collect(),
            is_counted: true,
            unstated: None,
        })
    }
}
