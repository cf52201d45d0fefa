//! Bodies, joints and colliders of the arm in rapier.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};
use rapier3d::dynamics::{GenericJoint, JointAxesMask, RigidBodyBuilder, RigidBodyHandle};
use rapier3d::geometry::{ColliderBuilder, ColliderHandle};
use rapier3d::math::{Matrix, Vector};
use rapier3d::parry::mass_properties::MassProperties;
use rapier3d::pipeline::{ActiveHooks, PhysicsWorld};

use crate::convert::to_rapier;
use crate::physics::rapier::link_load::Link;
use crate::solids::{Carrier, Solids};
use crate::spec::PhysicsSpec;
use armcal_core::robot::parry_pose;

/// Returns an engine without gravity, which is among the loads.
pub(super) fn empty_engine(step_s: f64) -> PhysicsWorld {
    let mut engine = PhysicsWorld::new();
    engine.gravity = Vector::ZERO;
    let parameters = &mut engine.integration_parameters;
    parameters.dt = step_s;
    // Springs and dampers are implicit and separate from the iterative solver, which resolves only contacts.
    parameters.num_solver_iterations = 1;
    parameters.num_internal_pgs_iterations = 4;
    // No body moves by its own size in a step.
    parameters.max_ccd_substeps = 0;
    engine
}

pub(super) fn rigid_body(link: &Link) -> RigidBodyBuilder {
    let i = link.engine_inertia_kg_m2();
    let column = |k: usize| Vector::new(i[(0, k)], i[(1, k)], i[(2, k)]);
    let inertia = Matrix::from_cols(column(0), column(1), column(2));
    let mass = MassProperties::with_inertia_matrix(to_rapier(&link.engine_com_m), link.engine_mass_kg, inertia);
    RigidBodyBuilder::dynamic()
        .additional_mass_properties(mass)
        .angular_damping(0.0)
        .linear_damping(0.0)
        .can_sleep(false)
}

/// Returns a revolute joint. Rapier turns a joint about the x axis of its frames: both have it along `axis`.
pub(super) fn revolute(parent_from_joint: &Isometry3<f64>, axis: &Unit<Vector3<f64>>) -> GenericJoint {
    let turn = UnitQuaternion::rotation_between_axis(&Vector3::x_axis(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI));
    let turn = Isometry3::from_parts(nalgebra::Translation3::identity(), turn);
    let mut joint = GenericJoint::new(JointAxesMask::LOCKED_REVOLUTE_AXES);
    joint.set_local_frame1(parry_pose(&(parent_from_joint * turn)));
    joint.set_local_frame2(parry_pose(&turn));
    joint.set_contacts_enabled(false);
    joint
}

/// Adds shapes on the links (root first) and on the ground, without mass, switched off.
pub(super) fn add_colliders(
    engine: &mut PhysicsWorld,
    solids: &Solids,
    spec: &PhysicsSpec,
    links: &[RigidBodyHandle],
    ground: RigidBodyHandle,
) -> Vec<ColliderHandle> {
    let add = |solid: &crate::solids::Solid| {
        let parent = match solid.carrier {
            Carrier::Body(body) => links[body],
            Carrier::World => ground,
        };
        let collider = ColliderBuilder::new(solid.shape.clone())
            .position(solid.carrier_from_shape)
            .density(0.0)
            .friction(spec.contact_friction)
            .enabled(false)
            .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)
            .user_data(solid.part as u128);
        engine.colliders.insert_with_parent(collider, parent, &mut engine.bodies)
    };
    solids.shapes().iter().map(add).collect()
}
