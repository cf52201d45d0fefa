//! Phases, views, reaches and faults as lanes of states, and the log.

use std::collections::{BTreeMap, BTreeSet};

use crate::rerun::{StateChange, StateConfiguration, TextLog, TextLogLevel};

use crate::colors::{self, Rgba};
use crate::entities::{LOG, PHASE_LANE, TARGETS_LANE, VIEWS_LANE};
use crate::entity_log::EntityLog;
use crate::fault_words::Fault;
use crate::scene::ReplayScene;
use crate::shapes::path_part;
use crate::tracks::Span;
use armcal_core::streams::{CaptureSet, LogLevel, MarkKind, Phase, ReachAttempt};

/// Draws the lanes and the log.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    draw_phases(run, stream);
    draw_lane(run, stream, VIEWS_LANE, view_state);
    draw_lane(run, stream, TARGETS_LANE, reach_state);
    draw_faults(run, stream);
    draw_log(run, stream);
}

fn draw_phases(run: &ReplayScene, stream: &mut EntityLog) {
    const PHASES: [(Phase, &str, Rgba); 8] = [
        (Phase::Plan, "plan", [130, 130, 150, 255]),
        (Phase::Move, "move", [80, 120, 200, 255]),
        (Phase::Settle, "settle", [70, 160, 170, 255]),
        (Phase::Capture, "capture", [70, 170, 90, 255]),
        (Phase::Calibrate, "calibrate", [200, 80, 190, 255]),
        (Phase::Reach, "reach", [215, 150, 50, 255]),
        (Phase::Wait, "wait", [90, 90, 120, 255]),
        (Phase::Done, "done", [110, 110, 110, 255]),
    ];
    let look = StateConfiguration::new().with_values(PHASES.map(|(_, name, _)| name));
    stream.log_static(PHASE_LANE, &look.with_colors(PHASES.map(|(_, _, color)| color)));
    let mut shown = None;
    let mut gaps = run.tracks.gaps().peekable();
    for mark in &run.tracks.marks {
        let MarkKind::Phase(phase) = mark.kind else { continue };
        while let Some(gap_s) = gaps.next_if(|gap_s| *gap_s < mark.start_s) {
            stream.draw(PHASE_LANE, gap_s, &StateChange::single(""));
            shown = None;
        }
        let name = PHASES.iter().find(|(other, ..)| *other == phase).map(|(_, name, _)| *name);
        if let Some(name) = name.filter(|_| shown != Some(phase)) {
            stream.draw(PHASE_LANE, mark.start_s, &StateChange::single(name));
            shown = Some(phase);
        }
    }
}

/// State of a lane for one mark.
struct State {
    /// Name, unique in the lane.
    name: String,
    /// Short text on the span.
    label: String,
    color: Rgba,
}

fn view_state(_: &ReplayScene, mark: &Span) -> Option<State> {
    let MarkKind::Capture { set, pose_idx } = mark.kind else { return None };
    let (set, color) = match set {
        CaptureSet::Fit => ("to fit", colors::FIT_VIEW),
        CaptureSet::HeldOut => ("held out", colors::HELD_OUT_VIEW),
    };
    let n = u64::from(pose_idx) + 1;
    Some(State { name: format!("view {n}, {set}"), label: n.to_string(), color: colors::dimmed(color) })
}

fn reach_state(run: &ReplayScene, mark: &Span) -> Option<State> {
    let MarkKind::Reach { attempt, target_idx } = mark.kind else { return None };
    let when = match attempt {
        ReachAttempt::Before => "before",
        ReachAttempt::After => "after",
    };
    let (verdict, color) = match run.arrival(mark) {
        None => ("reached for", colors::TARGET),
        Some(arrival) if arrival.hit => ("hit", colors::HIT),
        Some(_) => ("missed", colors::MISS),
    };
    let n = u64::from(target_idx) + 1;
    let name = format!("target {n} {verdict}, {when} calibration");
    Some(State { name, label: n.to_string(), color: colors::dimmed(color) })
}

/// Draws the truth's latest fault of each kind from its time on; a lane cannot show the duration of a fault.
fn draw_faults(run: &ReplayScene, stream: &mut EntityLog) {
    let faults = || run.truth.iter().flat_map(|truth| &truth.faults);
    let mut names: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for fault in faults() {
        names.entry(fault.of.lane()).or_default().insert(&fault.sentence);
    }
    for (lane, names) in names {
        let look = StateConfiguration::new().with_values(names.iter().copied());
        stream.log_static(lane, &look.with_colors(names.iter().map(|_| colors::dimmed(colors::MISS))));
    }
    for fault in faults() {
        stream.draw(fault.of.lane(), fault.time_s, &StateChange::single(fault.sentence.as_str()));
    }
}

/// Draws a lane with a state for each mark that `state` knows, and gaps between them.
fn draw_lane(run: &ReplayScene, stream: &mut EntityLog, lane: &str, state: fn(&ReplayScene, &Span) -> Option<State>) {
    let spans: Vec<_> =
        run.tracks.marks.iter().filter_map(|mark| Some((mark.start_s, mark.end_s, state(run, mark)?))).collect();
    if spans.is_empty() {
        return;
    }
    let looks: BTreeMap<&str, &State> = spans.iter().map(|(_, _, state)| (state.name.as_str(), state)).collect();
    let look = StateConfiguration::new().with_values(looks.keys().copied());
    let look = look.with_labels(looks.values().map(|state| state.label.as_str()));
    stream.log_static(lane, &look.with_colors(looks.values().map(|state| state.color)));
    for (n, (start_s, end_s, state)) in spans.iter().enumerate() {
        stream.draw(lane, *start_s, &StateChange::single(state.name.as_str()));
        let next_s = spans.get(n + 1).map_or(f64::INFINITY, |(next_s, ..)| *next_s);
        if *end_s < next_s && end_s > start_s {
            // An empty state is a gap.
            stream.draw(lane, *end_s, &StateChange::single(""));
        }
    }
}

/// Draws the log's lines by their senders, and a line for each arrival.
fn draw_log(run: &ReplayScene, stream: &mut EntityLog) {
    let mut lines: Vec<(f64, String, TextLog)> = Vec::new();
    for (time_s, line) in &run.tracks.log {
        let level = match line.level {
            LogLevel::Debug => TextLogLevel::DEBUG,
            LogLevel::Info => TextLogLevel::INFO,
            LogLevel::Warn => TextLogLevel::WARN,
            LogLevel::Error => TextLogLevel::ERROR,
        };
        lines.push((*time_s, path_part(&line.name), TextLog::new(line.text.as_str()).with_level(level)));
    }
    for arrival in run.arrivals() {
        let when = match arrival.attempt {
            ReachAttempt::Before => "before",
            ReachAttempt::After => "after",
        };
        let verdict = if arrival.hit { "hit" } else { "missed" };
        let text = format!(
            "{when} calibration: target {} {verdict}, tool rests {:.1} mm away",
            arrival.target_idx + 1,
            1000.0 * arrival.miss_m
        );
        lines.push((arrival.time_s, "truth".to_owned(), TextLog::new(text).with_level(TextLogLevel::INFO)));
    }
    for Fault { time_s, sentence, .. } in run.truth.iter().flat_map(|truth| &truth.faults) {
        let line = TextLog::new(format!("fault: {sentence}")).with_level(TextLogLevel::WARN);
        lines.push((*time_s, "truth".to_owned(), line));
    }
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (time_s, sender, line) in lines {
        let sender = if sender.is_empty() { "run" } else { sender.as_str() };
        stream.draw(&format!("{LOG}/{sender}"), time_s, &line);
    }
}
