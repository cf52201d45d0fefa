//! Comparison of a dive's tool poses with the truth at each task. The poses are those by the online estimate from the
//! messages before it, by the one calibration at the start, and by the datasheet.

use nalgebra::{Matrix3, Vector3};

use armcal_belief::calib::ParameterCovariance;
use armcal_belief::calib::online::{Follower, OnlineEvent, OnlineSettings};
use armcal_belief::verify::{Belief, ReachRest, reaches};
use armcal_core::kinematics::LinkCorrections;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::stats::quantile;
use armcal_core::streams::{Mark, MarkKind, Message};
use armcal_core::time::Stamp;
use armcal_sim::truth::Truth;

/// Tool errors at one task.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiveTask {
    /// Time since the recording's first reach, s.
    pub at_s: f64,
    /// Number of the target, from 0.
    pub target_idx: usize,
    /// Tool error by the online estimate of that moment, m.
    pub online_m: f64,
    /// Tool error by the one calibration at the start, m.
    pub start_m: f64,
    /// Tool error by the datasheet, m.
    pub datasheet_m: f64,
    /// Tool error that the online estimate predicted, one standard deviation in space, m.
    pub predicted_m: f64,
    /// Squared online error, normalised by the predicted covariance.
    pub nees: f64,
}

/// Result of following a dive.
#[derive(Clone, Debug)]
pub struct DiveStudy {
    /// Tasks in the order of time, from the first online estimate on.
    pub tasks: Vec<DiveTask>,
    /// Events that the online estimate reported.
    pub events: Vec<OnlineEvent>,
    /// Number of views that the online estimate includes.
    pub views: usize,
    /// Estimated walk and lag of the sensors relative to their initial guess, at the end of the dive.
    pub drift_factors: Option<[f64; 2]>,
    /// Lag of the sensors' temperature that explains the views best, s.
    pub lag_s: f64,
}

/// The online estimate at the end of a reach mark.
struct Snapshot {
    from: Stamp,
    sensors: ArmSensors,
    covariance: ParameterCovariance,
    conditions: Conditions,
}

/// The arm as calibrated at the start.
#[derive(Clone, Copy, Debug)]
pub struct AtStart<'a> {
    /// Sensors as calibrated.
    pub sensors: &'a ArmSensors,
    /// Link corrections as calibrated.
    pub links: LinkCorrections,
}

/// Follows a recording and compares it with its truth.
#[must_use]
pub fn dive_study(recording: &Recording, truth: &Truth, robot: &Robot, at_start: AtStart<'_>) -> DiveStudy {
    let mut follower = Follower::new(robot.clone(), OnlineSettings::default());
    let (mut events, mut snapshots) = (Vec::new(), Vec::new());
    for (log_time, message) in &recording.messages {
        events.extend(follower.push(*log_time, message));
        if let Message::Mark(Mark { start, kind: MarkKind::Reach { .. }, .. }) = message {
            snapshots.extend(snapshot(&follower, *start));
        }
    }
    events.extend(follower.finish());
    let online: Vec<Belief<'_>> = snapshots.iter().map(|at| fixed(at.from, &at.sensors)).collect();
    let nominal = ArmSensors::nominal(robot);
    let first = Stamp { nanos: i64::MIN };
    let [by_belief, by_start, by_datasheet] = [
        &online[..],
        &[Belief { from: first, sensors: at_start.sensors, links: at_start.links }],
        &[fixed(first, &nominal)],
    ]
    .map(|b| reaches(recording, robot, b));
    let begins = by_belief.first().map_or(first, |rest| rest.start);
    let rests = by_belief.iter().zip(&by_start).zip(&by_datasheet);
    let tasks = rests.filter_map(|((belief, start), datasheet)| {
        let snapshot = snapshots.iter().find(|snapshot| snapshot.from == belief.start)?;
        let [online, by_start, by_datasheet] = [belief, start, datasheet].map(|rest| off_m(rest, truth));
        let off = online?;
        let predicted = snapshot.tool_m2(robot, belief);
        let nees = predicted.cholesky().map_or(f64::NAN, |factor| off.dot(&factor.solve(&off)));
        Some(DiveTask {
            at_s: belief.start.since_s(begins),
            target_idx: belief.target_idx,
            online_m: off.norm(),
            start_m: by_start?.norm(),
            datasheet_m: by_datasheet?.norm(),
            predicted_m: predicted.trace().max(0.0).sqrt(),
            nees,
        })
    });
    let (views, drift_factors) = (follower.estimator().n_views(), follower.estimator().drift_factors());
    DiveStudy { tasks: tasks.collect(), events, views, drift_factors, lag_s: follower.estimator().temperature_lag_s() }
}

fn snapshot(follower: &Follower, from: Stamp) -> Option<Snapshot> {
    let conditions = *follower.conditions();
    let covariance = follower.estimator().covariance(&conditions)?;
    Some(Snapshot { from, sensors: follower.sensors(), covariance, conditions })
}

fn fixed(from: Stamp, sensors: &ArmSensors) -> Belief<'_> {
    Belief { from, sensors, links: LinkCorrections::default() }
}

impl Snapshot {
    fn tool_m2(&self, robot: &Robot, rest: &ReachRest) -> Matrix3<f64> {
        // The covariance includes the drift since the last view.
        let at = Conditions { stamp: self.sensors.reference.stamp, ..self.conditions };
        self.covariance.tool_position_under_m2(robot, &self.sensors, &rest.believed, &at)
    }
}

fn off_m(rest: &ReachRest, truth: &Truth) -> Option<Vector3<f64>> {
    let state = truth.state_at(rest.start.plus_s(0.5 * rest.end.since_s(rest.start)))?;
    Some(rest.believed_tool.origin().vector() - state.base_from_tool.origin().vector())
}

/// Table by hour of the dive and over the whole dive: median and 95 % error of each estimate, consistency of the online
/// one.
#[must_use]
pub fn dive_table(tasks: &[DiveTask]) -> String {
    use std::fmt::Write as _;
    let mut text = String::from(
        "| hour | tasks | online, mm | 95 % | at the start only | 95 % | datasheet | NEES | error / predicted |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    let hours = tasks.iter().map(|task| hour(task) + 1).max().unwrap_or(0);
    for of_hour in (0..hours).map(Some).chain([None]) {
        let of: Vec<&DiveTask> = tasks.iter().filter(|task| of_hour.is_none_or(|h| hour(task) == h)).collect();
        if of.is_empty() {
            continue;
        }
        let mm = |f: &dyn Fn(&DiveTask) -> f64, q: f64| {
            let all: Vec<f64> = of.iter().map(|task| 1e3 * f(task)).collect();
            quantile(&all, q).unwrap_or(f64::NAN)
        };
        let mean = |f: &dyn Fn(&DiveTask) -> f64| of.iter().map(|task| f(task)).sum::<f64>() / of.len() as f64;
        let ratio = (mean(&|t| t.online_m.powi(2)) / mean(&|t| t.predicted_m.powi(2))).sqrt();
        let name = of_hour.map_or("all".to_owned(), |h| (h + 1).to_string());
        let _ = writeln!(
            text,
            "| {name} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {:.2} | {ratio:.2} |",
            of.len(),
            mm(&|t| t.online_m, 0.5),
            mm(&|t| t.online_m, 0.95),
            mm(&|t| t.start_m, 0.5),
            mm(&|t| t.start_m, 0.95),
            mm(&|t| t.datasheet_m, 0.5),
            mean(&|t| t.nees),
        );
    }
    text
}

fn hour(task: &DiveTask) -> usize {
    (task.at_s / 3600.0) as usize
}

/// CSV with one row per task.
#[must_use]
pub fn dive_csv(rows: &[(u64, DiveTask)]) -> String {
    use std::fmt::Write as _;
    let mut text = "seed,at_s,target,online_m,predicted_m,nees,start_m,datasheet_m\n".to_owned();
    for (seed, task) in rows {
        let DiveTask { at_s, target_idx, online_m, start_m, datasheet_m, predicted_m, nees } = task;
        let _ = writeln!(text, "{seed},{at_s:.1},{target_idx},{online_m},{predicted_m},{nees},{start_m},{datasheet_m}");
    }
    text
}
