//! Drive and controller together: the rest position of a joint.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::controller::Controller;
use crate::hydraulics::tests::*;
use crate::spec::CONTROL_PERIOD_S;
use armcal_core::robot::JointSensorSpec;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointCounts;

const COUNTS_PER_RAD: f64 = 46.0 * 180.0 / std::f64::consts::PI;
const WRAP_COUNTS: f64 = 65_536.0;
/// 0.05 deg.
const LIMIT_RAD: f64 = 0.05 * std::f64::consts::PI / 180.0;

/// The last joint of a large arm: light, fast, soft.
const WRIST: ActuatorInput = ActuatorInput { limits: None, torque_max_n_m: 170.0, rate_limit_rad_s: 1.5 };

fn sensor(max_rate_rad_s: f64) -> JointSensorSpec {
    JointSensorSpec { noise_std_counts: 2.0, ..crate::fixture::exact_sensor(COUNTS_PER_RAD, max_rate_rad_s) }
}

/// One joint under a load of `load_ratio` of its torque, which the vehicle rocks by a hundredth.
struct Loop {
    rig: Rig,
    controller: Controller,
    rng: rand_chacha::ChaCha8Rng,
    load_n_m: f64,
    rocking_n_m: f64,
    reading: f64,
    t_s: f64,
}

impl Loop {
    fn new(spec: &HydraulicsSpec, input: ActuatorInput, inertia_kg_m2: f64, load_ratio: f64, seed: u64) -> Self {
        let load_n_m = load_ratio * input.torque_max_n_m;
        let start = JointCounts::from_slice(&[0.0]);
        Self {
            rig: Rig::new(spec, &[input], inertia_kg_m2, load_n_m),
            controller: Controller::new(spec, &[sensor(input.rate_limit_rad_s)], &[1.0], &start),
            rng: stream_rng(seed, "noise of a loop"),
            load_n_m,
            rocking_n_m: 0.015 * load_n_m.abs() + 0.002 * input.torque_max_n_m,
            reading: 0.0,
            t_s: 0.0,
        }
    }

    fn period(&mut self) {
        let command = self.controller.update(&JointCounts::from_slice(&[self.reading]))[0];
        for _ in 0..(CONTROL_PERIOD_S / self.rig.hydraulics.step_s).round() as u32 {
            self.t_s += self.rig.hydraulics.step_s;
            let torque = self.load_n_m + self.rocking_n_m * (TAU * self.t_s / 7.0).sin();
            self.rig.step(command, torque);
        }
        let noise: f64 = StandardNormal.sample(&mut self.rng);
        self.reading = (self.rig.angles[0] * COUNTS_PER_RAD + 1.5 * noise).round().rem_euclid(WRAP_COUNTS);
    }

    /// Moves to `to_rad` along a cubic of `path_s` and rests; the largest error over the last second, rad.
    fn rest_error_rad(&mut self, to_rad: f64, path_s: f64, rest_s: f64) -> (f64, f64) {
        let from_rad = self.rig.angles[0];
        let periods = (path_s / CONTROL_PERIOD_S).round() as u32;
        for period in 1..=periods {
            let u = f64::from(period) / f64::from(periods);
            let at = from_rad + (to_rad - from_rad) * u * u * (3.0 - 2.0 * u);
            self.controller.command(&JointCounts::from_slice(&[(at * COUNTS_PER_RAD).rem_euclid(WRAP_COUNTS)]));
            self.period();
        }
        self.controller.command(&JointCounts::from_slice(&[(to_rad * COUNTS_PER_RAD).rem_euclid(WRAP_COUNTS)]));
        let rest = (rest_s / CONTROL_PERIOD_S).round() as u32;
        let (mut largest, mut sum) = (0.0_f64, 0.0);
        for period in 0..rest {
            self.period();
            if period + 100 >= rest {
                let error = self.rig.angles[0] - to_rad;
                largest = largest.max(error.abs());
                sum += error / 100.0;
            }
        }
        (largest, sum.abs())
    }
}

/// The largest error at rest over `n` moves, rad.
fn worst_rest_rad(spec: &HydraulicsSpec, input: ActuatorInput, inertia: f64, load_ratio: f64, n: u32) -> (f64, f64) {
    let mut moves = stream_rng(7, "moves of a loop");
    let mut joint = Loop::new(spec, input, inertia, load_ratio, 7);
    (0..n).fold((0.0_f64, 0.0_f64), |worst, _| {
        let to_rad = moves.random_range(-0.9..0.9);
        let path_s = if moves.random_range(0.0..1.0) < 0.3 { 0.02 } else { moves.random_range(2.0..6.0) };
        let (largest, mean) = joint.rest_error_rad(to_rad, path_s, 8.0);
        (worst.0.max(largest), worst.1.max(mean))
    })
}

/// Rest angle of a joint: the mean over the last of eight seconds. It swings about it as the vehicle rocks its load.
#[test]
fn a_joint_rests_within_a_twentieth_of_a_degree_of_its_set_point() {
    let standard = HydraulicsSpec::default();
    let worlds = [
        ("without friction", slippery()),
        ("standard", standard),
        ("much stiction", HydraulicsSpec { coulomb_friction_ratio: 0.03, stiction_ratio: 0.05, ..standard }),
        ("leaky", HydraulicsSpec { leakage_rad_s: 1e-3, ..standard }),
        ("very leaky", HydraulicsSpec { leakage_rad_s: 5e-3, ..standard }),
        ("slow valve", HydraulicsSpec { valve_lag_s: 0.08, ..standard }),
    ];
    for (name, spec) in worlds {
        let mut worst = (0.0_f64, 0.0_f64);
        for (input, inertia) in [(SHOULDER, 50.0), (WRIST, 0.3)] {
            for load in [0.0, 0.6, -0.6] {
                let (largest, mean) = worst_rest_rad(&spec, input, inertia, load, 30);
                worst = (worst.0.max(largest), worst.1.max(mean));
            }
        }
        eprintln!("{name}: mean {:.4} deg, largest {:.4} deg", worst.1.to_degrees(), worst.0.to_degrees());
        assert!(worst.1 < LIMIT_RAD, "{name}: {} deg", worst.1.to_degrees());
    }
}

/// Without what it learns of the creep the controller cannot keep up with a leaky valve.
#[test]
fn learning_the_creep_is_what_holds_a_leaky_joint() {
    let spec = HydraulicsSpec { leakage_rad_s: 5e-3, ..HydraulicsSpec::default() };
    let deaf = HydraulicsSpec { controller_creep_gain: 0.0, ..spec };
    let [learns, does_not] = [spec, deaf].map(|spec| worst_rest_rad(&spec, SHOULDER, 50.0, -0.6, 10).1);
    eprintln!("learns {:.4} deg, does not {:.4} deg", learns.to_degrees(), does_not.to_degrees());
    assert!(learns < LIMIT_RAD && does_not > 1.2 * LIMIT_RAD);
}
