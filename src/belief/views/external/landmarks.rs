//! One landmark over the frames of a view.

use crate::views::constants::external_landmarks::NEVER_APART_M;
use crate::views::constants::frame_consensus::USUAL_DISTANCES;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::views::association::check_square;
use crate::views::external::board::{BoardBefore, mean_board};
use crate::views::frame_consensus::agreeing_mean;
use crate::views::view::{ObservationRejection, TagMeasurement};
use armcal_core::input::RawMeasurement;
use armcal_core::optics::Chessboard;
use armcal_core::robot::CameraSpec;

/// Landmark without a number that the input map names.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlainLandmark {
    /// Number of the landmark.
    pub id: Option<u32>,
    /// Board, if the landmark is a board with corners of its own.
    pub board: Option<Chessboard>,
}

/// Measurement of a landmark in a view.
pub(crate) struct Averaged {
    pub center_in_camera_m: Vector3<f64>,
    pub measured: TagMeasurement,
}

/// Returns the mean of a board's corners over the frames, and the number of rejected corners.
pub(crate) fn average_board(
    seen: &[RawMeasurement],
    camera: &CameraSpec,
    board: Chessboard,
) -> (Result<Averaged, ObservationRejection>, usize) {
    let corner = |seen: &RawMeasurement| match seen {
        RawMeasurement::BoardCorner { number, pixel } => Some((*number, *pixel)),
        _ => None,
    };
    let corners: Vec<(u32, [f64; 2])> = seen.iter().filter_map(corner).collect();
    let before = BoardBefore { board, lens: &camera.lens, corner_std_px: camera.corner_std_px };
    let (found, n_apart) = mean_board(&corners, &before);
    let averaged = found.map(|found| Averaged {
        center_in_camera_m: found.camera_from_board.translation.vector,
        measured: TagMeasurement::Board(found),
    });
    (averaged, n_apart)
}

/// Returns the mean of the frames that agree, and the number of the others; no mean if fewer than half agree.
pub(crate) fn average(
    seen: &[RawMeasurement],
    camera: &CameraSpec,
    size_m: f64,
) -> (Result<Option<Averaged>, ObservationRejection>, usize) {
    let corners: Vec<[[f64; 2]; 4]> = seen
        .iter()
        .filter_map(|seen| if let RawMeasurement::Corners(corners) = seen { Some(*corners) } else { None })
        .collect();
    if !corners.is_empty() {
        let (mean, n_apart) = agreeing_mean(&corners, camera.corner_std_px);
        let averaged = mean.map(|mean| {
            let solved = check_square(camera, size_m, &mean)?;
            let center_in_camera_m = solved.camera_from_tag.origin().vector();
            Ok(Averaged { center_in_camera_m, measured: TagMeasurement::Corners(mean) })
        });
        return (averaged.transpose(), n_apart);
    }
    let positions: Vec<Vector3<f64>> = seen.iter().filter_map(position).collect();
    let center = Vector3::from_fn(|axis, _| median(positions.iter().map(|position| position[axis]).collect()));
    let usual_m = median(positions.iter().map(|position| (position - center).norm()).collect());
    let gate_m = (USUAL_DISTANCES * usual_m).max(NEVER_APART_M);
    let near: Vec<&RawMeasurement> =
        seen.iter().filter(|seen| position(seen).is_some_and(|p| (p - center).norm() <= gate_m)).collect();
    let n_apart = seen.len() - near.len();
    (Ok((2 * near.len() > seen.len()).then(|| mean(&near))), n_apart)
}

fn position(seen: &RawMeasurement) -> Option<Vector3<f64>> {
    match seen {
        RawMeasurement::Position(position) => Some(*position),
        RawMeasurement::Pose(pose) => Some(pose.translation.vector),
        RawMeasurement::Corners(_) | RawMeasurement::BoardCorner { .. } => None,
    }
}

/// Returns the mean of the positions, and of the rotations about the first one, which is close to the others.
fn mean(near: &[&RawMeasurement]) -> Averaged {
    let n = near.len() as f64;
    let center_in_camera_m = near.iter().filter_map(|seen| position(seen)).sum::<Vector3<f64>>() / n;
    let rotations: Vec<UnitQuaternion<f64>> = near
        .iter()
        .filter_map(|seen| if let RawMeasurement::Pose(pose) = seen { Some(pose.rotation) } else { None })
        .collect();
    let measured = match rotations.first() {
        None => TagMeasurement::Position,
        Some(first) => {
            let turns = rotations.iter().map(|rotation| (first.inverse() * rotation).scaled_axis());
            let turn = UnitQuaternion::from_scaled_axis(turns.sum::<Vector3<f64>>() / n);
            let place = Translation3::from(Point3::from(center_in_camera_m).coords);
            TagMeasurement::Pose(Isometry3::from_parts(place, first * turn))
        }
    };
    Averaged { center_in_camera_m, measured }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}
