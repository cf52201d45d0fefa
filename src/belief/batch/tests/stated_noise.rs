//! A corner noise that robot.toml states far too small is named, not the arm or the map.

use crate::batch::tests::failures::{Case, case};
use crate::say::refusal::Refusal;
use crate::views::view::{TagMeasurement, View};

/// Error of a case's corners, averaged over its five frames, px.
const CORNER_PX: f64 = 0.3 / 2.236;

/// The case as single frames, whose noise only robot.toml states.
fn of_single_frames(seed: u64, stated_px: f64) -> Case {
    let mut case = case(seed, None);
    case.robot.camera.corner_std_px = stated_px;
    for seen in case.views.iter_mut().flat_map(|view: &mut View| &mut view.tags) {
        if let TagMeasurement::Corners(corners) = &mut seen.measured {
            (corners.n_frames, corners.scatter_px2) = (1, 0.0);
        }
    }
    case
}

#[test]
fn a_corner_noise_that_is_stated_ten_times_too_small_is_named_with_its_size() {
    for seed in 50..53 {
        let calibration = of_single_frames(seed, 0.1 * CORNER_PX).calibrated();
        match calibration.refusals.first() {
            Some(Refusal::CornerNoiseUnderstated { residual_px, .. }) => {
                assert!((residual_px / CORNER_PX - 1.0).abs() < 0.3, "seed {seed}: {residual_px} px");
            }
            other => panic!("seed {seed}: {other:?}"),
        }
    }
}

#[test]
fn a_corner_noise_that_is_stated_right_is_not_blamed() {
    for seed in 50..53 {
        let calibration = of_single_frames(seed, CORNER_PX).calibrated();
        let is_blamed = |refusal: &Refusal| matches!(refusal, Refusal::CornerNoiseUnderstated { .. });
        assert!(!calibration.refusals.iter().any(is_blamed), "seed {seed}");
    }
}
