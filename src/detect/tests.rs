//! Detected against projected corners, and rejected candidates, on images with known truth.

use std::f64::consts::TAU;

use nalgebra::{Vector2, Vector3};
use rand::RngExt;

use crate::synthetic::{CLEAN, PlacedTag, Rendering, Window, overlap, render};
use crate::*;
use armcal_core::optics::fixture::{fisheye, lens};
use armcal_core::optics::{CameraModel, Fisheye, TagFamily};
use armcal_core::stats::{quantile, stream_rng};
use armcal_core::streams::RejectReason;

fn detector(lens: &CameraModel, settings: DetectorSettings) -> TagDetector {
    TagDetector::new(lens, settings).expect("it starts")
}

fn detect_in(lens: &CameraModel, settings: DetectorSettings, data: &[u8]) -> ImageDetections {
    let [width, height] = lens.resolution_px().map(|n| n as usize);
    detector(lens, settings).detect(GreyImage { width, height, data }).expect("an image of the lens")
}

fn drawn(lens: &CameraModel, rendering: &Rendering, tags: &[PlacedTag]) -> Vec<u8> {
    render(lens, rendering, tags, &mut stream_rng(1, "detect/test"))
}

fn ahead(id: u32, x_m: f64, z_m: f64) -> PlacedTag {
    PlacedTag::new(id, 0.15, Vector3::new(x_m, 0.05, z_m), [0.3, 0.5, 0.2])
}

fn reasons(detections: &ImageDetections) -> Vec<(u32, RejectReason)> {
    detections.rejects.iter().map(|reject| (reject.id, reject.reason)).collect()
}

#[derive(Default)]
struct DetectionErrors {
    n_drawn: usize,
    n_found: usize,
    errors_px: Vec<f64>,
    /// Squared errors in units of their covariance: chi-square of 2 degrees.
    normalised: Vec<f64>,
}

impl DetectionErrors {
    /// Returns the RMS error per pixel coordinate.
    fn rms_px(&self) -> f64 {
        (self.errors_px.iter().map(|e| e * e).sum::<f64>() / self.errors_px.len() as f64 / 2.0).sqrt()
    }

    fn mean_normalised(&self) -> f64 {
        self.normalised.iter().sum::<f64>() / self.normalised.len() as f64
    }
}

/// A tag anywhere in view.
fn drawn_tag(number: u64, ranges_m: [f64; 2], incidences_rad: [f64; 2]) -> PlacedTag {
    let mut rng = stream_rng(number, "detect/trials");
    let mut uniform = |[a, b]: [f64; 2]| rng.random_range(a..=b);
    let (angle, around, range) = (uniform([0.0, 1.1]), uniform([0.0, TAU]), uniform(ranges_m));
    let center = Vector3::new(angle.sin() * around.cos(), angle.sin() * around.sin(), angle.cos()) * range;
    let pose = [uniform(incidences_rad), uniform([0.0, TAU]), uniform([0.0, TAU])];
    PlacedTag::new((number * 7 % 587) as u32, 0.15, center, pose)
}

/// Tags by image: each in the first image where it covers no other.
fn by_image(lens: &CameraModel, tags: impl Iterator<Item = PlacedTag>) -> Vec<Vec<PlacedTag>> {
    let mut images: Vec<(Vec<PlacedTag>, Vec<Window>)> = Vec::new();
    for tag in tags {
        let window = tag.window(lens).expect("in view");
        let is_free = |(_, windows): &(_, Vec<Window>)| !windows.iter().any(|other| overlap(&window, other));
        let place = images.iter().position(is_free).unwrap_or(images.len());
        if place == images.len() {
            images.push((Vec::new(), Vec::new()));
        }
        images[place].0.push(tag);
        images[place].1.push(window);
    }
    images.into_iter().map(|(tags, _)| tags).collect()
}

fn trials(
    numbers: std::ops::Range<u64>,
    rendering: &Rendering,
    ranges_m: [f64; 2],
    incidences_rad: [f64; 2],
) -> DetectionErrors {
    let lens = lens();
    let mut detector = detector(&lens, DetectorSettings::default());
    let mut errors = DetectionErrors::default();
    let tags = numbers.map(|number| drawn_tag(number, ranges_m, incidences_rad));
    let whole = tags.filter(|tag| tag.corners_px(&lens).is_some());
    for (image, tags) in by_image(&lens, whole).into_iter().enumerate() {
        let data = render(&lens, rendering, &tags, &mut stream_rng(image as u64, "detect/trials/noise"));
        let detections = detector.detect(GreyImage { width: 1224, height: 1024, data: &data }).expect("of the lens");
        errors.n_drawn += tags.len();
        errors.n_found += detections.tags.len();
        for DetectedTag { detection, covariances_px2 } in &detections.tags {
            let tag = tags.iter().find(|tag| tag.id == detection.id).expect("a tag of the image");
            let truth = tag.corners_px(&lens).expect("in view");
            for ((corner, truth), covariance) in detection.corners_px.iter().zip(truth).zip(covariances_px2) {
                let error = Vector2::from(*corner) - Vector2::from(truth);
                let inverse = covariance.try_inverse().expect("regular");
                errors.errors_px.push(error.norm());
                errors.normalised.push((error.transpose() * inverse * error).x);
            }
        }
    }
    errors
}

/// Places tags at any spin and position. A wrong order of the corners would make errors as large as a side.
#[test]
fn clean_corners_are_those_of_the_projection() {
    for (ranges, incidences) in [([0.4, 0.8], [0.0, 0.9]), ([0.8, 1.6], [0.0, 0.9]), ([1.6, 2.5], [0.0, 0.6])] {
        let errors = trials(0..12, &CLEAN, ranges, incidences);
        let worst = quantile(&errors.errors_px, 0.95).expect("some");
        eprintln!(
            "{ranges:?} m: {} of {}, rms {:.4} px, 95 % below {worst:.4} px",
            errors.n_found,
            errors.n_drawn,
            errors.rms_px()
        );
        assert_eq!(errors.n_found, errors.n_drawn);
        assert!(errors.rms_px() < 0.02 && worst < 0.05, "{} {worst}", errors.rms_px());
    }
}

/// In white noise the covariances are 1.5 times too large, which marine snow requires: the mean of the normalized
/// squares is 2/1.5. Means of about 150 squares have a standard deviation of 0.11. At the largest contrast, the
/// variance floor makes the errors smaller than the covariance says.
#[test]
fn noisy_corners_err_as_their_covariance_says() {
    for (contrast, blur_px, band) in [(120.0, 1.0, 0.5..=2.2), (40.0, 0.4, 0.9..=2.2), (30.0, 1.0, 0.9..=2.2)] {
        let rendering = Rendering { white: 40.0 + contrast, black: 40.0, around: 60.0, blur_px, noise: 3.0 };
        let errors = trials(100..140, &rendering, [0.5, 2.0], [0.0, 0.9]);
        let mean = errors.mean_normalised();
        let [middle, high] = [0.5, 0.95].map(|q| quantile(&errors.normalised, q).expect("some"));
        eprintln!(
            "contrast {contrast}, blur {blur_px}: {} of {}, rms {:.4} px, \
             squares mean {mean:.2}, 50 % {middle:.2}, 95 % {high:.2}",
            errors.n_found,
            errors.n_drawn,
            errors.rms_px()
        );
        assert!(errors.n_found + 1 >= errors.n_drawn && errors.rms_px() < 0.1);
        // Chi-square of 2 degrees: median 1.39, 95 % below 5.99.
        assert!(band.contains(&mean) && middle < 1.9 && high < 8.0, "{mean} {middle} {high}");
    }
}

#[test]
fn noise_shows_nothing() {
    let lens = lens();
    for seed in 0..4 {
        let mut rng = stream_rng(seed, "detect/noise");
        let data: Vec<u8> = (0..1224 * 1024).map(|_| rng.random_range(0..=255)).collect();
        let detections = detect_in(&lens, DetectorSettings::default(), &data);
        assert!(detections.tags.is_empty(), "{:?}", detections.tags);
    }
    // Patches as large as a tag, with random cells instead of a tag's, hold no tag of the family.
    let mut rng = stream_rng(9, "detect/noise");
    for _ in 0..3 {
        let cells: Vec<u8> = (0..128 * 154).map(|_| if rng.random_range(0.0..1.0) < 0.5 { 20 } else { 220 }).collect();
        let data: Vec<u8> = (0..1224 * 1024).map(|i| cells[i / 1224 / 8 * 154 + i % 1224 / 8]).collect();
        let detections = detect_in(&lens, DetectorSettings::default(), &data);
        assert!(detections.tags.is_empty(), "{:?}", detections.tags);
    }
}

/// Each family's corners are those of 36h11 within its noise, and none of its tags is read as one of another family.
#[test]
fn tags_of_each_family_are_found_where_they_are() {
    // The images end where the tags end.
    let lens = Fisheye { center_px: [260.0, 160.0], resolution_px: [520, 320], ..fisheye() }.into();
    let of_family = |family| detector(&lens, DetectorSettings::of_family(family));
    // Tables of large families take seconds to make, so those families are tested on their own tags only, in few
    // images.
    let is_small = |family: &TagFamily| family.n_tags() < 5000;
    let mut small: Vec<(TagFamily, TagDetector)> =
        TagFamily::ALL.into_iter().filter(is_small).map(|family| (family, of_family(family))).collect();
    for family in TagFamily::ALL {
        let mut large = (!is_small(&family)).then(|| (family, of_family(family)));
        let mut errors_px = Vec::new();
        let n_images = if family.n_tags() > 1000 { 4 } else { 10 };
        for id in 0..n_images {
            let tag = PlacedTag { family, ..ahead(3 * id, 0.03 * f64::from(id), 0.7) };
            let image = drawn(&lens, &Rendering { noise: 3.0, ..CLEAN }, &[tag]);
            // Families whose border is outermost are held against each other in all images.
            let is_old = |family: TagFamily| family.n_margin_cells() == 1;
            for (other, detector) in small.iter_mut().chain(&mut large) {
                if *other != family && id != 3 && !(is_old(family) && is_old(*other)) {
                    continue;
                }
                let found =
                    detector.detect(GreyImage { width: 520, height: 320, data: &image }).expect("detected").tags;
                let expected = if *other == family { vec![3 * id] } else { vec![] };
                let ids: Vec<u32> = found.iter().map(|tag| tag.detection.id).collect();
                assert_eq!(ids, expected, "{family} {other}");
                let truth = tag.corners_px(&lens).expect("in view");
                let pairs = found.iter().flat_map(|tag| tag.detection.corners_px.into_iter().zip(truth));
                errors_px.extend(pairs.map(|(found, truth)| (found[0] - truth[0]).hypot(found[1] - truth[1])));
            }
        }
        assert!(quantile(&errors_px, 0.95).expect("some") < 0.1, "{family}: {errors_px:?}");
    }
}

#[test]
fn an_id_at_two_places_is_no_tag() {
    let lens = lens();
    let tags = [ahead(5, -0.2, 0.8), ahead(5, 0.2, 0.8), ahead(6, 0.0, 1.4)];
    let detections = detect_in(&lens, DetectorSettings::default(), &drawn(&lens, &CLEAN, &tags));
    assert_eq!(detections.tags.iter().map(|tag| tag.detection.id).collect::<Vec<_>>(), [6]);
    assert_eq!(reasons(&detections), [(5, RejectReason::SeenTwice); 2]);
}

/// Cells painted over: as many as are corrected, and more.
#[test]
fn wrong_bits_are_counted() {
    let lens = lens();
    let tag = ahead(3, 0.02, 0.5);
    let clean = drawn(&lens, &CLEAN, &[tag]);
    let cells = TagFamily::Tag36h11.cells(3).expect("in the family");
    let inverse = tag.camera_from_tag.inverse();
    // The first cells of the second row within the border, in the colour that they do not have.
    let painted = |n_wrong: usize| {
        let mut data = clean.clone();
        for (i, value) in data.iter_mut().enumerate() {
            let Some(bearing) = lens.unproject(&Vector2::new((i % 1224) as f64, (i / 1224) as f64)) else { continue };
            let (origin, direction) = (inverse.translation.vector, inverse.rotation * bearing.into_inner());
            let at = origin - direction * (origin.z / direction.z);
            let cell_m = tag.size_m / 8.0;
            let (column, row) = ((at.x / cell_m + 4.0).floor(), (4.0 - at.y / cell_m).floor());
            if row == 2.0 && (1.0..=n_wrong as f64).contains(&column) {
                *value = if cells.get(3, 1 + column as usize) == Some(true) { CLEAN.black } else { CLEAN.white } as u8;
            }
        }
        data
    };
    let strict = || DetectorSettings { max_wrong_bits: 0, ..DetectorSettings::default() };
    assert_eq!(detect_in(&lens, strict(), &clean).tags.len(), 1);
    assert_eq!(detect_in(&lens, DetectorSettings::default(), &painted(2)).tags.len(), 1);
    let detections = detect_in(&lens, strict(), &painted(1));
    assert!(detections.tags.is_empty());
    assert_eq!(reasons(&detections), [(3, RejectReason::WrongBits)]);
    assert!(detect_in(&lens, DetectorSettings::default(), &painted(4)).tags.is_empty());
}

#[test]
fn doubtful_tags_are_rejected_with_the_reason() {
    let lens = lens();
    let tag = ahead(42, 0.1, 0.9);
    let clean = drawn(&lens, &CLEAN, &[tag]);
    let default = DetectorSettings::default;
    let other = DetectorSettings { known_ids: Some(vec![41]), ..default() };
    assert_eq!(reasons(&detect_in(&lens, other, &clean)), [(42, RejectReason::UnknownId)]);
    let large = DetectorSettings { min_side_px: 300.0, ..default() };
    assert_eq!(reasons(&detect_in(&lens, large, &clean)), [(42, RejectReason::TooSmall)]);
    let contrast = DetectorSettings { min_contrast: 200.0, ..default() };
    assert_eq!(reasons(&detect_in(&lens, contrast, &clean)), [(42, RejectReason::LowContrast)]);
    // A tag whose border the image does not have where the code says: half of it hidden by a grey bar.
    let sure = DetectorSettings { max_corner_std_px: 1e-4, ..default() };
    assert_eq!(reasons(&detect_in(&lens, sure, &clean)), [(42, RejectReason::PoorEdges)]);
    // The tag is beyond the assumed field of view.
    let narrow = Fisheye { max_view_angle_rad: 0.05, ..fisheye() }.into();
    let detections = detect_in(&narrow, default(), &clean);
    assert_eq!(reasons(&detections), [(42, RejectReason::OutOfView)]);
}

/// Tags near the rim, where the lens bends most, and those that the image cuts off.
#[test]
fn the_rim_of_the_image_is_no_trap() {
    let lens = lens();
    let (mut n_whole, mut n_found) = (0, 0);
    for step in 0..12 {
        let angle = 1.1 + 0.03 * f64::from(step);
        let center = Vector3::new(angle.sin(), 0.1, angle.cos()) * 0.7;
        let tag = PlacedTag::new(step, 0.15, center, [0.2, f64::from(step), 0.0]);
        let truth = tag.corners_px(&lens);
        // The whole scene is drawn even where corners are beyond the rim.
        let detections = detect_in(&lens, DetectorSettings::default(), &drawn(&lens, &CLEAN, &[tag]));
        let Some(truth) = truth else {
            assert!(detections.tags.is_empty());
            continue;
        };
        n_whole += 1;
        for errors in &detections.tags {
            n_found += 1;
            for (a, b) in errors.detection.corners_px.iter().zip(truth) {
                assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 0.1, "{a:?} {b:?}");
            }
        }
    }
    assert!(n_whole >= 6 && n_found + 1 >= n_whole, "{n_found} of {n_whole}");
}

#[test]
fn the_same_image_gives_the_same_bytes_and_a_wrong_size_an_error() {
    let lens = lens();
    let data = drawn(&lens, &Rendering { noise: 4.0, ..CLEAN }, &[ahead(7, 0.1, 0.9), ahead(8, -0.3, 1.2)]);
    let image = GreyImage { width: 1224, height: 1024, data: &data };
    let mut detector = detector(&lens, DetectorSettings::default());
    let first = detector.detect(image).expect("detected");
    assert_eq!(first.tags.len(), 2);
    assert_eq!(detector.detect(image).expect("detected"), first);
    let short = GreyImage { data: &data[1..], ..image };
    assert_eq!(detector.detect(short), Err(DetectError::Size { bytes: data.len() - 1, width: 1224, height: 1024 }));
    let error = detector.detect(GreyImage { width: 1024, height: 1224, data: &data }).expect_err("turned");
    let wanted = DetectError::Resolution { width: 1024, height: 1224, lens_width: 1224, lens_height: 1024 };
    assert_eq!(error, wanted);
}
