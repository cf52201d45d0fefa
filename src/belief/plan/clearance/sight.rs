//! Lines of sight and the shapes that block them.
//!
//! Tags are tested for occlusion at many poses, so shapes are placed once per pose. A shape that stays clear of all
//! rays to a tag's corners, or whose box a ray misses, is not tested further.

use crate::plan::constants::clearance_sight::{BESIDE, HOUSING_M, MISS_M};
use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::math::Pose3;
use parry3d::query;
use parry3d::shape::SharedShape;

use crate::plan::clearance::ClearanceModel;
use crate::plan::clearance::separation::Placed;
use crate::plan::clearance::shapes::{LinkShape, StaticShape, vec3};
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{MAX_COLLISION_SHAPES, parry_pose};

/// A line from an eye to a point, without its ends.
struct Ray {
    start: Vector3<f64>,
    direction: Vector3<f64>,
    reach_m: f64,
    parry: query::Ray,
}

impl Ray {
    /// Returns the ray without `skip_m` at its far end; `None` if nothing is left.
    fn between([from_m, to_m]: [&Vector3<f64>; 2], skip_m: f64) -> Option<Self> {
        let sight = to_m - from_m;
        let length = sight.norm();
        let direction = sight / length.max(1e-9);
        let start = from_m + direction * HOUSING_M;
        let parry = query::Ray::new(vec3(&start), vec3(&direction));
        let reach_m = length - HOUSING_M - skip_m;
        (reach_m > 0.0).then_some(Self { start, direction, reach_m, parry })
    }

    fn distance_m(&self, center: &Vector3<f64>) -> f64 {
        let along = (center - self.start).dot(&self.direction).clamp(0.0, self.reach_m);
        (center - (self.start + self.direction * along)).norm()
    }

    fn hits(&self, pose: &Pose3, shape: &SharedShape) -> bool {
        shape.cast_ray(pose, &self.parry, self.reach_m, true).is_some()
    }

    /// True if the ray passes outside the box around a placed shape.
    fn misses_box(&self, placed: &Placed) -> bool {
        let to_start = self.parry.origin - placed.center;
        let (mut enter_m, mut leave_m) = (0.0, self.reach_m);
        for half in placed.half_axes {
            let length = half.length();
            if length == 0.0 {
                return false;
            }
            let axis = half / length;
            let (at, rate) = (axis.dot(to_start), axis.dot(self.parry.dir));
            let most = length + MISS_M;
            if rate.abs() < BESIDE {
                if at.abs() > most + MISS_M {
                    return true;
                }
                continue;
            }
            let [a, b] = [(-most - at) / rate, (most - at) / rate];
            enter_m = f64::max(enter_m, a.min(b));
            leave_m = f64::min(leave_m, a.max(b));
        }
        enter_m > leave_m
    }
}

/// Placements of all shapes at one pose of the arm.
pub(crate) struct Sights<'a> {
    model: &'a ClearanceModel<'a>,
    /// Centre of each moving shape, base frame.
    centers: [Vector3<f64>; MAX_COLLISION_SHAPES],
    poses: [Pose3; MAX_COLLISION_SHAPES],
    eye: Vector3<f64>,
}

impl<'a> Sights<'a> {
    /// Places the shapes, and takes the eye at the arm's camera in these poses.
    pub(crate) fn new(model: &'a ClearanceModel<'a>, poses: &LinkPoses) -> Self {
        let mut sights = Self {
            model,
            centers: [Vector3::zeros(); MAX_COLLISION_SHAPES],
            poses: [Pose3::IDENTITY; MAX_COLLISION_SHAPES],
            eye: poses.frame(&model.robot.camera.mount).translation.vector,
        };
        for (k, moving) in model.moving.iter().enumerate() {
            let isometry = poses.link(moving.body) * moving.body_from_shape;
            (sights.centers[k], sights.poses[k]) = (isometry.translation.vector, parry_pose(&isometry));
        }
        sights
    }

    /// True if a shape hides any of a tag's corners; the last `skip_m` before each corner does not count.
    pub(crate) fn hide(&self, base_from_tag: &Isometry3<f64>, corners: &[Point3<f64>; 4], skip_m: f64) -> bool {
        let corners = corners.map(|corner| (base_from_tag * corner).coords);
        let center = base_from_tag.translation.vector;
        let half_m = corners.iter().map(|corner| (corner - center).norm()).fold(0.0, f64::max);
        let rays = corners.map(|corner| Ray::between([&self.eye, &corner], skip_m));
        let sight = center - self.eye;
        let per_length2 = 1.0 / sight.norm_squared().max(1e-18);
        // At the same share of its length, each ray is at most `half_m` away from the line to the centre.
        let is_far = |at: &Vector3<f64>, radius_m: f64| {
            let to_shape = at - self.eye;
            let share = (to_shape.dot(&sight) * per_length2).clamp(0.0, 1.0);
            (to_shape - sight * share).norm_squared() > (radius_m + half_m + MISS_M).powi(2)
        };
        let near = |ray: &&Ray, at: &Vector3<f64>, radius_m: f64| ray.distance_m(at) <= radius_m;
        let stands = |s: &StaticShape| {
            let meets = |ray: &Ray| !ray.misses_box(&s.placed) && ray.hits(&s.placed.pose, &s.shape);
            !is_far(&s.center_m, s.radius_m)
                && rays.iter().flatten().filter(|ray| near(ray, &s.center_m, s.radius_m)).any(meets)
        };
        let moves = |(k, m): (usize, &LinkShape)| {
            let (at, pose) = (&self.centers[k], &self.poses[k]);
            let meets = |ray: &Ray| !ray.misses_box(&m.placed_at(pose)) && ray.hits(pose, &m.shape);
            !is_far(at, m.radius_m) && rays.iter().flatten().filter(|ray| near(ray, at, m.radius_m)).any(meets)
        };
        self.model.standing.iter().any(stands) || self.model.moving.iter().enumerate().any(moves)
    }
}

impl ClearanceModel<'_> {
    /// True if a shape blocks the line between two points of the base frame; `skip_m` is left out at its far end.
    #[must_use]
    pub fn blocks_sight(&self, poses: &LinkPoses, from_m: &Vector3<f64>, to_m: &Vector3<f64>, skip_m: f64) -> bool {
        self.sight_blocker(poses, [from_m, to_m], skip_m).is_some()
    }

    /// Returns the name of the blocking shape.
    pub(crate) fn sight_blocker(&self, poses: &LinkPoses, ends_m: [&Vector3<f64>; 2], skip_m: f64) -> Option<&str> {
        let ray = Ray::between(ends_m, skip_m)?;
        let stands = |s: &&StaticShape| ray.distance_m(&s.center_m) <= s.radius_m && ray.hits(&s.placed.pose, &s.shape);
        let moves = |m: &&LinkShape| {
            let isometry = poses.link(m.body) * m.body_from_shape;
            ray.distance_m(&isometry.translation.vector) <= m.radius_m && ray.hits(&parry_pose(&isometry), &m.shape)
        };
        let standing = self.standing.iter().find(stands).map(|s| s.name.as_str());
        standing.or_else(|| self.moving.iter().find(moves).map(|m| m.name.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use armcal_core::optics::square_corners;
    use armcal_core::robot::{load, load_vehicle};
    use armcal_core::routine::Scene;
    use armcal_core::stats::stream_rng;
    use armcal_core::streams::JointAngles;

    /// Early rejection of shapes changes no answer: testing the corners' rays against every shape gives the same
    /// result.
    #[test]
    fn a_tag_is_hidden_where_the_ray_to_a_corner_is_blocked() {
        let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let robot = load(&root.join("titan4")).expect("the robot reads");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
        let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() };
        let model = ClearanceModel::new(&robot, &vehicle, &scene);
        let (mut rng, mut n_hidden, mut n_free) = (stream_rng(1, "sights"), 0, 0);
        for _ in 0..2000 {
            let angles = JointAngles::from_fn(6, |j| {
                let sensor = &robot.sensors[j];
                sensor.center_rad + rng.random_range(-1.0..1.0) * sensor.half_range_rad
            });
            let poses = robot.chain.link_poses(&angles);
            let sights = Sights::new(&model, &poses);
            for tag in &robot.tags {
                let (base_from_tag, corners) = (tag.base_from_tag.isometry(), square_corners(tag.size_m));
                let is_blocked = |corner: &Point3<f64>| {
                    model.blocks_sight(&poses, &sights.eye, &(base_from_tag * corner).coords, 0.01)
                };
                let is_hidden = corners.iter().any(is_blocked);
                assert_eq!(sights.hide(base_from_tag, &corners, 0.01), is_hidden, "tag {} at {angles:?}", tag.id);
                *(if is_hidden { &mut n_hidden } else { &mut n_free }) += 1;
            }
        }
        assert!(n_hidden > 2000 && n_free > 2000, "{n_hidden} {n_free}");
    }
}
