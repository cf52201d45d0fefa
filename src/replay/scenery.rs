//! Surroundings of the arm: seafloor, obstacles, tags, and the moving vehicle.

use crate::rerun::{Boxes3D, FillMode, ViewCoordinates};
use nalgebra::{Isometry3, Translation3};

use crate::colors;
use crate::entities::{BASE, VEHICLE, WORLD};
use crate::entity_log::EntityLog;
use crate::poses::{quaternion, transform, vector};
use crate::scene::ReplayScene;
use crate::shapes::{Look, log_shapes};
use armcal_core::spatial::{Pose, Vehicle, World};

/// Half of the seafloor that is drawn, m.
const SEAFLOOR_HALF_M: f64 = 8.0;
/// Side of a board of unknown size, m.
pub(super) const LANDMARK_M: f64 = 0.1;
/// Motions below which nothing is drawn again.
const SAME_M: f64 = 2e-5;
const SAME_RAD: f64 = 2e-5;

impl ReplayScene<'_> {
    /// Returns the pose of the vehicle: by truth, else by its attitude sensor, else at rest.
    pub(super) fn world_from_vehicle(&self, time_s: f64) -> Pose<World, Vehicle> {
        let measured = || {
            let turn = self.tracks.attitude.at(time_s)?;
            Some(Pose::from_isometry(Isometry3::from_parts(Translation3::identity(), *turn)))
        };
        let truth = self.truth.as_ref().and_then(|truth| truth.world_from_vehicle(time_s));
        truth.or_else(measured).unwrap_or_else(Pose::identity)
    }
}

/// Moving entity, which is drawn again only after a motion.
pub(super) struct Mover {
    entity: String,
    last: Option<Isometry3<f64>>,
}

impl Mover {
    pub fn new(entity: String) -> Self {
        Self { entity, last: None }
    }

    pub fn entity(&self) -> &str {
        &self.entity
    }

    /// Draws the pose that the entity has in its parent from `time_s` on.
    pub fn place(&mut self, stream: &mut EntityLog, time_s: f64, pose: &Isometry3<f64>) {
        let last = self.last.or_else(|| stream.shown_pose(&self.entity));
        let same = last.is_some_and(|last| {
            (last.translation.vector - pose.translation.vector).norm() < SAME_M
                && last.rotation.angle_to(&pose.rotation) < SAME_RAD
        });
        if !same {
            stream.draw_pose(&self.entity, time_s, pose);
            stream.note_pose(&self.entity, pose);
            self.last = Some(*pose);
        }
    }
}

/// Draws the scenery.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    stream.log_static(WORLD, &ViewCoordinates::RIGHT_HAND_Z_UP());
    draw_site(run, stream);
    let mut mover = Mover::new(VEHICLE.to_owned());
    for time_s in run.tracks.frames() {
        mover.place(stream, time_s, run.world_from_vehicle(time_s).isometry());
    }
    if let Some(vehicle) = run.vehicle {
        let parts = vehicle.parts.iter().map(|part| &part.placed);
        log_shapes(stream, &format!("{VEHICLE}/body"), parts, Look::Drawn);
        stream.log_static(BASE, &transform(vehicle.vehicle_from_base.isometry()));
    }
    draw_tags(run, stream);
}

fn draw_site(run: &ReplayScene, stream: &mut EntityLog) {
    let Some(scene) = run.scene else { return };
    if let Some(z_m) = scene.seafloor_z_m {
        let half_m = [SEAFLOOR_HALF_M as f32, SEAFLOOR_HALF_M as f32, 0.02];
        let floor = Boxes3D::from_centers_and_half_sizes([[0.0, 0.0, z_m as f32 - half_m[2]]], [half_m]);
        let floor = floor.with_colors([colors::SEAFLOOR]).with_fill_mode(FillMode::Solid);
        stream.log_static(&format!("{WORLD}/seafloor"), &floor);
    }
    let obstacles = scene.obstacles.iter().map(|part| &part.placed);
    log_shapes(stream, &format!("{WORLD}/obstacles"), obstacles, Look::Drawn);
}

/// Draws each tag as a white plate with a black square and a white middle; the base tag's plate is blue.
fn draw_tags(run: &ReplayScene, stream: &mut EntityLog) {
    let tags = &run.robot.tags;
    if tags.is_empty() {
        return;
    }
    // Tags that the arm carries move with it.
    if run.robot.is_watched() {
        let mut mover = Mover::new(format!("{BASE}/tags"));
        for time_s in run.tracks.frames() {
            if let Some(angles) = run.shown_angles(time_s) {
                mover.place(stream, time_s, &run.robot.base_from_tags(&angles));
            }
        }
    }
    let layers = [(1.25, 0.0), (1.0, 0.002), (0.5, 0.004)];
    let (mut centers, mut sizes, mut turns, mut shades) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for tag in tags {
        let plate = if Some(tag.id) == run.robot.base_tag { colors::BASE_TAG } else { [245, 245, 245, 255] };
        let fills = [plate, [15, 15, 15, 255], plate];
        for ((share, height_m), fill) in layers.into_iter().zip(fills) {
            let place = tag.base_from_tag.isometry() * Translation3::new(0.0, 0.0, height_m);
            centers.push(vector(&place.translation.vector));
            turns.push(quaternion(&place.rotation));
            let half_m = (0.5 * share * if tag.size_m.is_nan() { LANDMARK_M } else { tag.size_m }) as f32;
            sizes.push([half_m, half_m, 0.001]);
            shades.push(fill);
        }
    }
    let plates = Boxes3D::from_centers_and_half_sizes(centers, sizes).with_quaternions(turns);
    stream.log_static(&format!("{BASE}/tags"), &plates.with_colors(shades).with_fill_mode(FillMode::Solid));
}
