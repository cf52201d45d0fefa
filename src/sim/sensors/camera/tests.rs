//! Camera compared with closed forms of its lens, its motion and its clock.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3};

use crate::as_built::AsBuilt;
use crate::body_poses::BodyPoses;
use crate::sensors::camera::ported_lens::PortedLens;
use crate::sensors::camera::*;
use crate::solids::Solids;
use crate::spec::{CameraMode, CameraWorldSpec, CornerNoiseKind, PortKind, WorldSpec};
use armcal_core::optics::{CornerNoise, square_corners};
use armcal_core::robot::{Robot, load, load_vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::{ImageDemand, JointAngles, Message, TagDetections};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

#[cfg(feature = "images")]
mod rendered;
mod watched;

struct Site {
    robot: Robot,
    built: AsBuilt,
    solids: Solids,
    spec: WorldSpec,
    links: BodyPoses,
}

/// Returns the stowed arm with exact sensors and a detector without noise, changed by `change`.
fn site(change: impl FnOnce(&mut WorldSpec)) -> Site {
    site_of("titan4", |_| {}, change)
}

/// Returns a site like [`site`] with another robot, changed by `arm`.
fn site_of(robot: &str, arm: impl FnOnce(&mut Robot), change: impl FnOnce(&mut WorldSpec)) -> Site {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
    let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("it reads");
    let mut robot = load(&root.join(robot)).expect("it reads").mounted_on(&vehicle).expect("it fits");
    arm(&mut robot);
    let mut spec = WorldSpec::default();
    spec.camera.miss_probability = 0.0;
    spec.camera.corner_noise_px = 0.0;
    change(&mut spec);
    let built = AsBuilt::draw(&robot, &spec, 4);
    let mut solids = Solids::new(&robot, &vehicle, &Scene::default());
    let links = BodyPoses::drawn(robot.n_joints(), &robot.chain.link_poses(&robot.stowed));
    solids.place(&links, vehicle.vehicle_from_base.isometry());
    Site { robot, built, solids, spec, links }
}

impl Site {
    fn camera(&self) -> WristCamera {
        let Self { robot, built, solids, spec, .. } = self;
        WristCamera::new(&CameraInput { robot, built, solids, spec, seed: 4 })
    }

    /// Takes an image while all joints move at `rates_rad_s`.
    fn image(&self, camera: &mut WristCamera, rates_rad_s: f64, at_s: f64) -> (Stamp, TagDetections) {
        let rates = JointAngles::from_fn(self.robot.n_joints(), |_| rates_rad_s);
        let motion = ArmMotion { chain: &self.robot.chain, angles: self.robot.stowed, rates };
        let poses =
            ScenePoses { links: &self.links, base_from_world: Isometry3::identity(), jaws: [Isometry3::identity(); 2] };
        let closed = SIMULATION_EPOCH.plus_s(at_s);
        let (solids, demand) = (&self.solids, ImageDemand::All);
        camera.project_tags(&ShutterState { poses, solids, motion, closed, demand })
    }

    /// Returns the corners by the nominal lens, with the joints at their angles `earlier_s` before.
    fn drawn_corners(&self, id: u32, rates_rad_s: f64, earlier_s: f64) -> [Vector2<f64>; 4] {
        let stowed = &self.robot.stowed;
        let angles = JointAngles::from_fn(stowed.len(), |j| stowed[j] - rates_rad_s * earlier_s);
        let poses = self.robot.chain.link_poses(&angles);
        let base_from_camera = poses.frame(&self.built.camera_attachment(&self.robot));
        let tag = self.built.tags.iter().find(|tag| tag.id == id).expect("a known tag");
        let base_from_tag = self.robot.base_from_tags_at(&poses) * tag.base_from_tag().isometry();
        let camera_from_tag = base_from_camera.inverse() * base_from_tag;
        square_corners(tag.size_m)
            .map(|corner| self.robot.camera.lens.project(&(camera_from_tag * corner).coords).expect("in view"))
    }
}

fn largest_px(a: &[[f64; 2]; 4], b: &[Vector2<f64>; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (Vector2::from(*a) - b).norm()).fold(0.0, f64::max)
}

fn all_ids(image: &TagDetections) -> Vec<u32> {
    image.tags.iter().map(|tag| tag.id).collect()
}

#[test]
fn an_instant_shows_where_the_corners_are() {
    let site = site(|_| {});
    let (_, image) = site.image(&mut site.camera(), 0.3, 1.0);
    assert!(image.tags.len() >= 5, "{:?}", all_ids(&image));
    for tag in &image.tags {
        assert!(largest_px(&tag.corners_px, &site.drawn_corners(tag.id, 0.0, 0.0)) < 1e-9);
    }
}

/// The tag on the gripper moves with the last joint and is hidden by the wrist behind it. It changes no other tag's
/// noise.
#[test]
fn the_tag_on_the_gripper_turns_with_the_last_joint_until_the_wrist_hides_it() {
    let mut with = site(|spec| spec.camera.corner_noise_px = 0.3);
    let without = with.image(&mut with.camera(), 0.0, 1.0).1;
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
    with.robot.gripper_tag = load(&root.join("titan4-gripper-tag")).expect("it reads").gripper_tag;
    with.built = AsBuilt::draw(&with.robot, &with.spec, 4);
    let tag = with.robot.gripper_tag.expect("a tag");
    let built = with.built.gripper_tag_attachment(&with.robot).expect("a tag");
    assert!((built.link_from_frame.translation.vector - tag.mount.link_from_frame.translation.vector).norm() < 0.003);
    let image = with.image(&mut with.camera(), 0.0, 1.0).1;
    let others: Vec<_> = image.tags.iter().filter(|seen| seen.id != tag.id).cloned().collect();
    assert_eq!(others, without.tags);

    with.spec.camera.corner_noise_px = 0.0;
    let mut seen_at = Vec::new();
    for degrees in (-180..180).step_by(10) {
        let turn_rad = f64::from(degrees).to_radians();
        let angles = JointAngles::from_fn(6, |j| if j == 5 { turn_rad } else { with.robot.stowed[j] });
        let poses = with.robot.chain.link_poses(&angles);
        with.links = BodyPoses::drawn(6, &poses);
        with.solids.place(&with.links, &Isometry3::identity());
        let image = with.image(&mut with.camera(), 0.0, 1.0).1;
        let Some(seen) = image.tags.iter().find(|seen| seen.id == tag.id) else { continue };
        let camera_from_tag = with.built.camera_attachment(&with.robot);
        let camera_from_tag = poses.frame(&camera_from_tag).inverse() * poses.frame(&built);
        let corners = square_corners(tag.size_m)
            .map(|corner| with.robot.camera.lens.project(&(camera_from_tag * corner).coords).expect("in view"));
        assert!(largest_px(&seen.corners_px, &corners) < 1e-9);
        seen_at.push(degrees);
    }
    let (first, last) = (seen_at[0], seen_at[seen_at.len() - 1]);
    eprintln!("seen from {first} to {last} deg");
    assert!((-100..=-60).contains(&first) && (50..=100).contains(&last), "{seen_at:?}");
    assert_eq!(seen_at.len() as i32, (last - first) / 10 + 1, "without a gap");
}

/// The corners are the mean over 2000 instants of the same motion, which lags by half of the exposure.
#[test]
fn a_moving_camera_shows_the_mean_over_its_exposure() {
    const INSTANTS: u32 = 2000;
    let site = site(|spec| spec.camera.exposure_s = 0.04);
    let (_, image) = site.image(&mut site.camera(), 0.1, 1.0);
    assert!(image.tags.len() >= 5, "{:?}", all_ids(&image));
    for tag in &image.tags {
        let mut mean = [Vector2::zeros(); 4];
        for i in 0..INSTANTS {
            let earlier_s = 0.04 * (f64::from(i) + 0.5) / f64::from(INSTANTS);
            for (sum, corner) in mean.iter_mut().zip(site.drawn_corners(tag.id, 0.1, earlier_s)) {
                *sum += corner / f64::from(INSTANTS);
            }
        }
        let (off_px, lag_px) =
            (largest_px(&tag.corners_px, &mean), largest_px(&tag.corners_px, &site.drawn_corners(tag.id, 0.1, 0.0)));
        eprintln!("tag {}: {off_px:.1e} px from the mean, {lag_px:.2} px behind the end", tag.id);
        assert!(off_px < 1e-6, "{off_px}");
        assert!(lag_px > 0.2, "the motion shows: {lag_px}");
    }
    let (_, still) = site.image(&mut site.camera(), 0.0, 1.0);
    for tag in &still.tags {
        assert!(largest_px(&tag.corners_px, &site.drawn_corners(tag.id, 0.0, 0.0)) < 1e-9);
    }
}

/// One image with and without growth of the noise shows that noise scales by `1 + k blur`.
#[test]
fn noise_grows_with_the_blur() {
    let noisy = |growth: f64| {
        site(|spec| {
            spec.camera.exposure_s = 0.04;
            spec.camera.corner_noise_px = 0.3;
            spec.camera.blur_noise_per_px = growth;
        })
    };
    let (plain, grown) = (noisy(0.0), noisy(0.5));
    let quiet = site(|spec| spec.camera.exposure_s = 0.04);
    let [plain, grown, quiet_image] = [&plain, &grown, &quiet].map(|s| s.image(&mut s.camera(), 0.1, 1.0).1);
    assert_eq!(all_ids(&plain), all_ids(&grown));
    for ((a, b), mean) in plain.tags.iter().zip(&grown.tags).zip(&quiet_image.tags) {
        let (start, end) = (quiet.drawn_corners(a.id, 0.1, 0.04), quiet.drawn_corners(a.id, 0.1, 0.0));
        let blur_px = (0..4).map(|k| (start[k] - end[k]).norm()).fold(0.0, f64::max);
        for k in 0..4 {
            for axis in 0..2 {
                let noise = a.corners_px[k][axis] - mean.corners_px[k][axis];
                let grown = b.corners_px[k][axis] - mean.corners_px[k][axis];
                assert!((grown - noise * (1.0 + 0.5 * blur_px)).abs() < 1e-9, "{grown} {noise} {blur_px}");
            }
        }
    }
}

#[test]
fn the_cameras_clock_gains_evenly_and_images_arrive_by_the_arms() {
    let site = site(|spec| {
        spec.clock.camera_jitter_s = 0.0;
        spec.clock.camera_clock_drift_ppm = -40.0;
    });
    let mut camera = site.camera();
    for at_s in [0.0, 10.0, 3600.0] {
        let (arrival, image) = site.image(&mut camera, 0.0, at_s);
        let closed = SIMULATION_EPOCH.plus_s(at_s);
        assert!((arrival.since_s(closed) - 0.02).abs() < 1e-8);
        assert!((image.stamp.since_s(closed) - (0.02 - 40e-6 * at_s)).abs() < 1e-8);
    }
}

#[test]
fn a_camera_that_slips_on_its_mount_sees_from_there() {
    let site = site(|_| {});
    let mut camera = site.camera();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.01, -0.02, 0.03));
    let motion = Isometry3::from_parts(Vector3::new(0.004, 0.0, -0.002).into(), turn);
    let before = camera.base_from_camera(&site.links);
    camera.slip(motion);
    let (_, image) = site.image(&mut camera, 0.0, 1.0);
    assert!(image.tags.len() > 3, "{image:?}");
    for seen in &image.tags {
        let tag = site.built.tags.iter().find(|tag| tag.id == seen.id).expect("a known tag");
        let camera_from_tag = (before * motion).inverse() * tag.base_from_tag().isometry();
        let expected = square_corners(tag.size_m)
            .map(|corner| site.robot.camera.lens.project(&(camera_from_tag * corner).coords).expect("in view"));
        assert!(largest_px(&seen.corners_px, &expected) < 1e-9, "tag {}", seen.id);
    }
}

#[test]
fn tags_get_lost_moved_and_misread() {
    let site = site(|_| {});
    let mut camera = site.camera();
    let ids = all_ids(&site.image(&mut camera, 0.0, 1.0).1);
    let [lost, moved, misread] = [ids[0], ids[1], ids[2]];
    camera.lose(lost);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 0.1));
    let motion = Isometry3::from_parts(Vector3::new(0.02, 0.0, 0.0).into(), turn);
    camera.move_tag(moved, motion);
    camera.misread(misread, 777);
    let (_, image) = site.image(&mut camera, 0.0, 1.2);
    let mut expected: Vec<u32> = ids[1..].iter().map(|id| if *id == misread { 777 } else { *id }).collect();
    expected.sort_unstable();
    assert_eq!(all_ids(&image), expected);
    let seen = |id: u32| image.tags.iter().find(|tag| tag.id == id).expect("seen").corners_px;
    assert!(largest_px(&seen(777), &site.drawn_corners(misread, 0.0, 0.0)) < 1e-9, "the same corners");
    let tag = site.built.tags.iter().find(|tag| tag.id == moved).expect("known");
    let base_from_camera = camera.base_from_camera(&site.links);
    let camera_from_tag = base_from_camera.inverse() * tag.base_from_tag().isometry() * motion;
    let project = |p: Point3<f64>| site.robot.camera.lens.project(&(camera_from_tag * p).coords).expect("in view");
    assert!(largest_px(&seen(moved), &square_corners(tag.size_m).map(project)) < 1e-9);
}

#[test]
fn wrong_ids_come_as_often_as_asked_and_are_those_of_other_tags() {
    let site = site(|spec| spec.camera.wrong_id_probability = 0.1);
    let mut camera = site.camera();
    let known: Vec<u32> = site.built.tags.iter().map(|tag| tag.id).collect();
    let (mut wrong, mut n, mut by_id) = (0, 0, BTreeMap::<u32, u32>::new());
    for image in 0..2000 {
        for tag in site.image(&mut camera, 0.0, f64::from(image)).1.tags {
            n += 1;
            assert!(known.contains(&tag.id));
            if largest_px(&tag.corners_px, &site.drawn_corners(tag.id, 0.0, 0.0)) > 1e-6 {
                wrong += 1;
                *by_id.entry(tag.id).or_default() += 1;
            }
        }
    }
    let share = f64::from(wrong) / f64::from(n);
    assert!((share - 0.1).abs() < 4.0 * (0.09 / f64::from(n)).sqrt(), "{share} of {n}");
    assert_eq!(by_id.len(), known.len(), "each tag is taken for each other: {by_id:?}");
}

/// Random effects have their own streams.
#[test]
fn wrong_ids_shift_no_noise() {
    let noisy = |p: f64| {
        let site = site(|spec| {
            spec.camera.corner_noise_px = 0.3;
            spec.camera.wrong_id_probability = p;
        });
        let mut camera = site.camera();
        let mut corners: Vec<_> = site
            .image(&mut camera, 0.0, 1.0)
            .1
            .tags
            .iter()
            .map(|tag| tag.corners_px.map(|c| c.map(f64::to_bits)))
            .collect();
        corners.sort_unstable();
        corners
    };
    assert_eq!(noisy(0.0), noisy(1.0));
}

/// The corners are projected by the lens that was drawn for the seed.
#[test]
fn corners_go_through_the_lens_as_built() {
    let site = site(|spec| {
        spec.camera.focal_std = 0.01;
        spec.camera.center_std_px = 3.0;
    });
    let lens = site.built.lens.expect("a lens of its own").applied(&site.robot.camera.lens);
    let (_, image) = site.image(&mut site.camera(), 0.0, 1.0);
    for tag in &image.tags {
        let nominal = site.drawn_corners(tag.id, 0.0, 0.0);
        let bent = nominal.map(|pixel| {
            let ray = site.robot.camera.lens.unproject(&pixel).expect("in view");
            lens.project(&ray.into_inner()).expect("in view")
        });
        assert!(largest_px(&tag.corners_px, &bent) < 1e-7);
        assert!(largest_px(&tag.corners_px, &nominal) > 0.5);
    }
}

/// Behind a thin flat port at the pupil, an angle becomes `asin(n sin)`, through a lens shorter by n. The result is the
/// nominal focal length on the axis, and another one outwards. A dome centred off the pupil shifts corners by several
/// pixels.
#[test]
fn ports_keep_the_focal_length_near_the_axis() {
    let shift = |change: &dyn Fn(&mut CameraWorldSpec), angle_rad: f64, range_m: f64| {
        let site = site(|spec| change(&mut spec.camera));
        let lens = PortedLens::new(&site.robot.camera.lens, &site.built, &site.spec.camera);
        let point = Vector3::new(angle_rad.sin(), 0.0, angle_rad.cos()) * range_m;
        (lens.project(&point).expect("in view") - site.robot.camera.lens.project(&point).expect("in view")).norm()
    };
    let flat = |spec: &mut CameraWorldSpec| spec.port = PortKind::Flat;
    let dome = |spec: &mut CameraWorldSpec| {
        spec.port = PortKind::Dome;
        spec.dome_decentre_std_m = 0.002;
    };
    let thin = |spec: &mut CameraWorldSpec| {
        flat(spec);
        spec.port_distance_m = 0.0;
        spec.port_thickness_m = 0.0;
    };
    assert!(shift(&thin, 0.001, 1.0) < 1e-4, "{}", shift(&thin, 0.001, 1.0));
    let lens = site(|_| {}).robot.camera.lens;
    let [fx, fy, cx, cy, k1, k2, k3, k4] = lens.intrinsics();
    let short = lens.with_intrinsics([fx / 1.333, fy / 1.333, cx, cy, k1, k2, k3, k4]);
    for angle in [0.2_f64, 0.5, 0.7] {
        let in_air = (1.333 * angle.sin()).asin();
        let ray = |angle: f64| Vector3::new(angle.sin(), 0.0, angle.cos());
        let expected = short.project(&ray(in_air)).expect("in view") - lens.project(&ray(angle)).expect("in view");
        assert!((shift(&thin, angle, 2.0) - expected.norm()).abs() < 1e-9);
    }
    for angle in (1..=20).map(|i| 0.04 * f64::from(i)) {
        let short =
            short.project(&Vector3::new(1.333 * angle.sin(), 0.0, (1.0 - (1.333 * angle.sin()).powi(2)).sqrt()));
        let seen = lens.project(&Vector3::new(angle.sin(), 0.0, angle.cos()));
        let exact = (short.expect("in view") - seen.expect("in view")).norm();
        eprintln!("plot port {angle:.2} {:e} {exact:e} {:e}", shift(&thin, angle, 2.0), shift(&flat, angle, 1.0));
    }
    let [near_axis, aside, far_aside] = [0.1, 0.4, 0.7].map(|angle| shift(&flat, angle, 1.0));
    eprintln!("flat port, 1 m: {near_axis:.2}, {aside:.1}, {far_aside:.1} px at 0.1, 0.4, 0.7 rad");
    assert!(near_axis < 1.0 && aside > 2.0 && far_aside > 20.0, "{near_axis} {aside} {far_aside}");
    let bent = [0.1, 0.7, 1.2].map(|angle| shift(&dome, angle, 1.0));
    eprintln!("dome 2 mm off, 1 m: {bent:.2?} px");
    assert!(bent.iter().all(|px| (0.1..20.0).contains(px)), "{bent:?}");
    let centred = |spec: &mut CameraWorldSpec| spec.port = PortKind::Dome;
    assert_eq!(shift(&centred, 0.7, 1.0), 0.0);
}

/// Squared errors in units of the model's covariance are chi-square of 2 degrees, and tags are found with the model's
/// probability.
#[test]
fn fitted_noise_and_misses_are_those_of_the_model() {
    let site = site(|spec| spec.camera.noise = CornerNoiseKind::Fitted);
    let mut camera = site.camera();
    let standing = site.built.camera_attachment(&site.robot);
    let base_from_camera = site.robot.chain.link_poses(&site.robot.stowed).frame(&standing);
    let model = CornerNoise::CLEAR;
    let (mut squares, mut n_found, n_images) = (Vec::new(), BTreeMap::<u32, u32>::new(), 500);
    for image in 0..n_images {
        for tag in site.image(&mut camera, 0.0, f64::from(image)).1.tags {
            *n_found.entry(tag.id).or_default() += 1;
            let truth = site.drawn_corners(tag.id, 0.0, 0.0);
            let built = site.built.tags.iter().find(|built| built.id == tag.id).expect("a known tag");
            let to_tag = base_from_camera.inverse() * built.base_from_tag().isometry();
            let range_m = to_tag.translation.vector.norm();
            let covariances = model.covariances_px2(&truth.map(Into::into), range_m, 0.0);
            for ((corner, truth), covariance) in tag.corners_px.iter().zip(truth).zip(covariances) {
                let error = Vector2::from(*corner) - truth;
                let inverse = covariance.try_inverse().expect("regular");
                squares.push((error.transpose() * inverse * error).x);
            }
        }
    }
    // The variance is 4 for each.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((mean - 2.0).abs() < 5.0 * 2.0 / (squares.len() as f64).sqrt(), "{mean} of {}", squares.len());
    for (id, n) in n_found {
        let truth = site.drawn_corners(id, 0.0, 0.0);
        let side_px = (0..4).map(|k| (truth[k] - truth[(k + 1) % 4]).norm()).fold(f64::INFINITY, f64::min);
        let built = site.built.tags.iter().find(|built| built.id == id).expect("a known tag");
        let range_m = (base_from_camera.inverse() * built.base_from_tag().isometry()).translation.vector.norm();
        let chance = model.chance.of(side_px, range_m);
        let std = (chance * (1.0 - chance) / f64::from(n_images)).sqrt();
        let rate = f64::from(n) / f64::from(n_images);
        assert!((rate - chance).abs() < 5.0 * std + 0.005, "tag {id}: {rate} {chance}");
    }
}
