//! Line between the arm and the part nearest to it, coloured by the distance.
//!
//! The parts and their distance are those of the truth or, without truth, those of planning at the estimated angles.
//! The points are found between the collision shapes of the two parts.

use crate::rerun::LineStrips3D;
use nalgebra::{Isometry3, Vector3};
use parry3d::math::{Pose3, Vec3};
use parry3d::query::{self, ClosestPoints};
use parry3d::shape::SharedShape;

use crate::colors::{self, Rgba};
use crate::entities::BASE;
use crate::entity_log::EntityLog;
use crate::poses::vector;
use crate::scene::{ReplayInput, ReplayScene};
use crate::truth::Clearance;
use armcal_belief::plan::ClearanceModel;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{PlacedShape, Shape, parry_pose};

/// Distance beyond which parts are not shown, m; `FAR_TIMES` is its multiple of the required clearance, used if that is
/// known.
const FAR_M: f64 = 0.15;
const FAR_TIMES: f64 = 3.0;
/// Largest distance at which the points are searched, m: planning's distance may be less, because the vehicle sways.
const SEARCHED_M: f64 = 1.0;
/// Rate at which planning's distances are drawn, Hz.
const RATE_HZ: f64 = 5.0;
/// Multiple of the required clearance within which the line is amber.
const AMBER_TIMES: f64 = 2.0;
/// Motion of the ends below which the line is not drawn again, m.
const SAME_M: f64 = 1e-3;
/// Side of the seafloor, m: wider than any arm's reach.
const SEAFLOOR_SIDE_M: f64 = 40.0;

/// Body that carries a shape.
#[derive(Clone, Copy)]
enum Carrier {
    Link(usize),
    Base,
    World,
}

/// One shape of a part.
struct Solid<'a> {
    part: &'a str,
    carrier: Carrier,
    carrier_from_shape: Isometry3<f64>,
    shape: SharedShape,
}

/// Draws the line; ends it when nothing is near.
pub(super) fn draw(run: &ReplayScene, input: &ReplayInput, stream: &mut EntityLog) {
    let found = found(run, input);
    if found.is_empty() {
        return;
    }
    let solids = solids(run);
    let entity = format!("{BASE}/nearest");
    stream.log_static(&entity, &LineStrips3D::update_fields().with_radii([0.006]).with_show_labels(true));
    let far_m = input.clearance_m.map_or(FAR_M, |kept_m| FAR_TIMES * kept_m);
    let mut drawn: Option<([Vector3<f64>; 2], Rgba)> = None;
    for clearance in &found {
        let near = (clearance.distance_m <= far_m).then(|| points(run, &solids, clearance)).flatten();
        let Some(points_m) = near else {
            if drawn.take().is_some() {
                stream.clear(&entity, clearance.time_s);
            }
            continue;
        };
        let color = color(clearance.distance_m, input.clearance_m);
        let is_same = |(before_m, shade): ([Vector3<f64>; 2], Rgba)| {
            shade == color && points_m.iter().zip(before_m).all(|(a, b)| (a - b).norm() < SAME_M)
        };
        if drawn.is_some_and(is_same) {
            continue;
        }
        drawn = Some((points_m, color));
        let line = LineStrips3D::update_fields().with_strips([points_m.map(|point_m| vector(&point_m))]);
        // Same value as in the plots: planning reduces the required clearance between two links, and adds the
        // difference to their distance.
        let label = format!("{:.0} mm", 1e3 * clearance.distance_m.max(0.0));
        stream.draw(&entity, clearance.time_s, &line.with_colors([color]).with_labels([label]));
    }
}

/// Returns green, amber or red; white if the required clearance is unknown.
fn color(distance_m: f64, clearance_m: Option<f64>) -> Rgba {
    match clearance_m {
        None => colors::TRAIL,
        Some(kept_m) if distance_m < kept_m => colors::MISS,
        Some(kept_m) if distance_m < AMBER_TIMES * kept_m => colors::TARGET,
        Some(_) => colors::HIT,
    }
}

/// Returns the clearances by truth. Without truth they are those of planning, if a clearance is required.
fn found(run: &ReplayScene, input: &ReplayInput) -> Vec<Clearance> {
    if let Some(truth) = run.truth.as_ref() {
        return truth.clearances.clone();
    }
    let (Some(vehicle), Some(scene), Some(_)) = (run.vehicle, run.scene, input.clearance_m) else { return Vec::new() };
    let model = ClearanceModel::new(run.robot, vehicle, scene);
    let measured = |time_s: f64| {
        let nearest = model.nearest(run.tracks.believed.at(time_s)?);
        let parts = [nearest.first, nearest.second];
        Some(Clearance { time_s, distance_m: nearest.distance_m, parts })
    };
    run.tracks.ticks(RATE_HZ).filter_map(measured).collect()
}

fn solids<'a>(run: &'a ReplayScene<'_>) -> Vec<Solid<'a>> {
    let mut solids = Vec::new();
    let mut push = |part: &'a str, carrier: Carrier, placed: &PlacedShape, carrier_from_owner: Isometry3<f64>| {
        let carrier_from_shape = carrier_from_owner * placed.owner_from_shape * placed.shape.axis_fix();
        solids.push(Solid { part, carrier, carrier_from_shape, shape: placed.shape.to_parry() });
    };
    for (body, link) in run.robot.bodies.iter().enumerate() {
        for placed in &link.collisions {
            push(&link.name, Carrier::Link(body), placed, Isometry3::identity());
        }
    }
    if let Some(vehicle) = run.vehicle {
        for part in &vehicle.parts {
            push(&part.name, Carrier::Base, &part.placed, vehicle.vehicle_from_base.isometry().inverse());
        }
    }
    if let Some(scene) = run.scene {
        for part in &scene.obstacles {
            push(&part.name, Carrier::World, &part.placed, Isometry3::identity());
        }
        if let Some(z_m) = scene.seafloor_z_m {
            // A slab of 1 m below the floor.
            let owner_from_shape = Isometry3::translation(0.0, 0.0, z_m - 0.5);
            let shape = Shape::Box { size_m: [SEAFLOOR_SIDE_M, SEAFLOOR_SIDE_M, 1.0] };
            let slab = PlacedShape { owner_from_shape, shape, color_rgb: [0; 3] };
            push("seafloor", Carrier::World, &slab, Isometry3::identity());
        }
    }
    solids
}

/// Returns the nearest points of two parts in the base frame, m; `None` if a part has no shape.
fn points(run: &ReplayScene, solids: &[Solid<'_>], clearance: &Clearance) -> Option<[Vector3<f64>; 2]> {
    let poses = run.robot.chain.link_poses(&run.shown_angles(clearance.time_s)?);
    let vehicle_from_base = run.vehicle.map_or_else(Isometry3::identity, |v| *v.vehicle_from_base.isometry());
    let base_from_world = (*run.world_from_vehicle(clearance.time_s).isometry() * vehicle_from_base).inverse();
    let [firsts, seconds] = clearance.parts.each_ref().map(|name| {
        let of_part = solids.iter().filter(|solid| solid.part == name.as_str());
        of_part.map(|solid| (solid.pose(&poses, &base_from_world), &solid.shape)).collect::<Vec<_>>()
    });
    let pairs = firsts.iter().flat_map(|a| seconds.iter().map(move |b| (a, b)));
    let apart = pairs.filter_map(|((a_pose, a), (b_pose, b))| between(a_pose, a, b_pose, b));
    apart.min_by(|(_, a_m), (_, b_m)| a_m.total_cmp(b_m)).map(|(points_m, _)| points_m)
}

fn between(a_pose: &Pose3, a: &SharedShape, b_pose: &Pose3, b: &SharedShape) -> Option<([Vector3<f64>; 2], f64)> {
    let ends = |a: Vec3, b: Vec3| [a, b].map(|p| Vector3::new(p.x, p.y, p.z));
    match query::closest_points(a_pose, a.as_ref(), b_pose, b.as_ref(), SEARCHED_M).ok()? {
        ClosestPoints::WithinMargin(on_a, on_b) => Some((ends(on_a, on_b), (on_a - on_b).length())),
        ClosestPoints::Intersecting => {
            let contact = query::contact(a_pose, a.as_ref(), b_pose, b.as_ref(), 0.0).ok()??;
            Some((ends(contact.point1, contact.point2), 0.0))
        }
        ClosestPoints::Disjoint => None,
    }
}

impl Solid<'_> {
    fn pose(&self, poses: &LinkPoses, base_from_world: &Isometry3<f64>) -> Pose3 {
        parry_pose(&match self.carrier {
            Carrier::Link(body) => poses.link(body) * self.carrier_from_shape,
            Carrier::Base => self.carrier_from_shape,
            Carrier::World => base_from_world * self.carrier_from_shape,
        })
    }
}
