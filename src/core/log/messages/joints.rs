//! Readings, set-points and angles of the joints, and the opening of the gripper.

use serde::{Deserialize, Serialize};

use super::basic::{Header, Time};
use super::checks::finite;
use crate::joints::MAX_JOINTS;
use crate::log::cdr;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::time::Stamp;

/// Name of the one joint on the gripper's topics.
const GRIPPER_JOINT: &str = "gripper";

/// Properties of a topic's first message that all share: the joint names, and the positions of the numbers in the
/// bytes.
#[derive(Clone, Debug, Default)]
pub(in crate::log) struct FirstJoints {
    /// Names of the joints; `None` before the first message.
    pub(in crate::log) names: Option<Vec<String>>,
    layout: Option<Layout>,
}

/// Bytes of a message that differs from others of its topic only in stamp and positions: so names need not be read
/// again in each of millions.
#[derive(Clone, Debug)]
struct Layout {
    bytes: Vec<u8>,
    n_positions: usize,
}

impl Layout {
    /// Range of the stamp, after the encapsulation header.
    const STAMP: std::ops::Range<usize> = 4..12;
    /// Lengths of the empty velocities and efforts at the end of our own messages.
    const TAIL_BYTES: usize = 8;

    /// Returns the layout of a message that decodes to these positions; `None` if they have other places in the bytes.
    fn of(bytes: &[u8], position: &[f64]) -> Option<Self> {
        let layout = Self { bytes: bytes.to_vec(), n_positions: position.len() };
        let is_little_endian = bytes.starts_with(&[0, 1]);
        let (_, found) = layout.read(bytes).filter(|_| is_little_endian)?;
        (found == position).then_some(layout)
    }

    /// Returns stamp and positions of a message that is otherwise equal.
    fn read(&self, bytes: &[u8]) -> Option<(Time, Vec<f64>)> {
        let tail = bytes.len().checked_sub(Self::TAIL_BYTES)?;
        let start = tail.checked_sub(8 * self.n_positions).filter(|&start| start >= Self::STAMP.end)?;
        let is_alike = |range: std::ops::Range<usize>| bytes[range.clone()] == self.bytes[range];
        let is_same = bytes.len() == self.bytes.len()
            && is_alike(0..Self::STAMP.start)
            && is_alike(Self::STAMP.end..start)
            && is_alike(tail..bytes.len())
            && bytes[tail..] == [0; Self::TAIL_BYTES];
        let (stamp, positions) = (bytes[Self::STAMP].as_chunks::<4>().0, bytes[start..tail].as_chunks::<8>().0);
        let time = Time { sec: i32::from_le_bytes(stamp[0]), nanosec: u32::from_le_bytes(stamp[1]) };
        is_same.then(|| (time, positions.iter().map(|number| f64::from_le_bytes(*number)).collect()))
    }
}

/// sensor_msgs/msg/JointState; position in rad, or in raw counts on `/joint_sensors` and `/joint_commands`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Stamp of the readings or set-points; the frame is empty.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Positions, one per name.
    pub position: Vec<f64>,
    /// Empty in our recordings; not read.
    pub velocity: Vec<f64>,
    /// Empty in our recordings; not read.
    pub effort: Vec<f64>,
}

message!(
    JointState,
    "sensor_msgs/msg/JointState",
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    header!(),
);

/// [`JointState`] to write, from borrowed data: joint samples come a thousand times a second.
#[derive(Serialize)]
struct JointStateOut<'a> {
    stamp: Time,
    frame_id: &'a str,
    name: &'a [String],
    position: &'a [f64],
    velocity: &'a [f64],
    effort: &'a [f64],
}

/// [`JointState`] as read, with names that borrow from the file's bytes.
#[derive(Deserialize)]
struct JointStateIn<'a> {
    stamp: Time,
    #[serde(borrow)]
    _frame_id: &'a str,
    #[serde(borrow)]
    name: Vec<&'a str>,
    position: Vec<f64>,
    _velocity: Vec<f64>,
    _effort: Vec<f64>,
}

/// Encodes one position per joint into `out`, and replaces its content.
pub(in crate::log) fn encode(
    stamp: Stamp,
    position: &[f64],
    header: &RecordingHeader,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    let name = header.joint_names.as_slice();
    if position.len() != name.len() {
        return Err(EncodeError::JointCount { got: position.len(), expected: name.len() });
    }
    let stamp = stamp.try_into()?;
    let joints = JointStateOut { stamp, frame_id: "", name, position, velocity: &[], effort: &[] };
    Ok(cdr::encode(&joints, out)?)
}

/// Returns the stamp and one finite position per joint. The first message sets the names in `first`; later ones must
/// have the same.
pub(in crate::log) fn decode(bytes: &[u8], first: &mut FirstJoints) -> Result<(Stamp, Vec<f64>), DecodeRejection> {
    if let Some((stamp, position)) = first.layout.as_ref().and_then(|layout| layout.read(bytes)) {
        finite("position", position.iter().copied())?;
        return Ok((stamp.try_into()?, position));
    }
    let joints: JointStateIn<'_> = cdr::decode(bytes)?;
    let n = joints.position.len();
    if n > MAX_JOINTS {
        return Err(DecodeRejection::TooManyJoints { got: n });
    }
    if n == 0 {
        return Err(DecodeRejection::NoJoints);
    }
    let names = &mut first.names;
    if let Some(first) = names.as_ref().filter(|first| first.len() != n) {
        return Err(DecodeRejection::JointCount { got: n, expected: first.len() });
    }
    if joints.name.len() != n {
        return Err(DecodeRejection::NameCount { names: joints.name.len(), positions: n });
    }
    if names.as_ref().is_some_and(|first| *first != joints.name) {
        return Err(DecodeRejection::NamesChanged);
    }
    finite("position", joints.position.iter().copied())?;
    names.get_or_insert_with(|| joints.name.iter().map(|name| (*name).to_owned()).collect());
    if first.layout.is_none() {
        first.layout = Layout::of(bytes, &joints.position);
    }
    Ok((joints.stamp.try_into()?, joints.position))
}

/// Returns the gripper as one joint, whose position is the gap between the jaws, m.
pub(in crate::log) fn gripper_to_ros(stamp: Stamp, opening_m: f64) -> Result<JointState, EncodeError> {
    Ok(JointState {
        header: Header::new(stamp, "")?,
        name: vec![GRIPPER_JOINT.to_owned()],
        position: vec![opening_m],
        ..JointState::default()
    })
}

/// Returns stamp and opening, m, of one joint with any name.
pub(in crate::log) fn gripper_from_ros(m: &JointState) -> Result<(Stamp, f64), DecodeRejection> {
    let [opening_m] = m.position[..] else {
        return Err(DecodeRejection::JointCount { got: m.position.len(), expected: 1 });
    };
    finite("position", [opening_m])?;
    Ok((m.header.stamp.try_into()?, opening_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::samples;

    #[test]
    fn joint_names_and_count_are_fixed_by_the_first_message() {
        let mut first = FirstJoints::default();
        let mut decode = |names: &[&str], position: &[f64]| {
            let name = names.iter().map(|&name| name.into()).collect();
            let joints = JointState { name, position: position.to_vec(), ..Default::default() };
            let mut bytes = Vec::new();
            cdr::encode(&joints, &mut bytes).unwrap();
            decode(&bytes, &mut first).map(|(_, position)| position)
        };
        assert_eq!(decode(&["a", "b"], &[1.0, f64::NAN]), Err(DecodeRejection::NotFinite { field: "position" }));
        assert!(decode(&["a", "b"], &[1.0, 2.0]).is_ok());
        assert_eq!(decode(&["a"], &[1.0]), Err(DecodeRejection::JointCount { got: 1, expected: 2 }));
        assert_eq!(decode(&["a", "c"], &[1.0, 2.0]), Err(DecodeRejection::NamesChanged));
        assert_eq!(decode(&[], &[1.0, 2.0]), Err(DecodeRejection::NameCount { names: 0, positions: 2 }));
        assert_eq!(decode(&["a"; 9], &[0.0; 9]), Err(DecodeRejection::TooManyJoints { got: 9 }));
        assert_eq!(decode(&[], &[]), Err(DecodeRejection::NoJoints));
        assert!(decode(&["a", "b"], &[3.0, 4.0]).is_ok());
    }

    #[test]
    fn borrowed_joint_state_has_the_bytes_of_the_owned_one() {
        let header = samples::header();
        let stamp = Stamp { nanos: 1_500_000_000 };
        let mut borrowed = Vec::new();
        encode(stamp, &[1.0, 2.0, 3.0], &header, &mut borrowed).unwrap();
        let owned = JointState {
            header: Header::new(stamp, "").unwrap(),
            name: header.joint_names.clone(),
            position: vec![1.0, 2.0, 3.0],
            ..JointState::default()
        };
        let mut expected = Vec::new();
        cdr::encode(&owned, &mut expected).unwrap();
        assert_eq!(borrowed, expected);
    }

    #[test]
    fn a_known_layout_reads_what_decoding_reads_and_refuses_what_it_refuses() {
        let header = samples::header();
        let (mut bytes, mut first, stamp) = (Vec::new(), FirstJoints::default(), Stamp { nanos: 1_500_000_000 });
        encode(stamp, &[1.0, 2.0, 3.0], &header, &mut bytes).unwrap();
        decode(&bytes, &mut first).unwrap();
        assert!(first.layout.is_some());
        let slow = FirstJoints { layout: None, ..first.clone() };
        let mut n_read = 0;
        for bit in 0..8 * bytes.len() {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            let expected = decode(&changed, &mut slow.clone());
            n_read += u32::from(expected.is_ok());
            assert_eq!(decode(&changed, &mut first.clone()), expected, "bit {bit}");
            assert_eq!(decode(&changed[..bit / 8], &mut first.clone()), decode(&changed[..bit / 8], &mut slow.clone()));
        }
        assert!(n_read > 100);
    }

    #[test]
    fn wrong_joint_count_is_refused() {
        let error = encode(Stamp::default(), &[1.0], &samples::header(), &mut Vec::new()).unwrap_err();
        assert!(matches!(error, EncodeError::JointCount { got: 1, expected: 3 }));
    }
}
