//! Corners of a tag with covariance: the tag's pattern, blurred and seen through the lens, fitted to the grey levels.
//!
//! Model: `I = a.(1, s, t) + P(s, t; blur) g.(1, s, t)`. Black level a and contrast g have a linear gradient each. P is
//! the tag's cells convolved with a Gaussian of any shape (defocus, motion, pixel area). The 17 parameters are eight
//! corner coordinates, three of the blur and six of the light. The corners give a homography of the bearings, which
//! includes the lens distortion. Solver: Levenberg-Marquardt; the second pass has Huber weights against snow and
//! occlusion. The corners' covariance is the inverse normal matrix times the residual variance.

use armcal_core::numeric::{Damping, LeastSquares, Loss, Outcome, Proposal, StopRule, minimize};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use crate::bearings::{BearingTable, RectifiedView};
use crate::homography::Homography;
use crate::image::GreyImage;
use crate::normal::NormalTable;
use crate::pattern::Cells;
use crate::samples::{Sample, TagRegion};

const N: usize = 17;
type NormalMatrix = SMatrix<f64, N, N>;
type Parameters = SVector<f64, N>;

/// Indices of the first parameters of blur, black level and contrast.
const BLUR: usize = 8;
const BLACK: usize = 11;
const GAIN: usize = 14;

const COARSE_SAMPLES: usize = 500;
const FINE_SAMPLES: usize = 2500;
const COARSE_ITERATIONS: usize = 12;
const FINE_ITERATIONS: usize = 6;
/// Largest corner step of a converged fit.
const DONE_PX: f64 = 2e-3;
/// Variance of a pixel's area (a box of side 1).
const PIXEL_VARIANCE_PX2: f64 = 1.0 / 12.0;
/// Prior of the blur's variance: mean and std, px2.
const BLUR_PX2: [f64; 2] = [0.5, 2.0];
/// Prior std of the light's gradients over half a tag, as a share of the contrast.
const SLOPE_STD: f64 = 0.3;
/// Huber threshold in standard deviations.
const HUBER: f64 = 2.5;
/// Smallest residual std, grey levels: rounding.
const MIN_RESIDUAL_STD: f64 = 0.3;

/// Result of a fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub corners_px: [[f64; 2]; 4],
    /// Covariance of each corner from residuals and normal matrix, px2.
    pub covariances_px2: [Matrix2<f64>; 4],
    /// Difference of the blur's variances along and across its longest direction.
    pub motion_px2: f64,
    /// White minus black, grey levels.
    pub contrast: f64,
    /// Standard deviation of the residuals, grey levels.
    pub residual_std: f64,
    /// Share of the pixels' variance that the pattern explains.
    pub explained: f64,
}

/// Buffers and tables, reused.
#[derive(Debug)]
pub(super) struct Fitter {
    normal: NormalTable,
    samples: Vec<Sample>,
    magnitudes: Vec<f64>,
}

struct Linearized {
    cost: f64,
    /// Sum of the pixels' weights; `squares` is the sum of their weighted squared residuals.
    weight: f64,
    squares: f64,
    matrix: NormalMatrix,
    gradient: Parameters,
}

/// Rectified view and pattern of one tag.
struct Scene<'a> {
    view: RectifiedView<'a>,
    cells: &'a Cells,
}

/// One pass of the fit.
#[derive(Clone, Copy)]
struct Stage {
    n_samples: usize,
    loss: Loss,
    n_iterations: usize,
}

const DAMPING: Damping = Damping { first: 1e-3, min: 1e-9, max: 1e4, down: 0.1, up: 10.0, min_after_rejection: 0.0 };

struct Search<'a, 'b> {
    fitter: &'a Fitter,
    scene: &'a Scene<'b>,
    stage: Stage,
    x: Parameters,
    model: Linearized,
    trial: Parameters,
    trial_model: Option<Linearized>,
}

impl LeastSquares for Search<'_, '_> {
    fn cost(&self) -> f64 {
        self.model.cost
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        let mut damped = self.model.matrix;
        for k in 0..N {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&self.model.gradient);
        self.trial = self.x + step;
        constrain_blur(&mut self.trial);
        // Largest corner step, px.
        Some(Proposal { length: step.fixed_rows::<8>(0).amax(), predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.trial_model = self.fitter.linearize(self.scene, &self.trial, self.stage.n_samples, self.stage.loss);
        self.trial_model.as_ref().map(|trial_model| trial_model.cost)
    }

    fn accept(&mut self) {
        if let Some(trial_model) = self.trial_model.take() {
            (self.x, self.model) = (self.trial, trial_model);
        }
    }
}

impl Fitter {
    pub(super) fn new() -> Self {
        Self { normal: NormalTable::new(), samples: Vec::new(), magnitudes: Vec::new() }
    }

    /// Fit from initial corners `start_px`, which may err by some pixels. `None` without bearings or without
    /// convergence.
    pub(super) fn fit(
        &mut self,
        image: &GreyImage,
        table: &BearingTable,
        cells: &Cells,
        start_px: &[[f64; 2]; 4],
    ) -> Option<Fit> {
        let scene = Scene { view: RectifiedView::new(table, start_px)?, cells };
        let (homography, _) = scene.homography(start_px)?;
        let region = TagRegion { image, view: &scene.view, homography: &homography, cells, corners_px: start_px };
        region.sample(FINE_SAMPLES, &mut self.samples);
        let n_coarse = self.samples.len().min(COARSE_SAMPLES);
        if n_coarse < 4 * N {
            return None;
        }
        let mut x = self.start(&scene, start_px, n_coarse)?;
        let coarse = Stage { n_samples: n_coarse, loss: Loss::Square, n_iterations: COARSE_ITERATIONS };
        self.iterate(&scene, &mut x, coarse)?;
        let scale = self.residual_std(&scene, &x, n_coarse)?;
        let loss = Loss::Huber { k: HUBER * scale };
        let fine = Stage { n_samples: self.samples.len(), loss, n_iterations: FINE_ITERATIONS };
        let end = self.iterate(&scene, &mut x, fine)?;
        self.finish(&x, &end)
    }

    fn start(&self, scene: &Scene, start_px: &[[f64; 2]; 4], n: usize) -> Option<Parameters> {
        let mut x = Parameters::zeros();
        for (k, corner) in start_px.iter().enumerate() {
            x[2 * k] = corner[0];
            x[2 * k + 1] = corner[1];
        }
        x[BLUR] = BLUR_PX2[0];
        x[BLUR + 2] = BLUR_PX2[0];
        // Black and white by linear regression on the pattern at the initial corners.
        let (homography, _) = scene.homography(start_px)?;
        let (mut sp, mut spp, mut sy, mut spy) = (0.0, 0.0, 0.0, 0.0);
        let half = scene.cells.half();
        for sample in &self.samples[..n] {
            let point = homography.map(&sample.plane);
            let at = [(point.s + 1.0) * half, (point.t + 1.0) * half];
            let p = scene.cells.blurred(&self.normal, at, [0.1, 0.0, 0.1]).p;
            sp += p;
            spp += p * p;
            sy += sample.value;
            spy += p * sample.value;
        }
        let n = n as f64;
        let spread = spp - sp * sp / n;
        let gain = (spy - sp * sy / n) / spread;
        if gain.is_nan() || gain <= 0.0 {
            return None;
        }
        x[GAIN] = gain;
        x[BLACK] = (sy - gain * sp) / n;
        Some(x)
    }

    fn iterate(&self, scene: &Scene, x: &mut Parameters, stage: Stage) -> Option<Linearized> {
        let model = self.linearize(scene, x, stage.n_samples, stage.loss)?;
        let mut search = Search { fitter: self, scene, stage, x: *x, model, trial: *x, trial_model: None };
        let stop = StopRule { step_length: DONE_PX, ..StopRule::after(stage.n_iterations) };
        if minimize(&mut search, &DAMPING, &stop).outcome() == Outcome::Degenerate {
            return None;
        }
        *x = search.x;
        Some(search.model)
    }

    /// Cost under a loss in grey levels, and its quadratic model; priors in units of the residual variance.
    fn linearize(&self, scene: &Scene, x: &Parameters, n: usize, loss: Loss) -> Option<Linearized> {
        let corners = corners_of(x);
        let (homography, plane_jacobians) = scene.homography(&corners)?;
        let mut out = Linearized {
            cost: 0.0,
            weight: 0.0,
            squares: 0.0,
            matrix: NormalMatrix::zeros(),
            gradient: Parameters::zeros(),
        };
        let mut sums = [[0.0; N]; N];
        for sample in &self.samples[..n] {
            let (value, row) = self.predict(scene, &homography, x, sample);
            // A saturated pixel has no residual where the model saturates, too.
            let residual = sample.value - value.clamp(0.0, 255.0);
            if !(0.0..=255.0).contains(&value) && residual == 0.0 {
                continue;
            }
            let (cost, weight) = loss.of(residual * residual);
            out.cost += cost;
            out.weight += weight;
            out.squares += weight * residual * residual;
            for i in 0..N {
                let wi = weight * row[i];
                for j in i..N {
                    sums[i][j] += wi * row[j];
                }
                out.gradient[i] += wi * residual;
            }
        }
        let mut corner_jacobian = NormalMatrix::identity();
        corner_jacobian.fixed_view_mut::<8, 8>(0, 0).copy_from(&homography.corner_jacobian(&plane_jacobians));
        let raw = NormalMatrix::from_fn(|i, j| sums[i.min(j)][i.max(j)]);
        out.matrix = corner_jacobian.transpose() * raw * corner_jacobian;
        out.gradient = corner_jacobian.transpose() * out.gradient;
        let variance = (out.squares / out.weight.max(1.0)).max(MIN_RESIDUAL_STD * MIN_RESIDUAL_STD);
        add_priors(&mut out, x, variance);
        out.cost.is_finite().then_some(out)
    }

    /// Grey level at a sample and its derivatives by g (homography), blur and light.
    #[inline]
    fn predict(&self, scene: &Scene, homography: &Homography, x: &Parameters, sample: &Sample) -> (f64, [f64; N]) {
        let point = homography.map(&sample.plane);
        let (s, t) = (point.s, point.t);
        let half = scene.cells.half();
        let m = homography.jacobian(&point) * sample.jacobian * half;
        let [xx, xy, yy] = [x[BLUR] + PIXEL_VARIANCE_PX2, x[BLUR + 1], x[BLUR + 2] + PIXEL_VARIANCE_PX2];
        let by_blur = |a: usize, b: usize| {
            let (ax, ay, bx, by) = (m[(a, 0)], m[(a, 1)], m[(b, 0)], m[(b, 1)]);
            [ax * bx, ax * by + ay * bx, ay * by]
        };
        let (uu, uv, vv) = (by_blur(0, 0), by_blur(0, 1), by_blur(1, 1));
        let dot = |w: [f64; 3]| w[0] * xx + w[1] * xy + w[2] * yy;
        let covariance = [dot(uu), dot(uv), dot(vv)];
        let b = scene.cells.blurred(&self.normal, [(s + 1.0) * half, (t + 1.0) * half], covariance);
        let black = x[BLACK] + x[BLACK + 1] * s + x[BLACK + 2] * t;
        let gain = x[GAIN] + x[GAIN + 1] * s + x[GAIN + 2] * t;
        let d_s = x[BLACK + 1] + x[GAIN + 1] * b.p + gain * half * b.u;
        let d_t = x[BLACK + 2] + x[GAIN + 2] * b.p + gain * half * b.v;
        let (px, py) = (sample.plane.x * point.scale, sample.plane.y * point.scale);
        let radial = d_s * s + d_t * t;
        let heat = |k: usize| gain * (0.5 * b.uu * uu[k] + b.uv * uv[k] + 0.5 * b.vv * vv[k]);
        let row = [
            d_s * px,
            d_s * py,
            d_s * point.scale,
            d_t * px,
            d_t * py,
            d_t * point.scale,
            -radial * px,
            -radial * py,
            heat(0),
            heat(1),
            heat(2),
            1.0,
            s,
            t,
            b.p,
            b.p * s,
            b.p * t,
        ];
        (black + gain * b.p, row)
    }

    /// Robust residual std: 1.4826 times the median absolute residual.
    fn residual_std(&mut self, scene: &Scene, x: &Parameters, n: usize) -> Option<f64> {
        let (homography, _) = scene.homography(&corners_of(x))?;
        let mut magnitudes = std::mem::take(&mut self.magnitudes);
        magnitudes.clear();
        let magnitude = |sample: &Sample| (sample.value - self.predict(scene, &homography, x, sample).0).abs();
        magnitudes.extend(self.samples[..n].iter().map(magnitude));
        let middle = magnitudes.len() / 2;
        let (_, median, _) = magnitudes.select_nth_unstable_by(middle, f64::total_cmp);
        let std = (1.4826 * *median).max(MIN_RESIDUAL_STD);
        self.magnitudes = magnitudes;
        Some(std)
    }

    fn finish(&self, x: &Parameters, end: &Linearized) -> Option<Fit> {
        let n = self.samples.len() as f64;
        let variance = (end.squares / (end.weight - N as f64).max(1.0)).max(MIN_RESIDUAL_STD * MIN_RESIDUAL_STD);
        let inverse = end.matrix.cholesky()?.inverse();
        let covariances_px2 = std::array::from_fn(|k| inverse.fixed_view::<2, 2>(2 * k, 2 * k) * variance);
        let mean = self.samples.iter().map(|sample| sample.value).sum::<f64>() / n;
        let total = self.samples.iter().map(|sample| (sample.value - mean).powi(2)).sum::<f64>() / n;
        Some(Fit {
            corners_px: corners_of(x),
            covariances_px2,
            motion_px2: 2.0 * (0.5 * (x[BLUR] - x[BLUR + 2])).hypot(x[BLUR + 1]),
            contrast: x[GAIN],
            residual_std: variance.sqrt(),
            explained: 1.0 - end.squares / end.weight / total.max(1e-9),
        })
    }
}

impl Scene<'_> {
    /// Homography of these corners, and d(plane)/d(pixel) at each.
    fn homography(&self, corners_px: &[[f64; 2]; 4]) -> Option<(Homography, [Matrix2<f64>; 4])> {
        let mut planes = [Vector2::zeros(); 4];
        let mut jacobians = [Matrix2::zeros(); 4];
        for k in 0..4 {
            (planes[k], jacobians[k]) = self.view.plane_with_jacobian(corners_px[k])?;
        }
        Some((Homography::new(&planes)?, jacobians))
    }
}

fn corners_of(x: &Parameters) -> [[f64; 2]; 4] {
    std::array::from_fn(|k| [x[2 * k], x[2 * k + 1]])
}

/// Keeps the blur's covariance positive definite.
fn constrain_blur(x: &mut Parameters) {
    for k in [BLUR, BLUR + 2] {
        x[k] = x[k].clamp(0.0, 100.0);
    }
    let limit = 0.95 * ((x[BLUR] + PIXEL_VARIANCE_PX2) * (x[BLUR + 2] + PIXEL_VARIANCE_PX2)).sqrt();
    x[BLUR + 1] = x[BLUR + 1].clamp(-limit, limit);
}

/// Weak priors on blur and gradients: they regularize a tag of few pixels.
fn add_priors(out: &mut Linearized, x: &Parameters, variance: f64) {
    let slope_std = SLOPE_STD * x[GAIN].abs().max(1.0);
    let priors = [
        (BLUR, BLUR_PX2[0], BLUR_PX2[1]),
        (BLUR + 1, 0.0, BLUR_PX2[1]),
        (BLUR + 2, BLUR_PX2[0], BLUR_PX2[1]),
        (BLACK + 1, 0.0, slope_std),
        (BLACK + 2, 0.0, slope_std),
        (GAIN + 1, 0.0, slope_std),
        (GAIN + 2, 0.0, slope_std),
    ];
    for (k, mean, std) in priors {
        let weight = variance / (std * std);
        out.cost += weight * (x[k] - mean).powi(2);
        out.matrix[(k, k)] += weight;
        out.gradient[k] += weight * (mean - x[k]);
    }
}
