//! Projection of points by the camera as built: its port, then its lens.
//!
//! The nominal lens is calibrated in water behind a perfect dome. Behind a flat port, the lens's own focal length is
//! shorter by the water's index. Near the axis, lens and port together have the nominal focal length; farther out they
//! differ. A nominal model with a flat port has its lens in air, and the world's port replaces its port.

use nalgebra::{Vector2, Vector3};

use crate::as_built::AsBuilt;
use crate::sensors::camera::port::{Port, WATER_INDEX};
use crate::spec::{CameraWorldSpec, PortKind};
use armcal_core::optics::CameraModel;

#[derive(Clone, Copy, Debug)]
pub(super) struct PortedLens {
    /// Lens in air; it includes its own window if the nominal model has one and the world has no port.
    pub lens: CameraModel,
    pub port: Port,
}

impl PortedLens {
    pub(super) fn new(nominal: &CameraModel, built: &AsBuilt, spec: &CameraWorldSpec) -> Self {
        let lens = built.lens.map_or(*nominal, |lens| lens.applied(nominal));
        let thickness_m = spec.port_thickness_m;
        match (spec.port, built.dome_center_m) {
            (PortKind::Dome, Some(center_m)) => {
                let (center_m, inner_radius_m) = (Vector3::from(center_m), spec.dome_radius_m);
                Self { lens: in_air(&lens), port: Port::Dome { center_m, inner_radius_m, thickness_m } }
            }
            (PortKind::None | PortKind::Dome, _) => Self { lens, port: Port::None },
            (PortKind::Flat, _) => Self {
                lens: if lens.port.is_some() { in_air(&lens) } else { shorter(&lens) },
                port: Port::Flat { distance_m: spec.port_distance_m, thickness_m },
            },
        }
    }

    /// Returns the pixel of a point in the water (camera frame, m); `None` beyond the field of view.
    pub(super) fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.lens.project(&self.port.direction_in_air(point_m)?)
    }

    /// Returns true if a pixel is in the image.
    pub(super) fn contains(&self, pixel_px: &Vector2<f64>) -> bool {
        self.lens.contains(pixel_px)
    }
}

fn in_air(lens: &CameraModel) -> CameraModel {
    CameraModel { port: None, ..*lens }
}

/// Returns the lens in air that has the nominal focal length in water.
fn shorter(lens: &CameraModel) -> CameraModel {
    let [fx, fy, rest @ ..] = lens.intrinsics();
    let [cx, cy, a, b, c, d] = rest;
    lens.with_intrinsics([fx / WATER_INDEX, fy / WATER_INDEX, cx, cy, a, b, c, d])
}
