//! Hose that pulls a link toward its anchor.

use nalgebra::Vector3;

use crate::dynamics::Force;
use crate::spec::StructureSpec;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::Robot;

/// Spring that pulls and never pushes, `k max(0, |d| - l)` along the line `d` between its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hose {
    body: usize,
    point_m: Vector3<f64>,
    anchor_m: Vector3<f64>,
    length_m: f64,
    stiffness_n_m: f64,
}

impl Hose {
    pub(super) fn new(spec: &StructureSpec, robot: &Robot) -> Option<Self> {
        let body = robot.bodies.iter().position(|body| body.name == spec.hose_link)?;
        (spec.hose_stiffness_n_m > 0.0).then_some(Self {
            body,
            point_m: spec.hose_point_m.into(),
            anchor_m: spec.hose_anchor_m.into(),
            length_m: spec.hose_length_m,
            stiffness_n_m: spec.hose_stiffness_n_m,
        })
    }

    /// Returns the body that it pulls, and the force on it about the base's origin, base axes.
    pub(super) fn pull(&self, links: &LinkPoses) -> (usize, Force) {
        let point = links.link(self.body).transform_point(&self.point_m.into()).coords;
        let line = self.anchor_m - point;
        let distance_m = line.norm();
        let pull_n = self.stiffness_n_m * (distance_m - self.length_m).max(0.0);
        let force = if pull_n > 0.0 { line * (pull_n / distance_m) } else { Vector3::zeros() };
        (self.body, Force::at(&point, &force))
    }
}
