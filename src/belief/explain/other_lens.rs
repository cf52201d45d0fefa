//! A lens that is not robot.toml's, before any sensor is blamed: a centre some ten pixels off looks like readings that
//! are off here and there.

use crate::explain::constants::drawing::MIN_GAIN_NATS;
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::is_suspicious;
use crate::explain::model_selection::log_evidence_of_all;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;

/// `drawing` with the lens of a camera estimated, where `found` looks as if a sensor did not belong, the same with that
/// lens does not, and nothing else of the drawing explains more.
pub(crate) fn lens_that_fits(drawing: &Drawing, input: &BundleInput<'_>, found: &Estimate<'_>) -> Option<Drawing> {
    if input.joint_prior.is_some() || found.has_positions() || !is_suspicious(found) {
        return None;
    }
    let before = log_evidence_of_all(found);
    let with_lens = |camera: usize| {
        let other = Drawing { lenses: [&drawing.lenses[..], &[camera]].concat(), ..drawing.clone() };
        let mut input = input.clone();
        other.apply(&mut input);
        let by_lens = estimate(&input).filter(|by_lens| !is_suspicious(by_lens))?;
        Some((log_evidence_of_all(&by_lens) - before, other))
    };
    let cameras = found.cameras().filter(|camera| !drawing.lenses.contains(camera));
    let (gain, other) = cameras.filter_map(with_lens).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (gain > MIN_GAIN_NATS && drawing.better(input, found, gain).is_none()).then_some(other)
}
