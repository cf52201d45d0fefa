//! What rests on priors alone: elements of the geometry that the views do not tell, and what each means at the tool.
//!
//! Each element z (a joint's place on its parent link, the camera's mount, the tool point) is held at the drawing. By
//! the score test's quantities, z has the information I from the views, all estimated parameters x eliminated, and the
//! estimate follows it by `dx/dz`. An error of one sigma s of z's prior moves the tool by
//! `t = (d tool/dz + d tool/dx dx/dz) s`. Views leave `1 / (1 + I s^2)` of the prior's variance: an element of which
//! more than half is left is unseen. What is not estimated adds `t t^T` to the tool's covariance.

use nalgebra::{Matrix3, Vector3};

use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::score_test::{GeometryElement, Score, ToolJacobian, columns};
use crate::calib::finding::FindingUnit;
use crate::calib::geometry_error::ErrorKind;
use crate::calib::reservation::Reservation;
use armcal_core::joints::JointAngles;

/// Share of the prior's variance that the views leave, above which an element counts as unseen.
const UNSEEN_SHARE: f64 = 0.5;
/// A reservation is worth a line where one sigma of it moves the tool by more than this share of the predicted error.
const WORTH_SHARE: f64 = 0.5;

/// An element of the geometry along one axis, with its prior.
struct HeldElement {
    what: String,
    unit: FindingUnit,
    prior_std: f64,
    /// Share of the prior's variance that the views leave.
    share_left: f64,
    /// Of the tool by one sigma, at each configuration, m.
    shifts: Vec<Vector3<f64>>,
    /// Whether the estimate has it as a parameter, so that its covariance has it already.
    is_estimated: bool,
}

/// What priors alone say of the tool.
pub(crate) struct PriorImpact {
    /// The largest first.
    pub reservations: Vec<Reservation>,
    /// Added to the tool's covariance at each configuration, m^2.
    pub covariances_m2: Vec<Matrix3<f64>>,
}

impl Estimate<'_> {
    /// What the drawing leaves open at `task`, where the data alone predict `predicted_m`.
    pub(crate) fn prior_impact(&self, task: &[JointAngles], predicted_m: f64) -> PriorImpact {
        let elements = self.held_elements(task);
        let covariance = |at: usize| {
            let unmodelled = elements.iter().filter(|element| !element.is_estimated);
            unmodelled.map(|element| element.shifts[at] * element.shifts[at].transpose()).sum()
        };
        let mut reservations: Vec<Reservation> = elements
            .iter()
            .filter(|element| element.share_left > UNSEEN_SHARE && element.prior_std > 0.0)
            .map(HeldElement::reservation)
            .filter(|reservation| reservation.tool_error_m > WORTH_SHARE * predicted_m)
            .collect();
        reservations.sort_by(|a, b| b.tool_error_m.total_cmp(&a.tool_error_m));
        PriorImpact { reservations, covariances_m2: (0..task.len()).map(covariance).collect() }
    }

    fn held_elements(&self, task: &[JointAngles]) -> Vec<HeldElement> {
        let robot = self.problem.robot;
        let score = self.score();
        let tool = self.tool_jacobians(task);
        let joints = (0..robot.tool.mount.n_joints).map(GeometryElement::Joint);
        let mount = self.problem.layout.mount.map(|_| GeometryElement::Mount);
        let mut elements = Vec::new();
        for element in joints.chain(mount) {
            for error in [ErrorKind::Shift, ErrorKind::Turn] {
                for axis in 0..3 {
                    elements.push(self.held_element(&score, (element, error, axis), &tool));
                }
            }
        }
        elements.extend((0..3).map(|axis| self.tool_point(axis, task)));
        elements
    }

    fn held_element(
        &self,
        score: &Score,
        (element, error, axis): (GeometryElement, ErrorKind, usize),
        tool: &[ToolJacobian],
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
        HeldElement { what, unit, prior_std, share_left, shifts, is_estimated }
    }

    /// No view shows the tool's point.
    fn tool_point(&self, axis: usize, task: &[JointAngles]) -> HeldElement {
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
            shifts: task.iter().map(shift).collect(),
            is_estimated: false,
        }
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl HeldElement {
    fn reservation(&self) -> Reservation {
        let n = self.shifts.len().max(1) as f64;
        let tool_error_m = (self.shifts.iter().map(Vector3::norm_squared).sum::<f64>() / n).sqrt();
        Reservation { what: self.what.clone(), prior_std: self.prior_std, unit: self.unit, tool_error_m }
    }
}
