//! The gripper's jaws: they follow their command at a limited rate behind a valve's lag.
//!
//! `v` is the rate of the gap, `w = clamp((command - gap)/(4 lag), +-rate)` the commanded rate: `dv/dt = (w - v)/lag`.
//! With that gain the loop is critically damped: the jaws do not overshoot their command.

use armcal_core::robot::GripperSpec;

/// Gap between the jaws and its rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gripper {
    pub opening_m: f64,
    rate_m_s: f64,
    told_m: f64,
    opening_max_m: f64,
    rate_max_m_s: f64,
    lag_s: f64,
}

impl Gripper {
    /// Starts at rest with the gap in which the arm carries the gripper.
    pub(super) fn new(spec: &GripperSpec, lag_s: f64) -> Self {
        Self {
            opening_m: spec.rest_opening_m,
            rate_m_s: 0.0,
            told_m: spec.rest_opening_m,
            opening_max_m: spec.opening_max_m,
            rate_max_m_s: spec.opening_max_m / spec.closing_time_s,
            lag_s,
        }
    }

    /// Commands a gap; `opening` is 0 (closed) .. 1 (open).
    pub(super) fn command(&mut self, opening: f64) {
        self.told_m = opening * self.opening_max_m;
    }

    /// Advances by `step_s`.
    pub(super) fn step(&mut self, step_s: f64) {
        let gain_per_s = 0.25 / self.lag_s;
        let wanted_m_s = (gain_per_s * (self.told_m - self.opening_m)).clamp(-self.rate_max_m_s, self.rate_max_m_s);
        self.rate_m_s += (wanted_m_s - self.rate_m_s) * (1.0 - (-step_s / self.lag_s).exp());
        self.opening_m = (self.opening_m + self.rate_m_s * step_s).clamp(0.0, self.opening_max_m);
    }

    /// Moves to the commanded gap at once, for time that is skipped.
    pub(super) fn arrive(&mut self) {
        (self.opening_m, self.rate_m_s) = (self.told_m, 0.0);
    }

    /// Returns true if the gap still changes by a measurable amount.
    pub(super) fn is_moving(&self) -> bool {
        self.rate_m_s.abs() > 1e-4 || (self.told_m - self.opening_m).abs() > 1e-4
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use armcal_core::robot::Jaw;

    const STEP_S: f64 = 0.001;
    const LAG_S: f64 = 0.05;

    fn gripper() -> Gripper {
        let jaw = || Jaw { name: String::new(), visuals: Vec::new() };
        let spec = GripperSpec {
            jaws: [jaw(), jaw()],
            opens_along: Vector3::x_axis(),
            body: 6,
            rest_opening_m: 0.02,
            opening_max_m: 0.1,
            closing_time_s: 2.0,
        };
        Gripper::new(&spec, LAG_S)
    }

    #[test]
    fn it_follows_at_its_rate_behind_its_lag_and_stops_where_it_was_told() {
        let mut jaws = gripper();
        jaws.command(1.0);
        let mut largest_m: f64 = 0.0;
        for k in 1..=3000 {
            jaws.step(STEP_S);
            let time_s = STEP_S * f64::from(k);
            largest_m = largest_m.max(jaws.opening_m);
            // While the rate is limited: v = V (1 - exp(-t/lag)), so the gap is V (t - lag (1 - exp(-t/lag))).
            if time_s < 1.0 {
                let expected_m = 0.02 + 0.05 * (time_s - LAG_S * (1.0 - (-time_s / LAG_S).exp()));
                assert!((jaws.opening_m - expected_m).abs() < 5e-5, "{time_s}: {} {expected_m}", jaws.opening_m);
            }
        }
        assert!((jaws.opening_m - 0.1).abs() < 1e-5 && largest_m <= 0.1, "{} {largest_m}", jaws.opening_m);
        assert!(!jaws.is_moving());
    }

    #[test]
    fn it_swings_past_nothing() {
        let mut jaws = gripper();
        jaws.command(0.5);
        let path: Vec<f64> = (0..4000)
            .map(|_| {
                jaws.step(STEP_S);
                jaws.opening_m
            })
            .collect();
        assert!(path.windows(2).all(|pair| pair[1] >= pair[0] - 1e-9), "it turns back");
        assert!((path[3999] - 0.05).abs() < 1e-6, "{}", path[3999]);
    }
}
