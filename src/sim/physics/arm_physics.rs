//! State of arm and vehicle, advanced by the engine that the world names.

use nalgebra::{Isometry3, Vector3};

use crate::body_poses::BodyPoses;
use crate::dynamics::Force;
use crate::error::SimError;
use crate::physics::engine::{Drive, Engine, PhysicsInput};
use crate::physics::featherstone::Featherstone;
use crate::physics::rapier::RapierArm;
use crate::spec::EngineKind;
use crate::vehicle::BaseState;
use armcal_core::spatial::{Base, Pose, Vehicle};
use armcal_core::streams::JointAngles;

/// Arm, the vehicle if it is free, and the solids with which they may collide.
pub(crate) struct ArmPhysics {
    engine: Box<dyn Engine>,
    push: Option<Push>,
    step_s: f64,
}

/// Force on a link for some time.
#[derive(Clone, Copy, Debug)]
struct Push {
    body: usize,
    point_m: Vector3<f64>,
    force_n: Vector3<f64>,
    steps: u64,
}

impl ArmPhysics {
    /// Builds the arm's physics.
    ///
    /// # Errors
    /// [`SimError`] for what the engine cannot do.
    pub(crate) fn new(input: PhysicsInput) -> Result<Self, SimError> {
        let step_s = input.spec.step_s;
        let engine: Box<dyn Engine> = match input.engine {
            EngineKind::Featherstone => Box::new(Featherstone::new(input)),
            EngineKind::Rapier => Box::new(RapierArm::new(input)?),
        };
        Ok(Self { engine, push: None, step_s })
    }

    /// Moves the first joint to its pose on the mount.
    pub(crate) fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>) {
        self.engine.set_first_place(base_from_joint);
    }

    /// Returns the true joint angles, rad.
    pub(crate) fn angles(&self) -> JointAngles {
        self.engine.angles()
    }

    /// Returns the true joint rates, rad/s.
    pub(crate) fn rates(&self) -> JointAngles {
        self.engine.rates()
    }

    /// Returns the poses of all links, base frame.
    pub(crate) fn poses(&self) -> BodyPoses {
        self.engine.poses()
    }

    /// Returns a free base's motion; `None` if its motion is prescribed.
    pub(crate) fn base_state(&self, vehicle_from_base: &Pose<Vehicle, Base>) -> Option<BaseState> {
        self.engine.base_state(vehicle_from_base)
    }

    /// Pushes a link for some time at a point of its own frame, with a force in base axes.
    pub(crate) fn push(&mut self, body: usize, point_m: &Vector3<f64>, force_n: &Vector3<f64>, duration_s: f64) {
        let steps = (duration_s / self.step_s).round().max(1.0) as u64;
        self.push = Some(Push { body, point_m: *point_m, force_n: *force_n, steps });
    }

    /// Advances by one step.
    pub(crate) fn step(&mut self, drive: &Drive) {
        let Some(push) = &mut self.push else { return self.engine.step(drive) };
        let mut wrenches = *drive.wrenches;
        let poses = self.engine.poses();
        let place = poses.link(push.body);
        let point = place.rotation * push.point_m + place.translation.vector;
        wrenches[push.body] += Force::at(&point, &push.force_n);
        push.steps -= 1;
        if push.steps == 0 {
            self.push = None;
        }
        self.engine.step(&Drive { wrenches: &wrenches, ..*drive });
    }

    /// Calls `touch` with the two parts of every pair that touches now.
    pub(crate) fn for_each_contact(&self, mut touch: impl FnMut(usize, usize)) {
        self.engine.for_each_contact(&mut touch);
    }
}
