//! Viewpoint of the 3D view: the arm and its work fill the picture.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::poses::vector;
use crate::scene::ReplayScene;

/// Tangents of half the viewer's field of view, upwards (55 degrees in all) and sideways (the view is about twice as
/// wide).
const HALF_UP: f64 = 0.52;
const HALF_ACROSS: f64 = 1.7 * HALF_UP;
/// Share of the picture that the scene fills.
const FILL: f64 = 0.82;
/// Number of sampled configurations of the arm over the run.
const SAMPLES: u32 = 200;
/// Direction to the viewpoint in the base frame, rad: about z from x, and above the horizon.
const AZIMUTH_RAD: f64 = -0.95;
const ELEVATION_RAD: f64 = 0.36;

/// Position of the viewer and the point in the picture's centre, world frame, m.
pub(super) struct Viewpoint {
    pub position: [f32; 3],
    pub target: [f32; 3],
}

/// Frames the arm's links over the run, the tags and the targets.
pub(super) fn frame(run: &ReplayScene) -> Viewpoint {
    let mut points = Vec::new();
    for n in 0..=SAMPLES {
        let time_s = run.tracks.duration_s * f64::from(n) / f64::from(SAMPLES);
        if let Some(angles) = run.shown_angles(time_s) {
            let poses = run.robot.chain.link_poses(&angles);
            points.extend((0..=run.robot.n_joints()).map(|body| poses.link(body).translation.vector));
            points.push(poses.frame(&run.robot.tool.mount).translation.vector);
        }
    }
    // Tags that the arm carries move with its links.
    let beside = run.robot.tags.iter().filter(|_| !run.robot.is_watched());
    points.extend(beside.map(|tag| tag.base_from_tag.origin().vector()));
    points.extend(run.tracks.task.iter().flat_map(|(_, task)| task.targets_m.iter().map(|t| Vector3::from(*t))));
    points.push(Vector3::zeros());
    // Axes of the picture: towards the viewer, to its right and up.
    let around = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), AZIMUTH_RAD);
    let towards = around * Vector3::new(ELEVATION_RAD.cos(), 0.0, ELEVATION_RAD.sin());
    let right = Vector3::z().cross(&towards).normalize();
    let axes = Matrix3::from_columns(&[towards, right, towards.cross(&right)]);
    let seen: Vec<Vector3<f64>> = points.iter().map(|p| axes.tr_mul(p)).collect();
    let low = seen.iter().fold(Vector3::repeat(f64::INFINITY), |low, p| low.inf(p));
    let high = seen.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
    let middle = 0.5 * (low + high);
    let distance_m = seen.iter().map(|p| {
        let off = p - middle;
        off.x + (off.y.abs() / HALF_ACROSS).max(off.z.abs() / HALF_UP) / FILL
    });
    let center = axes * middle;
    let position = center + towards * distance_m.fold(0.5, f64::max);
    let world_from_base = *run.world_from_vehicle(0.0).isometry()
        * run.vehicle.map_or_else(nalgebra::Isometry3::identity, |vehicle| *vehicle.vehicle_from_base.isometry());
    let to_world = |p: Vector3<f64>| vector(&(world_from_base * nalgebra::Point3::from(p)).coords);
    Viewpoint { position: to_world(position), target: to_world(center) }
}
