use crate::say::constants::length_unit::UNITS;
use crate::say::wrong_input::WrongInputKind;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;
use std::sync::LazyLock;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use super::lens::{of_other_model, scaled};
use super::map::{margin_hint, other_axes};
use super::recording::reordered_back;
use super::*;
use crate::fixture::titan;
use crate::views::association::{associate, surveyed};
use crate::views::view::TagMeasurement;
use armcal_core::log::read_recording;
use armcal_core::optics::{LensModel, TagFamily, solve_square};
use armcal_core::spatial::Pose;

/// Views of the sample, and the arm with the tags in its scene.
fn sample() -> (CaptureData, Robot) {
    static SAMPLE: LazyLock<(CaptureData, Robot)> = LazyLock::new(read_sample);
    SAMPLE.clone()
}

fn read_sample() -> (CaptureData, Robot) {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/sample/run.mcap");
    let recording = read_recording(&file).expect("the sample reads");
    let robot = surveyed(&recording, &titan()).into_owned();
    (associate(&recording, &robot), robot)
}

fn found(data: &CaptureData, robot: &Robot) -> Option<WrongInputKind> {
    wrong_input(data, &robot.tags, robot).map(|wrong| wrong.input)
}

/// Returns the robot with each tag's pose as `change` makes it of its index and pose.
fn with_tags(robot: &Robot, change: impl Fn(usize, &Isometry3<f64>) -> Isometry3<f64>) -> Robot {
    let mut robot = robot.clone();
    for (k, tag) in robot.tags.iter_mut().enumerate() {
        tag.base_from_tag = Pose::from_isometry(change(k, tag.base_from_tag.isometry()));
    }
    robot
}

#[test]
fn a_map_and_a_lens_that_are_right_are_not_blamed() {
    let (data, robot) = sample();
    let views: Vec<&View> = data.fit.iter().collect();
    let pairs = mismatch(&views, &robot.tags, &robot.camera.lens).expect("pairs of tags");
    assert!(pairs.mismatch < 0.5 * GOOD && (pairs.ratio - 1.0).abs() < 0.01, "{} {}", pairs.mismatch, pairs.ratio);
    assert_eq!(found(&data, &robot), None);
    // A frame that is turned or shifted as a whole is not named either, because the arm is involved.
    let turn = Isometry3::new(Vector3::new(0.3, 0.0, 0.1), Vector3::new(0.0, 0.0, 1.6));
    assert_eq!(found(&data, &with_tags(&robot, |_, pose| turn * pose)), None);
}

#[test]
fn quaternions_of_the_map_in_the_other_order_are_told() {
    let (data, robot) = sample();
    let written =
        |_: usize, pose: &Isometry3<f64>| Isometry3::from_parts(pose.translation, reordered_back(&pose.rotation));
    let robot = with_tags(&robot, written);
    let wrong = wrong_input(&data, &robot.tags, &robot).expect("a wrong input");
    assert_eq!(wrong.input, WrongInputKind::MapQuaternions);
    insta::assert_snapshot!("map_quaternions", format!("{wrong}; {}", wrong.remedy()));
}

/// Conventions of other programs: z into the tag, another first corner, x out of the tag.
#[test]
fn tags_that_are_all_turned_alike_are_told_with_the_turn() {
    let (data, robot) = sample();
    let turns = [(Vector3::x(), 2.0), (Vector3::z(), 1.0), (Vector3::z(), 2.0), (Vector3::y(), -1.0)];
    for (axis, quarters) in turns {
        let turn = UnitQuaternion::from_scaled_axis(axis * (quarters * FRAC_PI_2));
        let turned = with_tags(&robot, |_, pose| pose * turn);
        let wrong = wrong_input(&data, &turned.tags, &turned).expect("a wrong input");
        let WrongInputKind::TagFrames([w, x, y, z]) = wrong.input else { panic!("{wrong}") };
        let back = turn * UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        assert!(back.angle() < 1e-6, "{wrong}");
    }
}

#[test]
fn a_survey_in_another_unit_is_told() {
    let (data, robot) = sample();
    for (unit, per_m) in UNITS {
        let scaled = |_: usize, pose: &Isometry3<f64>| {
            Isometry3::from_parts((pose.translation.vector * per_m).into(), pose.rotation)
        };
        assert_eq!(found(&data, &with_tags(&robot, scaled)), Some(WrongInputKind::MapUnit(unit.to_owned())));
    }
}

#[test]
fn a_map_of_other_tags_is_told() {
    let (data, robot) = sample();
    let n = robot.tags.len();
    let places: Vec<Isometry3<f64>> = robot.tags.iter().map(|tag| *tag.base_from_tag.isometry()).collect();
    let exchanged = with_tags(&robot, |k, _| places[(k + 3) % n]);
    assert_eq!(found(&data, &exchanged), Some(WrongInputKind::OtherMap));
}

#[test]
fn ids_that_are_exchanged_among_a_few_tags_are_told() {
    let (data, robot) = sample();
    let places: Vec<Isometry3<f64>> = robot.tags.iter().map(|tag| *tag.base_from_tag.isometry()).collect();
    let ring = with_tags(&robot, |k, pose| if k < 3 { places[(k + 1) % 3] } else { *pose });
    let ids: Vec<u32> = robot.tags[..3].iter().map(|tag| tag.id).collect();
    let wrong = wrong_input(&data, &ring.tags, &ring).expect("a wrong input");
    assert!(matches!(&wrong.input, WrongInputKind::ExchangedIds(found) if *found == ids), "{wrong}");
    // Tags that were moved elsewhere are no exchange.
    let by = Isometry3::translation(0.4, 0.3, 0.0);
    let moved = with_tags(&robot, |k, pose| if k < 2 { by * pose } else { *pose });
    assert_eq!(found(&data, &moved), None);
}

#[test]
fn a_lens_of_another_image_size_is_told() {
    let (data, robot) = sample();
    let with_lens = |scale: f64| {
        let mut other = robot.clone();
        other.camera.lens = scaled(&robot.camera.lens, scale);
        other
    };
    assert_eq!(found(&data, &with_lens(2.0)), Some(WrongInputKind::ImageScale(2.0)));
    assert_eq!(found(&data, &with_lens(0.5)), Some(WrongInputKind::ImageScale(0.5)));
    let mut pinhole = robot.clone();
    pinhole.camera.lens = of_other_model(&robot.camera.lens);
    assert_eq!(found(&data, &pinhole), Some(WrongInputKind::LensModel));
    let mut half = with_lens(0.5);
    let LensModel::Equidistant(lens) = &mut half.camera.lens.lens else { panic!("a fisheye") };
    lens.resolution_px = lens.resolution_px.map(|side| side / 2);
    assert!(matches!(found(&data, &half), Some(WrongInputKind::ImageSize { stated_px: [612, 512], .. })));
}

/// Surveys in a left-handed frame: an axis of the other sign, or two exchanged.
#[test]
fn a_mirrored_survey_is_told_with_its_axes() {
    let (data, robot) = sample();
    for (words, axes) in other_axes() {
        let mirrored = |_: usize, pose: &Isometry3<f64>| {
            let place = Vector3::from(axes.map(|(axis, sign)| sign * pose.translation.vector[axis]));
            Isometry3::from_parts(place.into(), pose.rotation)
        };
        assert_eq!(found(&data, &with_tags(&robot, mirrored)), Some(WrongInputKind::MapAxes(words)));
    }
}

#[test]
fn corners_that_are_no_pixels_of_the_image_are_told() {
    let (data, robot) = sample();
    let [center_x, center_y] = robot.camera.lens.center_px();
    let sides_px = robot.camera.lens.resolution_px().map(f64::from);
    let with_extent = |of: &dyn Fn([f64; 2]) -> [f64; 2]| CaptureData {
        smallest_px: of(data.smallest_px),
        largest_px: of(data.largest_px),
        ..data.clone()
    };
    let from_center = with_extent(&|[x, y]| [x - center_x, y - center_y]);
    assert_eq!(found(&from_center, &robot), Some(WrongInputKind::NegativePixels(from_center.smallest_px)));
    let shares = with_extent(&|px| [px[0] / sides_px[0], px[1] / sides_px[1]]);
    assert_eq!(found(&shares, &robot), Some(WrongInputKind::ImageShares));
    // A detector that rounds reaches a little over the edge.
    let rounded = with_extent(&|[x, y]| [x - 2.0, y - 2.0]);
    assert_eq!(found(&rounded, &robot), None);
}

/// The images are rectified, with the lens as it was before.
#[test]
fn a_distortion_that_the_images_do_not_have_is_told() {
    let (data, mut robot) = sample();
    let [fx, fy, cx, cy, ..] = robot.camera.lens.intrinsics();
    robot.camera.lens = robot.camera.lens.with_intrinsics([fx, fy, cx, cy, 0.25, 0.1, 0.0, 0.0]);
    assert_eq!(found(&data, &robot), Some(WrongInputKind::Distortion));
}

#[test]
fn a_tag_size_is_told_and_the_margin_of_the_print() {
    let (data, robot) = sample();
    let mut words = Vec::new();
    for (family, share) in [
        (TagFamily::Tag36h11, 1.25),
        (TagFamily::Tag36h11, 0.8),
        (TagFamily::Tag25h9, 9.0 / 7.0),
        (TagFamily::Standard41h12, 9.0 / 5.0),
        (TagFamily::Standard52h13, 0.6),
    ] {
        let mut other = robot.clone();
        other.tag_family = family;
        other.tags.iter_mut().for_each(|tag| tag.size_m *= share);
        let wrong = wrong_input(&data, &other.tags, &other).expect("a wrong input");
        assert!(matches!(wrong.input, WrongInputKind::TagSize(ratio) if (ratio * share - 1.0).abs() < 0.01), "{wrong}");
        words.push(wrong.to_string());
    }
    insta::assert_snapshot!("tag_sizes", words.join("\n"));
    let hint = |ratio| margin_hint(TagFamily::Tag36h11, ratio);
    assert_eq!((hint(1.1), hint(1.0), hint(5.0 / 9.0)), (None, None, None));
}

/// A tag that nearly all views show.
const OFTEN_SEEN: usize = 4;

/// Returns all landmarks as a program may have written their poses.
fn recorded(data: &CaptureData, robot: &Robot, write: impl Fn(&Isometry3<f64>) -> TagMeasurement) -> CaptureData {
    let mut data = data.clone();
    for seen in data.fit.iter_mut().chain(&mut data.held_out).flat_map(|view| &mut view.tags) {
        let corners = seen.corners().expect("corners").corners_px;
        let pose = solve_square(&robot.camera.lens, robot.tags[seen.tag_idx].size_m, &corners).expect("a pose");
        seen.measured = write(pose.camera_from_tag.isometry());
    }
    data
}

/// Returns one landmark per view, with its pose as a program may have written it.
fn posed(data: &CaptureData, robot: &Robot, write: impl Fn(&Isometry3<f64>) -> Isometry3<f64>) -> CaptureData {
    let mut data = data.clone();
    for view in data.fit.iter_mut().chain(&mut data.held_out) {
        view.tags.retain(|seen| seen.tag_idx == OFTEN_SEEN);
    }
    recorded(&data, robot, |pose| TagMeasurement::Pose(write(pose)))
}

#[test]
fn recorded_poses_in_another_order_or_direction_are_told() {
    let (data, robot) = sample();
    let found = |write: &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>| found(&posed(&data, &robot, write), &robot);
    assert_eq!(found(&|pose| *pose), None);
    let turned = |pose: &Isometry3<f64>| Isometry3::from_parts(pose.translation, reordered_back(&pose.rotation));
    assert_eq!(found(&turned), Some(WrongInputKind::RecordedQuaternions));
    assert_eq!(found(&|pose| turned(&pose.inverse()).inverse()), Some(WrongInputKind::RecordedQuaternions));
    assert_eq!(found(&|pose| pose.inverse()), Some(WrongInputKind::RecordedDirection));
}

/// The tags of one view determine the reading of their poses, with the map as it is.
#[test]
fn recorded_poses_of_several_tags_are_told_without_the_arm() {
    let (data, robot) = sample();
    let found = |write: &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>| {
        found(&recorded(&data, &robot, |pose| TagMeasurement::Pose(write(pose))), &robot)
    };
    let turned = |pose: &Isometry3<f64>| Isometry3::from_parts(pose.translation, reordered_back(&pose.rotation));
    assert_eq!(found(&|pose| *pose), None);
    assert_eq!(found(&|pose| pose.inverse()), Some(WrongInputKind::RecordedDirection));
    assert_eq!(found(&turned), Some(WrongInputKind::RecordedQuaternions));
    assert_eq!(found(&|pose| turned(&pose.inverse()).inverse()), Some(WrongInputKind::RecordedQuaternions));
    assert_eq!(found(&|pose| turned(pose).inverse()), Some(WrongInputKind::RecordedOrderAndDirection));
    assert_eq!(found(&|pose| turned(&pose.inverse())), Some(WrongInputKind::RecordedOrderAndDirection));
    let of_inverse = |pose: &Isometry3<f64>| Isometry3::from_parts(pose.translation, pose.rotation.inverse());
    assert_eq!(found(&of_inverse), Some(WrongInputKind::RecordedRotations));
}

/// Right poses do not hide a wrong map.
#[test]
fn a_wrong_map_is_told_by_recorded_poses_too() {
    let (data, robot) = sample();
    let data = recorded(&data, &robot, |pose| TagMeasurement::Pose(*pose));
    let written =
        |_: usize, pose: &Isometry3<f64>| Isometry3::from_parts(pose.translation, reordered_back(&pose.rotation));
    assert_eq!(found(&data, &with_tags(&robot, written)), Some(WrongInputKind::MapQuaternions));
    let scaled =
        |_: usize, pose: &Isometry3<f64>| Isometry3::from_parts((1e3 * pose.translation.vector).into(), pose.rotation);
    assert_eq!(found(&data, &with_tags(&robot, scaled)), Some(WrongInputKind::MapUnit("mm".to_owned())));
}

/// The positions come with their rotations or without them.
#[test]
fn a_scale_of_recorded_positions_is_not_called_the_size_of_the_tags() {
    let (data, robot) = sample();
    let with_poses = |scale: f64| {
        let scaled =
            |pose: &Isometry3<f64>| Isometry3::from_parts((scale * pose.translation.vector).into(), pose.rotation);
        recorded(&data, &robot, |pose| TagMeasurement::Pose(scaled(pose)))
    };
    let with_positions = |scale: f64| {
        let mut data = recorded(&data, &robot, |_| TagMeasurement::Position);
        let tags = data.fit.iter_mut().chain(&mut data.held_out).flat_map(|view| &mut view.tags);
        tags.for_each(|seen| seen.center_in_camera_m *= scale);
        data
    };
    for with_scale in [&with_poses as &dyn Fn(f64) -> CaptureData, &with_positions] {
        assert_eq!(found(&with_scale(1.0), &robot), None);
        for (unit, per_m) in UNITS {
            let wrong = found(&with_scale(per_m), &robot);
            assert_eq!(wrong, Some(WrongInputKind::RecordedUnit(unit.to_owned())));
        }
        let wrong = found(&with_scale(1.25), &robot);
        assert!(matches!(wrong, Some(WrongInputKind::RecordedScale(k)) if (k / 1.25 - 1.0).abs() < 0.01), "{wrong:?}");
    }
}

/// Landmarks have only positions: as they are, or those of the camera in the tag's frame. The cases are all tags, one
/// per view, and tags that are turned alike, whose distances are the same both ways.
#[test]
fn positions_of_the_inverse_transform_are_told() {
    let (data, robot) = sample();
    let written = |keep: &dyn Fn(usize) -> bool, write: &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>| {
        let mut data = data.clone();
        for view in data.fit.iter_mut().chain(&mut data.held_out) {
            view.tags.retain(|seen| keep(seen.tag_idx));
        }
        for seen in data.fit.iter_mut().chain(&mut data.held_out).flat_map(|view| &mut view.tags) {
            let corners = seen.corners().expect("corners").corners_px;
            let pose = solve_square(&robot.camera.lens, robot.tags[seen.tag_idx].size_m, &corners).expect("a pose");
            seen.center_in_camera_m = write(pose.camera_from_tag.isometry()).translation.vector;
            seen.measured = TagMeasurement::Position;
        }
        found(&data, &robot)
    };
    let rotation = |tag: usize| robot.tags[tag].base_from_tag.isometry().rotation;
    let is_alike = |tag: usize| rotation(tag).angle_to(&rotation(OFTEN_SEEN)) < 0.1;
    let all: [&dyn Fn(usize) -> bool; 3] = [&|_| true, &|tag| tag == OFTEN_SEEN, &is_alike];
    for keep in all {
        assert_eq!(written(keep, &|pose| *pose), None);
        assert_eq!(written(keep, &|pose| pose.inverse()), Some(WrongInputKind::RecordedDirection));
    }
}

/// A stretched map looks like tags of another size: the words name both.
#[test]
fn a_stretched_map_is_told_with_its_ratio() {
    let (data, robot) = sample();
    let stretched =
        |_: usize, pose: &Isometry3<f64>| Isometry3::from_parts((1.05 * pose.translation.vector).into(), pose.rotation);
    let wrong = found(&data, &with_tags(&robot, stretched));
    assert!(matches!(wrong, Some(WrongInputKind::TagSize(ratio)) if (ratio / 1.05 - 1.0).abs() < 0.01), "{wrong:?}");
}
