//! Scalars over time.

use crate::rerun::components::MarkerShape;
use crate::rerun::{Scalars, SeriesLines, SeriesPoints};

use crate::colors::{self, Rgba};
use crate::entities::{COUNTS, JOINT_ANGLE, JOINT_ERROR, TEMPERATURE, TOOL_ERROR};
use crate::entity_log::EntityLog;
use crate::scene::ReplayScene;
use crate::tracks::{GAP_S, HOLD_S};
use armcal_core::streams::{JointAngles, ReachAttempt};

/// Sample rates of moving quantities, and of slow ones, Hz.
const FAST_HZ: f64 = 12.5;
const SLOW_HZ: f64 = 2.0;

/// Draws all plots.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    draw_angles(run, stream);
    draw_joint_error(run, stream);
    draw_tool_error(run, stream);
    draw_temperatures(run, stream);
    let names = run.robot.joint_names();
    style(stream, COUNTS, &names, &colors::JOINTS, 1.2);
    interrupt(run, stream, COUNTS);
    for time_s in run.tracks.ticks(FAST_HZ) {
        if let Some(counts) = run.tracks.counts.at(time_s) {
            stream.draw(COUNTS, time_s, &Scalars::new(counts.iter().copied()));
        }
    }
}

fn style(stream: &mut EntityLog, entity: &str, names: &[String], shades: &[Rgba], width: f32) {
    let shades = shades.iter().copied().take(names.len());
    let lines = SeriesLines::new().with_names(names.iter().map(String::as_str)).with_colors(shades);
    stream.log_static(entity, &lines.with_widths(names.iter().map(|_| width)));
}

/// Ends the lines at gaps of the recording.
fn interrupt(run: &ReplayScene, stream: &mut EntityLog, entity: &str) {
    for gap_s in run.tracks.gaps() {
        stream.draw(entity, gap_s, &Scalars::new([] as [f64; 0]));
    }
}

/// Returns the estimated angles at the drawn times, s. `None` ends the lines after a long time without an estimate,
/// which would otherwise appear as a ramp.
pub(super) fn believed<'a>(run: &'a ReplayScene<'_>) -> Vec<(f64, Option<&'a JointAngles>)> {
    let step_s = 0.9 / run.tracks.affordable_hz(FAST_HZ);
    let (mut next_s, mut last_s) = (0.0, f64::INFINITY);
    let mut drawn = Vec::new();
    for (time_s, angles) in run.tracks.believed.iter() {
        if time_s - last_s > GAP_S {
            drawn.push((last_s + HOLD_S, None));
        }
        last_s = *time_s;
        if *time_s >= next_s {
            next_s = time_s + step_s;
            drawn.push((*time_s, Some(angles)));
        }
    }
    drawn
}

/// Draws estimated angles as bright lines, true ones as dark lines of the same colours.
fn draw_angles(run: &ReplayScene, stream: &mut EntityLog) {
    let names = run.robot.joint_names();
    let (believed, truth) = (format!("{JOINT_ANGLE}/believed"), format!("{JOINT_ANGLE}/true"));
    if run.has_true_joints() {
        let true_names: Vec<String> = names.iter().map(|name| format!("{name} (true)")).collect();
        style(stream, &truth, &true_names, &colors::JOINTS.map(colors::dimmed), 2.5);
        interrupt(run, stream, &truth);
    }
    style(stream, &believed, &names, &colors::JOINTS, 1.2);
    interrupt(run, stream, &believed);
    for time_s in run.tracks.ticks(FAST_HZ) {
        if let Some(angles) = run.tracks.believed.at(time_s) {
            stream.draw(&believed, time_s, &shown(run, angles));
        }
        if let Some(angles) = run.truth.as_ref().and_then(|truth| truth.angles(time_s)) {
            stream.draw(&truth, time_s, &shown(run, &angles));
        }
    }
}

/// Returns the angles in degrees; slides in millimetres.
fn shown(run: &ReplayScene, angles: &JointAngles) -> Scalars {
    Scalars::new(angles.iter().zip(&run.robot.sensors).map(|(angle_rad, spec)| angle_rad * spec.unit().scale()))
}

/// Returns the joint errors, estimated minus true, the shorter way round. They are taken at the times of the estimates,
/// so that motion adds nothing. Empty where the lines end.
pub(super) fn joint_errors_deg(run: &ReplayScene) -> Vec<(f64, Vec<f64>)> {
    let Some(truth) = run.truth.as_ref().filter(|_| run.has_true_joints()) else { return Vec::new() };
    let errors = |(time_s, believed): (f64, Option<&JointAngles>)| {
        let Some(believed) = believed else { return Some((time_s, Vec::new())) };
        let angles = truth.angles(time_s)?;
        let difference = |j: usize| (believed[j] - angles[j]).to_degrees();
        let errors = (0..believed.len()).map(|j| (difference(j) + 180.0).rem_euclid(360.0) - 180.0);
        Some((time_s, errors.collect()))
    };
    believed(run).into_iter().filter_map(errors).collect()
}

fn draw_joint_error(run: &ReplayScene, stream: &mut EntityLog) {
    if !run.has_true_joints() {
        return;
    }
    style(stream, JOINT_ERROR, &run.robot.joint_names(), &colors::JOINTS, 1.5);
    for (time_s, errors_deg) in joint_errors_deg(run) {
        stream.draw(JOINT_ERROR, time_s, &Scalars::new(errors_deg));
    }
}

/// Returns the distance between estimated and true tool, mm; `None` where the line ends.
pub(super) fn tool_errors_mm(run: &ReplayScene) -> Vec<(f64, Option<f64>)> {
    let Some(truth) = run.truth.as_ref() else { return Vec::new() };
    let error = |(time_s, angles): (f64, Option<&JointAngles>)| {
        let Some(angles) = angles else { return Some((time_s, None)) };
        let tool = run.believed_poses(time_s, angles).frame(&run.robot.tool.mount);
        let actual = truth.base_from_tool(time_s)?.origin().vector();
        Some((time_s, Some(1000.0 * (tool.translation.vector - actual).norm())))
    };
    believed(run).into_iter().filter_map(error).collect()
}

/// Draws the distance between estimated and true tool, and the miss of each arrival, mm.
fn draw_tool_error(run: &ReplayScene, stream: &mut EntityLog) {
    if !run.has_true_tool() {
        return;
    }
    let name = "believed tool to true tool".to_owned();
    let entity = format!("{TOOL_ERROR}/believed");
    style(stream, &entity, &[name], &[colors::BELIEVED], 1.5);
    for (time_s, error_mm) in tool_errors_mm(run) {
        stream.draw(&entity, time_s, &Scalars::new(error_mm));
    }
    let Some((since_s, task)) = run.tracks.task else { return };
    let tolerance = format!("{TOOL_ERROR}/tolerance");
    style(stream, &tolerance, &["tolerance".to_owned()], &[colors::HIT], 1.0);
    for time_s in [since_s, run.tracks.duration_s] {
        stream.draw(&tolerance, time_s, &Scalars::single(1000.0 * task.tolerance_m));
    }
    for (attempt, name, shade, marker) in [
        (ReachAttempt::Before, "before", colors::MISS, MarkerShape::Cross),
        (ReachAttempt::After, "after", colors::TARGET, MarkerShape::Diamond),
    ] {
        let arrivals: Vec<_> = run.arrivals().into_iter().filter(|arrival| arrival.attempt == attempt).collect();
        if arrivals.is_empty() {
            continue;
        }
        let entity = format!("{TOOL_ERROR}/{name}");
        let points = SeriesPoints::new().with_names([format!("miss at target, {name}")]).with_colors([shade]);
        stream.log_static(&entity, &points.with_markers([marker]).with_marker_sizes([5.0]));
        for arrival in arrivals {
            stream.draw(&entity, arrival.time_s, &Scalars::single(1000.0 * arrival.miss_m));
        }
    }
}

/// Returns all temperatures that are drawn, C.
pub(super) fn temperatures_c(run: &ReplayScene) -> Vec<f64> {
    let both = [&run.tracks.oil_c, &run.tracks.water_c];
    both.iter().flat_map(|track| run.tracks.ticks(SLOW_HZ).filter_map(|time_s| track.at(time_s).copied())).collect()
}

fn draw_temperatures(run: &ReplayScene, stream: &mut EntityLog) {
    let tracks = [("oil", &run.tracks.oil_c, colors::OIL), ("water", &run.tracks.water_c, colors::COLD)];
    for (name, track, shade) in tracks.into_iter().filter(|(_, track, _)| !track.is_empty()) {
        let entity = format!("{TEMPERATURE}/{name}");
        style(stream, &entity, &[name.to_owned()], &[shade], 1.5);
        interrupt(run, stream, &entity);
        for time_s in run.tracks.ticks(SLOW_HZ) {
            if let Some(value_c) = track.at(time_s) {
                stream.draw(&entity, time_s, &Scalars::single(*value_c));
            }
        }
    }
}
