//! Settings of the detector.

use armcal_core::optics::TagFamily;

use crate::decoder::corrected_bits;

/// Search resolution and gates of a detector. `armcal-lab detection` measures the defaults.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorSettings {
    /// Tag family printed on the tags.
    pub family: TagFamily,
    /// Image decimation for the quad search: 1 finds small tags, 2 is faster.
    pub decimation: f32,
    /// Image decimation of a second pass on the contrast-normalized image; 0 for no second pass. It finds tags in haze.
    pub second_decimation: f32,
    /// Largest Hamming distance that is corrected: at most 2 of 25h9 and 36h11, 0 of 16h5, 1 of the other families.
    pub max_wrong_bits: usize,
    /// Smallest contrast (white minus black) over the standard deviation of the fit's residuals.
    pub min_contrast_ratio: f64,
    /// Smallest contrast, white minus black, grey levels.
    pub min_contrast: f64,
    /// Shortest side, px.
    pub min_side_px: f64,
    /// Share of the pixels' variance that the fitted pattern must explain.
    pub min_explained: f64,
    /// Largest standard deviation of a corner in any direction, px.
    pub max_corner_std_px: f64,
    /// Accepted ids; `None`: all ids of the family.
    pub known_ids: Option<Vec<u32>>,
}

impl DetectorSettings {
    /// The defaults for tags of a family.
    #[must_use]
    pub fn of_family(family: TagFamily) -> Self {
        Self {
            family,
            decimation: 1.0,
            second_decimation: 2.0,
            max_wrong_bits: corrected_bits(family),
            min_contrast_ratio: 3.0,
            min_contrast: 4.0,
            min_side_px: 8.0,
            min_explained: 0.5,
            max_corner_std_px: 1.5,
            known_ids: None,
        }
    }
}

impl Default for DetectorSettings {
    fn default() -> Self {
        Self::of_family(TagFamily::default())
    }
}
