//! Solids of arm, vehicle and scene: for collision, clearance and occlusion of tags.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::math::{Pose3, Vec3};
use parry3d::query::{self, Ray};
use parry3d::shape::SharedShape;

use crate::body_poses::BodyPoses;
use crate::convert::to_rapier;
use armcal_core::kinematics::Chain;
use armcal_core::robot::{PlacedShape, Robot, Shape, Vehicle, parry_pose};
use armcal_core::routine::Scene;
use armcal_core::streams::MAX_JOINTS;

/// Solid shapes with their poses in the base frame, and the pairs of parts that are watched.
#[derive(Clone)]
pub(super) struct Solids {
    names: Vec<String>,
    shapes: Vec<Solid>,
    /// Pose `base_from_shape` of each shape, as last placed.
    placed: Vec<Pose3>,
    pairs: PairTable,
    /// Watched pairs of parts that overlap in the stowed pose of the nominal model.
    overlaps: Vec<(usize, usize)>,
    n_bodies: usize,
    first_obstacle: usize,
}

#[derive(Clone)]
pub(super) struct Solid {
    pub part: usize,
    pub carrier: Carrier,
    pub carrier_from_shape: Pose3,
    pub shape: SharedShape,
    radius_m: f64,
    /// Half extents of a box about the shape's origin, in its own axes.
    half_extents_m: Vec3,
}

/// Body or frame that carries a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Carrier {
    /// Body of the arm: 0 is the base, and with it the vehicle.
    Body(usize),
    /// The ground.
    World,
}

/// Pairs of parts that are watched.
#[derive(Clone, Debug)]
pub(super) struct PairTable {
    n_parts: usize,
    watched: Vec<bool>,
}

/// The nearest pair of parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearest {
    pub distance_m: f64,
    pub part_a: usize,
    pub part_b: usize,
}

/// Distance from the camera's eye within which shapes belong to its own housing, m.
pub(super) const HOUSING_M: f64 = 0.03;
/// Side of the seafloor, m: wider than any arm's reach.
const SEAFLOOR_SIDE_M: f64 = 40.0;

impl Solids {
    /// Builds the parts: 0..=n are the bodies of the arm, then those of the vehicle, then seafloor and obstacles.
    pub(super) fn new(robot: &Robot, vehicle: &Vehicle, scene: &Scene) -> Self {
        let mut solids = Self {
            names: Vec::new(),
            shapes: Vec::new(),
            placed: Vec::new(),
            pairs: PairTable { n_parts: 0, watched: Vec::new() },
            overlaps: Vec::new(),
            n_bodies: robot.bodies.len(),
            first_obstacle: 0,
        };
        for (body, link) in robot.bodies.iter().enumerate() {
            let part = solids.name(&link.name);
            for placed in &link.collisions {
                solids.push(part, Carrier::Body(body), placed, &Isometry3::identity());
            }
        }
        let base_from_vehicle = vehicle.vehicle_from_base.inverse();
        for part in &vehicle.parts {
            let index = solids.name(&part.name);
            solids.push(index, Carrier::Body(0), &part.placed, base_from_vehicle.isometry());
        }
        if let Some(z_m) = scene.seafloor_z_m {
            let index = solids.name("seafloor");
            solids.push(index, Carrier::World, &seafloor(z_m), &Isometry3::identity());
        }
        solids.first_obstacle = solids.names.len();
        for obstacle in &scene.obstacles {
            let index = solids.name(&obstacle.name);
            solids.push(index, Carrier::World, &obstacle.placed, &Isometry3::identity());
        }
        solids.watch_pairs(robot, base_from_vehicle.isometry());
        solids
    }

    fn name(&mut self, name: &str) -> usize {
        self.names.push(name.to_owned());
        self.names.len() - 1
    }

    fn push(&mut self, part: usize, carrier: Carrier, placed: &PlacedShape, carrier_from_owner: &Isometry3<f64>) {
        let pose = parry_pose(carrier_from_owner) * shape_pose(placed);
        let radius_m = placed.shape.bounding_radius_m();
        let shape = placed.shape.to_parry();
        let bounds = shape.compute_local_aabb();
        let half_extents_m = bounds.mins.abs().max(bounds.maxs.abs());
        self.shapes.push(Solid { part, carrier, carrier_from_shape: pose, shape, radius_m, half_extents_m });
        self.placed.push(pose);
    }

    /// Watches every link against all parts, except neighbours in the chain and pairs that touch by design (the robot's
    /// `allowed_pairs`). Planning keeps the same pairs apart.
    fn watch_pairs(&mut self, robot: &Robot, base_from_world: &Isometry3<f64>) {
        let (n_bodies, n_parts) = (self.n_bodies, self.names.len());
        self.pairs = PairTable { n_parts, watched: vec![false; n_parts * n_parts] };
        let stowed = BodyPoses::drawn(robot.n_joints(), &robot.chain.link_poses(&robot.stowed));
        self.place(&stowed, base_from_world);
        for a in 1..self.n_bodies {
            for b in (0..n_parts).filter(|&b| b < a.saturating_sub(1) || b >= n_bodies) {
                let on_ground = self.shapes.iter().any(|s| s.part == b && s.carrier == Carrier::World);
                if !on_ground && robot.allowed_pairs.has(&self.names[a], &self.names[b]) {
                    continue;
                }
                self.watch(a, b);
            }
        }
    }

    /// Watches what the vehicle carries against obstacles, too, for a vehicle whose motion is not prescribed. The
    /// seafloor below it is soft ground and is not watched.
    pub(super) fn watch_vehicle(&mut self) {
        let (n_bodies, first_obstacle) = (self.n_bodies, self.first_obstacle);
        for a in (0..first_obstacle).filter(|&a| !(1..n_bodies).contains(&a)) {
            let is_carried = self.shapes.iter().any(|s| s.part == a && s.carrier == Carrier::Body(0));
            for b in (first_obstacle..self.names.len()).filter(|_| is_carried) {
                self.watch(a, b);
            }
        }
    }

    fn watch(&mut self, a: usize, b: usize) {
        self.pairs.watch(a, b);
        if self.distance_of_parts(a, b) <= 0.0 {
            self.overlaps.push((a, b));
        }
    }

    fn distance_of_parts(&self, a: usize, b: usize) -> f64 {
        let mut nearest = f64::INFINITY;
        for i in (0..self.shapes.len()).filter(|&i| self.shapes[i].part == a) {
            for j in (0..self.shapes.len()).filter(|&j| self.shapes[j].part == b) {
                nearest = nearest.min(self.distance(i, j));
            }
        }
        nearest
    }

    /// Returns the distance of two shapes, m; infinite if parry has no answer (it has one for every shape of `Shape`).
    fn distance(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (&self.shapes[i], &self.shapes[j]);
        query::distance(&self.placed[i], a.shape.as_ref(), &self.placed[j], b.shape.as_ref())
            .map_or(f64::INFINITY, |found| found.distance)
    }

    pub(super) fn shapes(&self) -> &[Solid] {
        &self.shapes
    }

    pub(super) fn pairs(&self) -> &PairTable {
        &self.pairs
    }

    /// Returns the names of parts that overlap in the stowed pose of the nominal model, and should not.
    pub(super) fn overlaps(&self) -> Vec<String> {
        let names = |&(a, b): &(usize, usize)| format!("`{}` and `{}`", self.names[a], self.names[b]);
        self.overlaps.iter().map(names).collect()
    }

    pub(super) fn part_name(&self, part: usize) -> &str {
        &self.names[part]
    }

    /// Moves every shape to its present pose.
    pub(super) fn place(&mut self, links: &BodyPoses, base_from_world: &Isometry3<f64>) {
        let ground = parry_pose(base_from_world);
        for (placed, solid) in self.placed.iter_mut().zip(&self.shapes) {
            *placed = match solid.carrier {
                Carrier::Body(0) => solid.carrier_from_shape,
                Carrier::Body(body) => parry_pose(links.link(body)) * solid.carrier_from_shape,
                Carrier::World => ground * solid.carrier_from_shape,
            };
        }
    }

    /// Returns the smallest distance of the given shapes as placed, at most `far_m`.
    pub(super) fn least_distance_m(&self, pairs: &[(usize, usize)], far_m: f64) -> f64 {
        pairs.iter().fold(far_m, |least_m, &(i, j)| {
            if self.is_farther(i, j, least_m) { least_m } else { least_m.min(self.distance(i, j)) }
        })
    }

    /// Returns true if a cheap bound shows that two shapes are at least `distance_m` apart.
    fn is_farther(&self, i: usize, j: usize, distance_m: f64) -> bool {
        let (a, b) = (&self.shapes[i], &self.shapes[j]);
        let between = self.placed[j].translation - self.placed[i].translation;
        if between.length() - a.radius_m - b.radius_m >= distance_m {
            return true;
        }
        // Compares one shape's box in its own axes with the other's sphere.
        let beside = |place: &Pose3, half: Vec3, center: Vec3, radius_m: f64| {
            let local = place.inverse_transform_point(center);
            (local.abs() - half).max(Vec3::ZERO).length() - radius_m >= distance_m
        };
        beside(&self.placed[j], b.half_extents_m, self.placed[i].translation, a.radius_m)
            || beside(&self.placed[i], a.half_extents_m, self.placed[j].translation, b.radius_m)
    }

    /// Returns, for each joint between two bodies, an upper bound on the distance of the outer body's shapes from its
    /// axis, m.
    pub(super) fn levers_m(&self, chain: &Chain, inner: usize, outer: usize) -> [f64; MAX_JOINTS] {
        let own_m = self.extent_m(Carrier::Body(outer));
        let mut levers_m = [0.0; MAX_JOINTS];
        for (joint, lever_m) in levers_m.iter_mut().enumerate().take(outer).skip(inner) {
            let links = &chain.joints()[joint + 1..outer];
            *lever_m = own_m + links.iter().map(|next| next.parent_from_joint.translation.vector.norm()).sum::<f64>();
        }
        levers_m
    }

    /// Returns the pairs of shapes on `inner` and on the body `outer` that are watched against each other.
    pub(super) fn watched_pairs(&self, inner: Carrier, outer: usize) -> Vec<(usize, usize)> {
        let on = |carrier: Carrier| self.shapes.iter().enumerate().filter(move |(_, solid)| solid.carrier == carrier);
        on(inner)
            .flat_map(|(i, a)| on(Carrier::Body(outer)).map(move |(j, b)| (i, a.part, j, b.part)))
            .filter(|&(_, a, _, b)| self.pairs.is_watched(a, b))
            .map(|(i, _, j, _)| (i, j))
            .collect()
    }

    /// Returns true if a shape belongs to the arm or its base link.
    pub(super) fn is_of_arm(&self, shape: usize) -> bool {
        self.shapes[shape].part < self.n_bodies
    }

    /// Returns the nearest of the given pairs as placed, if it is nearer than `far_m`.
    pub(super) fn nearest_of(&self, pairs: &[(usize, usize)], far_m: f64) -> Option<Nearest> {
        pairs.iter().fold(None, |nearest: Option<Nearest>, &(i, j)| {
            let best_m = nearest.map_or(far_m, |nearest| nearest.distance_m);
            if self.is_farther(i, j, best_m) {
                return nearest;
            }
            let distance_m = self.distance(i, j);
            // The arm's part is first, as in `nearest`.
            let (part_a, part_b) = (self.shapes[j].part, self.shapes[i].part);
            if distance_m < best_m { Some(Nearest { distance_m, part_a, part_b }) } else { nearest }
        })
    }

    /// Returns the largest distance of a carrier's shapes from its origin, m.
    pub(super) fn extent_m(&self, carrier: Carrier) -> f64 {
        let on_it = self.shapes.iter().filter(|solid| solid.carrier == carrier);
        on_it.map(|solid| solid.carrier_from_shape.translation.length() + solid.radius_m).fold(0.0, f64::max)
    }

    /// Returns the moving link and the part outside the arm that are nearest, as placed; `None` if nothing is watched.
    pub(super) fn nearest(&self) -> Option<Nearest> {
        let is_link = |solid: &Solid| (1..self.n_bodies).contains(&solid.part);
        let mut nearest: Option<Nearest> = None;
        for (i, a) in self.shapes.iter().enumerate() {
            for (j, b) in self.shapes.iter().enumerate().skip(i + 1) {
                let is_own = a.part < self.n_bodies && b.part < self.n_bodies;
                if is_own || !(is_link(a) || is_link(b)) || !self.pairs.is_watched(a.part, b.part) {
                    continue;
                }
                let best = nearest.map_or(f64::INFINITY, |n| n.distance_m);
                if !self.is_farther(i, j, best) {
                    let distance_m = self.distance(i, j);
                    if distance_m < best {
                        nearest = Some(Nearest { distance_m, part_a: a.part, part_b: b.part });
                    }
                }
            }
        }
        nearest
    }

    /// Returns the shapes of the camera's housing: on its link, and near its eye by the nominal model.
    pub(super) fn housing(&self, robot: &Robot) -> Vec<usize> {
        let mount = &robot.camera.mount;
        let eye = to_rapier(&mount.link_from_frame.translation.vector);
        let is_near = |solid: &Solid| {
            let local = solid.carrier_from_shape.inverse_transform_point(eye);
            parry3d::query::PointQuery::distance_to_local_point(solid.shape.as_ref(), local, true) < HOUSING_M
        };
        let on_link = |solid: &Solid| solid.carrier == Carrier::Body(mount.n_joints);
        (0..self.shapes.len()).filter(|&i| on_link(&self.shapes[i]) && is_near(&self.shapes[i])).collect()
    }

    /// Returns true if any shape except those in `ignored` is between `eye` and `target` (base frame).
    pub(super) fn hides(&self, eye: &Point3<f64>, target: &Point3<f64>, ignored: &[usize]) -> bool {
        let way: Vector3<f64> = target - eye;
        let length = way.norm();
        let ray = Ray::new(to_rapier(&eye.coords), to_rapier(&(way / length)));
        self.shapes
            .iter()
            .zip(&self.placed)
            .enumerate()
            .any(|(i, (solid, pose))| !ignored.contains(&i) && solid.shape.intersects_ray(pose, &ray, length))
    }
}

/// Returns a shape's pose in its owner's frame as parry has it, with its axis turned.
fn shape_pose(placed: &PlacedShape) -> Pose3 {
    parry_pose(&(placed.owner_from_shape * placed.shape.axis_fix()))
}

/// Returns a slab of 1 m with its upper face at `z_m`.
pub(super) fn seafloor(z_m: f64) -> PlacedShape {
    PlacedShape {
        owner_from_shape: Isometry3::translation(0.0, 0.0, z_m - 0.5),
        shape: Shape::Box { size_m: [SEAFLOOR_SIDE_M, SEAFLOOR_SIDE_M, 1.0] },
        color_rgb: [0; 3],
    }
}

impl PairTable {
    fn watch(&mut self, a: usize, b: usize) {
        self.watched[a * self.n_parts + b] = true;
        self.watched[b * self.n_parts + a] = true;
    }

    pub(super) fn is_watched(&self, a: usize, b: usize) -> bool {
        self.watched[a * self.n_parts + b]
    }

    pub(super) fn n_parts(&self) -> usize {
        self.n_parts
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use armcal_core::robot::{load, load_vehicle};

    #[test]
    fn of_any_arm_on_any_vehicle_only_neighbours_go_unwatched() {
        for vehicle in ["work-class-front", "open-frame", "tight-basket", "under-ice"] {
            for arm in ["titan4", "kraft-predator"] {
                only_neighbours_go_unwatched(arm, vehicle);
            }
        }
    }

    fn only_neighbours_go_unwatched(arm: &str, vehicle: &str) {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let vehicle = load_vehicle(&root.join(format!("vehicles/{vehicle}.toml"))).expect("the vehicle reads");
        let robot = load(&root.join(arm)).and_then(|robot| robot.mounted_on(&vehicle)).expect("the robot reads");
        let scene = Scene { seafloor_z_m: Some(-1.1), obstacles: Vec::new() };
        let solids = Solids::new(&robot, &vehicle, &scene);
        let unwatched: Vec<(usize, usize)> = (1..robot.bodies.len())
            .flat_map(|a| (0..solids.pairs.n_parts()).map(move |b| (a, b)))
            .filter(|&(a, b)| !solids.pairs.is_watched(a, b) && (b >= robot.bodies.len() || a.abs_diff(b) > 1))
            .collect();
        let names: Vec<_> = unwatched.iter().map(|&(a, b)| (solids.part_name(a), solids.part_name(b))).collect();
        assert!(names.is_empty(), "{names:?}");
        assert_eq!(solids.housing(&robot).len(), 1, "the camera's own cylinder");
    }
}
