//! True and estimated arm, the camera's view cone, captured views and the tool's path.

use crate::rerun::components::Radius;
use crate::rerun::{LineStrips3D, Points3D};
use nalgebra::Vector3;

use crate::colors;
use crate::entities::BASE;
use crate::entity_log::EntityLog;
use crate::poses::{transform, vector};
use crate::scene::ReplayScene;
use crate::scenery::Mover;
use crate::shapes::{Look, log_shapes, path_part};
use crate::tracks::Tick;
use armcal_core::kinematics::{Attachment, LinkPoses};
use armcal_core::spatial::{Base, Pose, Tool};
use armcal_core::streams::{CaptureSet, JointAngles, MarkKind};

/// Duration of the tool's path that is drawn, s, and its points per second.
const TRAIL_S: f64 = 12.0;
const TRAIL_HZ: f64 = 5.0;
/// Largest number of captured views that are drawn: each of them draws all earlier ones again.
const MAX_CAPTURES: usize = 2000;
/// Length of the lines of sight at the image's corners, m.
const SIGHT_M: f64 = 0.22;

/// Names of the drawn arms. The first is the true arm, or the estimated one if the truth is unknown; the second is the
/// estimated arm if both are drawn.
const SHOWN_ARM: &str = "arm";
const BELIEVED_ARM: &str = "believed_arm";

/// Returns the name of the estimated arm.
pub(super) fn believed_arm(run: &ReplayScene) -> &'static str {
    if run.has_true_joints() { BELIEVED_ARM } else { SHOWN_ARM }
}

/// Returns the entity of an arm's body.
pub(super) fn body_entity(run: &ReplayScene, arm: &str, body: usize) -> String {
    format!("{BASE}/{arm}/{body}_{}", path_part(&run.robot.bodies[body].name))
}

impl ReplayScene<'_> {
    /// Returns the best known joint angles: the true ones, else the estimated ones.
    pub(super) fn shown_angles(&self, time_s: f64) -> Option<JointAngles> {
        let truth = self.truth.as_ref().and_then(|truth| truth.angles(time_s));
        truth.or_else(|| self.tracks.believed.at(time_s).copied())
    }

    /// Returns the estimated tool pose.
    pub(super) fn believed_tool(&self, time_s: f64) -> Option<Pose<Base, Tool>> {
        let angles = self.tracks.believed.at(time_s)?;
        Some(Pose::from_isometry(self.believed_poses(time_s, angles).frame(&self.robot.tool.mount)))
    }

    /// Returns the true tool pose, else the estimated one.
    pub(super) fn shown_tool(&self, time_s: f64) -> Option<Pose<Base, Tool>> {
        let truth = self.truth.as_ref().and_then(|truth| truth.base_from_tool(time_s));
        truth.or_else(|| self.believed_tool(time_s))
    }

    /// Returns the measured gap between the jaws, m.
    fn opening_m(&self, time_s: f64) -> Option<f64> {
        self.tracks.gripper.between(time_s, |a, b, share| a + share * (b - a))
    }

    /// Returns true if true joint angles are known.
    pub(super) fn has_true_joints(&self) -> bool {
        self.truth.as_ref().is_some_and(|truth| truth.angles(0.0).is_some())
    }

    /// Returns true if the tool's true pose is known.
    pub(super) fn has_true_tool(&self) -> bool {
        self.truth.as_ref().is_some_and(|truth| truth.base_from_tool(0.0).is_some())
    }
}

/// Draws the arms, the camera and the tool's path.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    draw_at_rest(run, stream);
    draw_trail(run, stream);
}

/// Draws the arms like [`draw`], without the tool's path: views do not determine it.
pub(super) fn draw_at_rest(run: &ReplayScene, stream: &mut EntityLog) {
    let mut shown = Arm::new(run, stream, SHOWN_ARM, Look::Drawn);
    log_camera(run, stream, &shown);
    for time_s in run.tracks.frames() {
        if let Some(angles) = run.shown_angles(time_s) {
            shown.place(run, stream, time_s, &run.robot.chain.link_poses(&angles));
        }
    }
    if run.has_true_joints() && !run.tracks.believed.is_empty() {
        let mut believed = Arm::new(run, stream, BELIEVED_ARM, Look::Ghost(colors::GHOST));
        for time_s in run.tracks.frames() {
            if let Some(angles) = run.tracks.believed.at(time_s) {
                believed.place(run, stream, time_s, &run.believed_poses(time_s, angles));
            }
        }
    }
    draw_captures(run, stream);
}

/// One drawn arm: a moving entity for each body and each jaw.
struct Arm {
    bodies: Vec<Mover>,
    jaws: Vec<Mover>,
}

impl Arm {
    fn new(run: &ReplayScene, stream: &mut EntityLog, name: &str, look: Look) -> Self {
        let mut bodies = Vec::new();
        for (n, body) in run.robot.bodies.iter().enumerate() {
            let entity = body_entity(run, name, n);
            // The base does not move in its own frame: one drawing of it is enough.
            if n > 0 || matches!(look, Look::Drawn) {
                let shapes = if body.visuals.is_empty() { &body.collisions } else { &body.visuals };
                log_shapes(stream, &entity, shapes, look);
                if shapes.is_empty() {
                    log_skeleton(run, stream, &entity, n);
                }
            }
            bodies.push(Mover::new(entity));
        }
        let mut jaws = Vec::new();
        for (n, jaw) in run.robot.gripper.iter().flat_map(|gripper| &gripper.jaws).enumerate() {
            let entity = format!("{BASE}/{name}/jaw_{n}_{}", path_part(&jaw.name));
            log_shapes(stream, &entity, &jaw.visuals, look);
            jaws.push(Mover::new(entity));
        }
        Self { bodies, jaws }
    }

    fn place(&mut self, run: &ReplayScene, stream: &mut EntityLog, time_s: f64, poses: &LinkPoses) {
        for (n, body) in self.bodies.iter_mut().enumerate() {
            body.place(stream, time_s, poses.link(n));
        }
        let Some(gripper) = &run.robot.gripper else { return };
        let opening_m = run.opening_m(time_s).unwrap_or(gripper.rest_opening_m);
        for (n, jaw) in self.jaws.iter_mut().enumerate() {
            jaw.place(stream, time_s, &(poses.link(gripper.body) * gripper.shift(n, opening_m)));
        }
    }
}

/// Draws a body without known shapes: lines from the joint that moves it to the next joint or the tool, and to the
/// camera that it carries.
fn log_skeleton(run: &ReplayScene, stream: &mut EntityLog, entity: &str, body: usize) {
    let (chain, tool, camera) = (&run.robot.chain, &run.robot.tool.mount, &run.robot.camera.mount);
    let next = chain.joints().get(body).map(|joint| joint.parent_from_joint.translation.vector);
    let carried = |mount: &Attachment| (mount.n_joints == body).then_some(mount.link_from_frame.translation.vector);
    let ends = next.or_else(|| carried(tool)).into_iter().chain(carried(camera));
    let lines: Vec<_> = ends.filter(|end| end.norm() > 0.0).map(|end| [[0.0; 3], vector(&end)]).collect();
    if !lines.is_empty() {
        let lines = LineStrips3D::new(lines).with_radii([0.01]).with_colors([colors::SKELETON]);
        stream.log_static(&format!("{entity}/skeleton"), &lines);
    }
}

/// Draws the camera's lines of sight towards the corners of its image.
fn log_camera(run: &ReplayScene, stream: &mut EntityLog, arm: &Arm) {
    let camera = &run.robot.camera;
    let Some(carrier) = arm.bodies.get(camera.mount.n_joints) else { return };
    let entity = format!("{}/camera", carrier.entity());
    stream.log_static(&entity, &transform(&camera.mount.link_from_frame));
    // The image's corners may lie beyond the field of view: a cone of a narrower angle shows the direction as well.
    let half_angle_rad = camera.lens.max_view_angle_rad().min(0.6);
    let rays = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[x, y]: [f64; 2]| {
        let across = SIGHT_M * half_angle_rad.tan();
        vector(&Vector3::new(0.75 * across * x, 0.63 * across * y, SIGHT_M))
    });
    let mut strips: Vec<Vec<[f32; 3]>> = rays.iter().map(|ray| vec![[0.0; 3], *ray]).collect();
    strips.push(vec![rays[0], rays[1], rays[2], rays[3], rays[0]]);
    let cone = LineStrips3D::new(strips).with_radii([0.003]).with_colors([colors::CAMERA]);
    stream.log_static(&format!("{entity}/view"), &cone);
}

/// Draws the last seconds of the tool's path.
fn draw_trail(run: &ReplayScene, stream: &mut EntityLog) {
    let mut points: Vec<[f32; 3]> = Vec::new();
    let kept = (TRAIL_S * TRAIL_HZ) as usize;
    let entity = format!("{BASE}/tool_path");
    stream.log_static(&entity, &LineStrips3D::update_fields().with_radii([0.004]).with_colors([colors::TRAIL]));
    let mut drawn: Vec<[f32; 3]> = Vec::new();
    let mut gaps = run.tracks.gaps().peekable();
    for Tick { time_s, is_drawn } in run.tracks.ticks_with_lead(TRAIL_HZ, kept as u64) {
        if gaps.next_if(|gap_s| *gap_s < time_s).is_some() {
            points.clear();
        }
        let Some(tool) = run.shown_tool(time_s) else { continue };
        points.push(vector(&tool.origin().vector()));
        let first = points.len().saturating_sub(kept);
        // Positions are rounded to 0.1 mm, so that a tool at rest has one point.
        let mut trail: Vec<[f32; 3]> = points[first..].iter().map(|p| p.map(|v| (v * 1e4).round() / 1e4)).collect();
        trail.dedup();
        if trail != drawn && is_drawn {
            stream.draw(&entity, time_s, &LineStrips3D::update_fields().with_strips([trail.clone()]));
        }
        drawn = trail;
    }
}

/// Radius of a view's dot, points of the screen: the same at any distance, so that many dots do not hide a small arm.
const VIEW_DOT_POINTS: f32 = 3.0;

/// Draws the position of the camera at each captured view; for a fixed camera, that of the tags on the arm. Fitted and
/// held-out views have different colours.
fn draw_captures(run: &ReplayScene, stream: &mut EntityLog) {
    let (mut places, mut shades) = (Vec::new(), Vec::new());
    let mut marks: Vec<_> = run.tracks.marks.iter().collect();
    marks.sort_by(|a, b| a.end_s.total_cmp(&b.end_s));
    for mark in marks {
        if places.len() == MAX_CAPTURES {
            break;
        }
        let MarkKind::Capture { set, .. } = mark.kind else { continue };
        let Some(angles) = run.shown_angles(mark.end_s) else { continue };
        let (camera, tags) = (&run.robot.camera.mount, &run.robot.tag_frame);
        let moved = if run.robot.is_watched() { tags } else { camera };
        places.push(vector(&run.robot.chain.frame(&angles, moved).translation.vector));
        shades.push(match set {
            CaptureSet::Fit => colors::FIT_VIEW,
            CaptureSet::HeldOut => colors::HELD_OUT_VIEW,
        });
        let points = Points3D::new(places.iter().copied()).with_colors(shades.iter().copied());
        stream.draw(&format!("{BASE}/views"), mark.end_s, &points.with_radii([Radius::new_ui_points(VIEW_DOT_POINTS)]));
    }
}
