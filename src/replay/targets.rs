//! The reach task: targets, and the true rest position of the tool for each.

use crate::rerun::{LineStrips3D, Points3D};
use nalgebra::Vector3;

use crate::colors::{self, Rgba};
use crate::entities::BASE;
use crate::entity_log::EntityLog;
use crate::poses::vector;
use crate::scene::ReplayScene;
use crate::tracks::Span;
use armcal_core::streams::{MarkKind, ReachAttempt, ReachTask};

/// Smallest radius of a drawn target, m: small tolerances are drawn larger to be visible.
const SMALLEST_M: f64 = 0.02;

/// Arrival at a target, judged by truth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    pub time_s: f64,
    pub attempt: ReachAttempt,
    pub target_idx: usize,
    /// Rest position of the tool, base frame, m.
    pub rest_m: Vector3<f64>,
    pub miss_m: f64,
    pub hit: bool,
}

impl ReplayScene<'_> {
    /// Returns the arrivals in the order of time; none without truth.
    pub(super) fn arrivals(&self) -> Vec<Arrival> {
        let mut arrivals: Vec<Arrival> = self.tracks.marks.iter().filter_map(|mark| self.arrival(mark)).collect();
        arrivals.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        arrivals
    }

    /// Returns the arrival of a reach mark.
    pub(super) fn arrival(&self, mark: &Span) -> Option<Arrival> {
        let MarkKind::Reach { attempt, target_idx } = mark.kind else { return None };
        let (_, task) = self.tracks.task?;
        let target_idx = usize::try_from(target_idx).ok()?;
        let target_m = Vector3::from(*task.targets_m.get(target_idx)?);
        let rest_m = self.truth.as_ref()?.base_from_tool(mark.end_s)?.origin().vector();
        let miss_m = (rest_m - target_m).norm();
        let hit = miss_m <= task.tolerance_m;
        Some(Arrival { time_s: mark.end_s, attempt, target_idx, rest_m, miss_m, hit })
    }
}

/// Draws the targets and their arrivals.
pub(super) fn draw(run: &ReplayScene, stream: &mut EntityLog) {
    let Some((since_s, task)) = run.tracks.task else { return };
    let mut board = TargetMarkers::new(task);
    board.draw_targets(stream, since_s);
    for arrival in run.arrivals() {
        board.note(arrival);
        let time_s = arrival.time_s.max(since_s);
        board.draw_targets(stream, time_s);
        board.draw_rests(stream, time_s, ReachAttempt::Before);
        board.draw_rests(stream, time_s, ReachAttempt::After);
    }
}

/// Arrivals at each target so far.
struct TargetMarkers<'a> {
    task: &'a ReachTask,
    latest: Vec<Option<Arrival>>,
    all: Vec<Arrival>,
}

impl<'a> TargetMarkers<'a> {
    fn new(task: &'a ReachTask) -> Self {
        Self { task, latest: vec![None; task.targets_m.len()], all: Vec::new() }
    }

    fn note(&mut self, arrival: Arrival) {
        self.latest[arrival.target_idx] = Some(arrival);
        self.all.push(arrival);
    }

    fn draw_targets(&self, stream: &mut EntityLog, time_s: f64) {
        let positions = self.task.targets_m.iter().map(|target| target.map(|v| v as f32));
        let shades = self.latest.iter().map(|latest| latest.map_or(colors::TARGET, verdict_color));
        // Figures of earlier arrivals are only in the log: all figures at once would hide one another and the tags.
        let last = self.all.last().map(|arrival| arrival.target_idx);
        let labels = self.latest.iter().enumerate().map(|(at, latest)| match latest.filter(|_| last == Some(at)) {
            None => (at + 1).to_string(),
            Some(arrival) => match self.missed_before_m(&arrival) {
                None => format!("{}: {:.1} mm", at + 1, 1000.0 * arrival.miss_m),
                Some(before_m) => {
                    format!("{}: {:.1} \u{2192} {:.1} mm", at + 1, 1000.0 * before_m, 1000.0 * arrival.miss_m)
                }
            },
        });
        let balls = Points3D::new(positions).with_radii([self.task.tolerance_m.max(SMALLEST_M) as f32]);
        let balls = balls.with_colors(shades).with_labels(labels).with_show_labels(true);
        stream.draw(&format!("{BASE}/task/targets"), time_s, &balls);
    }

    /// Returns the miss of the same target before calibration, for an `arrival` after it.
    fn missed_before_m(&self, arrival: &Arrival) -> Option<f64> {
        let earlier = |a: &&Arrival| a.target_idx == arrival.target_idx && a.attempt == ReachAttempt::Before;
        let before = self.all.iter().rev().find(earlier)?;
        (arrival.attempt == ReachAttempt::After).then_some(before.miss_m)
    }

    /// Draws lines from the targets to the tool's rest positions, with a ball there.
    fn draw_rests(&self, stream: &mut EntityLog, time_s: f64, attempt: ReachAttempt) {
        let shown: Vec<&Arrival> = self.all.iter().filter(|arrival| arrival.attempt == attempt).collect();
        if shown.is_empty() {
            return;
        }
        let is_past = attempt == ReachAttempt::Before && self.all.iter().any(|a| a.attempt == ReachAttempt::After);
        let shades: Vec<Rgba> = shown.iter().map(|a| if is_past { colors::PAST } else { verdict_color(**a) }).collect();
        let strips = shown.iter().map(|arrival| {
            let target = self.task.targets_m[arrival.target_idx].map(|v| v as f32);
            [target, vector(&arrival.rest_m)]
        });
        let (name, radius_m) = match attempt {
            ReachAttempt::Before => ("before", 0.004),
            ReachAttempt::After => ("after", 0.006),
        };
        let lines = LineStrips3D::new(strips).with_colors(shades.iter().copied()).with_radii([radius_m]);
        stream.draw(&format!("{BASE}/task/{name}/miss"), time_s, &lines);
        let rests = Points3D::new(shown.iter().map(|arrival| vector(&arrival.rest_m))).with_colors(shades);
        stream.draw(&format!("{BASE}/task/{name}/rest"), time_s, &rests.with_radii([2.5 * radius_m]));
    }
}

fn verdict_color(arrival: Arrival) -> Rgba {
    if arrival.hit { colors::HIT } else { colors::MISS }
}
