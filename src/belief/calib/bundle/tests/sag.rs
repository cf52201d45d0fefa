//! Arms that bend under their weight.

use nalgebra::Vector3;

use crate::calib::bundle::drawing::Drawing;
use crate::calib::bundle::estimate::estimate;
use crate::calib::bundle::input::BundleInput;
use crate::calib::bundle::tests::data::{normal, rng, titan};
use crate::calib::bundle::tests::drawing::{Case, case_changed, median, tool_errors_m};
use crate::calib::bundle::tests::score_test::{input, with_link};
use armcal_core::kinematics::Sag;
use armcal_core::robot::Robot;
use armcal_core::stats::quantile;

/// The drawing that explains the views best, step by step.
fn revised(input: &BundleInput<'_>) -> Drawing {
    let mut drawing = Drawing::default();
    for _ in 0..4 {
        let mut wider = input.clone();
        drawing.apply(&mut wider);
        let found = estimate(&wider).expect("solved");
        match drawing.better(&wider, &found, 0.0) {
            Some(better) => drawing = better,
            None => break,
        }
    }
    drawing
}

/// Each joint before the camera, and the base about its horizontal axes, gives by as much as `rad_per_nm`, half to one
/// and a half of it.
fn soft(robot: &Robot, rad_per_nm: f64, tool_load_n: f64, seed: u64) -> Sag {
    let mut rng = rng(seed, "soft");
    let mut draw = || rad_per_nm * (1.0 + 0.25 * normal(&mut rng)).clamp(0.5, 1.5);
    let mut sag = Sag { tool_load_n, ..Sag::default() };
    sag.joint_rad_per_nm[..robot.camera.mount.n_joints].fill_with(&mut draw);
    sag.mount_rad_per_nm = [draw(), draw(), 0.0];
    sag
}

fn soft_case(robot: &Robot, sag: Sag, seed: u64) -> Case {
    case_changed(robot, robot, seed, |truth| truth.parameters.links.sag = sag)
}

#[derive(Default)]
struct Errors {
    /// Tool errors m: the straight arm's, the soft one's without and with sag columns.
    good: Vec<f64>,
    plain: Vec<f64>,
    bent: Vec<f64>,
    n_named: usize,
    n_links: usize,
}

fn errors(robot: &Robot, seeds: u64, sag: impl Fn(u64) -> Sag) -> Errors {
    let mut errors = Errors::default();
    for seed in 0..seeds {
        let straight = soft_case(robot, Sag::default(), seed);
        let found = estimate(&input(robot, &straight.views, &straight.model)).expect("solved");
        errors.good.extend(tool_errors_m(robot, &straight.truth, robot, &found, seed));
        let case = soft_case(robot, sag(seed), seed);
        let as_drawn = input(robot, &case.views, &case.model);
        let first = estimate(&as_drawn).expect("solved");
        errors.plain.extend(tool_errors_m(robot, &case.truth, robot, &first, seed));
        let drawing = revised(&as_drawn);
        let mut wider = as_drawn.clone();
        drawing.apply(&mut wider);
        let found = estimate(&wider).expect("solved");
        errors.bent.extend(tool_errors_m(robot, &case.truth, robot, &found, seed));
        errors.n_named += usize::from(drawing.sag.is_some());
        errors.n_links += usize::from(drawing.links.is_some());
    }
    errors
}

#[test]
fn a_soft_arm_is_as_good_as_a_stiff_one() {
    let robot = titan();
    for (rad_per_nm, load_n) in [(3e-6, 0.0), (1e-5, 0.0), (3e-5, 0.0), (3e-6, 500.0), (1e-5, 500.0)] {
        let Errors { good, plain, bent, n_named, n_links } =
            errors(&robot, 20, |seed| soft(&robot, rad_per_nm, load_n, seed));
        let of = |errors: &[f64]| [0.5, 0.95].map(|q| 1e3 * quantile(errors, q).expect("values"));
        println!(
            "{rad_per_nm:.0e} rad/(N m), {load_n} N: stiff {:.2?}, soft as drawn {:.2?}, with sag {:.2?} mm; sag {n_named}, links \
             {n_links} of 20",
            of(&good),
            of(&plain),
            of(&bent)
        );
    }
}
