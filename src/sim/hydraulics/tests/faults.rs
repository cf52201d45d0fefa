//! Faults of an actuator.

use crate::hydraulics::tests::*;

#[test]
fn a_locked_joint_stays_and_its_neighbour_goes() {
    let mut rig = Rig::new(&HydraulicsSpec { leakage_rad_s: 5e-3, ..slippery() }, &[SHOULDER; 2], LIGHT, -500.0);
    rig.run(0.3, 0.5, -500.0);
    rig.hydraulics.lock(0);
    let piston_rad = rig.drive().piston_rad;
    rig.run(1.0, 0.5, -500.0);
    let at = rig.angles;
    assert_eq!(rig.drive().piston_rad, piston_rad);
    rig.run(1.0, 0.5, -500.0);
    assert!((rig.angles[0] - at[0]).abs() < 1e-6, "{}", rig.angles[0] - at[0]);
    assert!(rig.angles[1] - at[1] > 0.2);
    // Not even the relief valve releases it.
    rig.run(1.0, -1.0, 5000.0);
    let give = 5500.0 / rig.drive().stiffness_n_m_rad;
    assert!((rig.angles[0] - at[0] - give).abs() < 1e-4, "it gives as far as the oil does");
}

#[test]
fn less_pressure_is_less_rate_and_less_torque() {
    let rate = |ratio: f64, torque: f64| {
        let mut rig = Rig::new(&slippery(), &[SHOULDER], LIGHT, torque);
        rig.hydraulics.lose_pressure(0, ratio);
        rig.run(0.8, 1.0, torque);
        rig.mean_rates(1.0, torque)[0]
    };
    for (ratio, torque, exact) in [
        (0.25, 0.0, 0.65 * 0.5),
        (0.5, -400.0, 0.65 * (0.5_f64 - 0.2).sqrt()),
        (0.5, 400.0, 0.65 * (0.5_f64 + 0.2).sqrt()),
        (0.5, -1000.0, 0.0),
    ] {
        let rate = rate(ratio, torque);
        eprintln!("ratio {ratio}, {torque} N m: {rate:.6} rad/s, {exact:.6} by the orifice");
        assert!((rate - exact).abs() < 1e-4, "{rate} {exact}");
    }
    // The load exceeds the relief's share of the torque: the joint sinks, whether the valve is open or not.
    let mut rig = Rig::new(&slippery(), &[SHOULDER], 50.0, -800.0);
    rig.hydraulics.lose_pressure(0, 0.25);
    rig.run(0.3, 0.0, -800.0);
    let exact = -(800.0 - 1.2 * 0.25 * 2000.0) / 50.0;
    assert!((rig.rates[0] / (0.3 * exact) - 1.0).abs() < 0.03, "{} {}", rig.rates[0], 0.3 * exact);
}

#[test]
fn without_pressure_the_joint_falls_against_its_friction_alone() {
    let spec = HydraulicsSpec { coulomb_friction_ratio: 0.015, stiction_ratio: 0.0, ..HydraulicsSpec::default() };
    let mut rig = Rig::new(&spec, &[SHOULDER], 50.0, -500.0);
    rig.hydraulics.lose_pressure(0, 0.0);
    rig.run(0.2, 1.0, -500.0);
    let rate = rig.rates[0];
    rig.run(0.2, 1.0, -500.0);
    let error = (rig.rates[0] - rate) / (-0.2 * 470.0 / 50.0) - 1.0;
    assert!(error.abs() < 1e-9, "{error}");
    assert_eq!(rig.hydraulics.torques(&rig.angles, &rig.rates)[0], 0.0);
}

#[test]
fn without_pump_closed_valves_still_hold() {
    let mut rig = Rig::new(&slippery(), &[SHOULDER], 50.0, -1500.0);
    rig.hydraulics.lose_pump(0.0);
    rig.run(60.0, 0.0, -1500.0);
    assert!(rig.angles[0].abs() < 1e-9, "{}", rig.angles[0]);
    rig.run(1.0, 1.0, -1500.0);
    assert!(rig.angles[0].abs() < 1e-9, "nothing lifts it, and the check valve lets no oil back");
    // At a quarter of the pressure: half the rate, and three joints have a quarter of the flow to share.
    let mut rig = Rig::new(&slippery(), &[SHOULDER], LIGHT, 0.0);
    rig.hydraulics.lose_pump(0.25);
    rig.run(1.0, 1.0, 0.0);
    let rate = rig.mean_rates(1.0, 0.0)[0];
    assert!((rate - 0.325).abs() < 1e-4, "{rate}");
    let mut rig = Rig::new(&slippery(), &[SHOULDER; 3], LIGHT, 0.0);
    rig.hydraulics.lose_pump(0.25);
    rig.run(1.0, 1.0, 0.0);
    let rates = rig.mean_rates(1.0, 0.0);
    let flow: f64 = (0..3).map(|j| rig.drive().displacement_m3_rad * rates[j]).sum();
    assert!((flow * 60_000.0 / 3.0 - 1.0).abs() < 1e-6, "{flow}");
}
