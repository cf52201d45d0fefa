//! Detects a weak pump: the arm moves much less oil than its set-points request.

use crate::plan::constants::motion_timing::S_PER_MIN;
use crate::session::constants::flow::{SOUND_SHARE, SPAN_S};
use armcal_core::robot::Robot;
use armcal_core::streams::JointAngles;

/// Largest flows so far.
pub(crate) struct FlowWatch {
    displacement_l_per_rad: Vec<f64>,
    pump_l_per_min: Option<f64>,
    periods: u64,
    span_s: f64,
    /// Set-point and angles at the start of the span.
    start: Option<[JointAngles; 2]>,
    /// Largest requested and moved flow, L/min.
    most_l_per_min: [f64; 2],
}

impl FlowWatch {
    pub fn new(robot: &Robot, period_s: f64) -> Self {
        let periods = (SPAN_S / period_s).round().max(1.0);
        Self {
            displacement_l_per_rad: robot.drive.displacement_l_per_rad.clone(),
            pump_l_per_min: robot.drive.pump_l_per_min,
            periods: periods as u64,
            span_s: periods * period_s,
            start: None,
            most_l_per_min: [0.0; 2],
        }
    }

    /// True if a span ends with the control period of this number.
    pub fn is_due(&self, period: u64) -> bool {
        period.is_multiple_of(self.periods)
    }

    /// Takes in set-point and believed angles at the end of a span.
    pub fn update(&mut self, now: [JointAngles; 2]) {
        if let Some(start) = self.start.replace(now) {
            for k in 0..2 {
                let ways = now[k].iter().zip(start[k].iter()).zip(&self.displacement_l_per_rad);
                let oil_l: f64 = ways.map(|((now, before), litres)| litres * (now - before).abs()).sum();
                self.most_l_per_min[k] = self.most_l_per_min[k].max(oil_l / self.span_s * S_PER_MIN);
            }
        }
    }

    /// Returns the message about a pump that gives far less than robot.toml states, if it seems to.
    pub fn weak_pump(&self) -> Option<String> {
        let (pump, [asked, moved]) = (self.pump_l_per_min?, self.most_l_per_min);
        (moved < SOUND_SHARE * asked.min(pump)).then(|| {
            format!(
                "the arm moved {moved:.1} L/min of oil at most, where its set-points asked for {asked:.1}: the pump \
                 gives far less than the {pump} L/min of [hydraulics] pump_l_per_min?"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An arm that follows late is sound, and one that gets a third of the oil is not.
    #[test]
    fn a_weak_pump_is_told_from_a_late_arm() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let robot = armcal_core::robot::load(&folder).expect("the robot reads");
        for (rate_share, is_weak) in [(1.0, false), (0.8, false), (0.33, true)] {
            let mut flow = FlowWatch::new(&robot, 0.01);
            for k in 0..400 {
                let t_s = 0.01 * f64::from(k);
                let at =
                    |rate: f64, t_s: f64| JointAngles::from_fn(6, |j| robot.stowed[j] + rate * t_s.clamp(0.0, 2.0));
                if flow.is_due(k as u64) {
                    flow.update([at(0.1, t_s), at(0.1 * rate_share, t_s - 0.2)]);
                }
            }
            let said = flow.weak_pump();
            assert_eq!(said.is_some(), is_weak, "{rate_share}: {said:?}");
            if let Some(said) = said {
                insta::assert_snapshot!("weak_pump", said);
            }
        }
    }
}
