//! The camera's dome port as built: its offset from the lens's pupil.

use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};

use crate::spec::{CameraWorldSpec, PortKind};
use armcal_core::stats::stream_rng;

/// Draws the centre of a dome, camera frame, m; within half of its radius. `None` without a dome, or if it is centred
/// on the pupil.
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
    use crate::as_built::tests::assert_normal;
    use armcal_core::stats::Summary;

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
