//! Online estimates: the expected tool error, the change of each sensor's offset, and the events.

use crate::rerun::{Scalars, SeriesLines, StateChange, StateConfiguration};

use crate::colors;
use crate::entities::{EVENTS_LANE, OFFSET_CHANGE, TOOL_ERROR};
use crate::entity_log::EntityLog;
use crate::scene::ReplayScene;
use armcal_belief::calib::online::{BeliefLog, BeliefRow, OnlineEvent};
use armcal_core::time::Stamp;

/// Shortest drawn span of an event, as a share of the recording.
const LEAST_SHARE: f64 = 0.01;

/// Draws plots and lane; nothing without an online estimate.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    let Some(log) = run.online else { return };
    draw_expected_error(run, log, stream);
    draw_offsets(run, log, stream);
    draw_events(run, log, stream);
}

fn place_s(run: &ReplayScene, nanos: i64) -> f64 {
    let stamp = Stamp { nanos };
    run.tracks.place_s(stamp, stamp)
}

fn draw_expected_error(run: &ReplayScene, log: &BeliefLog, stream: &mut EntityLog) {
    for (name, shade, of) in [
        ("expected now", colors::EXPECTED, (|row| row.tool_error_m.median) as fn(&BeliefRow) -> f64),
        ("expected in an hour without views", colors::dimmed(colors::EXPECTED), |row| {
            row.tool_error_in_an_hour_m.median
        }),
    ] {
        let entity = format!("{TOOL_ERROR}/{}", name.replace(' ', "_"));
        stream.log_static(&entity, &SeriesLines::new().with_names([name]).with_colors([shade]).with_widths([1.8]));
        for row in log.beliefs() {
            stream.draw(&entity, place_s(run, row.stamp_nanos), &Scalars::single(1e3 * of(row)));
        }
    }
}

/// Draws the change of each joint's offset since the first estimate, bright, between bounds of one standard deviation,
/// dark.
fn draw_offsets(run: &ReplayScene, log: &BeliefLog, stream: &mut EntityLog) {
    let Some(first) = log.beliefs().next() else { return };
    let names = run.robot.joint_names();
    // Offsets distal to the camera are unobservable.
    let joints = 0..run.robot.camera.mount.n_joints.min(first.offset_rad.len());
    for (part, sigmas) in [("believed", 0.0), ("above", 1.0), ("below", -1.0)] {
        let entity = format!("{OFFSET_CHANGE}/{part}");
        let shade = |joint: usize| {
            let shade = colors::JOINTS[joint % colors::JOINTS.len()];
            if sigmas == 0.0 { shade } else { colors::dimmed(shade) }
        };
        let name = |joint: usize| {
            let name = &names[joint];
            if sigmas == 0.0 { name.clone() } else { format!("{name} {sigmas:+} sigma") }
        };
        let lines = SeriesLines::new().with_names(joints.clone().map(name)).with_colors(joints.clone().map(shade));
        let width = if sigmas == 0.0 { 1.8 } else { 0.8 };
        stream.log_static(&entity, &lines.with_widths(joints.clone().map(|_| width)));
        for row in log.beliefs() {
            let at = |joint: usize| {
                let [offset_rad, std_rad] = row.offset_rad[joint];
                (offset_rad - first.offset_rad[joint][0] + sigmas * std_rad).to_degrees()
            };
            let values: Vec<f64> = joints.clone().take(row.offset_rad.len()).map(at).collect();
            stream.draw(&entity, place_s(run, row.stamp_nanos), &Scalars::new(values));
        }
    }
}

/// Draws a lane with a span for each event, from its first sign to its verdict.
fn draw_events(run: &ReplayScene, log: &BeliefLog, stream: &mut EntityLog) {
    let events: Vec<&OnlineEvent> = log.events().collect();
    if events.is_empty() {
        return;
    }
    let lines: Vec<String> = events.iter().map(|event| event.to_line()).collect();
    let mut values: Vec<&str> = lines.iter().map(String::as_str).collect();
    values.sort_unstable();
    values.dedup();
    let look = StateConfiguration::new().with_values(values.iter().copied());
    stream.log_static(EVENTS_LANE, &look.with_colors(values.iter().map(|_| colors::MISS)));
    for (n, (event, line)) in events.iter().zip(&lines).enumerate() {
        let since_s = place_s(run, event.since_nanos);
        let least_s = since_s + LEAST_SHARE * run.tracks.duration_s;
        let end_s = place_s(run, event.decided_nanos).max(least_s);
        stream.draw(EVENTS_LANE, since_s, &StateChange::single(line.as_str()));
        if events.get(n + 1).is_none_or(|next| place_s(run, next.since_nanos) > end_s) {
            stream.draw(EVENTS_LANE, end_s, &StateChange::single(""));
        }
    }
}
