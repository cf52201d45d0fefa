//! One row per joint, with standard deviations.

use armcal_belief::calib::{Calibration, JointResult};
use armcal_core::sensor::N_SHAPE;

use crate::export::table::csv_field;

/// Terms that are a single number each.
const SCALARS: [&str; 5] =
    ["offset_rad_per_k", "gain_per_k", "offset_rad_per_mpa", "drift_rad_per_h", "half_backlash_rad"];

/// CSV with the keys of calibration.toml as columns; the column after a term's is that of its standard deviation. A
/// cell is empty where calibration.toml has no such key. For an arm with slides, names of columns have no `_rad`, and
/// the last column, `unit`, says rad or m.
#[must_use]
pub fn csv_rows(calibration: &Calibration) -> String {
    let with_std = |key: String| [key.clone(), format!("{key}_std")];
    let nonlinearity =
        (1..=N_SHAPE).flat_map(|n| [format!("nonlinearity_rad_{n}"), format!("nonlinearity_rad_std_{n}")]);
    let scalars = SCALARS.iter().flat_map(|key| with_std((*key).to_owned()));
    let fixed = [
        "joint",
        "center_rad",
        "gain_rad_per_count",
        "gain_std_rad_per_count",
        "gain_estimated",
        "offset_rad",
        "offset_std_rad",
        "offset_estimated",
        "covered_low_rad",
        "covered_high_rad",
        "residual_std_rad",
        "half_range_rad",
    ];
    let head: Vec<String> = fixed.map(str::to_owned).into_iter().chain(nonlinearity).chain(scalars).collect();
    let has_slide = calibration.has_slide();
    // With slides the rows have different units, so the last column gives the unit.
    let head = if has_slide { head.iter().map(|key| key.replace("_rad", "")).collect() } else { head };
    let unit = |joint: &JointResult| has_slide.then(|| joint.moves.si().to_owned());
    let head: Vec<String> = head.into_iter().chain(has_slide.then(|| "unit".to_owned())).collect();
    let rows = calibration.joint.iter().map(|joint| row(joint).into_iter().chain(unit(joint)).collect());
    let lines: Vec<String> = std::iter::once(head).chain(rows).map(|cells| cells.join(",")).collect();
    lines.join("\n") + "\n"
}

fn row(joint: &JointResult) -> Vec<String> {
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let mut cells = vec![
        csv_field(&joint.name),
        joint.center_rad.to_string(),
        joint.gain_rad_per_count.to_string(),
        joint.gain_std_rad_per_count.to_string(),
        joint.gain_estimated.to_string(),
        joint.offset_rad.to_string(),
        joint.offset_std_rad.to_string(),
        joint.offset_estimated.to_string(),
        joint.covered_rad[0].to_string(),
        joint.covered_rad[1].to_string(),
        number(joint.residual_std_rad),
    ];
    let terms = joint.terms.clone().unwrap_or_default();
    cells.push(number(joint.terms.as_ref().map(|terms| terms.half_range_rad)));
    let at = |values: &Option<Vec<f64>>, n: usize| number(values.as_ref().and_then(|values| values.get(n).copied()));
    for n in 0..N_SHAPE {
        cells.extend([at(&terms.nonlinearity_rad, n), at(&terms.nonlinearity_rad_std, n)]);
    }
    let scalars = [
        (terms.offset_rad_per_k, terms.offset_rad_per_k_std),
        (terms.gain_per_k, terms.gain_per_k_std),
        (terms.offset_rad_per_mpa, terms.offset_rad_per_mpa_std),
        (terms.drift_rad_per_h, terms.drift_rad_per_h_std),
        (terms.half_backlash_rad, terms.half_backlash_rad_std),
    ];
    cells.extend(scalars.into_iter().flat_map(|(value, std)| [number(value), number(std)]));
    cells
}
