//! Noise of a tag's corners and chance of its detection, by the tag's position and size in the image.
//!
//! A side is an edge between black and white. One pixel of its length locates it to `s_e sqrt(b)`, where b is the
//! blur's standard deviation across it. The bound for a step blurred by a Gaussian in white noise n has the variance
//! `2 sqrt(pi) b (n/c)^2` (matched filter). The contrast c falls with the range, so that s_e grows as `exp(a range)`. A
//! line through L such pixels is known at its ends to `4 s_e^2 b / L`, and a corner is the intersection of two such
//! lines. With their normals as the rows of N, its covariance is `N^-1 diag(v_1, v_2) N^-T` and a floor. Short and
//! slanted sides make it large by themselves. The chance of detection is logistic in the tag's shortest side and in its
//! range.

use nalgebra::{Matrix2, Vector2};

/// Corner covariances and chance of detection in one kind of water. The constants are fitted by
/// `armcal-lab detection --repeats 2` to tags of 0.15 m under its lamps, with a camera of 1224 x 1024 pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerNoise {
    /// Standard deviation of an edge's position by 1 px of its length at range 0, per root of the blur: px.
    pub edge_std_px: f64,
    /// Relative growth of `edge_std_px` with the range, 1/m.
    pub contrast_loss_per_m: f64,
    /// Standard deviation of each coordinate regardless of the edges, px.
    pub floor_std_px: f64,
    /// Chance that a tag is detected.
    pub chance: DetectionChance,
}

/// Chance of detection: `1/(1 + exp(-(side - half_side)/side_width))` times the same function of the range, falling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectionChance {
    /// Shortest side of a tag in the image at which the chance is 1/2, as far as the side matters.
    pub half_side_px: f64,
    /// Width of the logistic function of the side.
    pub side_width_px: f64,
    /// Range at which the chance is 1/2, as far as the range matters.
    pub half_range_m: f64,
    /// Width of the logistic function of the range.
    pub range_width_m: f64,
}

/// Standard deviation of the blur of a camera and a tag at rest: lens (0.5 px) and pixel.
const SHARP_PX: f64 = 0.58;
/// Shortest side in the image, px, that has a position.
const MIN_SIDE_PX: f64 = 1.0;

impl CornerNoise {
    /// Clear ocean water.
    pub const CLEAR: Self = Self {
        edge_std_px: 0.0128,
        contrast_loss_per_m: 0.976,
        floor_std_px: 0.0136,
        chance: DetectionChance { half_side_px: 15.93, side_width_px: 1.91, half_range_m: 8.87, range_width_m: 2.72 },
    };
    /// Coastal water.
    pub const COASTAL: Self = Self {
        edge_std_px: 0.0541,
        contrast_loss_per_m: 0.196,
        floor_std_px: 0.0134,
        chance: DetectionChance { half_side_px: 21.04, side_width_px: 2.63, half_range_m: 8.9, range_width_m: 2.72 },
    };
    /// Turbid harbour water.
    pub const TURBID: Self = Self {
        edge_std_px: 0.2224,
        contrast_loss_per_m: 0.148,
        floor_std_px: 0.0001,
        chance: DetectionChance { half_side_px: 41.86, side_width_px: 7.39, half_range_m: 0.89, range_width_m: 0.3 },
    };

    /// Returns the covariance of each corner, px2, for corners in the order of a detection. `blur_px` is the image's
    /// motion during the exposure.
    #[must_use]
    pub fn covariances_px2(&self, corners_px: &[[f64; 2]; 4], range_m: f64, blur_px: f64) -> [Matrix2<f64>; 4] {
        let blur_std_px = SHARP_PX.hypot(blur_px / 12.0_f64.sqrt());
        let edge_std_px = self.edge_std_px * (self.contrast_loss_per_m * range_m).exp();
        let side = |k: usize| Vector2::from(corners_px[(k + 1) % 4]) - Vector2::from(corners_px[k % 4]);
        let variance = |length_px: f64| 4.0 * edge_std_px * edge_std_px * blur_std_px / length_px.max(MIN_SIDE_PX);
        std::array::from_fn(|k| {
            let (before, after) = (side(k + 3), side(k));
            let (v1, v2) = (variance(before.norm()), variance(after.norm()));
            intersection(&before, v1, &after, v2) + Matrix2::identity() * self.floor_std_px.powi(2)
        })
    }
}

impl DetectionChance {
    /// Returns the chance of detection, 0..1, of a tag with this shortest side in the image and this distance from the
    /// camera.
    #[must_use]
    pub fn of(&self, shortest_side_px: f64, range_m: f64) -> f64 {
        let logistic = |x: f64| 1.0 / (1.0 + (-x).exp());
        logistic((shortest_side_px - self.half_side_px) / self.side_width_px)
            * logistic((self.half_range_m - range_m) / self.range_width_m)
    }
}

/// Covariance of the intersection of two lines whose positions across themselves have the variances v1 and v2.
fn intersection(along_1: &Vector2<f64>, v1: f64, along_2: &Vector2<f64>, v2: f64) -> Matrix2<f64> {
    /// Smallest sine between two lines; closer to parallel they have no definite intersection.
    const MIN_SIN: f64 = 0.02;
    let unit = |v: &Vector2<f64>| v / v.norm().max(1e-12);
    let (d1, d2) = (unit(along_1), unit(along_2));
    let sin = (d1.x * d2.y - d1.y * d2.x).abs().max(MIN_SIN);
    // A line moved by one across itself moves the point by 1/sin along the other.
    (d2 * d2.transpose() * v1 + d1 * d1.transpose() * v2) / (sin * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise() -> CornerNoise {
        let chance = DetectionChance { half_side_px: 12.0, side_width_px: 1.0, half_range_m: 3.0, range_width_m: 0.2 };
        CornerNoise { edge_std_px: 0.1, contrast_loss_per_m: 0.5, floor_std_px: 0.01, chance }
    }

    #[test]
    fn a_corner_is_where_its_sides_meet() {
        // Two lines are moved at random across themselves and intersected.
        let (along_1, along_2) = (Vector2::new(3.0, 1.0), Vector2::new(-1.0, 2.0));
        let (n1, n2) = (Vector2::new(-1.0, 3.0).normalize(), Vector2::new(2.0, 1.0).normalize());
        let rows = Matrix2::from_rows(&[n1.transpose(), n2.transpose()]);
        let inverse = rows.try_inverse().expect("not parallel");
        let expected = inverse * Matrix2::from_diagonal(&Vector2::new(0.3, 0.7)) * inverse.transpose();
        assert!((intersection(&along_1, 0.3, &along_2, 0.7) - expected).norm() < 1e-12);
    }

    #[test]
    fn it_grows_with_range_blur_and_slant() {
        let square = [[0.0, 40.0], [40.0, 40.0], [40.0, 0.0], [0.0, 0.0]];
        let slanted = [[0.0, 40.0], [40.0, 60.0], [40.0, 20.0], [0.0, 0.0]];
        let trace = |corners: &[[f64; 2]; 4], range_m, blur_px| {
            noise().covariances_px2(corners, range_m, blur_px).iter().map(Matrix2::trace).sum::<f64>()
        };
        let plain = trace(&square, 1.0, 0.0);
        // Expected value by hand: each coordinate has 4 s^2 b / 40 and the floor.
        let by_hand = 8.0 * (4.0 * 0.01 * 1.0_f64.exp() * SHARP_PX / 40.0 + 1e-4);
        assert!((plain - by_hand).abs() < 1e-12, "{plain} {by_hand}");
        assert!(trace(&square, 2.0, 0.0) > 2.0 * plain);
        assert!(trace(&square, 1.0, 4.0) > 1.5 * plain);
        assert!(trace(&slanted, 1.0, 0.0) > 1.1 * plain);
        let half = square.map(|corner| corner.map(|x| 0.5 * x));
        assert!(trace(&half, 1.0, 0.0) > 1.5 * plain);
    }

    #[test]
    fn small_and_far_tags_are_missed() {
        let chance = noise().chance;
        assert!(chance.of(40.0, 1.0) > 0.999);
        assert!((chance.of(12.0, 1.0) - 0.5).abs() < 1e-3);
        assert!((chance.of(40.0, 3.0) - 0.5).abs() < 1e-3);
        assert!(chance.of(6.0, 1.0) < 0.01 && chance.of(40.0, 5.0) < 0.01);
    }
}
