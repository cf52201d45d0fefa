//! Is the drawing right? Other explanations of the same views, compared by their evidence.
//!
//! Where the score test says that links, base or mount would explain the data better than joint sensors do, the views
//! are estimated again under each alternative: link geometry with columns of its own, and a lens with columns. The one
//! of most evidence stays if it brings [`MIN_GAIN_NATS`] or more. A tag that was moved is freed before that
//! (module `freed_tags`).
//!
//! The score test says beforehand what links may bring: with the pull s and the information I of trial columns z under
//! a prior of variance a^2, Laplace's approximation is `ln Z(a) - ln Z(0) = s^T (I + a^-2)^-1 s / 2 - ln det(1 + a^2 I)
//! / 2`. The element and size of the largest gain are where the sizes of the links' errors start from.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::calib::bundle::estimate::{Estimate, estimate};
use crate::calib::bundle::evidence::SCALE_BOUNDS;
use crate::calib::bundle::input::BundleInput;
use crate::calib::bundle::model_selection::log_evidence;
use crate::calib::bundle::score_test::GeometryElement;
use armcal_core::joints::MAX_JOINTS;

/// What of the drawing is estimated beside the joint sensors.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Drawing {
    pub links: Option<LinkStart>,
    pub has_lens: bool,
}

/// Where the sizes of the links' errors start from, and how many joints have columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinkStart {
    n_links: usize,
    /// Over robot.toml's: shift, turn.
    multiples: [[f64; 2]; MAX_JOINTS],
    mount_scale: [f64; 2],
}

/// What an alternative must bring; good arms seldom reach a tenth of it (measured, docs/verdict.md).
const MIN_GAIN_NATS: f64 = 8.0;
/// Sizes of an error that are tried, over robot.toml's.
const MULTIPLES: [f64; 5] = [2.0, 5.0, 10.0, 20.0, 40.0];

impl Drawing {
    /// Gives `input` the columns of this drawing.
    pub(crate) fn apply(&self, input: &mut BundleInput<'_>) {
        input.model.lens |= self.has_lens;
        let Some(start) = &self.links else { return };
        input.model.n_links = input.model.n_links.max(start.n_links);
        let (link_std, multiples) = (&mut input.scales.link_std, &start.multiples);
        for (std, by) in link_std.iter_mut().flatten().zip(multiples.iter().flatten()) {
            *std *= by;
        }
        input.scales.mount_scale = start.mount_scale;
    }

    /// The drawing of most evidence, if another than this explains the views much better; `input` has this one's
    /// columns, `found` is its estimate.
    pub(crate) fn better(&self, input: &BundleInput<'_>, found: &Estimate<'_>) -> Option<Self> {
        if input.joint_prior.is_some() {
            // A warm start knows the links from before, and its own test of agreement.
            return None;
        }
        let links = found.link_start().filter(|_| self.links.is_none())?;
        let mut alternatives = vec![Self { links: Some(links), ..self.clone() }];
        if !self.has_lens && !found.has_positions() {
            alternatives.push(Self { has_lens: true, ..self.clone() });
        }
        let least = log_evidence(found) + MIN_GAIN_NATS;
        let evidence = |drawing: &Self| {
            let mut input = input.clone();
            drawing.apply(&mut input);
            estimate(&input).map_or(f64::NEG_INFINITY, |found| log_evidence(&found))
        };
        let all = alternatives.into_iter().map(|drawing| (evidence(&drawing), drawing));
        let (best, drawing) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (best > least).then_some(drawing)
    }
}

impl Estimate<'_> {
    /// Where to start links from; `None` where no error of the drawing would explain much.
    fn link_start(&self) -> Option<LinkStart> {
        let robot = self.problem.robot;
        let score = self.score();
        let n_links = self.n_seen_joints();
        let priors = [robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad];
        let mount = [robot.camera.mount_std_m, robot.camera.mount_std_rad];
        let of_joints = (0..n_links).flat_map(|joint| [0, 1].map(|kind| (GeometryElement::Joint(joint), kind)));
        let of_mount = self.problem.layout.mount.iter().flat_map(|_| [0, 1].map(|kind| (GeometryElement::Mount, kind)));
        let mut best = (0.0, None, 1.0);
        let mut consider = |columns: &[(usize, f64)], element| {
            for multiple in MULTIPLES {
                let gain = gain_nats(&score.score, &score.information, columns, multiple);
                if gain > best.0 {
                    best = (gain, element, multiple);
                }
            }
        };
        let three = |first: usize, std: f64| (first..first + 3).map(move |column| (column, std));
        for (element, kind) in of_joints.chain(of_mount) {
            let (first, std) = match element {
                GeometryElement::Joint(joint) => (6 * joint + 3 * kind, priors[kind]),
                GeometryElement::Mount => (6 * MAX_JOINTS + 3 * kind, mount[kind]),
            };
            consider(&three(first, std).collect::<Vec<_>>(), Some((element, kind)));
        }
        let all = (0..n_links).flat_map(|joint| [0, 1].map(|kind| three(6 * joint + 3 * kind, priors[kind]))).flatten();
        consider(&all.collect::<Vec<_>>(), None);
        let (gain, element, multiple) = best;
        if gain < MIN_GAIN_NATS {
            return None;
        }
        let mut start = LinkStart { n_links, multiples: [[1.0; 2]; MAX_JOINTS], mount_scale: [1.0; 2] };
        match element {
            Some((GeometryElement::Joint(joint), kind)) => start.multiples[joint][kind] = multiple,
            Some((GeometryElement::Mount, kind)) => start.mount_scale[kind] = multiple,
            None => start.multiples = [[multiple; 2]; MAX_JOINTS],
        }
        Some(start)
    }
}

/// What trial columns would bring under priors of `multiple` times their (column, std).
fn gain_nats(score: &DVector<f64>, information: &DMatrix<f64>, columns: &[(usize, f64)], multiple: f64) -> f64 {
    let n = columns.len();
    let unit = |k: usize| columns[k].1 * multiple;
    let scaled = DMatrix::from_fn(n, n, |i, k| {
        let prior = if i == k { 1.0 } else { 0.0 };
        prior + information[(columns[i].0, columns[k].0)] * unit(i) * unit(k)
    });
    let pull = DVector::from_fn(n, |k, _| score[columns[k].0] * unit(k));
    let Some(factor) = Cholesky::new(scaled) else { return 0.0 };
    let half_log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    0.5 * pull.dot(&factor.solve(&pull)) - half_log_det
}

/// Largest multiple of robot.toml's sigmas that the evidence may fit.
const _: () = assert!(MULTIPLES[4] <= SCALE_BOUNDS[1]);
