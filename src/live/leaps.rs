//! Detection of leaps: readings that move farther in one step than any joint can, and do not return.

use armcal_core::robot::Robot;
use armcal_core::streams::JointSensorSample;
use armcal_core::time::Stamp;

/// Factor on the largest rate of the robot's file, for a joint that is pushed or falls.
const RATE_SLACK: f64 = 2.0;

/// Joints whose readings are in doubt.
pub(crate) struct Leaps {
    limit_rad: f64,
    max_rate_rad_s: Vec<f64>,
    /// Last reading of each joint before its leap.
    before: Vec<Option<(f64, Stamp)>>,
}

/// A joint whose readings have stayed away after a leap.
pub(crate) struct Leapt {
    pub joint: usize,
    pub off_rad: f64,
    pub for_s: f64,
}

impl Leaps {
    /// Detects leaps: steps longer by `limit_rad` than a joint can go between two readings.
    pub fn new(robot: &Robot, limit_rad: f64) -> Self {
        let max_rate_rad_s = robot.sensors.iter().map(|sensor| RATE_SLACK * sensor.max_rate_rad_s).collect();
        Self { limit_rad, max_rate_rad_s, before: vec![None; robot.sensors.len()] }
    }

    /// Accepts the next readings as they are: an arm that is only listened to may begin anywhere.
    pub fn forget(&mut self) {
        self.before.fill(None);
    }

    /// Returns true if the joint's readings leapt, and have not come back.
    pub fn has_leapt(&self, joint: usize) -> bool {
        self.before[joint].is_some()
    }

    /// Returns the joint that has stayed away longest. `way_rad` returns the way of a joint from one reading to
    /// another. Only a second leap brings a joint back. A joint that could have moved to its present reading by now was
    /// not there in between.
    pub fn hear(
        &mut self,
        last: &JointSensorSample,
        sample: &JointSensorSample,
        way_rad: impl Fn(usize, f64, f64) -> f64,
    ) -> Option<Leapt> {
        let mut longest: Option<Leapt> = None;
        for (joint, before) in self.before.iter_mut().enumerate() {
            let reading = sample.counts[joint];
            let is_beyond = |(from, since): (f64, Stamp)| {
                let most = self.limit_rad + self.max_rate_rad_s[joint] * sample.stamp.since_s(since);
                way_rad(joint, from, reading).abs() > most
            };
            let previous = (last.counts[joint], last.stamp);
            *before = match *before {
                None => is_beyond(previous).then_some(previous),
                Some(before) if is_beyond(previous) && !is_beyond(before) => None,
                Some(before) => Some(before),
            };
            let Some((from, since)) = *before else { continue };
            let leapt = Leapt { joint, off_rad: way_rad(joint, from, reading), for_s: sample.stamp.since_s(since) };
            if longest.as_ref().is_none_or(|longest| leapt.for_s > longest.for_s) {
                longest = Some(leapt);
            }
        }
        longest
    }
}
