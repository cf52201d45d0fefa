//! A free rod on a shaken vehicle, simulated by the world, against the equation of motion.
//!
//! The comparison has two steps because the world draws its vehicle's motion itself. The integrator below reproduces
//! the golden file. The world's rod then follows that integrator under the motion that the truth reports.

use std::path::{Path, PathBuf};

use armcal::robot::{load, load_vehicle};
use armcal::routine::Scene;
use armcal::sim::truth::{TruthRecorder, read_truth};
use armcal::sim::{World, WorldInput, WorldSpec};
use armcal::streams::Arm;
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use super::golden;
use crate::support::{Nowhere, temp, write};

#[derive(Deserialize)]
struct Pendulum {
    mass_kg: f64,
    center_of_mass_to_hinge_m: f64,
    inertia_about_hinge_kg_m2: f64,
    amplitude_m: f64,
    frequency_hz: f64,
    phase_rad: f64,
    gravity_m_s2: f64,
    initial_angle_rad: f64,
    initial_rate_rad_s: f64,
    duration_s: f64,
    end_angle_rad: f64,
    samples: Vec<[f64; 3]>,
}

/// Integrates `angle'' = f(time, angle)` by Runge-Kutta 4 from `start` (angle, rate); passes (time, angle, rate) to
/// `each`.
fn integrate(
    f: impl Fn(f64, f64) -> f64,
    start: [f64; 2],
    step_s: f64,
    steps: u32,
    mut each: impl FnMut(f64, [f64; 2]),
) {
    let slope = |t: f64, [angle, rate]: [f64; 2]| [rate, f(t, angle)];
    let along = |[a, b]: [f64; 2], [da, db]: [f64; 2], h: f64| [a + h * da, b + h * db];
    let mut state = start;
    each(0.0, state);
    for k in 0..steps {
        let (t, h) = (f64::from(k) * step_s, step_s);
        let k1 = slope(t, state);
        let k2 = slope(t + 0.5 * h, along(state, k1, 0.5 * h));
        let k3 = slope(t + 0.5 * h, along(state, k2, 0.5 * h));
        let k4 = slope(t + h, along(state, k3, h));
        let mean = [0, 1].map(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0);
        state = along(state, mean, h);
        each(f64::from(k + 1) * step_s, state);
    }
}

#[test]
fn the_integrator_reproduces_the_golden_pendulum() {
    /// Tolerance, rad: the file itself is good to 1e-13, and its pendulum magnifies an early error sixfold.
    const TOLERANCE_RAD: f64 = 1e-9;
    let file: Pendulum = golden("pendulum.json");
    let w = std::f64::consts::TAU * file.frequency_hz;
    let lever = file.mass_kg * file.center_of_mass_to_hinge_m / file.inertia_about_hinge_kg_m2;
    let f = |t: f64, angle: f64| {
        let shake = -file.amplitude_m * w * w * (w * t + file.phase_rad).sin();
        -lever * (file.gravity_m_s2 * angle.sin() + shake * angle.cos())
    };
    let step_s = 1e-4;
    let steps = (file.duration_s / step_s).round() as u32;
    let (mut worst, mut end) = (0.0_f64, 0.0);
    integrate(f, [file.initial_angle_rad, file.initial_rate_rad_s], step_s, steps, |t, [angle, rate]| {
        end = angle;
        let sample = (t * 10.0).round();
        if (t * 10.0 - sample).abs() < 1e-6 {
            let [_, golden_angle, golden_rate] = file.samples[sample as usize];
            worst = worst.max((angle - golden_angle).abs()).max((rate - golden_rate).abs());
        }
    });
    assert!(worst < TOLERANCE_RAD && (end - file.end_angle_rad).abs() < TOLERANCE_RAD, "{worst} {end}");
}

/// Writes a rod of 1 m and 2 kg that swings about -y, so its angle counts from straight down towards +x. Its drive is
/// too weak to have an effect.
fn write_rod(folder: &Path, stowed_rad: f64) -> (PathBuf, PathBuf) {
    let urdf = r#"<robot name="rod">
        <link name="base_link"/>
        <link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
            <inertia ixx="0.16666666666666666" ixy="0" ixz="0" iyy="0.16666666666666666" iyz="0" izz="0.001"/>
        </inertial></link>
        <joint name="hinge" type="continuous"><parent link="base_link"/><child link="rod"/><axis xyz="0 -1 0"/>
            <limit effort="1e-9" velocity="1"/></joint>
    </robot>"#;
    let toml = format!(
        r#"version = 1
kind = "robot"
name = "rod"
urdf = "rod.urdf"
base_link = "base_link"
base_tag = 0
stowed_rad = [{stowed_rad}]
[tool]
link = "rod"
point_m = [0.0, 0.0, -1.0]
[[joint_sensor]]
joint = "hinge"
kind = "potentiometer"
offset_counts = 0.0
scale_counts_per_deg = 46.0
wrap_counts = 65536.0
gain_std = 0.03
offset_std_rad = 0.05
gain_bound = 0.05
offset_bound_rad = 0.0873
noise_std_counts = 2.0
linearity_std_rad = 0.0
max_rate_rad_s = 0.5
[camera]
name = "none"
link = "rod"
model = "equidistant"
resolution_px = [1224, 1024]
focal_px = [387.0, 387.0]
center_px = [612.0, 512.0]
distortion = [0.0, 0.0, 0.0, 0.0]
max_view_angle_rad = 1.4
corner_std_px = 0.3
mount_std_m = 0.002
mount_std_rad = 0.0035
"#
    );
    let vehicle = "version = 1\nkind = \"vehicle\"\nname = \"crate\"\nmass_kg = 4000.0\npart = []\n[mount]\n\
                   position_m = [0.0, 0.0, 0.0]\nquaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\n";
    write(&folder.join("rod.urdf"), urdf);
    write(&folder.join("robot.toml"), &toml);
    write(&folder.join("vehicle.toml"), vehicle);
    (folder.to_owned(), folder.join("vehicle.toml"))
}

const PERIOD_S: f64 = 2.0;

/// A vehicle that shakes in all three directions at 0.5 Hz and does not turn; no water, no errors.
fn shaken_dry_world() -> WorldSpec {
    let mut spec = WorldSpec::default();
    spec.physics.truth_rate_hz = 100.0;
    spec.joint_sensors.gain_error_max = 0.0;
    spec.joint_sensors.offset_error_max_rad = 0.0;
    spec.joint_sensors.nonlinearity_peak = 0.0;
    spec.joint_sensors.temperature_offset_std_rad_per_k = 0.0;
    spec.joint_sensors.temperature_gain_std_per_k = 0.0;
    spec.vehicle.rotation_rms_rad = 0.0;
    spec.vehicle.translation_rms_m = 0.2;
    spec.vehicle.period_min_s = PERIOD_S;
    spec.vehicle.period_max_s = PERIOD_S;
    spec.vehicle.ramp_s = 0.0;
    spec.water.density_kg_m3 = 0.0;
    spec.water.drag_coefficient = 0.0;
    spec.water.joint_friction_n_m_s_rad = 0.0;
    spec
}

/// Amplitudes of `a sin + b cos` per direction, from the truth's vehicle poses.
fn fitted_shake(times_s: &[f64], positions_m: &[[f64; 3]]) -> [[f64; 2]; 3] {
    let w = std::f64::consts::TAU / PERIOD_S;
    let basis = DMatrix::from_fn(times_s.len(), 2, |row, column| {
        let (sin, cos) = (w * times_s[row]).sin_cos();
        if column == 0 { sin } else { cos }
    });
    let solver = basis.clone().svd(true, true);
    [0, 1, 2].map(|axis| {
        let positions = DVector::from_fn(times_s.len(), |row, _| positions_m[row][axis]);
        let fit = solver.solve(&positions, 1e-12).expect("two columns that differ");
        assert!((&basis * &fit - positions).amax() < 1e-9, "the vehicle moves in one sinusoid per direction");
        [fit[0], fit[1]]
    })
}

/// A swing in the truth file: the rod's angles, and the vehicle's positions from which `times_s` count.
struct Swing {
    times_s: Vec<f64>,
    angles_rad: Vec<f64>,
    positions_m: Vec<[f64; 3]>,
}

/// Start straight down, because the weak drive must carry the rod at the start.
const START_RAD: f64 = 0.0;
const DURATION_S: f64 = 8.0;

fn swing(folder: &Path, step_s: f64, seed: u64) -> Swing {
    let (robot, vehicle) = write_rod(folder, START_RAD);
    let (robot, vehicle) = (load(&robot).expect("the rod reads"), load_vehicle(&vehicle).expect("the vehicle reads"));
    let mut spec = shaken_dry_world();
    spec.physics.step_s = step_s;
    let scene = Scene::default();
    let input = WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed };
    let mut world = World::new(input).expect("a world");
    let file = folder.join("truth.mcap");
    world.set_truth_sink(Box::new(TruthRecorder::create(&file).expect("a file"))).expect("accepted");
    let start = world.now();
    Nowhere::watch(&mut world, DURATION_S);
    world.finish_truth().expect("finished");
    let states = read_truth(&file).expect("the truth reads").states;
    Swing {
        times_s: states.iter().map(|s| s.stamp.since_s(start)).collect(),
        angles_rad: states.iter().map(|s| s.angles[0]).collect(),
        positions_m: states.iter().map(|s| s.world_from_vehicle.origin().to_array()).collect(),
    }
}

/// The rod's angles by its equation of motion, every millisecond, under the vehicle's motion of `swing`.
fn expected_rad(swing: &Swing) -> Vec<f64> {
    let [x, _, z] = fitted_shake(&swing.times_s, &swing.positions_m);
    let w = std::f64::consts::TAU / PERIOD_S;
    let acceleration = |[a, b]: [f64; 2], t: f64| -w * w * (a * (w * t).sin() + b * (w * t).cos());
    // A rod about its end has m l / I = 3/2 per m. Gravity is the world's.
    let f =
        |t: f64, angle: f64| -1.5 * ((9.806_65 + acceleration(z, t)) * angle.sin() + acceleration(x, t) * angle.cos());
    let mut angles = Vec::new();
    integrate(f, [START_RAD, 0.0], 1e-3, (DURATION_S * 1e3) as u32, |_, [angle, _]| angles.push(angle));
    angles
}

fn expect_a_rod_to_swing_as_its_equation_of_motion_says(seeds: std::ops::RangeInclusive<u64>) {
    /// Finer step, s. The engine's step is of first order, so twice the fine result less the coarse one cancels its
    /// error.
    const STEP_S: f64 = 2e-4;
    /// Tolerance over 8 s of the remaining error, rad; 5e-5 where the rod goes over the top.
    const TOLERANCE_RAD: f64 = 5e-4;
    let folder = temp();
    for seed in seeds {
        let [coarse, fine] = [STEP_S, 0.5 * STEP_S].map(|step_s| swing(folder.path(), step_s, seed));
        assert_eq!(coarse.times_s.len(), (DURATION_S * 100.0) as usize);
        let shaken = expected_rad(&fine);
        let (mut worst, mut worst_fine, mut moved) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (k, t) in fine.times_s.iter().enumerate() {
            let at = (t * 1e3).round() as usize;
            let limit = 2.0 * fine.angles_rad[k] - coarse.angles_rad[k];
            worst = worst.max((limit - shaken[at]).abs());
            worst_fine = worst_fine.max((fine.angles_rad[k] - shaken[at]).abs());
            moved = moved.max(shaken[at].abs());
        }
        eprintln!("seed {seed}: off by {worst_fine:.1e} rad, {worst:.1e} in the limit; it swings {moved:.2} rad");
        assert!(moved > 0.3, "seed {seed}: it must swing: {moved}");
        assert!(worst < TOLERANCE_RAD, "seed {seed}: {worst}");
    }
}

#[test]
fn the_world_swings_a_free_rod_as_its_equation_of_motion_says() {
    expect_a_rod_to_swing_as_its_equation_of_motion_says(1..=1);
}

#[test]
#[ignore = "second tier: two more seeds, 2 s"]
fn the_world_swings_more_free_rods_as_their_equations_of_motion_say() {
    expect_a_rod_to_swing_as_its_equation_of_motion_says(2..=3);
}
