//! Rendered images compared with projection and closed forms.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector2, Vector3};
use rand::RngExt;

use crate::imaging::light::Lamp;
use crate::imaging::shape::{Form, Place};
use crate::imaging::*;
use armcal_core::optics::{TagFamily, fixture::lens, square_corners};
use armcal_core::robot::{Hull, Shape, parry_pose};
use armcal_core::stats::stream_rng;
use armcal_detect::{DetectorSettings, GreyImage, TagDetector};

/// Id that the family does not have: a blank white board.
const BLANK: u32 = 9999;
const WHITE: f64 = 0.85;
const BLACK: f64 = 0.05;
const COUNTS_PER_CD_M2: f64 = 255.0 * PI / 1000.0;

/// Returns a tag `range_m` ahead of the camera in a direction by pixel. It is turned by `tilt` (rad, its own axes) from
/// facing the camera.
fn ahead(pixel: [f64; 2], range_m: f64, tilt: [f64; 3]) -> Isometry3<f64> {
    let ray = lens().unproject(&Vector2::from(pixel)).expect("in view");
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &-ray.into_inner())
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * PI));
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from(tilt));
    Isometry3::from_parts(Translation3::from(ray.into_inner() * range_m), facing * turn)
}

fn center() -> [f64; 2] {
    lens().center_px()
}

fn grey(frame: &Frame) -> Vec<f64> {
    frame.rgb.as_chunks::<3>().0.iter().map(|rgb| f64::from(rgb[1])).collect()
}

fn shot(spec: &ImageSpec, lights: &[Light], tags: &[TagPlane]) -> Frame {
    Imager::new(&lens(), spec, lights, 3).take_image(&Shot::of_tags(Isometry3::identity(), tags, 0)).clone()
}

fn at(frame: &Frame, pixel: [f64; 2]) -> [f64; 3] {
    let i = 3 * (pixel[1].round() as usize * frame.width + pixel[0].round() as usize);
    std::array::from_fn(|k| f64::from(frame.rgb[i + k]))
}

/// Interpolates between pixels.
fn between(image: &[f64], pixel: &Vector2<f64>) -> f64 {
    let width = lens().resolution_px()[0] as usize;
    let (x, y) = (pixel.x.floor(), pixel.y.floor());
    let (u, v, i) = (pixel.x - x, pixel.y - y, y as usize * width + x as usize);
    let row = |i: usize| (1.0 - u) * image[i] + u * image[i + 1];
    (1.0 - v) * row(i) + v * row(i + width)
}

/// The sides of the black border are at their projections. Across each side the brightness falls from white to black,
/// and the area under the profile gives its position, for any blur of the pixels.
#[test]
fn edges_lie_where_the_projection_puts_them() {
    const REACH_PX: f64 = 2.5;
    const STEPS: i32 = 50;
    let mut rng = stream_rng(1, "edges");
    let (mut sum, mut sum_squares, mut n) = (0.0, 0.0, 0.0);
    let mut imager = Imager::new(&lens(), &ImageSpec::clean(), &[], 1);
    for number in 0..12 {
        let mut draw = |span: f64| rng.random_range(-span..span);
        let pixel = [center()[0] + draw(350.0), center()[1] + draw(300.0)];
        let pose = ahead(pixel, 0.55 + draw(0.1), [draw(0.6), draw(0.6), draw(PI)]);
        let tag = TagPlane::fixed(number as u32, 0.15, pose);
        let image = grey(imager.take_image(&Shot::of_tags(Isometry3::identity(), &[tag], number)));
        let project = |p: &Point3<f64>| lens().project(&(pose * p).coords).expect("in view");
        let corners = square_corners(0.15);
        for k in 0..4 {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            for step in 2..=18 {
                let place = a + (b - a) * (f64::from(step) / 20.0);
                let (here, out) = (project(&place), project(&(place + place.coords.normalize() * 1e-4)));
                let along = project(&(place + (b - a) * 1e-4)) - here;
                let mut normal = Vector2::new(-along.y, along.x).normalize();
                if normal.dot(&(out - here)) < 0.0 {
                    normal = -normal;
                }
                let profile = |t: f64| between(&image, &(here + normal * t));
                let (black, white) = (profile(-REACH_PX), profile(REACH_PX));
                assert!(white - black > 100.0, "{white} {black}");
                let width_px = 2.0 * REACH_PX / f64::from(STEPS);
                let area: f64 = (0..STEPS)
                    .map(|i| {
                        (profile(-REACH_PX + (f64::from(i) + 0.5) * width_px) - black) / (white - black) * width_px
                    })
                    .sum();
                let off_px = REACH_PX - area;
                sum += off_px;
                sum_squares += off_px * off_px;
                n += 1.0;
            }
        }
    }
    let (mean, rms) = (sum / n, f64::sqrt(sum_squares / n));
    eprintln!("edges: mean {mean:.4} px, rms {rms:.4} px of {n}");
    assert!(mean.abs() < 0.01 && rms < 0.03, "mean {mean}, rms {rms}");
}

/// The detector reads each family from rendered images: the ids, and the corners at their projections.
#[test]
fn tags_of_each_family_are_read_where_they_were_drawn() {
    for family in TagFamily::ALL {
        let mut detector = TagDetector::new(&lens(), DetectorSettings::of_family(family)).expect("a detector");
        let mut worst_px = 0.0_f64;
        for number in 0..3_u32 {
            let off = 120.0 * f64::from(number);
            let pose = ahead([center()[0] - off, center()[1] + 0.5 * off], 0.6, [0.3, 0.1 * f64::from(number), 0.4]);
            let tag = TagPlane { family, ..TagPlane::fixed(7 * number, 0.12, pose) };
            let frame = shot(&ImageSpec::clean(), &[], &[tag]);
            let data: Vec<u8> = grey(&frame).into_iter().map(|value| value as u8).collect();
            let image = GreyImage { width: frame.width, height: data.len() / frame.width, data: &data };
            let found = detector.detect(image).expect("an image").tags;
            assert_eq!(found.iter().map(|tag| tag.detection.id).collect::<Vec<_>>(), [7 * number], "{family}");
            let truth = square_corners(0.12).map(|corner| lens().project(&(pose * corner).coords).expect("in view"));
            for (corner, truth) in found[0].detection.corners_px.iter().zip(truth) {
                worst_px = worst_px.max((Vector2::from(*corner) - truth).norm());
            }
        }
        eprintln!("{family}: worst corner {worst_px:.3} px off");
        assert!(worst_px < 0.1, "{family}: {worst_px} px");
    }
}

/// Each channel follows I = J exp(-bD z) + Binf (1 - exp(-bB z)), on white and black.
#[test]
fn water_takes_and_gives_light_by_its_closed_form() {
    let (direct, back, veil) = ([0.9, 0.3, 0.15], [1.4, 0.5, 0.3], [20.0, 60.0, 80.0]);
    let spec = ImageSpec {
        turbidity: 1.0,
        direct_per_m: Some(direct),
        backscatter_per_m: Some(back),
        veil_cd_m2: Some(veil),
        ambient_lux: 2000.0,
        ..ImageSpec::clean()
    };
    for range_m in [0.4, 1.0, 2.5] {
        for (albedo, pixel) in [(WHITE, center()), (WHITE, [300.0, 400.0])] {
            let frame = shot(&spec, &[], &[TagPlane::fixed(BLANK, 0.3, ahead(pixel, range_m, [0.0; 3]))]);
            let found = at(&frame, pixel);
            // The board's normal is nearly horizontal: half of the sky lights it.
            let normal = ahead(pixel, range_m, [0.0; 3]).rotation * Vector3::z();
            for k in 0..3 {
                let lux = 2000.0 * (0.5 + 0.5 * normal.z);
                let expected =
                    albedo * lux / PI * (-direct[k] * range_m).exp() + veil[k] * (1.0 - (-back[k] * range_m).exp());
                let counts = expected * COUNTS_PER_CD_M2;
                assert!(
                    (found[k] - counts.min(255.0)).abs() < 1.0,
                    "{range_m} m, channel {k}: {} for {counts}",
                    found[k]
                );
            }
        }
    }
    // The black border of a printed tag, seen through the same water.
    let pose = ahead(center(), 0.5, [0.0; 3]);
    let frame = shot(&spec, &[], &[TagPlane::fixed(0, 0.3, pose)]);
    let border = lens().project(&(pose * Point3::new(0.131, 0.0, 0.0)).coords).expect("in view");
    let range_m = (pose * Point3::new(0.131, 0.0, 0.0)).coords.norm();
    let lux = 2000.0 * (0.5 + 0.5 * (pose.rotation * Vector3::z()).z);
    let expected = BLACK * lux / PI * (-direct[1] * range_m).exp() + veil[1] * (1.0 - (-back[1] * range_m).exp());
    assert!((at(&frame, border.into())[1] - expected * COUNTS_PER_CD_M2).abs() < 1.0);
}

#[test]
fn lamps_fall_off_with_the_square_and_keep_their_flux() {
    let light = |half_angle_rad: f64| Light {
        position_m: Point3::new(0.0, 0.0, 0.0),
        direction: Vector3::z_axis(),
        flux_lm: 100.0,
        half_angle_rad,
    };
    // Peak intensity of the beam, by the closed form of its definition.
    let narrow = 1.0 / (1.0 - 0.5_f64.cos());
    let peak_cd = 100.0 * narrow * 2.0_f64.ln() / (TAU * (1.0 - (-2.0 * narrow).exp2()));
    let spec = ImageSpec { ambient_lux: 0.0, ..ImageSpec::clean() };
    for range_m in [0.5, 1.0, 1.5] {
        let frame = shot(&spec, &[light(0.5)], &[TagPlane::fixed(BLANK, 0.3, ahead(center(), range_m, [0.0; 3]))]);
        let expected = WHITE / PI * peak_cd / (range_m * range_m) * COUNTS_PER_CD_M2;
        let found = at(&frame, center())[1];
        assert!((found - expected.min(255.0)).abs() < 1.0, "{range_m} m: {found} for {expected}");
    }
    for half_angle_rad in [0.2, 0.7, 1.4] {
        let lamp = Lamp::new(&light(half_angle_rad), &Isometry3::identity());
        // Integral over a sphere of 1 m, in even steps of the cosine.
        let flux: f64 = (0..2000)
            .map(|i| {
                let cos = -1.0 + (f64::from(i) + 0.5) / 1000.0;
                let mut lux = [[0.0]; 3];
                lamp.light_up_all_sides(&[[(1.0 - cos * cos).sqrt() as f32], [0.0], [cos as f32]], &[0.0; 3], &mut lux);
                f64::from(lux[0][0]) * TAU / 1000.0
            })
            .sum();
        assert!((flux / 100.0 - 1.0).abs() < 2e-3, "{half_angle_rad}: {flux}");
    }
}

/// In an even field, the mean falls with the vignette. The variance is that of read noise, shot noise and rounding.
#[test]
fn the_sensor_has_the_vignette_and_the_noise_that_it_says() {
    let spec = ImageSpec { vignetting: 0.4, electrons_per_cd_m2: 400.0, gain: 2.0, ..ImageSpec::clean() };
    let silty = |spec: &ImageSpec, number: u64| {
        let mut imager = Imager::new(&lens(), spec, &[], 3);
        let silt = Shot { is_silty: true, ..Shot::of_tags(Isometry3::identity(), &[], number) };
        imager.take_image(&silt).clone()
    };
    let (quiet, level) = (silty(&spec, 0), 8.0 * 400.0 * 255.0 * 2.0 / 10_000.0);
    for pixel in [center(), [0.0, 0.0], [1223.0, 1023.0], [100.0, 700.0]] {
        let radius = (pixel[0] - center()[0]).hypot(pixel[1] - center()[1]) / 0.5 / 1224.0_f64.hypot(1024.0);
        let expected = level * (1.0 - 0.4 * radius * radius);
        assert!((at(&quiet, pixel)[1] - expected).abs() < 0.51, "{pixel:?}: {:?} for {expected}", at(&quiet, pixel));
    }
    let noisy = ImageSpec { vignetting: 0.0, read_noise_electrons: 30.0, shot_noise: 1.0, ..spec };
    let frame = silty(&noisy, 0);
    let values = grey(&frame);
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    let scale = 255.0 * 2.0 / 10_000.0;
    let expected = scale * scale * (900.0 + 8.0 * 400.0) + 1.0 / 12.0;
    assert!((mean - level).abs() < 0.02, "{mean} for {level}");
    assert!((variance / expected - 1.0).abs() < 0.01, "{variance} for {expected}");
    // Neighbours, channels and images are independent.
    let red: Vec<f64> = frame.rgb.as_chunks::<3>().0.iter().map(|rgb| f64::from(rgb[0]) - level * 9.0 / 8.0).collect();
    let other: Vec<f64> = grey(&silty(&noisy, 1));
    let correlation =
        |a: &dyn Fn(usize) -> f64| (0..values.len() - 1).map(|i| (values[i] - mean) * a(i)).sum::<f64>() / n / variance;
    let found = [correlation(&|i| values[i + 1] - mean), correlation(&|i| red[i]), correlation(&|i| other[i] - mean)];
    assert!(found.iter().all(|c| c.abs() < 0.006), "{found:?}");
}

/// In a turn that accelerates, the blurred board's centre of brightness is the mean over instants between.
#[test]
fn motion_blur_is_the_mean_over_the_exposure() {
    let board = [TagPlane::fixed(BLANK, 0.1, ahead([520.0, 430.0], 0.7, [0.3, 0.2, 0.1]))];
    let turned = |t: f64| {
        // -0.012 .. 0.02 rad, not even in time.
        Isometry3::from_parts(
            Translation3::new(0.002 * t, 0.0, 0.0),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 1.0, 0.1).normalize() * (0.016 * t + 0.004 * t * t)),
        )
    };
    let mut imager = Imager::new(&lens(), &ImageSpec::clean(), &[], 1);
    let centroid = |image: &[f64]| {
        let width = lens().resolution_px()[0] as usize;
        let sum = image.iter().enumerate().fold(Vector3::zeros(), |sum, (i, value)| {
            sum + Vector3::new((i % width) as f64, (i / width) as f64, 1.0) * *value
        });
        (Vector2::new(sum.x, sum.y) / sum.z, sum.z)
    };
    let moved = Shot { base_from_camera: [-1.0, 0.0, 1.0].map(turned), ..Shot::of_tags(turned(0.0), &board, 0) };
    let (blurred, light) = centroid(&grey(imager.take_image(&moved)));
    let (mut mean, mut mean_light, mut ends) = (Vector2::zeros(), 0.0, Vec::new());
    const INSTANTS: i32 = 24;
    for k in 0..INSTANTS {
        let t = -1.0 + (2.0 * f64::from(k) + 1.0) / f64::from(INSTANTS);
        let (sharp, light) = centroid(&grey(imager.take_image(&Shot::of_tags(turned(t), &board, 0))));
        mean += sharp / f64::from(INSTANTS);
        mean_light += light / f64::from(INSTANTS);
        ends.push(sharp);
    }
    let swept_px = (ends[0] - ends[ends.len() - 1]).norm();
    eprintln!("swept {swept_px:.1} px, off {:?}", blurred - mean);
    assert!(swept_px > 9.0, "{swept_px}");
    assert!((blurred - mean).norm() < 0.03, "{blurred} for {mean}");
    assert!((light / mean_light - 1.0).abs() < 0.005, "{light} for {mean_light}");
}

/// Returns a scene with every kind of object.
fn busy() -> (Imager, Vec<TagPlane>, Vec<[Isometry3<f64>; 3]>) {
    let light = Light {
        position_m: Point3::new(0.4, -0.5, 0.0),
        direction: Unit::new_normalize(Vector3::new(-0.2, 0.3, 1.0)),
        flux_lm: 10_000.0,
        half_angle_rad: 0.8,
    };
    let spec = ImageSpec { water: WaterKind::Coastal, snow_per_m3: 200.0, ..ImageSpec::default() };
    let mut imager = Imager::new(&lens(), &spec, &[light], 5);
    let solid = |shape: Shape, is_ground: bool| SolidShape { shape, color_rgb: [200, 120, 40], is_ground };
    imager.set_solids(&[
        solid(Shape::Box { size_m: [20.0, 1.0, 20.0] }, true),
        solid(Shape::Capsule { radius_m: 0.05, length_m: 0.6 }, false),
        solid(Shape::Cylinder { radius_m: 0.1, length_m: 0.3 }, false),
    ]);
    let still = |x: f64, y: f64, z: f64| [Isometry3::translation(x, y, z); 3];
    let solids = vec![still(0.0, 1.4, 0.0), still(0.3, 0.1, 0.8), still(-0.4, 0.2, 1.1)];
    let tags = (0..4).map(|k| {
        let x = f64::from(k);
        TagPlane::fixed(k, 0.15, ahead([350.0 + 150.0 * x, 400.0 + 30.0 * x], 0.6 + 0.3 * x, [0.2 * x, 0.1, 0.3]))
    });
    (imager, tags.collect(), solids)
}

#[test]
fn threads_do_not_show() {
    let render = |n_threads: usize| {
        let (mut imager, tags, solids) = busy();
        let turned = |a: f64| Isometry3::new(Vector3::zeros(), Vector3::new(a, 0.5 * a, 0.0));
        let base_from_camera = [-0.004, 0.0, 0.004].map(turned);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        let still = Shot::of_tags(base_from_camera[1], &tags, 7);
        pool.install(|| {
            let moving = imager.take_image(&Shot { solids: &solids, base_from_camera, ..still }).clone();
            (moving, imager.take_image(&Shot { solids: &solids, ..still }).clone())
        })
    };
    let (one, two) = (render(1), render(3));
    assert!(one == two);
    assert!(one.0 != one.1 && one.0.rgb.iter().any(|v| *v > 200), "there is something to see");
}

#[test]
fn what_is_nearer_hides_what_is_behind_it() {
    let pose = ahead(center(), 1.0, [0.0; 3]);
    let tag = [TagPlane::fixed(BLANK, 0.15, pose)];
    let mut imager = Imager::new(&lens(), &ImageSpec::clean(), &[], 1);
    let plate = Shape::Box { size_m: [0.3, 0.3, 0.01] };
    imager.set_solids(&[SolidShape { shape: plate, color_rgb: [128, 128, 128], is_ground: false }]);
    let mut level = |along_m: f64| {
        // In the tag's frame, the front of its plate is `along_m` before the print.
        let plate = [pose * Isometry3::translation(0.0, 0.0, along_m - 0.005); 3];
        let frame = imager.take_image(&Shot { solids: &[plate], ..Shot::of_tags(Isometry3::identity(), &tag, 0) });
        at(frame, center())[1]
    };
    let white = 255.0 * WHITE;
    let grey = 255.0 * (128.0_f64 / 255.0).powf(2.2);
    for (along_m, expected) in [(-0.0015, white), (-0.3, white), (0.004, white), (0.02, grey), (0.5, grey)] {
        assert!((level(along_m) - expected).abs() < 1.5, "{along_m}: {} for {expected}", level(along_m));
    }
    // The back of a tag is not printed.
    let back = [TagPlane::fixed(0, 0.15, ahead(center(), 0.5, [PI, 0.0, 0.0]))];
    let frame = shot(&ImageSpec::clean(), &[], &back);
    for k in 0..100 {
        let place = Point3::new(0.01 * f64::from(k % 10) - 0.045, 0.01 * f64::from(k / 10) - 0.045, 0.0);
        let pixel = lens().project(&(back[0].base_from_tag[1] * place).coords).expect("in view");
        assert!((at(&frame, pixel.into())[1] - white).abs() < 1.5, "{place}");
    }
}

/// Rays from outside meet shapes where parry's do.
#[test]
fn rays_meet_shapes_where_parry_says() {
    use parry3d::math::Vec3 as P;
    let corners = [[0.2, 0.1, -0.3], [-0.3, 0.2, -0.1], [0.0, -0.3, 0.0], [0.1, 0.1, 0.4], [-0.1, 0.25, 0.2]];
    let shapes = [
        Shape::Box { size_m: [0.3, 0.5, 0.7] },
        Shape::Cylinder { radius_m: 0.2, length_m: 0.6 },
        Shape::Capsule { radius_m: 0.15, length_m: 0.5 },
        Shape::Sphere { radius_m: 0.3 },
        Shape::Hull(Hull::new(&corners).expect("a hull")),
    ];
    let mut rng = stream_rng(2, "rays");
    for shape in &shapes {
        let (form, solid) = (Form::of_shape(shape), shape.to_parry());
        // Parry iterates on capsules.
        let limit_m = if matches!(shape, Shape::Capsule { .. }) { 2e-4 } else { 1e-5 };
        let mut n_hits = 0;
        for _ in 0..4000 {
            let mut draw = || rng.random_range(-1.0..1.0);
            let base_from_shape = Isometry3::new(Vector3::zeros(), Vector3::new(draw(), draw(), draw()) * 2.0);
            let eye = Vector3::new(draw(), draw(), draw()).normalize() * (1.2 + 0.5 * draw());
            let to = Vector3::new(draw(), draw(), draw()) * 0.3 - eye;
            let ray = to.normalize();
            let camera = Isometry3::translation(eye.x, eye.y, eye.z);
            let place = Place::new(&(base_from_shape.inverse() * camera));
            let [found] = form.enter(&place, &[[ray.x as f32], [ray.y as f32], [ray.z as f32]]);
            let pose = parry_pose(&(base_from_shape * shape.axis_fix()));
            let parry_ray = parry3d::query::Ray::new(P::new(eye.x, eye.y, eye.z), P::new(ray.x, ray.y, ray.z));
            let expected = solid.cast_ray_and_get_normal(&pose, &parry_ray, 10.0, true);
            let Some(expected) = expected else {
                let near_m = nearest(&*solid, &pose, &parry_ray);
                assert!(found.is_infinite() || near_m < 1e-3, "{shape:?}: met at {found}, misses by {near_m}");
                continue;
            };
            if found.is_infinite() {
                // Ray that grazes the shape.
                assert!(
                    expected.normal.dot(parry_ray.dir).abs() < 0.05,
                    "{shape:?}: missed at {}",
                    expected.time_of_impact
                );
                continue;
            }
            n_hits += 1;
            let (_, _, normal) = form.meet(&place, &ray.cast(), found);
            let is_flat_on = normal.cast::<f64>().dot(&ray) < -0.05;
            let off_m = (f64::from(found) - expected.time_of_impact).abs();
            assert!(off_m < limit_m || !is_flat_on, "{shape:?}: {found}, off by {off_m}");
            let n = expected.normal;
            let apart = (normal.cast::<f64>() - Vector3::new(n.x, n.y, n.z)).norm();
            // At a crease either normal is correct.
            assert!(
                apart < 5e-3 || is_near_crease(shape, &base_from_shape, &(eye + ray * f64::from(found))),
                "{shape:?}: {apart}"
            );
        }
        assert!(n_hits > 1000, "{shape:?}: {n_hits}");
    }
}

/// Returns the smallest distance of a ray from a shape, m.
fn nearest(solid: &dyn parry3d::shape::Shape, pose: &parry3d::math::Pose3, ray: &parry3d::query::Ray) -> f64 {
    let at = |k: i32| solid.distance_to_point(pose, ray.origin + ray.dir * (0.005 * f64::from(k)), true);
    (0..600).map(at).fold(f64::INFINITY, f64::min)
}

fn is_near_crease(shape: &Shape, base_from_shape: &Isometry3<f64>, place: &Vector3<f64>) -> bool {
    let p = base_from_shape.inverse() * Point3::from(*place);
    match *shape {
        Shape::Box { size_m } => (0..3).filter(|&k| (p[k].abs() - 0.5 * size_m[k]).abs() < 1e-4).count() > 1,
        Shape::Cylinder { radius_m, length_m } => {
            (p.x.hypot(p.y) - radius_m).abs() < 1e-4 && (p.z.abs() - 0.5 * length_m).abs() < 1e-4
        }
        _ => matches!(shape, Shape::Hull(_)),
    }
}
