//! Readings around the view of a moving arm: those of its sensors a little earlier or later.

use crate::views::constants::motion::{N_STEPS, STEP_S};
use armcal_core::streams::JointAngles;

/// Travel and rate of each joint, `N_STEPS` equal steps before and after a view.
#[derive(Clone, Debug)]
pub struct Motion(Vec<(JointAngles, JointAngles)>);

impl Motion {
    /// Makes a motion from travel, rad, and rate, rad/s, at seconds after the view; `None` if a step has none.
    pub(crate) fn new(at: impl Fn(f64) -> Option<(JointAngles, JointAngles)>) -> Option<Self> {
        let steps = (0..=2 * N_STEPS).map(|k| at((k as f64 - N_STEPS as f64) * STEP_S));
        steps.collect::<Option<Vec<_>>>().map(Self)
    }

    /// Change of the travel from the view to `by_s` later, and the rate at that time; `None` beyond the steps.
    pub(crate) fn later(&self, by_s: f64) -> Option<(JointAngles, JointAngles)> {
        let at_steps = by_s / STEP_S + N_STEPS as f64;
        if !(0.0..=2.0 * N_STEPS as f64).contains(&at_steps) {
            return None;
        }
        let middle = (at_steps.round() as usize).clamp(1, 2 * N_STEPS - 1);
        let by = at_steps - middle as f64;
        // A parabola through three steps.
        let shares = [0.5 * by * (by - 1.0), 1.0 - by * by, 0.5 * by * (by + 1.0)];
        let steps = &self.0[middle - 1..=middle + 1];
        let mean = |value: &dyn Fn(&(JointAngles, JointAngles)) -> f64| {
            steps.iter().zip(shares).map(|(step, share)| share * value(step)).sum::<f64>()
        };
        let (now, _) = &self.0[N_STEPS];
        let travel_rad = JointAngles::from_fn(now.len(), |j| mean(&|(travel_rad, _)| travel_rad[j]) - now[j]);
        Some((travel_rad, JointAngles::from_fn(now.len(), |j| mean(&|(_, rate_rad_s)| rate_rad_s[j]))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beyond_the_readings_nothing_is_known() {
        let still = || Some((JointAngles::zeros(6), JointAngles::zeros(6)));
        let motion = Motion::new(|_| still()).expect("all steps");
        let end_s = STEP_S * N_STEPS as f64;
        assert!(motion.later(0.99 * end_s).is_some() && motion.later(1.01 * end_s).is_none());
        assert!(motion.later(f64::NAN).is_none());
        assert!(Motion::new(|s| if s < 0.9 * end_s { still() } else { None }).is_none());
    }
}
