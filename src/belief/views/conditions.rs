//! Conditions of an arm at rest in a recording: oil temperature, pressure, and the last direction of each joint's
//! motion.
//!
//! Thermometers and the depth gauge report at long intervals. Readings inside a span give its value; otherwise the line
//! between the nearest before and after it does. All of this uses the messages' own stamps.

pub(crate) use crate::views::constants::conditions::{BACK_S, NEAR_S, ROUNDING_COUNTS};
use crate::views::constants::conditions::{CLEAR_READINGS, CLEAR_SIGMAS, MIN_READINGS_OF_RATE};
use crate::views::message_index::MessageIndex;
use armcal_core::input::{ConditionKind, ConditionReading};
use armcal_core::log::Recording;
use armcal_core::robot::JointSensorSpec;
use armcal_core::sensor::{ArmSensors, Conditions, wrap_symmetric};
use armcal_core::streams::{JointAngles, MAX_JOINTS, Mark, Message, Thermometer};
use armcal_core::time::Stamp;

/// One reading of a slow sensor.
#[derive(Clone, Copy, Debug)]
struct Sample {
    stamp: Stamp,
    value: f64,
    /// Index among the recording's messages.
    idx: usize,
}

/// Readings of a recording's slow sensors, by time.
#[derive(Clone, Debug, Default)]
pub struct ConditionHistory {
    oil_c: Vec<Sample>,
    pressure_pa: Vec<Sample>,
}

impl ConditionHistory {
    /// Returns all readings of the recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        Self::heard_until(recording, Stamp { nanos: i64::MAX })
    }

    /// Returns the readings that were measured and recorded by `until`: all that a calibration at that time could use.
    /// So the finished recording gives the same result as the one that was still growing.
    #[must_use]
    pub fn heard_until(recording: &Recording, until: Stamp) -> Self {
        Self::of_messages(&recording.messages, until)
    }

    pub(crate) fn of_messages(messages: &[(Stamp, Message)], until: Stamp) -> Self {
        let mut found = Self::default();
        for (idx, (log_time, message)) in messages.iter().enumerate() {
            if *log_time > until {
                continue;
            }
            match message {
                Message::Temperature(sample) if sample.thermometer == Thermometer::Oil => {
                    found.oil_c.push(Sample { stamp: sample.stamp, value: sample.temperature_c, idx });
                }
                Message::Pressure(sample) => {
                    found.pressure_pa.push(Sample { stamp: sample.stamp, value: sample.pressure_pa, idx });
                }
                _ => {}
            }
        }
        for samples in [&mut found.oil_c, &mut found.pressure_pa] {
            samples.retain(|sample| sample.value.is_finite() && sample.stamp <= until);
        }
        found.sorted()
    }

    /// Returns all readings of a recording of a real arm; `idx` is their index among them.
    pub(crate) fn of_external(readings: &[ConditionReading]) -> Self {
        let mut found = Self::default();
        for (idx, reading) in readings.iter().enumerate() {
            let samples = match reading.kind {
                ConditionKind::OilTemperature => &mut found.oil_c,
                ConditionKind::Pressure => &mut found.pressure_pa,
            };
            samples.push(Sample { stamp: reading.stamp, value: reading.value, idx });
        }
        found.sorted()
    }

    /// Sorts by stamp, and by value if stamps are equal, so that the order of messages in the file does not matter.
    fn sorted(mut self) -> Self {
        for samples in [&mut self.oil_c, &mut self.pressure_pa] {
            samples.sort_by(|a, b| a.stamp.cmp(&b.stamp).then(a.value.total_cmp(&b.value)));
        }
        self
    }

    /// Returns the conditions over the span `start ..= end`, at its middle.
    #[must_use]
    pub fn over(&self, start: Stamp, end: Stamp) -> Conditions {
        self.over_noting(start, end, &mut Vec::new())
    }

    /// Returns the conditions over the span, as [`Self::over`]; appends the indices of the messages used.
    pub(crate) fn over_noting(&self, start: Stamp, end: Stamp, used: &mut Vec<usize>) -> Conditions {
        Conditions {
            oil_c: value_over(&self.oil_c, start, end, used),
            pressure_pa: value_over(&self.pressure_pa, start, end, used),
            stamp: Some(middle(start, end)),
        }
    }
}

fn middle(start: Stamp, end: Stamp) -> Stamp {
    start.plus_s(0.5 * end.since_s(start))
}

/// Returns the mean within the span; else from the nearest on both sides; else from the nearer one.
fn value_over(samples: &[Sample], start: Stamp, end: Stamp, used: &mut Vec<usize>) -> Option<f64> {
    let from = samples.partition_point(|sample| sample.stamp < start);
    let to = samples.partition_point(|sample| sample.stamp <= end).max(from);
    let inside = &samples[from..to];
    if !inside.is_empty() {
        used.extend(inside.iter().map(|sample| sample.idx));
        return Some(inside.iter().map(|sample| sample.value).sum::<f64>() / inside.len() as f64);
    }
    let before = samples[..from].last().filter(|sample| start.since_s(sample.stamp) <= NEAR_S);
    let after = samples[to..].first().filter(|sample| sample.stamp.since_s(end) <= NEAR_S);
    used.extend([before, after].into_iter().flatten().map(|sample| sample.idx));
    match (before, after) {
        (Some(a), Some(b)) => {
            let share = middle(start, end).since_s(a.stamp) / b.stamp.since_s(a.stamp);
            Some(a.value + share * (b.value - a.value))
        }
        (Some(one), None) | (None, Some(one)) => Some(one.value),
        (None, None) => None,
    }
}

/// Rate of each joint's travel over a span: the slope of the least-squares line.
#[derive(Clone, Debug)]
pub(crate) struct TravelRate {
    middle: Stamp,
    first: Option<JointAngles>,
    n: usize,
    sum_s: f64,
    sum_s2: f64,
    sum_rad: [f64; MAX_JOINTS],
    sum_s_rad: [f64; MAX_JOINTS],
}

impl TravelRate {
    pub fn over(mark: &Mark) -> Self {
        let middle = middle(mark.start, mark.end);
        let zero = [0.0; MAX_JOINTS];
        Self { middle, first: None, n: 0, sum_s: 0.0, sum_s2: 0.0, sum_rad: zero, sum_s_rad: zero }
    }

    pub fn add(&mut self, stamp: Stamp, travel_rad: &JointAngles, sensors: &ArmSensors) {
        let first = *self.first.get_or_insert(*travel_rad);
        let s = stamp.since_s(self.middle);
        self.n += 1;
        self.sum_s += s;
        self.sum_s2 += s * s;
        for (joint, model) in sensors.models.iter().enumerate() {
            let moved_rad = apart_rad(&model.spec, travel_rad[joint], first[joint]);
            self.sum_rad[joint] += moved_rad;
            self.sum_s_rad[joint] += s * moved_rad;
        }
    }

    /// Returns the rate, rad/s; zero with too few readings, or if all have one time.
    pub fn rad_s(&self, n_joints: usize) -> JointAngles {
        let spread_s2 = self.sum_s2 - self.sum_s * self.sum_s / self.n.max(1) as f64;
        if self.n < MIN_READINGS_OF_RATE || spread_s2 <= 0.0 {
            return JointAngles::zeros(n_joints);
        }
        let mean_s = self.sum_s / self.n as f64;
        JointAngles::from_fn(n_joints, |j| (self.sum_s_rad[j] - mean_s * self.sum_rad[j]) / spread_s2)
    }
}

/// Returns the difference from travel `b` to travel `a`, the short way round the word.
pub(crate) fn apart_rad(spec: &JointSensorSpec, a: f64, b: f64) -> f64 {
    wrap_symmetric(a - b, (spec.wrap_counts / spec.counts_per_rad).abs())
}

impl MessageIndex<'_> {
    /// Returns the direction in which each joint moved to its rest over `mark`, at the mean travel `rest_rad`. The last
    /// readings before the mark that clearly differ decide it: -1 or 1, 0 if it has not moved for long. Appends the
    /// messages that decided it.
    pub(crate) fn approach(
        &self,
        mark: &Mark,
        rest_rad: &JointAngles,
        sensors: &ArmSensors,
        used: &mut Vec<usize>,
    ) -> [f64; MAX_JOINTS] {
        let before = &self.by_stamp[..self.by_stamp.partition_point(|(stamp, _)| *stamp < mark.start)];
        let readings = before.iter().rev().filter_map(|&(stamp, idx)| match &self.messages[idx].1 {
            Message::JointSensors(sample) => Some((stamp, idx, &sample.counts)),
            _ => None,
        });
        let near = readings.take_while(|(stamp, ..)| mark.start.since_s(*stamp) <= BACK_S);
        let travels = near.map(|(_, idx, counts)| (idx, counts));
        let rest = RestPose { travel_rad: rest_rad, sensors, rounding_counts: ROUNDING_COUNTS };
        rest.approach(travels, used, |counts, joint| sensors.models[joint].nominal_travel_rad(counts[joint]))
    }
}

/// Configuration in which an arm rests.
pub(crate) struct RestPose<'a> {
    /// Mean travel of its readings.
    pub travel_rad: &'a JointAngles,
    pub sensors: &'a ArmSensors,
    /// Standard deviation of the rounding of readings, counts.
    pub rounding_counts: f64,
}

impl RestPose<'_> {
    /// Returns the direction in which each joint moved here, from earlier `readings`, the latest first, each with its
    /// index. The last ones that clearly differ decide it: -1 or 1, 0 if it has not moved. Appends the readings that
    /// decided it.
    pub(crate) fn approach<R>(
        &self,
        readings: impl Iterator<Item = (usize, R)>,
        used: &mut Vec<usize>,
        travel_rad: impl Fn(&R, usize) -> f64,
    ) -> [f64; MAX_JOINTS] {
        let mut approach = [0.0; MAX_JOINTS];
        // Side of the earlier readings, and their number in a row.
        let mut seen = [(0.0, 0_usize, 0_usize); MAX_JOINTS];
        let mut left = self.sensors.models.len();
        for (idx, reading) in readings {
            if left == 0 {
                break;
            }
            for (joint, model) in self.sensors.models.iter().enumerate() {
                if approach[joint] != 0.0 {
                    continue;
                }
                let spec = &model.spec;
                let noise_rad = spec.noise_std_counts.hypot(self.rounding_counts) / spec.counts_per_rad.abs();
                let by_rad = apart_rad(spec, self.travel_rad[joint], travel_rad(&reading, joint));
                let side = if by_rad.abs() > CLEAR_SIGMAS * noise_rad { by_rad.signum() } else { 0.0 };
                let (side_before, n, idx_before) = seen[joint];
                let n = if side != 0.0 && side == side_before { n + 1 } else { 1 };
                if side != 0.0 && n >= CLEAR_READINGS {
                    approach[joint] = side;
                    left -= 1;
                    used.extend([idx_before, idx]);
                }
                seen[joint] = (side, n, idx);
            }
        }
        approach
    }
}

#[cfg(test)]
mod tests;
