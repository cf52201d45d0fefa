//! Corner noise: of one image by the scatter between the images of a rest, and of images of a moving arm by their
//! residuals.

use crate::follow::constants::image_noise::{CREEPS, KNOWN_COORDINATES, POSE};
use crate::follow::filter::ViewUpdate;
use crate::views::view::View;

/// Noise of one corner coordinate in one image, by the views so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CornerNoise {
    sum_px2: f64,
    n: f64,
}

impl CornerNoise {
    /// Starts with robot.toml's noise.
    pub(crate) fn new(std_px: f64) -> Self {
        Self { sum_px2: KNOWN_COORDINATES * std_px * std_px, n: KNOWN_COORDINATES }
    }

    /// Learns from the scatter between a view's images; a view of a moving arm has none.
    pub(crate) fn learn(&mut self, view: &View) {
        let [sum_px2, n] = scatter(view);
        self.sum_px2 += sum_px2;
        self.n += n;
    }

    /// True if a view's images scatter so much that the camera crept on. If no sensor shows that motion, the mean
    /// corners of its tags belong to several poses.
    pub(crate) fn creeps(&self, view: &View) -> bool {
        let [sum_px2, n] = scatter(view);
        sum_px2 > n * (CREEPS * self.std_px()).powi(2)
    }

    pub(crate) fn std_px(&self) -> f64 {
        (self.sum_px2 / self.n).sqrt()
    }
}

/// Returns the sum of squares between a view's images, px^2, and its degrees of freedom.
fn scatter(view: &View) -> [f64; 2] {
    let all = view.tags.iter().filter_map(|tag| tag.corners()).chain(&view.gripper_tag);
    all.fold([0.0, 0.0], |[sum_px2, n], seen| {
        [sum_px2 + seen.scatter_px2, n + 8.0 * seen.n_frames.saturating_sub(1) as f64]
    })
}

/// Ratio of the noise of images of a moving arm to that of an arm at rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionNoise {
    /// Sum of squares in units of the variance at rest.
    sum: f64,
    n: f64,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self { sum: KNOWN_COORDINATES, n: KNOWN_COORDINATES }
    }
}

impl MotionNoise {
    /// Learns from a view's residuals under the present factor.
    pub(crate) fn learn(&mut self, update: &ViewUpdate) {
        let left = update.n_coordinates as f64 - POSE;
        if left > 0.0 {
            self.sum += update.observation_cost * self.factor().powi(2);
            self.n += left;
        }
    }

    pub(crate) fn factor(&self) -> f64 {
        (self.sum / self.n).sqrt()
    }
}
