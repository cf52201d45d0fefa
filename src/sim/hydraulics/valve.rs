//! Spool of one valve: from the controller's command to the share of the full flow.

use crate::spec::HydraulicsSpec;

/// Valve with a first-order lag behind the command, then backlash of the spool, then the deadband.
#[derive(Clone, Copy, Debug)]
pub(super) struct Valve {
    deadband: f64,
    /// Half of the backlash between the lagged command and the spool.
    half_play: f64,
    /// Share of the lag that one step covers: exact for a constant command.
    lag_share: f64,
    lagged: f64,
    /// Position of the spool, -1..1.
    spool: f64,
}

impl Valve {
    pub(super) fn new(spec: &HydraulicsSpec, step_s: f64) -> Self {
        let lag_share = 1.0 - (-step_s / spec.valve_lag_s).exp();
        Self { deadband: spec.deadband, half_play: 0.5 * spec.spool_hysteresis, lag_share, lagged: 0.0, spool: 0.0 }
    }

    /// Moves the spool by one step; returns the opening halfway, -1..1.
    pub(super) fn step(&mut self, command: f64) -> f64 {
        let before = self.spool;
        self.lagged += (command.clamp(-1.0, 1.0) - self.lagged) * self.lag_share;
        self.spool = self.spool.clamp(self.lagged - self.half_play, self.lagged + self.half_play);
        let middle = 0.5 * (before + self.spool);
        middle.signum() * (middle.abs() - self.deadband).max(0.0) / (1.0 - self.deadband)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.002;

    fn valve(spec: &HydraulicsSpec) -> Valve {
        Valve::new(spec, STEP_S)
    }

    #[test]
    fn the_spool_answers_a_step_as_a_first_order_lag_does() {
        for lag_s in [0.02, 0.05, 0.08] {
            let mut valve = valve(&HydraulicsSpec { valve_lag_s: lag_s, ..HydraulicsSpec::default() });
            let mut worst: f64 = 0.0;
            for i in 1..=500 {
                valve.step(0.7);
                let exact = 0.7 * (1.0 - (-f64::from(i) * STEP_S / lag_s).exp());
                worst = worst.max((valve.spool - exact).abs());
                if i % 3 == 0 && i <= 150 {
                    eprintln!("plot spool/{lag_s} {:.3} {:e}", f64::from(i) * STEP_S, valve.spool);
                }
            }
            eprintln!("lag {lag_s} s: {worst:.1e}");
            assert!(worst < 1e-12, "{worst}");
        }
    }

    #[test]
    fn the_oil_of_a_stroke_is_right_to_second_order_in_the_step() {
        // Without deadband the opening's integral is u (t - T (1 - exp(-t/T))).
        let spec = HydraulicsSpec { deadband: 0.0, ..HydraulicsSpec::default() };
        let exact = 0.1 - spec.valve_lag_s * (1.0 - (-0.1 / spec.valve_lag_s).exp());
        let [coarse, fine] = [0.002_f64, 0.001].map(|step_s| {
            let mut valve = Valve::new(&spec, step_s);
            let steps = (0.1 / step_s).round() as u32;
            (0..steps).map(|_| valve.step(1.0) * step_s).sum::<f64>() - exact
        });
        eprintln!("coarse {coarse:.2e} fine {fine:.2e}");
        assert!((coarse / fine - 4.0).abs() < 0.01, "{coarse} {fine}");
    }

    #[test]
    fn the_deadband_passes_nothing_and_the_rest_is_linear() {
        let opening = |command: f64| {
            let mut valve = valve(&HydraulicsSpec::default());
            (0..2000).map(|_| valve.step(command)).last().unwrap_or(f64::NAN)
        };
        assert_eq!(opening(0.0299), 0.0);
        assert_eq!(opening(-0.0299), 0.0);
        for command in [0.05_f64, 0.5, 1.0, -0.4] {
            let exact = command.signum() * (command.abs() - 0.03) / 0.97;
            assert!((opening(command) - exact).abs() < 1e-12, "{command}");
        }
    }

    #[test]
    fn play_holds_the_spool_behind_the_command_both_ways() {
        let spec = HydraulicsSpec { deadband: 0.0, spool_hysteresis: 0.04, ..HydraulicsSpec::default() };
        let mut valve = valve(&spec);
        let mut settle = |command: f64| (0..2000).map(|_| valve.step(command)).last().unwrap_or(f64::NAN);
        assert!((settle(0.5) - 0.48).abs() < 1e-12, "it comes from below");
        assert!((settle(0.47) - 0.48).abs() < 1e-12, "within the play it stays");
        assert!((settle(0.1) - 0.12).abs() < 1e-12, "it comes from above");
    }
}
