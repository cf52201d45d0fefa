//! The selection against finite differences, dense posteriors, the estimate of `bundle`, and random poses.

use nalgebra::{Cholesky, DMatrix, Vector6};
use rand_chacha::ChaCha8Rng;

use crate::model::{Hyperparameters, JointParameters, ParameterKind};
use crate::plan::PlanError;
use crate::plan::view_planning::candidates::Candidate;
use crate::plan::view_planning::criterion::{DesignObjective, DesignState};
use crate::plan::view_planning::fixture::{Site, Truth, titan};
use crate::plan::view_planning::forecast::Task;
use crate::plan::view_planning::parameter_prior::{N_COMMON, ParameterPrior, WIDTH, basis, columns};
use crate::plan::view_planning::pool::{DesignInputs, PosePool};
use crate::plan::view_planning::view_information::{CornerModel, ViewJacobian};
use crate::plan::view_planning::{CapturedView, PlannedPose, PosePlan};
use crate::solve::covariance::ParameterCovariance;
use crate::solve::estimate::estimate;
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::model_for_views::model_for;
use armcal_core::optics::square_corners;
use armcal_core::robot::Robot;
use armcal_core::routine::PoseCriterion;
use armcal_core::spatial::{Pose, exp};
use armcal_core::stats::stream_rng;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

fn rng(seed: u64) -> ChaCha8Rng {
    stream_rng(seed, "plan")
}

/// Returns some candidates of the standard site.
fn pool(site: &Site, n: usize, seed: u64) -> PosePool {
    let clearance = site.clearance();
    PosePool::gather(&site.request(&clearance), n, &mut rng(seed)).expect("candidates")
}

/// Returns camera from tag with one parameter moved: joints by their basis, mount on the right, survey on the left of
/// all tags.
fn camera_from_tag(
    robot: &Robot,
    angles: &JointAngles,
    column: usize,
    by: f64,
    tag: usize,
) -> nalgebra::Isometry3<f64> {
    let n = robot.n_seen_joints();
    let mut moved = *angles;
    let (mut mount, mut survey) = (Vector6::zeros(), Vector6::zeros());
    if column < n * WIDTH {
        let joint = column / WIDTH;
        moved[joint] += basis(robot, joint, angles[joint])[column % WIDTH] * by;
    } else if column < n * WIDTH + 6 {
        mount[column - n * WIDTH] = by;
    } else {
        survey[column - n * WIDTH - 6] = by;
    }
    let mut arm = robot.clone();
    arm.camera.mount.link_from_frame *= exp(&mount);
    arm.tags_from_camera(&moved).inverse() * exp(&survey) * robot.tags[tag].base_from_tag.isometry()
}

/// The information on all columns, `G^T H G`, is compared with corners moved by finite differences.
#[test]
fn information_is_that_of_corners_moved_by_hand() {
    is_that_of_corners_moved_by_hand(&Site::titan());
}

#[test]
fn information_of_carried_tags_is_that_of_corners_moved_by_hand() {
    is_that_of_corners_moved_by_hand(&Site::watched());
}

fn is_that_of_corners_moved_by_hand(site: &Site) {
    let robot = &site.robot;
    let n = robot.n_seen_joints() * WIDTH + N_COMMON;
    let optics = CornerModel::new(1.0, 1.0);
    for candidate in pool(site, 12, 3).candidates() {
        let Candidate { angles, tags, .. } = candidate;
        let tag = tags[0].0;
        let look = ViewJacobian::new(robot, optics, angles, &[(tag, 1.0)]);
        let by_parameter = DMatrix::from_fn(6, n, |row, column| {
            let at = robot.n_seen_joints() * WIDTH;
            if column < at {
                look.twists[(row, column / WIDTH)] * look.basis[column / WIDTH][column % WIDTH]
            } else {
                look.twists[(row, MAX_JOINTS + column - at)]
            }
        });
        let info = by_parameter.tr_mul(&(look.sights[0].info * &by_parameter));
        let pixels = |column: usize, by: f64| {
            let pose = camera_from_tag(robot, angles, column, by, tag);
            square_corners(robot.tags[tag].size_m)
                .map(|corner| robot.camera.lens.project(&(pose * corner).coords).expect("in view"))
        };
        let step = 1e-6;
        let columns: Vec<DMatrix<f64>> = (0..n)
            .map(|column| {
                let (up, down) = (pixels(column, step), pixels(column, -step));
                DMatrix::from_fn(8, 1, |row, _| (up[row / 2][row % 2] - down[row / 2][row % 2]) / (2.0 * step))
            })
            .collect();
        // The weights come from the corner noise of the undisturbed view, because the information of each corner on the
        // camera's pose is not available.
        let weights =
            optics.corner_weights(robot, &camera_from_tag(robot, angles, 0, 0.0, tag), robot.tags[tag].size_m);
        let weights = weights.expect("in view");
        let scale = info.amax();
        for a in 0..n {
            for b in 0..=a {
                let dense: f64 = (0..8).map(|row| columns[a][row] * columns[b][row] * weights[row / 2]).sum();
                assert!((dense - info[(a, b)]).abs() < 1e-5 * scale, "{a} {b}: {dense} {}", info[(a, b)]);
            }
        }
    }
}

/// Updates by six rows equal the inverse of the summed information; gains equal the differences of values.
#[test]
fn updates_of_rank_six_are_the_dense_posterior() {
    let site = Site::titan();
    let clearance = site.clearance();
    let request = site.request(&clearance);
    let pool = pool(&site, 40, 4);
    let unknowns = ParameterPrior::of(&request);
    let n = unknowns.n();
    let Task { rows, floor_m2 } = Task::new(&request, &unknowns);
    let measures = [
        DesignObjective::of_tool(rows, floor_m2),
        DesignObjective::of_sensors(PoseCriterion::AOptimal, &unknowns),
        DesignObjective::of_sensors(PoseCriterion::DOptimal, &unknowns),
        DesignObjective::of_sensors(PoseCriterion::EOptimal, &unknowns),
    ];
    for measure in measures {
        let mut standing = DesignState::new(measure, &unknowns);
        let mut scratch = standing.scratch();
        let mut information = Cholesky::new(unknowns.covariance.clone()).expect("regular").inverse();
        for view in &pool.whitened_views(&request, &DesignInputs::new(&request))[..10] {
            let gain = standing.gain(view, &mut scratch);
            let before = standing.ln_value;
            standing.take(view, &mut scratch);
            assert!((before - standing.ln_value - gain).abs() < 1e-6 * gain.max(1e-3), "{before} {gain}");
            let at = unknowns.n_joints * WIDTH;
            let g = DMatrix::from_fn(6, n, |row, column| {
                if column < at {
                    view.twists[(row, column / WIDTH)] * view.basis[column / WIDTH][column % WIDTH]
                } else {
                    view.twists[(row, MAX_JOINTS + column - at)]
                }
            });
            information += g.tr_mul(&g);
        }
        let dense = Cholesky::new(information).expect("regular").inverse();
        for k in 0..n {
            for i in 0..n {
                let size = (dense[(k, k)] * dense[(i, i)]).sqrt();
                let off = (standing.covariance()[(i, k)] - dense[(i, k)]).abs();
                assert!(off < 1e-5 * size, "{i} {k}: {off} of {size}");
            }
        }
    }
}

#[test]
fn exchange_never_makes_it_worse_and_greedy_beats_any_order() {
    let mut site = Site::titan();
    for choose in [PoseCriterion::ToolError, PoseCriterion::DOptimal, PoseCriterion::AOptimal, PoseCriterion::EOptimal]
    {
        site.capture.criterion = choose;
        let clearance = site.clearance();
        let request = site.request(&clearance);
        for seed in 0..4 {
            let pool = pool(&site, 200, seed);
            let setup = DesignInputs::new(&request);
            let picker = pool.picker(&request, &setup);
            let greedy = picker.greedy(10);
            let before = picker.objective(&greedy);
            let exchanged = picker.exchanged(greedy);
            let after = picker.objective(&exchanged);
            assert!(after <= before + 1e-9, "{choose:?}: {before} {after}");
            let first: Vec<usize> = (0..10).collect();
            assert!(picker.ln_value(&exchanged.order) < picker.ln_value(&first), "{choose:?}");
        }
    }
}

/// The tool's variance is not submodular: the information of one view may need another. Stale gains then are no bounds,
/// but the selection is about as good.
#[test]
fn exchange_leaves_out_what_it_looked_at_before_and_chooses_the_same() {
    let site = Site::titan();
    let clearance = site.clearance();
    let request = site.request(&clearance);
    let mut n_exchanged = 0;
    for seed in 0..6 {
        let pool = pool(&site, 200, seed);
        let setup = DesignInputs::new(&request);
        let picker = pool.picker(&request, &setup);
        let greedy = picker.greedy(12);
        let [quick, plain] = [picker.exchanged(greedy.clone()), picker.exchanged_plainly(greedy.clone())];
        assert_eq!(quick.order, plain.order, "seed {seed}");
        n_exchanged += usize::from(quick.order != greedy.order);
    }
    assert!(n_exchanged > 2, "{n_exchanged}: hardly anything is exchanged");
}

#[test]
fn the_lazy_choice_is_worth_what_the_eager_one_is() {
    let site = Site::titan();
    let clearance = site.clearance();
    let request = site.request(&clearance);
    for seed in 0..5 {
        let pool = pool(&site, 150, seed);
        let setup = DesignInputs::new(&request);
        let picker = pool.picker(&request, &setup);
        let lazy = picker.ln_value(&picker.greedy(12).order);
        let eager = picker.ln_value(&picker.eager(12));
        assert!(lazy < eager + 0.15, "{lazy} {eager}");
    }
}

#[test]
fn the_same_seed_gives_the_same_plan_and_another_another() {
    let mut site = Site::titan();
    site.capture.poses = 8;
    let poses = |plan: PosePlan| plan.poses;
    for choose in [PoseCriterion::ToolError, PoseCriterion::Random] {
        let first = poses(site.plan(1, choose, 150).expect("a plan"));
        assert_eq!(first, poses(site.plan(1, choose, 150).expect("a plan")));
        assert_ne!(first, poses(site.plan(2, choose, 150).expect("a plan")));
    }
}

/// The forecast decides: it has each tag's own error and is not the criterion of the selection.
#[test]
fn chosen_poses_leave_less_tool_error_than_random_ones() {
    let mut site = Site::titan();
    site.capture.poses = 12;
    let mut ratios = Vec::new();
    for seed in 0..15 {
        let mut error = |choose| site.plan(seed, choose, 300).expect("a plan").predicted_tool_error_m;
        ratios.push(error(PoseCriterion::ToolError) / error(PoseCriterion::Random));
    }
    ratios.sort_by(f64::total_cmp);
    println!("12 chosen over 12 random: {:.2} {:.2} {:.2}", ratios[1], ratios[7], ratios[13]);
    assert!(ratios[7] < 0.8 && ratios[13] < 1.0, "{ratios:?}");
}

/// Views over the whole range determine the nonlinearity: chosen ones cover the angles that are safe to reach.
#[test]
fn chosen_poses_go_over_the_joints_ranges() {
    let mut site = Site::titan();
    let n = site.robot.camera.mount.n_joints;
    let range = |angles: &mut dyn Iterator<Item = f64>| {
        let (low, high) = angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(a), h.max(a)));
        high - low
    };
    let mut least: f64 = 1.0;
    for seed in 0..5 {
        let plan = site.plan(seed, PoseCriterion::ToolError, 600).expect("a plan");
        let all = pool(&site, 600, seed);
        for joint in 0..n {
            let chosen = range(&mut plan.poses.iter().map(|pose| pose.angles[joint]));
            // Reachable range: all but the outermost 1 % on either side.
            let mut reachable: Vec<f64> = all.candidates().iter().map(|candidate| candidate.angles[joint]).collect();
            reachable.sort_by(f64::total_cmp);
            let safe = reachable[593] - reachable[6];
            least = least.min(chosen / safe);
        }
    }
    println!("least share of a joint's reachable range that 30 chosen poses cover: {least:.2}");
    assert!(least > 0.8, "{least}");
}

#[test]
fn nothing_near_a_failed_pose_is_chosen_and_distrusted_tags_do_not_count() {
    let mut site = Site::titan();
    site.capture.poses = 10;
    let first = site.plan(1, PoseCriterion::ToolError, 200).expect("a plan");
    site.failed = first.poses.iter().map(|pose| pose.angles).collect();
    let second = site.plan(1, PoseCriterion::ToolError, 200).expect("a plan");
    let near = |a: &PlannedPose, b: &PlannedPose| (0..5).all(|j| (a.angles[j] - b.angles[j]).abs() < 0.1);
    assert!(second.poses.iter().all(|b| first.poses.iter().all(|a| !near(a, b))));
    site.detection_rate[2] = 0.0;
    let without = site.plan(1, PoseCriterion::ToolError, 200).expect("a plan");
    assert!(first.poses.iter().any(|pose| pose.tags.iter().any(|(tag, _)| *tag == 2)));
    assert!(without.poses.iter().all(|pose| pose.tags.iter().all(|(tag, _)| *tag != 2)));
}

/// If tags must be mapped first, at least every other view shows the tag whose pose is known.
#[test]
fn views_of_unknown_tags_hang_on_a_known_one() {
    let mut site = Site::titan();
    for tag in site.robot.tags.iter_mut().filter(|tag| tag.id != 0) {
        (tag.position_std_m, tag.rotation_std_rad) = (f64::INFINITY, f64::INFINITY);
    }
    site.capture.poses = 8;
    for choose in [PoseCriterion::ToolError, PoseCriterion::DOptimal] {
        let plan = site.plan(1, choose, 300).expect("a plan");
        let known = |pose: &&PlannedPose| pose.tags.iter().any(|(tag, p)| site.robot.tags[*tag].id == 0 && *p > 0.5);
        assert!(plan.poses.iter().filter(known).count() >= 4, "{choose:?}");
        assert!(plan.predicted_tool_error_m < 0.3 * plan.tool_error_before_m, "{}", plan.predicted_tool_error_m);
    }
}

/// If the capture replans soon, the first visits have the most information for their time, and fewer poses than
/// requested suffice.
#[test]
fn the_first_visits_tell_most_where_the_choice_is_renewed() {
    let mut site = Site::titan();
    let mut ratios = Vec::new();
    for seed in 0..7 {
        site.capture.replan_every = 0;
        let tour = site.plan(seed, PoseCriterion::ToolError, 200).expect("a plan");
        site.capture.replan_every = 4;
        let telling = site.plan(seed, PoseCriterion::ToolError, 200).expect("a plan");
        assert!((telling.predicted_tool_error_m / tour.predicted_tool_error_m - 1.0).abs() < 1e-6);
        ratios.push(telling.poses[3].predicted_tool_error_m / tour.poses[3].predicted_tool_error_m);
    }
    ratios.sort_by(f64::total_cmp);
    assert!(ratios[3] < 0.8, "{ratios:?}");
    assert_eq!(site.plan(1, PoseCriterion::ToolError, 20).expect("fewer").poses.len(), 20);
    site.capture.replan_every = 0;
    let error = site.plan(1, PoseCriterion::ToolError, 20).expect_err("20 are not 30");
    assert!(matches!(error, PlanError::TooFewPoses { found: 20, wanted: 30, .. }), "{error}");
}

#[test]
fn what_cannot_be_seen_is_said_with_what_could() {
    let mut site = Site::titan();
    site.robot.tags.truncate(3);
    site.detection_rate.truncate(3);
    site.robot.tags[2].base_from_tag = Pose::from_position_rpy([0.0, 0.0, 200.0], [0.0; 3]);
    let error = site.plan(1, PoseCriterion::ToolError, 50).expect_err("one of the three is far away");
    assert!(matches!(error, PlanError::NoUsefulPose { .. }), "{error}");
    let mut words = vec![error.to_string()];
    site.robot.tags.truncate(2);
    site.detection_rate.truncate(2);
    let error = site.plan(1, PoseCriterion::ToolError, 50).expect_err("two tags are not three");
    assert!(matches!(error, PlanError::TooFewTags { min_tags: 3, n_tags: 2 }), "{error}");
    site.robot.tags.clear();
    let error = site.plan(1, PoseCriterion::ToolError, 50).expect_err("no tags");
    assert!(matches!(error, PlanError::NoUsefulPose { .. }), "{error}");
    words.push(error.to_string());
    insta::assert_snapshot!("what_cannot_be_seen", words.join("\n"));
}

/// Captured views lower the prediction as planned ones do, and further views lower it again.
#[test]
fn views_taken_count_as_they_were_planned() {
    let site = Site::titan();
    let clearance = site.clearance();
    let mut request = site.request(&clearance);
    request.n_fit = 8;
    let plan = crate::plan::view_planning::choose_poses(&request, &mut rng(1)).expect("a plan");
    let taken: Vec<CapturedView> = plan
        .poses
        .iter()
        .map(|pose| CapturedView { angles: pose.angles, tags: pose.tags.iter().map(|(tag, _)| *tag).collect() })
        .collect();
    request.taken = &taken;
    request.n_fit = 2;
    let next = crate::plan::view_planning::choose_poses(&request, &mut rng(2)).expect("a plan");
    let ratio = next.tool_error_before_m / plan.predicted_tool_error_m;
    assert!((0.7..1.05).contains(&ratio), "{ratio}");
    assert!(next.predicted_tool_error_m < next.tool_error_before_m);
}

/// The forecast is within 25 % of the error that `bundle` predicts after the same views, in the median. It is 0.6 to
/// 1.6 times the true root mean square error.
#[test]
fn the_predicted_tool_error_is_what_bundle_finds() {
    predicts_what_bundle_finds(Site::titan());
}

#[test]
fn the_predicted_tool_error_before_a_camera_that_stands_still_is_what_bundle_finds() {
    predicts_what_bundle_finds(Site::watched());
}

fn predicts_what_bundle_finds(mut site: Site) {
    let robot = site.robot.clone();
    let scales = Hyperparameters::datasheet(&robot);
    let clearance = crate::plan::view_planning::fixture::clearance_of(&robot, &site.vehicle);
    for n_views in [6, 25] {
        site.capture.poses = n_views;
        let (mut by_bundle, mut planned2, mut true2) = (Vec::new(), 0.0, 0.0);
        for seed in 0..16 {
            let choose = if seed % 2 == 0 { PoseCriterion::ToolError } else { PoseCriterion::Random };
            let plan = site.plan(seed, choose, 200).expect("a plan");
            let mut rng = stream_rng(seed, "truth");
            let truth = Truth::draw(&robot, &scales, &mut rng);
            let views = truth.views(&clearance, &plan, &scales, &mut rng);
            let input = BundleInput {
                robot: &robot,
                views: &views,
                model: model_for(&robot, &views),
                scales: scales.clone(),
                guess: JointParameters::default(),
                joint_prior: None,
                evidence: HyperparameterMode::Given,
            };
            let found = estimate(&input).expect("solved");
            let covariance = ParameterCovariance {
                parameters: found.joint_parameters().to_vec(),
                matrix: found.joint_covariance(),
                residual_std_rad: Some(scales.joint_std_rad),
            };
            let sensors = found.parameters().sensors(&robot);
            let of_task =
                |f: &dyn Fn(&JointAngles) -> f64| site.task.iter().map(f).sum::<f64>() / site.task.len() as f64;
            let predicted2 = of_task(&|angles| covariance.tool_position_m2(&robot, &sensors, angles).trace());
            by_bundle.push(plan.predicted_tool_error_m / predicted2.sqrt());
            planned2 += plan.predicted_tool_error_m.powi(2);
            true2 += of_task(&|angles| truth.tool_error_m(&robot, &found.parameters(), angles).powi(2));
        }
        by_bundle.sort_by(f64::total_cmp);
        let (median, by_truth) = (0.5 * (by_bundle[7] + by_bundle[8]), (planned2 / true2).sqrt());
        println!(
            "{n_views} views: planned over bundle's own {:.2} {median:.2} {:.2}, over the true rms {by_truth:.2}",
            by_bundle[1], by_bundle[14]
        );
        assert!((0.75..1.25).contains(&median), "{n_views}: {median}");
        assert!((0.6..1.6).contains(&by_truth), "{n_views}: {by_truth}");
    }
}

/// The truths have the distribution of the priors.
#[test]
fn truths_are_drawn_from_the_priors() {
    let robot = titan();
    let scales = Hyperparameters::datasheet(&robot);
    let mut rng = rng(1);
    let (mut sum, mut n) = ([0.0; 2], 0.0);
    for _ in 0..300 {
        let truth = Truth::draw(&robot, &scales, &mut rng);
        for p in columns(5) {
            let nominal = JointParameters::default().get(p);
            let std = scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
            let off = (truth.parameters.get(p) - nominal) / std;
            sum[usize::from(matches!(p.kind, ParameterKind::Shape(_)))] += off * off;
            n += 1.0;
        }
    }
    let expected = [n * 2.0 / WIDTH as f64, n * (WIDTH - 2) as f64 / WIDTH as f64];
    assert!((sum[0] / expected[0] - 1.0).abs() < 0.1 && (sum[1] / expected[1] - 1.0).abs() < 0.1);
}
