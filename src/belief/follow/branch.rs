//! One explanation of what happened, and the belief under it.

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

/// One explanation, and the belief under it.
#[derive(Clone)]
pub(crate) struct Branch {
    pub fault: Option<Fault>,
    pub filter: Filter,
    /// `ln` of its odds.
    pub nats: f64,
    /// The evidence of each view since it was opened, nats.
    pub gains: Vec<f64>,
    /// Of one that was found in hindsight, how many views before its race count for it, and when the first was: those
    /// that speak for it, of a tag those that saw it.
    pub n_speak_before: usize,
    pub since: Option<Stamp>,
}

impl Branch {
    /// That nothing happened, from `filter` on.
    pub(crate) fn nothing(filter: Filter) -> Self {
        Self { fault: None, filter, nats: 0.0, gains: Vec::new(), n_speak_before: 0, since: None }
    }

    /// That `fault` happens now, where nothing had so far.
    pub(crate) fn with(&self, robot: &Robot, fault: Fault) -> Self {
        let nats = self.nats + fault.ln_prior();
        let mut branch = Self { fault: Some(fault), nats, ..Self::nothing(self.filter.clone()) };
        fault.open(&mut branch.filter, robot);
        branch
    }

    /// Views since it was opened that may speak for it.
    pub(crate) fn n_views(&self) -> usize {
        self.gains.len() + self.n_speak_before
    }

    /// How many of the views that it and `other` both took in speak for it.
    pub(crate) fn n_speak_for_it(&self, other: &Self) -> usize {
        let both = self.gains.iter().rev().zip(other.gains.iter().rev());
        both.filter(|(own, other)| speaks(**own, **other)).count()
    }

    /// Whether it explains by another scale or a bump that is none.
    pub(crate) fn is_void(&self, before: &Filter) -> bool {
        let Some(fault) = self.fault else { return false };
        let size = fault.size(before, &self.filter);
        match fault {
            Fault::Scale(_) => size.is_none_or(|gain| (gain - 1.0).abs() < LEAST_SCALE),
            Fault::Worn(..) => size.is_none_or(|height_rad| height_rad.abs() < LEAST_BUMP_RAD),
            _ => false,
        }
    }

    /// Joint and place, where it is a worn spot.
    pub(crate) fn worn_spot(&self) -> Option<(usize, WornSpot)> {
        match self.fault {
            Some(Fault::Worn(joint, spot)) => Some((joint, spot)),
            _ => None,
        }
    }

    /// Whether it tells of something.
    pub(crate) fn tells(&self) -> bool {
        !matches!(self.fault, None | Some(Fault::Drift))
    }
}

/// A view, and what sensors may have changed since the one before.
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

    /// `ln` of the probability of the view, up to what is the same for all.
    fn evidence(&self, update: Option<&ViewUpdate>) -> f64 {
        update.map_or(-NOTHING_FITS_NATS * self.view.tags.len() as f64, |update| update.log_evidence)
    }
}

/// Whether a view of which one explanation and another have the evidence, nats, speaks for the first.
pub(crate) fn speaks(one: f64, other: f64) -> bool {
    one > other + SPEAKS_NATS
}

/// A view under a fault: a failed sensor's reading is not looked at.
pub(crate) fn seen_by(fault: Option<Fault>, view: &View) -> View {
    let mut view = view.clone();
    if let Some(Fault::Failed(joint)) = fault {
        view.is_free[joint] = true;
    }
    view
}
