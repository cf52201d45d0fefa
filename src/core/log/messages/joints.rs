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

/// Joint names of a topic's first message; `None` before it.
pub(in crate::log) type FirstNames = Option<Vec<String>>;

/// sensor_msgs/msg/JointState; position in rad, or in raw counts on `/joint_sensors` and `/joint_commands`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Stamp of the readings or set-points; the frame is empty.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// One number per name.
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

/// Encodes one position per joint into `out`, whose former content goes.
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

/// Stamp and one finite position per joint. The first message sets `names`; later ones must have the same.
pub(in crate::log) fn decode(bytes: &[u8], names: &mut FirstNames) -> Result<(Stamp, Vec<f64>), DecodeRejection> {
    let joints: JointStateIn<'_> = cdr::decode(bytes)?;
    let n = joints.position.len();
    if n > MAX_JOINTS {
        return Err(DecodeRejection::TooManyJoints { got: n });
    }
    if n == 0 {
        return Err(DecodeRejection::NoJoints);
    }
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
    Ok((joints.stamp.try_into()?, joints.position))
}

/// The gripper as one joint, whose position is the gap between the jaws, m.
pub(in crate::log) fn gripper_to_ros(stamp: Stamp, opening_m: f64) -> Result<JointState, EncodeError> {
    Ok(JointState {
        header: Header::new(stamp, "")?,
        name: vec![GRIPPER_JOINT.to_owned()],
        position: vec![opening_m],
        ..JointState::default()
    })
}

/// Stamp and opening, m, of one joint with any name.
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
        let mut first = None;
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
    fn wrong_joint_count_is_refused() {
        let error = encode(Stamp::default(), &[1.0], &samples::header(), &mut Vec::new()).unwrap_err();
        assert!(matches!(error, EncodeError::JointCount { got: 1, expected: 3 }));
    }
}
