//! Durations of motions: rest to rest on each edge, within the joints' rates and the pump's flow.
//!
//! All joints complete the same share of their travel at the same time: the cubic `s = u^2 (3 - 2 u)` of the time share
//! `u`. Its rate is largest at the middle, 1.5 times its mean. An edge takes as long as its slowest joint needs, and as
//! the pump needs for all joints: `sum_j D_j |rate_j| <= Q`. `D_j` is the oil volume per radian of joint j.

use crate::plan::constants::motion_timing::{CUBIC_PEAK, S_PER_MIN};
pub(crate) use crate::plan::constants::motion_timing::{RATE_SHARE, SETTLE_S};
use crate::plan::motion::edge::{Edge, Path};
use armcal_core::robot::Robot;
use armcal_core::streams::JointAngles;

/// Limits of the joints' rates and the pump's flow.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// Largest rate of each joint's set-points, rad/s.
    rate_rad_s: Vec<f64>,
    displacement_l_per_rad: Vec<f64>,
    /// Flow that set-points use, L/s; infinite if no limit is known.
    flow_l_per_s: f64,
}

impl Timing {
    /// Returns the limits of the nominal drives and the pump, less a share for the controller.
    #[must_use]
    pub fn new(robot: &Robot) -> Self {
        Self {
            rate_rad_s: robot.sensors.iter().map(|sensor| RATE_SHARE * sensor.max_rate_rad_s).collect(),
            displacement_l_per_rad: robot.drive.displacement_l_per_rad.clone(),
            flow_l_per_s: robot.drive.pump_l_per_min.map_or(f64::INFINITY, |flow| RATE_SHARE * flow / S_PER_MIN),
        }
    }

    /// Returns these limits with every joint's rate limited to `rate_rad_s`.
    #[must_use]
    pub fn limited_to(&self, rate_rad_s: f64) -> Self {
        Self { rate_rad_s: self.rate_rad_s.iter().map(|rate| rate.min(rate_rad_s)).collect(), ..self.clone() }
    }

    /// Returns the duration of an edge at its speed, s; 0 if nothing moves.
    #[must_use]
    pub fn edge_duration_s(&self, edge: &Edge) -> f64 {
        edge.time_scale * self.least_duration_s(&edge.from, &edge.to)
    }

    /// Returns the shortest duration of the straight edge between two poses within rates and flow, s; 0 if nothing
    /// moves.
    #[inline]
    #[must_use]
    pub fn least_duration_s(&self, from: &JointAngles, to: &JointAngles) -> f64 {
        let (mut slowest_s, mut oil_l) = (0.0, 0.0);
        for (joint, (a, b)) in from.iter().zip(to.iter()).enumerate() {
            let way_rad = (b - a).abs();
            slowest_s = f64::max(slowest_s, way_rad / self.rate_rad_s[joint]);
            oil_l += self.displacement_l_per_rad[joint] * way_rad;
        }
        CUBIC_PEAK * f64::max(slowest_s, oil_l / self.flow_l_per_s)
    }

    /// Returns the set-point on an edge after `share_of_time` (0 to 1) of its duration.
    #[inline]
    #[must_use]
    pub fn set_point(from: &JointAngles, to: &JointAngles, share_of_time: f64) -> JointAngles {
        let share = share_of_time * share_of_time * (3.0 - 2.0 * share_of_time);
        JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j]))
    }

    /// Returns the largest rate of each joint on an edge, rad/s, not negative; 0 if the joint does not move.
    #[must_use]
    pub fn peak_rates_rad_s(&self, edge: &Edge) -> JointAngles {
        let (from, to, duration_s) = (&edge.from, &edge.to, self.edge_duration_s(edge));
        JointAngles::from_fn(from.len(), |j| {
            if from[j] == to[j] { 0.0 } else { CUBIC_PEAK * (to[j] - from[j]).abs() / duration_s }
        })
    }

    /// Returns the duration of a path, with rest at each waypoint, s.
    #[must_use]
    pub fn path_duration_s(&self, path: &Path) -> f64 {
        path.edges().map(|edge| self.edge_duration_s(&edge)).sum()
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;

    fn titan() -> Robot {
        armcal_core::robot::load(
            &std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4"),
        )
        .expect("it reads")
    }

    fn random(robot: &Robot, rng: &mut rand_chacha::ChaCha8Rng) -> JointAngles {
        JointAngles::from_fn(robot.n_joints(), |_| rng.random_range(-1.0..1.0))
    }

    /// Checks rates and flow by differences of set-points: one of the limits is reached, none is exceeded.
    #[test]
    fn set_points_keep_to_rates_and_flow_and_use_one_of_them_up() {
        let mut robot = titan();
        let mut rng = armcal_core::stats::stream_rng(1, "timing");
        let (mut by_rate, mut by_flow) = (0, 0);
        for pump in [None, Some(12.0), Some(5.0)] {
            robot.drive.pump_l_per_min = pump;
            let timing = Timing::new(&robot);
            for _ in 0..200 {
                let (from, to) = (random(&robot, &mut rng), random(&robot, &mut rng));
                let edge = Edge::at_full_speed(from, to);
                let duration_s = timing.edge_duration_s(&edge);
                let (mut rate_share, mut flow_share) = (0.0_f64, 0.0_f64);
                let n = 1000;
                let at = |k: i32| Timing::set_point(&from, &to, f64::from(k) / f64::from(n));
                assert!(at(0) == from && at(n).max_abs_difference(&to) < 1e-12);
                for k in 0..n {
                    let (before, after) = (at(k), at(k + 1));
                    let rate = |j: usize| (after[j] - before[j]).abs() * f64::from(n) / duration_s;
                    let mut flow_l_min = 0.0;
                    for (j, sensor) in robot.sensors.iter().enumerate() {
                        rate_share = rate_share.max(rate(j) / sensor.max_rate_rad_s);
                        flow_l_min += 60.0 * rate(j) * robot.drive.displacement_l_per_rad[j];
                        assert!(rate(j) <= timing.peak_rates_rad_s(&edge)[j] + 1e-9);
                    }
                    flow_share = flow_share.max(pump.map_or(0.0, |pump| flow_l_min / pump));
                }
                assert!(rate_share < 0.7 + 1e-9 && flow_share < 0.7 + 1e-9, "{rate_share} {flow_share}");
                assert!(rate_share.max(flow_share) > 0.699, "{rate_share} {flow_share}");
                by_rate += i32::from(rate_share > 0.699);
                by_flow += i32::from(flow_share > 0.699);
            }
        }
        assert!(by_rate > 100 && by_flow > 100, "{by_rate} by rate, {by_flow} by flow");
    }

    #[test]
    fn a_path_takes_what_its_edges_take_and_rest_takes_nothing() {
        let robot = titan();
        let timing = Timing::new(&robot);
        let mut rng = armcal_core::stats::stream_rng(2, "timing");
        let waypoints: Vec<JointAngles> = (0..4).map(|_| random(&robot, &mut rng)).collect();
        let edges_s: Vec<f64> = waypoints.windows(2).map(|edge| timing.least_duration_s(&edge[0], &edge[1])).collect();
        let quick = Path::at_full_speed(waypoints.clone());
        assert!((timing.path_duration_s(&quick) - edges_s.iter().sum::<f64>()).abs() < 1e-12);
        let mut slow = Path::at(waypoints[0]);
        for (to, slowness) in waypoints[1..].iter().zip([1.0, 4.0, 2.0]) {
            slow.push(*to, slowness);
        }
        let slow_s = edges_s[0] + 4.0 * edges_s[1] + 2.0 * edges_s[2];
        assert!((timing.path_duration_s(&slow) - slow_s).abs() < 1e-12);
        let [full, quarter] = [quick.edge(1), slow.edge(1)].map(|edge| timing.peak_rates_rad_s(&edge));
        for (full, quarter) in full.iter().zip(quarter.iter()) {
            assert!((full - 4.0 * quarter).abs() < 1e-12);
        }
        let nowhere = Edge::at_full_speed(waypoints[0], waypoints[0]);
        assert_eq!(timing.edge_duration_s(&nowhere), 0.0);
        assert_eq!(*timing.peak_rates_rad_s(&nowhere), [0.0; 6]);
    }
}
