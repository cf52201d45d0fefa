//! How noisy corners are: of one image by the scatter between the images of a rest, and of images of a moving arm by
//! what they leave.

use crate::follow::constants::image_noise::{CREEPS, KNOWN_COORDINATES, POSE};
use crate::follow::filter::ViewUpdate;
use crate::views::view::View;

/// Of one corner in one image, by the views so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CornerNoise {
    sum_px2: f64,
    n: f64,
}

impl CornerNoise {
    /// robot.toml's.
    pub(crate) fn new(std_px: f64) -> Self {
        Self { sum_px2: KNOWN_COORDINATES * std_px * std_px, n: KNOWN_COORDINATES }
    }

    /// From the scatter between a view's images; a moving arm's has none.
    pub(crate) fn learn(&mut self, view: &View) {
        let [sum_px2, n] = scatter(view);
        self.sum_px2 += sum_px2;
        self.n += n;
    }

    /// Whether a view's images scatter so much more than others that the camera crept on: where no sensor tells of it,
    /// the mean corners of its tags are of several places.
    pub(crate) fn creeps(&self, view: &View) -> bool {
        let [sum_px2, n] = scatter(view);
        sum_px2 > n * (CREEPS * self.std_px()).powi(2)
    }

    pub(crate) fn std_px(&self) -> f64 {
        (self.sum_px2 / self.n).sqrt()
    }
}

/// Sum of squares between a view's images, px^2, and its degrees of freedom.
fn scatter(view: &View) -> [f64; 2] {
    let all = view.tags.iter().filter_map(|tag| tag.corners()).chain(&view.gripper_tag);
    all.fold([0.0, 0.0], |[sum_px2, n], seen| {
        [sum_px2 + seen.scatter_px2, n + 8.0 * seen.n_frames.saturating_sub(1) as f64]
    })
}

/// Of the images of a moving arm, over that of an arm at rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionNoise {
    /// In units of the variance at rest.
    sum: f64,
    n: f64,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self { sum: KNOWN_COORDINATES, n: KNOWN_COORDINATES }
    }
}

impl MotionNoise {
    /// From what a view leaves under the present factor.
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
