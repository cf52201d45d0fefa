//! Closed loops against the Bayesian Cramer-Rao bound of their views.
//!
//! The bound is the inverse of the priors' information plus that of the views, at the true gains, offsets, mount and
//! tags (van Trees 1968, 2.4.3). It comes from a twin of the capture with the same tags in the same views. The camera
//! is where the true sensors put it by the readings. Corners are exact, weighted by the true noise; priors are centred
//! on the truth. Its only unknowns are gains, offsets, mount and tags, so it holds in worlds restricted by
//! [`AS_MODELLED`]; other worlds have an error but no bound.

use std::fmt::Write as _;

use nalgebra::{DMatrix, DVector, Isometry3, Vector3};

use armcal_belief::calib::bundle::{BundleInput, HyperparameterMode, estimate};
use armcal_belief::calib::{
    Calibration, MeanCorners, ParameterCovariance, Status, TagMeasurement, TagObservation, View, associate, surveyed,
};
use armcal_belief::model::{Block, Hyperparameters, JointParameters, JointPrior, Model, Parameter, ParameterKind};
use armcal_belief::verify::{Belief, ReachRest, reaches};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::kinematics::LinkCorrections;
use armcal_core::log::Recording;
use armcal_core::optics::square_corners;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, ConditionChange};
use armcal_core::spatial::{Camera, Link, Pose};
use armcal_core::stats::{Interval, chi_square_quantile};
use armcal_core::streams::{JointAngles, ReachAttempt};
use armcal_core::time::Stamp;
use armcal_sim::truth::Truth;
use armcal_sim::{AsBuilt, JointAsBuilt, WorldSpec};

/// Settings of a routine that leave only gain, offset and noise as the sensors' errors.
pub const AS_MODELLED: [&str; 5] = [
    "world.joint_sensors.nonlinearity_peak=0.0",
    "world.joint_sensors.temperature_offset_std_rad_per_k=0.0",
    "world.joint_sensors.temperature_gain_std_per_k=0.0",
    "world.joint_sensors.drift_rad_per_sqrt_h=0.0",
    "world.joint_sensors.backlash_rad=0.0",
];

/// Squared tool errors at one target, m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundTarget {
    /// Number of the target, from 0.
    pub target_idx: usize,
    /// Squared distance of the estimated tool at rest from the true tool.
    pub at_rest_m2: f64,
    /// Prediction of `at_rest_m2` by the calibration's result.
    pub predicted_m2: f64,
    /// Squared error caused by the parameters, with the reading free of noise, and its bound; `None` in worlds without
    /// a bound.
    pub by_parameters_m2: Option<[f64; 2]>,
}

/// Comparison of one run with its bound.
#[derive(Clone, Debug)]
pub struct BoundRun {
    pub seed: u64,
    /// True if the calibration was accepted.
    pub is_accepted: bool,
    /// Contacts of the run.
    pub contacts: usize,
    /// Views that were fitted.
    pub views: usize,
    /// Targets reached after the calibration.
    pub targets: Vec<BoundTarget>,
}

/// A run's results and truth.
pub struct BoundInput<'a> {
    pub seed: u64,
    /// The robot with its nominal values.
    pub robot: &'a Robot,
    pub world: &'a WorldSpec,
    pub recording: &'a Recording,
    pub truth: &'a Truth,
    pub calibration: &'a Calibration,
}

/// Compares a run with its truth and, where the world has a bound, with the bound. Otherwise returns the reason that it
/// cannot.
///
/// # Errors
/// In words: a calibration of another robot, views that determine nothing.
pub fn bound_run(input: &BoundInput<'_>) -> Result<BoundRun, String> {
    let robot = &*surveyed(input.recording, input.robot);
    let data = associate(input.recording, robot);
    let views: Vec<View> = data.fit.into_iter().chain(data.held_out).collect();
    let built = &input.truth.header.as_built;
    let twin = has_bound(input.world).then(|| Twin::of(robot, input.world, built, &views)).transpose()?;
    let scaled = input.calibration.scaled_robot(robot);
    let sensors = input.calibration.sensors(&scaled).map_err(|error| error.to_string())?;
    let predicted = input.calibration.parameter_covariance(&scaled);
    let by = |sensors: &ArmSensors, links: LinkCorrections| {
        let belief = Belief { from: Stamp { nanos: i64::MIN }, sensors, links };
        reaches(input.recording, robot, &[belief]).into_iter().filter(|rest| rest.attempt == ReachAttempt::After)
    };
    let drawn = by(&ArmSensors::nominal(robot), LinkCorrections::default());
    let mut targets = Vec::new();
    for (rest, drawn) in by(&sensors, input.calibration.link_corrections()).zip(drawn) {
        let Some(at_rest) = off_m(&rest, input.truth) else { continue };
        let covariance = predicted.tool_position_under_m2(&scaled, &sensors, &rest.believed, &rest.conditions);
        targets.push(BoundTarget {
            target_idx: rest.target_idx,
            at_rest_m2: at_rest.norm_squared(),
            predicted_m2: covariance.trace(),
            by_parameters_m2: twin.as_ref().map(|twin| twin.at(&rest, &drawn)),
        });
    }
    let is_accepted = input.calibration.status == Status::Accepted;
    Ok(BoundRun { seed: input.seed, is_accepted, contacts: input.truth.contacts.len(), views: views.len(), targets })
}

/// True if gain, offset and noise are the sensors' only errors.
fn has_bound(world: &WorldSpec) -> bool {
    let sensors = &world.joint_sensors;
    let wrong = [
        sensors.nonlinearity_peak,
        sensors.temperature_offset_std_rad_per_k,
        sensors.temperature_gain_std_per_k,
        sensors.drift_rad_per_sqrt_h,
        sensors.backlash_rad,
    ];
    wrong.iter().all(|size| *size == 0.0)
}

fn off_m(rest: &ReachRest, truth: &Truth) -> Option<Vector3<f64>> {
    let state = truth.state_at(rest.start.plus_s(0.5 * rest.end.since_s(rest.start)))?;
    Some(rest.believed_tool.origin().vector() - state.base_from_tool.origin().vector())
}

/// The capture without errors, with priors centred on the truth.
struct Twin {
    /// The robot with its mount and tags as built.
    robot: Robot,
    sensors: ArmSensors,
    covariance: ParameterCovariance,
}

impl Twin {
    /// Builds the twin; `robot` has nominal values.
    fn of(robot: &Robot, world: &WorldSpec, built: &AsBuilt, views: &[View]) -> Result<Self, String> {
        let robot = as_built(robot, world, built);
        let parameters = true_parameters(&built.joints);
        let views: Vec<View> = views.iter().map(|view| exact_view(&robot, world, &parameters, view)).collect();
        let kinds = |joint: usize| match joint < robot.n_seen_joints() {
            true => vec![ParameterKind::Gain, ParameterKind::Offset],
            false => Vec::new(),
        };
        let blocks = [Block::Mount(0)].into_iter().chain(Block::tags(&robot));
        let joints = (0..robot.n_joints()).map(kinds).collect();
        let model = Model { joints, ..Model::of_blocks(0, blocks) };
        // Readings have no error but their noise.
        let scales = Hyperparameters { joint_std_rad: [EXACT_RAD; MAX_JOINTS], ..Hyperparameters::datasheet(&robot) };
        let columns: Vec<Parameter> = (0..robot.n_joints())
            .flat_map(|joint| kinds(joint).into_iter().map(move |kind| Parameter { joint, kind }))
            .collect();
        let mean = DVector::from_iterator(columns.len(), columns.iter().map(|p| parameters.get(*p)));
        let std = |p: &Parameter| scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
        let info = DVector::from_iterator(columns.len(), columns.iter().map(|p| std(p).powi(-2)));
        let joint_prior = Some(JointPrior::of_parameters(mean, DMatrix::from_diagonal(&info)));
        let evidence = HyperparameterMode::Given;
        let input =
            BundleInput { robot: &robot, views: &views, model, scales, guess: parameters, joint_prior, evidence };
        let found = estimate(&input).ok_or("the views determine nothing")?;
        let covariance = ParameterCovariance {
            parameters: found.joint_parameters().to_vec(),
            matrix: found.joint_covariance(),
            residual_std_rad: Some([0.0; MAX_JOINTS]),
        };
        let sensors = parameters.sensors(&robot);
        Ok(Self { robot, sensors, covariance })
    }

    /// Squared tool error at a rest caused by the parameters, and its bound. `drawn` has the rest's angles by the
    /// datasheet's sensors.
    fn at(&self, rest: &ReachRest, drawn: &ReachRest) -> [f64; 2] {
        let angles = JointAngles::from_fn(drawn.believed.len(), |joint| {
            let model = &self.sensors.models[joint];
            let travel_rad = drawn.believed[joint] - model.spec.center_rad;
            model.correction.angle_rad(&model.spec, travel_rad, &ConditionChange::default(), 0.0)
        });
        let tool = self.robot.chain.frame(&angles, &self.robot.tool.mount).translation.vector;
        let off = rest.believed_tool.origin().vector() - tool;
        [off.norm_squared(), self.covariance.tool_position_m2(&self.robot, &self.sensors, &angles).trace()]
    }
}

/// Standard deviation that counts as no joint error beyond the reading's noise, rad.
const EXACT_RAD: f64 = 1e-7;

/// The arm with its true mount, tags and reading noise; the standard deviations of mount and tags stay.
fn as_built(robot: &Robot, world: &WorldSpec, built: &AsBuilt) -> Robot {
    let mut robot = robot.clone();
    let mount: Pose<Link, Camera> = built.camera_mount.to_pose();
    robot.camera.mount.link_from_frame = *mount.isometry();
    for (tag, built) in robot.tags.iter_mut().zip(&built.tags) {
        tag.base_from_tag = built.pose.to_pose();
    }
    let sensors = &world.joint_sensors;
    // Rounding to a step has a uniform error over the step.
    let noise_counts = sensors.noise_rms_counts.hypot(sensors.resolution_counts / 12.0_f64.sqrt());
    robot.sensors.iter_mut().for_each(|sensor| sensor.noise_std_counts = noise_counts);
    robot
}

/// Returns the parameters that undo the sensors' errors: a datasheet's travel is `(1 + gain error) travel + offset
/// error`.
fn true_parameters(joints: &[JointAsBuilt]) -> JointParameters {
    let mut parameters = JointParameters::default();
    for (joint, built) in joints.iter().enumerate() {
        parameters.gain[joint] = 1.0 / (1.0 + built.gain_error);
        parameters.offset_rad[joint] = -built.offset_error_rad / (1.0 + built.gain_error);
    }
    parameters
}

/// The view with every tag where the true arm would see it.
fn exact_view(robot: &Robot, world: &WorldSpec, parameters: &JointParameters, view: &View) -> View {
    let still = ConditionChange::default();
    let angles = JointAngles::from_fn(robot.n_joints(), |joint| {
        parameters.correction(joint).angle_rad(&robot.sensors[joint], view.travel_rad[joint], &still, 0.0)
    });
    let camera_from_tags = robot.tags_from_camera(&angles).inverse();
    let tags = view.tags.iter().filter_map(|seen| {
        let tag = &robot.tags[seen.tag_idx];
        let camera_from_tag = camera_from_tags * tag.base_from_tag.isometry();
        let corners = exact_corners(robot, world, &camera_from_tag, (tag.size_m, seen.corners()?.n_frames))?;
        let center_in_camera_m = camera_from_tag.translation.vector;
        Some(TagObservation { center_in_camera_m, measured: TagMeasurement::Corners(corners), ..*seen })
    });
    View { tags: tags.collect(), ..view.clone() }
}

fn exact_corners(
    robot: &Robot,
    world: &WorldSpec,
    camera_from_tag: &Isometry3<f64>,
    (size_m, n_frames): (f64, usize),
) -> Option<MeanCorners> {
    let mut corners_px = [[0.0; 2]; 4];
    for (pixel, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
        let exact = robot.camera.lens.project(&(camera_from_tag * corner).coords)?;
        *pixel = [exact.x, exact.y];
    }
    let center = camera_from_tag.translation.vector;
    let cos_incidence = -(camera_from_tag.rotation * Vector3::z()).dot(&center) / center.norm();
    let std_px = world.camera.corner_noise_px * (0.8 + 0.2 * center.norm()) / cos_incidence.max(0.05).sqrt();
    // With this many degrees of freedom the stated noise, which counts too, hardly matters.
    let n_frames = n_frames.max(1);
    let dof = 8.0 * (n_frames - 1) as f64;
    let stated_px2 = STATED_DOF * robot.camera.corner_std_px.powi(2);
    Some(MeanCorners { corners_px, n_frames, scatter_px2: (STATED_DOF + dof) * std_px.powi(2) - stated_px2 })
}

/// Degrees of freedom that robot.toml's corner noise has in `bundle`; subtracted again so that only the true noise
/// counts.
const STATED_DOF: f64 = 16.0;

/// Figures of many runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundFigures {
    /// Error of the estimated tool at rest over all targets of all runs, rms, m; `predicted_m` is its prediction.
    pub at_rest_m: f64,
    pub predicted_m: f64,
    /// Error caused by the parameters and its bound, rms, m.
    pub by_parameters_m: Option<[f64; 2]>,
    /// Error over bound, with its 95 % interval; without a bound, error over prediction.
    pub ratio: f64,
    pub interval: Interval,
}

impl BoundFigures {
    /// Figures of `runs`; `None` if they have no targets.
    #[must_use]
    pub fn of(runs: &[BoundRun]) -> Option<Self> {
        let targets = || runs.iter().flat_map(|run| &run.targets);
        let n = targets().count();
        let rms = |of: &dyn Fn(&BoundTarget) -> f64| (targets().map(of).sum::<f64>() / n as f64).sqrt();
        let [at_rest_m, predicted_m] = [rms(&|target| target.at_rest_m2), rms(&|target| target.predicted_m2)];
        let side = |k: usize| rms(&|target| target.by_parameters_m2.map_or(0.0, |pair| pair[k]));
        let has_bound = targets().all(|target| target.by_parameters_m2.is_some());
        let by_parameters_m = has_bound.then(|| [side(0), side(1)]);
        let [error_m, least_m] = by_parameters_m.unwrap_or([at_rest_m, predicted_m]);
        let ratio = (n > 0).then_some(error_m / least_m)?;
        // Most of a bound comes from one or two unobservable directions, so a run has one degree of freedom.
        let at = |p: f64| ratio * (runs.len() as f64 / chi_square_quantile(p, runs.len())).sqrt();
        let interval = Interval { low: at(0.975), high: at(0.025) };
        Some(Self { at_rest_m, predicted_m, by_parameters_m, ratio, interval })
    }
}

/// Table with one row per world: its name and the figures of its runs.
#[must_use]
pub fn bound_table(worlds: &[(&str, &[BoundRun])]) -> String {
    let mut text = String::from(
        "| world | accepted | contacts | views | tool at rest, rms mm | predicted, rms mm \
         | by parameters alone, rms mm | bound, rms mm | error / bound (95 %) \
         | at rest / predicted |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for (name, runs) in worlds {
        let accepted = runs.iter().filter(|run| run.is_accepted).count();
        let contacts: usize = runs.iter().map(|run| run.contacts).sum();
        let views = runs.iter().map(|run| run.views).sum::<usize>() as f64 / runs.len().max(1) as f64;
        let _ = write!(text, "| {name} | {accepted} of {} | {contacts} | {views:.1} ", runs.len());
        let Some(figures) = BoundFigures::of(runs) else {
            text += "| | | | | | |\n";
            continue;
        };
        let _ = write!(text, "| {:.2} | {:.2} ", 1e3 * figures.at_rest_m, 1e3 * figures.predicted_m);
        let _ = match figures.by_parameters_m {
            Some([error_m, bound_m]) => write!(
                text,
                "| {:.2} | {:.2} | {:.2} ({:.2} .. {:.2}) ",
                1e3 * error_m,
                1e3 * bound_m,
                figures.ratio,
                figures.interval.low,
                figures.interval.high
            ),
            None => write!(text, "| | | "),
        };
        let _ = writeln!(text, "| {:.2} |", figures.at_rest_m / figures.predicted_m);
    }
    text
}

/// CSV with one row per target of each run.
#[must_use]
pub fn bound_csv(worlds: &[(&str, &[BoundRun])]) -> String {
    let mut text = "world,seed,accepted,target,at_rest_m,predicted_m,by_parameters_m,bound_m\n".to_owned();
    for (name, runs) in worlds {
        for run in *runs {
            for target in &run.targets {
                let BoundRun { seed, is_accepted, .. } = run;
                let [error, bound] = target.by_parameters_m2.map_or([f64::NAN; 2], |pair| pair.map(f64::sqrt));
                let _ = writeln!(
                    text,
                    "{name},{seed},{is_accepted},{},{:.6},{:.6},{error:.6},{bound:.6}",
                    target.target_idx,
                    target.at_rest_m2.sqrt(),
                    target.predicted_m2.sqrt()
                );
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::RngExt;

    use super::*;
    use armcal_core::robot::load;
    use armcal_core::routine::{Override, Overrides, load_with};
    use armcal_core::stats::stream_rng;
    use armcal_core::time::SIMULATION_EPOCH;

    fn root() -> &'static Path {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
    }

    fn world(settings: &[&str]) -> WorldSpec {
        let path = root().join("routines/titan4-watched.toml");
        let set: Result<Vec<Override>, _> = settings.iter().map(|setting| setting.parse()).collect();
        let overrides = Overrides { set: set.expect("settings"), ..Overrides::default() };
        let routine = load_with(&path, &overrides).expect("the routine reads");
        WorldSpec::from_table(&routine.world, &path).expect("a world")
    }

    #[test]
    fn a_bound_is_for_worlds_as_modelled_alone() {
        assert!(has_bound(&world(&AS_MODELLED)));
        for left in AS_MODELLED {
            let others: Vec<&str> = AS_MODELLED.into_iter().filter(|setting| *setting != left).collect();
            assert!(!has_bound(&world(&others)), "{left}");
        }
    }

    /// Views of all tags, at angles spread over the joints' ranges.
    fn views(robot: &Robot, n: usize) -> Vec<View> {
        let mut rng = stream_rng(3, "views");
        let view = |k: usize| {
            let travel = JointAngles::from_fn(robot.n_joints(), |joint| {
                rng.random_range(-0.7..0.7) * robot.sensors[joint].half_range_rad.min(1.3)
            });
            let mut view = View::of_reading(k as u32, SIMULATION_EPOCH, travel);
            view.n_readings = 100;
            let corners = MeanCorners { corners_px: [[0.0; 2]; 4], n_frames: 5, scatter_px2: 0.0 };
            view.tags = (0..robot.tags.len())
                .map(|tag_idx| TagObservation {
                    id: robot.tags[tag_idx].id,
                    tag_idx,
                    center_in_camera_m: Vector3::zeros(),
                    measured: TagMeasurement::Corners(corners),
                })
                .collect();
            view
        };
        (0..n).map(view).collect()
    }

    /// The twin's readings agree with the true sensors': by the sensor's own equation the angle returns the reading.
    #[test]
    fn true_parameters_are_those_of_the_sensors_as_built() {
        let robot = load(&root().join("robots/titan4-watched")).expect("the robot reads");
        let built = AsBuilt::draw(&robot, &world(&AS_MODELLED), 5);
        let parameters = true_parameters(&built.joints);
        for (joint, sensor) in built.joints.iter().enumerate() {
            let angle_rad =
                parameters.correction(joint).angle_rad(&robot.sensors[joint], 0.4, &ConditionChange::default(), 0.0);
            let travel_rad = (1.0 + sensor.gain_error) * (angle_rad - sensor.center_rad) + sensor.offset_error_rad;
            assert!((travel_rad - 0.4).abs() < 1e-12, "{}", sensor.name);
        }
    }

    /// A bound falls with more views and with less noise, but never below the uncertainty of the camera's pose.
    #[test]
    fn the_bound_is_what_views_and_priors_leave() {
        let world = world(&AS_MODELLED);
        let robot = load(&root().join("robots/titan4-watched")).expect("the robot reads");
        let built = AsBuilt::draw(&robot, &world, 5);
        let bound_m = |n: usize, noise: f64| {
            let mut world = world.clone();
            world.camera.corner_noise_px *= noise;
            let twin = Twin::of(&robot, &world, &built, &views(&robot, n)).expect("a bound");
            let middle = JointAngles::from_fn(robot.n_joints(), |joint| robot.sensors[joint].center_rad);
            twin.covariance.tool_position_m2(&twin.robot, &twin.sensors, &middle).trace().sqrt()
        };
        let [few, many, sharp] = [bound_m(6, 1.0), bound_m(40, 1.0), bound_m(40, 0.01)];
        assert!(few > 1.2 * many && many > 1.02 * sharp, "{few} {many} {sharp}");
        // The camera may have turned about the first joint's axis by 1 mrad, which no view can show.
        assert!(sharp > 5e-4, "{sharp}");
    }

    #[test]
    fn the_ratio_is_of_root_mean_squares_over_all_targets() {
        let run = |seed: u64, pairs: &[[f64; 2]]| {
            let target = |pair: &[f64; 2]| BoundTarget {
                target_idx: 0,
                at_rest_m2: pair[0],
                predicted_m2: pair[1],
                by_parameters_m2: Some(*pair),
            };
            BoundRun { seed, is_accepted: true, contacts: 0, views: 3, targets: pairs.iter().map(target).collect() }
        };
        let runs = [run(1, &[[4.0, 1.0], [1.0, 1.0]]), run(2, &[[4.0, 1.0]])];
        let figures = BoundFigures::of(&runs).expect("targets");
        assert!((figures.ratio - 3.0_f64.sqrt()).abs() < 1e-12);
        // Chi-square of two degrees of freedom: 7.378 at 97.5 %, 0.0506 at 2.5 %.
        assert!((figures.interval.low / figures.ratio - (2.0_f64 / 7.378).sqrt()).abs() < 1e-3);
        assert!((figures.interval.high / figures.ratio - (2.0_f64 / 0.0506).sqrt()).abs() < 0.02);
        assert_eq!(BoundFigures::of(&[]), None);
    }
}
