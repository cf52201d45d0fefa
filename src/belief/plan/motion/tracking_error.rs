//! Deviation of the arm from the straight line of an edge while it moves: each joint lags, droops and overshoots by its
//! own amount.
//!
//! Set-points move rest to rest by a cubic (`timing`). Its rate at the time share `u` is `4 u (1 - u)` of its largest.
//! A joint's lag may differ from the others' by up to `lag_spread_s`. It then leaves the line by that time times its
//! rate, but never by more than its travel so far. Droop is proportional to the rate. An overshoot comes at the end of
//! the edge, mostly ahead. A joint that does not move does not deviate.

use crate::plan::constants::motion_tracking_error::BEHIND;
use crate::plan::motion::edge::{Edge, SLOWEST};
use crate::plan::motion::timing::{RATE_SHARE, Timing};
use armcal_core::robot::Robot;
use armcal_core::streams::MAX_JOINTS;

/// Bounds on the tracking error along one edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingErrorBound {
    /// Lag of each joint at its largest rate, rad.
    lag_rad: [f64; MAX_JOINTS],
    droop_rad: [f64; MAX_JOINTS],
    /// Travel of each joint, rad.
    way_rad: [f64; MAX_JOINTS],
    /// Least and largest error of each joint at the end of the edge, rad.
    end_rad: [[f64; 2]; MAX_JOINTS],
}

impl TrackingErrorBound {
    /// Returns the bounds for an edge, driven as `timing` defines.
    #[must_use]
    pub fn new(robot: &Robot, timing: &Timing, edge: &Edge) -> Self {
        let mut tracking_error = Self::default();
        if edge.from == edge.to {
            return tracking_error;
        }
        let motion = robot.drive.motion;
        let rates_rad_s = timing.peak_rates_rad_s(edge);
        for (joint, (&rate_rad_s, sensor)) in rates_rad_s.iter().zip(&robot.sensors).enumerate() {
            let share = rate_rad_s / sensor.max_rate_rad_s;
            let way_rad = edge.to[joint] - edge.from[joint];
            let (ahead_rad, behind_rad) = (motion.overshoot_rad * share, -BEHIND * motion.overshoot_rad * share);
            tracking_error.lag_rad[joint] = motion.lag_spread_s * rate_rad_s;
            tracking_error.droop_rad[joint] = motion.droop_rad * share;
            tracking_error.way_rad[joint] = way_rad.abs();
            tracking_error.end_rad[joint] =
                if way_rad < 0.0 { [-ahead_rad, -behind_rad] } else { [behind_rad, ahead_rad] };
        }
        tracking_error
    }

    /// Returns the bounds at the end of any edge driven at the lowest speed: the largest overshoot of its joints.
    #[must_use]
    pub fn arriving(robot: &Robot) -> Self {
        let beyond_rad = robot.drive.motion.overshoot_rad * RATE_SHARE / SLOWEST;
        Self { end_rad: [[-beyond_rad, beyond_rad]; MAX_JOINTS], ..Self::default() }
    }

    /// Returns the largest distance of a joint from the edge's end, rad.
    #[must_use]
    pub fn end_rad(&self, joint: usize) -> f64 {
        let [least_rad, most_rad] = self.end_rad[joint];
        most_rad.max(-least_rad)
    }

    /// Returns the middle of the joint's possible rest angles, relative to the edge's end, rad. On the edge it applies
    /// in proportion to the completed share.
    #[must_use]
    pub fn middle_rad(&self, joint: usize) -> f64 {
        let [least_rad, most_rad] = self.end_rad[joint];
        0.5 * (least_rad + most_rad)
    }

    /// Returns the largest distance of a joint from that middle between two shares of the edge, rad.
    #[must_use]
    pub fn most_rad(&self, joint: usize, along: [f64; 2]) -> f64 {
        let ([least_rad, most_rad], rate, far) = (self.end_rad[joint], most_rate(along), along[1].max(along[0]));
        let lag_rad = f64::min(self.lag_rad[joint] * rate, self.way_rad[joint] * far);
        lag_rad + self.droop_rad[joint] * rate + 0.5 * (most_rad - least_rad) * far
    }
}

/// Returns an upper bound on the cubic's rate, as a share of its largest, between two shares of the travel.
fn most_rate(along: [f64; 2]) -> f64 {
    let (low, high) = (along[0].min(along[1]), along[0].max(along[1]));
    if low <= 0.5 && high >= 0.5 {
        return 1.0;
    }
    // Share of the travel from the nearer end; the cubic is symmetric about the middle.
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

    /// At the end of an edge a joint may be ahead by its overshoot, and behind by a quarter of it, for both directions.
    #[test]
    fn an_edge_ends_ahead_for_the_most_part() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let mut robot = armcal_core::robot::load(&folder).expect("the robot reads");
        robot.drive.motion = armcal_core::robot::MotionSpec { lag_spread_s: 0.0, overshoot_rad: 0.05, droop_rad: 0.0 };
        let timing = Timing::new(&robot);
        let from = robot.stowed;
        let mut to = from;
        (to[0], to[1]) = (from[0] + 0.6, from[1] - 0.4);
        for slowness in [1.0, 4.0] {
            let edge = Edge { from, to, time_scale: slowness };
            let (tracking_error, rates_rad_s) =
                (TrackingErrorBound::new(&robot, &timing, &edge), timing.peak_rates_rad_s(&edge));
            for joint in 0..2 {
                let full_rad = 0.05 * rates_rad_s[joint] / robot.sensors[joint].max_rate_rad_s;
                let way = (to[joint] - from[joint]).signum();
                for share in [0.5, 1.0] {
                    let (middle_rad, most_rad) =
                        (way * share * tracking_error.middle_rad(joint), tracking_error.most_rad(joint, [share; 2]));
                    assert!((middle_rad + most_rad - share * full_rad).abs() < 1e-12, "{joint}: ahead");
                    assert!((middle_rad - most_rad + 0.25 * share * full_rad).abs() < 1e-12, "{joint}: behind");
                }
                assert!((tracking_error.end_rad(joint) - full_rad).abs() < 1e-12);
            }
            let fastest = (0..2).map(|j| rates_rad_s[j] / robot.sensors[j].max_rate_rad_s).fold(0.0, f64::max);
            assert!((fastest - RATE_SHARE / slowness).abs() < 1e-9, "{fastest}");
        }
    }

    /// Each joint has its own lag; none leaves the line by more than the bound.
    #[test]
    fn joints_that_lag_differently_stay_within_the_bound() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let mut robot = armcal_core::robot::load(&folder).expect("the robot reads");
        let motion = armcal_core::robot::MotionSpec { lag_spread_s: 0.2, overshoot_rad: 0.004, droop_rad: 0.002 };
        robot.drive.motion = motion;
        let timing = Timing::new(&robot);
        let from = robot.stowed;
        let mut to = from;
        (to[0], to[1], to[4]) = (from[0] + 0.9, from[1] - 0.3, from[4] + 0.5);
        let edge = Edge::at_full_speed(from, to);
        let tracking_error = TrackingErrorBound::new(&robot, &timing, &edge);
        let duration_s = timing.edge_duration_s(&edge);
        let mut closest = f64::INFINITY;
        for step in 0..=500 {
            let u = f64::from(step) / 500.0;
            let at = Timing::set_point(&from, &to, u);
            let share = u * u * (3.0 - 2.0 * u);
            for joint in 0..from.len() {
                let late = Timing::set_point(&from, &to, (u - motion.lag_spread_s / duration_s).clamp(0.0, 1.0));
                let lag_rad = (late[joint] - at[joint]).abs();
                let bound_rad = tracking_error.most_rad(joint, [share; 2]);
                // In the second half the rate falls during the lag, so only the first half tests the lag bound alone.
                if u < 0.5 {
                    assert!(lag_rad <= bound_rad + 1e-12, "joint {joint} at {u}: {lag_rad} {bound_rad}");
                    closest = if from[joint] == to[joint] { closest } else { closest.min(bound_rad - lag_rad) };
                }
                assert!(from[joint] != to[joint] || bound_rad == 0.0, "what does not move does not stray");
            }
        }
        assert!(closest < 0.02, "the bound is that of the lag, not a large number: {closest}");
        let nowhere = Edge::at_full_speed(from, from);
        assert_eq!(TrackingErrorBound::new(&robot, &timing, &nowhere), TrackingErrorBound::default());
        for slowness in [1.0, 2.0, SLOWEST] {
            let slow = TrackingErrorBound::new(&robot, &timing, &Edge { time_scale: slowness, ..edge });
            for along in [[0.0, 1.0], [0.2, 0.3], [1.0, 1.0]] {
                for joint in 0..from.len() {
                    let quicker_rad = slowness * slow.most_rad(joint, along);
                    assert!(
                        (quicker_rad - tracking_error.most_rad(joint, along)).abs() < 1e-12,
                        "it goes with the rate"
                    );
                }
            }
            let arriving = TrackingErrorBound::arriving(&robot);
            assert!(slowness != SLOWEST || (0..from.len()).all(|j| slow.end_rad(j) <= arriving.end_rad(j) + 1e-12));
        }
    }
}
