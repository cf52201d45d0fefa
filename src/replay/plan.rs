//! A plan as a file for the viewer: the arm's motion along its paths, with its error bounds.
//!
//! The messages that a session would record are computed from the plan and drawn like a recording. Margins, detection
//! probabilities and plots over the poses are added.

use std::path::{Path, PathBuf};

use crate::rerun::components::MarkerShape;
use crate::rerun::{Boxes3D, FillMode, LineStrips3D, Points3D, Scalars, SeriesLines, SeriesPoints};

use crate::colors::{self, Rgba};
use crate::entities::{BASE, CLEARANCE, PREDICTED};
use crate::entity_log::EntityLog;
use crate::error::ReplayError;
use crate::identity::Identity;
use crate::poses::{quaternion, vector};
use crate::scene::{ReplayInput, ReplayScene, RunState};
use crate::scenery::Mover;
use crate::shapes::{Look, log_shapes, path_part};
use crate::tracks::Tracks;
use crate::{blueprint, recording, rrd};
use armcal_belief::plan::{PlanFile, PoseTable, SetName, Timing};
use armcal_core::log::Recording;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::{Scene, TaskSettings};
use armcal_core::streams::{
    CaptureSet, JointAngles, JointStateBelief, LogLevel, LogLine, Mark, MarkKind, Message, Phase, ReachTask,
};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

/// Rate of moving entities, Hz.
const FRAME_HZ: f64 = 12.5;
/// Corners of the error box whose arms are drawn: all joints off to the same side, and alternate joints off to opposite
/// sides.
const CORNERS: [u32; 4] = [0b0000_0000, 0b1111_1111, 0b0101_0101, 0b1010_1010];

/// Plan, and the robot, vehicle, scene and task for which it was made.
pub struct PlanInput<'a> {
    pub plan: &'a PlanFile,
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub scene: &'a Scene,
    pub task: &'a TaskSettings,
    /// Text that is shown unchanged.
    pub markdown: &'a str,
}

/// Writes `out`, an .rrd file with its blueprint, replacing one of that name.
///
/// # Errors
/// [`ReplayError`] if it cannot be written, or the plan belongs to another arm.
pub fn write_plan_rrd(input: &PlanInput<'_>, out: &Path) -> Result<(), ReplayError> {
    let messages = plan_recording(input);
    let shown = ReplayInput {
        recording: &messages,
        truth: None,
        robot: input.robot,
        vehicle: Some(input.vehicle),
        scene: Some(input.scene),
        believed_links: &[],
        tool_beliefs: &[],
        residuals: &[],
        clearance_m: Some(input.plan.margin_m),
        online: None,
        summary_markdown: Some(input.markdown),
    };
    let tracks = Tracks::new(&messages, input.robot)?;
    let ReplayInput { robot, vehicle, scene, .. } = shown;
    let run = ReplayScene {
        tracks,
        truth: None,
        robot,
        vehicle,
        scene,
        believed_chains: Vec::new(),
        online: None,
        state: RunState::Over,
    };
    let mut stream = recording::draw(&run, &shown);
    draw_tool_path(&run, &mut stream);
    draw_margins(input, &run, &mut stream);
    draw_expected_tags(input, &mut stream);
    draw_plots(input, &mut stream);
    rrd::write(out, &Identity::of(&shown)?, &blueprint::build_plan(&run), stream)
}

/// Messages of the plan's motions.
struct PlanMessages<'a> {
    input: &'a PlanInput<'a>,
    messages: Vec<(Stamp, Message)>,
    time_s: f64,
}

fn plan_recording(input: &PlanInput<'_>) -> Recording {
    let mut motions = PlanMessages { input, messages: Vec::new(), time_s: 0.0 };
    motions.add_all();
    Recording {
        path: PathBuf::from("plan.toml"),
        messages: motions.messages,
        joint_names: input.plan.joints.clone(),
        ..Default::default()
    }
}

impl PlanMessages<'_> {
    fn add_all(&mut self) {
        let PlanInput { plan, task, .. } = *self.input;
        let (targets_m, tolerance_m) = (task.targets_m.clone(), task.tolerance_m);
        let stamp = self.stamp();
        self.push(Message::Task(ReachTask { stamp, targets_m, tolerance_m, poses: Vec::new() }));
        self.joint_state(&JointAngles::from_slice(&plan.start_rad));
        let dwell_s = plan.totals.arm_time_s - plan.pose.last().map_or(0.0, |pose| pose.arm_time_s);
        for (pose, path) in plan.pose.iter().zip(&plan.path) {
            self.phase(Phase::Move);
            for (edge, &duration_s) in path.waypoints_rad.windows(2).zip(&path.edge_durations_s) {
                self.edge(&JointAngles::from_slice(&edge[0]), &JointAngles::from_slice(&edge[1]), duration_s);
            }
            self.phase(Phase::Settle);
            let angles = JointAngles::from_slice(&pose.angles_rad);
            self.rest_until(&angles, pose.arm_time_s);
            self.capture(pose, &angles, dwell_s);
        }
        self.phase(Phase::Done);
    }

    fn stamp(&self) -> Stamp {
        SIMULATION_EPOCH.plus_s(self.time_s)
    }

    fn push(&mut self, message: Message) {
        self.messages.push((self.stamp(), message));
    }

    fn joint_state(&mut self, angles: &JointAngles) {
        let stamp = self.stamp();
        self.push(Message::JointStates(JointStateBelief { stamp, angles: *angles }));
    }

    fn phase(&mut self, phase: Phase) {
        let stamp = self.stamp();
        self.push(Message::Mark(Mark { start: stamp, end: stamp, kind: MarkKind::Phase(phase) }));
    }

    fn edge(&mut self, from: &JointAngles, to: &JointAngles, duration_s: f64) {
        let began_s = self.time_s;
        let steps = (duration_s * FRAME_HZ).ceil().max(1.0) as u32;
        for k in 1..=steps {
            let share = f64::from(k) / f64::from(steps);
            self.time_s = began_s + share * duration_s;
            self.joint_state(&Timing::set_point(from, to, share));
        }
    }

    fn rest_until(&mut self, angles: &JointAngles, time_s: f64) {
        self.time_s = self.time_s.max(time_s);
        self.joint_state(angles);
    }

    fn capture(&mut self, pose: &PoseTable, angles: &JointAngles, dwell_s: f64) {
        self.phase(Phase::Capture);
        let stamp = self.stamp();
        self.push(Message::Log(LogLine {
            stamp,
            level: LogLevel::Info,
            name: "plan".to_owned(),
            text: pose_text(pose),
        }));
        self.rest_until(angles, self.time_s + dwell_s);
        let set = match pose.set {
            SetName::Fit => CaptureSet::Fit,
            SetName::HeldOut => CaptureSet::HeldOut,
        };
        let kind = MarkKind::Capture { set, pose_idx: pose.number as u32 - 1 };
        let end = self.stamp();
        self.push(Message::Mark(Mark { start: stamp, end, kind }));
    }
}

fn pose_text(pose: &PoseTable) -> String {
    let tags: Vec<String> =
        pose.tags.iter().map(|tag| format!("{} ({:.0} %)", tag.id, 100.0 * tag.probability)).collect();
    let error = pose.predicted_tool_error_m.map_or_else(String::new, |m| format!(", predicted {:.2} mm", 1e3 * m));
    format!(
        "pose {}: clearance {:.0} mm{error}, {:.0} mm for the estimated arm; tags {}",
        pose.number,
        1e3 * pose.proven_clearance_m,
        1e3 * pose.clearance_m,
        tags.join(", ")
    )
}

/// Draws the whole path of the tool.
fn draw_tool_path(run: &ReplayScene, stream: &mut EntityLog) {
    let tool = |angles: &JointAngles| run.robot.chain.link_poses(angles).frame(&run.robot.tool.mount);
    let way: Vec<[f32; 3]> =
        run.tracks.believed.iter().map(|(_, angles)| vector(&tool(angles).translation.vector)).collect();
    let strip = LineStrips3D::new([way]).with_radii([0.003]).with_colors([colors::PLANNED_PATH]);
    stream.log_static(&format!("{BASE}/planned_way"), &strip);
}

/// Draws transparent arms at corners of the error box, and the tool positions of all corners.
fn draw_margins(input: &PlanInput<'_>, run: &ReplayScene, stream: &mut EntityLog) {
    let robot = input.robot;
    let mut ghosts: Vec<Vec<Mover>> = Vec::new();
    for (n, _) in CORNERS.iter().enumerate() {
        let bodies = robot.bodies.iter().enumerate().skip(1).map(|(body, link)| {
            let entity = format!("{BASE}/margins/arm_{n}/{body}_{}", path_part(&link.name));
            log_shapes(stream, &entity, &link.collisions, Look::Ghost(colors::MARGIN));
            Mover::new(entity)
        });
        ghosts.push(bodies.collect());
    }
    let n_joints = robot.chain.joints().iter().filter(|joint| joint.limits.is_some()).count();
    let cloud = format!("{BASE}/margins/tool");
    stream.log_static(&cloud, &Points3D::update_fields().with_radii([0.012]).with_colors([colors::MARGIN_TOOL]));
    for time_s in run.tracks.ticks(FRAME_HZ) {
        let Some(angles) = run.tracks.believed.at(time_s) else { continue };
        let error_rad = error_at(input.plan, time_s);
        let corner = |bits: u32| {
            JointAngles::from_fn(angles.len(), |j| match j {
                _ if j >= n_joints => angles[j],
                _ if bits >> j & 1 == 1 => angles[j] + error_rad[j],
                _ => angles[j] - error_rad[j],
            })
        };
        for (bodies, &bits) in ghosts.iter_mut().zip(&CORNERS) {
            let poses = robot.chain.link_poses(&corner(bits));
            for (n, body) in bodies.iter_mut().enumerate() {
                body.place(stream, time_s, poses.link(n + 1));
            }
        }
        let tools = (0..1u32 << n_joints)
            .map(|bits| robot.chain.link_poses(&corner(bits)).frame(&robot.tool.mount).translation.vector);
        stream.draw(&cloud, time_s, &Points3D::update_fields().with_positions(tools.map(|tool| vector(&tool))));
    }
}

/// Returns the error bounds, interpolated between those of the poses before and after.
fn error_at(plan: &PlanFile, time_s: f64) -> JointAngles {
    let after = plan.pose.partition_point(|pose| pose.arm_time_s < time_s).min(plan.pose.len().saturating_sub(1));
    let (Some(next), Some(last)) = (plan.pose.get(after), plan.pose.get(after.saturating_sub(1))) else {
        return JointAngles::zeros(plan.joints.len());
    };
    let span_s = next.arm_time_s - last.arm_time_s;
    let share = if span_s > 0.0 { ((time_s - last.arm_time_s) / span_s).clamp(0.0, 1.0) } else { 1.0 };
    let [a, b] = [&last.error_bound_rad, &next.error_bound_rad];
    JointAngles::from_fn(plan.joints.len(), |j| a[j] + share * (b[j] - a[j]))
}

/// Draws frames around the tags expected at the next pose, coloured by the probability of detection.
fn draw_expected_tags(input: &PlanInput<'_>, stream: &mut EntityLog) {
    let entity = format!("{BASE}/sights");
    let mut since_s = 0.0;
    for pose in &input.plan.pose {
        let (mut centers, mut sizes, mut turns, mut shades) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let base_from_tags = input.robot.base_from_tags(&JointAngles::from_slice(&pose.angles_rad));
        for expected in &pose.tags {
            let Some(tag) = input.robot.tag(expected.id) else { continue };
            let place = base_from_tags * tag.base_from_tag.isometry();
            centers.push(vector(&place.translation.vector));
            turns.push(quaternion(&place.rotation));
            let half_m = (0.75 * tag.size_m) as f32;
            sizes.push([half_m, half_m, 0.012]);
            shades.push(chance_color(expected.probability));
        }
        let frames = Boxes3D::from_centers_and_half_sizes(centers, sizes).with_quaternions(turns).with_colors(shades);
        stream.draw(&entity, since_s, &frames.with_fill_mode(FillMode::MajorWireframe).with_radii([0.008]));
        since_s = pose.arm_time_s + 0.01;
    }
}

/// Returns a colour between red (probability 0) and green (1).
fn chance_color(probability: f64) -> Rgba {
    let [from, to] = [colors::MISS, colors::SEEN];
    std::array::from_fn(|k| {
        (f64::from(from[k]) + probability.clamp(0.0, 1.0) * (f64::from(to[k]) - f64::from(from[k]))).round() as u8
    })
}

fn draw_plots(input: &PlanInput<'_>, stream: &mut EntityLog) {
    let plan = input.plan;
    let entity = |name: &str| format!("{CLEARANCE}/{name}");
    let lines = [
        ("believed", "estimated arm, at the pose", colors::CAMERA),
        ("proven", "all arms within bounds, at the pose", colors::SEEN),
        ("on_the_way", "all arms within bounds, on the path", colors::TARGET),
    ];
    for (name, label, shade) in lines {
        let style = SeriesPoints::new().with_names([label]).with_colors([shade]).with_markers([MarkerShape::Circle]);
        stream.log_static(&entity(name), &style.with_marker_sizes([4.0]));
    }
    let margin = SeriesLines::new().with_names(["required clearance"]).with_colors([colors::MISS]).with_widths([1.0]);
    stream.log_static(&entity("margin"), &margin);
    for time_s in [0.0, plan.totals.arm_time_s] {
        stream.draw(&entity("margin"), time_s, &Scalars::single(1e3 * plan.margin_m));
    }
    for (pose, path) in plan.pose.iter().zip(&plan.path) {
        let values = [pose.clearance_m, pose.proven_clearance_m, path.proven_clearance_m];
        for ((name, ..), value_m) in lines.iter().zip(values) {
            stream.draw(&entity(name), pose.arm_time_s, &Scalars::single(1e3 * value_m));
        }
    }
    let predicted = format!("{PREDICTED}/tool_error");
    let style = SeriesLines::new().with_names(["predicted after this view"]).with_colors([colors::BELIEVED]);
    stream.log_static(&predicted, &style.with_widths([1.8]));
    for pose in &plan.pose {
        if let Some(error_m) = pose.predicted_tool_error_m {
            stream.draw(&predicted, pose.arm_time_s, &Scalars::single(1e3 * error_m));
        }
    }
}
