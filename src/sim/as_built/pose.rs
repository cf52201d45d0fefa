//! A pose as files write it, and random pose errors.

use nalgebra::{Vector3, Vector6};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use armcal_core::spatial::{Frame, Pose};
use armcal_core::stats::stream_rng;

/// A pose as files write it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlainPose {
    /// Origin of the pose's second frame in the first.
    pub position_m: [f64; 3],
    /// Rotation from the second frame to the first.
    pub quaternion_wxyz: [f64; 4],
}

impl PlainPose {
    pub(super) fn of<A: Frame, B: Frame>(pose: &Pose<A, B>) -> Self {
        Self { position_m: pose.origin().to_array(), quaternion_wxyz: pose.quaternion_wxyz() }
    }

    /// Returns the pose. The caller names the frames, as the file's key does. A quaternion without direction means no
    /// rotation.
    #[must_use]
    pub fn to_pose<A: Frame, B: Frame>(&self) -> Pose<A, B> {
        Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz)
            .unwrap_or_else(|| Pose::from_position_rpy(self.position_m, [0.0; 3]))
    }
}

/// Draws a small random motion (translation m, rotation rad), independent per axis.
pub(super) fn normal_twist(seed: u64, stream: &str, std_m: f64, std_rad: f64) -> Vector6<f64> {
    let mut rng = stream_rng(seed, stream);
    let mut draw = |std: f64| Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, &mut rng));
    let (translation, rotation) = (draw(std_m), draw(std_rad));
    Vector6::new(translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z)
}
