//! Friction that holds, breaks away and slides.

use std::f64::consts::TAU;

use crate::hydraulics::friction::Friction;
use crate::hydraulics::tests::*;

const INERTIA: f64 = 50.0;
/// Friction torques of the shoulder, N m.
const COULOMB: f64 = 30.0;
const STICTION: f64 = 40.0;

/// Returns a rig with friction only: a burst hose leaves the oil without torque.
fn alone(spec: &HydraulicsSpec) -> Rig {
    let mut rig = Rig::new(spec, &[SHOULDER], INERTIA, 0.0);
    rig.hydraulics.lose_pressure(0, 0.0);
    rig
}

fn dry() -> HydraulicsSpec {
    HydraulicsSpec { coulomb_friction_ratio: 0.015, stiction_ratio: 0.02, ..HydraulicsSpec::default() }
}

/// Applies a load over ten seconds: a sudden load would double its torque.
fn load_slowly(rig: &mut Rig, torque: f64) {
    for step in 1..=5000 {
        rig.step(0.0, torque * f64::from(step) / 5000.0);
    }
}

/// Returns the drift in ten minutes under `torque(t)`: the difference of the mean angles over the last and the first
/// minute. Prints lines for a plot.
fn drift_rad(name: &str, rig: &mut Rig, torque: impl Fn(f64) -> f64) -> f64 {
    let minute = (60.0 / STEP_S).round() as u32;
    let mut means = [0.0; 10];
    for (i, mean) in means.iter_mut().enumerate() {
        for step in 0..minute {
            rig.step(0.0, torque(60.0 * i as f64 + (f64::from(step) + 0.5) * STEP_S));
            *mean += rig.angles[0] / f64::from(minute);
            if step % 2100 == 0 {
                eprintln!("plot hold/{name} {:.1} {:e}", 60.0 * i as f64 + f64::from(step) * STEP_S, rig.angles[0]);
            }
        }
        eprintln!("plot hold-mean/{name} {} {:e}", 60 * i + 30, *mean);
    }
    means[9] - means[0]
}

/// Returns the torque of gravity and of a vehicle that rolls, with periods that divide the minute.
fn rocking(gravity: f64, amplitude: f64) -> impl Fn(f64) -> f64 {
    move |t| gravity + amplitude * (0.7 * (TAU * t / 12.0).sin() + 0.3 * (TAU * t / 5.0).cos())
}

#[test]
fn a_closed_valve_with_friction_does_not_creep() {
    for (gravity, amplitude) in [(-1200.0, 10.0), (-1200.0, 300.0), (500.0, 30.0)] {
        let mut rig = Rig::new(&dry(), &[SHOULDER], INERTIA, gravity);
        let drift = drift_rad(&format!("valve/{gravity}/{amplitude}"), &mut rig, rocking(gravity, amplitude));
        eprintln!("gravity {gravity}, rocking {amplitude} N m: {drift:.1e} rad in 10 min");
        assert!(drift.abs() < 1e-6, "{drift}");
    }
}

#[test]
fn friction_alone_holds_a_load_below_its_breakaway() {
    for (gravity, amplitude) in [(20.0, 0.0), (39.0, 0.0), (20.0, 10.0), (-20.0, 15.0)] {
        let mut rig = alone(&dry());
        load_slowly(&mut rig, gravity);
        let drift = drift_rad(&format!("friction/{gravity}/{amplitude}"), &mut rig, rocking(gravity, amplitude));
        eprintln!("load {gravity} +- {amplitude} N m: {drift:.1e} rad in 10 min, at {:.1e}", rig.angles[0]);
        assert!(drift.abs() < 1e-6, "{drift}");
        assert!(rig.angles[0].abs() <= 1e-3, "it gives no more than before breakaway");
    }
    // Steady: as a spring of the breakaway torque over the presliding.
    let mut rig = alone(&dry());
    load_slowly(&mut rig, 20.0);
    rig.run(10.0, 0.0, 20.0);
    assert!((rig.angles[0] / (20.0 / STICTION * 1e-3) - 1.0).abs() < 1e-9);
}

#[test]
fn it_breaks_away_at_the_stiction_torque() {
    // The load grows by 0.2 N m per second.
    let mut rig = alone(&dry());
    let mut torque = 0.0;
    while rig.angles[0] < 2e-3 && torque < 100.0 {
        torque += 0.2 * STEP_S;
        rig.step(0.0, torque);
    }
    eprintln!("breakaway at {torque:.2} N m");
    assert!((torque / STICTION - 1.0).abs() < 0.01, "{torque}");
}

/// A block on a slope: the load less the sliding torque.
#[test]
fn it_slides_with_the_rest_of_the_load() {
    for torque in [50.0, -80.0, 400.0] {
        // Without Stribeck's part the form is closed.
        let spec = HydraulicsSpec { stiction_ratio: 0.0, ..dry() };
        let mut rig = alone(&spec);
        rig.run(0.3, 0.0, torque);
        let (angle, rate) = (rig.angles[0], rig.rates[0]);
        rig.run(0.2, 0.0, torque);
        let exact = (torque - COULOMB.copysign(torque)) / INERTIA;
        let error = (rig.rates[0] - rate) / (0.2 * exact) - 1.0;
        let path = (rig.angles[0] - angle) / (rate * 0.2 + 0.5 * exact * 0.04) - 1.0;
        eprintln!("{torque} N m: rate off by {error:.1e}, path by {path:.1e}");
        assert!(error.abs() < 1e-9 && path.abs() < 1e-9, "{error} {path}");
    }
}

/// A joint with an initial rate comes to rest where friction has used up its energy.
#[test]
fn a_thrown_joint_stops_where_friction_has_taken_its_energy() {
    let mut rig = alone(&HydraulicsSpec { stiction_ratio: 0.0, ..dry() });
    rig.rates = JointAngles::from_slice(&[0.5]);
    let exact = 0.5 * INERTIA * 0.25 / COULOMB;
    let mut farthest = 0.0_f64;
    for _ in 0..5000 {
        rig.step(0.0, 0.0);
        farthest = farthest.max(rig.angles[0]);
    }
    eprintln!("turns at {farthest:.6} rad, {exact:.6} by energy, rests at {:.6}", rig.angles[0]);
    // Angle by which the bristle bends before it slides, and by which it springs back at the end.
    let presliding = 1e-3;
    assert!((farthest - exact).abs() < 2.0 * presliding, "{farthest}");
    assert!((0.0..2.0 * presliding).contains(&(farthest - rig.angles[0])), "{}", rig.angles[0]);
    assert!(rig.rates[0].abs() < 1e-6, "it rests");
}

/// The sliding torque of a joint at a steady rate follows Stribeck's curve.
#[test]
fn the_sliding_torque_follows_stribecks_curve() {
    let spec = dry();
    for rate in [0.02, 0.05, 0.1, 0.3, -0.05] {
        let mut friction = Friction::new(&spec, SHOULDER.torque_max_n_m);
        friction.settle(0.0);
        let mut angle = 0.0;
        for _ in 0..2000 {
            friction.step(angle, rate);
            angle += rate * STEP_S;
        }
        let exact = COULOMB + (STICTION - COULOMB) * (-(rate / 0.05_f64).powi(2)).exp();
        let torque = friction.load().torque_n_m(angle, rate);
        assert!((torque + exact.copysign(rate)).abs() < 1e-9, "{rate} rad/s: {torque} {exact}");
    }
}

/// The joint moves to and fro at a steady rate, with the bristle's torque without damping. After each reversal the
/// bristle unbends and bends the other way up to the stiction, then slides. The area of the loop is the energy of a
/// cycle.
#[test]
fn a_cycle_takes_the_energy_of_its_loop() {
    const AMPLITUDE: f64 = 4e-3;
    const STEPS: u32 = 4000;
    for rate in [0.005_f64, 0.05, 0.15] {
        let mut friction = Friction::new(&dry(), SHOULDER.torque_max_n_m);
        friction.settle(0.0);
        let (mut work, mut before) = (0.0, 0.0);
        // A quarter cycle to the turning point, a cycle to forget the start, a cycle to measure.
        for step in 0..9 * STEPS {
            let cycle = f64::from(step) / f64::from(4 * STEPS);
            let phase = (cycle + 0.25).fract();
            let (up, direction) = if phase < 0.5 { (4.0 * phase - 1.0, 1.0) } else { (3.0 - 4.0 * phase, -1.0) };
            let angle = AMPLITUDE * up;
            friction.step(angle, direction * rate);
            let torque = -friction.load().torque_n_m(angle, 0.0);
            if step >= 5 * STEPS {
                work += torque * (angle - before);
            }
            if step % 200 == 0 {
                eprintln!("plot friction/{rate} {angle:e} {torque:e}");
            }
            before = angle;
        }
        let sliding = COULOMB + (STICTION - COULOMB) * (-(rate / 0.05_f64).powi(2)).exp();
        let stiffness = STICTION / 1e-3;
        let bending = (STICTION + sliding) / stiffness;
        let half =
            0.5 * (STICTION + sliding) / stiffness * (STICTION - sliding) + sliding * (2.0 * AMPLITUDE - bending);
        eprintln!("{rate} rad/s: {work:.5} J a cycle, {:.5} by the loop", 2.0 * half);
        assert!((work / (2.0 * half) - 1.0).abs() < 5e-3, "{work} {}", 2.0 * half);
    }
}

#[test]
fn without_ratios_there_is_no_friction() {
    let mut rig = alone(&slippery());
    rig.run(0.5, 0.0, 1.0);
    assert!((rig.rates[0] / (0.5 / INERTIA) - 1.0).abs() < 1e-9);
}
