//! Torques of weight less buoyancy about joints and base, and how an arm bends under them.
//!
//! With the weight less buoyancy `w_k` of link k, its first moment about the base's origin `s_k` (weight at the centre
//! of mass, buoyancy at the centre of volume), up `u` and joint j at `o_j` with axis `a_j`:
//!
//! ```text
//! L_j = sum_(k > j) (s_k - o_j w_k)        tau_j = a_j . (u x L_j)         joints
//! L   = sum_k s_k                          M     = u x L                   base, about its origin
//! ```
//!
//! A slide's force is `-(a_j . u) W_j`, with the weight `W_j` beyond it, N in the place of N m.
//!
//! Each joint then turns by `c_j tau_j` behind its sensor, and the base by `(c_x M_x, c_y M_y, c_z M_z)` on what
//! carries it. Torques are those of the arm bent by the torques of the straight one: what is left is of third order.

use std::ops::Range;

use nalgebra::{UnitQuaternion, Vector3};

use crate::joints::MAX_JOINTS;
use crate::kinematics::link_poses::{Attachment, LinkPoses};

/// Of one link, in its own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkLoad {
    /// Weight less buoyancy.
    pub weight_n: f64,
    /// The same times the place where it acts: weight at the centre of mass less buoyancy at that of volume.
    pub moment_nm: Vector3<f64>,
}

/// What an arm has to carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmLoads {
    /// Against gravity, base frame, unit.
    pub up: Vector3<f64>,
    /// Base first; zero where no mass is known.
    pub links: [LinkLoad; MAX_JOINTS + 1],
    /// Where a load in the gripper hangs.
    pub tool: Attachment,
}

/// A number about each joint's axis, and about the base's axes: torques (N m) or angles (rad). Of slides forces (N) or
/// ways (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AboutAxes {
    /// About the joints, base first.
    pub joints: [f64; MAX_JOINTS],
    /// About the axes of the base, through its origin.
    pub base: Vector3<f64>,
}

/// How much an arm gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sag {
    /// Of each joint behind its sensor, rad/(N m); m/N of a slide.
    pub joint_rad_per_nm: [f64; MAX_JOINTS],
    /// Of the base on what carries it, about the base's axes, rad/(N m).
    pub mount_rad_per_nm: [f64; 3],
    /// Weight less buoyancy at the tool point that the drawing does not have, N.
    pub tool_load_n: f64,
}

/// Of the links distal to each joint, and of all.
struct Moments {
    /// About that joint's origin, N m.
    about_joints: [Vector3<f64>; MAX_JOINTS],
    /// N.
    weights_n: [f64; MAX_JOINTS],
    /// Of all about the base's origin, N m.
    about_base: Vector3<f64>,
}

impl Moments {
    /// How the moment of what joint `joint` carries changes with its angle, N m/rad; N of a slide.
    fn change(&self, poses: &LinkPoses, joint: usize) -> Vector3<f64> {
        if poses.is_slide(joint) {
            return poses.axis(joint) * self.weights_n[joint];
        }
        poses.axis(joint).cross(&self.about_joints[joint])
    }
}

impl ArmLoads {
    /// Whether any moving link has a weight.
    #[must_use]
    pub fn are_known(&self) -> bool {
        self.links[1..].iter().any(|link| link.weight_n != 0.0)
    }

    /// The same where gravity points against `up` (unit, base frame): on a base that leans.
    #[must_use]
    pub fn with_up(&self, up: Vector3<f64>) -> Self {
        Self { up, ..*self }
    }

    /// Torques of all links and of `tool_load_n` at the tool, N m.
    #[must_use]
    pub fn torques(&self, poses: &LinkPoses, tool_load_n: f64) -> AboutAxes {
        self.torques_by(poses, &self.moments(poses, 1.0, tool_load_n))
    }

    /// Torques of one newton at the tool alone, N m.
    #[must_use]
    pub fn torques_by_tool(&self, poses: &LinkPoses) -> AboutAxes {
        self.torques_by(poses, &self.moments(poses, 0.0, 1.0))
    }

    /// How the torques change with the angle of each joint, N m/rad.
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
            // What is beyond a slide weighs the same wherever it is.
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
    /// Whether nothing gives.
    #[inline]
    #[must_use]
    pub fn is_rigid(&self) -> bool {
        self.joint_rad_per_nm == [0.0; MAX_JOINTS] && self.mount_rad_per_nm == [0.0; 3]
    }

    /// Angles by which joints and base turn under `torques`, rad; m of slides.
    #[must_use]
    pub fn bend(&self, torques: &AboutAxes) -> AboutAxes {
        AboutAxes {
            joints: std::array::from_fn(|joint| self.joint_rad_per_nm[joint] * torques.joints[joint]),
            base: torques.base.component_mul(&Vector3::from(self.mount_rad_per_nm)),
        }
    }
}

impl AboutAxes {
    /// How a frame at `point_m` (base frame) behind `joints` moves, where these are small turns: its point m, and
    /// itself about the base's axes rad. The base's own turn counts where `joints` begin at the base.
    #[must_use]
    pub fn motion(&self, poses: &LinkPoses, joints: Range<usize>, point_m: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let base = if joints.start == 0 { self.base } else { Vector3::zeros() };
        joints.fold([base.cross(point_m), base], |[moved, turned], joint| {
            let by = self.joints[joint];
            [moved + poses.point_jacobian(joint, point_m) * by, turned + poses.turn_jacobian(joint) * by]
        })
    }

    /// The base's turn.
    pub(crate) fn base_turn(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.base)
    }
}

#[cfg(test)]
mod tests;
