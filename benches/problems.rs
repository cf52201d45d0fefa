//! Problems of the benchmarks: views of a Titan 4 drawn from a fixed seed.

use std::path::Path;

use armcal::calib::bundle::{BundleInput, HyperparameterMode};
use armcal::calib::{MeanCorners, TagMeasurement, TagObservation, View};
use armcal::joints::{JointAngles, MAX_JOINTS};
use armcal::kinematics::Chain;
use armcal::model::{Block, Hyperparameters, JointParameters, Model, Parameter, ParameterKind};
use armcal::optics::{CameraModel, square_corners};
use armcal::robot::{CameraSpec, Robot, load};
use armcal::sensor::ConditionChange;
use armcal::spatial::exp;
use armcal::stats::stream_rng;
use armcal::time::SIMULATION_EPOCH;
use nalgebra::{Isometry3, Vector6};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Number of terms of each joint's nonlinearity, in addition to gain and offset.
pub const N_TERMS: u8 = 4;
const CORNER_STD_PX: f64 = 0.3;
const POSITION_STD_M: f64 = 0.01;
/// Largest angle of a corner from the optical axis, so that an initial guess with 0.1 rad of error still sees the
/// corner.
const MAX_VIEW_ANGLE_RAD: f64 = 1.25;
const MIN_RANGE_M: f64 = 0.25;

/// An arm, its views, and the parameters to estimate.
pub struct Problem {
    pub robot: Robot,
    pub views: Vec<View>,
    pub model: Model,
    pub scales: Hyperparameters,
}

impl Problem {
    pub fn input(&self, evidence: HyperparameterMode) -> BundleInput<'_> {
        BundleInput {
            robot: &self.robot,
            views: &self.views,
            model: self.model.clone(),
            scales: self.scales.clone(),
            guess: JointParameters::default(),
            joint_prior: None,
            evidence,
        }
    }

    /// Gains and offsets of the joints that move the camera.
    pub fn straight(&self) -> Vec<Parameter> {
        let straight = |p: &Parameter| matches!(p.kind, ParameterKind::Gain | ParameterKind::Offset);
        self.model.parameters().into_iter().filter(straight).collect()
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A robot whose readings have no noise of their own, so a view has no parameters of its own.
pub fn robot() -> Robot {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4");
    let mut robot = load(&folder).expect("the robot is part of the repository");
    for sensor in &mut robot.sensors {
        sensor.noise_std_counts = 0.0;
    }
    robot
}

fn model(robot: &Robot) -> Model {
    let kinds = |joint: usize| {
        if joint >= robot.camera.mount.n_joints {
            return Vec::new();
        }
        let terms = (0..N_TERMS).map(ParameterKind::Shape);
        [ParameterKind::Gain, ParameterKind::Offset].into_iter().chain(terms).collect()
    };
    let blocks = [Block::Mount(0)].into_iter().chain(Block::tags(robot));
    Model { joints: (0..robot.n_joints()).map(kinds).collect(), ..Model::of_blocks(0, blocks) }
}

/// The true arm, drawn from the priors of the parameters that have a column.
struct Truth {
    parameters: JointParameters,
    chain: Chain,
    lens: CameraModel,
    mount: Isometry3<f64>,
    tags: Vec<Isometry3<f64>>,
}

fn moved(pose: &Isometry3<f64>, std_m: f64, std_rad: f64, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    pose * exp(&Vector6::from_fn(|k, _| normal(rng) * if k < 3 { std_m } else { std_rad }))
}

/// Noise and tags of the views.
#[derive(Clone, Copy)]
pub struct Sight {
    /// Standard deviation of the joints' errors from view to view.
    pub joint_std_rad: f64,
    /// Number of tags of a view: those nearest to its axis. If it is the number of all tags, a view must show every
    /// one.
    pub n_tags: usize,
}

/// `n_views` views that see all tags, by their corners.
pub fn corners(n_views: u32, joint_std_rad: f64) -> Problem {
    let robot = robot();
    let n_tags = robot.tags.len();
    corners_of(robot, n_views, Sight { joint_std_rad, n_tags })
}

/// Views of all tags, with columns for all arm parameters of `bundle`: links, lens and sag, too.
pub fn corners_of_all(n_views: u32) -> Problem {
    let robot = robot();
    let (n, n_tags) = (robot.camera.mount.n_joints, robot.tags.len());
    let mut model = Model { n_links: n, n_compliant: n, ..model(&robot) };
    model.blocks.insert(Block::Lens(0));
    corners_by(robot, model, n_views, Sight { joint_std_rad: 0.0, n_tags })
}

/// `n_views` views by the corners of some of a robot's tags.
pub fn corners_of(robot: Robot, n_views: u32, sight: Sight) -> Problem {
    let model = model(&robot);
    corners_by(robot, model, n_views, sight)
}

fn corners_by(robot: Robot, model: Model, n_views: u32, sight: Sight) -> Problem {
    let joint_std_rad = sight.joint_std_rad;
    let mut scales = Hyperparameters::datasheet(&robot);
    scales.joint_std_rad = [joint_std_rad; MAX_JOINTS];
    let mut rng = stream_rng(1, "bench of bundle");
    let mut problem = Problem { robot, views: Vec::new(), model, scales };
    let truth = draw(&problem, &mut rng);
    while (problem.views.len() as u32) < n_views {
        let idx = problem.views.len() as u32;
        if let Some(view) = view(&problem.robot, &truth, sight, idx, &mut rng) {
            problem.views.push(view);
        }
    }
    problem
}

fn draw(problem: &Problem, rng: &mut ChaCha8Rng) -> Truth {
    let robot = &problem.robot;
    let mut parameters = JointParameters::default();
    for p in problem.model.parameters() {
        let std = problem.scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
        parameters.set(p, parameters.get(p) + std * normal(rng));
    }
    let camera = &robot.camera;
    let mount = moved(&camera.mount.link_from_frame, camera.mount_std_m, camera.mount_std_rad, rng);
    let tags = robot.tags.iter();
    let tags = tags.map(|t| moved(t.base_from_tag.isometry(), t.position_std_m, t.rotation_std_rad, rng)).collect();
    let lens = if problem.model.has(Block::Lens(0)) { lens(&robot.camera, rng) } else { robot.camera.lens };
    Truth { chain: robot.chain.corrected(&parameters.links), parameters, lens, mount, tags }
}

/// Standard deviations of a lens's eight columns: focal lengths and centre px, distortion.
pub fn lens_std(camera: &CameraSpec) -> [f64; 8] {
    let [fx, fy] = camera.lens.focal_px().map(|px| px * camera.lens_priors.focal_std);
    let (center, k) = (camera.lens_priors.center_std_px, camera.lens_priors.distortion_std);
    [fx, fy, center, center, k, k, k, k]
}

fn lens(camera: &CameraSpec, rng: &mut ChaCha8Rng) -> CameraModel {
    let (mean, std) = (camera.lens.intrinsics(), lens_std(camera));
    camera.lens.with_intrinsics(std::array::from_fn(|k| mean[k] + std[k] * normal(rng)))
}

/// A view at a random pose; `None` where it does not see the required tags.
fn view(robot: &Robot, truth: &Truth, sight: Sight, idx: u32, rng: &mut ChaCha8Rng) -> Option<View> {
    let travel_rad =
        JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(-0.9..0.9) * robot.sensors[j].half_range_rad);
    let angles = JointAngles::from_fn(robot.n_joints(), |j| {
        let spec = &robot.sensors[j];
        let angle_rad = truth.parameters.correction(j).angle_rad(spec, travel_rad[j], &ConditionChange::default(), 0.0);
        angle_rad + sight.joint_std_rad * normal(rng)
    });
    let camera_from_base = (truth.chain.link_poses(&angles).link(robot.camera.mount.n_joints) * truth.mount).inverse();
    let mut view = View::of_reading(idx, SIMULATION_EPOCH.plus_s(20.0 * f64::from(idx)), travel_rad);
    for (tag_idx, tag) in robot.tags.iter().enumerate() {
        let camera_from_tag = camera_from_base * truth.tags[tag_idx];
        let Some(corners_px) = corners_px(&truth.lens, tag.size_m, &camera_from_tag, rng) else {
            if sight.n_tags < robot.tags.len() {
                continue;
            }
            return None;
        };
        let center_in_camera_m = camera_from_tag.translation.vector;
        let measured = TagMeasurement::Corners(MeanCorners { corners_px, n_frames: 1, scatter_px2: 0.0 });
        view.tags.push(TagObservation { id: tag.id, tag_idx, center_in_camera_m, measured });
    }
    let off_axis = |tag: &TagObservation| -tag.center_in_camera_m.z / tag.center_in_camera_m.norm();
    if view.tags.len() > sight.n_tags {
        view.tags.sort_by(|a, b| off_axis(a).total_cmp(&off_axis(b)));
        view.tags.truncate(sight.n_tags);
        view.tags.sort_by_key(|tag| tag.tag_idx);
    }
    (view.tags.len() == sight.n_tags).then_some(view)
}

/// Measured corners of a tag, px; `None` where a corner is too far off the axis, or the tag too near.
fn corners_px(
    lens: &CameraModel,
    size_m: f64,
    camera_from_tag: &Isometry3<f64>,
    rng: &mut ChaCha8Rng,
) -> Option<[[f64; 2]; 4]> {
    let mut corners_px = [[0.0; 2]; 4];
    for (pixel, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
        let point = (camera_from_tag * corner).coords;
        let angle_rad = point.x.hypot(point.y).atan2(point.z);
        if angle_rad > MAX_VIEW_ANGLE_RAD || camera_from_tag.translation.vector.norm() < MIN_RANGE_M {
            return None;
        }
        let seen = lens.project(&point)?;
        *pixel = [seen.x + CORNER_STD_PX * normal(rng), seen.y + CORNER_STD_PX * normal(rng)];
    }
    Some(corners_px)
}

/// `n_views` views of the positions of `n_tags` tags, 1 cm of noise on each coordinate; sensors are straight.
pub fn positions(n_views: u32, n_tags: usize) -> Problem {
    let robot = robot();
    let model = model(&robot);
    let scales = Hyperparameters::datasheet(&robot);
    let mut rng = stream_rng(1, "bench of minimum distance");
    let mut problem = Problem { robot, views: Vec::new(), model, scales };
    let mut truth = JointParameters::default();
    for p in problem.straight() {
        truth.set(p, truth.get(p) + p.prior_std(&problem.robot) * normal(&mut rng));
    }
    let robot = &problem.robot;
    for idx in 0..n_views {
        let travel_rad =
            JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(-0.9..0.9) * robot.sensors[j].half_range_rad);
        let angles = JointAngles::from_fn(robot.n_joints(), |j| {
            let center_rad = robot.sensors[j].center_rad;
            center_rad + truth.gain[j] * travel_rad[j] + truth.offset_rad[j]
        });
        let camera_from_base = robot.chain.link_poses(&angles).frame(&robot.camera.mount).inverse();
        let mut view = View::of_reading(idx, SIMULATION_EPOCH, travel_rad);
        for (tag_idx, tag) in robot.tags.iter().enumerate().take(n_tags) {
            let mut center = (camera_from_base * tag.base_from_tag.isometry()).translation.vector;
            center.iter_mut().for_each(|x| *x += POSITION_STD_M * normal(&mut rng));
            view.tags.push(TagObservation {
                id: tag.id,
                tag_idx,
                center_in_camera_m: center,
                measured: TagMeasurement::Position,
            });
        }
        problem.views.push(view);
    }
    problem
}
