//! Contents of a connection's topics, and the reading of their messages, for every protocol.

use crate::messages::{BOOL, Bool};
use crate::{Connection, Heard};
use armcal_core::log::ros::JointState;
use armcal_core::log::{Stream, decode};
use armcal_core::streams::{JointCounts, JointSensorSample};
use armcal_core::time::Stamp;

/// Largest number of names that are listed from a message; `MAX_NAME_CHARS` is the largest number of characters of
/// each.
const MAX_LISTED: usize = 20;
const MAX_NAME_CHARS: usize = 40;

/// Content of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    Joints,
    Stream(Stream),
    Deadman,
}

impl Content {
    pub fn ros_type(self) -> &'static str {
        match self {
            Self::Joints => Stream::JointSensors.schema().name,
            Self::Stream(stream) => stream.schema().name,
            Self::Deadman => BOOL,
        }
    }
}

/// Returns every content that is heard of an arm, with its topic.
pub(crate) fn contents(connection: &Connection) -> Vec<(Content, &str)> {
    let mut all = vec![(Content::Joints, connection.joint_sensors.as_str())];
    all.extend(streams(connection).into_iter().map(|(stream, topic)| (Content::Stream(stream), topic)));
    all.extend(connection.deadman.as_ref().map(|deadman| (Content::Deadman, deadman.topic.as_str())));
    all
}

/// Returns the streams other than the joint readings, with their topics.
pub(crate) fn streams(connection: &Connection) -> Vec<(Stream, &str)> {
    let all = [
        (Stream::Detections, connection.detections.as_str()),
        (Stream::Images, &connection.images),
        (Stream::OilTemperature, &connection.oil_temperature),
        (Stream::WaterTemperature, &connection.water_temperature),
        (Stream::DepthPressure, &connection.pressure),
        (Stream::VehicleImu, &connection.imu),
    ];
    all.into_iter().filter(|(_, topic)| !topic.is_empty()).collect()
}

/// Reads and checks a message in CDR; `names` are the driver's, in the robot's order of joints.
pub(crate) fn read(content: Content, bytes: &[u8], names: &[String]) -> Heard {
    match content {
        Content::Joints => joints(bytes, names).map_or_else(Heard::Unusable, Heard::Joints),
        Content::Stream(stream) => stream
            .decode_alone(bytes)
            .map_or_else(|error| Heard::Unusable(format!("{}: {error}", stream.topic())), Heard::Other),
        Content::Deadman => decode::<Bool>(bytes).map_or_else(
            |error| Heard::Unusable(format!("the dead man's switch: {error}")),
            |held| Heard::Deadman(held.data),
        ),
    }
}

/// Reads joint readings and returns them in the robot's order.
fn joints(bytes: &[u8], names: &[String]) -> Result<JointSensorSample, String> {
    let message: JointState = decode(bytes).map_err(|error| format!("joint readings: {error}"))?;
    let stamp = Stamp::try_from(message.header.stamp).map_err(|error| format!("joint readings: {error}"))?;
    let mut counts = JointCounts::zeros(names.len());
    for (joint, name) in names.iter().enumerate() {
        let index = message.name.iter().position(|own| own == name);
        let position = index.and_then(|index| message.position.get(index)).copied();
        counts[joint] = position
            .filter(|position| position.is_finite())
            .ok_or_else(|| format!("joint readings: no finite position of {name} among {}", listed(&message.name)))?;
    }
    Ok(JointSensorSample { stamp, counts })
}

/// Returns the first names of a message, which may have very many and long ones.
fn listed(names: &[String]) -> String {
    let shown: Vec<String> =
        names.iter().take(MAX_LISTED).map(|name| name.chars().take(MAX_NAME_CHARS).collect()).collect();
    let further = names.len() - shown.len();
    if further == 0 { format!("{shown:?}") } else { format!("{shown:?} and {further} more") }
}

/// Returns the latest stamp of joint readings; `before` if none is later.
pub(crate) fn newest_stamp(heard: &[Heard], before: Stamp) -> Stamp {
    let stamps = heard.iter().filter_map(|heard| match heard {
        Heard::Joints(sample) => Some(sample.stamp),
        _ => None,
    });
    stamps.fold(before, Stamp::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::log::encode;
    use armcal_core::log::ros::{Header, Time};

    /// Readings of joints that nobody asked for.
    fn unusable(name: Vec<String>) -> String {
        let header = Header { stamp: Time { sec: 1, nanosec: 0 }, frame_id: String::new() };
        let position = vec![0.0; name.len()];
        let mut bytes = Vec::new();
        encode(&JointState { header, name, position, ..JointState::default() }, &mut bytes).expect("it is written");
        match read(Content::Joints, &bytes, &["elbow".to_owned()]) {
            Heard::Unusable(why) => why,
            heard => panic!("{heard:?}"),
        }
    }

    #[test]
    fn many_and_long_names_are_listed_in_part() {
        let numbered = |n: usize| (0..n).map(|k| format!("j{k}")).collect::<Vec<_>>();
        assert!(unusable(numbered(MAX_LISTED)).ends_with("\"j19\"]"));
        assert!(unusable(numbered(100_000)).ends_with("\"j19\"] and 99980 more"));
        let long = unusable(vec!["n".repeat(60_000); MAX_LISTED]);
        assert!(long.len() < MAX_LISTED * (MAX_NAME_CHARS + 4) + 100, "{} bytes", long.len());
    }
}
