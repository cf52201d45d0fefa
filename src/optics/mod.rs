//! Cameras: points to pixels and back.
//!
//! `Fisheye` is the equidistant model of Kannala and Brandt (2006, eq. 6 to the fourth odd term), as OpenCV's
//! `cv::fisheye` and Kalibr's `equidistant` use it; `square` finds a tag's pose from its four corners through it.
//! Oracle: OpenCV (tests/oracle).

mod fisheye;
mod square;

pub use fisheye::Fisheye;
pub use square::{SquareError, SquarePose, solve_square, square_corners};
