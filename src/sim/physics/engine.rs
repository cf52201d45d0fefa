//! What an engine of rigid bodies does for an arm on its vehicle.

use nalgebra::Isometry3;

use crate::body_poses::BodyPoses;
use crate::dynamics::{Body, Force, JointLoad};
use crate::solids::Solids;
use crate::spec::{EngineKind, PhysicsSpec};
use crate::vehicle::{BaseState, WaterMotion};
use armcal_core::kinematics::Chain;
use armcal_core::spatial::{Base, Pose, Vehicle};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// An arm as an engine starts with it.
pub(crate) struct PhysicsInput<'a> {
    pub chain: &'a Chain,
    /// Bodies 0..=n, base first; that of the base counts for a vehicle that floats only.
    pub bodies: Vec<Body>,
    /// `world_from_base` of a vehicle that floats.
    pub free_base: Option<Isometry3<f64>>,
    /// `None` for an arm that collides with nothing.
    pub solids: Option<&'a Solids>,
    pub engine: EngineKind,
    pub spec: &'a PhysicsSpec,
    pub angles: JointAngles,
}

/// The base's motion at both ends of a step, where it is prescribed; the water's, in world axes; and what acts on
/// joints and bodies.
pub(crate) struct Drive<'a> {
    pub base: [&'a BaseState; 2],
    pub water: [WaterMotion; 2],
    /// On each body besides gravity and water, about the base's origin, base axes.
    pub wrenches: &'a [Force; MAX_JOINTS + 1],
    /// Torque about each joint, linear in angle and rate.
    pub loads: &'a [JointLoad; MAX_JOINTS],
}

/// State of an arm, and of its vehicle where that floats, moved step by step.
pub(super) trait Engine: Send {
    /// True joint angles, rad.
    fn angles(&self) -> JointAngles;

    /// True joint rates, rad/s.
    fn rates(&self) -> JointAngles;

    /// Poses of all links, base frame.
    fn poses(&self) -> BodyPoses;

    /// Motion of a base that floats; `None` where it moves as prescribed.
    fn base_state(&self, _vehicle_from_base: &Pose<Vehicle, Base>) -> Option<BaseState> {
        None
    }

    /// Puts the first joint where the mount has brought it.
    fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>);

    /// One step.
    fn step(&mut self, drive: &Drive);

    /// Torque of gravity and buoyancy about each joint at `angles`, N m.
    #[cfg(test)]
    fn static_torques(&self, gravity: &nalgebra::Vector3<f64>, angles: &JointAngles) -> JointAngles;

    /// Calls `touch` with the two parts of every pair that touched in the last step.
    fn for_each_contact(&self, touch: &mut dyn FnMut(usize, usize));
}
