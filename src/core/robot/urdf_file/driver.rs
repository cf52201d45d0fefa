//! Offsets and reductions of `<ros2_control>` and `<transmission>`, which a driver applies before anything is recorded.
//!
//! ros-controls/ros2_control 53b9999: hardware_interface/src/component_parser.cpp, lines 71, 72 and 561 to 564, reads
//! `<offset>` and `<mechanical_reduction>` of a transmission's joint, lines 430 and 547 the free `<param>`s of a joint
//! and of its interfaces; transmission_interface/simple_transmission.hpp, line 265: joint = actuator / reduction +
//! offset, in rad (m of slides). A `<param name="offset">` has the unit and sign that its driver gives it.

use super::scan::Scan;
use crate::robot::xml_tree::XmlTree;

const APPLIED: &str = "the driver applies it: recorded angles have it in them, and armcal does not apply it again. \
    Take it out where an export of armcal replaces it";

/// Notes the joints whose readings a driver shifts or scales, below the element `at`.
pub(super) fn note_offsets(scan: &mut Scan<'_>, tree: &XmlTree, at: usize) {
    let mut open: Vec<(usize, Option<&str>)> = vec![(at, None)];
    while let Some((at, joint)) = open.pop() {
        let element = tree.element(at);
        let joint = if element.name == "joint" { element.attribute("name") } else { joint };
        if let Some(joint) = joint
            && let Some((what, usual)) = correction(element.name.as_str(), element.attribute("name"))
        {
            let written = element.text.trim();
            if written.parse::<f64>().ok() != Some(usual) {
                let written: String = written.chars().take(40).collect();
                // One text for all joints, because warnings are grouped by it.
                scan.skip(&format!("{what} = {written} of joint `{joint}`"), at, APPLIED.to_owned());
            }
        }
        open.extend(tree.children(at).map(|child| (child, joint)));
    }
}

/// Returns the correction that an element states, and its neutral value.
fn correction(element: &str, name: Option<&str>) -> Option<(&'static str, f64)> {
    match (element, name) {
        ("offset", _) | ("param", Some("offset")) => Some(("offset", 0.0)),
        ("mechanical_reduction" | "mechanicalReduction", _) => Some(("mechanical_reduction", 1.0)),
        _ => None,
    }
}
