//! Check that each joint has a recorded name of its own.

use super::InputMap;
use crate::robot::Robot;

impl InputMap {
    /// Describes two joints that share one recorded name. A joint distal to the camera that the map does not name may
    /// lack readings.
    pub(super) fn shared_name(&self, robot: &Robot) -> Option<String> {
        let joints = robot.joint_names();
        let is_read =
            |(k, joint): &(usize, &String)| *k < robot.n_seen_joints() || self.joint_names.contains_key(*joint);
        let read: Vec<&String> = joints.iter().enumerate().filter(is_read).map(|(_, joint)| joint).collect();
        let mut pairs = read.iter().enumerate().flat_map(|(k, &a)| read[k + 1..].iter().map(move |&b| (a, b)));
        let (a, b) = pairs.find(|(a, b)| self.recorded_name(a) == self.recorded_name(b))?;
        let name = self.recorded_name(a);
        Some(format!("gives `{a}` and `{b}` the same recorded name, `{name}`; name the readings of each joint"))
    }
}
