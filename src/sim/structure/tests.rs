//! Arms at rest compared with closed forms, and a swinging arm with MuJoCo.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use crate::dynamics::{
    BaseCoupling, Body, Environment, Force, JointLoad, Motion, Multibody, Stage, StepInput, SystemState,
    WaterProperties,
};
use crate::spec::{StructureSpec, WaterSpec};
use crate::structure::FlexibleArm;
use crate::structure::joint_shaft::JointShaft;
use armcal_core::kinematics::{Attachment, Chain, ChainJoint};
use armcal_core::robot::{Robot, load};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const G: f64 = 9.806_65;
const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -G);

/// Returns a joint about y, `at_m` along its parent's x axis: positive angles turn the link down.
fn joint(name: &str, at_m: f64) -> ChainJoint {
    ChainJoint {
        name: name.to_owned(),
        child_link: format!("{name} link"),
        kind: armcal_core::kinematics::JointKind::Revolute,
        parent_from_joint: Isometry3::translation(at_m, 0.0, 0.0),
        axis: Unit::new_normalize(Vector3::y()),
        limits: None,
    }
}

fn link(mass_kg: f64, center_m: f64, inertia_kg_m2: f64) -> Body {
    Body::dry(mass_kg, Vector3::new(center_m, 0.0, 0.0), &(Matrix3::identity() * inertia_kg_m2))
}

const MASS_KG: f64 = 80.0;
const CENTER_M: f64 = 1.1;
const ROOT_M: f64 = 0.3;

/// Returns an arm with one link that stands out from the base.
fn cantilever() -> Robot {
    let mut robot = load(&Path::new(ROOT).join("robots/titan4")).expect("the robot reads");
    robot.chain = Chain::new(vec![joint("root", ROOT_M)]);
    robot.bodies.truncate(2);
    robot.tool.mount = Attachment { n_joints: 1, link_from_frame: Isometry3::translation(2.0, 0.0, 0.0) };
    robot
}

/// Returns the equilibrium with the sensor at `shaft_rad`: the link's angle and the base's turn.
fn hangs(spec: &StructureSpec, bodies: Vec<Body>, shaft_rad: f64) -> (f64, f64) {
    let mut arm = FlexibleArm::new(spec, &cantilever(), bodies, 0.002);
    let balance = arm.settle(&JointAngles::from_slice(&[shaft_rad]), &DOWN);
    (balance.angles[0], arm.first_place().rotation.scaled_axis().y)
}

fn soft(compliance: f64) -> StructureSpec {
    let mut spec = StructureSpec::default();
    spec.joint_compliance_rad_per_nm.insert("root".to_owned(), compliance);
    spec
}

/// Returns the fixed point of `next`, which contracts.
fn fixed_point<const N: usize>(next: impl Fn([f64; N]) -> [f64; N]) -> [f64; N] {
    (0..500).fold([0.0; N], |at, _| next(at))
}

fn assert_near(value: f64, expected: f64, what: &str) {
    assert!((value - expected).abs() <= 1e-9 * expected.abs(), "{what}: {value} for {expected}");
}

/// The equilibrium follows `theta = q + c m g l cos(theta)`.
#[test]
fn a_cantilever_on_a_soft_joint_hangs_by_its_closed_form() {
    for (shaft_rad, compliance) in [(0.0, 1e-5), (0.4, 1e-4), (-0.7, 3e-5)] {
        let (angle, _) = hangs(&soft(compliance), vec![Body::none(), link(MASS_KG, CENTER_M, 5.0)], shaft_rad);
        let [sag] = fixed_point(|[sag]| [compliance * MASS_KG * G * CENTER_M * (shaft_rad + sag).cos()]);
        assert_near(angle - shaft_rad, sag, "sag");
    }
}

/// The link falls to the lower end of its backlash and deflects there.
#[test]
fn bearing_play_lets_it_hang_on_the_lower_side() {
    let mut spec = soft(1e-5);
    spec.bearing_play_rad.insert("root".to_owned(), 4e-3);
    let (angle, _) = hangs(&spec, vec![Body::none(), link(MASS_KG, CENTER_M, 5.0)], 0.1);
    let [sag] = fixed_point(|[sag]| [2e-3 + 1e-5 * MASS_KG * G * CENTER_M * (0.1 + sag).cos()]);
    assert_near(angle - 0.1, sag, "sag");
}

/// The base's own weight loads the mount, too. The mount's turn lowers the root and adds to the joint's.
#[test]
fn a_cantilever_on_a_soft_mount_hangs_by_its_closed_form() {
    let mut spec = soft(2e-5);
    spec.mount_compliance_rad_per_nm = [0.0, 3e-5, 0.0];
    spec.mount_compliance_m_per_n = [0.0, 0.0, 1e-6];
    let bodies = vec![link(16.0, -0.2, 1.0), link(MASS_KG, CENTER_M, 5.0)];
    let (angle, turn) = hangs(&spec, bodies, 0.2);
    let weight_n = MASS_KG * G;
    let [theta, psi] = fixed_point(|[theta, psi]: [f64; 2]| {
        let lever_m = CENTER_M * (psi + theta).cos();
        let on_mount = weight_n * (ROOT_M * psi.cos() + lever_m) - 16.0 * G * 0.2;
        [0.2 + 2e-5 * weight_n * lever_m, 3e-5 * on_mount]
    });
    assert_near(angle - 0.2, theta - 0.2, "joint");
    assert_near(turn, psi, "mount");
}

/// A ball of steel at the tool point weighs less by the water that it displaces.
#[test]
fn a_payload_hangs_by_its_weight_in_water() {
    let mut robot = cantilever();
    robot.tool.mount.link_from_frame = Isometry3::translation(1.5, 0.0, 0.0);
    let mut world = crate::spec::WorldSpec { structure: soft(1e-5), ..Default::default() };
    (world.structure.payload_kg, world.structure.payload_offset_m) = (25.0, [0.5, 0.0, 0.0]);
    let (body, payload) = crate::structure::payload(&world, &robot).expect("a payload");
    let mut bodies = vec![Body::none(), link(MASS_KG, CENTER_M, 5.0)];
    bodies[body].carry(&payload);
    let (angle, _) = hangs(&world.structure, bodies, 0.0);
    let moment_kg_m = MASS_KG * CENTER_M + 25.0 * (1.0 - 1025.0 / 7850.0) * 2.0;
    let [sag] = fixed_point(|[sag]: [f64; 1]| [1e-5 * G * moment_kg_m * sag.cos()]);
    assert_near(angle, sag, "sag");
}

/// A hose from straight above its point, stretched by 0.2 m, carries part of the weight.
#[test]
fn a_hose_lifts_what_it_is_tied_to() {
    let mut spec = soft(1e-5);
    spec.hose_link = cantilever().bodies[1].name.clone();
    (spec.hose_point_m, spec.hose_anchor_m) = ([2.0, 0.0, 0.0], [ROOT_M + 2.0, 0.0, 1.2]);
    (spec.hose_length_m, spec.hose_stiffness_n_m) = (1.0, 500.0);
    let (angle, _) = hangs(&spec, vec![Body::none(), link(MASS_KG, CENTER_M, 5.0)], 0.0);
    let [sag] = fixed_point(|[sag]: [f64; 1]| {
        let (point, anchor) = ([2.0 * sag.cos(), -2.0 * sag.sin()], [2.0, 1.2]);
        let line = [anchor[0] - point[0], anchor[1] - point[1]];
        let long = line[0].hypot(line[1]);
        let pull = [0, 1].map(|i| 500.0 * (long - 1.0) * line[i] / long);
        let lifting = point[0] * pull[1] - point[1] * pull[0];
        [1e-5 * (MASS_KG * G * CENTER_M * sag.cos() - lifting)]
    });
    assert_near(angle, sag, "sag");
}

/// Two links swung in the plane by drives, each through a compliant shaft. `tests/oracle/make_structure_golden.py` has
/// the same values.
struct Swing {
    shafts: [JointShaft; 2],
    state: SystemState,
    step_s: f64,
}

const DRIVE_N_M_RAD: [f64; 2] = [4e4, 1.5e4];
const DAMPING_N_M_S_RAD: [f64; 2] = [400.0, 150.0];

/// Returns the rest angle of a drive, and its rate.
fn rest(j: usize, t_s: f64) -> (f64, f64) {
    let (turn, swing_rad) = (std::f64::consts::TAU / 1.2, [0.25, -0.35][j]);
    let start_rad = [0.3, -0.6][j];
    if t_s >= 1.2 {
        return (start_rad, 0.0);
    }
    (start_rad + swing_rad * 0.5 * (1.0 - (turn * t_s).cos()), 0.5 * swing_rad * turn * (turn * t_s).sin())
}

impl Swing {
    /// Starts from the angles of links and shafts at rest.
    fn new(row: &[f64], step_s: f64) -> Self {
        let mut shafts = [JointShaft::new(2e-5, 0.0), JointShaft::new(6e-5, 0.0)];
        for (j, shaft) in shafts.iter_mut().enumerate() {
            shaft.settle((row[3 + j] - row[1 + j]) / [2e-5, 6e-5][j]);
        }
        let state = SystemState {
            angles: JointAngles::from_slice(&row[1..3]),
            rates: JointAngles::zeros(2),
            world_from_base: Isometry3::identity(),
            base_velocity: Motion::zero(),
        };
        Self { shafts, state, step_s }
    }

    fn step(&mut self, arm: &Multibody, t_s: f64) {
        let mut loads = [JointLoad::default(); MAX_JOINTS];
        for (j, shaft) in self.shafts.iter_mut().enumerate() {
            let (at, rate) = rest(j, t_s + 0.5 * self.step_s);
            let drive = JointLoad::spring(DRIVE_N_M_RAD[j], DAMPING_N_M_S_RAD[j], at, rate);
            let link = [self.state.angles[j], self.state.rates[j]];
            loads[j] = shaft.load(drive, link, self.step_s);
        }
        let held = |_: Stage, _: &SystemState| (Environment::still(G), BaseCoupling::Prescribed(Motion::zero()));
        let extra = [Force::zero(); MAX_JOINTS + 1];
        let (step_s, contacts) = (self.step_s, &[]);
        let input = StepInput { step_s, loads: &loads, extra: &extra, contacts, is_free: false, around: &held };
        arm.step(&mut self.state, &input);
        for (j, shaft) in self.shafts.iter_mut().enumerate() {
            shaft.follow(self.state.angles[j], self.state.rates[j], self.step_s);
        }
    }
}

/// Returns the largest differences of links, and of shafts, from MuJoCo's, rad.
fn differences(steps_per_sample: u32) -> [f64; 2] {
    let text = std::fs::read_to_string(Path::new(ROOT).join("tests/golden/structure.csv")).expect("the golden file");
    let rows: Vec<Vec<f64>> =
        text.lines().skip(2).map(|line| line.split(',').map(|v| v.parse().expect("a figure")).collect()).collect();
    let chain = Chain::new(vec![joint("a", 0.0), joint("b", 0.8)]);
    let arm = Multibody::new(chain, vec![Body::none(), link(25.0, 0.4, 1.5), link(15.0, 0.35, 0.6)]);
    let mut swing = Swing::new(&rows[0], 0.05 / f64::from(steps_per_sample));
    let mut worst = [0.0_f64; 2];
    for row in &rows[1..] {
        for step in 0..steps_per_sample {
            swing.step(&arm, row[0] - 0.05 + f64::from(step) * swing.step_s);
        }
        for j in 0..2 {
            let angle = swing.state.angles[j];
            worst[0] = worst[0].max((angle - row[1 + j]).abs());
            worst[1] = worst[1].max((angle + swing.shafts[j].twist_rad - row[3 + j]).abs());
        }
    }
    worst
}

/// The links deflect by up to 10 mrad behind their shafts. The step's error is of second order.
#[test]
fn a_swinging_arm_bends_as_mujocos() {
    let (standard, finer, finest) = (differences(25), differences(50), differences(1600));
    eprintln!("links and shafts, rad: {standard:?} at 2 ms, {finer:?} at 1 ms, {finest:?} at 31 us");
    for side in 0..2 {
        assert!(standard[side] < 1e-4 && finest[side] < 1e-7, "{standard:?} {finest:?}");
        assert!(finer[side] < 0.35 * standard[side], "it converges: {standard:?} {finer:?}");
    }
}

/// A joint that swings through its backlash is carried on neither side for a time, and rests on one side at the end.
#[test]
fn a_shaft_in_its_play_carries_nothing() {
    let (mut shaft, step_s) = (JointShaft::new(1e-5, 4e-3), 1e-3);
    shaft.settle(100.0);
    // The drive holds the shaft at 0; the link moves from below it to above it.
    let drive = JointLoad::spring(1e5, 1e3, 0.0, 0.0);
    let torque = |shaft: &mut JointShaft, angle_rad: f64| {
        let load = shaft.load(drive, [angle_rad, 0.0], step_s);
        shaft.follow(angle_rad, 0.0, step_s);
        load.torque_n_m(angle_rad, 0.0)
    };
    for (angle_rad, expected) in [(-5e-3, 3e-3), (0.0, 0.0), (1e-3, 0.0), (5e-3, -3e-3)] {
        let mut carried = 0.0;
        for _ in 0..200 {
            carried = torque(&mut shaft, angle_rad);
        }
        // Half the stiffness of drive and shaft, each 1e5.
        assert!((carried - 0.5e5 * expected).abs() < 1e-3, "{angle_rad}: {carried}");
        assert!((angle_rad + shaft.twist_rad + carried / 1e5).abs() < 1e-8, "the drive gives, too: {shaft:?}");
    }
}

/// The water displaced by a ball in the simulator's standard water.
#[test]
fn a_ball_displaces_its_volume() {
    let water = WaterProperties::of(&WaterSpec::default());
    let ball = Body::ball(785.0, 7850.0, &Vector3::zeros(), &water);
    assert!((ball.displaced_kg - 102.5).abs() < 1e-9);
    assert!((ball.added.linear[(0, 0)] - 51.25).abs() < 1e-9, "half the displaced water");
}
