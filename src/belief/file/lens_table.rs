//! `[[lens]]` of calibration.toml.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::optics::CameraModel;
use armcal_core::robot::{CameraSpec, FileIssue, LensPriors};

/// Lens that was estimated because the views contradict its values in robot.toml.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LensResult {
    /// Name of the further camera; absent for `[camera]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// Focal lengths along both axes of the image, px.
    pub focal_px: [f64; 2],
    /// Optical centre, px.
    pub center_px: [f64; 2],
    /// First four distortion coefficients of robot.toml's lens model.
    pub distortion: [f64; 4],
    /// Standard deviation of the focal lengths, px.
    pub focal_std_px: [f64; 2],
    /// Standard deviation of the optical centre, px.
    pub center_std_px: [f64; 2],
    /// Standard deviation of each distortion coefficient.
    pub distortion_std: [f64; 4],
}

impl LensResult {
    pub(crate) fn new(camera: Option<String>, lens: &CameraModel, std: [f64; 8]) -> Self {
        let [fx, fy, cx, cy, a, b, c, d] = lens.intrinsics();
        Self {
            camera,
            focal_px: [fx, fy],
            center_px: [cx, cy],
            distortion: [a, b, c, d],
            focal_std_px: [std[0], std[1]],
            center_std_px: [std[2], std[3]],
            distortion_std: [std[4], std[5], std[6], std[7]],
        }
    }

    pub(crate) fn check(&self, file: &Path) -> Result<(), FileIssue> {
        let pixels = self.focal_px.map(|px| ("lens.focal_px", px, 1.0..=1e6)).into_iter();
        let center = self.center_px.map(|px| ("lens.center_px", px, -1e6..=1e6));
        let distortion = self.distortion.map(|k| ("lens.distortion", k, -1e3..=1e3));
        for (key, value, range) in pixels.chain(center).chain(distortion) {
            FileIssue::check_range(file, key, value, range)?;
        }
        Ok(())
    }

    /// Gives `camera` this lens, with the largest standard deviations over axes and coefficients.
    pub(crate) fn apply(&self, camera: &mut CameraSpec) {
        let ([fx, fy], [cx, cy], [a, b, c, d]) = (self.focal_px, self.center_px, self.distortion);
        camera.lens = camera.lens.with_intrinsics([fx, fy, cx, cy, a, b, c, d]);
        let largest = |std: &[f64]| std.iter().copied().fold(0.0, f64::max);
        camera.lens_priors = LensPriors {
            focal_std: largest(&[self.focal_std_px[0] / fx, self.focal_std_px[1] / fy]),
            center_std_px: largest(&self.center_std_px),
            distortion_std: largest(&self.distortion_std),
        };
    }
}

#[cfg(test)]
mod tests {
    use armcal_core::optics::Radtan;

    use super::*;

    fn lens(focal_px: f64) -> CameraModel {
        let distortion = [-0.12, 0.03, 5e-4, -3e-4, 0.01];
        Radtan::new([focal_px, focal_px + 1.0], [610.0, 515.0], distortion, [1224, 1024]).into()
    }

    #[test]
    fn a_lens_is_the_same_after_its_table() {
        let (nominal, found) = (lens(500.0), lens(510.0));
        let table = LensResult::new(Some("elbow".to_owned()), &found, [0.1; 8]);
        let read: LensResult = toml::from_str(&toml::to_string(&table).expect("it writes")).expect("it reads");
        assert_eq!(read, table);
        // The lens's field of view stays nominal, as in the estimate.
        let mut camera = CameraSpec { lens: nominal, ..crate::fixture::titan().camera };
        read.apply(&mut camera);
        assert_eq!(camera.lens.intrinsics(), found.intrinsics());
        assert_eq!(camera.lens_priors.center_std_px, 0.1);
    }

    #[test]
    fn a_focal_length_that_no_lens_has_is_refused() {
        let table = LensResult::new(None, &lens(500.0), [0.1; 8]);
        assert!(table.check(Path::new("calibration.toml")).is_ok());
        for spoilt in [0.0, -500.0, 1e9, f64::NAN, f64::INFINITY] {
            let wrong = LensResult { focal_px: [500.0, spoilt], ..table.clone() };
            assert!(wrong.check(Path::new("calibration.toml")).is_err(), "{spoilt}");
        }
    }
}
