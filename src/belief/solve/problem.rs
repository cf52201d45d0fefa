//! The least-squares problem: views and observations as the solver's loops read them, with columns and priors.

use crate::solve::constants::problem::CORNER_PRIOR_DOF;
pub(crate) use crate::solve::constants::problem::N_VIEW_PARAMETERS;
use std::ops::Range;

use nalgebra::{DVector, Isometry3, SMatrix, Vector3};

use crate::measure::{BlockMeasurement, ObservationTerm, WeightedCorners, WeightedMeasurement, WeightedPoint};
use crate::model::blocks::Block;
use crate::model::estimated::Walk;
use crate::model::layout::Layout;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::prior::Prior;
use crate::model::scales::Hyperparameters;
use crate::model::state::State;
use crate::model::walk_modes::mode;
use crate::solve::input::BundleInput;
use crate::views::view::{BoardPoint, BoardPoints, MeanCorners, TagMeasurement, View};
use armcal_core::joints::{JointAngles, MAX_JOINTS};
use armcal_core::kinematics::{ArmLoads, LinkCorrections, LinkPoses};
use armcal_core::robot::{CameraSpec, Robot};
use armcal_core::time::Stamp;

/// A view as the loops want it.
#[derive(Clone, Debug)]
pub(crate) struct ViewData {
    /// Angles without the estimated parameters, rad.
    pub fixed_rad: [f64; MAX_JOINTS],
    /// d(angle)/d(parameter) of each column.
    pub basis: Vec<f64>,
    pub rate_rad_s: [f64; MAX_JOINTS],
    /// Variance of the mean reading by its noise, rad^2.
    pub reading_var: [f64; MAX_JOINTS],
    pub observations: Range<usize>,
    pub gripper: Option<usize>,
    /// Joints whose sensor says nothing in this view.
    pub is_free: [bool; MAX_JOINTS],
    /// Against gravity, base frame, where the view knows better than robot.toml.
    pub up: Option<Vector3<f64>>,
    /// Number of the camera that saw the observations.
    pub camera: usize,
    /// Joints, base first, that move it and the tags against each other.
    pub n_seen_joints: usize,
    /// Cameras with a view of the same pose.
    pub n_cameras: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct BundleProblem<'a> {
    pub robot: &'a Robot,
    pub layout: Layout,
    pub views: Vec<ViewData>,
    pub observations: Vec<ObservationTerm>,
    /// Between blocks that have columns.
    pub block_measurements: Vec<BlockMeasurement>,
    pub prior: Prior,
    pub scales: Hyperparameters,
    /// Links as they were known before.
    pub guess_links: LinkCorrections,
    /// Joints that move camera and tags against each other.
    pub n_seen_joints: usize,
}

/// Square matrix over a view's own parameters.
pub(crate) type Own = SMatrix<f64, N_VIEW_PARAMETERS, N_VIEW_PARAMETERS>;

impl<'a> BundleProblem<'a> {
    /// With columns of what the views show.
    pub(crate) fn new(input: &BundleInput<'a>, prior: Prior) -> Self {
        Self::with_layout(input, input.layout(), prior)
    }

    /// With columns that may be more than the views' own.
    pub(crate) fn with_layout(input: &BundleInput<'a>, layout: Layout, prior: Prior) -> Self {
        let BundleInput { robot, views, model, scales, .. } = input;
        let (robot, scales) = (*robot, scales.clone());
        let mut observations = Vec::new();
        let mut data = Vec::with_capacity(views.len());
        for view in *views {
            let from = observations.len();
            let camera = robot.camera_at(view.camera);
            for tag in &view.tags {
                let size_m = robot.tags[tag.tag_idx].size_m;
                let data = match &tag.measured {
                    TagMeasurement::Corners(seen) => corners(camera, seen, size_m),
                    TagMeasurement::Position => WeightedMeasurement::Position {
                        in_camera_m: tag.center_in_camera_m,
                        info: scales.position_std_m.powi(-2),
                    },
                    TagMeasurement::Pose(camera_from_tag) => WeightedMeasurement::Pose {
                        tag_from_camera: camera_from_tag.inverse(),
                        info_position: scales.position_std_m.powi(-2),
                        info_rotation: scales.rotation_std_rad.powi(-2),
                    },
                    TagMeasurement::Board(seen) => board(camera, seen),
                };
                observations.push(ObservationTerm { block: Block::Tag(tag.tag_idx), data, is_used: true });
            }
            let to = observations.len();
            let gripper_size_m = robot.gripper_tag.filter(|_| model.has(Block::GripperTag)).map(|tag| tag.size_m);
            let gripper = view.gripper_tag.as_ref().zip(gripper_size_m).map(|(seen, size_m)| {
                observations.push(ObservationTerm {
                    block: Block::GripperTag,
                    data: corners(&robot.camera, seen, size_m),
                    is_used: true,
                });
                to
            });
            data.push(view_data(input, view, &layout, from..to, gripper));
        }
        let (guess_links, n_seen_joints) = (input.guess.links, robot.n_seen_joints());
        let block_measurements = Vec::new();
        Self { robot, layout, views: data, observations, block_measurements, prior, scales, guess_links, n_seen_joints }
    }

    /// Makes the datasheet's priors those of the scales.
    pub(crate) fn rescale_priors(&mut self) {
        self.prior.rescale(self.robot, &self.layout.parameters, &self.scales);
    }

    /// Takes `scales` over, with the weights that depend on them.
    pub(crate) fn set_scales(&mut self, scales: Hyperparameters) {
        self.scales = scales;
        self.weigh_positions([1.0; 2]);
    }

    /// Weighs positions and rotations, other than corners, by the scales, each times its `factor`.
    pub(crate) fn weigh_positions(&mut self, factor: [f64; 2]) {
        let position = factor[0] * self.scales.position_std_m.powi(-2);
        let rotation = factor[1] * self.scales.rotation_std_rad.powi(-2);
        for observation in &mut self.observations {
            match &mut observation.data {
                WeightedMeasurement::Corners(_) | WeightedMeasurement::Board { .. } => {}
                WeightedMeasurement::Position { info, .. } => *info = position,
                WeightedMeasurement::Pose { info_position, info_rotation, .. } => {
                    (*info_position, *info_rotation) = (position, rotation);
                }
            }
        }
    }

    /// The state where nothing is off its prior, but for the joints' parameters, which are `guess`'s.
    pub(crate) fn start(&self, guess: &JointParameters) -> State {
        let parameters = &self.layout.parameters;
        State {
            joint: DVector::from_iterator(parameters.len(), parameters.iter().map(|p| guess.get(*p))),
            blocks: self.prior.mean.clone(),
            joint_error: vec![[0.0; MAX_JOINTS]; self.views.len()],
            camera_error: vec![Isometry3::identity(); self.views.len()],
        }
    }

    /// The steps of sensors that slipped.
    pub(crate) fn steps(&self, state: &State) -> Vec<(Parameter, f64)> {
        let all = self.layout.parameters.iter().copied().zip(state.joint.iter().copied());
        all.filter(|(p, _)| p.is_step()).collect()
    }

    pub(crate) fn set_steps(&self, state: &mut State, steps: &[(Parameter, f64)]) {
        for (parameter, step_rad) in steps {
            if let Some(column) = self.layout.parameters.iter().position(|p| p == parameter) {
                state.joint[column] = *step_rad;
            }
        }
    }

    /// Variance of what a joint is off in a view beyond the sensor's model, rad^2.
    pub(crate) fn joint_error_var(&self, view: &ViewData, joint: usize) -> f64 {
        self.joint_own_var(view, joint) + self.jitter_rad(view, joint).powi(2)
    }

    /// The part of it that is the joint's own: the image's time error moves all joints of a view together.
    ///
    /// Cameras that see one pose share it. Each of n has a view of its own here, under n times the variance: whatever
    /// the errors have to do with each other, what they tell together is not more than it is (covariance intersection
    /// with equal weights, Julier and Uhlmann 1997).
    pub(crate) fn joint_own_var(&self, view: &ViewData, joint: usize) -> f64 {
        if view.is_free[joint] {
            return self.scales.free_joint_std_rad.powi(2);
        }
        view.n_cameras * (self.scales.joint_std_rad[joint].powi(2) + view.reading_var[joint])
    }

    /// Motion of a joint within one sigma of the image's time error, rad.
    pub(crate) fn jitter_rad(&self, view: &ViewData, joint: usize) -> f64 {
        if view.is_free[joint] { 0.0 } else { view.rate_rad_s[joint] * self.scales.time_jitter_std_s }
    }

    pub(crate) fn angles(&self, view_idx: usize, state: &State) -> JointAngles {
        let view = &self.views[view_idx];
        JointAngles::from_fn(self.robot.n_joints(), |j| {
            let columns = self.layout.of_joint[j].clone();
            let estimated: f64 = columns.map(|column| view.basis[column] * state.joint[column]).sum();
            view.fixed_rad[j]
                + estimated
                + state.joint_error[view_idx][j]
                + view.rate_rad_s[j] * state.blocks.number(Block::Clock)
        })
    }

    /// The links' corrections in `state`; those of the guess where they are not estimated.
    pub(crate) fn link_corrections(&self, state: &State) -> LinkCorrections {
        let mut corrections = self.guess_links;
        let columns = self.layout.links.clone();
        let links = state.joint.rows_range(columns);
        for (six, correction) in links.as_slice().chunks_exact(6).zip(&mut corrections.places) {
            correction.shift_m.copy_from_slice(&six[..3]);
            correction.turn_rad.copy_from_slice(&six[3..]);
        }
        if self.layout.sag.is_empty() {
            return corrections;
        }
        let mut all = JointParameters { links: corrections, ..JointParameters::default() };
        for column in self.layout.sag.clone() {
            all.set(self.layout.parameters[column], state.joint[column]);
        }
        all.links
    }

    /// Weights that the arm carries in a view, whose base may lean.
    pub(crate) fn loads(&self, view_idx: usize) -> ArmLoads {
        let loads = self.robot.chain.loads();
        self.views[view_idx].up.map_or(*loads, |up| loads.with_up(up))
    }

    /// Poses of all links in a view, in the frame of the tags.
    pub(crate) fn link_poses(&self, view_idx: usize, state: &State) -> LinkPoses {
        self.corrected_link_poses(view_idx, state, &self.link_corrections(state))
    }

    /// Link poses of a view at `state`, with the given link corrections.
    pub(crate) fn corrected_link_poses(
        &self,
        view_idx: usize,
        state: &State,
        corrections: &LinkCorrections,
    ) -> LinkPoses {
        let angles = self.angles(view_idx, state);
        let poses = if *corrections == LinkCorrections::default() {
            self.robot.chain.link_poses(&angles)
        } else {
            self.robot.chain.corrected_link_poses_under(&angles, corrections, &self.loads(view_idx))
        };
        poses.in_frame(&self.robot.tag_frame)
    }
}

/// Corners with the variance of their mean: the scatter between frames, with robot.toml's figure for a few frames more.
fn corners(camera: &CameraSpec, seen: &MeanCorners, size_m: f64) -> WeightedMeasurement {
    let dof = 8.0 * seen.n_frames.saturating_sub(1) as f64;
    let info = seen.n_frames.max(1) as f64 / one_frame_px2(camera, seen.scatter_px2, dof);
    let (corners_px, half_size_m, used) = (seen.corners_px, 0.5 * size_m, [true; 4]);
    WeightedMeasurement::Corners(WeightedCorners { corners_px, half_size_m, info, used })
}

/// Corners of a board in the same way.
fn board(camera: &CameraSpec, seen: &BoardPoints) -> WeightedMeasurement {
    let variance_px2 = one_frame_px2(camera, seen.scatter_px2, seen.n_free as f64);
    let weighted = |point: &BoardPoint| {
        let BoardPoint { on_board, pixel, n_frames } = *point;
        WeightedPoint { on_board, pixel, info: n_frames.max(1) as f64 / variance_px2 }
    };
    WeightedMeasurement::Board { points: seen.points.iter().map(weighted).collect() }
}

/// Variance of a corner in one frame, px^2.
fn one_frame_px2(camera: &CameraSpec, scatter_px2: f64, dof: f64) -> f64 {
    let known_px2 = camera.corner_std_px.powi(2);
    (CORNER_PRIOR_DOF * known_px2 + scatter_px2) / (CORNER_PRIOR_DOF + dof)
}

fn view_data(
    input: &BundleInput<'_>,
    view: &View,
    layout: &Layout,
    observations: Range<usize>,
    gripper: Option<usize>,
) -> ViewData {
    let (robot, guess) = (input.robot, &input.guess);
    let departure = view.conditions.departure_from(&guess.reference);
    let mut data = ViewData {
        fixed_rad: [0.0; MAX_JOINTS],
        basis: Vec::with_capacity(layout.n_joint()),
        rate_rad_s: [0.0; MAX_JOINTS],
        reading_var: [0.0; MAX_JOINTS],
        observations,
        gripper,
        is_free: view.is_free,
        up: view.up,
        camera: view.camera,
        n_seen_joints: robot.n_joints_seen_by(robot.camera_at(view.camera)),
        n_cameras: view.n_cameras as f64,
    };
    for (joint, spec) in robot.sensors.iter().enumerate() {
        let travel_rad = view.travel_rad[joint];
        let mut fixed = guess.correction(joint).angle_rad(spec, travel_rad, &departure, view.approach[joint]);
        for parameter in &layout.parameters[layout.of_joint[joint].clone()] {
            let kind = parameter.kind;
            let by = past_derivative(kind, input.model.walk, view.end)
                .unwrap_or_else(|| kind.angle_derivative(spec, travel_rad, &departure, view.approach[joint]));
            fixed -= by * guess.get(*parameter);
            data.basis.push(by);
        }
        data.fixed_rad[joint] = fixed;
        data.rate_rad_s[joint] = view.rate_rad_s[joint];
        let reading_std_rad = spec.noise_std_counts / spec.counts_per_rad.abs();
        data.reading_var[joint] = reading_std_rad.powi(2) / view.n_readings.max(1) as f64;
    }
    data
}

/// d(angle)/d(parameter) in a view that ends at `end`, of what tells of the sensor as it was; `None` for all else.
pub(crate) fn past_derivative(kind: ParameterKind, walk: Option<Walk>, end: Stamp) -> Option<f64> {
    match kind {
        ParameterKind::StepBefore(since) => Some(f64::from(end < since)),
        ParameterKind::WalkMode(k) => Some(walk.map_or(0.0, |walk| mode(k, walk.span, end))),
        _ => None,
    }
}

/// `base` with the estimated parameters of `state`.
pub(crate) fn parameters_of(problem: &BundleProblem<'_>, state: &State, base: &JointParameters) -> JointParameters {
    let mut parameters = *base;
    for (parameter, value) in problem.layout.parameters.iter().zip(state.joint.iter()) {
        parameters.set(*parameter, *value);
    }
    parameters
}
