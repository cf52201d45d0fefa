//! Force that carries the whole arm.

use nalgebra::Isometry3;

use crate::dynamics::equations::{BaseCoupling, EquationInput, Multibody, joint_axes};
use crate::dynamics::spatial::{Force, Motion};
use armcal_core::streams::JointAngles;

impl Multibody {
    /// Returns the force of the base's carrier on base and arm, about the base's origin in base axes, at these joint
    /// accelerations (rad/s2).
    #[must_use]
    pub fn base_force(&self, input: &EquationInput, accelerations: &JointAngles) -> Force {
        let EquationInput { angles, rates, around, base, extra } = *input;
        let poses = self.chain().link_poses(angles);
        let axes = joint_axes(&poses, angles.len());
        let mut velocity = around.base_velocity;
        let mut acceleration = match base {
            BaseCoupling::Prescribed(a) => *a,
            BaseCoupling::Free => Motion::zero(),
        };
        let mut total = Force::zero();
        for (body, own) in self.bodies().iter().enumerate() {
            if body > 0 {
                let turning = axes[body - 1] * rates[body - 1];
                velocity = velocity + turning;
                acceleration = acceleration + velocity.cross(&turning) + axes[body - 1] * accelerations[body - 1];
            }
            let (_, wanted) = own.newton_euler(poses.link(body), &velocity, &acceleration, around);
            total += wanted - extra[body];
        }
        total
    }

    /// Moves the first joint to another pose on the base.
    pub fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>) {
        self.chain_mut().set_first_place(base_from_joint);
    }
}
