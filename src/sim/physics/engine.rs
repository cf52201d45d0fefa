//! Interface of a rigid-body engine for an arm on its vehicle.

use nalgebra::Isometry3;

use crate::body_poses::BodyPoses;
use crate::dynamics::{Body, Force, JointLoad};
use crate::solids::Solids;
use crate::spec::{EngineKind, PhysicsSpec};
use crate::vehicle::{BaseState, WaterMotion};
use armcal_core::kinematics::Chain;
use armcal_core::spatial::{Base, Pose, Vehicle};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Initial state and properties of an arm for an engine.
pub(crate) struct PhysicsInput<'a> {
    pub chain: &'a Chain,
    /// Bodies 0..=n, base first; the base's body matters only for a floating vehicle.
    pub bodies: Vec<Body>,
    /// Pose `world_from_base` of a floating vehicle.
    pub free_base: Option<Isometry3<f64>>,
    /// Solids of the arm and its surroundings; `None` for an arm without collisions.
    pub solids: Option<&'a Solids>,
    pub engine: EngineKind,
    pub spec: &'a PhysicsSpec,
    pub angles: JointAngles,
}

/// Inputs of a step: the base's motion at both ends of the step, if it is prescribed, the water's motion in world axes,
/// and the loads on joints and bodies.
pub(crate) struct Drive<'a> {
    pub base: [&'a BaseState; 2],
    pub water: [WaterMotion; 2],
    /// Force on each body in addition to gravity and water, about the base's origin, base axes.
    pub wrenches: &'a [Force; MAX_JOINTS + 1],
    /// Torque about each joint, linear in angle and rate.
    pub loads: &'a [JointLoad; MAX_JOINTS],
}

/// State of an arm, and of its vehicle if it floats, advanced step by step.
pub(super) trait Engine: Send {
    /// Returns the true joint angles, rad.
    fn angles(&self) -> JointAngles;

    /// Returns the true joint rates, rad/s.
    fn rates(&self) -> JointAngles;

    /// Returns the poses of all links, base frame.
    fn poses(&self) -> BodyPoses;

    /// Returns the motion of a floating base; `None` if its motion is prescribed.
    fn base_state(&self, _vehicle_from_base: &Pose<Vehicle, Base>) -> Option<BaseState> {
        None
    }

    /// Moves the first joint to its pose on the mount.
    fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>);

    /// Advances by one step.
    fn step(&mut self, drive: &Drive);

    /// Returns the torque of gravity and buoyancy about each joint at `angles`, N m.
    #[cfg(test)]
    fn static_torques(&self, gravity: &nalgebra::Vector3<f64>, angles: &JointAngles) -> JointAngles;

    /// Calls `touch` with the two parts of every pair that touched in the last step.
    fn for_each_contact(&self, touch: &mut dyn FnMut(usize, usize));
}
