//! Compliant parts and external loads of one arm.

use nalgebra::{Isometry3, Vector3};

use crate::dynamics::{BaseCoupling, Body, Environment, EquationInput, Force, JointLoad, Motion, Multibody};
use crate::spec::StructureSpec;
use crate::structure::hose::Hose;
use crate::structure::joint_shaft::JointShaft;
use crate::structure::mount::Mount;
use crate::vehicle::{BaseState, WaterMotion};
use armcal_core::robot::Robot;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Shafts of all joints, mount and hose, and the arm that loads them.
#[derive(Clone, Debug)]
pub(crate) struct FlexibleArm {
    /// Arm on its deflected mount; body 0 is the arm's own base.
    arm: Multibody,
    /// Nominal pose of the first joint on the base.
    drawn: Isometry3<f64>,
    shafts: [JointShaft; MAX_JOINTS],
    is_stiff: bool,
    mount: Option<Mount>,
    hose: Option<Hose>,
    rates_before: JointAngles,
    step_s: f64,
}

/// State of the arm at the end of a step, and its surroundings.
pub(crate) struct ArmState<'a> {
    pub angles: &'a JointAngles,
    /// Joint rates, rad/s.
    pub rates: &'a JointAngles,
    pub base: &'a BaseState,
    pub water: &'a WaterMotion,
}

/// Equilibrium of an arm at rest.
pub(crate) struct Balance {
    /// Angles of the links.
    pub angles: JointAngles,
    /// Torques of weight, buoyancy and hose about each joint, N m.
    pub torques: JointAngles,
}

/// Number of iterations until an arm is in equilibrium. Each leaves a share of the error: the compliance times the
/// change of the load with the deflection.
const SETTLING_ROUNDS: usize = 60;
/// Time much longer than the damping of any mount, s.
const FOREVER_S: f64 = 1e12;

impl FlexibleArm {
    /// Builds the arm; `bodies` are those of the links 0..=n, the arm's own base first.
    pub(crate) fn new(spec: &StructureSpec, robot: &Robot, bodies: Vec<Body>, step_s: f64) -> Self {
        let mut shafts = [JointShaft::default(); MAX_JOINTS];
        for (shaft, joint) in shafts.iter_mut().zip(robot.chain.joints()) {
            *shaft = JointShaft::new(spec.joint_compliance(&joint.name), spec.bearing_play(&joint.name));
        }
        Self {
            drawn: robot.chain.first_place(),
            arm: Multibody::new(robot.chain.clone(), bodies),
            is_stiff: shafts.iter().all(JointShaft::is_rigid),
            shafts,
            mount: Mount::new(spec),
            hose: Hose::new(spec, robot),
            rates_before: JointAngles::zeros(robot.n_joints()),
            step_s,
        }
    }

    /// Finds the equilibrium of an arm at rest whose shafts have these angles.
    pub(crate) fn settle(&mut self, shafts: &JointAngles, gravity: &Vector3<f64>) -> Balance {
        let n = shafts.len();
        let around = Environment { gravity: *gravity, ..Environment::still(0.0) };
        let (still, held) = (JointAngles::zeros(n), BaseCoupling::Prescribed(Motion::zero()));
        let mut balance = Balance { angles: *shafts, torques: still };
        for _ in 0..SETTLING_ROUNDS {
            let extra = self.pulls_on_links(&balance.angles);
            let input =
                EquationInput { angles: &balance.angles, rates: &still, around: &around, base: &held, extra: &extra };
            let needed = self.arm.equations(&input).bias;
            let load = Force::zero() - self.arm.base_force(&input, &still);
            self.bend_mount(&load, FOREVER_S);
            balance.torques = JointAngles::from_fn(n, |j| -needed[j]);
            if !self.is_stiff {
                balance.angles = JointAngles::from_fn(n, |j| shafts[j] - self.shafts[j].settle(needed[j]));
            }
        }
        balance
    }

    /// Returns the pose of the first joint in the base frame.
    pub(crate) fn first_place(&self) -> Isometry3<f64> {
        self.arm.chain().first_place()
    }

    /// Returns angles and rates of the shafts, which the sensors and the drives are on.
    pub(crate) fn shafts(&self, angles: &JointAngles, rates: &JointAngles) -> (JointAngles, JointAngles) {
        if self.is_stiff {
            return (*angles, *rates);
        }
        let n = angles.len();
        let shaft_angles = JointAngles::from_fn(n, |j| angles[j] + self.shafts[j].twist_rad);
        (shaft_angles, JointAngles::from_fn(n, |j| rates[j] + self.shafts[j].twist_rate_rad_s))
    }

    /// Returns the load about the link of `joint` during a step in which `drive` acts on its shaft; `link` is the
    /// link's angle and rate at the step's start.
    pub(crate) fn load(&mut self, joint: usize, drive: JointLoad, link: [f64; 2]) -> JointLoad {
        if self.is_stiff { drive } else { self.shafts[joint].load(drive, link, self.step_s) }
    }

    /// Returns the hose's forces on the links, about the base's origin in base axes, and on the vehicle from which it
    /// comes.
    pub(crate) fn pulls(&self, angles: &JointAngles) -> [Force; MAX_JOINTS + 1] {
        let mut pulls = self.pulls_on_links(angles);
        pulls[0] = pulls.iter().fold(Force::zero(), |sum, pull| sum - *pull);
        pulls
    }

    fn pulls_on_links(&self, angles: &JointAngles) -> [Force; MAX_JOINTS + 1] {
        let mut pulls = [Force::zero(); MAX_JOINTS + 1];
        if let Some(hose) = &self.hose {
            let (body, force) = hose.pull(&self.arm.chain().link_poses(angles));
            pulls[body] = force;
        }
        pulls
    }

    /// Takes the state at a step's end; returns the pose of the first joint if the mount has changed it.
    pub(crate) fn follow(&mut self, state: &ArmState) -> Option<Isometry3<f64>> {
        let ArmState { angles, rates, .. } = *state;
        if !self.is_stiff {
            for (j, shaft) in self.shafts.iter_mut().enumerate().take(angles.len()) {
                shaft.follow(angles[j], rates[j], self.step_s);
            }
        }
        self.mount.as_ref()?;
        let load = self.load_on_mount(state);
        self.rates_before = *rates;
        self.bend_mount(&load, self.step_s)
    }

    fn bend_mount(&mut self, load: &Force, elapsed_s: f64) -> Option<Isometry3<f64>> {
        let place = self.mount.as_mut()?.follow(load, elapsed_s) * self.drawn;
        self.arm.set_first_place(&place);
        Some(place)
    }

    /// Returns the wrench of base and arm on the vehicle: weight, water, inertia and hose. Contacts of the arm are
    /// excluded.
    fn load_on_mount(&self, state: &ArmState) -> Force {
        let ArmState { angles, rates, base, water } = *state;
        let around = base.environment(water);
        let input = EquationInput {
            angles,
            rates,
            around: &around,
            base: &BaseCoupling::Prescribed(base.spatial_acceleration()),
            extra: &self.pulls_on_links(angles),
        };
        let accelerations = JointAngles::from_fn(angles.len(), |j| (rates[j] - self.rates_before[j]) / self.step_s);
        Force::zero() - self.arm.base_force(&input, &accelerations)
    }
}
