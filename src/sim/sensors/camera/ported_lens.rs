//! Projection of points by the camera as built: its port, then its lens.
//!
//! The drawing's lens is calibrated in water behind a perfect dome. Behind a flat port the lens's own focal length is
//! shorter by the water's index. Near the axis both together then have the drawing's focal length; farther out they
//! differ.

use nalgebra::{Vector2, Vector3};

use crate::as_built::AsBuilt;
use crate::sensors::camera::port::{Port, WATER_INDEX};
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

    /// Pixel of a point in the water (camera frame, m); `None` beyond the field of view.
    pub(super) fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.lens.project(&self.port.direction_in_air(point_m)?)
    }

    /// Whether a pixel lies in the image.
    pub(super) fn contains(&self, pixel_px: &Vector2<f64>) -> bool {
        self.lens.contains(pixel_px)
    }
}
