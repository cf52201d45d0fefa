//! Tracking error of an arm against the straight lines that it was commanded along, from a recording.
//!
//! Set-points that lie on one line make an edge. Each reading on it is compared with the nearest point of the line,
//! joint by joint. The remaining distance is the part of lag, droop and overshoot in which the joints differ. Planning
//! bounds it by robot.toml's `[motion]` (`plan::Stray`).

use serde::Serialize;

use armcal_belief::plan::{Edge as Motion, Timing, TrackingErrorBound};
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointAngles, JointCounts, Message};
use armcal_core::time::Stamp;

/// Largest distance of a set-point on the line, rad.
const ON_LINE_RAD: f64 = 1e-3;
/// Shortest edge that counts, rad.
const SHORTEST_RAD: f64 = 0.05;
/// Longest gap between set-points of one edge, s: the motion in a longer gap was not recorded.
const LONGEST_GAP_S: f64 = 1.0;
/// Time after the last set-point of an edge during which readings count, s.
const AFTER_S: f64 = 0.5;
/// Share of the edge from which a reading is at its end.
const AT_END: f64 = 0.999;
/// Least share of a joint's full rate at which its overshoot counts.
const LEAST_RATE_SHARE: f64 = 0.1;
/// Allowance for the sensor's noise, in standard deviations of one reading.
const NOISE_SIGMAS: f64 = 4.0;

/// Tracking error of all edges.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackingError {
    pub n_edges: usize,
    pub n_readings: usize,
    /// Number of readings with some joint off the line by more than its bound and noise: on the way, and at the edge's
    /// end.
    pub n_beyond: [usize; 2],
    pub joints: Vec<JointTrackingError>,
}

/// Tracking error of one joint, less the allowance for noise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JointTrackingError {
    pub name: String,
    /// Largest distance from the line, rad.
    pub most_rad: f64,
    /// Largest distance over the edge's rate there, s. Only rates of at least a third of the edge's largest count.
    pub most_lag_s: f64,
    /// Largest distance at the edge's end, rad.
    pub most_at_end_rad: f64,
    /// The least `overshoot_rad` of `[motion]` that covers the ends of all edges on which the joint has at least a
    /// tenth of its rate.
    pub most_overshoot_rad: f64,
    /// Largest share of the bound that the distance reached.
    pub most_of_bound: f64,
}

struct Edge {
    from: JointAngles,
    to: JointAngles,
    start: Stamp,
    end: Stamp,
}

/// Set-points and readings, kept while a recording is read.
#[derive(Default)]
pub(super) struct Motions {
    commands: Vec<(Stamp, JointCounts)>,
    readings: Vec<(Stamp, JointCounts)>,
}

impl Motions {
    pub fn take(&mut self, message: &Message) {
        match message {
            Message::JointCommand(command) => self.commands.push((command.stamp, command.counts)),
            Message::JointSensors(sample) => self.readings.push((sample.stamp, sample.counts)),
            _ => {}
        }
    }

    /// Compares readings with set-points, both by the datasheet's scale; `None` where no edge was driven.
    pub fn finish(self, robot: &Robot) -> Option<TrackingError> {
        let n_joints = robot.n_joints();
        let sensors = ArmSensors::nominal(robot);
        let angles = |samples: Vec<(Stamp, JointCounts)>| {
            let whole = samples.into_iter().filter(|(_, counts)| counts.len() == n_joints);
            whole.map(|(stamp, counts)| (stamp, sensors.angles(&counts))).collect()
        };
        let found = tracking_error(robot, angles(self.commands), angles(self.readings));
        (found.n_edges > 0).then_some(found)
    }
}

fn tracking_error(
    robot: &Robot,
    mut commands: Vec<(Stamp, JointAngles)>,
    mut readings: Vec<(Stamp, JointAngles)>,
) -> TrackingError {
    commands.sort_by_key(|(stamp, _)| *stamp);
    readings.sort_by_key(|(stamp, _)| *stamp);
    let joints =
        robot.joint_names().into_iter().map(|name| JointTrackingError { name, ..JointTrackingError::default() });
    let mut study = TrackingError { n_edges: 0, n_readings: 0, n_beyond: [0; 2], joints: joints.collect() };
    let edges = edges(&commands);
    for (k, edge) in edges.iter().enumerate() {
        study.n_edges += 1;
        // The next edge may begin at once.
        let next = edges.get(k + 1).map(|next| next.start);
        let first = readings.partition_point(|(stamp, _)| *stamp < edge.start);
        for (stamp, reading) in &readings[first..] {
            if stamp.since_s(edge.end) > AFTER_S || next.is_some_and(|next| *stamp > next) {
                break;
            }
            study.add(robot, edge, *stamp, reading);
        }
    }
    study
}

/// Longest runs of set-points on one line.
fn edges(commands: &[(Stamp, JointAngles)]) -> Vec<Edge> {
    let mut edges = Vec::new();
    let mut first = 0;
    while first + 1 < commands.len() {
        // Neither rest before the edge nor a gap of the recording belongs to the edge.
        let is_gap = commands[first + 1].0.since_s(commands[first].0) > LONGEST_GAP_S;
        if is_gap || commands[first].1.max_abs_difference(&commands[first + 1].1) < 1e-9 {
            first += 1;
            continue;
        }
        let mut last = first + 1;
        while last + 1 < commands.len()
            && commands[last + 1].0.since_s(commands[last].0) <= LONGEST_GAP_S
            && commands[last].1.max_abs_difference(&commands[last + 1].1) >= 1e-9
            && is_line(&commands[first..=last + 1])
        {
            last += 1;
        }
        let (start, from) = commands[first];
        let (end, to) = commands[last];
        if from.max_abs_difference(&to) >= SHORTEST_RAD {
            edges.push(Edge { from, to, start, end });
        }
        first = last;
    }
    edges
}

fn is_line(points: &[(Stamp, JointAngles)]) -> bool {
    let (from, to) = (&points[0].1, &points[points.len() - 1].1);
    points.iter().all(|(_, at)| {
        let on_line = nearest(from, to, at);
        on_line.1.max_abs_difference(at) < ON_LINE_RAD
    })
}

/// Returns the share of the way to the nearest point of the line, and that point.
fn nearest(from: &JointAngles, to: &JointAngles, at: &JointAngles) -> (f64, JointAngles) {
    let (mut along, mut length) = (0.0, 0.0);
    for joint in 0..from.len() {
        let way = to[joint] - from[joint];
        along += way * (at[joint] - from[joint]);
        length += way * way;
    }
    let share = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    (share, JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j])))
}

impl TrackingError {
    fn add(&mut self, robot: &Robot, edge: &Edge, stamp: Stamp, reading: &JointAngles) {
        let (share, on_line) = nearest(&edge.from, &edge.to, reading);
        let timing = Timing::new(robot);
        let duration_s = edge.end.since_s(edge.start);
        // Set-points begin and end with about one period of rest, which makes the edge look quicker than it was.
        let slowness = f64::max(duration_s / timing.least_duration_s(&edge.from, &edge.to), 1.0);
        let tracking_error =
            TrackingErrorBound::new(robot, &timing, &Motion { from: edge.from, to: edge.to, time_scale: slowness });
        let u = (stamp.since_s(edge.start) / duration_s).clamp(0.0, 1.0);
        let mut is_beyond = false;
        for (joint, found) in self.joints.iter_mut().enumerate() {
            let sensor = &robot.sensors[joint];
            let noise_rad = NOISE_SIGMAS * sensor.noise_std_counts / sensor.counts_per_rad.abs();
            let signed_rad = reading[joint] - on_line[joint];
            let off_rad = (signed_rad.abs() - noise_rad).max(0.0);
            let off_middle_rad = |tracking_error: &TrackingErrorBound| {
                ((signed_rad - share * tracking_error.middle_rad(joint)).abs() - noise_rad).max(0.0)
            };
            let rate_rad_s = 6.0 * u * (1.0 - u) * (edge.to[joint] - edge.from[joint]).abs() / duration_s;
            let peak_rad_s = 1.5 * (edge.to[joint] - edge.from[joint]).abs() / duration_s;
            found.most_rad = found.most_rad.max(off_rad);
            if rate_rad_s > 0.33 * peak_rad_s && rate_rad_s > 0.02 {
                found.most_lag_s = found.most_lag_s.max(off_rad / rate_rad_s);
            }
            if share >= AT_END {
                found.most_at_end_rad = found.most_at_end_rad.max(off_rad);
                // A joint that hardly moves by itself does not show how far a moving joint overshoots.
                if tracking_error.end_rad(joint) > LEAST_RATE_SHARE * robot.drive.motion.overshoot_rad {
                    let full_rad = off_rad * robot.drive.motion.overshoot_rad / tracking_error.end_rad(joint);
                    found.most_overshoot_rad = found.most_overshoot_rad.max(full_rad);
                }
            }
            let (bound_rad, off_rad) = (tracking_error.most_rad(joint, [share; 2]), off_middle_rad(&tracking_error));
            is_beyond |= off_rad > bound_rad;
            if bound_rad > 1e-4 {
                found.most_of_bound = found.most_of_bound.max(off_rad / bound_rad);
            }
        }
        self.n_readings += 1;
        self.n_beyond[usize::from(share >= AT_END)] += usize::from(is_beyond);
    }

    /// Table of the joints, with the counts above it.
    pub(super) fn to_text(&self) -> String {
        let [moving, at_end] = self.n_beyond;
        let mut text = format!(
            "tracking     {} edges, {} readings, beyond the bound of [motion] {moving} on the way and {at_end} at the \
             end\n\
             {:<18} {:>9} {:>9} {:>11} {:>14} {:>9}\n",
            self.n_edges, self.n_readings, "joint", "most rad", "lag s", "at end rad", "overshoot_rad", "of bound"
        );
        for joint in &self.joints {
            text += &format!(
                "{:<18} {:>9.4} {:>9.3} {:>11.4} {:>14.4} {:>9.2}\n",
                joint.name,
                joint.most_rad,
                joint.most_lag_s,
                joint.most_at_end_rad,
                joint.most_overshoot_rad,
                joint.most_of_bound
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::streams::{JointCommand, JointSensorSample};
    use armcal_core::time::SIMULATION_EPOCH;

    /// Two edges, driven without noise; joint 0 is late by 0.15 s, the others follow at once.
    #[test]
    fn a_known_lag_is_found() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4");
        let mut robot = armcal_core::robot::load(&folder).expect("the robot reads");
        for sensor in &mut robot.sensors {
            sensor.noise_std_counts = 0.0;
        }
        let (sensors, timing) = (ArmSensors::nominal(&robot), Timing::new(&robot));
        let bent = [[0.5, -0.2, 0.4], [0.1, 0.3, -0.2]];
        let mut waypoints = vec![robot.stowed];
        for by in bent {
            let last = waypoints[waypoints.len() - 1];
            waypoints.push(JointAngles::from_fn(6, |j| last[j] + by.get(j).copied().unwrap_or(0.0)));
        }
        let lag_s = 0.15;
        let mut motions = Motions::default();
        let mut began_s = 0.0;
        for edge in waypoints.windows(2) {
            let duration_s = timing.least_duration_s(&edge[0], &edge[1]);
            let n = (duration_s / 0.01).ceil() as u32;
            let at = |k: f64| Timing::set_point(&edge[0], &edge[1], (k / f64::from(n)).clamp(0.0, 1.0));
            for k in 0..=n + 60 {
                let stamp = SIMULATION_EPOCH.plus_s(began_s + 0.01 * f64::from(k));
                let late = at(f64::from(k) - lag_s / 0.01);
                let set_point = at(f64::from(k));
                let angles = JointAngles::from_fn(6, |j| if j == 0 { late[j] } else { set_point[j] });
                if k % 4 == 0 {
                    motions.take(&Message::JointCommand(JointCommand { stamp, counts: sensors.counts(&set_point) }));
                }
                motions.take(&Message::JointSensors(JointSensorSample { stamp, counts: sensors.counts(&angles) }));
            }
            began_s += 0.01 * f64::from(n + 61);
        }
        let study = motions.finish(&robot).expect("edges were driven");
        assert_eq!(study.n_edges, 2, "{}", study.to_text());
        let lags: Vec<f64> = study.joints.iter().map(|joint| joint.most_lag_s).collect();
        // Distances are to the nearest point of the line, with u the edge's direction: joint 0 is late by `lag (1 -
        // u_0^2)`, the others by `-lag u_0^2`. Joint 0 has 0.139 s on the second edge, 0.083 s on the first. While the
        // rate falls, distance lost at a higher rate counts for more; the largest is up to 1.4 times that.
        assert!((0.139..0.139 * 1.4).contains(&lags[0]), "{lags:?}");
        assert!(lags[1..3].iter().all(|lag| (0.083..0.083 * 1.4).contains(lag)), "{lags:?}");
        assert!(lags[3..].iter().all(|lag| *lag == 0.0), "{lags:?}");
    }
}
