//! Sensors that slip during a capture of the estimator's own model: found, named with time and size, and fitted.

use rand::RngExt;

use crate::calib::bundle::drawing::Drawing;
use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::failure_detection::FailureSearch;
use crate::calib::bundle::failures::{Failure, FailureAdjusted};
use crate::calib::bundle::input::HyperparameterMode;
use crate::calib::bundle::model::{Hyperparameters, model_for};
use crate::calib::bundle::model_selection::log_evidence;
use crate::calib::bundle::step_test::OffsetPrior;
use crate::calib::bundle::tests::data::{Noise, Truth, reference, rng, titan, views};
use crate::calib::parameters::JointParameters;
use crate::calib::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::sensor::ConditionChange;

struct Case {
    robot: Robot,
    truth: Truth,
    views: Vec<View>,
}

fn case(seed: u64, n_views: usize) -> Case {
    let robot = titan();
    let mut rng = rng(seed, "slips");
    let scales = Hyperparameters::datasheet(&robot);
    let noise = Noise { corner_px: 0.3, n_frames: 5, joint_rad: scales.joint_std_rad };
    let mut model = model_for(&robot, &[]);
    let drawn = Truth::draw(&robot, &model, &scales, &mut rng);
    model.joints = model_for(&robot, &views(&robot, &drawn, &noise, 6, &mut rng)).joints;
    let truth = Truth::draw(&robot, &model, &scales, &mut rng);
    let views = views(&robot, &truth, &noise, n_views, &mut rng);
    Case { robot, truth, views }
}

/// The sensor of `joint` turns by `by_rad` on its shaft before view `since`; the truth is that of the sensor since then.
fn slip(case: &mut Case, joint: usize, since: usize, by_rad: f64) {
    let sensors = case.truth.parameters.sensors(&case.robot);
    let sensor = &sensors.models[joint];
    for view in &mut case.views[..since] {
        let change = view.conditions.departure_from(&sensors.reference);
        let angle_rad = sensor.correction.angle_rad(&sensor.spec, view.travel_rad[joint], &change, 0.0);
        view.travel_rad[joint] = sensor.travel_under_rad(angle_rad - by_rad, &change);
    }
}

/// Of the step, under the true scales at the fit.
fn noncentrality(case: &Case, joint: usize, since: usize) -> f64 {
    let known = [Failure::slip(joint, 0.0, &case.views, since)];
    let applied = FailureAdjusted::new(&case.robot, &case.views, &known, &JointParameters::default());
    let found = applied.estimate(HyperparameterMode::Given).expect("solved");
    let (size_rad, std_rad) = found.step(joint, case.views[since].end).expect("a column");
    (size_rad / std_rad).powi(2)
}

fn found_failures(case: &Case) -> Vec<Failure> {
    let applied = FailureAdjusted::new(&case.robot, &case.views, &[], &JointParameters::default());
    let found = applied.estimate(HyperparameterMode::Fitted);
    FailureSearch { robot: &case.robot, views: &case.views, prior: None, drawing: &Drawing::default() }
        .failures(&[], found.as_ref())
}

/// Root mean square of the tool's error over the range of the views, m.
fn tool_error_m(case: &Case, found: &Estimate<'_>) -> f64 {
    const N: usize = 40;
    let mut rng = rng(0, "targets");
    let (robot, found, truth) = (&case.robot, found.parameters(), case.truth.parameters);
    // Both under the truth's conditions.
    let change = reference().departure_from(&found.reference);
    let mut squares = 0.0;
    for _ in 0..N {
        let travel = JointAngles::from_fn(robot.n_joints(), |j| {
            rng.random_range(-0.8..0.8) * robot.sensors[j].half_range_rad.min(1.3)
        });
        let tool = |parameters: &JointParameters, change: &ConditionChange| {
            let angles = JointAngles::from_fn(robot.n_joints(), |j| {
                let parameters = if j < robot.camera.mount.n_joints { parameters } else { &truth };
                parameters.correction(j).angle_rad(&robot.sensors[j], travel[j], change, 0.0)
            });
            robot.chain.link_poses(&angles).frame(&robot.tool.mount).translation.vector
        };
        squares += (tool(&found, &change) - tool(&truth, &ConditionChange::default())).norm_squared();
    }
    (squares / N as f64).sqrt()
}

#[test]
fn explore() {
    let n_seeds: u64 = std::env::var("SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(20);
    for n_views in [16, 26, 38] {
        for size_deg in [0.0_f64, 0.05, 0.1, 0.3, 1.0, 2.0, 5.0] {
            let (mut hits, mut others, mut misplaced, mut weak, mut all_central, mut ratios, mut sizes) =
                (0, 0, 0, 0, Vec::new(), Vec::new(), Vec::new());
            let start = std::time::Instant::now();
            for seed in 0..n_seeds {
                let mut case = case(seed, n_views);
                let joint = seed as usize % 5;
                let since = n_views / 4 + (7 * seed as usize) % (n_views / 2);
                let clean = {
                    let applied = FailureAdjusted::new(&case.robot, &case.views, &[], &JointParameters::default());
                    tool_error_m(&case, &applied.estimate(HyperparameterMode::Fitted).expect("solved"))
                };
                slip(&mut case, joint, since, size_deg.to_radians());
                let central = noncentrality(&case, joint, since);
                let failures = found_failures(&case);
                all_central.push(central);
                if failures.is_empty() && central > 60.0 {
                    weak += 1;
                    let fit = |known: &[Failure]| {
                        let applied =
                            FailureAdjusted::new(&case.robot, &case.views, known, &JointParameters::default());
                        let found = applied.estimate(HyperparameterMode::Fitted).expect("solved");
                        let order: Vec<usize> = (0..n_views).collect();
                        let at = found.likeliest_steps(&order, OffsetPrior::Datasheet);
                        let at: Vec<(usize, usize, f64, f64)> = at
                            .iter()
                            .map(|c| (c.joint, c.since, c.size_rad.to_degrees(), c.likelihood_ratio))
                            .collect();
                        (
                            log_evidence(&found),
                            at,
                            found.scales().joint_std_rad[joint],
                            found.scales().shape_std_rad[joint],
                            found.step(joint, case.views[since].end),
                        )
                    };
                    let (a, at, s0, h0, _) = fit(&[]);
                    let (b, _, s1, h1, step) = fit(&[Failure::slip(joint, 0.0, &case.views, since)]);
                    let lr = 2.0 * (b - a) + 2.0 * (0.1 / step.unwrap().1).ln();
                    println!(
                        "   seed {seed} {joint} {since} nc {central:.0} lr {lr:.1} step {step:.5?} std {s0:.6} -> {s1:.6} shape {h0:.5} -> {h1:.5} {at:.2?}"
                    );
                }
                if let [only] = &failures[..]
                    && only.joint == joint
                    && only.is_step()
                {
                    hits += 1;
                    misplaced += u64::from(only.since != Some(since));
                } else if !failures.is_empty() {
                    others += 1;
                    println!("   {n_views} {size_deg} seed {seed} joint {joint} since {since}: {failures:?}");
                }
                let applied = FailureAdjusted::new(&case.robot, &case.views, &failures, &JointParameters::default());
                let found = applied.estimate(HyperparameterMode::Fitted).expect("solved");
                if let Some((size, std)) = found.step(joint, case.views[since].end) {
                    sizes.push((size - size_deg.to_radians()) / std);
                }
                ratios.push(tool_error_m(&case, &found) / clean);
            }
            all_central.sort_by(f64::total_cmp);
            println!(
                "nc: min {:.0} median {:.0}, missed above 60: {weak}",
                all_central[0],
                all_central[all_central.len() / 2]
            );
            ratios.sort_by(f64::total_cmp);
            let rms = (sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len().max(1) as f64).sqrt();
            println!(
                "{n_views} views, {size_deg} deg: {hits} of {n_seeds}, {misplaced} misplaced, {others} others; tool \
                 ratio median {:.2} 90% {:.2}; size error {rms:.2} sigma; {:.0} ms",
                ratios[ratios.len() / 2],
                ratios[ratios.len() * 9 / 10],
                start.elapsed().as_secs_f64() / n_seeds as f64 * 1e3
            );
        }
    }
}
