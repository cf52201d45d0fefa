//! Parameters that the data do not determine.

use crate::model::parameters::Parameter;
use armcal_core::robot::Robot;

/// Parameter that stays at its datasheet value, and the reason.
#[derive(Clone, Debug, PartialEq)]
pub struct Unobservable {
    /// Gain or offset of a joint.
    pub parameter: Parameter,
    /// End of a sentence about the parameter, for people.
    pub reason: String,
}

impl Unobservable {
    /// Returns the entry of a joint that lies between camera and tool.
    pub(crate) fn distal(parameter: Parameter) -> Self {
        Self { parameter, reason: "the joint is distal to the camera".to_owned() }
    }
}

/// Returns lines such as `wrist_rotate gain and offset: why`, one for each joint and reason.
pub(crate) fn grouped_names(robot: &Robot, unobservable: &[Unobservable]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut rest = unobservable.iter().peekable();
    while let Some(first) = rest.next() {
        let twin = |next: &&Unobservable| next.parameter.joint == first.parameter.joint && next.reason == first.reason;
        let name = first.parameter.name(robot);
        match rest.next_if(twin) {
            Some(_) => lines.push(format!("{name} and offset: {}", first.reason)),
            None => lines.push(format!("{name}: {}", first.reason)),
        }
    }
    lines
}
