//! Assignment of joint readings to stamps.
//!
//! A stream of readings is continuous where neighbours are at most a quarter of a second apart: there the travel is
//! interpolated, and its rate is known. In recordings with one reading per pose the nearest reading counts.

use crate::views::conditions::{BACK_S, ROUNDING_COUNTS, RestPose};
pub(crate) use crate::views::constants::external_pairing::{CONTINUOUS_WITHIN_S, RATE_WINDOW_S};
use armcal_core::input::{ExternalRecording, Reading};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, wrap_symmetric};
use armcal_core::streams::{JointAngles, MAX_JOINTS};
use armcal_core::time::Stamp;

/// Travel at a stamp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TravelSample {
    pub travel_rad: JointAngles,
    /// True if the stamp lies within a continuous stream.
    pub is_continuous: bool,
    /// Rate of the travel, if the stream is continuous around the stamp.
    pub rate_rad_s: Option<JointAngles>,
    /// Indices of the first and last reading that the travel comes from.
    pub readings: (usize, usize),
}

/// Readings of a recording as travel from the middle of each joint's range.
pub(crate) struct TravelSeries<'a> {
    pub readings: &'a [Reading],
    pub travel_rad: Vec<JointAngles>,
    /// Travel after which a reading repeats, for each joint.
    period_rad: Vec<f64>,
    max_gap_s: f64,
    sensors: ArmSensors,
    /// Standard deviation of the rounding of readings, counts.
    rounding_counts: f64,
}

impl<'a> TravelSeries<'a> {
    pub fn new(recording: &'a ExternalRecording, robot: &Robot, max_gap_s: f64) -> Self {
        let sensors = ArmSensors::nominal(robot);
        let travel = |reading: &Reading| {
            JointAngles::from_fn(robot.n_joints(), |j| {
                if recording.absent_joints.contains(&j) {
                    return 0.0;
                }
                sensors.models[j].nominal_travel_rad(reading.counts[j])
            })
        };
        Self {
            readings: &recording.readings,
            travel_rad: recording.readings.iter().map(travel).collect(),
            period_rad: robot.sensors.iter().map(|spec| spec.wrap_counts / spec.counts_per_rad.abs()).collect(),
            max_gap_s,
            rounding_counts: if is_whole(&recording.readings) { ROUNDING_COUNTS } else { 0.0 },
            sensors,
        }
    }

    /// Returns the direction in which each joint moved to its rest, at `rest_rad` from reading number `from` on. It is
    /// 0 if the joint has not moved in the stream of earlier readings. Appends the readings that decided it.
    pub fn approach(&self, from: usize, rest_rad: &JointAngles, used: &mut Vec<usize>) -> [f64; MAX_JOINTS] {
        let start = self.readings[from].stamp;
        let is_before = |idx: &usize| {
            let (this, next) = (self.readings[*idx].stamp, self.readings[*idx + 1].stamp);
            next.since_s(this) <= CONTINUOUS_WITHIN_S && start.since_s(this) <= BACK_S
        };
        let earlier = (0..from).rev().take_while(is_before).map(|idx| (idx, &self.travel_rad[idx]));
        let rest = RestPose { travel_rad: rest_rad, sensors: &self.sensors, rounding_counts: self.rounding_counts };
        rest.approach(earlier, used, |travel_rad, joint| travel_rad[joint])
    }

    /// Returns the travel from `from` to `to` the short way round.
    pub fn difference(&self, to: &JointAngles, from: &JointAngles, joint: usize) -> f64 {
        wrap_symmetric(to[joint] - from[joint], self.period_rad[joint])
    }

    /// Returns the travel at a stamp; `None` if no reading is near enough.
    pub fn at(&self, stamp: Stamp) -> Option<TravelSample> {
        if let Some((travel_rad, readings)) = self.between(stamp) {
            return Some(TravelSample { travel_rad, is_continuous: true, rate_rad_s: self.rate(stamp), readings });
        }
        let after = self.readings.partition_point(|reading| reading.stamp < stamp);
        let near = |idx: &usize| self.readings.get(*idx).map(|reading| (reading.stamp.since_s(stamp).abs(), *idx));
        let nearest = [after.wrapping_sub(1), after].iter().filter_map(near).min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, idx) = nearest.filter(|(gap_s, _)| *gap_s <= self.max_gap_s)?;
        Some(TravelSample {
            travel_rad: self.travel_rad[idx],
            is_continuous: false,
            rate_rad_s: None,
            readings: (idx, idx),
        })
    }

    /// Returns the travel interpolated within a continuous stream, and the indices of the readings on both sides.
    fn between(&self, stamp: Stamp) -> Option<(JointAngles, (usize, usize))> {
        let mut after = self.readings.partition_point(|reading| reading.stamp < stamp);
        if after == 0 && self.readings.first()?.stamp == stamp {
            after = 1;
        }
        let before = after.checked_sub(1)?;
        let span_s = self.readings.get(after)?.stamp.since_s(self.readings[before].stamp);
        if span_s > CONTINUOUS_WITHIN_S || span_s > 2.0 * self.max_gap_s {
            return None;
        }
        let share = if span_s > 0.0 { stamp.since_s(self.readings[before].stamp) / span_s } else { 0.0 };
        let (from, to) = (&self.travel_rad[before], &self.travel_rad[after]);
        let travel = JointAngles::from_fn(from.len(), |j| from[j] + share * self.difference(to, from, j));
        Some((travel, (before, after)))
    }

    fn rate(&self, stamp: Stamp) -> Option<JointAngles> {
        let windows = [(-RATE_WINDOW_S, RATE_WINDOW_S), (0.0, RATE_WINDOW_S), (-RATE_WINDOW_S, 0.0)];
        windows.into_iter().find_map(|(from_s, to_s)| {
            let (from, _) = self.between(stamp.plus_s(from_s))?;
            let (to, _) = self.between(stamp.plus_s(to_s))?;
            Some(JointAngles::from_fn(from.len(), |j| self.difference(&to, &from, j) / (to_s - from_s)))
        })
    }
}

/// Returns true if all readings are whole numbers, as a sensor's words are.
fn is_whole(readings: &[Reading]) -> bool {
    readings.iter().flat_map(|reading| reading.counts.iter()).all(|counts| counts.fract() == 0.0)
}
