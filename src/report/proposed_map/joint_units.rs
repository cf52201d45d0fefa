//! The likely unit of the joints' numbers, of a topic or of a table's columns.

use armcal_core::robot::{JointSensorSpec, Robot};

/// No joint of an arm turns more than two turns either way.
pub(in crate::report) const MAX_RAD: f64 = 4.0 * std::f64::consts::PI;
/// A robot folder whose readings are radians has one count per radian.
const RADIANS_WITHIN: f64 = 1e-6;
/// Distance of an angle beyond the joint's range that an error of the sensor explains, rad. Assumed.
const BEYOND_RANGE_RAD: f64 = 0.2;
/// Distance of a slide beyond its range that an error of the sensor explains, m. Assumed.
const BEYOND_RANGE_M: f64 = 0.05;
/// Largest angle of an arm that was not moved for a calibration, rad: no joint exceeds it. Assumed.
const STOOD_RAD: f64 = 0.12;

/// Units of the numbers in a robot's joint readings.
pub(in crate::report) struct JointUnits {
    /// Unit as the input map states it; `None` if the numbers may be counts of the robot's sensors.
    pub unit: Option<&'static str>,
    /// Largest absolute number of joints that turn.
    pub largest: f64,
    /// True if the slides' numbers are millimetres.
    pub are_slides_mm: bool,
}

/// Units that the names of all columns state: degrees of joints that turn, millimetres of slides.
#[derive(Clone, Copy, Default)]
pub(in crate::report) struct StatedUnits {
    pub deg: bool,
    pub mm: bool,
}

impl JointUnits {
    /// Returns the units that fit the largest number of each joint; `largest` returns its absolute value.
    pub fn of(robot: &Robot, stated: StatedUnits, largest: impl Fn(&JointSensorSpec) -> Option<f64>) -> Self {
        let sensors = robot.sensors.iter().filter_map(|spec| Some((spec, largest(spec)?)));
        let (slides, turning): (Vec<_>, Vec<_>) = sensors.partition(|(spec, _)| spec.moves.is_slide());
        let most = turning.iter().map(|(_, value)| *value).fold(0.0, f64::max);
        let are_slides_mm = stated.mm || are_mm(&slides);
        let is_in_rad = robot.sensors.iter().all(|spec| (spec.counts_per_rad.abs() - 1.0).abs() <= RADIANS_WITHIN);
        let unit = match is_in_rad {
            _ if stated.deg => Some("deg"),
            true if most > MAX_RAD => Some("deg").filter(|_| most.to_radians() <= MAX_RAD),
            // The input map has a unit of slides only with one of the joints that turn.
            true => Some("rad").filter(|_| are_slides_mm),
            false if most <= MAX_RAD => Some("rad"),
            false => Some("deg").filter(|_| are_degrees(&turning)),
        };
        Self { unit, largest: most, are_slides_mm: are_slides_mm && unit.is_some() }
    }

    /// The line of the slides' unit; empty for metres.
    pub fn slide_line(&self) -> &'static str {
        if self.are_slides_mm { "slide_unit = \"mm\"   # of joints that slide\n" } else { "" }
    }
}

fn are_mm(slides: &[(&JointSensorSpec, f64)]) -> bool {
    let is_within = |&(spec, value): &(&JointSensorSpec, f64), unit_m: f64| {
        unit_m * value <= spec.center_rad.abs() + spec.half_range_rad + BEYOND_RANGE_M
    };
    !slides.is_empty() && slides.iter().all(|of| is_within(of, 1e-3)) && slides.iter().any(|of| !is_within(of, 1.0))
}

/// Numbers that are too small for counts, and within all ranges as degrees.
fn are_degrees(turning: &[(&JointSensorSpec, f64)]) -> bool {
    let most_rad = |spec: &JointSensorSpec| spec.center_rad.abs() + spec.half_range_rad + BEYOND_RANGE_RAD;
    let are_within = turning.iter().all(|(spec, value)| value.to_radians() <= most_rad(spec));
    let as_counts = |spec: &JointSensorSpec, value: f64| (value - spec.offset_counts) / spec.counts_per_rad;
    let is_outside = |(spec, value): &(&JointSensorSpec, f64)| {
        let from_center_rad = |value: f64| (as_counts(spec, value) - spec.center_rad).abs();
        from_center_rad(*value).min(from_center_rad(-value)) > spec.half_range_rad + BEYOND_RANGE_RAD
    };
    let stood = |(spec, value): &(&JointSensorSpec, f64)| value / spec.counts_per_rad.abs() < STOOD_RAD;
    are_within && (turning.iter().any(is_outside) || turning.iter().all(stood))
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::robot::load;
    use std::path::Path;

    fn titan() -> Robot {
        load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4")).expect("it reads")
    }

    /// The unit for a robot with so many counts per rad and that offset, at angles of half the ranges.
    fn unit(counts_per_rad: f64, offset: f64, recorded: impl Fn(&JointSensorSpec, f64) -> f64) -> Option<&'static str> {
        let mut robot = titan();
        for spec in &mut robot.sensors {
            (spec.counts_per_rad, spec.offset_counts) = (counts_per_rad, offset);
        }
        let largest = |spec: &JointSensorSpec| Some(recorded(spec, spec.center_rad + 0.5 * spec.half_range_rad).abs());
        JointUnits::of(&robot, StatedUnits::default(), largest).unit
    }

    #[test]
    fn degrees_are_told_from_radians_and_counts() {
        let deg = |_: &JointSensorSpec, angle_rad: f64| angle_rad.to_degrees();
        let rad = |_: &JointSensorSpec, angle_rad: f64| angle_rad;
        let counts = |spec: &JointSensorSpec, angle_rad: f64| spec.offset_counts + spec.counts_per_rad * angle_rad;
        assert_eq!((unit(1.0, 0.0, deg), unit(1.0, 0.0, rad)), (Some("deg"), None));
        for (per_rad, offset) in [(652.0, 2048.0), (-10_430.0, 32_768.0), (20_860.0, 0.0)] {
            assert_eq!(unit(per_rad, offset, deg), Some("deg"), "{per_rad}");
            assert_eq!(unit(per_rad, offset, rad), Some("rad"), "{per_rad}");
            assert_eq!(unit(per_rad, offset, counts), None, "{per_rad}");
        }
        // Raw readings of a sensor that counts degrees.
        assert_eq!(unit(1f64.to_degrees(), 0.0, counts), None);
    }
}
