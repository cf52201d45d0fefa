//! Touches of surveyed surfaces by the tool: the point, the surface's normal and its name.

use crate::rerun::{Arrows3D, Points3D};

use crate::colors;
use crate::entities::BASE;
use crate::entity_log::EntityLog;
use crate::scene::ReplayScene;

/// Length of a normal, m.
const NORMAL_M: f64 = 0.1;
const POINT_M: f32 = 0.012;

/// Draws each touch from its time on.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    let touches = &run.tracks.touches;
    for (n, (time_s, _)) in touches.iter().enumerate() {
        let so_far = touches[..=n].iter().map(|(_, touch)| touch);
        let points: Vec<[f32; 3]> = so_far.clone().map(|touch| touch.point_m.map(|v| v as f32)).collect();
        let normals = so_far.clone().map(|touch| touch.normal.map(|v| (NORMAL_M * v) as f32));
        let names = so_far.map(|touch| touch.surface.clone());
        let arrows = Arrows3D::from_vectors(normals).with_origins(points.iter().copied()).with_colors([colors::SEEN]);
        let spots = Points3D::new(points).with_radii([POINT_M]).with_colors([colors::SEEN]).with_labels(names);
        stream.draw(&format!("{BASE}/touched/normal"), *time_s, &arrows);
        stream.draw(&format!("{BASE}/touched/point"), *time_s, &spots);
    }
}
