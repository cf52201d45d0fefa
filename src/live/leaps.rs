//! Readings that leap: farther from one to the next than any joint goes, and not back.

use armcal_core::robot::Robot;
use armcal_core::streams::JointSensorSample;
use armcal_core::time::Stamp;

/// A joint that is pushed or falls goes no faster than the robot's file allows, times this.
const RATE_SLACK: f64 = 2.0;

/// Which joints' readings are in doubt.
pub(crate) struct Leaps {
    limit_rad: f64,
    max_rate_rad_s: Vec<f64>,
    /// The last reading before the leap, for each joint.
    before: Vec<Option<(f64, Stamp)>>,
}

/// A joint whose readings have stayed away after a leap.
pub(crate) struct Leapt {
    pub joint: usize,
    pub off_rad: f64,
    pub for_s: f64,
}

impl Leaps {
    /// `limit_rad`: what counts as a leap, beside the way that a joint can go between two readings.
    pub fn new(robot: &Robot, limit_rad: f64) -> Self {
        let max_rate_rad_s = robot.sensors.iter().map(|sensor| RATE_SLACK * sensor.max_rate_rad_s).collect();
        Self { limit_rad, max_rate_rad_s, before: vec![None; robot.sensors.len()] }
    }

    /// Readings are taken as they are from here on: an arm that is heard out may begin anywhere.
    pub fn forget(&mut self) {
        self.before.fill(None);
    }

    /// Whether the joint's readings leapt, and have not come back.
    pub fn has_leapt(&self, joint: usize) -> bool {
        self.before[joint].is_some()
    }

    /// The joint that has stayed away for longest. `way_rad`: of a joint, from one reading to another. Only a second
    /// leap brings a joint back: one that could have gone to where it reads by now was not there in between.
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
