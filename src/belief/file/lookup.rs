//! Sensors with terms as tables, for programs that know no basis functions.

use crate::file::constants::lookup::POINTS;
use serde::Serialize;

use crate::file::calibration::{Calibration, JointResult};
use armcal_core::sensor::{SensorModel, nonlinearity_basis};

/// Table of one joint's angle over its range under the reference conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LookupTable {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Reading minus the datasheet's reading in the middle of the range; ascending or descending.
    pub travel_counts: Vec<f64>,
    /// Angle at each of `travel_counts`; ascending if the gain is positive.
    pub angle_rad: Vec<f64>,
    /// Part of the angle beyond `center_rad + offset_rad + gain_rad_per_count * travel_counts`.
    pub correction_rad: Vec<f64>,
}

/// Sensor of a joint whose reading in the middle of the range need not be known.
struct Sensor<'a> {
    joint: &'a str,
    center_rad: f64,
    offset_rad: f64,
    gain: f64,
    gain_rad_per_count: f64,
    half_range_rad: f64,
    nonlinearity_rad: &'a [f64],
}

impl Sensor<'_> {
    fn table(&self) -> LookupTable {
        let share = |n: usize| 2.0 * n as f64 / (POINTS - 1) as f64 - 1.0;
        let correction =
            |n: usize| nonlinearity_basis(share(n)).iter().zip(self.nonlinearity_rad).map(|(phi, a)| phi * a).sum();
        let correction_rad: Vec<f64> = (0..POINTS).map(correction).collect();
        let counts_per_rad = self.gain / self.gain_rad_per_count;
        let travel_rad = |n: usize| share(n) * self.half_range_rad;
        let straight_rad = |n: usize| self.center_rad + self.offset_rad + self.gain * travel_rad(n);
        LookupTable {
            joint: self.joint.to_owned(),
            travel_counts: (0..POINTS).map(|n| counts_per_rad * travel_rad(n)).collect(),
            angle_rad: correction_rad.iter().enumerate().map(|(n, by_rad)| straight_rad(n) + by_rad).collect(),
            correction_rad,
        }
    }
}

impl Calibration {
    /// Returns a table for each joint with terms.
    #[must_use]
    pub fn lookup(&self) -> Vec<LookupTable> {
        let one = |joint: &JointResult| {
            let terms = joint.terms.as_ref()?;
            let sensor = Sensor {
                joint: &joint.name,
                center_rad: joint.center_rad,
                offset_rad: joint.offset_rad,
                gain: joint.gain_over_datasheet? * joint.identified_ratio.unwrap_or(1.0),
                gain_rad_per_count: joint.gain_rad_per_count,
                half_range_rad: terms.half_range_rad,
                nonlinearity_rad: terms.nonlinearity_rad.as_deref().unwrap_or_default(),
            };
            Some(sensor.table())
        };
        self.joint.iter().filter_map(one).collect()
    }
}

impl LookupTable {
    /// Returns the table of a sensor with terms; `None` for other sensors.
    #[must_use]
    pub fn of(model: &SensorModel) -> Option<Self> {
        let (spec, correction) = (&model.spec, &model.correction);
        let sensor = Sensor {
            joint: &spec.joint,
            center_rad: spec.center_rad,
            offset_rad: correction.offset_rad,
            gain: correction.gain,
            gain_rad_per_count: correction.gain / spec.counts_per_rad,
            half_range_rad: spec.half_range_rad,
            nonlinearity_rad: &correction.terms.nonlinearity_rad,
        };
        (!correction.terms.are_zero()).then(|| sensor.table())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{estimate, sample, titan, with_terms};
    use armcal_core::stats::stream_rng;

    #[test]
    fn a_table_is_monotone_and_says_what_the_sensor_says() {
        let robot = titan();
        let mut worst: f64 = 0.0;
        for seed in 0..20 {
            let mut rng = stream_rng(seed, "lookup");
            let (parameters, covariance) = estimate(&robot, 5, 2e-3, &mut rng);
            let full = with_terms(&robot, &parameters, &covariance);
            let tables = full.lookup();
            assert_eq!(tables.len(), 5);
            let sensors = full.sensors(&robot).expect("fits");
            for (table, model) in tables.iter().zip(&sensors.models) {
                let again = LookupTable::of(model).expect("terms");
                assert_eq!((table.travel_counts.len(), &table.joint), (65, &model.spec.joint));
                let ends = [table.travel_counts[0], table.travel_counts[64]];
                let end_counts = model.spec.counts_per_rad * model.spec.half_range_rad;
                assert!((ends[0] + end_counts).abs() < 1e-6 && (ends[1] - end_counts).abs() < 1e-6, "{ends:?}");
                let middle = model.spec.offset_counts + model.spec.counts_per_rad * model.spec.center_rad;
                for n in 0..64 {
                    let [a, b] = [table.angle_rad[n], table.angle_rad[n + 1]];
                    assert!(a < b, "{seed}: {a} {b}");
                    let reading = |travel: f64| model.angle_rad((middle + travel).rem_euclid(model.spec.wrap_counts));
                    assert!((reading(table.travel_counts[n]) - a).abs() < 1e-9);
                    assert!((again.angle_rad[n] - a).abs() < 1e-9);
                    // The angle between two points comes from a straight line.
                    let between = reading(0.5 * (table.travel_counts[n] + table.travel_counts[n + 1]));
                    let size = table.correction_rad.iter().fold(0.0_f64, |size, by| size.max(by.abs()));
                    worst = worst.max((between - 0.5 * (a + b)).abs() / size);
                }
            }
        }
        eprintln!("a straight line between points is off by {:.1} % of the nonlinearity at most", 100.0 * worst);
        assert!(worst < 0.05, "{worst}");
        assert_eq!(sample().lookup(), []);
    }
}
