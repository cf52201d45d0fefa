//! Messages of a recording that a replay shows, within a budget of memory.

use std::collections::BTreeMap;
use std::path::Path;

use armcal_core::log::{LogError, Recording, Stream, TopicMap, scan_recording};
use armcal_core::streams::Message;
use armcal_core::time::Stamp;

/// Largest memory of all kept messages, bytes.
const MAX_BYTES: usize = 160 << 20;
/// Memory after which the rate of repeated measurements halves each time, bytes: first after 20 minutes.
const HALVING_BYTES: usize = 24 << 20;
/// Spacing of one stream's messages after the first halving, s.
const SPACING_S: f64 = 0.019;

/// Reads the messages that a replay shows; of long recordings, a share. `left_in_file` of the result counts the rest,
/// including images.
///
/// # Errors
/// Errors of [`armcal_core::log::read_recording`].
pub fn read_for_replay(path: &Path) -> Result<Recording, LogError> {
    let mut thinning = Thinning::default();
    let (recording, _) =
        scan_recording(path, &TopicMap::default(), |_| {}, |log_time, message| thinning.keep(log_time, message))?;
    Ok(recording)
}

#[derive(Default)]
struct Thinning {
    bytes: usize,
    latest: BTreeMap<Stream, Stamp>,
}

impl Thinning {
    fn keep(&mut self, log_time: Stamp, message: &Message) -> bool {
        let bytes = bytes_of(message);
        if matches!(message, Message::Image(_)) || self.bytes + bytes > MAX_BYTES {
            return false;
        }
        let stream = Stream::of(message);
        let halvings = self.bytes / HALVING_BYTES;
        if halvings > 0 && is_series(message) {
            let spacing_s = SPACING_S * (1_u32 << (halvings - 1).min(20)) as f64;
            if self.latest.get(&stream).is_some_and(|latest| log_time.since_s(*latest).abs() < spacing_s) {
                return false;
            }
            self.latest.insert(stream, log_time);
        }
        self.bytes += bytes;
        true
    }
}

/// Returns the memory of a message and of the data that it points to.
pub(super) fn bytes_of(message: &Message) -> usize {
    let pointed = match message {
        Message::Detections(detections) => size_of_val(&detections.tags[..]),
        Message::Rejects(rejects) => size_of_val(&rejects.rejects[..]),
        Message::Task(task) => size_of_val(&task.targets_m[..]),
        Message::Survey(survey) => size_of_val(&survey.tags[..]),
        Message::Image(image) => image.jpeg.len(),
        Message::Log(line) => line.name.len() + line.text.len(),
        _ => 0,
    };
    size_of::<(Stamp, Message)>() + pointed
}

/// Returns true if the stream is a series of measurements, which may be thinned.
fn is_series(message: &Message) -> bool {
    !matches!(message, Message::Task(_) | Message::Survey(_) | Message::Touch(_) | Message::Mark(_) | Message::Log(_))
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::streams::{JointCounts, JointSensorSample, LogLevel, LogLine};
    use armcal_core::time::SIMULATION_EPOCH;

    #[test]
    fn long_recordings_are_thinned_and_end_within_the_budget() {
        let mut thinning = Thinning::default();
        let mut kept_by_hour = [0_u32; 24];
        for n in 0..24 * 360_000 {
            let stamp = SIMULATION_EPOCH.plus_s(0.01 * f64::from(n));
            let sample = JointSensorSample { stamp, counts: JointCounts::from_slice(&[1.0; 6]) };
            kept_by_hour[n as usize / 360_000] += u32::from(thinning.keep(stamp, &Message::JointSensors(sample)));
        }
        assert!(kept_by_hour[0] > 200_000 && kept_by_hour[0] < 360_000, "{kept_by_hour:?}");
        // The hours may differ by one message at their ends.
        assert!(kept_by_hour.is_sorted_by(|a, b| a + 1 >= *b) && kept_by_hour[23] > 10_000, "{kept_by_hour:?}");
        assert!(thinning.bytes < MAX_BYTES);
        let text = "x".repeat(1 << 20);
        let line = LogLine { stamp: SIMULATION_EPOCH, level: LogLevel::Info, name: String::new(), text };
        let kept = (0..1000).filter(|_| thinning.keep(SIMULATION_EPOCH, &Message::Log(line.clone()))).count();
        assert!(kept < 160 && thinning.bytes <= MAX_BYTES, "{kept}");
    }
}
