//! Ids that the detector reads on tags: misreadings by a fault, and random wrong ids.

use std::collections::BTreeMap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::sensors::camera::tag_projection::TagOnLink;
use armcal_core::stats::stream_rng;

#[derive(Debug)]
pub(super) struct TagReader {
    /// Misread ids, keyed by the true id.
    misread: BTreeMap<u32, u32>,
    wrong_id_probability: f64,
    wrong_ids: ChaCha8Rng,
}

impl TagReader {
    pub(super) fn new(wrong_id_probability: f64, seed: u64) -> Self {
        let wrong_ids = stream_rng(seed, "camera/wrong_ids");
        Self { misread: BTreeMap::new(), wrong_id_probability, wrong_ids }
    }

    pub(super) fn misread(&mut self, id: u32, as_id: u32) {
        self.misread.insert(id, as_id);
    }

    /// Returns the id that is read without random errors.
    pub(super) fn usual_id(&self, id: u32) -> u32 {
        self.misread.get(&id).copied().unwrap_or(id)
    }

    /// Returns the id that is read in one image; a wrong one is that of another tag in `tags`.
    pub(super) fn read_id(&mut self, id: u32, tags: &[TagOnLink]) -> u32 {
        let usual = self.usual_id(id);
        let others = tags.len().saturating_sub(1);
        if self.wrong_id_probability <= 0.0 || others == 0 {
            return usual;
        }
        let is_wrong = self.wrong_ids.random_range(0.0..1.0) < self.wrong_id_probability;
        let pick = self.wrong_ids.random_range(0..others);
        let other = tags.iter().map(|tag| tag.id).filter(|other| *other != id).nth(pick);
        if is_wrong { other.unwrap_or(usual) } else { usual }
    }
}
