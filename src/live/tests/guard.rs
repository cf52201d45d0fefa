//! The guard's rules on readings alone, where a session takes back what it asked.

use std::time::Duration;

use super::{PERIOD_S, titan4};
use crate::GuardLimits;
use crate::guard::{Guard, StopReason};
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointCounts, JointSensorSample};
use armcal_core::time::SIMULATION_EPOCH;

/// Returns the time of the guard's stop. Readings and set-points are turns of joint 1 from its start, deg, one per
/// period.
fn heard(n: u32, reading_deg: impl Fn(f64) -> f64, sent_deg: impl Fn(f64) -> f64) -> Option<(f64, StopReason)> {
    let robot = titan4();
    let stowed = ArmSensors::nominal(&robot).counts(&robot.stowed);
    let turned = |deg: f64| {
        let turn = (deg.to_radians() * robot.sensors[1].counts_per_rad).round();
        JointCounts::from_fn(stowed.len(), |joint| stowed[joint] + if joint == 1 { turn } else { 0.0 })
    };
    let mut guard = Guard::new(&robot, GuardLimits::default(), None);
    (0..n).find_map(|k| {
        let at_s = f64::from(k) * PERIOD_S;
        let sample = JointSensorSample { stamp: SIMULATION_EPOCH.plus_s(at_s), counts: turned(reading_deg(at_s)) };
        let stop = guard.hear(&sample, &turned(sent_deg(at_s)), Duration::from_secs_f64(at_s)).err();
        stop.map(|reason| (at_s, reason))
    })
}

/// Readings repeat all the time; the set-point moves by 2 deg in 0.2 s, and is taken back 0.3 s later.
#[test]
fn frozen_readings_stop_an_arm_that_is_held_meanwhile() {
    let sent = |at_s: f64| if at_s < 2.5 { ((at_s - 2.0) / 0.1).clamp(0.0, 2.0) } else { 0.0 };
    let (at_s, reason) = heard(300, |_| 0.0, sent).expect("it stops");
    assert!(matches!(reason, StopReason::Frozen { .. }), "{reason}");
    // The set-point has moved by 1.15 deg at 2.115 s.
    let late_s = at_s - 2.115 - 0.5 * GuardLimits::default().frozen_s;
    assert!((0.0..=2.0 * PERIOD_S).contains(&late_s), "{late_s} s");
}

/// Sensors without noise repeat their readings at rest: only commands count, not the duration of the rest.
#[test]
fn an_arm_without_noise_may_rest_and_then_move_late() {
    let sent = |at_s: f64| (2.0 * (at_s - 8.0)).clamp(0.0, 10.0);
    assert_eq!(heard(1000, |at_s| sent(at_s - 0.4), sent), None);
}

/// Set-points that follow the reading at once hide no fault.
#[test]
fn a_reading_that_leaps_and_stays_stops_the_arm() {
    let read = |at_s: f64| if at_s < 1.99 { 0.0 } else { 30.0 };
    let (at_s, reason) = heard(500, read, read).expect("it stops");
    assert!(matches!(&reason, StopReason::Leapt { joint, .. } if *joint == titan4().joint_names()[1]), "{reason}");
    let late_s = at_s - 2.0 - GuardLimits::default().tracking_s;
    assert!((-PERIOD_S..=PERIOD_S).contains(&late_s), "{late_s} s");
}

#[test]
fn readings_that_come_back_or_go_as_joints_go_do_not_stop_it() {
    let some_wild = |at_s: f64| if (2.0..2.5).contains(&at_s) { 30.0 } else { 0.0 };
    assert_eq!(heard(500, some_wild, |_| 0.0), None);
    let two_places = |at_s: f64| some_wild(at_s) - if (2.2..2.5).contains(&at_s) { 80.0 } else { 0.0 };
    assert_eq!(heard(500, two_places, |_| 0.0), None);
    let moves = |at_s: f64| (20.0 * (at_s - 2.0)).clamp(0.0, 60.0);
    assert_eq!(heard(500, moves, moves), None);
    // Slip that calibration corrects.
    let slips = |at_s: f64| if at_s < 2.0 { 0.0 } else { 8.0 };
    assert_eq!(heard(500, slips, |_| 0.0), None);
}
