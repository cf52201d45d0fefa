//! Keys that correct the scale of a joint: in robot.toml for counts, in the input map for readings stated as angles.

use crate::say::constants::sensor_keys::{SIGN_ALONE, SIGNIFICANT_DIGITS};
use armcal_core::kinematics::JointKind;

/// A joint whose angle is another multiple of its reading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rescaled<'a> {
    /// Name of the joint in the URDF.
    pub joint: &'a str,
    /// Angle over reading, under the present scale.
    pub slope: f64,
    /// `factor` of the input map with that slope; `None`: readings are counts.
    pub input_factor: Option<f64>,
}

impl Rescaled<'_> {
    /// Returns the joint with the assumed slope for its kind of error.
    pub(crate) fn taken_as(self, slope: f64) -> Self {
        Self { slope, input_factor: self.input_factor.map(|factor| factor * slope / self.slope), ..self }
    }

    /// Returns a reversed sensor with the scale of its datasheet, if its slope is near -1.
    pub(crate) fn with_own_scale_if_reversed(self) -> Self {
        if (self.slope + 1.0).abs() < SIGN_ALONE { self.taken_as(-1.0) } else { self }
    }

    /// Returns the joint with the slope of another unit: the ratio of the two units.
    pub(crate) fn of_another_unit(self, moves: JointKind) -> Self {
        let ratio = if moves.is_slide() { 1e-3 } else { 1f64.to_radians() };
        self.taken_as(if self.slope < 1.0 { ratio } else { ratio.recip() })
    }

    /// The line to change, as advice.
    pub(crate) fn line(&self) -> String {
        let Self { joint, slope, input_factor } = *self;
        match input_factor {
            Some(factor) => {
                format!("set in [joint_sensors] of the input map: factor.{joint} = {}", significant(factor))
            }
            None => format!(
                "multiply scale_counts_per_deg (of a slide, scale_counts_per_mm) in robot.toml by {}",
                significant(slope.recip())
            ),
        }
    }
}

/// Formats a figure with enough digits for a file.
pub(crate) fn significant(value: f64) -> String {
    let before = value.abs().max(f64::MIN_POSITIVE).log10().floor() as i32 + 1;
    let digits = (SIGNIFICANT_DIGITS - before).max(1) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_keep_their_precision_at_any_size() {
        for value in [0.000_015_346_1, -0.499_474_2, 1.0, 57.295_78, 651.510_4, -123_456.7] {
            let written: f64 = significant(value).parse().expect("a number");
            assert!((written / value - 1.0).abs() < 1e-5, "{value}: {written}");
            assert!(significant(value).contains('.'), "{value}");
        }
    }

    #[test]
    fn a_sensor_that_goes_the_other_way_has_its_own_scale() {
        let found = Rescaled { joint: "elbow", slope: -0.997, input_factor: Some(-0.997 * 2.0) };
        let taken = found.with_own_scale_if_reversed();
        assert!((taken.slope + 1.0).abs() < 1e-12 && (taken.input_factor.unwrap() + 2.0).abs() < 1e-12, "{taken:?}");
        let geared = Rescaled { slope: -0.5, ..found }.with_own_scale_if_reversed();
        assert_eq!((geared.slope, geared.input_factor), (-0.5, found.input_factor));
    }

    #[test]
    fn another_unit_has_an_exact_ratio() {
        let found = Rescaled { joint: "elbow", slope: 0.0173, input_factor: Some(0.0173) };
        let taken = found.of_another_unit(JointKind::Revolute);
        assert!((taken.input_factor.unwrap() - 1f64.to_radians()).abs() < 1e-12, "{taken:?}");
        let metres = Rescaled { slope: 990.0, input_factor: None, ..found }.of_another_unit(JointKind::Prismatic);
        assert!((metres.slope - 1000.0).abs() < 1e-9, "{metres:?}");
    }
}
