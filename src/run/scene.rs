//! Tags, targets and meshes as solids, for Foxglove.

use nalgebra::Isometry3;

use armcal_core::log::ros::{
    Color, Pose, Quaternion, SceneEntity, SceneUpdate, SizedPrimitive, TextPrimitive, Time, TriangleListPrimitive,
};
use armcal_core::robot::{PlacedShape, Robot, Shape, tag_frame_name};

/// Height of a tag's name, m.
const LETTERS_M: f64 = 0.05;
/// Color of targets.
const TARGET: Color = Color { r: 0.95, g: 0.6, b: 0.1, a: 0.8 };
const LETTERS: Color = Color { r: 0.9, g: 0.9, b: 0.9, a: 1.0 };

/// The scene at the start: the tags' names, the task's targets, links that are meshes in the URDF.
pub(super) fn scene(robot: &Robot, targets_m: &[[f64; 3]], tolerance_m: f64, now: Time) -> SceneUpdate {
    let entity = |frame: &str, id: &str| SceneEntity {
        timestamp: now,
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..SceneEntity::default()
    };
    let mut entities = Vec::new();
    for tag in robot.tags.iter().filter(|tag| tag.is_known()) {
        let name = tag_frame_name(robot.tag_family, tag.id);
        let text = TextPrimitive {
            pose: pose(&Isometry3::translation(0.0, 0.0, LETTERS_M)),
            billboard: true,
            font_size: LETTERS_M,
            scale_invariant: false,
            color: LETTERS,
            text: tag.id.to_string(),
        };
        entities.push(SceneEntity { texts: vec![text], ..entity(&name, &name) });
    }
    let balls = targets_m.iter().map(|&[x, y, z]| SizedPrimitive {
        pose: pose(&Isometry3::translation(x, y, z)),
        size: [2.0 * tolerance_m; 3].into(),
        color: TARGET,
    });
    entities.push(SceneEntity { spheres: balls.collect(), ..entity(&robot.base_link, "targets") });
    for body in &robot.bodies {
        let triangles: Vec<_> = body.collisions.iter().filter_map(mesh).collect();
        if !triangles.is_empty() {
            entities.push(SceneEntity { triangles, ..entity(&body.name, &format!("hulls of {}", body.name)) });
        }
    }
    SceneUpdate { entities, ..SceneUpdate::default() }
}

fn mesh(placed: &PlacedShape) -> Option<TriangleListPrimitive> {
    let Shape::Hull(hull) = &placed.shape else { return None };
    let [r, g, b] = placed.color_rgb.map(|part| f64::from(part) / 255.0);
    Some(TriangleListPrimitive {
        pose: pose(&placed.owner_from_shape),
        points: hull.corners_m().iter().map(|corner| (*corner).into()).collect(),
        color: Color { r, g, b, a: 1.0 },
        colors: Vec::new(),
        indices: hull.triangles().iter().flatten().copied().collect(),
    })
}

fn pose(place: &Isometry3<f64>) -> Pose {
    let turn = &place.rotation;
    let orientation = Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w };
    Pose { position: <[f64; 3]>::from(place.translation.vector).into(), orientation }
}
