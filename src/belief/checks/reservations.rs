//! What rests on priors alone: elements of the geometry that the views do not tell, and what each means at the tool.
//!
//! Each element z (a joint's place on its parent link, the camera's mount, the tool point) is held at the drawing. By
//! the score test's quantities, z has the information I from the views, all estimated parameters x eliminated, and the
//! estimate follows it by `dx/dz`. An error of one sigma s of z's prior moves the tool by
//! `t = (d tool/dz + d tool/dx dx/dz) s`. Views leave `1 / (1 + I s^2)` of the prior's variance: an element of which
//! more than half is left is unseen. What is not estimated adds `t t^T` to the tool's covariance.

mod lens;

use crate::checks::constants::reservations::{
    ALIKE, MAX_RESERVATIONS, TOUCHED_SIGMAS, UNSEEN_SHARE, WORTH_SHARE, WORTH_SHARE_UNWATCHED,
};
use nalgebra::{Matrix3, Vector3};

use crate::checks::touch_term::TouchUpdate;
use crate::explain::score_test::{GeometryElement, Score, ToolJacobian, columns};
use crate::model::blocks::Block;
use crate::say::finding::FindingUnit;
use crate::say::geometry_error::ErrorKind;
use crate::say::reservation::Reservation;
use crate::solve::estimate::Estimate;
use armcal_core::joints::JointAngles;
use armcal_core::robot::geometry::GeometryPriors;

/// An element of the geometry along one axis, with its prior.
struct HeldElement {
    /// What it is, up to its axis.
    stem: String,
    axis: &'static str,
    unit: FindingUnit,
    prior_std: f64,
    /// Share of the prior's variance that the views leave.
    share_left: f64,
    /// One sigma to which touches tell it; infinite without them.
    touched_std: f64,
    /// Of the tool by one sigma, at each configuration, m.
    shifts: Vec<Vector3<f64>>,
    /// Whether the tool's covariance has it already: by the estimate's parameters, or by the lens's.
    is_counted: bool,
    /// Key of robot.toml that would state `prior_std`, where it does not.
    unstated: Option<&'static str>,
}

/// What priors alone say of the tool.
pub(crate) struct PriorImpact {
    /// The largest first.
    pub reservations: Vec<Reservation>,
    /// Added to the tool's covariance at each configuration, m^2; without elements of which no sigma is stated.
    pub covariances_m2: Vec<Matrix3<f64>>,
    /// Kinds of elements that are not in it: their keys in robot.toml.
    pub not_included: Vec<&'static str>,
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
        let lenses = self.held_lenses();
        let mut elements = self.held_elements(touches, task, &tool);
        elements.extend(lenses.iter().flat_map(|lens| lens.elements(&tool)));
        // Without a tag on the gripper and without touches nothing watches over what is beyond the camera.
        let is_watched = touches.is_some() || self.has(Block::GripperTag);
        let worth_m = if is_watched { WORTH_SHARE } else { WORTH_SHARE_UNWATCHED } * predicted_m;
        let covariance = |at: usize| {
            if let Some(touches) = touches {
                return touches.beside_parameters_m2(self.problem.robot, &tool[at]);
            }
            let unmodelled = elements.iter().filter(|element| !element.is_counted && element.unstated.is_none());
            let by_drawing: Matrix3<f64> =
                unmodelled.map(|element| element.shifts[at] * element.shifts[at].transpose()).sum();
            by_drawing + lenses.iter().map(|lens| lens.covariance_m2(&tool[at])).sum::<Matrix3<f64>>()
        };
        let mut reservations: Vec<Reservation> =
            elements.chunk_by(|a, b| a.stem == b.stem).flat_map(|alike| reservations_of(alike, worth_m)).collect();
        reservations.sort_by(|a, b| b.tool_error_m.total_cmp(&a.tool_error_m));
        let mut not_included: Vec<&'static str> =
            elements.iter().filter(|element| element.is_open()).filter_map(|element| element.unstated).collect();
        not_included.sort_unstable();
        not_included.dedup();
        PriorImpact { reservations, covariances_m2: (0..task.len()).map(covariance).collect(), not_included }
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
        let mount = self.has(Block::Mount(0)).then_some(GeometryElement::Mount);
        let mut elements = Vec::new();
        let six =
            || [ErrorKind::Shift, ErrorKind::Turn].into_iter().flat_map(|error| (0..3).map(move |axis| (error, axis)));
        for element in joints.chain(mount) {
            elements
                .extend(six().map(|(error, axis)| self.held_element(&score, (element, error, axis), tool, touches)));
        }
        elements.extend(six().map(|(error, axis)| self.survey_frame(&score, (error, axis), tool, touches)));
        elements.extend((0..3).map(|axis| self.tool_point(axis, task, touches)));
        elements
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
                (true, scales.mount_scale[0][kind] * [camera.mount_std_m, camera.mount_std_rad][kind])
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
            GeometryElement::Joint(joint) => format!("pose of {}", robot.chain.joints()[joint].name),
            GeometryElement::Mount => "camera mount".to_owned(),
        };
        let way = if error == ErrorKind::Shift { "shift along" } else { "rotation about" };
        let stem = format!("{name}, {way} ");
        // The mount's prior is in the estimate, and is left there.
        let own_std = if is_estimated { 0.0 } else { prior_std };
        let touched_std = touches.map_or(f64::INFINITY, |touches| touches.std_of_trial(first, axis, own_std));
        let unstated = match element {
            GeometryElement::Mount => None,
            GeometryElement::Joint(_) => unstated_link(priors, error),
        };
        HeldElement {
            stem,
            axis: AXES[axis],
            unit,
            prior_std,
            share_left,
            touched_std,
            shifts,
            is_counted: is_estimated,
            unstated,
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
        let priors = &self.problem.robot.geometry;
        let (way, prior_std) = match error {
            ErrorKind::Shift => ("shift along", priors.link_position_std_m),
            ErrorKind::Turn => ("rotation about", priors.link_rotation_std_rad),
        };
        let size = Vector3::ith(axis, prior_std);
        HeldElement {
            stem: format!("tag survey, {way} "),
            prior_std,
            // A base that is estimated takes up all of it.
            share_left: if base.is_counted { 1.0 } else { base.share_left },
            touched_std: touches.map_or(f64::INFINITY, |touches| touches.std_of_survey(first, axis)),
            shifts: tool.iter().map(|at| -at.followed(score, first, &size)).collect(),
            is_counted: false,
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
            stem: "tool point, shift along ".to_owned(),
            axis: AXES[axis],
            unit: FindingUnit::Metre,
            prior_std,
            share_left: 1.0,
            touched_std: touches.map_or(f64::INFINITY, |touches| touches.std_of_tool_point(robot, axis)),
            shifts: task.iter().map(shift).collect(),
            is_counted: false,
            unstated: (!robot.geometry.stated.tool_position).then_some("tool_position_std_m"),
        }
    }
}

/// Key of robot.toml that would state how well links are known, where it does not.
fn unstated_link(priors: &GeometryPriors, error: ErrorKind) -> Option<&'static str> {
    match error {
        ErrorKind::Shift => (!priors.stated.link_position).then_some("link_position_std_m"),
        ErrorKind::Turn => (!priors.stated.link_rotation).then_some("link_rotation_std_rad"),
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// What is told of elements that only differ by their axis.
fn reservations_of(elements: &[HeldElement], worth_m: f64) -> Option<Reservation> {
    let open: Vec<&HeldElement> = elements.iter().filter(|e| e.is_open() && e.tool_error_m() > worth_m).collect();
    let each: Vec<f64> = open.iter().map(|element| element.tool_error_m()).collect();
    let (least, most) = (each.iter().copied().fold(f64::INFINITY, f64::min), each.iter().copied().fold(0.0, f64::max));
    let first = open.first()?;
    let are_alike = most - least <= ALIKE * most;
    let axes = match &open[..] {
        [_, _, _] if are_alike => "any axis".to_owned(),
        _ => open.iter().map(|element| element.axis).collect::<Vec<_>>().join(", "),
    };
    Some(Reservation {
        what: format!("{}{axes}", first.stem),
        prior_std: first.prior_std,
        unit: first.unit,
        tool_error_m: most,
        by_axis_m: if are_alike { Vec::new() } else { each },
        included: first.unstated.is_none(),
    })
}

impl HeldElement {
    /// Neither views nor touches tell it.
    fn is_open(&self) -> bool {
        self.share_left > UNSEEN_SHARE && self.prior_std > 0.0 && self.touched_std > TOUCHED_SIGMAS * self.prior_std
    }

    /// By one sigma, root mean square.
    fn tool_error_m(&self) -> f64 {
        let n = self.shifts.len().max(1) as f64;
        (self.shifts.iter().map(Vector3::norm_squared).sum::<f64>() / n).sqrt()
    }
}
