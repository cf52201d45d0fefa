//! Common parts of the YAML formats.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use armcal_core::robot::{FileIssue, RobotError, syntax_code};
use armcal_core::text::with_nearest;

pub(super) fn parse<T: DeserializeOwned>(file: &Path, text: &str) -> Result<T, RobotError> {
    // Some editors leave tabs at the ends of lines and comments, which other parsers accept.
    let trimmed: Vec<&str> = text.lines().map(str::trim_end).collect();
    serde_saphyr::from_str(&trimmed.join("\n")).map_err(|error| {
        let message = with_nearest(&error.to_string());
        RobotError::Syntax { code: syntax_code(&message), file: file.to_owned(), message }
    })
}

/// Three coordinates: `x: .. y: .. z: ..`.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

impl Xyz {
    pub(super) fn array(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }
}

/// A pose in TagSLAM's form: the rotation is axis times angle, rad.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct PoseYaml {
    position: Xyz,
    rotation: Xyz,
    position_noise: Option<Xyz>,
    rotation_noise: Option<Xyz>,
}

impl PoseYaml {
    pub(super) fn pose(&self, file: &Path, key: &str) -> Result<Isometry3<f64>, RobotError> {
        let (position, rotation) = (self.position.array(), self.rotation.array());
        for (name, values, limit) in [("position", position, 1e6), ("rotation", rotation, 100.0)] {
            for value in values {
                FileIssue::check_range(file, &format!("{key}.{name}"), value, -limit..=limit)?;
            }
        }
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from(rotation));
        Ok(Isometry3::from_parts(Translation3::from(Vector3::from(position)), turn))
    }

    /// Standard deviations of translation and rotation; the defaults if none are stated.
    pub(super) fn std(&self, file: &Path, key: &str, defaults: (f64, f64)) -> Result<[f64; 6], RobotError> {
        let of = |noise: Option<Xyz>, default: f64| noise.map_or([default; 3], Xyz::array);
        let position = of(self.position_noise, defaults.0);
        let rotation = of(self.rotation_noise, defaults.1);
        for (name, values) in [("position_noise", position), ("rotation_noise", rotation)] {
            for value in values {
                FileIssue::check_range(file, &format!("{key}.{name}"), value, 0.0..=1e6)?;
            }
        }
        let [a, b, c] = position;
        let [d, e, f] = rotation;
        Ok([a, b, c, d, e, f])
    }
}
