//! Camera mount from a tag on the gripper only.

use std::ops::Range;

use nalgebra::{DMatrix, Isometry3};

use crate::model::parameters::JointParameters;

/// Camera mount and the joints distal to the camera, estimated from the tag on the gripper.
#[derive(Clone, Debug)]
pub struct MountEstimate {
    /// Estimated pose of the camera on the link that carries it.
    pub link_from_camera: Isometry3<f64>,
    /// Joints between camera and tag.
    pub joints: Range<usize>,
    /// Parameters: estimated for these joints, as given for the others.
    pub parameters: JointParameters,
    /// Covariance. Rows: mount (translation m, rotation rad, on the right), then gain and offset (rad) of each joint.
    pub covariance: DMatrix<f64>,
    /// Number of views that show the tag.
    pub views: usize,
    /// Root mean square reprojection error per corner (2D), px.
    pub rms_px: f64,
}
