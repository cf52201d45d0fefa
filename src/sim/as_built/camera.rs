//! The camera's optics as built.

use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::spec::{CameraWorldSpec, PortKind};
use armcal_core::optics::Fisheye;
use armcal_core::stats::stream_rng;

/// A lens as built; its resolution and field of view are the drawing's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LensAsBuilt {
    pub focal_px: [f64; 2],
    pub center_px: [f64; 2],
    pub distortion: [f64; 4],
}

impl LensAsBuilt {
    /// `None` where nothing differs from the drawing.
    pub(super) fn draw(nominal: &Fisheye, spec: &CameraWorldSpec, seed: u64) -> Option<Self> {
        if spec.focal_std <= 0.0 && spec.center_std_px <= 0.0 && spec.distortion_std <= 0.0 {
            return None;
        }
        let normals = |what: &str, std: f64| {
            let mut rng = stream_rng(seed, &format!("as_built/lens/{what}"));
            [0; 4].map(|_| std * Distribution::<f64>::sample(&StandardNormal, &mut rng))
        };
        // One lens, square pixels: both axes err alike.
        let scale = 1.0 + normals("focal", spec.focal_std)[0];
        let [dx, dy, ..] = normals("center", spec.center_std_px);
        let mut bend = normals("distortion", spec.distortion_std);
        let mut built = Self {
            focal_px: nominal.focal_px.map(|focal| focal * scale),
            center_px: [nominal.center_px[0] + dx, nominal.center_px[1] + dy],
            distortion: nominal.distortion,
        };
        // A lens gives each direction a pixel of its own; a draw that would not is taken back by halves.
        for _ in 0..16 {
            built.distortion = std::array::from_fn(|k| nominal.distortion[k] + bend[k]);
            if built.applied(nominal).is_monotonic() {
                break;
            }
            bend = bend.map(|k| 0.5 * k);
        }
        Some(built)
    }

    pub(crate) fn applied(&self, nominal: &Fisheye) -> Fisheye {
        Fisheye { focal_px: self.focal_px, center_px: self.center_px, distortion: self.distortion, ..*nominal }
    }
}

/// Where a dome's centre lies, camera frame, m; kept within half of its radius. `None` without a dome or on the pupil.
pub(super) fn draw_dome_center(spec: &CameraWorldSpec, seed: u64) -> Option<[f64; 3]> {
    if spec.port != PortKind::Dome || spec.dome_decentre_std_m <= 0.0 {
        return None;
    }
    let mut rng = stream_rng(seed, "as_built/dome");
    let std_m = spec.dome_decentre_std_m;
    let center = Vector3::from_fn(|_, _| std_m * Distribution::<f64>::sample(&StandardNormal, &mut rng));
    Some(center.cap_magnitude(0.5 * spec.dome_radius_m).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::optics::fixture::lens;
    use armcal_core::stats::Summary;

    fn assert_normal(what: &str, samples: &[f64], std: f64) {
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let spread = (samples.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        assert!(mean.abs() < 4.0 * std / n.sqrt(), "{what}: mean {mean}");
        assert!((spread / std - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{what}: {spread} against {std}");
    }

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
            assert_normal("center", &column(&|l| l.center_px[k] - nominal.center_px[k]), 1.5);
        }
        for k in 0..4 {
            assert_normal("distortion", &column(&|l| l.distortion[k] - nominal.distortion[k]), 1e-4);
        }
        assert!(drawn.iter().all(|l| (l.focal_px[0] / 387.33 - l.focal_px[1] / 387.06).abs() < 1e-12));
        assert_eq!(LensAsBuilt::draw(&nominal, &CameraWorldSpec::default(), 1), None);
    }

    #[test]
    fn every_lens_keeps_one_pixel_a_direction() {
        let spec = CameraWorldSpec { distortion_std: 0.002, ..CameraWorldSpec::default() };
        let wide = Fisheye { max_view_angle_rad: 1.6, ..lens() };
        assert!(
            (0..2000)
                .all(|seed| { LensAsBuilt::draw(&wide, &spec, seed).expect("a lens").applied(&wide).is_monotonic() })
        );
    }

    #[test]
    fn domes_spread_as_asked_and_keep_the_pupil_inside() {
        let spec = CameraWorldSpec { port: PortKind::Dome, dome_decentre_std_m: 0.001, ..CameraWorldSpec::default() };
        let x: Vec<f64> = (0..4000).map(|seed| draw_dome_center(&spec, seed).expect("a dome")[0]).collect();
        assert_normal("dome", &x, 0.001);
        let wild = CameraWorldSpec { dome_decentre_std_m: 0.02, dome_radius_m: 0.01, ..spec };
        let far = (0..200).map(|seed| Vector3::from(draw_dome_center(&wild, seed).expect("a dome")).norm());
        assert!(Summary::of(&far.collect::<Vec<f64>>()).expect("samples").max <= 0.005 + 1e-12);
    }
}
