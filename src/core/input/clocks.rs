//! Comparison of the camera's clock with that of the joints, and the remedy if they differ.

use crate::log::ros::Time;
use crate::time::{Stamp, utc};

/// Share of frames next to a joint reading below which the clocks are compared. Assumed: gaps in a recording are
/// shorter.
const FEW: f64 = 0.5;
/// Share of frames next to a reading above which another time source explains the gap. Assumed.
const NEARLY_ALL: f64 = 0.9;
/// Clocks that started at boot stay below this, s: ten years. Wall clocks count from 1970.
const LONGEST_UPTIME_S: f64 = 10.0 * 365.25 * 86_400.0;

/// Times of one stream's messages.
#[derive(Clone, Debug, Default)]
pub struct StreamTimes {
    /// Name of the topic.
    pub topic: String,
    /// The stamps that count, in any order.
    pub stamps: Vec<Stamp>,
    /// Log times of the same messages, in any order.
    pub log_times: Vec<Stamp>,
}

/// Keys of the input map that bring two clocks together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClockRemedy {
    /// `stamps = "log_time"`.
    LogTime,
    /// `clock_offset_s` of `[tags]`, s.
    Offset(f64),
    /// The recording shows no remedy.
    Unknown,
}

/// Clocks of two streams that differ.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockDoubt {
    /// Both clocks, their difference and the remedy.
    pub text: String,
    /// The key that the text names.
    pub remedy: ClockRemedy,
}

/// Returns the stamp of the header at the beginning of a CDR message, or `skip` bytes after it.
#[must_use]
pub fn header_stamp(data: &[u8], skip: usize) -> Option<Time> {
    let bytes = data.get(4 + skip..12 + skip)?;
    let (sec, nanosec): ([u8; 4], [u8; 4]) = (bytes[..4].try_into().ok()?, bytes[4..].try_into().ok()?);
    match data[1] {
        0 => Some(Time { sec: i32::from_be_bytes(sec), nanosec: u32::from_be_bytes(nanosec) }),
        _ => Some(Time { sec: i32::from_le_bytes(sec), nanosec: u32::from_le_bytes(nanosec) }),
    }
}

impl StreamTimes {
    fn sorted(mut self) -> Self {
        self.stamps.sort_unstable();
        self.log_times.sort_unstable();
        self
    }

    /// Describes the clock in words, by its first stamp.
    fn clock(&self, first: Stamp) -> String {
        let first_s = first.since_s(Stamp::default());
        if (0.0..LONGEST_UPTIME_S).contains(&first_s) {
            return format!("count from boot (first {first_s:.3} s)");
        }
        let nanos = u64::try_from(first.nanos).unwrap_or_default();
        format!("are wall-clock times (first {})", utc(nanos))
    }
}

/// The share of `frames` with a joint reading within `max_gap_s`; both sorted.
fn share_with_reading(frames: &[Stamp], readings: &[Stamp], offset_s: f64, max_gap_s: f64) -> f64 {
    let has_reading = |frame: &&Stamp| {
        let at = frame.plus_s(offset_s);
        let after = readings.partition_point(|reading| *reading < at);
        let neighbours = [after.checked_sub(1), Some(after)].into_iter().flatten();
        neighbours.filter_map(|idx| readings.get(idx)).any(|reading| reading.since_s(at).abs() <= max_gap_s)
    };
    frames.iter().filter(has_reading).count() as f64 / frames.len().max(1) as f64
}

/// Compares the clocks of two streams and finds the key of the input map that corrects them. `None` if most frames have
/// a reading. `None` also if the streams overlap in time and log times give most frames no reading.
#[must_use]
pub fn compare_clocks(gap_s: f64, joints: StreamTimes, tags: StreamTimes) -> Option<ClockDoubt> {
    let (joints, tags) = (joints.sorted(), tags.sorted());
    let (first_joint, first_tag) = (*joints.stamps.first()?, *tags.stamps.first()?);
    let (last_joint, last_tag) = (*joints.stamps.last()?, *tags.stamps.last()?);
    let share = share_with_reading(&tags.stamps, &joints.stamps, 0.0, gap_s);
    if share >= FEW {
        return None;
    }
    let n = tags.stamps.len();
    let by_log = share_with_reading(&tags.log_times, &joints.log_times, 0.0, gap_s);
    let offset_s = first_joint.since_s(first_tag);
    let by_offset = share_with_reading(&tags.stamps, &joints.stamps, offset_s, gap_s);
    let are_apart = last_tag.since_s(first_joint) < -gap_s || first_tag.since_s(last_joint) > gap_s;
    let count = |share: f64| (share * n as f64).round() as usize;
    let (todo, difference_s, remedy) = if by_log > NEARLY_ALL {
        let (first_tag_log, first_joint_log) = (*tags.log_times.first()?, *joints.log_times.first()?);
        let of_tags_s = first_tag_log.since_s(first_tag);
        let of_joints_s = first_joint_log.since_s(first_joint);
        let todo = format!(
            "By log time, {} of {n} frames have one: add the line stamps = \"log_time\" above the tables of the input \
             map",
            count(by_log)
        );
        (todo, of_tags_s - of_joints_s, ClockRemedy::LogTime)
    } else if are_apart && by_offset > NEARLY_ALL {
        let todo = format!(
            "If both streams began together, add clock_offset_s = {offset_s:.3} to [tags] of the input map: {} of {n} \
             frames then have one",
            count(by_offset)
        );
        (todo, offset_s, ClockRemedy::Offset(offset_s))
    } else if are_apart {
        let todo = "Neither log times nor one common start give them one: record both streams together, or set \
                    clock_offset_s in [tags] of the input map, the joints' clock less the camera's";
        (todo.to_owned(), offset_s, ClockRemedy::Unknown)
    } else {
        return None;
    };
    let text = format!(
        "the camera's stamps on {} {}, the joint readings' on {} {}: they differ by {:.3} s, so that {} of \
         {n} frames have no joint reading within max_gap_s = {gap_s} s. {todo}",
        tags.topic,
        tags.clock(first_tag),
        joints.topic,
        joints.clock(first_joint),
        difference_s.abs(),
        n - count(share),
    );
    Some(ClockDoubt { text, remedy })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the doubt about 20 poses, 4 s apart: the stamps begin at the two times given, the log times at the other
    /// two.
    fn told(stamps_s: [f64; 2], log_times_s: [f64; 2]) -> Option<String> {
        let from = |start_s: f64| (0..20).map(move |k| Stamp::default().plus_s(start_s + 4.0 * f64::from(k)));
        let stream = |k: usize, topic: &str| StreamTimes {
            topic: topic.to_owned(),
            stamps: from(stamps_s[k]).collect(),
            log_times: from(log_times_s[k]).collect(),
        };
        compare_clocks(0.5, stream(0, "/joint_states"), stream(1, "/tag_detections")).map(|doubt| doubt.text)
    }

    #[test]
    fn clocks_that_differ_are_named_with_their_difference_and_the_key_that_helps() {
        let wall_s = 1_790_000_000.0;
        assert_eq!(told([wall_s, wall_s + 0.2], [wall_s; 2]), None);
        // No clock has a reading at these times.
        assert_eq!(told([wall_s, wall_s + 2.0], [wall_s, wall_s + 2.0]), None);
        let cases = [
            ([wall_s, 12.3], [wall_s + 0.01, wall_s + 0.02]),
            ([845.25, wall_s], [wall_s; 2]),
            ([wall_s, wall_s - 7200.0], [wall_s; 2]),
            ([wall_s, wall_s + 2.0], [wall_s; 2]),
            ([wall_s, 12.3], [wall_s, 12.3]),
            ([wall_s, wall_s + 500.0], [wall_s, wall_s + 501.7]),
        ];
        let found = cases.map(|(stamps_s, log_times_s)| told(stamps_s, log_times_s).expect("other clocks"));
        insta::assert_snapshot!("clocks", found.join("\n"));
    }
}
