//! Rendered camera compared with the geometric one.

use crate::sensors::camera::tests::*;
use armcal_detect::{DetectorSettings, GreyImage, TagDetector, grey_of_jpeg};

/// Messages of a rendered image.
struct Searched {
    detections: TagDetections,
    jpeg: Option<Vec<u8>>,
}

impl Searched {
    fn of(shot: CameraShot) -> Self {
        let SeenTags::Searched(late) = shot.tags else { panic!("a rendered image") };
        let mut searched = Self { detections: TagDetections { stamp: shot.arrival, tags: Vec::new() }, jpeg: None };
        for message in late.wait().expect("it was searched") {
            match message {
                Message::Detections(detections) => searched.detections = detections,
                Message::Image(image) => searched.jpeg = Some(image.jpeg),
                other => assert!(matches!(other, Message::Rejects(_)), "{other:?}"),
            }
        }
        searched
    }
}

impl Site {
    /// Returns images of a rendered camera, one per second.
    fn rendered(&self, rates_rad_s: f64, seconds: u32, change: impl Fn(&mut WristCamera, u32)) -> Vec<Searched> {
        let root =
            Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/vehicles/work-class-front.toml");
        let vehicle = load_vehicle(&root).expect("it reads");
        let Self { robot, solids, spec, links, .. } = self;
        let mut camera = self.camera();
        let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() };
        camera
            .enable_rendering(&RenderInput { robot, vehicle: &vehicle, scene: &scene, spec, seed: 4 })
            .expect("a camera");
        let rates = JointAngles::from_fn(robot.n_joints(), |_| rates_rad_s);
        let take = |second: u32| {
            change(&mut camera, second);
            let poses = ScenePoses {
                links,
                base_from_world: vehicle.vehicle_from_base.inverse().isometry().to_owned(),
                jaws: [Isometry3::identity(); 2],
            };
            let motion = ArmMotion { chain: &robot.chain, angles: robot.stowed, rates };
            let closed = SIMULATION_EPOCH.plus_s(f64::from(second));
            camera.take_image(&ShutterState { poses, solids, motion, closed, demand: ImageDemand::All })
        };
        let shots: Vec<CameraShot> = (0..seconds).filter_map(take).collect();
        shots.into_iter().map(Searched::of).collect()
    }
}

fn clear_deep_water(spec: &mut WorldSpec) {
    spec.camera.mode = CameraMode::Rendered;
}

/// The detector finds the geometric camera's corners in rendered pixels, at rest and in motion.
#[test]
fn the_detector_reads_what_the_projection_says() {
    for (exposure_s, rate_rad_s) in [(0.0, 0.0), (0.02, 0.1)] {
        let site = site(|spec| {
            clear_deep_water(spec);
            spec.camera.exposure_s = exposure_s;
        });
        let (_, expected) = site.image(&mut site.camera(), rate_rad_s, 1.0);
        let images = site.rendered(rate_rad_s, 3, |_, _| {});
        let (mut sum_px2, mut n) = (0.0, 0);
        for image in &images {
            assert!(image.detections.tags.len() + 1 >= expected.tags.len(), "{:?}", all_ids(&image.detections));
            for tag in &image.detections.tags {
                let Some(known) = expected.tags.iter().find(|known| known.id == tag.id) else { continue };
                for (a, b) in tag.corners_px.iter().zip(&known.corners_px) {
                    sum_px2 += (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
                    n += 2;
                }
            }
        }
        let rms_px = f64::sqrt(sum_px2 / f64::from(n));
        eprintln!("{exposure_s} s: {rms_px:.3} px per coordinate over {n}");
        assert!(n > 80 && rms_px < 0.15, "{rms_px} px over {n}");
    }
}

#[test]
fn faults_show_in_the_pixels() {
    let site = site(clear_deep_water);
    let images = site.rendered(0.0, 4, |camera, second| match second {
        1 => camera.lose(3),
        2 => camera.misread(2, 40),
        3 => camera.blind(SIMULATION_EPOCH.plus_s(9.0)),
        _ => {}
    });
    let ids: Vec<Vec<u32>> = images.iter().map(|image| all_ids(&image.detections)).collect();
    assert!(ids[0].contains(&2) && ids[0].contains(&3), "{ids:?}");
    assert!(ids[1].contains(&2) && !ids[1].contains(&3), "{ids:?}");
    assert!(ids[2].contains(&40) && !ids[2].contains(&2), "{ids:?}");
    assert!(ids[3].is_empty(), "{ids:?}");
    let jpeg = images[0].jpeg.as_ref().expect("the first image is kept");
    assert!(jpeg.starts_with(&[0xff, 0xd8]) && (10_000..400_000).contains(&jpeg.len()), "{}", jpeg.len());
}

/// The recorded pixels give the same corners, to the last bit, and so do images that are not recorded.
#[test]
fn the_detector_sees_what_the_recording_holds() {
    let images_kept_every = |period_s: f64| {
        let site = site(|spec| {
            clear_deep_water(spec);
            spec.image.log_period_s = period_s;
        });
        let lens = site.robot.camera.lens;
        (lens, site.rendered(0.0, 2, |_, _| {}))
    };
    let (lens, all) = images_kept_every(0.0);
    let mut detector = TagDetector::new(&lens, DetectorSettings::default()).expect("a detector");
    for image in &all {
        let seen = grey_of_jpeg(image.jpeg.as_ref().expect("kept"), lens.resolution_px()).expect("a picture");
        let seen = GreyImage { width: seen.width, height: seen.height, data: &seen.data };
        let found = detector.detect(seen).expect("searched").tags;
        let tags: Vec<_> = found.into_iter().map(|tag| tag.detection).collect();
        assert!(tags.len() >= 3);
        assert_eq!(tags, image.detections.tags);
    }
    let (_, few) = images_kept_every(10.0);
    assert_eq!(few.iter().filter(|image| image.jpeg.is_some()).count(), 1);
    for (kept, left_out) in all.iter().zip(&few) {
        assert_eq!(kept.detections.tags, left_out.detections.tags);
    }
}
