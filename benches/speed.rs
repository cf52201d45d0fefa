//! Time of the parts: kinematics, the objective, the solver, the tag map, clearance, one simulated second.
//!
//! `cargo bench --bench speed`. Compare figures of one run only; machines differ and are noisy.

use std::hint::black_box;
use std::path::Path;

use armcal::calib::online::{DriftModel, FaultSearch, OnlineEstimator, OnlineSettings, ViewStream};
use armcal::calib::{
    PositionMethod, PositionProblem, SearchOptions, TagMeasurement, TagObservation, View, minimum_distance,
};
use armcal::log::read_recording;
use armcal::model::{JointParameters, Parameter, ParameterKind};
use armcal::plan::{ClearanceModel, Edge, JointErrorBounds};
use armcal::robot::{Robot, Vehicle, load, load_vehicle};
use armcal::routine::Scene;
use armcal::sensor::Conditions;
use armcal::stats::stream_rng;
use armcal::streams::JointAngles;
use armcal::time::SIMULATION_EPOCH;
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
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
                TagObservation {
                    id: robot.tags[tag_idx].id,
                    tag_idx,
                    center_in_camera_m: center.coords + nalgebra::Vector3::from(noise_m),
                    measured: TagMeasurement::Position,
                }
            };
            let tags = (0..TAGS_A_VIEW).map(|t| tag(t, [0; 3].map(|_| rng.random_range(-0.003..0.003)))).collect();
            let travel_rad =
                JointAngles::from_fn(robot.n_joints(), |j| (angles[j] - robot.sensors[j].center_rad - 0.035) / 1.02);
            View { tags, ..View::of_reading(pose_idx, SIMULATION_EPOCH, travel_rad) }
        })
        .collect()
}

fn calibration(c: &mut Criterion) {
    online(c, &robot());
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
    // The search ends at 1e-6 of a prior sigma; the other methods have the same data.
    let options = SearchOptions { rho_end: 1e-6, ..SearchOptions::default() };
    let without_gauge = &free[..1].iter().chain(&free[2..]).copied().collect::<Vec<_>>();
    for (name, method, free) in [
        ("minimum distance by BOBYQA to 1e-6, 40 x 6", PositionMethod::MinimumDistance, &free),
        ("minimum variance by BOBYQA to 1e-6, 40 x 6", PositionMethod::MinimumVariance, without_gauge),
        ("least squares, 40 x 6", PositionMethod::LeastSquares, &free),
    ] {
        c.bench_function(name, |b| {
            b.iter(|| method.solve(black_box(&problem), free, &JointParameters::default(), &options));
        });
    }
}

fn planning(c: &mut Criterion) {
    let (robot, vehicle) = (robot(), vehicle());
    let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() };
    let clearance = ClearanceModel::new(&robot, &vehicle, &scene);
    let bounds = JointErrorBounds::datasheet(&robot);
    c.bench_function("clearance of one arm", |b| b.iter(|| clearance.nearest(black_box(&robot.stowed))));
    let mut rng = stream_rng(1, "bench poses");
    let poses: Vec<JointAngles> = (0..256).map(|_| random_angles(&robot, &mut rng)).collect();
    c.bench_function("256 poses, clear for every arm within the bounds?", |b| {
        b.iter(|| poses.iter().filter(|at| clearance.find_violation(at, black_box(&bounds), 0.05).is_none()).count());
    });
    c.bench_function("256 edges, clear for every arm within the bounds?", |b| {
        b.iter(|| {
            let is_clear = |edge: &&[JointAngles]| {
                clearance
                    .find_violation_along(&Edge::at_full_speed(edge[0], edge[1]), black_box(&bounds), 0.05)
                    .is_none()
            };
            poses.windows(2).filter(is_clear).count()
        });
    });
    choice(c, &robot, &clearance, &bounds);
}

/// Choice of 30 of 5,000 candidates: information of each, greedy choice, exchange, order and forecast.
fn choice(c: &mut Criterion, robot: &Robot, clearance: &ClearanceModel<'_>, bounds: &JointErrorBounds) {
    use armcal::plan::{PosePool, PoseRequest, VisibilityModel};

    let capture: armcal::routine::CaptureSettings = toml::from_str("poses = 30\nheld_out = 0").expect("settings");
    let mut rng = stream_rng(1, "bench choice");
    let task: Vec<JointAngles> = (0..14)
        .map(|_| {
            let angle = |j: usize, rng: &mut rand_chacha::ChaCha8Rng| {
                let spec = &robot.sensors[j];
                spec.center_rad + rng.random_range(-0.6..0.6) * spec.half_range_rad
            };
            JointAngles::from_fn(robot.n_joints(), |j| angle(j, &mut rng))
        })
        .collect();
    let visibility = VisibilityModel::default();
    let request = PoseRequest {
        robot,
        clearance,
        bounds,
        visibility: &visibility,
        capture: &capture,
        n_fit: 30,
        n_held_out: 0,
        belief: None,
        taken: &[],
        prior: None,
        known: None,
        detection_rate: &[],
        failed: &[],
        task: &task,
        targets_m: &[],
        start: &robot.stowed,
    };
    let pool = PosePool::gather(&request, 5000, &mut rng).expect("candidates");
    assert_eq!(pool.len(), 5000);
    c.bench_function("choice of 30 poses out of 5000", |b| {
        b.iter(|| pool.choose(black_box(&request), &mut stream_rng(1, "choice")).expect("a plan").arm_time_s);
    });
    c.bench_function("100 candidates: drawn, seen, clear", |b| {
        b.iter(|| PosePool::gather(black_box(&request), 100, &mut stream_rng(1, "pool")).expect("candidates").len());
    });
}

/// Tag map from 300 images of up to 8 tags through the wrist camera, 0.3 px of noise; from pixels to map with
/// covariances.
fn tag_map(c: &mut Criterion) {
    use armcal::tagmap::{Body, MapDetection, MapInput, MapSettings, MapView, TagPrior, solve};
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

    let lens = robot().camera.lens;
    let mut rng = stream_rng(1, "bench tag map");
    let tags: Vec<Isometry3<f64>> = (0..8)
        .map(|k| {
            let lean = Vector3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), 0.0);
            let place = Translation3::new(0.4 * f64::from(k % 4) - 0.6, 0.4 * f64::from(k / 4) - 0.2, 0.0);
            Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(lean))
        })
        .collect();
    let view = |k: i64, rng: &mut rand_chacha::ChaCha8Rng| {
        let mut draw = |size: f64| rng.random_range(-size..size);
        let turn = Vector3::new(draw(0.4), draw(0.4), draw(3.0));
        let place = Translation3::new(draw(0.6), draw(0.5), 1.2 + draw(0.3));
        let face = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
        let camera = Isometry3::from_parts(place, face * UnitQuaternion::from_scaled_axis(turn)).inverse();
        let seen = (0_u32..).zip(&tags).filter_map(|(id, tag)| {
            let mut corners_px = [[0.0; 2]; 4];
            for (pixel, corner) in corners_px.iter_mut().zip(armcal::optics::square_corners(0.15)) {
                let exact = lens.project(&(camera * tag * corner).coords).filter(|pixel| lens.contains(pixel))?;
                *pixel = [exact.x + draw(0.5), exact.y + draw(0.5)];
            }
            Some(MapDetection { id, corners_px, covariance_px2: None })
        });
        let stamp = armcal::time::Stamp { nanos: k };
        MapView { camera: 0, stamp, tags: seen.collect(), attitude: None }
    };
    let views: Vec<MapView> = (0..300).map(|k| view(k, &mut rng)).collect();
    let bodies = [Body { name: "base".to_owned(), is_static: true, pose: None }];
    let prior = |(id, pose): (u32, &Isometry3<f64>)| TagPrior {
        id,
        size_m: 0.15,
        body: 0,
        pose: (id == 0).then_some(*pose),
        std: None,
    };
    let priors: Vec<TagPrior> = (0_u32..).zip(&tags).map(prior).collect();
    let cameras = [lens];
    let input = MapInput { cameras: &cameras, views: &views, bodies: &bodies, tags: &priors };
    let settings = MapSettings { base_tag: Some(0), ..MapSettings::default() };
    c.bench_function("tagmap: 300 images of up to 8 tags", |b| b.iter(|| solve(black_box(&input), &settings)));
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
    // The world has current, waves, a free vehicle, and an arm that always moves.
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
    images(c, &robot, &vehicle, &scene);
}

/// The wrist camera's view of the stowed arm, the vehicle and its tags, at half and at full resolution, without and
/// with detection.
#[cfg(feature = "sim")]
fn images(c: &mut Criterion, robot: &Robot, vehicle: &Vehicle, scene: &Scene) {
    use armcal::detect::{DetectorSettings, GreyImage, TagDetector};
    use armcal::optics::{CameraModel, Fisheye, LensModel};
    use armcal::robot::PlacedShape;
    use armcal::sim::imaging::{ImageSpec, Imager, Light, Shot, SolidShape, TagPlane};

    let base_from_vehicle = *vehicle.vehicle_from_base.inverse().isometry();
    let links = robot.chain.link_poses(&robot.stowed);
    let on_link = |body: usize, placed: &PlacedShape| (*links.link(body) * placed.owner_from_shape, placed.clone());
    let camera_body = robot.camera.mount.n_joints;
    let of_arm = robot.bodies.iter().enumerate().filter(|(body, _)| *body != camera_body);
    let arm = of_arm.flat_map(|(body, link)| link.visuals.iter().map(move |placed| on_link(body, placed)));
    let parts = vehicle.parts.iter().map(|p| (base_from_vehicle * p.placed.owner_from_shape, p.placed.clone()));
    let (poses, shapes): (Vec<_>, Vec<_>) = arm
        .chain(parts)
        .map(|(pose, placed)| {
            ([pose; 3], SolidShape { shape: placed.shape, color_rgb: placed.color_rgb, is_ground: false })
        })
        .unzip();
    assert!(scene.obstacles.is_empty() && !poses.is_empty());
    let tags: Vec<TagPlane> =
        robot.tags.iter().map(|tag| TagPlane::fixed(tag.id, tag.size_m, *tag.base_from_tag.isometry())).collect();
    let lights: Vec<Light> = vehicle
        .lights
        .iter()
        .map(|light| Light {
            position_m: base_from_vehicle * light.position_m,
            direction: nalgebra::Unit::new_normalize(base_from_vehicle * light.direction.into_inner()),
            flux_lm: light.flux_lm,
            half_angle_rad: light.half_angle_rad,
        })
        .collect();
    let half = robot.camera.lens;
    let LensModel::Equidistant(lens) = half.lens else { panic!("a fisheye") };
    let full = CameraModel::from(Fisheye {
        focal_px: lens.focal_px.map(|f| 2.0 * f),
        center_px: lens.center_px.map(|c| 2.0 * (c + 0.5) - 0.5),
        resolution_px: lens.resolution_px.map(|n| 2 * n),
        ..lens
    });
    let spec = ImageSpec { snow_per_m3: 100.0, ..ImageSpec::default() };
    let shot = Shot { solids: &poses, ..Shot::of_tags(links.frame(&robot.camera.mount), &tags, 0) };
    for (name, lens) in [("half", half), ("full", full)] {
        let mut imager = Imager::new(&lens, &spec, &lights, 1);
        imager.set_solids(&shapes);
        c.bench_function(&format!("render: one image, {name} resolution"), |b| {
            b.iter(|| imager.take_image(&shot).rgb[0])
        });
        let mut detector = TagDetector::new(&lens, DetectorSettings::default()).expect("a detector");
        let mut grey = Vec::new();
        c.bench_function(&format!("render and detect: one image, {name} resolution"), |b| {
            b.iter(|| {
                let frame = imager.take_image(&shot);
                frame.grey(&mut grey);
                let image = GreyImage { width: frame.width, height: frame.height, data: &grey };
                detector.detect(image).expect("an image").tags.len()
            });
        });
    }
}

/// One step of the arm on its oil columns in sea water and in air, without sensors, hydraulics or contacts.
#[cfg(feature = "sim")]
fn one_step(c: &mut Criterion, robot: &Robot) {
    use armcal::robot::LinkBody;
    use armcal::sim::dynamics::{
        BaseCoupling, Body, Environment, Force, JointLoad, Motion, Multibody, Stage, StepInput, SystemState,
    };
    use armcal::streams::MAX_JOINTS;

    let wet = |link| Body::in_sea_water(link, robot.buoyancy_fraction);
    let dry = |link: &LinkBody| Body::dry(link.mass_kg, link.com_m, &link.inertia_kg_m2);
    let loads = std::array::from_fn(|j| {
        JointLoad::spring(5e4, 500.0, if j < robot.n_joints() { robot.stowed[j] } else { 0.0 }, 0.0)
    });
    let around = |_: Stage, _: &SystemState| (Environment::still(9.806_65), BaseCoupling::Prescribed(Motion::zero()));
    let bodies: [(&str, Vec<Body>); 2] =
        [("", robot.bodies.iter().map(wet).collect()), (", dry", robot.bodies.iter().map(dry).collect())];
    for (name, bodies) in bodies {
        let arm = Multibody::new(robot.chain.clone(), bodies);
        let mut state = SystemState {
            angles: robot.stowed,
            rates: JointAngles::from_fn(robot.n_joints(), |_| 0.0),
            world_from_base: nalgebra::Isometry3::identity(),
            base_velocity: Motion::zero(),
        };
        c.bench_function(&format!("dynamics: one step{name}"), |b| {
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
}

/// Detection of eight tags before the camera at 0.7 to 1.8 m, in clear water.
#[cfg(feature = "sim")]
fn detect(c: &mut Criterion) {
    use armcal::detect::{DetectorSettings, GreyImage, TagDetector};
    use armcal::sim::ImageSpec;
    use armcal::sim::imaging::{Imager, Light, Shot, TagPlane};
    use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

    let lens = robot().camera.lens;
    // The tag's z axis points against the camera's.
    let facing = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
    let tags: Vec<TagPlane> = (0..8_u32)
        .map(|k| {
            let (column, row) = (f64::from(k % 4) - 1.5, f64::from(k / 4) - 0.5);
            let place = Vector3::new(0.35 * column, 0.4 * row, 0.7 + 0.15 * f64::from(k));
            TagPlane::fixed(k, 0.15, Isometry3::from_parts(place.into(), facing))
        })
        .collect();
    let direction = Unit::new_normalize(Vector3::z());
    let light = Light { position_m: [0.0, -0.5, -0.3].into(), direction, flux_lm: 2e4, half_angle_rad: 1.0 };
    let mut grey = Vec::new();
    let shot = Shot::of_tags(Isometry3::identity(), &tags, 1);
    Imager::new(&lens, &ImageSpec::default(), &[light], 1).take_image(&shot).grey(&mut grey);
    let [width, height] = lens.resolution_px().map(|n| n as usize);
    let mut detector = TagDetector::new(&lens, DetectorSettings::default()).expect("it starts");
    let image = GreyImage { width, height, data: &grey };
    assert_eq!(detector.detect(image).expect("of the lens").tags.len(), tags.len());
    c.bench_function("detect: eight tags, 1224 x 1024", |b| b.iter(|| detector.detect(black_box(image))));
}

#[cfg(not(feature = "sim"))]
fn detect(_: &mut Criterion) {}

#[cfg(not(feature = "sim"))]
fn simulation(_: &mut Criterion) {}

/// One more view after those of the sample. The first estimator holds one hypothesis per lag, because the oil has
/// cooled down; the second holds only one.
fn online(c: &mut Criterion, robot: &Robot) {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/sample/run.mcap");
    let recording = read_recording(sample).expect("the sample is part of the repository");
    let mut stream = ViewStream::new(robot.clone());
    let mut views: Vec<View> = recording.messages.iter().flat_map(|(at, message)| stream.push(*at, message)).collect();
    views.extend(stream.finish());
    let last = views.iter().max_by_key(|view| view.tags.len()).expect("it has views");
    let alone = OnlineSettings { drift: DriftModel::Stationary, faults: FaultSearch::Off, ..OnlineSettings::default() };
    for settings in [OnlineSettings::default(), alone] {
        let mut estimator = OnlineEstimator::new(robot.clone(), settings);
        for (k, view) in views.iter().enumerate() {
            let oil_c = 20.0 - 0.2 * k as f64;
            estimator.hear_temperature(view.end, oil_c);
            let conditions = Conditions { oil_c: Some(oil_c), ..view.conditions };
            estimator.add_view(&View { conditions, ..view.clone() });
        }
        let name = format!("online view of {} tags, {} beliefs", last.tags.len(), estimator.lags().len());
        c.bench_function(&name, |b| {
            b.iter_batched_ref(|| estimator.clone(), |estimator| estimator.add_view(last), BatchSize::SmallInput);
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = calibration, planning, tag_map, detect, simulation
}
criterion_main!(benches);
