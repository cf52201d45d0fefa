//! An oracle that knows when something may have happened: what can be told of it by the views since then. For studies:
//! a belief that finds out by itself cannot be faster.

use crate::follow::branch::{NOTHING_FITS_NATS, seen_by};
use crate::follow::filter::Filter;
use crate::follow::hypothesis::Fault;
use crate::follow::lagged_temperature::LaggedTemperature;
use crate::follow::process_noise::ProcessNoise;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::sensor::Conditions;
use armcal_core::time::Stamp;

/// Beliefs that took the same views in: that nothing happened, and each of some explanations, opened at its time.
#[derive(Clone)]
pub struct Oracle {
    pub(crate) robot: Robot,
    pub(crate) lag: LaggedTemperature,
    pub(crate) noise: ProcessNoise,
    pub(crate) conditions: Conditions,
    /// Joints whose sensor is not looked at.
    pub(crate) failed: Vec<usize>,
    pub(crate) nothing: Explained,
    pub(crate) explanations: Vec<Explained>,
}

/// What the views say of one explanation.
#[derive(Clone)]
pub(crate) struct Explained {
    pub faults: Vec<Fault>,
    pub filter: Filter,
    /// Sum of squares in sigmas.
    pub cost: f64,
    /// Logarithm of the probability of the views.
    pub nats: f64,
    /// Numbers that the faults leave open and the views see.
    pub numbers: usize,
    /// Tags that were seen.
    pub tags: Vec<usize>,
}

/// How one explanation compares with that nothing happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleGain {
    /// What it saves of the sum of squares in sigmas.
    pub chi2: f64,
    /// Numbers that it fits to the views for that: where nothing happened, `chi2` has about so many degrees of freedom.
    pub numbers: usize,
    /// `ln` of the odds that the views give it.
    pub nats: f64,
}

impl Explained {
    pub(crate) fn new(faults: Vec<Fault>, filter: &Filter, robot: &Robot) -> Self {
        let mut filter = filter.clone();
        faults.iter().for_each(|fault| fault.open(&mut filter, robot));
        let numbers = faults.iter().map(|fault| fault.numbers()).sum();
        Self { faults, filter, cost: 0.0, nats: 0.0, numbers, tags: Vec::new() }
    }

    /// A tag counts once it is seen, a sensor that says nothing anew in each view.
    fn count(&mut self, view: &View) {
        let new = view.tags.iter().map(|seen| seen.tag_idx).filter(|tag| !self.tags.contains(tag));
        let new: Vec<usize> = new.collect();
        self.numbers += self
            .faults
            .iter()
            .map(|fault| match fault {
                Fault::Tag(tag) if new.contains(tag) => 6,
                Fault::Failed(joint) if !view.is_free[*joint] => 1,
                _ => 0,
            })
            .sum::<usize>();
        self.tags.extend(new);
    }

    fn add(&mut self, robot: &Robot, view: &View) {
        self.count(view);
        let seen = self.faults.iter().fold(view.clone(), |view, fault| seen_by(Some(*fault), &view));
        match self.filter.update(robot, &seen) {
            Some(update) => {
                self.cost += update.cost + update.rejected_cost;
                self.nats += update.log_evidence;
            }
            None => {
                let nats = NOTHING_FITS_NATS * view.tags.len() as f64;
                self.cost += 2.0 * nats;
                self.nats -= nats;
            }
        }
    }
}

impl Oracle {
    /// A reading of the oil's thermometer.
    pub fn hear_temperature(&mut self, stamp: Stamp, oil_c: f64) {
        self.lag.hear(stamp, oil_c);
    }

    /// Takes a view in.
    pub fn add_view(&mut self, view: &View) {
        let Some(mut view) = view.of_known_tags(&self.robot) else { return };
        self.failed.iter().for_each(|joint| view.is_free[*joint] = true);
        view.conditions = self.lag.of_sensors(&view.conditions);
        let change = view.conditions.departure_from(&self.conditions);
        self.conditions = view.conditions;
        for explained in std::iter::once(&mut self.nothing).chain(&mut self.explanations) {
            let columns = self.noise.widening(&explained.filter, &change);
            explained.filter.widen(&columns);
            explained.add(&self.robot, &view);
        }
    }

    /// Of each explanation, in their order.
    #[must_use]
    pub fn gains(&self) -> Vec<OracleGain> {
        let Explained { cost, nats, .. } = &self.nothing;
        let gain = |of: &Explained| OracleGain { chi2: cost - of.cost, numbers: of.numbers, nats: of.nats - nats };
        self.explanations.iter().map(gain).collect()
    }
}
