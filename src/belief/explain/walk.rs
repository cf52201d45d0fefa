//! Offsets with a random walk during the capture: detection, and estimates as of the last view.
//!
//! Columns for the modes of a walk (`walk_modes`) cost time, so two figures of the estimate without them decide first.
//! One is the excess of the offsets' change with temperature over the stated one, because it absorbs a walk in one
//! direction. The other is a score test of the walk's variance (Lin 1997). `z` and `I` are those of the joint's errors,
//! all else marginalised (`step_test`); l are the modes' variances. If nothing walks
//!
//! ```text
//! T = sum_k l_k (phi_k^T z)^2,   A = phi^T I phi,   mean sum_k l_k A_kk,   variance 2 sum_kl l_k l_l A_kl^2
//! ```
//!
//! Then the evidence and a permutation test decide: there is no walk if the views in another order have as much of it
//! (`permutation_test`). No view constrains the offsets afterwards, so a walk as long as that during the views is added
//! to each joint's error.

pub(crate) use crate::explain::constants::walk::WARMTH_WORTH_A_FIT;
use crate::explain::constants::walk::{FEW_VIEWS, MAX_WALK_P, MIN_VIEWS, MIN_WALK_NATS, SCORE_WORTH_A_FIT};
use crate::explain::model_selection::{OptionalTerm, Selection, evidence_gain_nats};
use crate::model::estimated::Walk;
use crate::model::parameters::ParameterKind;
use crate::model::walk_modes::{N_WALK_MODES, mode, mode_std};
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::time::Stamp;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Ends of the first and the last of `views`; `None` for views that all end together.
pub(crate) fn span(views: &[View]) -> Option<[Stamp; 2]> {
    let ends = || views.iter().map(|view| view.end);
    let (first, last) = (ends().min()?, ends().max()?);
    (last > first).then_some([first, last])
}

impl<'a> Estimate<'a> {
    /// Returns the estimate with walks of the offsets if the views need them, else `self`; and the result of a trial.
    /// `input`: that of this estimate, except for the terms that were chosen.
    pub(crate) fn with_walks(
        self,
        input: &BundleInput<'a>,
        has_sensor: impl Fn(usize) -> bool,
    ) -> (Self, Option<Selection>) {
        if input.joint_prior.is_some() || input.views.len() < MIN_VIEWS {
            return (self, None);
        }
        let Some(span) = span(input.views) else { return (self, None) };
        let warmth = self.scales().offset_std_rad_per_k / input.scales.offset_std_rad_per_k;
        let is_quick = input.views.len() < FEW_VIEWS;
        if !is_quick && warmth < WARMTH_WORTH_A_FIT && !self.walks_seem_likely(input.views, span) {
            return (self, None);
        }
        let mut wider = self.with_found_terms(input);
        let p_value = self.walk_p_values(input.views, span);
        wider.model.walk = Some(Walk { span, p_value, gain_nats: 0.0 });
        wider.scales.walk_std_rad = self.first_walk_std_rad(input.views);
        for (joint, kinds) in wider.model.joints.iter_mut().enumerate() {
            if !kinds.is_empty() && has_sensor(joint) {
                kinds.extend((0..N_WALK_MODES as u8).map(ParameterKind::WalkMode));
            }
        }
        let Some(mut found) = estimate(&wider) else { return (self, None) };
        let gain_nats = evidence_gain_nats(&found, &self);
        // A model that rejects more explains less.
        let least_p = p_value.iter().copied().fold(1.0, f64::min) * self.problem.n_seen_joints as f64;
        let is_in = gain_nats > MIN_WALK_NATS && found.outliers.len() <= self.outliers.len() && least_p < MAX_WALK_P;
        if let Some(walk) = &mut found.model.walk {
            walk.gain_nats = gain_nats;
        }
        let selection = Selection { term: OptionalTerm::Walk, is_in, gain_nats };
        (if is_in { found } else { self }, Some(selection))
    }

    /// Initial standard deviation of a walk, rad: twice each joint's error per view, or the change attributed to
    /// warmth. From much smaller ones the fit attributes all of it to errors new in each view.
    fn first_walk_std_rad(&self, views: &[View]) -> [f64; MAX_JOINTS] {
        let oil_c = || views.iter().filter_map(|view| view.conditions.oil_c);
        let warmed_k = oil_c().fold(f64::NEG_INFINITY, f64::max) - oil_c().fold(f64::INFINITY, f64::min);
        let by_warmth_rad = self.scales().offset_std_rad_per_k * warmed_k.max(0.0);
        self.scales().joint_std_rad.map(|std_rad| (2.0 * std_rad).max(by_warmth_rad))
    }

    /// Probability of as large a walk of each joint's errors in a random order of the views.
    pub(crate) fn walk_p_values(&self, views: &[View], span: [Stamp; 2]) -> [f64; MAX_JOINTS] {
        let mut order: Vec<usize> = (0..views.len()).collect();
        order.sort_by_key(|&view_idx| (views[view_idx].end, view_idx));
        let weights: Vec<f64> = (0..N_WALK_MODES).map(|k| mode_std(k as u8).powi(2)).collect();
        let mut p_values = [1.0; MAX_JOINTS];
        for (joint, errors) in self.joint_errors(&order).iter().enumerate() {
            if errors.len() < MIN_VIEWS {
                continue;
            }
            let patterns = DMatrix::from_fn(errors.len(), N_WALK_MODES, |row, k| {
                mode(k as u8, span, views[errors[row].view_idx].end)
            });
            p_values[joint] = self.time_order(joint, errors).p_of_patterns(&patterns, &weights);
        }
        p_values
    }

    fn walks_seem_likely(&self, views: &[View], span: [Stamp; 2]) -> bool {
        let all: Vec<usize> = (0..views.len()).collect();
        self.joint_errors(&all).iter().any(|errors| {
            let mut score = SVector::<f64, N_WALK_MODES>::zeros();
            let mut information = SMatrix::<f64, N_WALK_MODES, N_WALK_MODES>::zeros();
            let mut by_common = vec![DVector::zeros(self.problem.layout.n); N_WALK_MODES];
            for error in errors {
                let phi = SVector::<f64, N_WALK_MODES>::from_fn(|k, _| mode(k as u8, span, views[error.view_idx].end));
                score += phi * (error.weight * error.error_rad);
                information += phi * phi.transpose() * (error.weight - error.weight.powi(2) * error.own_var);
                for (sum, phi) in by_common.iter_mut().zip(phi.iter()) {
                    sum.axpy(error.weight * phi, &error.by_common, 1.0);
                }
            }
            let propagated: Vec<DVector<f64>> = by_common.iter().map(|by| &self.posterior.covariance * by).collect();
            information -= SMatrix::<f64, N_WALK_MODES, N_WALK_MODES>::from_fn(|k, l| by_common[k].dot(&propagated[l]));
            sigmas(&score, &information) > SCORE_WORTH_A_FIT
        })
    }
}

/// Excess of a walk's statistic over its mean, in its standard deviations.
fn sigmas(score: &SVector<f64, N_WALK_MODES>, information: &SMatrix<f64, N_WALK_MODES, N_WALK_MODES>) -> f64 {
    let by_mode = SVector::<f64, N_WALK_MODES>::from_fn(|k, _| mode_std(k as u8).powi(2));
    let statistic: f64 = (0..N_WALK_MODES).map(|k| by_mode[k] * score[k].powi(2)).sum();
    let mean: f64 = (0..N_WALK_MODES).map(|k| by_mode[k] * information[(k, k)]).sum();
    let pairs = (0..N_WALK_MODES).flat_map(|k| (0..N_WALK_MODES).map(move |l| (k, l)));
    let variance: f64 = 2.0 * pairs.map(|(k, l)| by_mode[k] * by_mode[l] * information[(k, l)].powi(2)).sum::<f64>();
    if variance > 0.0 { (statistic - mean) / variance.sqrt() } else { 0.0 }
}
