//! Where the time goes: kinematics, the objective, the solver, clearance, one simulated second.
//!
//! `cargo bench --bench speed`. Compare figures of one run only; machines differ and are noisy.

use std::hint::black_box;
use std::path::Path;

use armcal::calib::{JointParameters, Parameter, ParameterKind, PositionProblem, TagView, View, minimum_distance};
use armcal::plan::{ClearanceModel, JointErrorBounds};
use armcal::robot::{Robot, Vehicle, load, load_vehicle};
use armcal::routine::Scene;
use armcal::stats::stream_rng;
use armcal::streams::JointAngles;
use armcal::time::SIMULATION_EPOCH;
use criterion::{Criterion, criterion_group, criterion_main};
use rand::RngExt;

const N_VIEWS: u32 = 40;
const TAGS_A_VIEW: usize = 6;

fn robot() -> Robot {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4")).expect("the robot is part of the repository")
}

fn vehicle() -> Vehicle {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/vehicles/work-class-front.toml");
    load_vehicle(&file).expect("the vehicle is part of the repository")
}

fn random_angles(robot: &Robot, rng: &mut rand_chacha::ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |j| {
        let limits = robot.chain.joints()[j].limits;
        limits.map_or(0.0, |l| rng.random_range(l.lower_rad..=l.upper_rad))
    })
}

/// Views of an arm whose sensors are 2 % and 2 deg off, with 3 mm of noise on each tag's position.
fn views(robot: &Robot) -> Vec<View> {
    let mut rng = stream_rng(1, "bench");
    (0..N_VIEWS)
        .map(|pose_idx| {
            let angles = random_angles(robot, &mut rng);
            let camera_from_base = robot.chain.link_poses(&angles).frame(&robot.camera.mount).inverse();
            let tag = |tag_idx: usize, noise_m: [f64; 3]| {
                let center =
                    camera_from_base * nalgebra::Point3::from(robot.tags[tag_idx].base_from_tag.origin().vector());
                TagView {
                    id: robot.tags[tag_idx].id,
                    tag_idx,
                    center_in_camera_m: center.coords + nalgebra::Vector3::from(noise_m),
                    corners_px: [[0.0; 2]; 4],
                    n_frames: 1,
                }
            };
            let tags = (0..TAGS_A_VIEW).map(|t| tag(t, [0; 3].map(|_| rng.random_range(-0.003..0.003)))).collect();
            let travel_rad =
                JointAngles::from_fn(robot.n_joints(), |j| (angles[j] - robot.sensors[j].center_rad - 0.035) / 1.02);
            View { pose_idx, end: SIMULATION_EPOCH, travel_rad, tags }
        })
        .collect()
}

fn calibration(c: &mut Criterion) {
    let robot = robot();
    let views = views(&robot);
    let problem = PositionProblem::new(&robot, &views);
    let free: Vec<Parameter> = (0..robot.camera.mount.n_joints)
        .flat_map(|joint| [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind }))
        .collect();
    let angles = views[0].travel_rad;
    c.bench_function("forward kinematics", |b| b.iter(|| robot.chain.link_poses(black_box(&angles))));
    c.bench_function("sum of distances, 40 x 6", |b| {
        b.iter(|| problem.sum_of_distances_m(black_box(&JointParameters::default())));
    });
    c.bench_function("minimum distance by BOBYQA, 40 x 6", |b| {
        b.iter(|| minimum_distance(black_box(&problem), &free, &JointParameters::default()))
    });
}

fn planning(c: &mut Criterion) {
    let (robot, vehicle) = (robot(), vehicle());
    let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() };
    let clearance = ClearanceModel::new(&robot, &vehicle, &scene);
    let bounds = JointErrorBounds::prior(&robot);
    c.bench_function("clearance of one arm", |b| b.iter(|| clearance.nearest(black_box(&robot.stowed))));
    let mut rng = stream_rng(1, "bench poses");
    let poses: Vec<JointAngles> = (0..256).map(|_| random_angles(&robot, &mut rng)).collect();
    c.bench_function("256 poses, clear for every arm within the bounds?", |b| {
        b.iter(|| poses.iter().filter(|at| clearance.too_near(at, black_box(&bounds), 0.05).is_none()).count());
    });
    c.bench_function("256 edges, clear for every arm within the bounds?", |b| {
        b.iter(|| {
            let is_clear = |edge: &&[JointAngles]| {
                clearance.too_near_between(&edge[0], &edge[1], black_box(&bounds), 0.05).is_none()
            };
            poses.windows(2).filter(is_clear).count()
        });
    });
}

#[cfg(feature = "sim")]
fn simulation(c: &mut Criterion) {
    use armcal::sim::{World, WorldInput, WorldSpec};
    use armcal::streams::{Arm, Message, Sink, SinkError};

    struct Nothing;
    impl Sink for Nothing {
        fn record(&mut self, _: armcal::time::Stamp, _: &Message) -> Result<(), SinkError> {
            Ok(())
        }
    }
    let (robot, vehicle) = (robot(), vehicle());
    let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() };
    let spec = WorldSpec::default();
    let input = WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed: 1 };
    let mut world = World::new(input).expect("the standard world");
    c.bench_function("one simulated second", |b| {
        b.iter(|| (0..100).for_each(|_| world.step(&mut Nothing).expect("a sink that takes everything")));
    });
    // Current, waves, a free vehicle, and the arm always on its way.
    let mut spec = WorldSpec::default();
    spec.vehicle.motion = armcal::sim::MotionKind::Free;
    spec.water.current_m_s = [0.2, 0.1, 0.0];
    (spec.water.wave_height_m, spec.water.depth_m) = (2.0, 20.0);
    spec.hydraulics.leakage_rad_s = 1e-3;
    let mut world = World::new(WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed: 1 })
        .expect("a world with everything on");
    let sensors = armcal::sensor::ArmSensors::nominal(&robot);
    let mut second = 0_u32;
    c.bench_function("physics: one second, all effects", |b| {
        b.iter(|| {
            second += 1;
            let shift = if second.is_multiple_of(2) { -0.15 } else { 0.15 };
            let goal = JointAngles::from_fn(robot.n_joints(), |j| robot.stowed[j] + shift);
            world.command(&sensors.counts(&goal)).expect("a set-point");
            (0..100).for_each(|_| world.step(&mut Nothing).expect("a sink that takes everything"));
        });
    });
    one_step(c, &robot);
}

/// The arm on its oil columns in sea water, without sensors, hydraulics or contacts.
#[cfg(feature = "sim")]
fn one_step(c: &mut Criterion, robot: &Robot) {
    use armcal::sim::dynamics::{
        BaseCoupling, Body, Force, JointLoad, Motion, Multibody, Stage, StepInput, Surroundings, SystemState,
    };
    use armcal::streams::MAX_JOINTS;

    let bodies = robot.bodies.iter().map(|link| Body::in_sea_water(link, robot.buoyancy_fraction)).collect();
    let arm = Multibody::new(robot.chain.clone(), bodies);
    let mut state = SystemState {
        angles: robot.stowed,
        rates: JointAngles::from_fn(robot.n_joints(), |_| 0.0),
        world_from_base: nalgebra::Isometry3::identity(),
        base_velocity: Motion::zero(),
    };
    let loads = std::array::from_fn(|j| {
        JointLoad::spring(5e4, 500.0, if j < robot.n_joints() { robot.stowed[j] } else { 0.0 }, 0.0)
    });
    let around = |_: Stage, _: &SystemState| (Surroundings::still(9.806_65), BaseCoupling::Prescribed(Motion::zero()));
    c.bench_function("dynamics: one step", |b| {
        b.iter(|| {
            let input = StepInput {
                step_s: 0.002,
                loads: &loads,
                extra: &[Force::zero(); MAX_JOINTS + 1],
                contacts: &[],
                is_free: false,
                around: &around,
            };
            arm.step(black_box(&mut state), &input);
        });
    });
}

#[cfg(not(feature = "sim"))]
fn simulation(_: &mut Criterion) {}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = calibration, planning, simulation
}
criterion_main!(benches);
