//! A board over the frames of a view: the mean position of each corner, and the board's pose from them.

use crate::views::constants::external_board::{FAR_SIGMAS, MAX_LEFT_OUT, SIGMA_OF_MEDIAN};
use crate::views::constants::frame_consensus::CLOSE_SIGMAS;
use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, Vector2};

use crate::views::association::MAX_SQUARE_RMS_PX;
use crate::views::frame_consensus::different;
use crate::views::view::{BoardPoint, BoardPoints, ObservationRejection};
use armcal_core::optics::{BoardPose, CameraModel, Chessboard, SquareError, solve_board};

/// A board and the camera that sees it.
#[derive(Clone, Copy)]
pub(crate) struct BoardBefore<'a> {
    pub board: Chessboard,
    pub lens: &'a CameraModel,
    /// Standard deviation of a corner in one frame, px.
    pub corner_std_px: f64,
}

/// Averages the board's corners by their numbers over all frames of a view; also returns the number of rejected
/// corners.
pub(crate) fn mean_board(
    seen: &[(u32, [f64; 2])],
    before: &BoardBefore<'_>,
) -> (Result<BoardPoints, ObservationRejection>, usize) {
    let mut by_number: BTreeMap<u32, Vec<[f64; 2]>> = BTreeMap::new();
    for (number, pixel) in seen {
        by_number.entry(*number).or_default().push(*pixel);
    }
    let gate_px = CLOSE_SIGMAS * before.corner_std_px;
    let (mut points, mut scatter_px2, mut n_apart) = (Vec::new(), 0.0, 0);
    for (number, frames) in by_number {
        let Some(on_board) = before.board.corner(number) else {
            n_apart += frames.len();
            continue;
        };
        let middle = [0, 1].map(|axis| median(frames.iter().map(|pixel| pixel[axis]).collect()));
        let is_near = |pixel: &&[f64; 2]| (0..2).all(|axis| (pixel[axis] - middle[axis]).abs() <= gate_px);
        let n_near = frames.iter().filter(is_near).count();
        n_apart += frames.len() - n_near;
        if 2 * n_near <= frames.len() {
            continue;
        }
        let near = different(frames.iter().filter(is_near));
        let n = near.len() as f64;
        let pixel = [0, 1].map(|axis| near.iter().map(|pixel| pixel[axis]).sum::<f64>() / n);
        scatter_px2 += near.iter().map(|at| (Vector2::from(*at) - Vector2::from(pixel)).norm_squared()).sum::<f64>();
        points.push(BoardPoint { on_board, pixel, n_frames: near.len() });
    }
    let n_free = points.iter().map(|point: &BoardPoint| 2 * (point.n_frames - 1)).sum();
    match fitting(points, before) {
        Ok((points, camera_from_board, n_far)) => {
            let points: Arc<[BoardPoint]> = points.into();
            (Ok(BoardPoints { points, camera_from_board, scatter_px2, n_free }), n_apart + n_far)
        }
        Err(why) => (Err(why), n_apart),
    }
}

/// Corners that fit one pose of the board, that pose, and the number of corners that do not fit it.
type Fitting = (Vec<BoardPoint>, nalgebra::Isometry3<f64>, usize);

fn fitting(mut points: Vec<BoardPoint>, before: &BoardBefore<'_>) -> Result<Fitting, ObservationRejection> {
    let n_before = points.len();
    loop {
        let found = pose(&points, before.lens)?;
        let off_px = |point: &BoardPoint| {
            let pixel = before.lens.project(&(found.camera_from_board * point.on_board).coords);
            pixel.map_or(f64::INFINITY, |pixel| (Vector2::from(point.pixel) - pixel).amax())
        };
        let off: Vec<f64> = points.iter().map(off_px).collect();
        let usual_px = (SIGMA_OF_MEDIAN * median(off.clone())).max(before.corner_std_px);
        let worst = off.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        match worst.filter(|(_, off_px)| **off_px > FAR_SIGMAS * usual_px) {
            Some((at, _)) => drop(points.remove(at)),
            None if found.rms_px > MAX_SQUARE_RMS_PX => return Err(ObservationRejection::NotASquare),
            None => {
                let n_far = n_before - points.len();
                return Ok((points, found.camera_from_board, n_far));
            }
        }
        if (n_before - points.len()) as f64 > MAX_LEFT_OUT * n_before as f64 {
            return Err(ObservationRejection::NotASquare);
        }
    }
}

fn pose(points: &[BoardPoint], lens: &CameraModel) -> Result<BoardPose, ObservationRejection> {
    let on_board: Vec<Point3<f64>> = points.iter().map(|point| point.on_board).collect();
    let pixels: Vec<[f64; 2]> = points.iter().map(|point| point.pixel).collect();
    solve_board(lens, &on_board, &pixels).map_err(|error| match error {
        SquareError::OutOfView => ObservationRejection::OutOfView,
        SquareError::Degenerate => ObservationRejection::NotASquare,
    })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::optics::fixture::lens;
    use nalgebra::{Isometry3, Vector3};

    const BOARD: Chessboard = Chessboard { squares: [7, 5], square_m: 0.04 };

    /// Returns every corner in `n_frames` frames, each with an error of a few hundredths of a pixel.
    fn seen(n_frames: u32) -> (Isometry3<f64>, Vec<(u32, [f64; 2])>) {
        let pose = Isometry3::new(Vector3::new(-0.1, -0.1, 0.6), Vector3::new(0.2, -0.3, 0.1));
        let mut out = Vec::new();
        for frame in 0..n_frames {
            for number in 0..BOARD.n_corners() {
                let on_board = BOARD.corner(number).expect("a corner");
                let pixel = lens().project(&(pose * on_board).coords).expect("in view");
                let off = 0.02 * f64::from((7 * number + 3 * frame) % 5) - 0.04;
                out.push((number, [pixel.x + off, pixel.y - off]));
            }
        }
        (pose, out)
    }

    #[test]
    fn corners_are_averaged_and_strange_ones_left_out() {
        let (pose, mut seen) = seen(4);
        let lens = lens();
        let before = BoardBefore { board: BOARD, lens: &lens, corner_std_px: 0.1 };
        // One frame shows corner 5 elsewhere, and all frames corner 8. One number does not exist on the board.
        seen.iter_mut().filter(|(number, _)| *number == 5).take(1).for_each(|(_, pixel)| pixel[0] += 9.0);
        seen.iter_mut().filter(|(number, _)| *number == 8).for_each(|(_, pixel)| pixel[1] -= 4.0);
        seen.push((24, [600.0, 500.0]));
        let (found, n_apart) = mean_board(&seen, &before);
        let found = found.expect("a board");
        assert_eq!((found.points.len(), n_apart), (23, 3));
        let frames_of = |number: u32| {
            let at = BOARD.corner(number).expect("a corner");
            found.points.iter().find(|point| point.on_board == at).map(|point| point.n_frames)
        };
        assert_eq!((frames_of(4), frames_of(5), frames_of(8)), (Some(4), Some(3), None));
        assert!((found.camera_from_board.translation.vector - pose.translation.vector).norm() < 2e-4);
        // Used are 23 corners in 4 frames, one in 3, and corner 8, whose frames agree.
        assert_eq!(found.n_free, 2 * (23 * 3 + 2));
    }

    #[test]
    fn what_is_no_board_is_refused() {
        let (_, mut seen) = seen(1);
        let lens = lens();
        let before = BoardBefore { board: BOARD, lens: &lens, corner_std_px: 0.1 };
        let few: Vec<_> = seen.iter().copied().take(3).collect();
        assert_eq!(mean_board(&few, &before).0.map(|_| ()), Err(ObservationRejection::NotASquare));
        // Corners numbered along the other side form the mirror image of this board.
        for (number, _) in &mut seen {
            *number = (*number % 6) * 4 + *number / 6;
        }
        assert_eq!(mean_board(&seen, &before).0.map(|_| ()), Err(ObservationRejection::NotASquare));
    }
}
