//! Valve, pump, column, leak, relief.

use crate::hydraulics::tests::*;

#[test]
fn the_flow_depends_on_opening_and_load() {
    let rate_under = |command: f64, torque: f64| {
        let mut rig = Rig::new(&slippery(), &[SHOULDER], LIGHT, torque);
        rig.run(0.9, command, torque);
        rig.mean_rates(command, torque)[0]
    };
    let open = (0.5 - 0.03) / 0.97 * 0.5 * 1.3;
    let cases = [(0.5, 0.0, open), (0.5, -1000.0, open * 0.5_f64.sqrt()), (-0.5, -1000.0, -open * 1.5_f64.sqrt())];
    for (command, torque, exact) in cases {
        let error = rate_under(command, torque) / exact - 1.0;
        eprintln!("command {command}, torque {torque} N m: relative error {error:.1e}");
        assert!(error.abs() < 1e-4, "{error}");
    }
    assert!(rate_under(0.5, -2000.0).abs() < 1e-9, "it stalls");
    assert!(rate_under(0.029, -1000.0).abs() < 1e-9, "the deadband passes nothing");
}

#[test]
fn three_joints_share_a_small_pump() {
    // Different joints: each asks for D rate_max.
    let big = ActuatorInput { torque_max_n_m: 4000.0, ..SHOULDER };
    let fast = ActuatorInput { rate_limit_rad_s: 1.0, ..SHOULDER };
    let inputs = [SHOULDER, big, fast];
    let asked: Vec<f64> = inputs.iter().map(|i| 1.3 * i.rate_limit_rad_s).collect();
    for flow_l_min in [2.0, 5.0, 8.0, 12.0, 16.0, 20.0, 30.0, 60.0] {
        let spec = HydraulicsSpec { pump_flow_l_min: flow_l_min, ..slippery() };
        let mut rig = Rig::new(&spec, &inputs, LIGHT, 0.0);
        rig.run(0.7, 1.0, 0.0);
        let rates = rig.mean_rates(1.0, 0.0);
        let used: f64 = (0..3).map(|j| rig.hydraulics.actuators[j].displacement_m3_rad * rates[j].abs()).sum();
        let wanted: f64 = (0..3).map(|j| rig.hydraulics.actuators[j].displacement_m3_rad * asked[j]).sum();
        let pump = flow_l_min / 60_000.0;
        let share = (pump / wanted).min(1.0);
        for (j, asked) in asked.iter().enumerate() {
            eprintln!("plot pump/{j} {flow_l_min} {:e} {:e} {asked}", rates[j], share * asked);
            assert!((rates[j] / (share * asked) - 1.0).abs() < 1e-4, "{flow_l_min} L/min, joint {j}");
        }
        let error = used / pump.min(wanted) - 1.0;
        eprintln!("{flow_l_min} L/min: share {share:.3}, flow off by {error:.1e}");
        assert!(error.abs() < 1e-4, "{error}");
    }
}

#[test]
fn a_column_droops_by_torque_over_stiffness() {
    let mut rig = Rig::new(&slippery(), &[SHOULDER], 50.0, 0.0);
    rig.run(10.0, 0.0, 700.0);
    // 4 beta D^2 / V with V = D range (1 + dead volume).
    let displacement = 2000.0 / 2.07e7;
    let stiffness = 4.0 * 1e9 * displacement / (2.0 * 3.0);
    let error = rig.angles[0] / (700.0 / stiffness) - 1.0;
    eprintln!("droop {:.3e} rad, relative error {error:.1e}", rig.angles[0]);
    assert!(error.abs() < 1e-9, "{error}");
    // 8e4 N m/rad are published for a shoulder of 2 to 3 kN m.
    assert!((4e4..1.6e5).contains(&stiffness), "{stiffness}");
}

#[test]
fn a_leaky_closed_valve_creeps() {
    for (leakage, torque) in [(5e-3, -1200.0), (5e-5, 800.0)] {
        let spec = HydraulicsSpec { leakage_rad_s: leakage, ..slippery() };
        let mut rig = Rig::new(&spec, &[SHOULDER], 50.0, torque);
        rig.run(5.0, 0.0, torque);
        let start = rig.angles[0];
        for second in (5..=60).step_by(5) {
            rig.run(5.0, 0.0, torque);
            eprintln!("plot leak/{leakage}/{torque} {second} {:e}", rig.angles[0] - start);
        }
        let error = (rig.angles[0] - start) / (60.0 * leakage * torque / 2000.0) - 1.0;
        eprintln!("leakage {leakage} rad/s: relative error {error:.1e}");
        assert!(error.abs() < 1e-4, "{error}");
    }
}

#[test]
fn the_relief_valve_yields_above_its_torque_and_holds_below() {
    let slack = 1.2 * 2000.0;
    let mut rig = Rig::new(&slippery(), &[SHOULDER], 50.0, 2300.0);
    let held = rig.drive().piston_rad;
    rig.run(10.0, 0.0, 2300.0);
    assert_eq!(rig.drive().piston_rad, held, "below its torque the piston stays");
    // Above that torque, the joint is an inertia under the difference.
    rig.run(0.1, 0.0, 2500.0);
    let (start, rate) = (rig.angles[0], rig.rates[0]);
    rig.run(0.4, 0.0, 2500.0);
    let acceleration = (rig.rates[0] - rate) / 0.4;
    eprintln!("slip {:.3} rad, acceleration {acceleration:.4} rad/s2", rig.angles[0] - start);
    assert!((acceleration / (100.0 / 50.0) - 1.0).abs() < 1e-9, "{acceleration}");
    // Without the load the joint stops; the column holds at most its earlier torque.
    let largest = (0..500).fold(0.0_f64, |largest, _| {
        rig.step(0.0, 0.0);
        largest.max(rig.drive().column_torque_n_m(rig.angles[0], 0.0).abs())
    });
    assert!(largest < slack * 1.02, "{largest}");
    assert!(rig.rates[0].abs() < 1e-3 && rig.drive().piston_rad > 0.1, "it has yielded for good");
}

/// With the valve fully open, the pump's power becomes heat except for the work on the load.
#[test]
fn what_the_pump_brings_and_the_load_does_not_take_is_heat() {
    let mut rig = Rig::new(&slippery(), &[SHOULDER], LIGHT, -1000.0);
    rig.run(0.6, 1.0, -1000.0);
    let rate = 0.65 * 0.5_f64.sqrt();
    let flow = 2000.0 / 2.07e7 * rate;
    let exact = 2.07e7 * flow - 1000.0 * rate;
    eprintln!("{:.3} W, {exact:.3} by the orifice", rig.hydraulics.power_w());
    assert!((rig.hydraulics.power_w() / exact - 1.0).abs() < 1e-3, "{} {exact}", rig.hydraulics.power_w());
    // A sinking load warms the oil too.
    let mut rig = Rig::new(&slippery(), &[SHOULDER], LIGHT, -1000.0);
    rig.run(0.6, -1.0, -1000.0);
    let exact = (2000.0 + 1000.0) * 0.65 * 1.5_f64.sqrt();
    eprintln!("{:.3} W, {exact:.3} by the orifice", rig.hydraulics.power_w());
    assert!((rig.hydraulics.power_w() / exact - 1.0).abs() < 1e-3, "{} {exact}", rig.hydraulics.power_w());
    // Power of a leak: torque times creep.
    let mut rig = Rig::new(&HydraulicsSpec { leakage_rad_s: 5e-3, ..slippery() }, &[SHOULDER], 50.0, -1000.0);
    rig.run(5.0, 0.0, -1000.0);
    assert!((rig.hydraulics.power_w() / (1000.0 * 2.5e-3) - 1.0).abs() < 1e-4, "{}", rig.hydraulics.power_w());
}

/// The joint follows its valve to second order in the step.
#[test]
fn halving_the_step_quarters_the_error() {
    let swung = |step_s: f64| {
        let spec = HydraulicsSpec { deadband: 0.0, ..slippery() };
        let mut rig = Rig::with_step(&spec, &[SHOULDER], 50.0, -600.0, step_s);
        rig.run(0.2, 0.8, -600.0);
        rig.angles[0]
    };
    let exact = swung(1e-5);
    let errors = [0.004, 0.002, 0.001].map(|step_s| 1e6 * (swung(step_s) - exact));
    eprintln!("errors in microradians {errors:.3?}");
    for (step_s, error) in [0.004, 0.002, 0.001].iter().zip(errors) {
        eprintln!("plot convergence/valve {step_s} {:e}", 1e-6 * error.abs());
    }
    assert!((3.0..5.0).contains(&(errors[0] / errors[1])) && (3.0..5.0).contains(&(errors[1] / errors[2])));
    assert!(errors[1].abs() < 100.0);
}

#[test]
fn an_end_stop_gives_by_torque_over_stiffness_and_does_not_bounce() {
    let stiffness = 1e6;
    let spec = HydraulicsSpec { end_stop_stiffness_n_m_rad: stiffness, ..slippery() };
    for (command, inertia) in [(1.0, 50.0), (-1.0, 50.0), (1.0, 1.0)] {
        let mut rig = Rig::new(&spec, &[SHOULDER], inertia, 0.0);
        let end: f64 = command;
        let (mut has_touched, mut back) = (false, 0.0_f64);
        for _ in 0..3000 {
            rig.step(command, 0.0);
            has_touched |= rig.angles[0] * end > 1.0;
            back = if has_touched { back.min(rig.rates[0] * end) } else { 0.0 };
        }
        // The valve pushes until the load leaves it no pressure head: the full torque.
        let error = (rig.angles[0] * end - 1.0) / (2000.0 / stiffness) - 1.0;
        eprintln!("inertia {inertia}: depth off by {error:.1e}, fastest way back {back:.1e} rad/s");
        assert!(error.abs() < 1e-3, "{error}");
        assert!(back > -0.2 * 0.65, "{back}");
    }
}

/// A load throws the joint against its stop, with a burst hose: only the stop acts.
#[test]
fn a_bounce_gains_no_energy() {
    let spec = HydraulicsSpec { end_stop_stiffness_n_m_rad: 1e6, ..slippery() };
    for (inertia, speed) in [(0.1, 1.0), (5.0, 1.0), (50.0, 0.5), (100.0, 0.5)] {
        let mut rig = Rig::new(&spec, &[SHOULDER], inertia, 0.0);
        rig.hydraulics.lose_pressure(0, 0.0);
        rig.angles = JointAngles::from_slice(&[0.99937]);
        rig.rates = JointAngles::from_slice(&[speed]);
        let (mut fastest_back, mut deepest) = (0.0_f64, 0.0_f64);
        for _ in 0..500 {
            rig.step(0.0, 0.0);
            fastest_back = fastest_back.min(rig.rates[0]);
            deepest = deepest.max(rig.angles[0] - 1.0);
        }
        let kept = (fastest_back / speed).powi(2);
        eprintln!("inertia {inertia}, {speed} rad/s: depth {deepest:.1e} rad, energy kept {kept:.1e}");
        assert!(deepest > 0.0 && kept < 0.15, "{kept}");
    }
}
