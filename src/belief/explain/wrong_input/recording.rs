//! Other readings of the recording: pixels of another image, poses in another order or direction.
//!
//! If views have several landmarks, these determine the right reading (`by_pairs`). If a view has one, the arm by its
//! datasheet locates it. The rotations of `base_from_tag` over the views must then agree within the sensors' errors.

use crate::explain::constants::wrong_input_recording::{BEYOND_IMAGE, GOOD_SPREAD_RAD, MIN_ROTATIONS, SPREAD_RAD};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

use super::BETTER;
use crate::say::wrong_input::{MismatchMeasure, WrongInput, WrongInputKind};
use crate::views::view::{CaptureData, TagMeasurement, View};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::stats::quantile;

/// Wrong input of corners that are not pixels of an image of the stated size.
pub(crate) fn beside_image(stated_px: [u32; 2], data: &CaptureData) -> Option<WrongInputKind> {
    let (smallest_px, largest_px) = (data.smallest_px, data.largest_px);
    let sides_px = stated_px.map(f64::from);
    let is_any = |is_so: &dyn Fn(usize) -> bool| stated_px[0] > 0 && (is_so(0) || is_so(1));
    if is_any(&|axis| largest_px[axis] > BEYOND_IMAGE * sides_px[axis]) {
        Some(WrongInputKind::ImageSize { stated_px, seen_px: largest_px })
    } else if is_any(&|axis| smallest_px[axis] < (1.0 - BEYOND_IMAGE) * sides_px[axis]) {
        Some(WrongInputKind::NegativePixels(smallest_px))
    } else {
        let are_shares = largest_px.iter().all(|px| *px > 0.0 && *px <= BEYOND_IMAGE);
        are_shares.then_some(WrongInputKind::ImageShares)
    }
}

/// Possible meaning of a recorded pose.
pub(crate) type Reading = fn(&Isometry3<f64>) -> Isometry3<f64>;

/// Possible meanings of recorded poses. A reader may have inverted them already, so that each order of quaternions
/// counts for the pose and for its inverse.
pub(crate) fn readings() -> [(WrongInputKind, Reading); 11] {
    use WrongInputKind::{RecordedDirection, RecordedOrderAndDirection, RecordedQuaternions, RecordedRotations};
    [
        (RecordedDirection, |pose| pose.inverse()),
        (RecordedQuaternions, |pose| with(pose, reordered)),
        (RecordedQuaternions, |pose| with(pose, reordered_back)),
        (RecordedQuaternions, |pose| with(&pose.inverse(), reordered).inverse()),
        (RecordedQuaternions, |pose| with(&pose.inverse(), reordered_back).inverse()),
        (RecordedOrderAndDirection, |pose| with(&pose.inverse(), reordered)),
        (RecordedOrderAndDirection, |pose| with(&pose.inverse(), reordered_back)),
        (RecordedOrderAndDirection, |pose| with(pose, reordered).inverse()),
        (RecordedOrderAndDirection, |pose| with(pose, reordered_back).inverse()),
        (RecordedRotations, |pose| with(pose, UnitQuaternion::inverse)),
        (RecordedRotations, |pose| with(&pose.inverse(), UnitQuaternion::inverse).inverse()),
    ]
}

fn with(pose: &Isometry3<f64>, turn: fn(&UnitQuaternion<f64>) -> UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(pose.translation, turn(&pose.rotation))
}

/// Returns the view with its recorded poses read by `read`.
pub(crate) fn read_by(view: &View, read: Reading) -> View {
    let mut view = view.clone();
    for seen in &mut view.tags {
        if let TagMeasurement::Pose(pose) = &mut seen.measured {
            *pose = read(pose);
        }
    }
    view
}

/// Wrong reading of recorded poses, by the rotations of one landmark per view.
pub(crate) fn by_rotations(views: &[&View], robot: &Robot) -> Option<WrongInput> {
    let base_from_camera = |view: &View| {
        let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
        robot.tags_from_camera(&JointAngles::from_fn(view.travel_rad.len(), angle_rad))
    };
    let posed: Vec<(usize, Isometry3<f64>, Isometry3<f64>)> = views
        .iter()
        .flat_map(|view| {
            let camera = base_from_camera(view);
            view.tags.iter().filter_map(move |seen| match &seen.measured {
                TagMeasurement::Pose(pose) => Some((seen.tag_idx, camera, *pose)),
                _ => None,
            })
        })
        .collect();
    let spread = |read: Reading| {
        let turned = |&(tag, camera, pose): &(usize, Isometry3<f64>, Isometry3<f64>)| (tag, camera * read(&pose));
        spread_rad(&posed.iter().map(turned).collect::<Vec<_>>())
    };
    let as_written = spread(|pose| *pose)?;
    // Rotations do not distinguish the inverse of a pose from that of its rotation.
    let readings = readings().into_iter().filter(|(input, _)| *input != WrongInputKind::RecordedRotations);
    let spreads = readings.filter_map(|(input, read)| Some((input, spread(read)?)));
    let (input, least) = spreads.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_better = as_written > SPREAD_RAD && least < GOOD_SPREAD_RAD.min(BETTER * as_written);
    is_better.then_some(WrongInput {
        input,
        measure: MismatchMeasure::Rotations,
        mismatch: as_written,
        mismatch_otherwise: Some(least),
        size_hint: None,
    })
}

/// Median angle of a landmark's rotations from the one that is nearest to all others, rad; the largest of all
/// landmarks.
fn spread_rad(poses: &[(usize, Isometry3<f64>)]) -> Option<f64> {
    let mut tags: Vec<usize> = poses.iter().map(|(tag, _)| *tag).collect();
    tags.sort_unstable();
    tags.dedup();
    let of_tag = |tag: usize| {
        let turns: Vec<_> = poses.iter().filter(|(of, _)| *of == tag).map(|(_, pose)| pose.rotation).collect();
        let median = |from: &UnitQuaternion<f64>| {
            quantile(&turns.iter().map(|turn| from.angle_to(turn)).collect::<Vec<f64>>(), 0.5)
        };
        let spreads = turns.iter().filter_map(median);
        (turns.len() >= MIN_ROTATIONS).then(|| spreads.fold(f64::INFINITY, f64::min))
    };
    tags.into_iter().filter_map(of_tag).reduce(f64::max)
}

/// Rotation that was written `[x, y, z, w]` and read as `[w, x, y, z]`.
pub(crate) fn reordered(read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let [x, y, z, w] = [read.w, read.i, read.j, read.k];
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Rotation that was written `[w, x, y, z]` and read as `[x, y, z, w]`.
pub(crate) fn reordered_back(read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let [w, x, y, z] = [read.i, read.j, read.k, read.w];
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}
