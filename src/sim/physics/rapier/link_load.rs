//! Wrenches on the links: gravity, water, and the inertial forces of a moving base.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::dynamics::{Body, Environment, Force, Inertia, Motion};
use armcal_core::kinematics::LinkPoses;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Link: its body in water, and the rigid body that represents it in rapier.
pub(super) struct Link {
    body: Body,
    /// Inertia of rapier's rigid body, about the link's origin.
    engine: Inertia,
    pub engine_mass_kg: f64,
    pub engine_com_m: Vector3<f64>,
}

/// State of the arm on its base, in base axes about the base's origin.
pub(super) struct ArmState<'a> {
    pub poses: &'a LinkPoses,
    pub rates: &'a JointAngles,
    /// Rates of change of the joint rates over the last step, rad/s2.
    pub accelerations: &'a JointAngles,
    pub around: &'a Environment,
    /// Spatial acceleration of the base.
    pub base_acceleration: Motion,
}

impl Link {
    /// Builds a link. Rapier's masses are scalars: the added mass is the middle between its largest and its smallest
    /// direction. It acts at the centre of the water that the link displaces, with its inertia about that point.
    pub(super) fn new(body: Body) -> Self {
        let directions = body.added.linear.symmetric_eigenvalues();
        let added_kg = 0.5 * (directions.max() + directions.min());
        let center = body.center_of_buoyancy_m;
        let about_center = body.added.shifted(&-center).rotational;
        let engine_mass_kg = body.mass_kg + added_kg;
        Self {
            engine: body.rigid + Inertia::rigid(added_kg, &center, &about_center),
            engine_mass_kg,
            engine_com_m: (body.mass_kg * body.com_m + added_kg * center) / engine_mass_kg,
            body,
        }
    }

    /// Returns the inertia of rapier's rigid body about its centre of mass, link axes.
    pub(super) fn engine_inertia_kg_m2(&self) -> Matrix3<f64> {
        self.engine.shifted(&-self.engine_com_m).rotational
    }

    /// Returns the wrench of gravity and buoyancy only.
    #[cfg(test)]
    pub(super) fn weight(&self, place: &Isometry3<f64>, gravity: &Vector3<f64>) -> Force {
        self.body.weight(place, gravity, &Vector3::zeros())
    }
}

/// Returns the momentum of a motion, with the inertia in its own frame at `place`: cheaper than turning the inertia.
fn momentum(inertia: &Inertia, place: &Isometry3<f64>, motion: &Motion) -> Force {
    let to_own = place.rotation.inverse();
    let own = Motion::new(to_own * motion.angular, to_own * motion.at(&place.translation.vector));
    let found = inertia.momentum(&own);
    let force = place.rotation * found.force;
    Force::new(place.rotation * found.moment + place.translation.vector.cross(&force), force)
}

/// Returns the wrench on each link 1..=n, in base axes, that makes rapier's rigid bodies move as the links move in the
/// world.
///
/// With `V`, `A` a link's velocity and acceleration in the world, `v`, `a` those against the base, `V0`, `A0` the
/// base's, `I` the link's inertia with added mass and `Ie` that of rapier's body:
///
/// ```text
/// A = A0 + a + V0 x v        I A + V x* I V - loads = joint forces       (water: `Body::newton_euler`)
/// rapier:                    Ie a + v x* Ie v       = joint forces + W
/// W = loads - I A - V x* I V + Ie a + v x* Ie v
/// ```
///
/// For a dry link `a` cancels. For the difference of the scalar and the added mass, `a` is that of the last step. As `I
/// < 2 Ie` this is a contraction for every step, and of first order.
pub(super) fn link_wrenches(links: &[Link], state: &ArmState) -> [Force; MAX_JOINTS + 1] {
    let mut wrenches = [Force::zero(); MAX_JOINTS + 1];
    let base = &state.around.base_velocity;
    let (mut own, mut own_acceleration) = (Motion::zero(), Motion::zero());
    for (j, link) in links.iter().enumerate() {
        let axis = Motion::rotation(state.poses.axis(j), &state.poses.joint_origin(j));
        let turning = axis * state.rates[j];
        own = own + turning;
        own_acceleration = own_acceleration + axis * state.accelerations[j] + own.cross(&turning);
        let place = state.poses.link(j + 1);
        let velocity = *base + own;
        let acceleration = state.base_acceleration + own_acceleration + base.cross(&own);
        let (_, needed) = link.body.newton_euler(place, &velocity, &acceleration, state.around);
        let engine = |motion: &Motion| momentum(&link.engine, place, motion);
        wrenches[j + 1] = engine(&own_acceleration) + own.cross_force(&engine(&own)) - needed;
    }
    wrenches
}
