//! Frames in types.
//!
//! `Pose<A, B>` is `a_from_b`: it maps coordinates of frame B to frame A, so that names cancel in
//! `world_from_tool = world_from_base * base_from_tool` and the compiler refuses what does not cancel.
//! Perturbations act on the right, `T * exp(xi)`. Raw isometries leave this folder through named functions only.

mod frames;
mod pose;

pub use frames::{Base, Camera, Frame, Link, Tag, Tool, Vehicle, World};
pub use pose::{Point, Pose, adjoint, exp, left_jacobian, log, rotation_angle_between, skew};
