//! Arms with other cameras: a pinhole with distortion, a lens behind a flat port.

use crate::batch::tests::corner_outliers::tool_error;
use crate::batch::tests::data::titan;
use crate::batch::tests::statistics::{Case, case, input};
use crate::explain::drawing::Drawing;
use crate::explain::other_lens::{lens_that_fits, of_better_model};
use crate::explain::wrong_input::lens::of_other_model;
use crate::solve::estimate::estimate;
use crate::solve::input::HyperparameterMode;
use armcal_core::numeric::Outcome;
use armcal_core::optics::{CameraModel, Fisheye, FlatPort, LensModel, Radtan};
use armcal_core::robot::Robot;
use armcal_core::stats::quantile;

const N_VIEWS: usize = 25;
const SEEDS: std::ops::Range<u64> = 4000..4016;
const PORT: FlatPort = FlatPort { distance_m: 0.02, thickness_m: 0.01, glass_index: 1.49, water_index: 1.333 };

fn with_camera(lens: CameraModel) -> Robot {
    let mut robot = titan();
    robot.camera.lens = lens;
    robot
}

fn pinhole() -> CameraModel {
    Radtan::new([500.0, 501.0], [610.0, 515.0], [-0.12, 0.03, 5e-4, -3e-4, 0.0], [1224, 1024]).into()
}

/// The wrist camera's lens in air, behind a window.
fn ported() -> CameraModel {
    let lens = titan().camera.lens;
    let [fx, fy, cx, cy, k1, k2, k3, k4] = lens.intrinsics();
    CameraModel { port: Some(PORT), ..lens.with_intrinsics([fx / 1.333, fy / 1.333, cx, cy, k1, k2, k3, k4]) }
}

/// Median tool error over the seeds, m, and mean NEES, with views through `real` and the estimate's lens `known`.
fn errors(real: CameraModel, known: CameraModel) -> [f64; 2] {
    let (robot, believed) = (with_camera(real), with_camera(known));
    let of_seed = |seed| {
        let mut case = case(&robot, seed, N_VIEWS);
        case.robot = &believed;
        let found = estimate(&input(&case, &case.views, HyperparameterMode::Fitted)).expect("solved");
        let [square_m2, nees] = tool_error(&case, &found, seed);
        [square_m2.sqrt(), nees]
    };
    let all: Vec<[f64; 2]> = SEEDS.map(of_seed).collect();
    let median_m = quantile(&all.iter().map(|of| of[0]).collect::<Vec<f64>>(), 0.5).expect("seeds");
    [median_m, all.iter().map(|of| of[1]).sum::<f64>() / all.len() as f64]
}

#[test]
fn a_pinhole_with_distortion_serves_an_arm() {
    let [median_m, nees] = errors(pinhole(), pinhole());
    println!("pinhole with distortion: tool error {:.2} mm median, NEES {nees:.2}", 1e3 * median_m);
    assert!(median_m < 2e-3 && (1.8..4.5).contains(&nees), "{median_m} {nees}");
}

/// A lens measured in water attributes the window's effect to its focal length, which is right only near the axis.
#[test]
fn a_flat_port_is_no_bias_where_it_is_in_the_model() {
    let without = titan().camera.lens;
    let [with_m, nees] = errors(ported(), ported());
    let [without_m, biased] = errors(ported(), without);
    println!(
        "behind a flat port: tool error {:.2} mm median, NEES {nees:.2}; without it in the model {:.2} mm, {biased:.2}",
        1e3 * with_m,
        1e3 * without_m
    );
    assert!(with_m < 2e-3 && (1.8..4.5).contains(&nees), "{with_m} {nees}");
    assert!(without_m > 3.0 * with_m, "{without_m} {with_m}");
}

/// The centre is 30 px from robot.toml's: the lens must explain it, not the sensors' readings.
#[test]
fn a_centre_that_is_off_is_told_from_sensors_that_are() {
    let real = titan();
    let [fx, fy, cx, cy, k1, k2, k3, k4] = real.camera.lens.intrinsics();
    let other = with_camera(real.camera.lens.with_intrinsics([fx, fy, cx + 30.0, cy, k1, k2, k3, k4]));
    for seed in SEEDS.take(6) {
        let mut case = case(&real, seed, N_VIEWS);
        let lenses = |case: &Case<'_>| {
            let input = input(case, &case.views, HyperparameterMode::Fitted);
            let found = estimate(&input).expect("solved");
            lens_that_fits(&Drawing::default(), &input, &found).map(|drawing| drawing.lenses)
        };
        assert_eq!(lenses(&case), None, "seed {seed}: as it is");
        case.robot = &other;
        assert_eq!(lenses(&case), Some(vec![0]), "seed {seed}: another centre");
        case.robot = &real;
        case.views[7].travel_rad[1] += 0.3;
        assert_eq!(lenses(&case), None, "seed {seed}: a reading is off");
    }
}

/// The encoders' datasheet allows almost no error. A centre with a small error makes them vary from view to view by
/// more than that, but by less than wrong readings would.
#[test]
fn a_centre_that_makes_good_encoders_vary_is_told_from_them() {
    let mut real = titan();
    real.sensors.iter_mut().for_each(|spec| spec.linearity_std_rad = 2e-4);
    let [fx, fy, cx, cy, k1, k2, k3, k4] = real.camera.lens.intrinsics();
    let mut other = real.clone();
    other.camera.lens = real.camera.lens.with_intrinsics([fx, fy, cx + 20.0, cy, k1, k2, k3, k4]);
    for seed in SEEDS.take(6) {
        let mut case = case(&real, seed, N_VIEWS);
        let lenses = |case: &Case<'_>| {
            let input = input(case, &case.views, HyperparameterMode::Fitted);
            let found = estimate(&input).expect("solved");
            lens_that_fits(&Drawing::default(), &input, &found).map(|drawing| drawing.lenses)
        };
        assert_eq!(lenses(&case), None, "seed {seed}: as it is");
        case.robot = &other;
        assert_eq!(lenses(&case), Some(vec![0]), "seed {seed}: another centre");
    }
}

/// A pinhole that robot.toml calls equidistant, with its own numbers, and the reverse. A lens of the stated model with
/// a wrong centre must not count as one.
#[test]
fn a_lens_of_the_other_model_is_told_from_one_that_is_off() {
    let fisheye = titan().camera.lens;
    let off = |lens: CameraModel| {
        let [fx, fy, cx, cy, k1, k2, k3, k4] = lens.intrinsics();
        lens.with_intrinsics([fx, fy, cx + 15.0, cy, k1, k2, k3, k4])
    };
    let cases = [
        (pinhole(), of_other_model(&pinhole()), true),
        (pinhole(), off(pinhole()), false),
        (fisheye, of_other_model(&fisheye), true),
        (fisheye, off(fisheye), false),
    ];
    for (real, stated, is_other) in cases {
        let (robot, believed) = (with_camera(real), with_camera(stated));
        for seed in SEEDS.take(3) {
            let mut case = case(&robot, seed, N_VIEWS);
            case.robot = &believed;
            let mut input = input(&case, &case.views, HyperparameterMode::Fitted);
            Drawing { lenses: vec![0], ..Drawing::default() }.apply(&mut input);
            let found = of_better_model(&input, 0);
            assert_eq!(found.is_some(), is_other, "seed {seed}: {} as {}", real.name(), stated.name());
            assert!(found.is_none_or(|lens| lens.name() == real.name()), "seed {seed}");
        }
    }
}

/// The outermost corner of all views lies a little beyond the edge of robot.toml's field of view.
#[test]
fn a_corner_at_the_edge_of_the_field_of_view_is_no_wall() {
    for seed in 4000..4010 {
        let robot = titan();
        let mut case = case(&robot, seed, N_VIEWS);
        let corners = case.views.iter().flat_map(|view| &view.tags).filter_map(|tag| tag.corners());
        let angles = corners.flat_map(|seen| seen.corners_px).filter_map(|px| robot.camera.lens.unproject(&px.into()));
        let farthest_rad = angles.map(|bearing| bearing.z.acos()).fold(0.0, f64::max);
        let LensModel::Equidistant(lens) = robot.camera.lens.lens else { panic!("a fisheye") };
        let narrow = with_camera(Fisheye { max_view_angle_rad: farthest_rad - 1e-3, ..lens }.into());
        case.robot = &narrow;
        let found = estimate(&input(&case, &case.views, HyperparameterMode::Fitted)).expect("solved");
        assert!(found.outliers.is_empty(), "seed {seed}: {:?}", found.outliers);
        assert_eq!(found.solved.outcome, Outcome::Converged, "seed {seed}");
    }
}
