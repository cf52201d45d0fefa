//! Faults at unknown times in a dive: the time until the online estimate names them, against an oracle. The oracle
//! knows which faults are possible and when. It shows how well the views can determine a fault, and which explanations
//! they cannot distinguish.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use rand::{Rng, RngExt};

use armcal_belief::calib::View;
use armcal_belief::calib::online::{
    Fault, Follower, OnlineEvent, OnlineSettings, Oracle, OracleGain, TagSet, ViewStream,
};
use armcal_belief::model::WornSpot;
use armcal_belief::say::FindingKind;
use armcal_core::log::Recording;
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::stats::{chi_square_above, stream_rng};
use armcal_core::streams::{Mark, MarkKind, Message, Thermometer};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

/// Chance of error below which the oracle is sure: that of a normal variable beyond five sigma on either side.
const FIVE_SIGMA: f64 = 5.733e-7;
/// Largest log-probability difference, nats, at which the oracle cannot distinguish explanations (odds of 20).
const ALIKE_NATS: f64 = 3.0;
/// Views after the oracle's within which naming a fault counts as in time.
const IN_TIME: usize = 3;
/// Number of views that the oracle continues for after it is sure; later reports are too late.
const ORACLE_GOES_ON: usize = 8;
/// Earliest and latest time of a fault, s: after the first tasks, before the last ones.
const BETWEEN_S: [f64; 2] = [900.0, 2700.0];
const DEG: f64 = std::f64::consts::PI / 180.0;

/// Kind of a fault on a dive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DiveFaultKind {
    /// A sensor slips by 0.5 to 1.5 deg.
    Slipped,
    /// A sensor keeps its current word.
    Stuck,
    /// A sensor's wire breaks.
    Dead,
    /// A sensor's sense reverses.
    Reversed,
    /// A wiper loses contact more and more often.
    Dying,
    /// A spot of a sensor's track wears where the arm looks at tags: by 0.5 to 1.5 deg, 1.5 to 4 deg wide.
    Worn,
    /// A tag is knocked aside by 10 to 40 mm.
    Tag,
    /// Every other tag is knocked aside: those tags are on one boom.
    Boom,
    /// The camera turns on its mount by 0.5 to 2 deg, about any axis.
    Camera,
}

impl DiveFaultKind {
    /// All kinds of faults.
    pub const ALL: [Self; 9] = [
        Self::Slipped,
        Self::Stuck,
        Self::Dead,
        Self::Reversed,
        Self::Dying,
        Self::Worn,
        Self::Tag,
        Self::Boom,
        Self::Camera,
    ];

    /// Name of the kind in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Slipped => "sensor slipped",
            Self::Stuck => "sensor stuck",
            Self::Dead => "sensor dead",
            Self::Reversed => "sensor reversed",
            Self::Dying => "sensor dying",
            Self::Worn => "sensor worn",
            Self::Tag => "tag moved",
            Self::Boom => "boom of tags moved",
            Self::Camera => "camera slipped",
        }
    }
}

/// One fault of a dive.
#[derive(Clone, Debug, PartialEq)]
pub struct DiveFault {
    /// Kind of the fault.
    pub kind: DiveFaultKind,
    /// Seed of the fault's draw and of the run.
    pub seed: u64,
    /// Time of the fault after the start, s.
    pub at_s: f64,
    /// The joint that the fault is at.
    joint: usize,
    /// Worn spot of the track, for a worn sensor.
    spot: Option<WornSpot>,
    /// Indices of the moved tags.
    tags: Vec<usize>,
    /// Size of the fault, rad or m, for kinds that have one.
    pub size: Option<f64>,
    /// The value of `world.fault` for `--set`.
    pub setting: String,
}

/// Draws the fault of one kind and seed for `robot`, which looks at tags from the configurations `looks`, rad, base
/// first. The same arguments give the same fault.
#[must_use]
pub fn drawn_dive_fault(kind: DiveFaultKind, seed: u64, robot: &Robot, looks: &[Vec<f64>]) -> DiveFault {
    use DiveFaultKind as K;
    let mut rng = stream_rng(seed, kind.name());
    let at_s = rng.random_range(BETWEEN_S[0]..BETWEEN_S[1]).round();
    let joint = rng.random_range(0..robot.n_joints());
    let name = &robot.sensors[joint].joint;
    let first = rng.random_range(0..robot.tags.len());
    let tags: Vec<usize> = match kind {
        K::Tag => vec![first],
        K::Boom => (first % 2..robot.tags.len()).step_by(2).collect(),
        _ => Vec::new(),
    };
    let sign = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let direction = direction(&mut rng);
    let along = |size: f64| direction.map(|of| of * size);
    let mut spot = None;
    let plain = |kind: &str| format!("{{at_s={at_s:?}, kind=\"{kind}\", joint=\"{name}\"}}");
    let (size, setting) = match kind {
        K::Slipped => {
            let by_rad = sign * rng.random_range(0.5..1.5) * DEG;
            let text = format!("{{at_s={at_s:?}, kind=\"sensor_jump\", joint=\"{name}\", by_rad={by_rad:?}}}");
            (Some(by_rad), text)
        }
        K::Stuck => (None, plain("sensor_stuck")),
        K::Dead => (None, plain("sensor_dead")),
        K::Reversed => (None, plain("sensor_reversed")),
        K::Dying => {
            let text = format!("{{at_s={at_s:?}, kind=\"sensor_dying\", joint=\"{name}\", dropout_per_s=5.0}}");
            (None, text)
        }
        K::Worn => {
            let Wear { joint, at_rad, by_rad, width_rad } = drawn_wear(&mut rng, robot, looks);
            spot = Some((joint, WornSpot::about(at_rad - robot.sensors[joint].center_rad)));
            let (name, by_rad) = (&robot.sensors[joint].joint, sign * by_rad);
            let text = format!(
                "{{at_s={at_s:?}, kind=\"sensor_worn\", joint=\"{name}\", at_rad={at_rad:?}, by_rad={by_rad:?}, \
                 width_rad={width_rad:?}}}"
            );
            (Some(by_rad), text)
        }
        K::Tag | K::Boom => {
            let by_m = rng.random_range(0.01..0.04);
            // The tag moves off the plate that carries it: behind the plate's face no camera sees it.
            let [x, y, z] = along(by_m);
            let by = [x, y, z.abs()];
            let moved = |tag: &usize| {
                let id = robot.tags[*tag].id;
                format!("{{at_s={at_s:?}, kind=\"tag_moved\", id={id}, by_m={by:?}}}")
            };
            (Some(by_m), tags.iter().map(moved).collect::<Vec<_>>().join(", "))
        }
        K::Camera => {
            let by_rad = rng.random_range(0.5..2.0) * DEG;
            (Some(by_rad), format!("{{at_s={at_s:?}, kind=\"camera_slipped\", by_rad={:?}}}", along(by_rad)))
        }
    };
    let (joint, spot) = spot.map_or((joint, None), |(joint, spot)| (joint, Some(spot)));
    DiveFault { kind, seed, at_s, joint, spot, tags, size, setting: format!("[{setting}]") }
}

/// A drawn worn spot, its height without a sign.
struct Wear {
    joint: usize,
    at_rad: f64,
    by_rad: f64,
    width_rad: f64,
}

/// Draws a worn spot near the joint's angle in one of the looks at tags: no view constrains it elsewhere.
fn drawn_wear(rng: &mut impl Rng, robot: &Robot, looks: &[Vec<f64>]) -> Wear {
    let joint = rng.random_range(0..robot.n_seen_joints());
    let look = looks.get(rng.random_range(0..looks.len().max(1))).and_then(|look| look.get(joint));
    let width_rad = rng.random_range(1.5..4.0) * DEG;
    let by_rad = rng.random_range(0.5..1.5) * DEG;
    let at_rad = look.copied().unwrap_or(robot.stowed[joint]) + rng.random_range(-0.5..0.5) * width_rad;
    Wear { joint, at_rad, by_rad, width_rad }
}

/// Draws a direction, uniform over the sphere.
fn direction(rng: &mut impl Rng) -> [f64; 3] {
    let (up, around) = (rng.random_range(-1.0..1.0_f64), rng.random_range(0.0..TAU));
    let across = (1.0 - up * up).sqrt();
    [across * around.cos(), across * around.sin(), up]
}

impl DiveFault {
    fn explanation(&self) -> Vec<Fault> {
        use DiveFaultKind as K;
        match self.kind {
            K::Slipped => vec![Fault::Slip(self.joint)],
            K::Stuck | K::Dead | K::Dying => vec![Fault::Failed(self.joint)],
            K::Reversed => vec![Fault::Scale(self.joint)],
            K::Worn => self.spot.map(|spot| Fault::Worn(self.joint, spot)).into_iter().collect(),
            K::Tag | K::Boom => self.tags.iter().map(|tag| Fault::Tag(*tag)).collect(),
            K::Camera => vec![Fault::Mount],
        }
    }

    /// True if the named fault is this fault.
    fn is(&self, named: Fault) -> bool {
        use DiveFaultKind as K;
        match (self.kind, named) {
            (K::Slipped, Fault::Slip(joint)) => joint == self.joint,
            (K::Worn, Fault::Worn(joint, at)) => {
                joint == self.joint && self.spot.is_some_and(|spot| !spot.is_far_from(at.at_rad()))
            }
            // A sensor with a constant reading has a slope of zero.
            (K::Stuck | K::Dead | K::Dying | K::Reversed, Fault::Failed(joint) | Fault::Scale(joint)) => {
                joint == self.joint
            }
            (K::Tag | K::Boom, Fault::Tag(tag)) => self.tags.contains(&tag),
            (K::Boom, Fault::Tags(tags)) => tags.iter().all(|tag| self.tags.contains(&tag)),
            (K::Camera, Fault::Mount) => true,
            _ => false,
        }
    }
}

/// A reported fault, with the number of views until then.
#[derive(Clone, Debug, PartialEq)]
struct Told {
    fault: Fault,
    n_views: usize,
    line: String,
    nats: Option<f64>,
    nats_of_truth: f64,
}

/// Result of following a dive with a fault.
#[derive(Clone, Debug, PartialEq)]
pub struct DiveFaultRow {
    /// The fault of the dive.
    pub fault: DiveFault,
    /// Views after the fault until an oracle is sure that knows its kind, time and place (joint or tag, and spot).
    /// `None`: the views never determine it.
    pub oracle_views: Option<usize>,
    /// Views after the fault until an oracle is sure that knows only kind and time. It must exclude chance for every
    /// joint, tag or place.
    pub kind_oracle_views: Option<usize>,
    /// Views after the fault until it was named; `None` if it never was.
    pub named_views: Option<usize>,
    /// Later reports that are neither the fault nor an explanation that the views cannot distinguish from it.
    pub wrong: Vec<String>,
    /// Later reports that are not the fault but that the views cannot distinguish from it.
    pub alike: Vec<String>,
    /// Reports before the fault.
    pub false_alarms: Vec<String>,
}

impl DiveFaultRow {
    /// True if the fault was named within three views after the oracle that knows its place; `None` where the views do
    /// not determine it.
    #[must_use]
    pub fn is_in_time(&self) -> Option<bool> {
        self.oracle_views.map(|sure| self.is_named_soon_after(sure))
    }

    /// True if the fault was named within three views after the oracle that knows only kind and time; `None` as for
    /// `is_in_time`.
    #[must_use]
    pub fn is_in_time_by_kind(&self) -> Option<bool> {
        self.kind_oracle_views.map(|sure| self.is_named_soon_after(sure))
    }

    fn is_named_soon_after(&self, sure: usize) -> bool {
        self.named_views.is_some_and(|named| named <= sure + IN_TIME)
    }
}

/// State of following one run.
struct Followed<'a> {
    fault: &'a DiveFault,
    follower: Follower,
    stream: ViewStream,
    oracle: Option<Oracle>,
    explanations: Vec<Vec<Fault>>,
    n_views: usize,
    oracle_views: Option<usize>,
    kind_oracle_views: Option<usize>,
    /// Places of each joint in the views since the fault, far from each other.
    places: Vec<Vec<WornSpot>>,
    told: Vec<Told>,
    false_alarms: Vec<String>,
}

/// Follows the recording of a dive on which `fault` happened.
#[must_use]
pub fn dive_fault_study(recording: &Recording, robot: &Robot, fault: &DiveFault) -> DiveFaultRow {
    let mut followed = Followed::new(robot, fault);
    for (log_time, message) in &recording.messages {
        followed.push(*log_time, message);
    }
    let last = followed.follower.finish();
    followed.hear(last);
    followed.row()
}

impl<'a> Followed<'a> {
    fn new(robot: &Robot, fault: &'a DiveFault) -> Self {
        let follower = Follower::new(robot.clone(), OnlineSettings::default());
        let stream = ViewStream::new(robot.clone());
        Self {
            fault,
            follower,
            stream,
            oracle: None,
            explanations: Vec::new(),
            n_views: 0,
            oracle_views: None,
            kind_oracle_views: None,
            places: vec![Vec::new(); robot.n_joints()],
            told: Vec::new(),
            false_alarms: Vec::new(),
        }
    }

    fn push(&mut self, log_time: Stamp, message: &Message) {
        for view in self.stream.push(log_time, message) {
            self.see(&view);
        }
        match (message, &mut self.oracle) {
            (Message::Temperature(sample), Some(oracle)) if sample.thermometer == Thermometer::Oil => {
                oracle.hear_temperature(sample.stamp, sample.temperature_c);
            }
            (Message::Survey(_), None) if self.follower.estimator().n_views() == 0 => {
                // The follower takes the recorded survey, so the oracle's stream of views does too.
                self.follower.push(log_time, message);
                self.stream = ViewStream::new(self.follower.estimator().robot().clone());
                return;
            }
            (
                Message::Mark(Mark {
                    kind: MarkKind::Failed(FailedJoint { joint, kind: FailedKind::Locked }),
                    end,
                    ..
                }),
                _,
            ) => {
                let name = &self.follower.estimator().robot().sensors[*joint].joint;
                let line = format!("{name} was given up");
                self.tell(Fault::Failed(*joint), *end, line);
            }
            _ => {}
        }
        let events = self.follower.push(log_time, message);
        self.hear(events);
    }

    /// Takes a view. The oracle takes it first, so that it begins with the estimate before the view.
    fn see(&mut self, view: &View) {
        let robot = self.follower.estimator().robot();
        let is_blind = view.tags.iter().all(|seen| !robot.tags[seen.tag_idx].is_known());
        if view.end.since_s(SIMULATION_EPOCH) < self.fault.at_s || is_blind {
            return;
        }
        if self.oracle.is_none() {
            self.explanations = explanations(robot, self.fault);
            self.oracle = self.follower.estimator().oracle(&self.explanations);
        }
        let Some(oracle) = &mut self.oracle else { return };
        self.n_views += 1;
        if self.kind_oracle_views.is_some_and(|sure| self.n_views > sure + ORACLE_GOES_ON) {
            return;
        }
        oracle.add_view(view);
        let Some(gain) = oracle.gains().first().copied() else { return };
        self.stand_at(view);
        let is_sure_of_kind = is_sure(&gain, self.n_candidates());
        if self.oracle_views.is_none() && is_sure(&gain, 1) {
            self.oracle_views = Some(self.n_views);
        }
        if self.kind_oracle_views.is_none() && is_sure_of_kind {
            self.kind_oracle_views = Some(self.n_views);
        }
    }

    fn stand_at(&mut self, view: &View) {
        for (joint, places) in self.places.iter_mut().enumerate() {
            let at_rad = view.travel_rad[joint];
            if places.iter().all(|place| place.is_far_from(at_rad)) {
                places.push(WornSpot::about(at_rad));
            }
        }
    }

    /// Number of candidates for a fault of this kind that the views since then could name: joints, tags, or places of
    /// joints.
    fn n_candidates(&self) -> usize {
        use DiveFaultKind as K;
        let robot = self.follower.estimator().robot();
        let seen_joints = robot.n_seen_joints();
        match self.fault.kind {
            K::Slipped | K::Stuck | K::Dead | K::Dying | K::Reversed => seen_joints,
            K::Worn => self.places[..seen_joints].iter().map(Vec::len).sum(),
            K::Tag => robot.tags.len(),
            // The boom carries either the even or the odd tags.
            K::Boom => 2,
            K::Camera => 1,
        }
    }

    fn hear(&mut self, events: Vec<OnlineEvent>) {
        for event in events {
            let line = event.to_line();
            let robot = self.follower.estimator().robot();
            if let Some(fault) = fault_of(robot, &event) {
                self.tell(fault, Stamp { nanos: event.decided_nanos }, line);
            }
        }
    }

    fn tell(&mut self, fault: Fault, at: Stamp, line: String) {
        if at.since_s(SIMULATION_EPOCH) < self.fault.at_s {
            self.false_alarms.push(line);
            return;
        }
        let gains = self.oracle.as_ref().map(Oracle::gains).unwrap_or_default();
        let place = self.explanations.iter().position(|of| of[..] == [fault]);
        self.told.push(Told {
            fault,
            n_views: self.n_views,
            line,
            nats: place.and_then(|place| gains.get(place)).map(|gain| gain.nats),
            nats_of_truth: gains.first().map_or(f64::NAN, |gain| gain.nats),
        });
    }

    fn row(self) -> DiveFaultRow {
        let is_alike = |told: &Told| told.nats.is_some_and(|nats| nats > told.nats_of_truth - ALIKE_NATS);
        let is_right = |told: &&Told| self.fault.is(told.fault);
        let named = self.told.iter().find(|told| self.fault.is(told.fault) || is_alike(told));
        let others = || self.told.iter().filter(|told| !is_right(told));
        let lines = |of: Vec<&Told>| of.into_iter().map(|told| told.line.clone()).collect();
        DiveFaultRow {
            fault: self.fault.clone(),
            oracle_views: self.oracle_views,
            kind_oracle_views: self.kind_oracle_views,
            named_views: named.map(|told| told.n_views),
            wrong: lines(others().filter(|told| !is_alike(told)).collect()),
            alike: lines(others().filter(|told| is_alike(told)).collect()),
            false_alarms: self.false_alarms,
        }
    }
}

/// True if the oracle excludes chance: a sum of squares of 25.0 for one number, 39.5 for six. Each of the
/// `n_candidates` may fit by chance (Bonferroni's bound): 28.5 for one number of six joints.
fn is_sure(gain: &OracleGain, n_candidates: usize) -> bool {
    chi_square_above(gain.chi2, gain.numbers) * (n_candidates as f64) < FIVE_SIGMA
}

/// Explanations: first the true one, then all single faults.
fn explanations(robot: &Robot, fault: &DiveFault) -> Vec<Vec<Fault>> {
    let joints = (0..robot.n_joints()).flat_map(|j| [Fault::Slip(j), Fault::Scale(j), Fault::Failed(j)]);
    let tags = (0..robot.tags.len()).map(Fault::Tag);
    let others = joints.chain(tags).chain([Fault::Mount, Fault::Base]).map(|fault| vec![fault]);
    std::iter::once(fault.explanation()).chain(others).collect()
}

/// The tags that a finding names: `1, 3 and 5`.
fn tags_of(robot: &Robot, names: &str) -> Option<TagSet> {
    let mut tags: Option<TagSet> = None;
    for name in names.split(", ").flat_map(|part| part.split(" and ")) {
        let tag = robot.tags.iter().position(|tag| tag.id.to_string() == name)?;
        tags = tags.map_or_else(|| TagSet::of(tag), |tags| tags.with(tag));
    }
    tags
}

fn fault_of(robot: &Robot, event: &OnlineEvent) -> Option<Fault> {
    let name = &event.finding.name;
    let joint = || robot.sensors.iter().position(|sensor| sensor.joint == *name);
    let tag = || robot.tags.iter().position(|tag| tag.id.to_string() == *name);
    match event.finding.kind {
        FindingKind::SensorSlip => joint().map(Fault::Slip),
        FindingKind::SensorScale | FindingKind::SensorReversed => joint().map(Fault::Scale),
        FindingKind::SensorFailed => joint().map(Fault::Failed),
        FindingKind::SensorWorn => joint()
            .zip(event.at_rad)
            .map(|(joint, at_rad)| Fault::Worn(joint, WornSpot::about(at_rad - robot.sensors[joint].center_rad))),
        FindingKind::TagMoved => tag().map(Fault::Tag),
        FindingKind::TagsMoved => tags_of(robot, name).map(Fault::Tags),
        FindingKind::CameraMount => Some(Fault::Mount),
        FindingKind::Base => Some(Fault::Base),
        _ => None,
    }
}

/// Table with one line per kind, and the wrong reports.
#[must_use]
pub fn dive_faults_table(rows: &[DiveFaultRow]) -> String {
    let mut text = String::from(
        "| fault | runs | told | in time | late | not named | told by kind | in time | wrong names | false alarms |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for kind in DiveFaultKind::ALL.map(Some).into_iter().chain([None]) {
        let of: Vec<&DiveFaultRow> = rows.iter().filter(|row| kind.is_none_or(|kind| row.fault.kind == kind)).collect();
        if of.is_empty() {
            continue;
        }
        let count = |is: &dyn Fn(&DiveFaultRow) -> bool| of.iter().filter(|row| is(row)).count();
        let in_time = count(&|row| row.is_in_time() == Some(true));
        let late = count(&|row| row.is_in_time() == Some(false) && row.named_views.is_some());
        let never = count(&|row| row.oracle_views.is_some() && row.named_views.is_none());
        let by_kind = count(&|row| row.kind_oracle_views.is_some());
        let in_time_by_kind = count(&|row| row.is_in_time_by_kind() == Some(true));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {in_time} | {late} | {never} | {by_kind} | {in_time_by_kind} | {} | {} |",
            kind.map_or("all", DiveFaultKind::name),
            of.len(),
            count(&|row| row.oracle_views.is_some()),
            count(&|row| !row.wrong.is_empty()),
            count(&|row| !row.false_alarms.is_empty()),
        );
    }
    text += "\nTold: the views tell it to an oracle that knows kind, time, joint or tag, and place (five sigma). By \
             kind: to one that knows kind and time alone. In time: within three views after it; late and not named: \
             after the first. Runs with wrong names: something was named that is not what happened, though the views \
             tell them apart; with false alarms: something before anything happened.\n";
    text
}

/// CSV with one row per run.
#[must_use]
pub fn dive_faults_csv(rows: &[DiveFaultRow]) -> String {
    let quoted = |lines: &[String]| format!("\"{}\"", lines.join("; ").replace('"', "'"));
    let number = |n: Option<usize>| n.map(|n| n.to_string()).unwrap_or_default();
    let mut text =
        "fault,seed,at_s,size,setting,oracle_views,kind_oracle_views,named_views,wrong,alike,false_alarms\n".to_owned();
    for row in rows {
        let DiveFault { kind, seed, at_s, size, setting, .. } = &row.fault;
        let _ = writeln!(
            text,
            "{},{seed},{at_s},{},{},{},{},{},{},{},{}",
            kind.name(),
            size.map(|size| size.to_string()).unwrap_or_default(),
            quoted(std::slice::from_ref(setting)),
            number(row.oracle_views),
            number(row.kind_oracle_views),
            number(row.named_views),
            quoted(&row.wrong),
            quoted(&row.alike),
            quoted(&row.false_alarms),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same seed draws the same fault; each fault names its place, and the oracle gets the same fault.
    #[test]
    fn faults_are_drawn_with_what_explains_them() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let robot = armcal_core::robot::load(&folder).expect("the robot reads");
        for kind in DiveFaultKind::ALL {
            for seed in 0..20 {
                let looks = [vec![-1.0; 6], vec![-1.5; 6]];
                let fault = drawn_dive_fault(kind, seed, &robot, &looks);
                assert_eq!(fault, drawn_dive_fault(kind, seed, &robot, &looks));
                assert!((BETWEEN_S[0]..=BETWEEN_S[1]).contains(&fault.at_s), "{fault:?}");
                let about = fault.explanation();
                assert!(!about.is_empty() && about.iter().all(|one| fault.is(*one)), "{fault:?}");
                assert!(!fault.is(Fault::Base) && !fault.is(Fault::Drift), "{fault:?}");
                let joint = &robot.sensors[fault.joint].joint;
                let names = |text: &str| fault.setting.contains(text);
                match kind {
                    DiveFaultKind::Tag | DiveFaultKind::Boom | DiveFaultKind::Camera => assert!(!names("joint")),
                    _ => assert!(names(joint), "{fault:?}"),
                }
                fault.tags.iter().for_each(|tag| assert!(names(&format!("id={}", robot.tags[*tag].id))));
            }
        }
    }

    #[test]
    fn five_sigma_are_more_of_the_sum_of_squares_where_more_numbers_are_fitted() {
        for (numbers, chi2) in [(1, 25.0), (2, 28.7437), (6, 39.4914), (24, 73.7974)] {
            let gain = |chi2: f64| OracleGain { chi2, numbers, nats: 0.0 };
            assert!(is_sure(&gain(chi2 + 0.01), 1) && !is_sure(&gain(chi2 - 0.01), 1), "{numbers}");
        }
        let of_six_joints = |chi2: f64| is_sure(&OracleGain { chi2, numbers: 1, nats: 0.0 }, 6);
        assert!(of_six_joints(28.6) && !of_six_joints(28.4));
    }
}
