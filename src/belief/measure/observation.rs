//! One tag in one view, weighted.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};

use crate::measure::board::WeightedPoint;
use crate::measure::corners::WeightedCorners;
use crate::model::blocks::Block;

/// One tag in one view.
#[derive(Clone, Debug)]
pub(crate) struct ObservationTerm {
    /// The tag.
    pub block: Block,
    pub data: WeightedMeasurement,
    /// Sightings that are out of the estimate keep their place.
    pub is_used: bool,
}

impl ObservationTerm {
    /// Which corners are used; of a position or pose all four or none.
    pub(crate) fn used(&self) -> [bool; 4] {
        match &self.data {
            WeightedMeasurement::Corners(corners) if self.is_used => corners.used,
            _ => [self.is_used; 4],
        }
    }

    /// Uses no other corners than these; an observation without any is out as a whole.
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
    /// Of the corners that are used.
    pub(crate) fn n_coordinates(&self) -> usize {
        match self {
            Self::Corners(corners) => 2 * corners.used.iter().filter(|is_used| **is_used).count(),
            Self::Position { .. } => 3,
            Self::Pose { .. } => 6,
            Self::Board { points } => 2 * points.len(),
        }
    }

    /// Whether it is of pixels, whose noise is that of corners.
    pub(crate) fn is_in_pixels(&self) -> bool {
        matches!(self, Self::Corners(_) | Self::Board { .. })
    }
}
