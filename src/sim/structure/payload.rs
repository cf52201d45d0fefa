//! Payload in the gripper: a ball that moves with the tool's link.

use nalgebra::Vector3;

use crate::dynamics::{Body, WaterProperties};
use crate::spec::WorldSpec;
use armcal_core::robot::Robot;

/// Returns the body that carries the payload, and the payload in its frame; `None` without one.
pub(crate) fn payload(spec: &WorldSpec, robot: &Robot) -> Option<(usize, Body)> {
    let (structure, mount) = (&spec.structure, &robot.tool.mount);
    let offset_m = Vector3::from(structure.payload_offset_m);
    let center_m = mount.link_from_frame.transform_point(&offset_m.into()).coords;
    let (mass_kg, density_kg_m3) = (structure.payload_kg, structure.payload_density_kg_m3);
    let water = WaterProperties::of(&spec.water);
    (mass_kg > 0.0).then(|| (mount.n_joints, Body::ball(mass_kg, density_kg_m3, &center_m, &water)))
}
