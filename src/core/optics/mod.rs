//! Camera models: projection of points to pixels, and bearings of pixels.
//!
//! `Fisheye` is the equidistant model of Kannala and Brandt (2006, eq. 6 to the fourth odd term), as in OpenCV's
//! `cv::fisheye` and Kalibr's `equidistant`. `Radtan` is Brown's pinhole model. `CameraModel` is either of them, with
//! or without a window in front of it (`FlatPort`). `square` computes the pose of a tag from its four corners for any
//! [`Lens`]. `board` computes that of a chessboard from its detected corners. `tag_family` has the printed patterns.
//! Oracle: OpenCV (tests/oracle).

mod board;
mod camera;
mod corner_noise;
mod fisheye;
mod flat_port;
mod radtan;
mod square;
mod tag_family;
mod twist;

pub use board::{BoardPose, Chessboard, solve_board};
pub use camera::{CameraModel, Lens, LensModel, UnknownLens, check_image_size};
pub use corner_noise::{CornerNoise, DetectionChance};
pub use fisheye::Fisheye;
pub use flat_port::FlatPort;
pub use radtan::Radtan;
pub use square::{SquareError, SquarePose, solve_square, solve_square_both, square_corners};
pub use tag_family::{MAX_PRINT_CELLS, TagCells, TagFamily};
pub use twist::image_jacobian;

/// The wrist camera's lens, for tests.
#[doc(hidden)]
pub mod fixture {
    use super::{CameraModel, Fisheye};

    #[must_use]
    pub fn lens() -> CameraModel {
        fisheye().into()
    }

    #[must_use]
    pub fn fisheye() -> Fisheye {
        Fisheye {
            focal_px: [387.33, 387.06],
            center_px: [633.6, 510.9],
            distortion: [0.02268, -0.01345, 0.01296, -0.00418],
            resolution_px: [1224, 1024],
            max_view_angle_rad: 1.45,
        }
    }
}
