//! A flat board with a grid of points, and its pose from the pixels of the detected points.
//!
//! A homography by least squares between the board's plane and the bearings (turned so that the board lies ahead) gives
//! the initial guess. Levenberg-Marquardt on the pixels refines it and its mirror image; the better one is taken.

use nalgebra::{Isometry3, Point3, SMatrix, SVector, Translation3, UnitQuaternion, Vector2, Vector3};

use super::camera::Lens;
use super::square::{SquareError, flipped, pose_of_homography, refine_points};

/// Minimum number of points of a pose.
const MIN_POINTS: usize = 4;
/// Ratio of the scatter across to the scatter along below which points count as collinear.
const MIN_SCATTER_RATIO: f64 = 1e-4;
/// Smallest z of a bearing that the initial guess uses, with z along the board's direction.
const MIN_AHEAD: f64 = 0.05;

/// A chessboard, or a ChArUco board: its inner corners are numbered along x first, from 0, as OpenCV does. Corner 0 is
/// one square along x and one along y from the origin, an outer corner of the board. All are at z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chessboard {
    /// Squares along x and along y.
    pub squares: [u32; 2],
    /// Side of a square, m.
    pub square_m: f64,
}

impl Chessboard {
    /// Number of inner corners.
    #[must_use]
    pub fn n_corners(&self) -> u32 {
        self.squares.map(|n| n.saturating_sub(1)).iter().product()
    }

    /// Returns the inner corner of this number in the board's frame, m; `None` if there is no such corner.
    #[must_use]
    pub fn corner(&self, number: u32) -> Option<Point3<f64>> {
        let along_x = self.squares[0].saturating_sub(1);
        (number < self.n_corners()).then(|| {
            let [x, y] = [number % along_x, number / along_x].map(|n| self.square_m * f64::from(n + 1));
            Point3::new(x, y, 0.0)
        })
    }
}

/// Pose of a board in the camera frame, with its residual.
#[derive(Clone, Copy, Debug)]
pub struct BoardPose {
    /// Pose of the board; either side may face the camera.
    pub camera_from_board: Isometry3<f64>,
    /// Root mean square residual over all coordinates, px.
    pub rms_px: f64,
}

/// Solves for the pose of a board whose points `on_board` (m, z = 0) have the pixels `pixels`.
///
/// # Errors
/// [`SquareError`] if a pixel has no bearing, or the points (fewer than four, or collinear) have no pose.
pub fn solve_board(lens: &impl Lens, on_board: &[Point3<f64>], pixels: &[[f64; 2]]) -> Result<BoardPose, SquareError> {
    if on_board.len() < MIN_POINTS || on_board.len() != pixels.len() || are_on_a_line(on_board) {
        return Err(SquareError::Degenerate);
    }
    let center = center(on_board);
    let about_center: Vec<Point3<f64>> = on_board.iter().map(|point| point - center).collect();
    let start = start(lens, &about_center, pixels)?;
    let found =
        [start, flipped(&start)].into_iter().filter_map(|from| refine_points(lens, from, &about_center, pixels));
    let best = found.min_by(|a, b| a.cost.total_cmp(&b.cost)).ok_or(SquareError::Degenerate)?;
    Ok(BoardPose {
        camera_from_board: best.pose * Translation3::from(-center),
        rms_px: (best.cost / (2 * pixels.len()) as f64).sqrt(),
    })
}

fn center(points: &[Point3<f64>]) -> Vector3<f64> {
    points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / points.len() as f64
}

fn are_on_a_line(points: &[Point3<f64>]) -> bool {
    let center = center(points);
    let off = points.iter().map(|point| point.coords - center);
    let scatter = off.fold(nalgebra::Matrix2::zeros(), |sum, off| sum + off.xy() * off.xy().transpose());
    let across = scatter.symmetric_eigenvalues();
    across.min() <= MIN_SCATTER_RATIO * across.max()
}

/// Solves the direct linear transform by least squares. Lengths are in units of the points' own size, so that the
/// normal equations are well conditioned.
fn start(lens: &impl Lens, points: &[Point3<f64>], pixels: &[[f64; 2]]) -> Result<Isometry3<f64>, SquareError> {
    let bearing = |pixel: &[f64; 2]| lens.unproject(&Vector2::from(*pixel)).map(nalgebra::Unit::into_inner);
    let bearings: Vec<Vector3<f64>> =
        pixels.iter().map(bearing).collect::<Option<_>>().ok_or(SquareError::OutOfView)?;
    let mean = bearings.iter().sum::<Vector3<f64>>();
    let turn = UnitQuaternion::rotation_between(&mean, &Vector3::z()).ok_or(SquareError::Degenerate)?;
    let unit_m = points.iter().map(|point| point.coords.norm()).fold(0.0, f64::max);
    let (mut normal, mut right) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
    for (bearing, point) in bearings.iter().zip(points) {
        let ahead = turn * bearing;
        if ahead.z < MIN_AHEAD {
            continue;
        }
        let (x, y) = (point.x / unit_m, point.y / unit_m);
        let (u, v) = (ahead.x / ahead.z, ahead.y / ahead.z);
        let rows = [[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y]];
        for (row, value) in rows.map(SVector::<f64, 8>::from).iter().zip([u, v]) {
            normal += row * row.transpose();
            right += row * value;
        }
    }
    let mut h = normal.cholesky().ok_or(SquareError::Degenerate)?.solve(&right);
    for k in [0, 1, 3, 4, 6, 7] {
        h[k] /= unit_m;
    }
    pose_of_homography(&h, &turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::fixture::lens;
    use crate::spatial::log;
    use proptest::prelude::*;

    const BOARD: Chessboard = Chessboard { squares: [7, 5], square_m: 0.04 };

    #[test]
    fn corners_are_numbered_along_x_first() {
        assert_eq!(BOARD.n_corners(), 24);
        assert_eq!(BOARD.corner(0), Some(Point3::new(0.04, 0.04, 0.0)));
        assert_eq!(BOARD.corner(7), Some(Point3::new(0.08, 0.08, 0.0)));
        assert_eq!(BOARD.corner(24), None);
        assert_eq!(Chessboard { squares: [1, 9], square_m: 0.04 }.corner(0), None);
    }

    proptest! {
        #[test]
        fn the_pose_of_a_noiseless_board_comes_back_from_either_side_and_in_parts(
            x in -0.6f64..0.6, y in -0.6f64..0.6, z in 0.3f64..1.5,
            tilt in 0.0f64..1.0, azimuth in -3.0f64..3.0, spin in -3.0f64..3.0, behind in 0u8..2, first in 0u32..12,
        ) {
            let sight = Vector3::new(x, y, z);
            let facing = UnitQuaternion::rotation_between(&Vector3::z(), &-sight).expect("not opposite");
            let lean = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt);
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * spin);
            let over = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI * f64::from(behind));
            let at_center = Isometry3::from_parts(Translation3::from(sight), facing * lean * turn * over);
            let pose = at_center * Translation3::new(-0.14, -0.1, 0.0);
            let points: Vec<Point3<f64>> = (first..24).filter_map(|number| BOARD.corner(number)).collect();
            let seen: Option<Vec<[f64; 2]>> =
                points.iter().map(|point| lens().project(&(pose * point).coords).map(Into::into)).collect();
            let Some(pixels) = seen else { return Ok(()) };
            let found = solve_board(&lens(), &points, &pixels).expect("a board");
            prop_assert!(found.rms_px < 1e-6, "rms {}", found.rms_px);
            let error = log(&(found.camera_from_board.inverse() * pose));
            prop_assert!(error.norm() < 1e-6, "error {}", error.norm());
        }
    }

    #[test]
    fn too_few_points_and_points_on_a_line_have_no_pose() {
        let points = |numbers: &[u32]| numbers.iter().filter_map(|n| BOARD.corner(*n)).collect::<Vec<_>>();
        let pixel = |point: &Point3<f64>| [500.0 + 900.0 * point.x, 400.0 + 900.0 * point.y];
        let solve = |numbers: &[u32]| {
            let points = points(numbers);
            solve_board(&lens(), &points, &points.iter().map(pixel).collect::<Vec<_>>()).map(|found| found.rms_px)
        };
        assert!(solve(&[0, 1, 6, 7]).is_ok());
        assert_eq!(solve(&[0, 1, 6]).unwrap_err(), SquareError::Degenerate);
        assert_eq!(solve(&[0, 1, 2, 3, 4, 5]).unwrap_err(), SquareError::Degenerate);
        assert_eq!(solve(&[0, 7, 14, 21]).unwrap_err(), SquareError::Degenerate);
    }
}
