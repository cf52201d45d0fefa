//! What rests on priors alone: elements of the geometry that the views do not tell, and what each means at the tool.
//!
//! Each element z (a joint's place on its parent link, the camera's mount, the tool point) is held at the drawing. By
//! the score test's quantities, z has the information I from the views, all estimated parameters x eliminated, and the
//! estimate follows it by `dx/dz`. An error of one sigma s of z's prior moves the tool by
//! `t = (d tool/dz + d tool/dx dx/dz) s`. Views leave `1 / (1 + I s^2)` of the prior's variance: an element of which
//! more than half is left is unseen. What is not estimated adds `t t^T` to the tool's covariance.

mod lens;

use nalgebra::{Matrix3, Vector3};

use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::score_test::{GeometryElement, Score, ToolJacobian, columns};
use crate::calib::bundle::touch_term::TouchUpdate;
use crate::calib::finding::FindingUnit;
use crate::calib::geometry_error::ErrorKind;
use crate::calib::reservation::Reservation;
use armcal_core::joints::JointAngles;

/// Share of the prior's variance that the views leave, above which an element counts as unseen.
const UNSEEN_SHARE: f64 = 0.5;
/// A reservation is worth a line where one sigma of it moves the tool by more than this share of the predicted error.
const WORTH_SHARE: f64 = 0.5;
/// The same where nothing watches over what is beyond the camera.
const WORTH_SHARE_UNWATCHED: f64 = 0.1;
/// So many are told, the largest at the tool first.
const MAX_RESERVATIONS: usize = 5;
/// Touches that tell an element to so many sigmas of its prior would show it where it is beyond the drawing's figure.
const TOUCHED_SIGMAS: f64 = 5.0;

/// An element of the geometry along one axis, with its prior.
struct HeldElement {
    what: String,
    unit: FindingUnit,
    prior_std: f64,
    /// Share of the prior's variance that the views leave.
    share_left: f64,
    /// One sigma to which touches tell it; infinite without them.
    touched_std: f64,
    /// Of the tool by one sigma, at each configuration, m.
    shifts: Vec<Vector3<f64>>,
    /// Whether another element's line speaks of it, too.
    is_spoken_of: bool,
    /// Whether the tool's covariance has it already: by the estimate's parameters, or by the lens's.
    is_counted: bool,
}

/// What priors alone say of the tool.
pub(crate) struct PriorImpact {
    /// The largest first.
    pub reservations: Vec<Reservation>,
    /// Added to the tool's covariance at each configuration, m^2.
    pub covariances_m2: Vec<Matrix3<f64>>,
}

impl PriorImpact {
    /// The reservations that are told.
    pub(crate) fn told(mut self) -> Vec<Reservation> {
        self.reservations.truncate(MAX_RESERVATIONS);
        self.reservations
    }
}

impl Estimate<'_> {
    /// What the drawing leaves open at `task`, where the data alone predict `predicted_m`.
    #[cfg(test)]
    pub(crate) fn prior_impact(&self, task: &[JointAngles], predicted_m: f64) -> PriorImpact {
        self.prior_impact_with(None, task, predicted_m)
    }

    /// The same where touches tell of it, too; of the estimate by the views alone.
    pub(crate) fn prior_impact_with(
        &self,
        touches: Option<&TouchUpdate>,
        task: &[JointAngles],
        predicted_m: f64,
    ) -> PriorImpact {
        let tool = self.tool_jacobians(task);
        let lens = self.held_lens();
        let mut elements = self.held_elements(touches, task, &tool);
        elements.extend(lens.iter().flat_map(|lens| lens.elements(&tool)));
        // Without a tag on the gripper and without touches nothing watches over what is beyond the camera.
        let is_watched = touches.is_some() || self.problem.layout.gripper_tag.is_some();
        let worth_m = if is_watched { WORTH_SHARE } else { WORTH_SHARE_UNWATCHED } * predicted_m;
        let covariance = |at: usize| {
            if let Some(touches) = touches {
                return touches.beside_parameters_m2(self.problem.robot, &tool[at]);
            }
            let unmodelled = elements.iter().filter(|element| !element.is_counted);
            let by_drawing: Matrix3<f64> =
                unmodelled.map(|element| element.shifts[at] * element.shifts[at].transpose()).sum();
            by_drawing + lens.as_ref().map_or_else(Matrix3::zeros, |lens| lens.covariance_m2(&tool[at]))
        };
        let mut reservations: Vec<Reservation> = elements
            .iter()
            .filter(|element| element.share_left > UNSEEN_SHARE && element.prior_std > 0.0)
            .filter(|element| !element.is_spoken_of)
            .filter(|element| element.touched_std > TOUCHED_SIGMAS * element.prior_std)
            .map(HeldElement::reservation)
            .filter(|reservation| reservation.tool_error_m > worth_m)
            .collect();
        reservations.sort_by(|a, b| b.tool_error_m.total_cmp(&a.tool_error_m));
        PriorImpact { reservations, covariances_m2: (0..task.len()).map(covariance).collect() }
    }

    fn held_elements(
        &self,
        touches: Option<&TouchUpdate>,
        task: &[JointAngles],
        tool: &[ToolJacobian],
    ) -> Vec<HeldElement> {
        let robot = self.problem.robot;
        let score = self.score();
        let joints = (0..robot.tool.mount.n_joints).map(GeometryElement::Joint);
        let mount = self.problem.layout.mount.map(|_| GeometryElement::Mount);
        let mut elements = Vec::new();
        let six =
            || [ErrorKind::Shift, ErrorKind::Turn].into_iter().flat_map(|error| (0..3).map(move |axis| (error, axis)));
        for element in joints.chain(mount) {
            elements
                .extend(six().map(|(error, axis)| self.held_element(&score, (element, error, axis), tool, touches)));
        }
        if self.problem.layout.links.is_empty() {
            elements.extend(six().map(|(error, axis)| self.survey_frame(&score, (error, axis), tool, touches)));
        }
        elements.extend((0..3).map(|axis| self.tool_point(axis, task, touches)));
        all_axes_alike(elements)
    }

    fn held_element(
        &self,
        score: &Score,
        (element, error, axis): (GeometryElement, ErrorKind, usize),
        tool: &[ToolJacobian],
        touches: Option<&TouchUpdate>,
    ) -> HeldElement {
        let robot = self.problem.robot;
        let (priors, camera) = (&robot.geometry, &robot.camera);
        let (first, _) = columns(element, error);
        let (scales, n_links) = (&self.problem.scales, self.problem.layout.links.len() / 6);
        let kind = usize::from(error == ErrorKind::Turn);
        let (is_estimated, prior_std) = match element {
            GeometryElement::Mount => {
                (true, scales.mount_scale[kind] * [camera.mount_std_m, camera.mount_std_rad][kind])
            }
            GeometryElement::Joint(joint) if joint < n_links => (true, scales.link_std[joint][kind]),
            GeometryElement::Joint(_) => (false, [priors.link_position_std_m, priors.link_rotation_std_rad][kind]),
        };
        let unit = [FindingUnit::Metre, FindingUnit::Radian][kind];
        let seen = score.information[(first + axis, first + axis)] * prior_std * prior_std;
        // The prior of what is estimated takes part in its information.
        let share_left = if is_estimated { 1.0 - seen } else { 1.0 / (1.0 + seen) };
        let size = Vector3::ith(axis, prior_std);
        let shifts = tool.iter().map(|at| at.shift(score, first, &size)).collect();
        let name = match element {
            GeometryElement::Joint(joint) => format!("the place of {}", robot.chain.joints()[joint].name),
            GeometryElement::Mount => "camera mount".to_owned(),
        };
        let way = if error == ErrorKind::Shift { "shift along" } else { "turn about" };
        let what = format!("{name}, {way} {}", AXES[axis]);
        // The mount's prior is in the estimate, and is left there.
        let own_std = if is_estimated { 0.0 } else { prior_std };
        let touched_std = touches.map_or(f64::INFINITY, |touches| touches.std_of_trial(first, axis, own_std));
        HeldElement {
            what,
            unit,
            prior_std,
            share_left,
            touched_std,
            shifts,
            is_counted: is_estimated,
            is_spoken_of: false,
        }
    }

    /// All tags together against the base: the same views as a base that is off the other way, and the tool that
    /// follows the estimate alone. Nobody states how well that is known; as well as a link, it is assumed.
    fn survey_frame(
        &self,
        score: &Score,
        (error, axis): (ErrorKind, usize),
        tool: &[ToolJacobian],
        touches: Option<&TouchUpdate>,
    ) -> HeldElement {
        let base = self.held_element(score, (GeometryElement::Joint(0), error, axis), tool, None);
        let (first, _) = columns(GeometryElement::Joint(0), error);
        let size = Vector3::ith(axis, base.prior_std);
        let way = if error == ErrorKind::Shift { "shift along" } else { "turn about" };
        HeldElement {
            what: format!("tag survey, {way} {}", AXES[axis]),
            touched_std: touches.map_or(f64::INFINITY, |touches| touches.std_of_survey(first, axis)),
            shifts: tool.iter().map(|at| -at.followed(score, first, &size)).collect(),
            ..base
        }
    }

    /// No view shows the tool's point.
    fn tool_point(&self, axis: usize, task: &[JointAngles], touches: Option<&TouchUpdate>) -> HeldElement {
        let robot = self.problem.robot;
        let prior_std = robot.geometry.tool_position_std_m;
        let tool = &robot.tool.mount;
        let shift =
            |angles: &JointAngles| robot.chain.link_poses(angles).frame(tool).rotation * Vector3::ith(axis, prior_std);
        HeldElement {
            what: format!("tool point, shift along {}", AXES[axis]),
            unit: FindingUnit::Metre,
            prior_std,
            share_left: 1.0,
            touched_std: touches.map_or(f64::INFINITY, |touches| touches.std_of_tool_point(robot, axis)),
            shifts: task.iter().map(shift).collect(),
            is_counted: false,
            is_spoken_of: false,
        }
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];
/// Axes whose shifts are within this share of one another at the tool are spoken of together.
const ALIKE: f64 = 0.05;

/// Names three neighbouring elements that only differ by their axis, and mean the same at the tool, as one.
fn all_axes_alike(mut elements: Vec<HeldElement>) -> Vec<HeldElement> {
    for three in elements.chunks_exact_mut(3) {
        let sizes = [0, 1, 2].map(|axis| three[axis].reservation().tool_error_m);
        let (least, most) =
            (sizes.iter().copied().fold(f64::INFINITY, f64::min), sizes.iter().copied().fold(0.0, f64::max));
        let is_open = |element: &HeldElement| element.share_left > UNSEEN_SHARE && element.touched_std.is_infinite();
        if most - least <= ALIKE * most && three.iter().all(is_open) {
            let stem = three[0].what.trim_end_matches(AXES[0]).to_owned();
            three[0].what = format!("{stem}any axis");
            three[1..].iter_mut().for_each(|element| element.is_spoken_of = true);
        }
    }
    elements
}

impl HeldElement {
    fn reservation(&self) -> Reservation {
        let n = self.shifts.len().max(1) as f64;
        let tool_error_m = (self.shifts.iter().map(Vector3::norm_squared).sum::<f64>() / n).sqrt();
        Reservation { what: self.what.clone(), prior_std: self.prior_std, unit: self.unit, tool_error_m }
    }
}
