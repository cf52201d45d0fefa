//! Nudges of one joint by one degree out and back, on arms that misinterpret set-points.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use super::{FAULT_S, FakeWire, Fault, Log, PERIOD_S, titan4};
use crate::{Connection, Heard, LiveArm, LiveError, NudgeProblem, Wire};
use armcal_core::codes::Coded;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointCounts;

/// Interpretation of set-points by an arm's driver.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Driver {
    Sound,
    /// The displacement of a joint is multiplied by a factor.
    Scaled {
        joint: usize,
        by: f64,
    },
    /// Readings of a joint rise where set-points fall, mirrored about half a turn.
    Mirrored {
        joint: usize,
    },
    /// The names of two joints are exchanged.
    Swapped {
        a: usize,
        b: usize,
    },
}

/// An arm at rest where it is stowed.
fn still(robot: &Robot, log: &Rc<RefCell<Log>>) -> FakeWire {
    let counts = ArmSensors::nominal(robot).counts(&robot.stowed);
    FakeWire {
        now_s: 0.0,
        next_s: PERIOD_S,
        counts,
        set_point: counts,
        rate_counts: robot.sensors.iter().map(|s| s.max_rate_rad_s * s.counts_per_rad.abs() * PERIOD_S).collect(),
        fault: Fault::None,
        fault_s: FAULT_S,
        under_way: VecDeque::new(),
        rng: stream_rng(7, "loss"),
        log: Rc::clone(log),
    }
}

struct SkewedWire {
    wire: FakeWire,
    start: JointCounts,
    driver: Driver,
}

impl Wire for SkewedWire {
    fn elapsed(&self) -> Duration {
        self.wire.elapsed()
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        self.wire.receive(timeout, heard)
    }

    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError> {
        let mut meant = *set_point;
        let way = |joint: usize| set_point[joint] - self.start[joint];
        match self.driver {
            Driver::Sound => {}
            Driver::Scaled { joint, by } => meant[joint] = self.start[joint] + by * way(joint),
            Driver::Mirrored { joint } => meant[joint] = 65_535.0 - set_point[joint],
            Driver::Swapped { a, b } => {
                (meant[a], meant[b]) = (self.start[a] + way(b), self.start[b] + way(a));
            }
        }
        self.wire.send(&meant, within_s)
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        self.wire.stop()
    }
}

struct Nudged {
    problem: Option<NudgeProblem>,
    /// Share of the way that each joint moves.
    shares: Vec<f64>,
    log: Rc<RefCell<Log>>,
    start: JointCounts,
}

/// Nudges one joint after the other until one fails.
fn nudge_all(robot: &Robot, driver: Driver) -> Nudged {
    let start = ArmSensors::nominal(robot).counts(&robot.stowed);
    let log = Rc::new(RefCell::new(Log::default()));
    let wire = still(robot, &log);
    let (mut arm, _) =
        LiveArm::connect(SkewedWire { wire, start, driver }, robot, &Connection::default()).expect("it is ready");
    let (mut shares, mut problem) = (Vec::new(), None);
    for joint in 0..robot.n_joints() {
        match arm.nudge(joint, &|| false) {
            Ok(nudge) => shares.push(nudge.moved_rad / nudge.asked_rad),
            Err(error) => {
                problem = Some(error);
                break;
            }
        }
    }
    Nudged { problem, shares, log, start }
}

impl Nudged {
    /// Returns the largest commanded distance of any joint from its start, deg.
    fn farthest_deg(&self, robot: &Robot) -> f64 {
        let log = self.log.borrow();
        let way =
            |counts: &JointCounts, j: usize| ((counts[j] - self.start[j]) / robot.sensors[j].counts_per_rad).abs();
        let all = log.set_points.iter().flat_map(|(_, counts)| (0..counts.len()).map(move |j| way(counts, j)));
        all.fold(0.0, f64::max).to_degrees()
    }
}

#[test]
fn a_sound_arm_passes_and_is_where_it_was() {
    let robot = titan4();
    let nudged = nudge_all(&robot, Driver::Sound);
    assert!(nudged.problem.is_none(), "{:?}", nudged.problem);
    assert_eq!(nudged.shares.len(), robot.n_joints());
    assert!(nudged.shares.iter().all(|share| (0.95..=1.05).contains(share)), "{:?}", nudged.shares);
    let farthest_deg = nudged.farthest_deg(&robot);
    // A count of the coarsest sensor is 0.05 deg.
    assert!((0.99..1.06).contains(&farthest_deg), "{farthest_deg}");
    let log = nudged.log.borrow();
    let (_, last) = log.set_points.last().expect("set-points");
    // Each nudge begins at the arm's reading, which is within a count of its true angle.
    let most = robot.n_joints() as f64;
    assert!((0..last.len()).all(|j| (last[j] - nudged.start[j]).abs() <= most), "{last:?}");
    assert!(log.stops_s.is_empty());
}

#[test]
fn a_joint_that_moves_otherwise_than_told_stops_the_arm() {
    let robot = titan4();
    let mut told = String::new();
    for (driver, n_before) in [
        (Driver::Scaled { joint: 2, by: -1.0 }, 2),
        (Driver::Scaled { joint: 1, by: 2.0 }, 1),
        (Driver::Scaled { joint: 3, by: 0.3 }, 3),
        (Driver::Scaled { joint: 0, by: 20.0 }, 0),
        (Driver::Scaled { joint: 4, by: 0.0 }, 4),
        (Driver::Mirrored { joint: 1 }, 0),
        (Driver::Swapped { a: 0, b: 2 }, 0),
    ] {
        let nudged = nudge_all(&robot, driver);
        let problem = nudged.problem.as_ref().expect("it is stopped");
        told += &format!("{driver:?}\n  {problem} [{}]\n", problem.code());
        assert_eq!(nudged.shares.len(), n_before, "{driver:?}");
        assert_eq!(nudged.log.borrow().stops_s.len(), 1, "{driver:?}: no stop");
    }
    insta::assert_snapshot!("nudges", told);
}

/// The arm is stopped within a few degrees, however far the driver would move it.
#[test]
fn an_arm_that_goes_astray_does_not_go_far() {
    let robot = titan4();
    let nudged = nudge_all(&robot, Driver::Mirrored { joint: 1 });
    let log = nudged.log.borrow();
    let stop_s = log.stops_s[0];
    let first_s = log.set_points[0].0;
    assert!(stop_s - first_s < 0.2, "stopped after {} s", stop_s - first_s);
}

#[test]
fn ctrl_c_stops_the_arm() {
    let robot = titan4();
    let log = Rc::new(RefCell::new(Log::default()));
    let wire = still(&robot, &log);
    let (mut arm, _) = LiveArm::connect(wire, &robot, &Connection::default()).expect("it is ready");
    let n = Cell::new(0);
    let problem = arm.nudge(0, &|| n.replace(n.get() + 1) > 20).expect_err("it was stopped");
    assert!(matches!(problem, NudgeProblem::Stopped), "{problem}");
    assert_eq!(log.borrow().stops_s.len(), 1);
}
