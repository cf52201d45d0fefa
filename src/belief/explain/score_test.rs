//! Score test: whether other geometry explains the data better than joint sensors can.
//!
//! In the score test (Rao 1948; the Lagrange multiplier test), each link's shift and rotation is a trial parameter z,
//! zero in the model. With everything else at its optimum, the normal equations give `s = d(-cost/2)/dz` and z's
//! information `I` without another fit. All other parameters are marginalised under their priors. `z = I^-1 s` is the
//! estimate from the data; `s^T I^-1 s` is chi-square under the model. Directions that the data determine less well
//! than [`SIZE_M`] or [`SIZE_RAD`] do not count.

use crate::explain::constants::score_test::{ALIKE_CHI2, MOUNT, SIZE_M, SIZE_RAD, SURER};
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector3, Vector6};

use crate::model::blocks::Block;
use crate::model::parameters::{JointParameters, Parameter};
use crate::say::geometry_error::ErrorKind;
use crate::solve::body_twists::link_twist;
use crate::solve::estimate::Estimate;
use crate::solve::schur::Group;
use crate::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, ConditionChange};
use armcal_core::stats::chi_square_above;

/// Element of the geometry that is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeometryElement {
    /// Pose of the joint on its parent link.
    Joint(usize),
    /// Pose of the camera mount, beyond its prior.
    Mount,
}

/// Result of the test of one change of the geometry.
#[derive(Clone, Debug)]
pub struct ScoreTestResult {
    /// Element that the test changes.
    pub element: GeometryElement,
    /// Kind of change: shift or rotation.
    pub error: ErrorKind,
    /// Estimated change, in the parent link's frame (the camera's for the mount): m or rad.
    pub size: Vector3<f64>,
    /// Chi-square of the score under the model.
    pub chi2: f64,
    /// Number of directions that the data determine well enough, 1 to 3.
    pub dof: usize,
    /// Probability that chance alone makes `chi2` as large.
    pub probability: f64,
    /// Tool displacement by the change, root mean square over the task, m.
    pub tool_m: f64,
}

/// Trial columns: for each joint's pose in its parent link, three of translation, then three of rotation; then the
/// mount's six.
type Trials = SMatrix<f64, 6, { MOUNT + 6 }>;

/// Score and information of all trials, and the response of the common parameters to them.
pub(crate) struct Score {
    pub(crate) score: DVector<f64>,
    pub(crate) information: DMatrix<f64>,
    /// Derivative of the common parameters by the trials.
    sensitivity: DMatrix<f64>,
}

impl Estimate<'_> {
    /// Results of all tests, the least likely by chance first; `task`: the arm's angles at the task's targets. A mount
    /// that explains as much as a link, and has a much larger stated sigma, comes before it.
    #[must_use]
    pub fn score_tests(&self, task: &[JointAngles]) -> Vec<ScoreTestResult> {
        let score = self.score();
        let mut elements: Vec<GeometryElement> = (0..self.n_seen_joints()).map(GeometryElement::Joint).collect();
        elements.extend(self.has(Block::Mount(0)).then_some(GeometryElement::Mount));
        let both = elements.iter().flat_map(|&element| [(element, ErrorKind::Shift), (element, ErrorKind::Turn)]);
        let task = self.tool_jacobians(task);
        let mut out: Vec<ScoreTestResult> =
            both.filter_map(|(element, error)| self.score_test(&score, element, error, &task)).collect();
        out.sort_by(|a, b| a.probability.total_cmp(&b.probability).then(b.chi2.total_cmp(&a.chi2)));
        if let Some(mount) = self.likelier_mount(&out) {
            out[..=mount].rotate_right(1);
        }
        out
    }

    /// Index in `results` of the mount, if it explains as much as the first link. Beyond the last joint that the views
    /// move, only the stated sigmas distinguish them.
    fn likelier_mount(&self, results: &[ScoreTestResult]) -> Option<usize> {
        let first = results.first().filter(|first| matches!(first.element, GeometryElement::Joint(1..)))?;
        let (links, camera) = (&self.problem.robot.geometry, &self.problem.robot.camera);
        let is_likelier = |result: &ScoreTestResult| {
            let (of_link, of_mount) = match result.error {
                ErrorKind::Shift => (links.link_position_std_m, camera.mount_std_m),
                ErrorKind::Turn => (links.link_rotation_std_rad, camera.mount_std_rad),
            };
            let explains_as_much = result.chi2 > first.chi2 - ALIKE_CHI2;
            result.element == GeometryElement::Mount && explains_as_much && of_mount > SURER * of_link
        };
        results.iter().position(is_likelier)
    }

    /// Number of joints, from the base, whose motion some view shows.
    pub(crate) fn n_seen_joints(&self) -> usize {
        match &self.problem.robot.gripper_tag {
            Some(tag) if self.has(Block::GripperTag) => tag.mount.n_joints,
            _ => self.problem.n_seen_joints,
        }
    }

    /// The arm's angles in each view.
    #[must_use]
    pub fn view_angles(&self) -> Vec<JointAngles> {
        (0..self.problem.views.len()).map(|view_idx| self.problem.angles(view_idx, &self.solved.state)).collect()
    }

    fn score_test(
        &self,
        score: &Score,
        element: GeometryElement,
        error: ErrorKind,
        task: &[ToolJacobian],
    ) -> Option<ScoreTestResult> {
        let (first, unit) = columns(element, error);
        let information = score.information.fixed_view::<3, 3>(first, first).into_owned() * (unit * unit);
        let pull = score.score.fixed_rows::<3>(first).into_owned() * unit;
        let eigen = information.symmetric_eigen();
        let (mut size, mut chi2, mut dof) = (Vector3::zeros(), 0.0, 0);
        for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > 1.0 {
                let along = direction.dot(&pull);
                size += direction * (along / value * unit);
                chi2 += along * along / value;
                dof += 1;
            }
        }
        if dof == 0 {
            return None;
        }
        let probability = chi_square_above(chi2, dof);
        let square = |at: &ToolJacobian| at.shift(score, first, &size).norm_squared();
        let tool_m = (task.iter().map(square).sum::<f64>() / task.len().max(1) as f64).sqrt();
        Some(ScoreTestResult { element, error, size, chi2, dof, probability, tool_m })
    }

    /// Tool and its derivatives at each configuration of `task`.
    pub(crate) fn tool_jacobians(&self, task: &[JointAngles]) -> Vec<ToolJacobian> {
        let at = self.parameters();
        let (robot, sensors) = (at.with_links(self.problem.robot.clone()), at.sensors(self.problem.robot));
        task.iter().map(|angles| ToolJacobian::new(&robot, &self.problem.layout.parameters, &sensors, angles)).collect()
    }

    pub(crate) fn score(&self) -> Score {
        self.score_of(trials)
    }

    /// Score of the trials whose twists of the camera (right, camera frame) `trials` gives for each group.
    pub(crate) fn score_of<const N: usize>(&self, trials: impl Fn(&Group<'_>) -> SMatrix<f64, 6, N>) -> Score {
        let problem = &self.problem;
        let n = problem.layout.n;
        let mut score = DVector::zeros(N);
        let mut information = DMatrix::zeros(N, N);
        let mut cross = DMatrix::zeros(N, n);
        let mut groups = self.solved.normal.eliminated.iter();
        for view_idx in 0..problem.views.len() {
            let poses = problem.link_poses(view_idx, &self.solved.state);
            for (group, own) in Group::of_view(problem, &self.solved.state, view_idx, &poses).zip(groups.by_ref()) {
                let trials = trials(&group);
                let (h, g) = self.gradient(&group);
                let m = own.twists * own.inverse * own.twists.transpose();
                let left = trials.transpose() * (Matrix6::identity() - h * m);
                score += left_times(&trials, &(g - h * (own.twists * (own.inverse * own.gradient))));
                information += DMatrix::from_fn(N, N, |i, k| (left.row(i) * h).dot(&trials.column(k).transpose()));
                cross += left * own.twist_by_columns(problem, &self.solved.normal.by_tag, view_idx);
            }
        }
        let followed = -(&self.posterior.covariance * cross.transpose());
        score += followed.tr_mul(&self.solved.normal.right);
        information += &cross * &followed;
        Score { score, information, sensitivity: followed }
    }

    /// Information and gradient of a group's observations on the camera's twist.
    fn gradient(&self, group: &Group<'_>) -> (Matrix6<f64>, Vector6<f64>) {
        let (problem, state) = (&self.problem, &self.solved.state);
        let (mut h, mut g) = (Matrix6::zeros(), Vector6::zeros());
        for observation in
            problem.observations[group.observations.clone()].iter().filter(|observation| observation.is_used)
        {
            let camera_from_tag = group.camera_from_tag(state, observation.block);
            let lens = state.blocks.lens(Block::Lens(group.camera));
            if let Some(info) = observation.data.information(&camera_from_tag, lens, problem.scales.noise, None) {
                h += info.h;
                g += info.g;
            }
        }
        (h, g)
    }
}

/// Twists of the camera (right, camera frame) by each trial parameter.
fn trials(group: &Group<'_>) -> Trials {
    let mut trials = Trials::zeros();
    for joint in group.joints.clone() {
        for axis in 0..3 {
            let by = [Vector3::ith(axis, group.sign); 2];
            let [shift, turn] = link_twist(group.poses, &group.base_from_camera, joint, by);
            trials.set_column(6 * joint + axis, &shift);
            trials.set_column(6 * joint + 3 + axis, &turn);
        }
    }
    if group.camera == 0 {
        trials.fixed_view_mut::<6, 6>(0, MOUNT).copy_from(&group.by_mount);
    }
    trials
}

/// Tool position at one configuration, and its derivatives.
pub(crate) struct ToolJacobian {
    pub(crate) poses: LinkPoses,
    /// Tool position in the base frame, m.
    pub(crate) tool_m: Vector3<f64>,
    /// Derivatives by the estimated joints' parameters, m per unit.
    pub(crate) by_parameters: Vec<Vector3<f64>>,
    n_joints: usize,
}

impl ToolJacobian {
    fn new(robot: &Robot, parameters: &[Parameter], sensors: &ArmSensors, angles: &JointAngles) -> Self {
        let poses = robot.chain.link_poses(angles);
        let tool = &robot.tool.mount;
        let tool_m = poses.frame(tool).translation.vector;
        let still = ConditionChange::default();
        let travel_rad = JointAngles::from_fn(angles.len(), |j| sensors.models[j].travel_under_rad(angles[j], &still));
        let by = |parameter: &Parameter| {
            let joint = parameter.joint;
            if joint >= tool.n_joints {
                return Vector3::zeros();
            }
            if parameter.kind.is_of_body() {
                return by_body(robot, &poses, &tool_m, *parameter);
            }
            let spec = &sensors.models[joint].spec;
            poses.point_jacobian(joint, &tool_m) * parameter.kind.angle_derivative(spec, travel_rad[joint], &still, 0.0)
        };
        let by_parameters = parameters.iter().map(by).collect();
        Self { by_parameters, tool_m, n_joints: tool.n_joints, poses }
    }

    /// Tool and derivatives by the readings of an arm at rest, under their conditions.
    pub(crate) fn of_view(robot: &Robot, estimated: &[Parameter], at: &JointParameters, view: &View) -> Self {
        let departure = view.conditions.departure_from(&at.reference);
        let angles = JointAngles::from_fn(robot.n_joints(), |joint| {
            let (spec, travel_rad) = (&robot.sensors[joint], view.travel_rad[joint]);
            at.correction(joint).angle_rad(spec, travel_rad, &departure, view.approach[joint])
        });
        let poses = robot.chain.link_poses(&angles);
        let tool = &robot.tool.mount;
        let tool_m = poses.frame(tool).translation.vector;
        let by = |parameter: &Parameter| {
            let Parameter { joint, kind } = *parameter;
            if joint >= tool.n_joints {
                return Vector3::zeros();
            }
            if kind.is_of_body() {
                return by_body(robot, &poses, &tool_m, *parameter);
            }
            let (spec, travel_rad) = (&robot.sensors[joint], view.travel_rad[joint]);
            let by_angle = kind.angle_derivative(spec, travel_rad, &departure, view.approach[joint]);
            poses.point_jacobian(joint, &tool_m) * by_angle
        };
        let by_parameters = estimated.iter().map(by).collect();
        Self { by_parameters, tool_m, n_joints: tool.n_joints, poses }
    }

    /// Tool displacement by changes of the estimated joints' parameters, base frame, m.
    pub(crate) fn moved_by(&self, changes: &DVector<f64>) -> Vector3<f64> {
        self.by_parameters.iter().zip(changes.iter()).map(|(by, change)| by * *change).sum()
    }

    /// Tool displacement by the trial at `first` of `size`, with the joints' parameters following it, base frame, m.
    pub(crate) fn shift(&self, score: &Score, first: usize, size: &Vector3<f64>) -> Vector3<f64> {
        let mut moved = Vector3::zeros();
        let joint = first / 6;
        if first < MOUNT && joint < self.n_joints {
            let turned = self.poses.link(joint).rotation * size;
            let lever = self.tool_m - self.poses.joint_origin(joint);
            moved += if first.is_multiple_of(6) { turned } else { turned.cross(&lever) };
        }
        moved + self.followed(score, first, size)
    }

    /// Part of `shift` caused by the joints' parameters that follow the trial, base frame, m.
    pub(crate) fn followed(&self, score: &Score, first: usize, size: &Vector3<f64>) -> Vector3<f64> {
        self.moved_by(&(score.sensitivity.columns(first, 3) * size))
    }
}

/// Tool displacement by a parameter of the arm's body, m per unit.
fn by_body(robot: &Robot, poses: &LinkPoses, tool_m: &Vector3<f64>, parameter: Parameter) -> Vector3<f64> {
    let motion = parameter.body_motion(&robot.chain, poses, 0..robot.tool.mount.n_joints, tool_m);
    motion.map_or_else(Vector3::zeros, |[moved, _]| moved)
}

/// First trial column, and the size that defines its unit.
pub(crate) fn columns(element: GeometryElement, error: ErrorKind) -> (usize, f64) {
    let first = match element {
        GeometryElement::Joint(joint) => 6 * joint,
        GeometryElement::Mount => MOUNT,
    };
    match error {
        ErrorKind::Shift => (first, SIZE_M),
        ErrorKind::Turn => (first + 3, SIZE_RAD),
    }
}

fn left_times<const N: usize>(trials: &SMatrix<f64, 6, N>, pull: &Vector6<f64>) -> DVector<f64> {
    DVector::from_iterator(N, trials.column_iter().map(|column| column.dot(pull)))
}
