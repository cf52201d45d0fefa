//! One hypothesis about a fault, and the belief under it.

pub(crate) use crate::follow::constants::branch::NOTHING_FITS_NATS;
use crate::follow::constants::branch::{LEAST_BUMP_RAD, LEAST_SCALE, SPEAKS_NATS};
use crate::follow::filter::{Filter, ViewUpdate};
use crate::follow::hypothesis::Fault;
use crate::follow::process_noise::ProcessNoise;
use crate::model::parameters::WornSpot;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::sensor::ConditionChange;
use armcal_core::time::Stamp;

/// One hypothesis about a fault, and the belief under it.
#[derive(Clone)]
pub(crate) struct Branch {
    pub fault: Option<Fault>,
    pub filter: Filter,
    /// Logarithm of its odds, nats.
    pub nats: f64,
    /// Evidence of each view since the branch was opened, nats.
    pub gains: Vec<f64>,
    /// Number of views before the race that count for a branch found in hindsight, and the stamp of the first. Views
    /// count if they support the hypothesis; for a tag, those that saw it.
    pub n_speak_before: usize,
    pub since: Option<Stamp>,
}

impl Branch {
    /// Returns the branch without a fault, from `filter` on.
    pub(crate) fn nothing(filter: Filter) -> Self {
        Self { fault: None, filter, nats: 0.0, gains: Vec::new(), n_speak_before: 0, since: None }
    }

    /// Returns the branch in which `fault` happens now, with no fault before.
    pub(crate) fn with(&self, robot: &Robot, fault: Fault) -> Self {
        let nats = self.nats + fault.ln_prior();
        let mut branch = Self { fault: Some(fault), nats, ..Self::nothing(self.filter.clone()) };
        fault.open(&mut branch.filter, robot);
        branch
    }

    /// Returns the number of views since the branch was opened that may support it.
    pub(crate) fn n_views(&self) -> usize {
        self.gains.len() + self.n_speak_before
    }

    /// Returns the number of views taken in by this branch and by `other` that support this one.
    pub(crate) fn n_speak_for_it(&self, other: &Self) -> usize {
        let both = self.gains.iter().rev().zip(other.gains.iter().rev());
        both.filter(|(own, other)| speaks(**own, **other)).count()
    }

    /// True if the branch explains the views by a scale or a bump too small to be a fault.
    pub(crate) fn is_void(&self, before: &Filter) -> bool {
        let Some(fault) = self.fault else { return false };
        let size = fault.size(before, &self.filter);
        match fault {
            Fault::Scale(_) => size.is_none_or(|gain| (gain - 1.0).abs() < LEAST_SCALE),
            Fault::Worn(..) => size.is_none_or(|height_rad| height_rad.abs() < LEAST_BUMP_RAD),
            _ => false,
        }
    }

    /// Returns joint and place if the fault is a worn spot.
    pub(crate) fn worn_spot(&self) -> Option<(usize, WornSpot)> {
        match self.fault {
            Some(Fault::Worn(joint, spot)) => Some((joint, spot)),
            _ => None,
        }
    }

    /// True if the hypothesis is a fault to report.
    pub(crate) fn tells(&self) -> bool {
        !matches!(self.fault, None | Some(Fault::Drift))
    }
}

/// A view, and the sensor changes that may have happened since the view before.
#[derive(Clone)]
pub(crate) struct Step {
    pub drift: Option<(ProcessNoise, ConditionChange)>,
    pub view: View,
}

impl Step {
    pub(crate) fn take_in(&self, robot: &Robot, branch: &mut Branch) -> Option<ViewUpdate> {
        let Branch { fault, filter, nats, gains, .. } = branch;
        if let Some((noise, change)) = &self.drift {
            let columns = noise.widening(filter, change);
            filter.widen(&columns);
        }
        let may_read = matches!(fault, Some(Fault::Failed(joint)) if !self.view.is_free[*joint]);
        let read = may_read.then(|| {
            let mut filter = filter.clone();
            let update = filter.update(robot, &self.view);
            (self.evidence(update.as_ref()), filter, update)
        });
        let mut update = filter.update(robot, &seen_by(*fault, &self.view));
        let mut gain = self.evidence(update.as_ref());
        if let Some((of_reading, as_read, read)) = read {
            let (most, least) = (gain.max(of_reading), gain.min(of_reading));
            if of_reading > gain {
                (*filter, update) = (as_read, read);
            }
            gain = most + (0.5 * (1.0 + (least - most).exp())).ln();
        }
        *nats += gain;
        gains.push(gain);
        update
    }

    /// Returns `ln` of the probability of the view, up to a constant that all branches share.
    fn evidence(&self, update: Option<&ViewUpdate>) -> f64 {
        update.map_or(-NOTHING_FITS_NATS * self.view.tags.len() as f64, |update| update.log_evidence)
    }
}

/// True if the evidence of one hypothesis exceeds that of another, nats, enough to support the first.
pub(crate) fn speaks(one: f64, other: f64) -> bool {
    one > other + SPEAKS_NATS
}

/// Returns the view under a fault: the reading of a failed sensor is ignored.
pub(crate) fn seen_by(fault: Option<Fault>, view: &View) -> View {
    let mut view = view.clone();
    if let Some(Fault::Failed(joint)) = fault {
        view.is_free[joint] = true;
    }
    view
}
