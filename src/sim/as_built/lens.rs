//! The camera's lens as built.

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::spec::CameraWorldSpec;
use armcal_core::optics::CameraModel;
use armcal_core::stats::stream_rng;

/// Lens as built; its resolution and field of view are nominal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LensAsBuilt {
    /// Focal lengths along x and y.
    pub focal_px: [f64; 2],
    /// Principal point, x and y.
    pub center_px: [f64; 2],
    /// First four distortion coefficients.
    pub distortion: [f64; 4],
}

impl LensAsBuilt {
    /// Draws the lens; `None` if it equals the nominal model.
    pub(super) fn draw(nominal: &CameraModel, spec: &CameraWorldSpec, seed: u64) -> Option<Self> {
        if spec.focal_std <= 0.0 && spec.center_std_px <= 0.0 && spec.distortion_std <= 0.0 {
            return None;
        }
        let normals = |what: &str, std: f64| {
            let mut rng = stream_rng(seed, &format!("as_built/lens/{what}"));
            [0; 4].map(|_| std * Distribution::<f64>::sample(&StandardNormal, &mut rng))
        };
        // One lens with square pixels has the same error on both axes.
        let scale = 1.0 + normals("focal", spec.focal_std)[0];
        let [dx, dy, ..] = normals("center", spec.center_std_px);
        let mut bend = normals("distortion", spec.distortion_std);
        let [.., a, b, c, d] = nominal.intrinsics();
        let distortion = [a, b, c, d];
        let mut built = Self {
            focal_px: nominal.focal_px().map(|focal| focal * scale),
            center_px: [nominal.center_px()[0] + dx, nominal.center_px()[1] + dy],
            distortion,
        };
        // A lens gives each direction its own pixel; a draw that would not is reduced by halves.
        for _ in 0..16 {
            built.distortion = std::array::from_fn(|k| distortion[k] + bend[k]);
            if built.applied(nominal).is_monotonic() {
                break;
            }
            bend = bend.map(|k| 0.5 * k);
        }
        Some(built)
    }

    pub(crate) fn applied(&self, nominal: &CameraModel) -> CameraModel {
        let ([fx, fy], [cx, cy], [a, b, c, d]) = (self.focal_px, self.center_px, self.distortion);
        nominal.with_intrinsics([fx, fy, cx, cy, a, b, c, d])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::as_built::tests::assert_normal;
    use armcal_core::optics::Fisheye;
    use armcal_core::optics::fixture::{fisheye, lens};

    #[test]
    fn lenses_spread_as_asked() {
        let spec = CameraWorldSpec {
            focal_std: 0.002,
            center_std_px: 1.5,
            distortion_std: 1e-4,
            ..CameraWorldSpec::default()
        };
        let nominal = lens();
        let drawn: Vec<LensAsBuilt> =
            (0..4000).map(|seed| LensAsBuilt::draw(&nominal, &spec, seed).expect("a lens")).collect();
        let column = |f: &dyn Fn(&LensAsBuilt) -> f64| drawn.iter().map(f).collect::<Vec<f64>>();
        assert_normal("focal", &column(&|l| l.focal_px[0] / 387.33 - 1.0), 0.002);
        for k in 0..2 {
            assert_normal("center", &column(&|l| l.center_px[k] - nominal.center_px()[k]), 1.5);
        }
        for k in 0..4 {
            assert_normal("distortion", &column(&|l| l.distortion[k] - nominal.intrinsics()[4 + k]), 1e-4);
        }
        assert!(drawn.iter().all(|l| (l.focal_px[0] / 387.33 - l.focal_px[1] / 387.06).abs() < 1e-12));
        assert_eq!(LensAsBuilt::draw(&nominal, &CameraWorldSpec::default(), 1), None);
    }

    #[test]
    fn every_lens_keeps_one_pixel_a_direction() {
        let spec = CameraWorldSpec { distortion_std: 0.002, ..CameraWorldSpec::default() };
        let wide = Fisheye { max_view_angle_rad: 1.6, ..fisheye() }.into();
        assert!(
            (0..2000)
                .all(|seed| { LensAsBuilt::draw(&wide, &spec, seed).expect("a lens").applied(&wide).is_monotonic() })
        );
    }
}
