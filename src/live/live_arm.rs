//! Real arm as sessions know arms: paced by its own readings, and stopped by the guard.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::guard::{Guard, StopReason};
use crate::tag_check::{TagCheck, check_tags};
use crate::{Connection, Heard, LiveError, Wire};
use armcal_core::codes::{Code, Coded};
use armcal_core::robot::Robot;
use armcal_core::streams::{
    Arm, ArmError, JointCounts, JointSensorSample, LogLevel, LogLine, Message, Sink, TagDetection,
};
use armcal_core::time::Stamp;

/// Longest wait for messages before silence is checked again.
const LISTEN: Duration = Duration::from_millis(5);
/// Share of a period by which the reading that ends a step may be early.
const EARLY_SHARE: f64 = 0.25;
/// Largest motion of an arm at rest before its first set-point, rad.
const REST_RAD: f64 = 0.01;
/// Smallest rate of readings at which an arm can be controlled, Hz.
const MIN_RATE_HZ: f64 = 5.0;
/// Factor on the largest rates of the robot's file, beyond which set-points move no joint: the session plans up to
/// those rates.
const RATE_SLACK: f64 = 1.2;
/// Distance of a set-point from the reading within which a joint is not moved, rad.
const STAY_RAD: f64 = 0.005;
/// Largest number of stored times from reading to set-point; the latest are kept.
const MAX_LATENCIES: usize = 1 << 16;

/// Arm behind a wire. Set-points pass the guard before they are sent, and readings when they arrive.
pub struct LiveArm<W> {
    wire: W,
    guard: Guard,
    joint_names: Vec<String>,
    max_rate_rad_s: Vec<f64>,
    period_s: f64,
    stale: Duration,
    now: Stamp,
    /// Earliest time under which messages are recorded: a message that arrives now was not there when the last call
    /// ended.
    not_before: Stamp,
    /// End of the present control period.
    due: Stamp,
    goal: JointCounts,
    sent: JointCounts,
    sent_at: Stamp,
    has_sent: bool,
    /// True if the present period has its set-point.
    was_commanded: bool,
    /// Time at which the last call ended, by our clock.
    left_at: Duration,
    /// Time at which the newest reading arrived, by our clock.
    heard_at: Duration,
    stopped: Option<StopReason>,
    heard: Vec<Heard>,
    unusable: u64,
    latencies_s: Vec<f64>,
    n_latencies: usize,
}

/// Messages of an arm before anything moved.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Duration of the survey, s.
    pub seconds: f64,
    /// Number of joint readings in it.
    pub readings: usize,
    /// Last joint reading.
    pub counts: JointCounts,
    /// Number of images that were searched for tags.
    pub images: usize,
    /// Number of tags in all images.
    pub tags: usize,
    /// Number of unusable messages, and the fault of the last of them.
    pub unusable: Option<(u64, String)>,
    /// The latest detection of each tag.
    pub detections: BTreeMap<u32, TagDetection>,
    /// Comparison of known tags with the datasheet; `None` if no known tag is in view.
    pub tag_check: Option<TagCheck>,
}

impl Survey {
    fn new() -> Self {
        let (seconds, readings, images, tags) = (0.0, 0, 0, 0);
        let (counts, detections) = (JointCounts::zeros(0), BTreeMap::new());
        Self { seconds, readings, counts, images, tags, unusable: None, detections, tag_check: None }
    }
}

impl<W: Wire> LiveArm<W> {
    /// Listens until readings have been sound and the arm at rest for `guard.ready_s`. Nothing is sent.
    ///
    /// # Errors
    /// [`LiveError::NotReady`] with what is missing.
    pub fn connect(mut wire: W, robot: &Robot, connection: &Connection) -> Result<(Self, Survey), LiveError> {
        let limits = connection.guard;
        let mut guard = Guard::new(robot, limits, connection.deadman.as_ref());
        let mut survey = listen(&mut wire, &mut guard, connection)?;
        let detections: Vec<_> = survey.detections.values().cloned().collect();
        survey.tag_check = check_tags(robot, &survey.counts, &detections)?;
        let now = guard.latest().map_or(Stamp { nanos: 0 }, |sample| sample.stamp);
        let left_at = wire.elapsed();
        let arm = Self {
            wire,
            guard,
            joint_names: robot.joint_names(),
            max_rate_rad_s: robot.sensors.iter().map(|sensor| RATE_SLACK * sensor.max_rate_rad_s).collect(),
            period_s: 1.0 / connection.commands.rate_hz,
            stale: Duration::from_secs_f64(limits.stale_s),
            now,
            not_before: now,
            due: now,
            goal: survey.counts,
            sent: survey.counts,
            sent_at: now,
            has_sent: false,
            was_commanded: false,
            left_at,
            heard_at: left_at,
            stopped: None,
            heard: Vec::new(),
            unusable: 0,
            latencies_s: Vec::new(),
            n_latencies: 0,
        };
        Ok((arm, survey))
    }

    /// Stops the arm for good, in every way that the connection knows. The arm is told to stay at its reading, and no
    /// later set-point is sent.
    pub fn stop(&mut self, why: &str) {
        self.halt(StopReason::Asked(why.to_owned()));
    }

    /// Returns the reason for which the arm was stopped.
    #[must_use]
    pub fn stopped(&self) -> Option<&StopReason> {
        self.stopped.as_ref()
    }

    /// Returns the times from a reading to the set-point that follows from it, s; of the latest set-points, in no
    /// order.
    #[must_use]
    pub fn latencies_s(&self) -> &[f64] {
        &self.latencies_s
    }

    /// Returns the number of unusable messages so far.
    #[must_use]
    pub fn unusable(&self) -> u64 {
        self.unusable
    }

    /// Returns the newest reading.
    pub(crate) fn reading(&self) -> Option<JointCounts> {
        self.guard.latest().map(|sample| sample.counts)
    }

    /// Returns the name of a joint, by its index from the base.
    #[must_use]
    pub fn joint_name(&self, joint: usize) -> String {
        self.joint_names[joint].clone()
    }

    /// Returns the guard, for the geometry of readings.
    pub(crate) fn guard(&self) -> &Guard {
        &self.guard
    }

    fn halt(&mut self, reason: StopReason) -> ArmError {
        if self.stopped.is_none() {
            if let Some(latest) = self.guard.latest() {
                // A joint whose reading is in doubt stays at its last set-point.
                let stay = JointCounts::from_fn(self.sent.len(), |joint| {
                    if self.guard.has_leapt(joint) { self.sent[joint] } else { latest.counts[joint] }
                });
                // Both are tried, even if one fails.
                let _ = self.wire.send(&stay, self.period_s);
            }
            if let Err(error) = self.wire.stop() {
                tracing::error!("the stop could not be sent: {error}");
            }
            self.stopped = Some(reason);
        }
        self.refusal()
    }

    fn refusal(&self) -> ArmError {
        let why = self.stopped.as_ref().map_or_else(String::new, ToString::to_string);
        ArmError::Stopped { why, code: self.stopped.as_ref().map_or(Code::ArmStopped, Coded::code) }
    }

    fn log_time(&self) -> Stamp {
        self.now.max(self.not_before)
    }

    /// Takes the messages that have arrived; waits a little if there are none.
    fn listen(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        let mut heard = std::mem::take(&mut self.heard);
        heard.clear();
        let received = self.wire.receive(LISTEN, &mut heard);
        let at = self.wire.elapsed();
        let taken = heard.drain(..).try_for_each(|heard| self.take(heard, at, sink));
        self.heard = heard;
        received.map_err(|error| ArmError::Connection(Box::new(error)))?;
        taken
    }

    fn take(&mut self, heard: Heard, at: Duration, sink: &mut dyn Sink) -> Result<(), ArmError> {
        match heard {
            Heard::Joints(sample) => match self.guard.hear(&sample, &self.sent, at) {
                Ok(true) => {
                    (self.now, self.heard_at) = (sample.stamp, at);
                    sink.record(self.now, &Message::JointSensors(sample)).map_err(ArmError::Sink)
                }
                // Older than the newest reading.
                Ok(false) => Ok(()),
                Err(reason) => Err(self.halt_saying(reason, sink)),
            },
            Heard::Other(message) => sink.record(self.log_time(), &message).map_err(ArmError::Sink),
            Heard::Deadman(is_held) => {
                self.guard.hear_deadman(is_held.then_some(at));
                Ok(())
            }
            Heard::Unusable(_) => {
                self.unusable += 1;
                Ok(())
            }
        }
    }

    /// Stops the arm and records the reason.
    fn halt_saying(&mut self, reason: StopReason, sink: &mut dyn Sink) -> ArmError {
        let text = format!("the guard stopped the arm: {reason} [{}]", reason.code());
        let error = self.halt(reason);
        let line = LogLine { stamp: self.now, level: LogLevel::Error, name: "guard".to_owned(), text };
        match sink.record(self.log_time(), &Message::Log(line)) {
            Ok(()) => error,
            Err(sink) => ArmError::Sink(sink),
        }
    }

    /// Sends the next set-point on the way to the goal, no faster than the joints may move.
    fn send(&mut self) -> Result<(), ArmError> {
        let elapsed_s = self.now.since_s(self.sent_at).clamp(0.0, self.period_s);
        let Some(latest) = self.guard.latest() else { return Ok(()) };
        let next = JointCounts::from_fn(self.goal.len(), |joint| {
            if self.guard.has_leapt(joint) {
                return self.sent[joint];
            }
            let (goal, read) = (self.goal[joint], latest.counts[joint]);
            let (way, most) =
                (self.guard.way_rad(joint, self.sent[joint], goal), self.max_rate_rad_s[joint] * elapsed_s);
            let stays = self.guard.way_rad(joint, read, goal).abs() <= STAY_RAD;
            if stays || way.abs() <= most {
                goal
            } else {
                self.guard.moved(joint, self.sent[joint], way.signum() * most)
            }
        });
        if let Err(reason) = self.guard.check_deadman(self.wire.elapsed()) {
            return Err(self.halt(reason));
        }
        self.wire.send(&next, self.period_s).map_err(|error| ArmError::Connection(Box::new(error)))?;
        (self.sent, self.sent_at, self.has_sent) = (next, self.now, true);
        let latency_s = self.wire.elapsed().saturating_sub(self.heard_at).as_secs_f64();
        if self.latencies_s.len() < MAX_LATENCIES {
            self.latencies_s.push(latency_s);
        } else {
            self.latencies_s[self.n_latencies % MAX_LATENCIES] = latency_s;
        }
        self.n_latencies += 1;
        Ok(())
    }
}

/// Listens to the arm before anything moves.
fn listen(wire: &mut impl Wire, guard: &mut Guard, connection: &Connection) -> Result<Survey, LiveError> {
    let limits = connection.guard;
    let (start, mut heard) = (wire.elapsed(), Vec::new());
    let mut first: Option<(JointSensorSample, Duration)> = None;
    let mut survey = Survey::new();
    loop {
        heard.clear();
        wire.receive(LISTEN, &mut heard)?;
        let now = wire.elapsed();
        for heard in heard.drain(..) {
            match heard {
                Heard::Joints(sample) => {
                    let (anchor, _) = first.get_or_insert_with(|| (sample.clone(), now));
                    let is_new = guard.hear(&sample, &anchor.counts, now).map_err(not_ready)?;
                    let moved = |j: usize| guard.way_rad(j, anchor.counts[j], sample.counts[j]).abs();
                    if (0..sample.counts.len()).any(|j| moved(j) > REST_RAD) {
                        // The arm moves: wait for rest from here on.
                        first = Some((sample.clone(), now));
                        guard.forget_leaps();
                        survey.readings = 0;
                        survey.detections.clear();
                    }
                    survey.readings += usize::from(is_new);
                    survey.counts = sample.counts;
                }
                Heard::Other(Message::Detections(detections)) => {
                    survey.images += 1;
                    survey.tags += detections.tags.len();
                    survey.detections.extend(detections.tags.into_iter().map(|tag| (tag.id, tag)));
                }
                Heard::Other(_) => {}
                Heard::Deadman(is_held) => guard.hear_deadman(is_held.then_some(now)),
                Heard::Unusable(why) => survey.unusable = Some((survey.unusable.map_or(0, |(n, _)| n) + 1, why)),
            }
        }
        guard.check_silence(now).or_else(|reason| match reason {
            // Nothing moves yet: the switch is needed only from the first set-point on.
            StopReason::Deadman { .. } => Ok(()),
            reason => Err(not_ready(reason)),
        })?;
        let waited_s = (now - start).as_secs_f64();
        match &first {
            Some((anchor, since)) if (now - *since).as_secs_f64() >= limits.ready_s => {
                survey.seconds = (now - *since).as_secs_f64();
                let arm_s = guard.latest().map_or(0.0, |latest| latest.stamp.since_s(anchor.stamp));
                guard.learn_pace(arm_s, survey.seconds);
                break;
            }
            None if waited_s > limits.connect_s => return Err(nothing_heard(connection, &survey)),
            Some(_) if waited_s > limits.connect_s + limits.ready_s => {
                return Err(LiveError::NotReady("it moves; calibration begins at rest".to_owned()));
            }
            _ => {}
        }
    }
    check_rate(&survey)?;
    guard.check_set_point(&survey.counts).map_err(|reason| {
        LiveError::NotReady(format!("where it stands by its readings: {reason}; is this robot.toml the arm's?"))
    })?;
    Ok(survey)
}

fn check_rate(survey: &Survey) -> Result<(), LiveError> {
    let (n, seconds) = (survey.readings, survey.seconds);
    if n as f64 >= MIN_RATE_HZ * seconds {
        return Ok(());
    }
    let problem = format!("{n} joint readings in {seconds:.1} s; at least {MIN_RATE_HZ} a second are needed");
    Err(LiveError::NotReady(problem))
}

fn not_ready(reason: StopReason) -> LiveError {
    LiveError::NotReady(reason.to_string())
}

fn nothing_heard(connection: &Connection, survey: &Survey) -> LiveError {
    let (topic, seconds) = (&connection.joint_sensors, connection.guard.connect_s);
    let unusable = survey.unusable.as_ref().map(|(n, why)| format!("; {n} messages were of no use, the last: {why}"));
    let place = match &connection.rosbridge {
        Some(bridge) => format!("and its topics known to the rosbridge at {}?", bridge.url),
        None => format!("in ROS domain {}, and `networks` right?", connection.domain),
    };
    LiveError::NotReady(format!(
        "no joint readings on {topic} in {seconds} s{}; is the driver running {place}",
        unusable.unwrap_or_default()
    ))
}

impl<W: Wire> Arm for LiveArm<W> {
    fn now(&self) -> Stamp {
        self.now
    }

    fn period_s(&self) -> f64 {
        self.period_s
    }

    fn command(&mut self, set_point: &JointCounts) -> Result<(), ArmError> {
        if self.stopped.is_some() {
            return Err(self.refusal());
        }
        let expected = self.joint_names.len();
        if set_point.len() != expected {
            return Err(ArmError::JointCount { got: set_point.len(), expected });
        }
        if let Some((joint, &counts)) = set_point.iter().enumerate().find(|(_, counts)| !counts.is_finite()) {
            return Err(ArmError::SetPoint { joint, counts });
        }
        if let Err(reason) = self.guard.check_set_point(set_point) {
            return Err(self.halt(reason));
        }
        (self.goal, self.was_commanded) = (*set_point, true);
        self.send()
    }

    fn step(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        if self.stopped.is_some() {
            return Err(self.refusal());
        }
        // Stamps of the next reading are later by far more.
        self.not_before = Stamp { nanos: self.now.nanos.saturating_add(1) };
        let before = self.wire.elapsed();
        if before.saturating_sub(self.left_at) > self.stale {
            self.guard.resume(before);
        }
        self.due = self.due.plus_s(self.period_s);
        if (self.due.since_s(self.now) - self.period_s).abs() > self.period_s {
            self.due = self.now.plus_s(self.period_s);
        }
        let until = self.due.plus_s(-EARLY_SHARE * self.period_s);
        loop {
            self.listen(sink)?;
            if self.now >= until {
                break;
            }
            if let Err(reason) = self.guard.check_silence(self.wire.elapsed()) {
                return Err(self.halt_saying(reason, sink));
            }
        }
        if let Err(reason) = self.guard.check_deadman(self.wire.elapsed())
            && self.has_sent
        {
            return Err(self.halt_saying(reason, sink));
        }
        // A set-point that was not renewed is sent again: it may still be on its way, and drivers expect messages.
        if self.has_sent && !std::mem::take(&mut self.was_commanded) {
            self.send()?;
        }
        self.left_at = self.wire.elapsed();
        Ok(())
    }
}
