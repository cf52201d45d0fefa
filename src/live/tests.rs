//! The guard against an arm in memory, with a clock that the test turns: each fault with the time it takes to stop.

mod discover;
mod guard;
mod nudge;
mod rosbridge;
mod search;
mod tag_check;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use crate::{Connection, Deadman, Heard, LiveArm, LiveError, Wire};
use armcal_core::robot::{Robot, load};
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{
    Arm, ArmError, JointCounts, JointSensorSample, Message, Sink, SinkError, TemperatureSample, Thermometer,
};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};
use rand_distr::{Distribution, Uniform};

const PERIOD_S: f64 = 0.02;
/// Longest time from the limit of a stop to the stop: one period, and the guard's own turn.
const REACTION_S: f64 = PERIOD_S + 0.005;

/// Fault of the arm or its connection, from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    None,
    Killed,
    Lost {
        share: f64,
    },
    Delayed {
        by_s: f64,
    },
    ClockLeaps {
        by_s: f64,
    },
    Frozen,
    Spike {
        counts: f64,
    },
    /// Jump of the first joint's reading, which stays.
    Jump {
        counts: f64,
    },
    /// Zeros in the first readings of all joints.
    BeginsWithZeros,
    Disobeys,
    LetGo,
    NotHeld,
}

/// Commands that the arm itself received.
#[derive(Default)]
struct Log {
    /// Time and set-point.
    set_points: Vec<(f64, JointCounts)>,
    stops_s: Vec<f64>,
}

/// An arm whose sensors are the datasheet's.
struct FakeWire {
    now_s: f64,
    next_s: f64,
    counts: JointCounts,
    set_point: JointCounts,
    rate_counts: Vec<f64>,
    fault: Fault,
    fault_s: f64,
    under_way: VecDeque<(f64, Heard)>,
    rng: rand_chacha::ChaCha8Rng,
    log: Rc<RefCell<Log>>,
}

impl FakeWire {
    fn is_faulty(&self) -> bool {
        self.now_s >= self.fault_s
    }

    /// Simulates one period of the arm.
    fn tick(&mut self) {
        let (is_faulty, at_s) = (self.is_faulty(), self.next_s);
        self.next_s += PERIOD_S;
        let moves = !(is_faulty && self.fault == Fault::Disobeys);
        for joint in 0..self.counts.len() {
            let way =
                (self.set_point[joint] - self.counts[joint]).clamp(-self.rate_counts[joint], self.rate_counts[joint]);
            if moves && self.log.borrow().stops_s.is_empty() {
                self.counts[joint] += way;
            }
        }
        if is_faulty && matches!(self.fault, Fault::Killed) {
            return;
        }
        let mut stamp = SIMULATION_EPOCH.plus_s(at_s);
        // A count of noise: no sensor of a moving arm repeats itself.
        let mut counts =
            JointCounts::from_fn(self.counts.len(), |j| self.counts[j] + f64::from((at_s / PERIOD_S) as u32 % 2));
        let mut delay_s = 0.0;
        match self.fault {
            Fault::Lost { share } if is_faulty && Uniform::new(0.0, 1.0).unwrap().sample(&mut self.rng) < share => {
                return;
            }
            Fault::Delayed { by_s } if is_faulty => delay_s = by_s,
            Fault::ClockLeaps { by_s } if is_faulty => stamp = stamp.plus_s(by_s),
            Fault::Frozen if is_faulty => counts = JointCounts::from_fn(counts.len(), |j| self.set_point_then(j)),
            Fault::Spike { counts: by } if is_faulty && at_s < self.fault_s + 1.5 * PERIOD_S => counts[0] += by,
            Fault::Jump { counts: by } if is_faulty => counts[0] += by,
            Fault::BeginsWithZeros if at_s < 3.5 * PERIOD_S => counts = JointCounts::zeros(counts.len()),
            _ => {}
        }
        self.under_way.push_back((at_s + delay_s, Heard::Joints(JointSensorSample { stamp, counts })));
        // The temperature has the reading's stamp and arrives a little later.
        let oil = TemperatureSample { stamp, thermometer: Thermometer::Oil, temperature_c: 10.0, variance_c2: 0.0 };
        self.under_way.push_back((at_s + delay_s + 0.001, Heard::Other(Message::Temperature(oil))));
        if self.fault != Fault::NotHeld {
            self.under_way.push_back((at_s, Heard::Deadman(!(is_faulty && self.fault == Fault::LetGo))));
        }
    }

    fn set_point_then(&self, joint: usize) -> f64 {
        let log = self.log.borrow();
        let before = log.set_points.iter().take_while(|(at_s, _)| *at_s <= self.fault_s).last();
        before.map_or(self.counts[joint], |(_, counts)| counts[joint])
    }
}

impl Wire for FakeWire {
    fn elapsed(&self) -> Duration {
        Duration::from_secs_f64(self.now_s)
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        self.now_s += timeout.as_secs_f64();
        while self.next_s <= self.now_s {
            self.tick();
        }
        let now_s = self.now_s;
        let (come, later): (VecDeque<_>, VecDeque<_>) =
            self.under_way.drain(..).partition(|(arrives_s, _)| *arrives_s <= now_s);
        self.under_way = later;
        heard.extend(come.into_iter().map(|(_, heard)| heard));
        Ok(())
    }

    fn send(&mut self, set_point: &JointCounts, _: f64) -> Result<(), LiveError> {
        self.set_point = *set_point;
        self.log.borrow_mut().set_points.push((self.now_s, *set_point));
        Ok(())
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        self.log.borrow_mut().stops_s.push(self.now_s);
        Ok(())
    }
}

#[derive(Default)]
struct Kept(Vec<(Stamp, Message)>);

impl Sink for Kept {
    fn record(&mut self, log_time: Stamp, message: &Message) -> Result<(), SinkError> {
        self.0.push((log_time, message.clone()));
        Ok(())
    }
}

fn titan4() -> Robot {
    load(&std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4")).expect("it reads")
}

struct Played {
    result: Result<(), ArmError>,
    ended_s: f64,
    kept: Kept,
    log: Rc<RefCell<Log>>,
    counts_per_rad: Vec<f64>,
}

/// The fault begins after the arm has been found ready and moves.
const FAULT_S: f64 = 4.0;

/// Connects, moves the first joint back and forth by 0.3 rad for ten seconds, and returns the outcome.
fn play(fault: Fault, goal_step_rad: f64) -> Played {
    let robot = titan4();
    let counts = ArmSensors::nominal(&robot).counts(&robot.stowed);
    let log = Rc::new(RefCell::new(Log::default()));
    let rates = robot.sensors.iter().map(|s| 1.5 * s.max_rate_rad_s * s.counts_per_rad.abs() * PERIOD_S);
    let wire = FakeWire {
        now_s: 0.0,
        next_s: PERIOD_S,
        counts,
        set_point: counts,
        rate_counts: rates.collect(),
        fault,
        fault_s: FAULT_S,
        under_way: VecDeque::new(),
        rng: stream_rng(7, "loss"),
        log: Rc::clone(&log),
    };
    let deadman = Some(Deadman { topic: "/held".to_owned(), timeout_s: 0.5 });
    let connection = Connection { deadman, ..Connection::default() };
    let (mut arm, survey) = LiveArm::connect(wire, &robot, &connection).expect("it is ready");
    assert!(survey.readings > 80 && log.borrow().set_points.is_empty(), "nothing is sent before it is ready");
    let (mut kept, start, mut ended_s) = (Kept::default(), arm.now(), 0.0);
    let mut result = Ok(());
    for k in 0..500 {
        let swing = goal_step_rad * (f64::from(k) * PERIOD_S * 0.8).sin();
        // Holds the first joint at its reading, as a session does.
        let held = arm.reading().filter(|_| matches!(fault, Fault::Jump { .. })).map_or(counts[0], |read| read[0]);
        let goal = JointCounts::from_fn(counts.len(), |j| match j {
            0 => held,
            1 => counts[j] + swing * robot.sensors[j].counts_per_rad,
            _ => counts[j],
        });
        let (left_at, n) = (arm.now(), kept.0.len());
        result = arm.command(&goal).and_then(|()| arm.step(&mut kept));
        assert!(kept.0[n..].iter().all(|(log_time, _)| *log_time > left_at), "recorded as if it had been there before");
        ended_s = arm.now().since_s(start);
        if result.is_err() {
            break;
        }
    }
    let counts_per_rad = robot.sensors.iter().map(|s| s.counts_per_rad.abs()).collect();
    Played { result, ended_s, kept, log, counts_per_rad }
}

impl Played {
    fn why(&self) -> String {
        self.result.as_ref().err().map_or_else(String::new, ToString::to_string)
    }

    /// Returns the time of the stop after the fault, s.
    fn stopped_after_s(&self) -> Option<f64> {
        self.log.borrow().stops_s.first().map(|at_s| at_s - FAULT_S)
    }

    /// Asserts that the arm received only safe commands: no leap, and nothing after a stop.
    fn assert_safe(&self, fault: Fault) {
        let log = self.log.borrow();
        let rates = log.set_points.windows(2).map(|pair| {
            let way = |joint: usize| (pair[1].1[joint] - pair[0].1[joint]).abs() / self.counts_per_rad[joint];
            way(0).max(way(1)) / (pair[1].0 - pair[0].0).max(PERIOD_S)
        });
        // The last set-point of a stopped arm is where it read to be: it lags.
        let n = rates.len() - usize::from(!log.stops_s.is_empty());
        let fastest = rates.take(n).fold(0.0, f64::max);
        assert!(fastest < 0.4 * 1.2 * 1.05, "{fault:?}: {fastest} rad/s");
        if let Some(stop_s) = log.stops_s.first() {
            assert!(log.set_points.iter().all(|(at_s, _)| at_s <= stop_s), "{fault:?}: a set-point after the stop");
            assert_eq!(log.stops_s.len(), 1, "{fault:?}");
        }
    }
}

#[test]
fn a_sound_arm_is_followed_to_the_end() {
    for fault in [
        Fault::None,
        Fault::Lost { share: 0.05 },
        Fault::Delayed { by_s: 0.2 },
        Fault::Spike { counts: 4000.0 },
        Fault::ClockLeaps { by_s: 0.3 },
        Fault::BeginsWithZeros,
    ] {
        let played = play(fault, 0.3);
        assert!(played.result.is_ok(), "{fault:?}: {}", played.why());
        assert!(played.ended_s > 9.0, "{fault:?}: {}", played.ended_s);
        assert!(played.log.borrow().stops_s.is_empty());
        played.assert_safe(fault);
        let times: Vec<Stamp> = played.kept.0.iter().map(|(at, _)| *at).collect();
        assert!(times.is_sorted(), "{fault:?}");
    }
}

#[test]
fn each_fault_stops_the_arm_within_its_time() {
    let default = Connection::default().guard;
    // A set-point leads by up to half a second; the limit of tracking is passed as the motion goes on.
    let mut told = String::new();
    for (fault, limit_s) in [
        (Fault::Killed, default.stale_s + PERIOD_S),
        (Fault::LetGo, 0.0),
        (Fault::ClockLeaps { by_s: 60.0 }, 0.0),
        (Fault::ClockLeaps { by_s: 0.6 }, 0.0),
        (Fault::ClockLeaps { by_s: -60.0 }, 0.0),
        (Fault::Frozen, default.frozen_s + PERIOD_S),
        (Fault::Jump { counts: 4000.0 }, default.tracking_s + PERIOD_S),
        (Fault::Disobeys, 3.0),
    ] {
        // Far enough that an arm which stays behind is 20 deg off.
        let played = play(fault, 0.45);
        let after_s = played.stopped_after_s().unwrap_or_else(|| panic!("{fault:?} went on: {}", played.ended_s));
        assert!(after_s <= limit_s + REACTION_S, "{fault:?}: stopped after {after_s} s");
        let said = played.kept.0.iter().find_map(|(_, message)| match message {
            Message::Log(line) if line.name == "guard" => Some(line.text.as_str()),
            _ => None,
        });
        told += &format!("{fault:?}\n  {}\n  recorded: {}\n", played.why(), said.expect("the recording says why"));
        played.assert_safe(fault);
    }
    insta::assert_snapshot!("stops", told);
}

#[test]
fn nothing_is_sent_while_nobody_holds_the_switch() {
    let played = play(Fault::NotHeld, 0.3);
    insta::assert_snapshot!("not_held", played.why());
    // The one that stops it: stay where you are.
    assert!(played.log.borrow().set_points.len() <= 1);
}

/// A goal that leaps is approached no faster than the joints may go.
#[test]
fn a_goal_that_leaps_is_approached_at_the_joints_rate() {
    let robot = titan4();
    let played = play(Fault::None, 0.0);
    assert!(played.result.is_ok());
    let leap = play_leap(&robot, 0.5);
    leap.assert_safe(Fault::None);
    assert!(leap.result.is_ok(), "{}", leap.why());
    let beyond = play_leap(&robot, 3.0);
    insta::assert_snapshot!("beyond_its_range", beyond.why());
    assert_eq!(beyond.log.borrow().stops_s.len(), 1);
}

fn play_leap(robot: &Robot, by_rad: f64) -> Played {
    let counts = ArmSensors::nominal(robot).counts(&robot.stowed);
    let log = Rc::new(RefCell::new(Log::default()));
    let wire = FakeWire {
        now_s: 0.0,
        next_s: PERIOD_S,
        counts,
        set_point: counts,
        rate_counts: robot.sensors.iter().map(|s| s.max_rate_rad_s * s.counts_per_rad.abs() * PERIOD_S).collect(),
        fault: Fault::None,
        fault_s: FAULT_S,
        under_way: VecDeque::new(),
        rng: stream_rng(7, "loss"),
        log: Rc::clone(&log),
    };
    let (mut arm, _) = LiveArm::connect(wire, robot, &Connection::default()).expect("it is ready");
    let goal = JointCounts::from_fn(counts.len(), |j| {
        counts[j] + if j == 1 { by_rad * robot.sensors[j].counts_per_rad } else { 0.0 }
    });
    let (mut kept, start) = (Kept::default(), arm.now());
    let mut result = arm.command(&goal);
    for _ in 0..200 {
        result = result.and_then(|()| arm.step(&mut kept));
    }
    let counts_per_rad = robot.sensors.iter().map(|s| s.counts_per_rad.abs()).collect();
    Played { result, ended_s: arm.now().since_s(start), kept, log, counts_per_rad }
}

#[test]
fn an_arm_that_says_nothing_or_moves_is_not_ready() {
    let robot = titan4();
    let counts = ArmSensors::nominal(&robot).counts(&robot.stowed);
    for (fault, fault_s, moves) in [(Fault::Killed, 0.0, false), (Fault::None, 0.0, true)] {
        let far = JointCounts::from_fn(counts.len(), |j| counts[j] + if moves { 1e9 } else { 0.0 });
        let wire = FakeWire {
            now_s: 0.0,
            next_s: PERIOD_S,
            counts,
            set_point: far,
            rate_counts: robot.sensors.iter().map(|s| 0.1 * s.counts_per_rad.abs() * PERIOD_S).collect(),
            fault,
            fault_s,
            under_way: VecDeque::new(),
            rng: stream_rng(7, "loss"),
            log: Rc::default(),
        };
        let problem = LiveArm::connect(wire, &robot, &Connection::default()).err().expect("it is not ready");
        insta::assert_snapshot!(if moves { "it_moves" } else { "it_says_nothing" }, problem);
    }
}
