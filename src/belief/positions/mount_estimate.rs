//! The camera mount by a tag on the gripper alone.

use std::ops::Range;

use nalgebra::{DMatrix, Isometry3};

use crate::model::parameters::JointParameters;

/// Camera mount and the joints behind the camera, by the tag on the gripper.
#[derive(Clone, Debug)]
pub struct MountEstimate {
    /// Estimated pose of the camera on the link that carries it.
    pub link_from_camera: Isometry3<f64>,
    /// The joints between camera and tag.
    pub joints: Range<usize>,
    /// Theirs are estimated, the others as they were given.
    pub parameters: JointParameters,
    /// Rows: mount (translation m, rotation rad, on the right), then gain and offset (rad) of each joint.
    pub covariance: DMatrix<f64>,
    /// Number of views that show the tag.
    pub views: usize,
    /// Root mean square per corner (2D), px.
    pub rms_px: f64,
}
