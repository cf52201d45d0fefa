//! Geometry elements that only a prior determines, and the tool error that each may cause.
//!
//! Each element z (pose of a joint on its parent link, camera mount, tool point) is held at the nominal model. The
//! score test gives the information I that the views have on z, with all estimated parameters x marginalised. The
//! estimate follows z by `dx/dz`. A prior error of one standard deviation s moves the tool by
//! `t = (d tool/dz + d tool/dx dx/dz) s`. The views leave `1 / (1 + I s^2)` of the prior's variance; an element that
//! keeps more than half of it is unseen. An element that is not estimated adds `t t^T` to the tool's covariance.

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
    /// Name of the element without its axis.
    stem: String,
    axis: &'static str,
    unit: FindingUnit,
    prior_std: f64,
    /// Share of the prior's variance that the views leave.
    share_left: f64,
    /// Standard deviation from the touches; infinite without touches.
    touched_std: f64,
    /// Tool displacement by one prior standard deviation at each configuration, m.
    shifts: Vec<Vector3<f64>>,
    /// True if the tool's covariance already includes the element, through the estimated parameters or the lens.
    is_counted: bool,
    /// Key of robot.toml for `prior_std` if the file does not state it.
    unstated: Option<&'static str>,
}

/// Tool error caused by elements that only a prior determines.
pub(crate) struct PriorImpact {
    /// Reservations, the largest tool error first.
    pub reservations: Vec<Reservation>,
    /// Covariance to add to the tool's at each configuration, m^2. Without touches, it excludes elements with no stated
    /// standard deviation.
    pub covariances_m2: Vec<Matrix3<f64>>,
    /// Keys in robot.toml of the kinds of unseen elements whose standard deviation is not stated.
    pub not_included: Vec<&'static str>,
}

impl PriorImpact {
    /// Returns the reservations to report, at most `MAX_RESERVATIONS`.
    pub(crate) fn told(mut self) -> Vec<Reservation> {
        self.reservations.truncate(MAX_RESERVATIONS);
        self.reservations
    }
}

impl Estimate<'_> {
    /// Computes the tool error from priors at `task`. `predicted_m`: tool error predicted from the data only, m.
    #[cfg(test)]
    pub(crate) fn prior_impact(&self, task: &[JointAngles], predicted_m: f64) -> PriorImpact {
        self.prior_impact_with(None, task, predicted_m)
    }

    /// Computes the tool error from priors at `task`, with the touches if there are any. `self`: the estimate from the
    /// views only.
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
        // Without a gripper tag or touches, nothing checks the links distal to the camera.
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
        // The information of an estimated element includes its prior.
        let share_left = if is_estimated { 1.0 - seen } else { 1.0 / (1.0 + seen) };
        let size = Vector3::ith(axis, prior_std);
        let shifts = tool.iter().map(|at| at.shift(score, first, &size)).collect();
        let name = match element {
            GeometryElement::Joint(joint) => format!("pose of {}", robot.chain.joints()[joint].name),
            GeometryElement::Mount => "camera mount".to_owned(),
        };
        let way = if error == ErrorKind::Shift { "shift along" } else { "rotation about" };
        let stem = format!("{name}, {way} ");
        // The estimate includes the prior of an estimated element, which stays in it.
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

    /// Pose of the whole tag survey relative to the base. The views cannot distinguish it from an opposite error of the
    /// base, but the tool then only follows the estimate. Nobody states its accuracy, so that of a link is assumed.
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
            // An estimated base absorbs the whole error of the survey.
            share_left: if base.is_counted { 1.0 } else { base.share_left },
            touched_std: touches.map_or(f64::INFINITY, |touches| touches.std_of_survey(first, axis)),
            shifts: tool.iter().map(|at| -at.followed(score, first, &size)).collect(),
            is_counted: false,
            ..base
        }
    }

    /// Tool point, which no view constrains.
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

/// Key of robot.toml for the standard deviation of links if the file does not state it.
fn unstated_link(priors: &GeometryPriors, error: ErrorKind) -> Option<&'static str> {
    match error {
        ErrorKind::Shift => (!priors.stated.link_position).then_some("link_position_std_m"),
        ErrorKind::Turn => (!priors.stated.link_rotation).then_some("link_rotation_std_rad"),
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Reservation on elements that differ only by their axis. `None` if no unseen one moves the tool by more than
/// `worth_m`.
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
    /// Returns true if neither views nor touches determine the element.
    fn is_open(&self) -> bool {
        self.share_left > UNSEEN_SHARE && self.prior_std > 0.0 && self.touched_std > TOUCHED_SIGMAS * self.prior_std
    }

    /// Tool error by one prior standard deviation, root mean square over the configurations, m.
    fn tool_error_m(&self) -> f64 {
        let n = self.shifts.len().max(1) as f64;
        (self.shifts.iter().map(Vector3::norm_squared).sum::<f64>() / n).sqrt()
    }
}
