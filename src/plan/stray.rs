//! How far the arm leaves the straight line of an edge while it moves: its joints lag, droop and overshoot, each its own way.
//!
//! Set-points go rest to rest by a cubic (`timing`), whose rate at the share `u` of time is `4 u (1 - u)` of its largest. A
//! joint that lags by up to `lag_spread_s` more or less than the others is off the line by that times its rate, and by a
//! droop in proportion to the rate; an overshoot comes at the end of the edge. What does not move does not stray.

use super::timing::Timing;
use crate::robot::Robot;
use crate::streams::{JointAngles, MAX_JOINTS};

/// Bounds on the straying along one edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stray {
    /// Where the joint is fastest, rad.
    moving_rad: [f64; MAX_JOINTS],
    /// At the end of the edge, rad.
    beyond_rad: [f64; MAX_JOINTS],
}

impl Stray {
    /// On the edge between two poses, driven as `timing` says.
    #[must_use]
    pub fn new(robot: &Robot, timing: &Timing, from: &JointAngles, to: &JointAngles) -> Self {
        let mut stray = Self::default();
        if from == to {
            return stray;
        }
        let motion = robot.drive.motion;
        let rates_rad_s = timing.peak_rates_rad_s(from, to);
        for (joint, (&rate_rad_s, sensor)) in rates_rad_s.iter().zip(&robot.sensors).enumerate() {
            let share = rate_rad_s / sensor.max_rate_rad_s;
            stray.moving_rad[joint] = motion.lag_spread_s * rate_rad_s + motion.droop_rad * share;
            stray.beyond_rad[joint] = motion.overshoot_rad * share;
        }
        stray
    }

    /// The most by which a joint is off the line between two shares of the way, rad.
    #[must_use]
    pub fn most_rad(&self, joint: usize, along: [f64; 2]) -> f64 {
        self.moving_rad[joint] * most_rate(along) + self.beyond_rad[joint] * along[1].max(along[0])
    }
}

/// An upper bound on the cubic's rate, as a share of its largest, between two shares of the way.
fn most_rate(along: [f64; 2]) -> f64 {
    let (low, high) = (along[0].min(along[1]), along[0].max(along[1]));
    if low <= 0.5 && high >= 0.5 {
        return 1.0;
    }
    // From the nearer end; the cubic is symmetric about the middle.
    let way = if high < 0.5 { high } else { 1.0 - low };
    // way = u^2 (3 - 2 u) is at least 2 u^2 in the first half, and the rate grows with u there.
    let most_u = (0.5 * way).sqrt();
    4.0 * most_u * (1.0 - most_u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_bounded_on_every_stretch() {
        let way = |u: f64| u * u * (3.0 - 2.0 * u);
        for a in 0..=40 {
            for b in a..=40 {
                let [u, v] = [a, b].map(|k| f64::from(k) / 40.0);
                let bound = most_rate([way(u), way(v)]);
                let most = (0..=100).map(|k| u + (v - u) * f64::from(k) / 100.0).map(|u| 4.0 * u * (1.0 - u));
                let most = most.fold(0.0, f64::max);
                assert!(bound >= most - 1e-12 && bound <= 1.3 * most + 1e-9, "{u} {v}: {bound} {most}");
            }
        }
    }

    /// Each joint lags by a time of its own: none is farther off the line than the bound says.
    #[test]
    fn joints_that_lag_differently_stay_within_the_bound() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4");
        let mut robot = crate::robot::load(&folder).expect("the robot reads");
        let motion = crate::robot::MotionSpec { lag_spread_s: 0.2, overshoot_rad: 0.004, droop_rad: 0.002 };
        robot.drive.motion = motion;
        let timing = Timing::new(&robot);
        let from = robot.stowed;
        let mut to = from;
        (to[0], to[1], to[4]) = (from[0] + 0.9, from[1] - 0.3, from[4] + 0.5);
        let stray = Stray::new(&robot, &timing, &from, &to);
        let duration_s = timing.edge_duration_s(&from, &to);
        let mut closest = f64::INFINITY;
        for step in 0..=500 {
            let u = f64::from(step) / 500.0;
            let at = Timing::set_point(&from, &to, u);
            let share = u * u * (3.0 - 2.0 * u);
            for joint in 0..from.len() {
                let late = Timing::set_point(&from, &to, (u - motion.lag_spread_s / duration_s).clamp(0.0, 1.0));
                let lag_rad = (late[joint] - at[joint]).abs();
                let bound_rad = stray.most_rad(joint, [share; 2]);
                // The cubic has slowed down by the end of the lag: before the end, the bound needs no help.
                if u < 0.5 {
                    assert!(lag_rad <= bound_rad + 1e-12, "joint {joint} at {u}: {lag_rad} {bound_rad}");
                    closest = if from[joint] == to[joint] { closest } else { closest.min(bound_rad - lag_rad) };
                }
                assert!(from[joint] != to[joint] || bound_rad == 0.0, "what does not move does not stray");
            }
        }
        assert!(closest < 0.02, "the bound is that of the lag, not a large number: {closest}");
        assert_eq!(Stray::new(&robot, &timing, &from, &from), Stray::default());
    }
}
