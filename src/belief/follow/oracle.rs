//! An oracle with known fault times: the evidence that later views can give for a fault. For studies: no diagnosis
//! without that knowledge can be faster.

use crate::follow::branch::{NOTHING_FITS_NATS, seen_by};
use crate::follow::filter::Filter;
use crate::follow::hypothesis::Fault;
use crate::follow::lagged_temperature::LaggedTemperature;
use crate::follow::process_noise::ProcessNoise;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::sensor::Conditions;
use armcal_core::time::Stamp;

/// Beliefs that took in the same views: one without a fault, and one for each hypothesis, opened at its time.
#[derive(Clone)]
pub struct Oracle {
    pub(crate) robot: Robot,
    pub(crate) lag: LaggedTemperature,
    pub(crate) noise: ProcessNoise,
    pub(crate) conditions: Conditions,
    /// Joints whose sensor is ignored.
    pub(crate) failed: Vec<usize>,
    pub(crate) nothing: Explained,
    pub(crate) explanations: Vec<Explained>,
}

/// State of one hypothesis.
#[derive(Clone)]
pub(crate) struct Explained {
    pub faults: Vec<Fault>,
    pub filter: Filter,
    /// Sum of squares in sigmas.
    pub cost: f64,
    /// Logarithm of the probability of the views.
    pub nats: f64,
    /// Number of parameters that the faults open and the views see.
    pub numbers: usize,
    /// Tags that were seen.
    pub tags: Vec<usize>,
}

/// Comparison of one hypothesis with no fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleGain {
    /// Decrease of the sum of squares in sigmas.
    pub chi2: f64,
    /// Number of parameters fitted for that: without a fault, `chi2` has about as many degrees of freedom.
    pub numbers: usize,
    /// Logarithm of the odds by the views, nats.
    pub nats: f64,
}

impl Explained {
    pub(crate) fn new(faults: Vec<Fault>, filter: &Filter, robot: &Robot) -> Self {
        let mut filter = filter.clone();
        faults.iter().for_each(|fault| fault.open(&mut filter, robot));
        let numbers = faults.iter().map(|fault| fault.numbers()).sum();
        Self { faults, filter, cost: 0.0, nats: 0.0, numbers, tags: Vec::new() }
    }

    /// Counts the parameters that a view adds: a tag once it is seen, a failed sensor in each view.
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
    /// Takes in a reading of the oil's thermometer.
    pub fn hear_temperature(&mut self, stamp: Stamp, oil_c: f64) {
        self.lag.hear(stamp, oil_c);
    }

    /// Takes in a view.
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

    /// Returns the gain of each hypothesis, in their order.
    #[must_use]
    pub fn gains(&self) -> Vec<OracleGain> {
        let Explained { cost, nats, .. } = &self.nothing;
        let gain = |of: &Explained| OracleGain { chi2: cost - of.cost, numbers: of.numbers, nats: of.nats - nats };
        self.explanations.iter().map(gain).collect()
    }
}
