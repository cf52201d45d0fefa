//! Automatic exposure: exposure time and gain from the brightness of the image.

use crate::imaging::math::max;
use crate::imaging::rays::Rays;
use crate::spec::ImageSpec;

/// Share of the pixels in the field of view that are at or above the set level.
const BRIGHT_SHARE: f64 = 0.002;
/// Target level of these pixels, as a share of full scale.
const BRIGHT_LEVEL: f32 = 0.85;
/// Sampling distance of the histogram across and down, px.
const LOOK_PX: usize = 3;
/// Bits of a float below the buckets' width: 64 in each octave.
const BUCKET_SHIFT: u32 = 17;
const BUCKETS: usize = 1 << (31 - BUCKET_SHIFT);

/// Exposure share and gain of one image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Exposure {
    pub share: f32,
    pub gain: f32,
}

/// Histogram of the brightness; its buffer is reused.
#[derive(Clone, Debug)]
pub(super) struct AutoExposure {
    buckets: Vec<u32>,
}

impl AutoExposure {
    pub(super) fn new() -> Self {
        Self { buckets: vec![0; BUCKETS] }
    }

    /// Returns the exposure for the image's brightness, or the spec's fixed gain.
    pub(super) fn choose(&mut self, spec: &ImageSpec, planes: &[Vec<f32>; 3], rays: &Rays) -> Exposure {
        if spec.gain > 0.0 {
            return Exposure { share: 1.0, gain: spec.gain as f32 };
        }
        let electrons = self.bright(planes, rays) * spec.electrons_per_cd_m2 as f32;
        let wanted = BRIGHT_LEVEL * spec.full_well_electrons as f32;
        if electrons > wanted {
            return Exposure { share: wanted / electrons, gain: 1.0 };
        }
        Exposure { share: 1.0, gain: (wanted / electrons.max(1e-3)).min(spec.gain_max as f32) }
    }

    /// Returns the level that the bright pixels reach, cd/m2, to a part in 64.
    fn bright(&mut self, planes: &[Vec<f32>; 3], rays: &Rays) -> f32 {
        self.buckets.fill(0);
        let mut n_seen = 0_u32;
        for row in (0..rays.height).step_by(LOOK_PX) {
            let [first, behind] = rays.spans[row];
            for i in (row * rays.width + first..row * rays.width + behind).step_by(LOOK_PX) {
                let brightest = planes.iter().map(|plane| plane[i]).fold(0.0, max);
                self.buckets[(brightest.to_bits() >> BUCKET_SHIFT) as usize] += 1;
                n_seen += 1;
            }
        }
        let wanted = (f64::from(n_seen) * BRIGHT_SHARE) as u32;
        let mut above = 0;
        let bucket = (0..BUCKETS).rev().find(|&bucket| {
            above += self.buckets[bucket];
            above > wanted
        });
        f32::from_bits((bucket.unwrap_or(0) as u32) << BUCKET_SHIFT)
    }
}
