//! Slow sensors of a recording: oil temperature and ambient pressure.

use std::collections::BTreeMap;

use super::error::{BadPlace, InputError};
use super::map::{ConditionKind, ConditionTopics, InputMap, NotFinite};
use super::stamp::TopicClock;
use crate::log::ros::{FluidPressure, Temperature};
use crate::log::{RawMessage, decode};
use crate::time::Stamp;

/// A reading of a slow sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConditionReading {
    /// The header's stamp, or the log time if the header has none.
    pub stamp: Stamp,
    /// Measured quantity, which decides the unit of `value`.
    pub kind: ConditionKind,
    /// The reading, finite.
    pub value: f64,
    /// Hash of the message's bytes.
    pub digest: [u8; 32],
}

/// Reads the messages of the topics in `[conditions]`.
pub(super) struct ConditionReader<'a> {
    file: &'a str,
    topics: &'a ConditionTopics,
    not_finite: NotFinite,
    clock: TopicClock,
    pub readings: Vec<ConditionReading>,
    pub left_out: u64,
    messages: BTreeMap<ConditionKind, u64>,
}

impl<'a> ConditionReader<'a> {
    pub fn new(file: &'a str, map: &InputMap, topics: &'a ConditionTopics) -> Self {
        let (not_finite, clock) = (map.not_finite, TopicClock::new(map.stamps));
        Self { file, topics, not_finite, clock, readings: Vec::new(), left_out: 0, messages: BTreeMap::new() }
    }

    /// Returns the quantity that `topic` holds by the input map.
    pub fn kind_of(&self, topic: &str) -> Option<ConditionKind> {
        self.topics.named().into_iter().find(|(name, _)| *name == topic).map(|(_, kind)| kind)
    }

    pub fn take(&mut self, raw: &RawMessage<'_>, kind: ConditionKind, digest: [u8; 32]) -> Result<(), InputError> {
        let n = self.messages.entry(kind).or_default();
        *n += 1;
        let place = BadPlace::Message { topic: raw.topic().to_owned(), message: *n };
        let decoded = match kind {
            ConditionKind::OilTemperature => {
                decode(raw.data).map(|m: Temperature| (m.header.stamp, "temperature", m.temperature))
            }
            ConditionKind::Pressure => {
                decode(raw.data).map(|m: FluidPressure| (m.header.stamp, "fluid_pressure", m.fluid_pressure))
            }
        };
        let file = || self.file.to_owned();
        let (stamp, field, value) =
            decoded.map_err(|error| InputError::Undecodable { file: file(), place: place.clone(), error })?;
        if !value.is_finite() {
            if self.not_finite == NotFinite::LeaveOut {
                self.left_out += 1;
                return Ok(());
            }
            return Err(InputError::NotFinite { file: file(), place, field, of: raw.topic().to_owned(), value });
        }
        let stamp = self.clock.read(stamp, raw.log_time());
        self.readings.push(ConditionReading { stamp, kind, value, digest });
        Ok(())
    }
}
