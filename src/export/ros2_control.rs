//! A `<ros2_control>` block: each joint's sensor as a transmission.

use std::fmt::Write as _;

use quick_xml::escape::escape;

use crate::export::urdf_text::comment_text;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, SensorModel};

const HEAD: &str = "\
<!--
  Joint sensors as calibrated by armcal, for the URDF of the same robot. An actuator's position is the datasheet's
  angle, rad, by robot.toml: center_rad + wrap(reading - reading at center_rad) / (counts per rad). SimpleTransmission
  makes the calibrated angle of it: joint = actuator / mechanical_reduction + offset. The driver must apply neither gain
  nor offset itself. Name its plugin below.
";

/// The block for `robot` with `sensors`: one `transmission_interface/SimpleTransmission` per joint, whose actuator is
/// the datasheet's angle (rad). Its equation is `joint = actuator / mechanical_reduction + offset`. The sensor model is
/// `joint = center + gain (actuator - center) + offset_rad`, so these are `1 / gain` and `offset_rad + (1 - gain)
/// center`. The block omits terms beyond the straight line; its head names the joints.
#[must_use]
pub fn ros2_control(robot: &Robot, sensors: &ArmSensors) -> String {
    let mut text = HEAD.to_owned();
    if robot.first_slide().is_some() {
        text += "  Of prismatic joints all that is in rad is in m.\n";
    }
    for bent in joints_with_terms(sensors) {
        let _ = writeln!(text, "  Not in it: the terms of {} beyond gain and offset.", comment_text(bent));
    }
    let _ = writeln!(text, "-->\n<ros2_control name=\"{}\" type=\"system\">", escape(&robot.name));
    text += "  <hardware>\n    <plugin>my_arm_driver/ArmSystem</plugin>\n  </hardware>\n";
    for model in &sensors.models {
        let name = escape(&model.spec.joint);
        let _ = write!(
            text,
            "  <joint name=\"{name}\">\n    <command_interface name=\"position\"/>\n    \
             <state_interface name=\"position\"/>\n  </joint>\n"
        );
    }
    for (joint, model) in sensors.models.iter().enumerate() {
        text += &transmission(model, gain_over_datasheet(robot, joint, model));
    }
    text += "</ros2_control>\n";
    text
}

const OFFSETS_HEAD: &str = "\
<!--
  Joint offsets as calibrated by armcal, rad (m of prismatic joints), for a driver that reads this parameter of a joint
  and adds it: angle = angle by the datasheet + offset. Gains and terms are not in it.
-->
";

/// The joints of a `<ros2_control>` block with their offsets at mid-range as `<param name="offset">`, and in words the
/// parts that it omits.
#[must_use]
pub fn ros2_control_offsets(robot: &Robot, sensors: &ArmSensors) -> (String, Vec<String>) {
    let mut text = OFFSETS_HEAD.to_owned();
    let mut left_out = Vec::new();
    for (joint, model) in sensors.models.iter().enumerate() {
        let (name, offset) = (escape(&model.spec.joint), model.correction.offset_rad + 0.0);
        let _ = writeln!(text, "<joint name=\"{name}\">\n  <param name=\"offset\">{offset}</param>\n</joint>");
        left_out.extend(gain_in_words(robot, joint, model));
    }
    left_out.extend(joints_with_terms(sensors).map(|joint| format!("the terms of {joint}")));
    (text, left_out)
}

/// Relative difference below which a gain is the datasheet's.
const GAIN_WITHIN: f64 = 1e-9;

/// A joint's gain in words, where it differs from the datasheet's.
pub(super) fn gain_in_words(robot: &Robot, joint: usize, model: &SensorModel) -> Option<String> {
    let gain = gain_over_datasheet(robot, joint, model);
    let text = || format!("the gain of {}, {:+.3} %", model.spec.joint, 100.0 * (gain - 1.0));
    ((gain - 1.0).abs() > GAIN_WITHIN).then(text)
}

/// Names of the joints whose sensors are not a straight line.
pub fn joints_with_terms(sensors: &ArmSensors) -> impl Iterator<Item = &str> {
    let bent = sensors.models.iter().filter(|model| !model.correction.terms.are_zero());
    bent.map(|model| model.spec.joint.as_str())
}

/// Gain relative to robot.toml, for any scale of the model's own.
fn gain_over_datasheet(robot: &Robot, joint: usize, model: &SensorModel) -> f64 {
    model.correction.gain * robot.sensors[joint].counts_per_rad / model.spec.counts_per_rad
}

fn transmission(model: &SensorModel, gain: f64) -> String {
    let name = escape(&model.spec.joint);
    let (reduction, offset) = (1.0 / gain, model.correction.offset_rad + (1.0 - gain) * model.spec.center_rad);
    format!(
        "  <transmission name=\"{name}_sensor\">\n    <plugin>transmission_interface/SimpleTransmission</plugin>\n    \
         <actuator name=\"{name}_datasheet\" role=\"actuator1\"/>\n    <joint name=\"{name}\" role=\"joint1\">\n      \
         <mechanical_reduction>{reduction}</mechanical_reduction>\n      <offset>{offset}</offset>\n    </joint>\n  \
         </transmission>\n"
    )
}
