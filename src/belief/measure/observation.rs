//! Weighted observation of one tag in one view.

use crate::measure::constants::observation::UNSEEN_SIGMAS;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};

use crate::measure::board::{self, WeightedPoint};
use crate::measure::corners::{self, WeightedCorners};
use crate::measure::information::{LensInformation, PoseInformation};
use crate::measure::{pose, position};
use crate::model::blocks::Block;
use armcal_core::optics::CameraModel;

/// Weighted observation of one tag in one view.
#[derive(Clone, Debug)]
pub(crate) struct ObservationTerm {
    /// Block of the tag.
    pub block: Block,
    pub data: WeightedMeasurement,
    /// True if the estimate uses the observation; rejected ones keep their index.
    pub is_used: bool,
}

impl ObservationTerm {
    /// Returns true for each corner in use; for a position or pose, all four or none.
    pub(crate) fn used(&self) -> [bool; 4] {
        match &self.data {
            WeightedMeasurement::Corners(corners) if self.is_used => corners.used,
            _ => [self.is_used; 4],
        }
    }

    /// Uses only these corners; without any, the whole observation is out.
    pub(crate) fn set_used(&mut self, corners: [bool; 4]) {
        self.is_used = corners.contains(&true);
        if let WeightedMeasurement::Corners(seen) = &mut self.data {
            seen.used = if self.is_used { corners } else { [true; 4] };
        }
    }
}

/// Measurements with the inverse of their variance.
#[derive(Clone, Debug)]
pub(crate) enum WeightedMeasurement {
    Corners(WeightedCorners),
    Board { points: Arc<[WeightedPoint]> },
    Position { in_camera_m: Vector3<f64>, info: f64 },
    Pose { tag_from_camera: Isometry3<f64>, info_position: f64, info_rotation: f64 },
}

impl WeightedMeasurement {
    /// Returns the linearization; `noise` multiplies the corners' standard deviations. Adds the lens's part to
    /// `by_lens`, if given. `None` if a corner is outside of the lens's view.
    pub(crate) fn information(
        &self,
        camera_from_tag: &Isometry3<f64>,
        lens: &CameraModel,
        noise: f64,
        by_lens: Option<&mut LensInformation>,
    ) -> Option<PoseInformation> {
        let scale = noise.powi(-2);
        match self {
            Self::Corners(seen) => corners::information(seen, camera_from_tag, lens, (seen.info * scale, by_lens)),
            Self::Board { points } => board::information(points, camera_from_tag, lens, (scale, by_lens)),
            Self::Position { in_camera_m, info } => Some(position::information(in_camera_m, *info, camera_from_tag)),
            Self::Pose { tag_from_camera, info_position, info_rotation } => {
                Some(pose::information(tag_from_camera, [*info_position, *info_rotation], camera_from_tag))
            }
        }
    }

    /// Returns the cost of an observation outside of the lens's view.
    pub(crate) fn unseen_chi2(&self) -> f64 {
        self.n_coordinates() as f64 * UNSEEN_SIGMAS * UNSEEN_SIGMAS
    }

    /// Returns the information of an impossible observation, which has no gradient and a large cost.
    pub(crate) fn unseen(&self) -> PoseInformation {
        let (chi2, corner_chi2) = (self.unseen_chi2(), [UNSEEN_SIGMAS * UNSEEN_SIGMAS; 4]);
        PoseInformation { h: Matrix6::zeros(), g: Vector6::zeros(), adjoint: Matrix6::identity(), chi2, corner_chi2 }
    }

    /// Returns the number of measured coordinates, for corners only of those in use.
    pub(crate) fn n_coordinates(&self) -> usize {
        match self {
            Self::Corners(corners) => 2 * corners.used.iter().filter(|is_used| **is_used).count(),
            Self::Position { .. } => 3,
            Self::Pose { .. } => 6,
            Self::Board { points } => 2 * points.len(),
        }
    }

    /// Returns true for measurements in pixels, which have the noise of corners.
    pub(crate) fn is_in_pixels(&self) -> bool {
        matches!(self, Self::Corners(_) | Self::Board { .. })
    }
}
