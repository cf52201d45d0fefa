//! Gradient and curvature compared with differences of the cost.

use nalgebra::DVector;
use rand::RngExt;

use crate::batch::tests::data::{
    Noise, Truth, normal, reference, rng, titan_watched_by_two, titan_with_gripper_tag, titan_with_taped_tags,
    titan_with_two_cameras, views, watched_titan,
};
use crate::model::blocks::Block;
use crate::model::estimated::Model;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::model::state::State;
use crate::solve::constants::levenberg_marquardt::{LOOSE, TIGHT};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::levenberg_marquardt::{solve, stepped, until};
use crate::solve::linearize::NormalEquations;
use crate::solve::model_for_views::model_for;
use crate::solve::problem::BundleProblem;
use crate::views::view::{TagMeasurement, View};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::{Loss, Outcome};
use armcal_core::robot::Robot;

struct Case {
    robot: Robot,
    views: Vec<View>,
    model: Model,
    scales: Hyperparameters,
}

/// A case with all kinds of terms: corners, positions, poses, gripper tag, lens, clock.
fn case(robot: Robot, seed: u64) -> Case {
    let mut rng = rng(seed, "equations");
    let mut scales = Hyperparameters::datasheet(&robot);
    scales.camera_error_std = Some([0.003, 0.004]);
    let blocks = Block::all(&robot).filter(|block| *block != Block::GripperTag || robot.gripper_tag.is_some());
    let mut model = Model::of_blocks(robot.n_joints(), blocks);
    model.n_links = robot.n_joints();
    model.n_compliant = if robot.is_watched() { 0 } else { robot.n_joints() };
    let truth = Truth::draw(&robot, &model, &scales, &mut rng);
    let noise = Noise { corner_px: 0.3, n_frames: 5, joint_rad: [1e-3; MAX_JOINTS] };
    let mut views = views(&robot, &truth, &noise, 10, &mut rng);
    model.joints = model_for(&robot, &views).joints;
    for (k, view) in views.iter_mut().enumerate() {
        for rate in view.rate_rad_s.iter_mut() {
            *rate = rng.random_range(-0.05..0.05);
        }
        for tag in &mut view.tags {
            let poses = robot.chain.link_poses(&truth.angles(
                &robot,
                &View {
                    conditions: reference(),
                    ..View::of_reading(0, armcal_core::time::SIMULATION_EPOCH, view.travel_rad)
                },
            ));
            let camera = robot.camera_at(view.camera);
            let tags_from_camera = poses.frame(&robot.tag_frame).inv_mul(&poses.frame(&camera.mount));
            match k % 3 {
                1 => tag.measured = TagMeasurement::Position,
                2 => tag.measured = TagMeasurement::Pose(tags_from_camera.inv_mul(&truth.tags[tag.tag_idx])),
                _ => {}
            }
        }
    }
    Case { robot, views, model, scales }
}

fn problem(case: &Case) -> BundleProblem<'_> {
    let guess = JointParameters { reference: reference(), ..JointParameters::default() };
    let input = BundleInput {
        robot: &case.robot,
        views: &case.views,
        model: case.model.clone(),
        scales: case.scales.clone(),
        guess,
        joint_prior: None,
        evidence: HyperparameterMode::Given,
    };
    BundleProblem::new(&input, input.prior())
}

/// A state near the prior's means, with the views' own parameters converged.
fn settled(problem: &BundleProblem<'_>, seed: u64) -> State {
    let mut rng = rng(seed, "state");
    let guess = JointParameters { reference: reference(), ..JointParameters::default() };
    let solved = solve(problem, problem.start(&guess), Loss::Square, LOOSE);
    let off = DVector::from_fn(problem.layout.n, |k, _| 0.3 * normal(&mut rng) / solved.normal.matrix[(k, k)].sqrt());
    let mut state = stepped(problem, &solved.state, &solved.normal, &off);
    let still = DVector::zeros(problem.layout.n);
    let mut normal = NormalEquations::new(problem);
    for _ in 0..30 {
        normal.update(problem, &state, Loss::Square);
        state = stepped(problem, &state, &normal, &still);
    }
    state
}

/// Only the priors are left, whose least cost is zero: no search may stop at a share of it.
#[test]
fn where_every_observation_is_rejected_the_search_ends_at_the_priors() {
    let case = case(titan_with_gripper_tag(), 0);
    let mut problem = problem(&case);
    let state = settled(&problem, 0);
    problem.observations.iter_mut().for_each(|observation| observation.is_used = false);
    let solved = solve(&problem, state, Loss::Square, TIGHT);
    assert!(solved.normal.cost < 1e-12 && solved.cost_initial > 1.0, "{} {}", solved.cost_initial, solved.normal.cost);
    assert!(solved.iterations < 20, "{} steps", solved.iterations);
    assert_eq!(solved.outcome, Outcome::Stalled);
}

fn cost(problem: &BundleProblem<'_>, state: &State) -> f64 {
    let mut normal = NormalEquations::new(problem);
    normal.update(problem, state, Loss::Square);
    normal.cost
}

#[test]
fn the_gradient_is_that_of_the_cost_for_each_column() {
    has_the_costs_gradient(titan_with_gripper_tag);
}

#[test]
fn the_gradient_is_that_of_the_cost_before_a_camera_that_stands_still() {
    has_the_costs_gradient(watched_titan);
}

#[test]
fn the_gradient_is_that_of_the_cost_with_a_second_camera() {
    has_the_costs_gradient(titan_with_two_cameras);
    has_the_costs_gradient(titan_watched_by_two);
}

#[test]
fn the_gradient_is_that_of_the_cost_with_taped_distances() {
    has_the_costs_gradient(titan_with_taped_tags);
}

fn has_the_costs_gradient(robot: fn() -> Robot) {
    /// Step in units of a column's sigma with all others held; the difference quotient's own error is far smaller.
    const STEP: f64 = 1e-3;
    const TOLERANCE: f64 = 2e-3;
    for seed in 0..3 {
        let case = case(robot(), seed);
        let problem = problem(&case);
        let state = settled(&problem, seed);
        let mut normal = NormalEquations::new(&problem);
        normal.update(&problem, &state, Loss::Square);
        let mut largest = 0.0_f64;
        for column in 0..problem.layout.n {
            let sigma = normal.matrix[(column, column)].sqrt().recip();
            let at = |sign: f64| {
                let step =
                    DVector::from_fn(problem.layout.n, |k, _| if k == column { sign * STEP * sigma } else { 0.0 });
                cost(&problem, &stepped(&problem, &state, &normal, &step))
            };
            let numeric = (at(1.0) - at(-1.0)) / (2.0 * STEP);
            let analytic = -2.0 * normal.right[column] * sigma;
            largest = largest.max(analytic.abs());
            assert!(
                (numeric - analytic).abs() < TOLERANCE * (1.0 + analytic.abs()),
                "seed {seed}, column {column} of {}: {numeric} by differences, {analytic}",
                problem.layout.n
            );
        }
        assert!(largest > 0.1, "nothing pulls: the test would pass with any gradient");
    }
}

#[test]
fn the_curvature_is_that_of_the_cost_where_nothing_is_off() {
    /// Tolerance: residuals at the minimum add a little curvature to the Gauss-Newton matrix.
    const TOLERANCE: f64 = 0.03;
    let case = case(titan_with_gripper_tag(), 7);
    let problem = problem(&case);
    let guess = JointParameters { reference: reference(), ..JointParameters::default() };
    let stop = until(200, 1e-16);
    let solved = solve(&problem, problem.start(&guess), Loss::Square, stop);
    let n = problem.layout.n;
    let full = nalgebra::DMatrix::from_fn(n, n, |i, k| solved.normal.matrix[(i.max(k), i.min(k))]);
    let mut rng = rng(7, "directions");
    for _ in 0..60 {
        // A few columns at a time, so that each block matters in some step.
        let columns: Vec<usize> = (0..3).map(|_| rng.random_range(0..n)).collect();
        let step =
            DVector::from_fn(
                n,
                |k, _| {
                    if columns.contains(&k) { 0.3 * normal(&mut rng) / full[(k, k)].sqrt() } else { 0.0 }
                },
            );
        let expected = step.dot(&(&full * &step));
        let sum = cost(&problem, &stepped(&problem, &solved.state, &solved.normal, &step))
            + cost(&problem, &stepped(&problem, &solved.state, &solved.normal, &-&step));
        let found = 0.5 * (sum - 2.0 * solved.normal.cost);
        assert!((found - expected).abs() < TOLERANCE * expected, "{columns:?}: {found} for {expected}");
    }
}

/// Compares each cell with the change of the gradient: sensors, links, sag, mounts, clock, lens and tags, all by all.
#[test]
fn every_cell_of_the_curvature_is_that_of_the_gradient() {
    for robot in [titan_with_gripper_tag, watched_titan, titan_with_two_cameras, titan_with_taped_tags] {
        for camera_error_std in [None, Some([0.003, 0.004])] {
            has_the_gradients_curvature(robot(), camera_error_std);
        }
    }
}

fn has_the_gradients_curvature(robot: Robot, camera_error_std: Option<[f64; 2]>) {
    /// Step in units of a column's sigma with all others held.
    const STEP: f64 = 1e-3;
    /// Tolerance over the roots of both diagonals: residuals add a little curvature to the Gauss-Newton matrix.
    const TOLERANCE: f64 = 0.01;
    let mut case = case(robot, 7);
    (case.scales.camera_error_std, case.scales.time_jitter_std_s) = (camera_error_std, 0.02);
    let problem = problem(&case);
    let guess = JointParameters { reference: reference(), ..JointParameters::default() };
    let solved = solve(&problem, problem.start(&guess), Loss::Square, until(200, 1e-16));
    let n = problem.layout.n;
    let sigma = DVector::from_fn(n, |k, _| solved.normal.matrix[(k, k)].sqrt().recip());
    let mut normal = NormalEquations::new(&problem);
    let mut worst = (0.0, 0, 0);
    // Load times compliance adds curvature that the Gauss-Newton matrix does not have.
    let sag = problem.layout.sag.clone();
    let is_product = |row: usize, column: usize| row != column && row + 1 == sag.end && sag.contains(&column);
    for column in 0..n {
        let mut right = |sign: f64| {
            let step = DVector::from_fn(n, |k, _| if k == column { sign * STEP * sigma[k] } else { 0.0 });
            normal.update(&problem, &stepped(&problem, &solved.state, &solved.normal, &step), Loss::Square);
            normal.right.clone()
        };
        let change = (right(-1.0) - right(1.0)) / (2.0 * STEP);
        for row in (column..n).filter(|row| !is_product(*row, column)) {
            let off: f64 = change[row] * sigma[row] - solved.normal.matrix[(row, column)] * sigma[row] * sigma[column];
            if off.abs() > worst.0 {
                worst = (off.abs(), row, column);
            }
        }
    }
    println!("{n} columns, worst {worst:?}");
    assert!(worst.0 < TOLERANCE, "{worst:?} of {n} columns");
}

/// Linearizing again allocates only two vectors, regardless of the number of views and tags. They hold the distance of
/// the state from the prior's means, and the force of the prior.
#[test]
fn linearizing_again_takes_two_vectors_and_no_more() {
    let case = case(titan_with_gripper_tag(), 3);
    let problem = problem(&case);
    let guess = JointParameters { reference: reference(), ..JointParameters::default() };
    let start = problem.start(&guess);
    let mut normal = NormalEquations::new(&problem);
    normal.update(&problem, &start, Loss::Square);
    let again = allocation_counter::measure(|| normal.update(&problem, &start, Loss::Square));
    assert!(again.count_total <= 2 && again.count_current == 0, "{again:?}");
}
