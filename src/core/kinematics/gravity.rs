//! Torques of weight less buoyancy about joints and base, and the bending of an arm under them.
//!
//! Link k has the weight less buoyancy `w_k` and its first moment `s_k` about the base's origin. Weight acts at the
//! centre of mass, buoyancy at the centre of volume. Up is `u`; joint j is at `o_j` with axis `a_j`:
//!
//! ```text
//! L_j = sum_(k > j) (s_k - o_j w_k)        tau_j = a_j . (u x L_j)         joints
//! L   = sum_k s_k                          M     = u x L                   base, about its origin
//! ```
//!
//! The force of a slide is `-(a_j . u) W_j`, N instead of N m, with the weight `W_j` distal to it.
//!
//! Each joint then turns by `c_j tau_j` behind its sensor, and the base turns by `(c_x M_x, c_y M_y, c_z M_z)` on its
//! mount. Torques are those of the arm bent by the torques of the straight one; the remaining error is of third order.

use std::ops::Range;

use nalgebra::{UnitQuaternion, Vector3};

use crate::joints::MAX_JOINTS;
use crate::kinematics::link_poses::{Attachment, LinkPoses};

/// Load of one link, in the link's own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkLoad {
    /// Weight less buoyancy.
    pub weight_n: f64,
    /// Weight times centre of mass, less buoyancy times centre of volume.
    pub moment_nm: Vector3<f64>,
}

/// Weights that an arm carries, and the direction of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmLoads {
    /// Unit vector against gravity, base frame.
    pub up: Vector3<f64>,
    /// Load of each link, base first; zero if its mass is unknown.
    pub links: [LinkLoad; MAX_JOINTS + 1],
    /// Frame at which a load in the gripper acts.
    pub tool: Attachment,
}

/// One value about each joint's axis and about the base's axes: torques (N m) or angles (rad). For slides forces (N) or
/// distances (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AboutAxes {
    /// Values about the joints' axes, base first.
    pub joints: [f64; MAX_JOINTS],
    /// Values about the axes of the base, through its origin.
    pub base: Vector3<f64>,
}

/// Compliance of an arm under its weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sag {
    /// Compliance of each joint behind its sensor, rad/(N m); for a slide m/N.
    pub joint_rad_per_nm: [f64; MAX_JOINTS],
    /// Compliance of the base on its mount, about the base's axes, rad/(N m).
    pub mount_rad_per_nm: [f64; 3],
    /// Weight less buoyancy at the tool point that the nominal model omits, N.
    pub tool_load_n: f64,
}

/// Weights and moments of the links distal to each joint, and of all links.
struct Moments {
    /// Moment about each joint's origin, N m.
    about_joints: [Vector3<f64>; MAX_JOINTS],
    /// Weight distal to each joint, N.
    weights_n: [f64; MAX_JOINTS],
    /// Moment of all links about the base's origin, N m.
    about_base: Vector3<f64>,
}

impl Moments {
    /// Returns the derivative of the moment that joint `joint` carries by its own angle, N m/rad; for a slide N.
    fn change(&self, poses: &LinkPoses, joint: usize) -> Vector3<f64> {
        if poses.is_slide(joint) {
            return poses.axis(joint) * self.weights_n[joint];
        }
        poses.axis(joint).cross(&self.about_joints[joint])
    }
}

impl ArmLoads {
    /// Returns true if any moving link has a weight.
    #[must_use]
    pub fn are_known(&self) -> bool {
        self.links[1..].iter().any(|link| link.weight_n != 0.0)
    }

    /// Returns the loads with gravity against `up` (unit, base frame), for a base that leans.
    #[must_use]
    pub fn with_up(&self, up: Vector3<f64>) -> Self {
        Self { up, ..*self }
    }

    /// Returns the torques of all links and of `tool_load_n` at the tool, N m.
    #[must_use]
    pub fn torques(&self, poses: &LinkPoses, tool_load_n: f64) -> AboutAxes {
        self.torques_by(poses, &self.moments(poses, 1.0, tool_load_n))
    }

    /// Returns the torques of one newton at the tool only, N m.
    #[must_use]
    pub fn torques_by_tool(&self, poses: &LinkPoses) -> AboutAxes {
        self.torques_by(poses, &self.moments(poses, 0.0, 1.0))
    }

    /// Returns the derivative of all torques by the angle of each joint, N m/rad.
    #[must_use]
    pub fn torque_derivatives(&self, poses: &LinkPoses, tool_load_n: f64) -> [AboutAxes; MAX_JOINTS] {
        let moments = self.moments(poses, 1.0, tool_load_n);
        let mut out = [AboutAxes::default(); MAX_JOINTS];
        (0..poses.n_joints()).for_each(|by| out[by] = self.derivative(poses, &moments, by));
        out
    }

    fn derivative(&self, poses: &LinkPoses, moments: &Moments, by: usize) -> AboutAxes {
        // The second derivative of a potential is symmetric.
        let derivative = |joint: usize| {
            let (near, far) = (joint.min(by), joint.max(by));
            // The position of a slide does not change the weight distal to it.
            if poses.is_slide(near) { 0.0 } else { poses.axis(near).dot(&self.up.cross(&moments.change(poses, far))) }
        };
        let mut change = AboutAxes { base: self.up.cross(&moments.change(poses, by)), ..Default::default() };
        (0..poses.n_joints()).for_each(|joint| change.joints[joint] = derivative(joint));
        change
    }

    fn torques_by(&self, poses: &LinkPoses, moments: &Moments) -> AboutAxes {
        let mut torques = AboutAxes { base: self.up.cross(&moments.about_base), ..Default::default() };
        for (joint, moment) in moments.about_joints.iter().enumerate().take(poses.n_joints()) {
            torques.joints[joint] = match poses.is_slide(joint) {
                true => -poses.axis(joint).dot(&self.up) * moments.weights_n[joint],
                false => poses.axis(joint).dot(&self.up.cross(moment)),
            };
        }
        torques
    }

    fn moments(&self, poses: &LinkPoses, of_links: f64, tool_load_n: f64) -> Moments {
        let (mut weight_n, mut about_base) = (0.0, Vector3::zeros());
        let (mut about_joints, mut weights_n) = ([Vector3::zeros(); MAX_JOINTS], [0.0; MAX_JOINTS]);
        for body in (0..=poses.n_joints()).rev() {
            let (place, load) = (poses.link(body), &self.links[body]);
            weight_n += of_links * load.weight_n;
            about_base += (place.rotation * load.moment_nm + place.translation.vector * load.weight_n) * of_links;
            if body == self.tool.n_joints {
                weight_n += tool_load_n;
                about_base += poses.frame(&self.tool).translation.vector * tool_load_n;
            }
            if let Some(joint) = body.checked_sub(1) {
                weights_n[joint] = weight_n;
                about_joints[joint] = about_base - poses.joint_origin(joint) * weight_n;
            }
        }
        Moments { about_joints, weights_n, about_base }
    }
}

impl Default for ArmLoads {
    fn default() -> Self {
        let tool = Attachment { n_joints: 0, link_from_frame: nalgebra::Isometry3::identity() };
        Self { up: Vector3::z(), links: [LinkLoad::default(); MAX_JOINTS + 1], tool }
    }
}

impl Sag {
    /// Returns true if no joint yields and the mount does not.
    #[inline]
    #[must_use]
    pub fn is_rigid(&self) -> bool {
        self.joint_rad_per_nm == [0.0; MAX_JOINTS] && self.mount_rad_per_nm == [0.0; 3]
    }

    /// Returns the angles by which joints and base turn under `torques`, rad; for slides the distance, m.
    #[must_use]
    pub fn bend(&self, torques: &AboutAxes) -> AboutAxes {
        AboutAxes {
            joints: std::array::from_fn(|joint| self.joint_rad_per_nm[joint] * torques.joints[joint]),
            base: torques.base.component_mul(&Vector3::from(self.mount_rad_per_nm)),
        }
    }
}

impl AboutAxes {
    /// Returns the translation (m) of `point_m` and the rotation (rad) of its frame, caused by these small turns of
    /// `joints`. Both are in the base frame. The base's own turn counts if `joints` begins at 0.
    #[must_use]
    pub fn motion(&self, poses: &LinkPoses, joints: Range<usize>, point_m: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let base = if joints.start == 0 { self.base } else { Vector3::zeros() };
        joints.fold([base.cross(point_m), base], |[moved, turned], joint| {
            let by = self.joints[joint];
            [moved + poses.point_jacobian(joint, point_m) * by, turned + poses.turn_jacobian(joint) * by]
        })
    }

    /// Returns the rotation of the base.
    pub(crate) fn base_turn(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.base)
    }
}

#[cfg(test)]
mod tests;
