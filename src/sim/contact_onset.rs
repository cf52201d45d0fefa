//! Onset of contacts between parts.

use crate::physics::ArmPhysics;
use crate::solids::PairTable;

/// Two parts that touch again within this time have not parted, s.
const DEBOUNCE_S: f64 = 0.1;

/// Last contact of each pair.
#[derive(Clone, Debug)]
pub(super) struct ContactOnsets {
    n_parts: usize,
    /// Step of the last touch per pair, or none.
    last_touch: Vec<Option<u64>>,
    began: Vec<(usize, usize)>,
    debounce_steps: u64,
}

impl ContactOnsets {
    pub(super) fn new(pairs: &PairTable, step_s: f64) -> Self {
        let n_parts = pairs.n_parts();
        Self {
            n_parts,
            last_touch: vec![None; n_parts * n_parts],
            began: Vec::with_capacity(n_parts * n_parts),
            debounce_steps: (DEBOUNCE_S / step_s).ceil() as u64,
        }
    }

    /// Returns the pairs that began to touch in this step, smaller part first, in order.
    pub(super) fn update(&mut self, physics: &ArmPhysics, step: u64) -> &[(usize, usize)] {
        self.began.clear();
        let Self { n_parts, last_touch, began, debounce_steps } = self;
        physics.for_each_contact(|a, b| {
            let (a, b) = (a.min(b), a.max(b));
            let last = &mut last_touch[a * *n_parts + b];
            if last.is_none_or(|last| step - last > *debounce_steps) {
                began.push((a, b));
            }
            *last = Some(step);
        });
        self.began.sort_unstable();
        &self.began
    }
}
