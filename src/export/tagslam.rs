//! The tags of a calibration's map as TagSLAM's tagslam.yaml.

use armcal_core::codes::Code;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};

use crate::export::yaml_text::{double, quoted};
use armcal_belief::calib::Calibration;
use armcal_core::robot::FileIssue;

/// Standard deviation that TagSLAM gets for a tag that was held, m.
const HELD_M: f64 = 1e-4;
const HELD_RAD: f64 = 1e-5;

/// tagslam.yaml with the tags of `[map]` in the base frame of the arm: one static body with the base link's name.
/// `file` is the calibration's file, for messages.
///
/// # Errors
/// [`FileIssue`] for a calibration without a map, or a quaternion of length 0.
pub fn tagslam_map(file: &Path, calibration: &Calibration) -> Result<String, FileIssue> {
    let Some(map) = &calibration.map else {
        let problem = "is missing: the tags' places were surveyed, and this calibration has no others";
        return Err(FileIssue::new(Code::KeyMissing, file, "map", problem));
    };
    let frame = quoted(&map.frame);
    let mut text = format!("default_body: {frame}\nbodies:\n  - {frame}:\n      type: simple\n      is_static: true\n");
    text += "      tags:\n";
    for tag in &map.tag {
        let [w, x, y, z] = tag.quaternion_wxyz;
        let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6);
        let key = format!("map.tag {}: quaternion_wxyz", tag.id);
        let turn = turn
            .ok_or_else(|| FileIssue::new(Code::ValueInvalid, file, key, "is no rotation; its length must not be 0"))?;
        let _ = writeln!(text, "        - id: {}\n          size: {}\n          pose:", tag.id, double(tag.size_m));
        for (key, values) in [
            ("position", tag.position_m),
            ("rotation", turn.scaled_axis().into()),
            ("position_noise", tag.position_std_m.map(|std| std.max(HELD_M))),
            ("rotation_noise", tag.rotation_std_rad.map(|std| std.max(HELD_RAD))),
        ] {
            let [x, y, z] = values.map(double);
            let _ = writeln!(text, "            {key}: {{x: {x}, y: {y}, z: {z}}}");
        }
    }
    Ok(text)
}
