//! Points to pixels as the camera was built: its port, then its lens.
//!
//! The drawing's lens is that of a calibration in water behind a perfect dome. Behind a flat port the lens itself is shorter by
//! the water's index, so that near the axis the two together have the drawing's focal length; farther out they differ.

use nalgebra::{Vector2, Vector3};

use super::port::{Port, WATER_INDEX};
use crate::as_built::AsBuilt;
use crate::spec::{CameraWorldSpec, PortKind};
use armcal_core::optics::Fisheye;

#[derive(Clone, Copy, Debug)]
pub(super) struct PortedLens {
    /// In air.
    pub lens: Fisheye,
    pub port: Port,
}

impl PortedLens {
    pub(super) fn new(nominal: &Fisheye, built: &AsBuilt, spec: &CameraWorldSpec) -> Self {
        let lens = built.lens.map_or(*nominal, |lens| lens.applied(nominal));
        let thickness_m = spec.port_thickness_m;
        match (spec.port, built.dome_center_m) {
            (PortKind::Dome, Some(center_m)) => {
                let (center_m, inner_radius_m) = (Vector3::from(center_m), spec.dome_radius_m);
                Self { lens, port: Port::Dome { center_m, inner_radius_m, thickness_m } }
            }
            (PortKind::None | PortKind::Dome, _) => Self { lens, port: Port::None },
            (PortKind::Flat, _) => Self {
                lens: Fisheye { focal_px: lens.focal_px.map(|focal| focal / WATER_INDEX), ..lens },
                port: Port::Flat { distance_m: spec.port_distance_m, thickness_m },
            },
        }
    }

    /// Where a point in the water falls (camera frame, m); `None` beyond the field of view.
    pub(super) fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.lens.project(&self.port.seen_from(point_m)?)
    }

    /// Whether a pixel lies in the image.
    pub(super) fn contains(&self, pixel_px: &Vector2<f64>) -> bool {
        self.lens.contains(pixel_px)
    }
}
