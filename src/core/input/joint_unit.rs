//! Whether the recorded joints' numbers are in the unit that the input map says.

use super::error::InputError;
use super::joints::{Reading, n_needed};
use super::lerobot::LerobotCalibration;
use super::map::{InputMap, JointUnit, SlideUnit};
use crate::robot::{JointSensorSpec, Robot};

/// An angle may lie so far outside of the joint's range: sensors are off.
const RANGE_FACTOR: f64 = 1.1;
const BEYOND_RANGE_RAD: f64 = 0.2;
const BEYOND_RANGE_M: f64 = 0.05;
/// A joint without limits may have turned so far.
const TURNS_RAD: f64 = 8.0 * std::f64::consts::PI;
/// With fewer of the numbers within the joints' ranges the unit is wrong, if with another one nearly all are.
const FEW: f64 = 0.7;
const NEARLY_ALL: f64 = 0.99;
/// An arm whose joints all move by less was not moved for a calibration; by more than `MOVED_RAD`, it was.
const STOOD_RAD: f64 = 0.12;
const MOVED_RAD: f64 = 0.3;
/// Angles in radians are smaller.
const LARGEST_RAD: f64 = 7.0;
/// LeRobot's numbers are single precision.
const ROUNDED: f64 = 1e-3;

/// What speaks for another unit without proving it; `None` where nothing does.
///
/// # Errors
/// [`InputError::Unit`] where most numbers lie outside of their joints' ranges, and none do in another unit.
pub(super) fn check_unit(
    file: &str,
    map: &InputMap,
    robot: &Robot,
    readings: &[Reading],
) -> Result<Option<String>, InputError> {
    if let Some(lerobot) = &map.lerobot {
        check_lerobot(file, map, lerobot, (robot, readings))?;
    }
    let values = Values { stated: map.joint_unit, sensors: &robot.sensors[..n_needed(robot)], readings };
    let stated = map.joint_unit;
    if stated != JointUnit::Counts {
        values.check_slides(file, map.slide_unit)?;
    }
    let others = [JointUnit::Rad, JointUnit::Deg].into_iter().filter(|unit| *unit != stated);
    let fits = |unit: &JointUnit| values.share_within(*unit) > NEARLY_ALL;
    if let Some((joint, value)) = values.first_outside()
        && stated != JointUnit::Counts
        && values.share_within(stated) < FEW
        && let Some(likely) = others.into_iter().find(fits)
    {
        let joint = robot.sensors[joint].joint.clone();
        return Err(InputError::Unit { file: file.to_owned(), joint, value, stated, likely });
    }
    let is_small = values.largest() < LARGEST_RAD && values.most_moved_rad(stated) < STOOD_RAD;
    let would_move = values.most_moved_rad(JointUnit::Rad) > MOVED_RAD && fits(&JointUnit::Rad);
    let is_doubtful = stated != JointUnit::Rad && !readings.is_empty() && is_small && would_move;
    Ok(is_doubtful.then(|| {
        format!(
            "the joints' numbers are all below {:.1} and would move the arm by {:.1} deg at most as {}: where they \
             are radians, set joint_sensors.unit = \"rad\" in the input map",
            values.largest(),
            values.most_moved_rad(stated).to_degrees(),
            stated.name()
        )
    }))
}

/// Refuses ticks that no number of LeRobot's stands for.
fn check_lerobot(
    file: &str,
    map: &InputMap,
    lerobot: &LerobotCalibration,
    (robot, readings): (&Robot, &[Reading]),
) -> Result<(), InputError> {
    let allowed = lerobot.values().allowed();
    for (joint, spec) in robot.sensors.iter().enumerate().take(n_needed(robot)) {
        let recorded = map.recorded_name(&spec.joint);
        let [zero, one] = [0.0, 1.0].map(|value| lerobot.tick(recorded, value));
        let values = readings.iter().map(|reading| (reading.counts[joint] - zero) / (one - zero));
        let is_outside = |value: &f64| *value < allowed[0] - ROUNDED || *value > allowed[1] + ROUNDED;
        if let Some(value) = values.into_iter().find(is_outside) {
            let (file, joint, values) = (file.to_owned(), spec.joint.clone(), lerobot.values().key().to_owned());
            return Err(InputError::Lerobot { file, joint, value, values, allowed });
        }
    }
    Ok(())
}

/// The recorded numbers of the joints that move the camera.
struct Values<'a> {
    stated: JointUnit,
    sensors: &'a [JointSensorSpec],
    readings: &'a [Reading],
}

impl Values<'_> {
    /// The number as recorded.
    fn value(&self, reading: &Reading, joint: usize) -> f64 {
        let (spec, counts) = (&self.sensors[joint], reading.counts[joint]);
        let angle_rad = (counts - spec.offset_counts) / spec.counts_per_rad;
        match self.stated {
            JointUnit::Counts => counts,
            JointUnit::Rad => angle_rad,
            JointUnit::Deg if spec.moves.is_slide() => angle_rad,
            JointUnit::Deg => angle_rad.to_degrees(),
        }
    }

    fn angle_rad(&self, unit: JointUnit, reading: &Reading, joint: usize) -> f64 {
        let (spec, value) = (&self.sensors[joint], self.value(reading, joint));
        (unit.counts(spec, value) - spec.offset_counts) / spec.counts_per_rad
    }

    fn is_within(&self, unit: JointUnit, reading: &Reading, joint: usize) -> bool {
        let spec = &self.sensors[joint];
        let most_rad =
            if spec.is_limited() { RANGE_FACTOR * spec.half_range_rad + BEYOND_RANGE_RAD } else { TURNS_RAD };
        (self.angle_rad(unit, reading, joint) - spec.center_rad).abs() <= most_rad
    }

    /// Refuses a slide whose numbers lie outside of its range, and within it in the other unit.
    fn check_slides(&self, file: &str, stated: SlideUnit) -> Result<(), InputError> {
        let likely = if stated == SlideUnit::M { SlideUnit::Mm } else { SlideUnit::M };
        let factor = likely.in_m() / stated.in_m();
        for (joint, spec) in self.sensors.iter().enumerate().filter(|(_, spec)| spec.moves.is_slide()) {
            let most_m = RANGE_FACTOR * spec.half_range_rad + BEYOND_RANGE_M;
            let share = |factor: f64| {
                let travel_m = |reading| factor * self.angle_rad(self.stated, reading, joint) - spec.center_rad;
                let within = self.readings.iter().filter(|reading| travel_m(reading).abs() <= most_m);
                within.count() as f64 / self.readings.len().max(1) as f64
            };
            if spec.is_limited() && !self.readings.is_empty() && share(1.0) < FEW && share(factor) > NEARLY_ALL {
                let value = self.angle_rad(self.stated, &self.readings[0], joint) / stated.in_m();
                let (file, joint) = (file.to_owned(), spec.joint.clone());
                return Err(InputError::SlideUnit { file, joint, value, stated, likely });
            }
        }
        Ok(())
    }

    fn each(&self) -> impl Iterator<Item = (&Reading, usize)> {
        self.readings.iter().flat_map(|reading| (0..self.sensors.len()).map(move |joint| (reading, joint)))
    }

    /// Of the numbers, taken in `unit`, within their joints' ranges.
    fn share_within(&self, unit: JointUnit) -> f64 {
        let n = (self.readings.len() * self.sensors.len()).max(1) as f64;
        self.each().filter(|(reading, joint)| self.is_within(unit, reading, *joint)).count() as f64 / n
    }

    /// The joint and number of the first one outside of its range.
    fn first_outside(&self) -> Option<(usize, f64)> {
        let (reading, joint) = self.each().find(|(reading, joint)| !self.is_within(self.stated, reading, *joint))?;
        Some((joint, self.value(reading, joint)))
    }

    fn largest(&self) -> f64 {
        self.each().map(|(reading, joint)| self.value(reading, joint).abs()).fold(0.0, f64::max)
    }

    /// How far the joint that moved most did.
    fn most_moved_rad(&self, unit: JointUnit) -> f64 {
        let span = |joint: usize| {
            let angles = self.readings.iter().map(|reading| self.angle_rad(unit, reading, joint));
            let (low, high) = angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(a), h.max(a)));
            high - low
        };
        (0..self.sensors.len()).map(span).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::parse_input_map;
    use crate::joints::JointCounts;
    use crate::time::Stamp;
    use std::path::Path;

    /// The arm at six poses, its angles in rad times `factor`, read as `unit`.
    fn told(unit: &str, factor: f64) -> Result<Option<String>, String> {
        let robot = crate::robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).unwrap();
        let text = format!(
            "version = 1\nkind = \"input\"\n\
             [joint_sensors]\ntopic = \"/j\"\nunit = \"{unit}\"\n[tags]\ntopic = \"/t\"\nuse = \
             \"corners\"\n"
        );
        let map = parse_input_map(Path::new("map.toml"), &text).unwrap();
        let value = |pose: i32, spec: &JointSensorSpec| {
            factor * (spec.center_rad + spec.half_range_rad * (0.15 * f64::from(pose) - 0.4))
        };
        let reading = |pose: i32| Reading {
            stamp: Stamp::default(),
            counts: JointCounts::from_fn(robot.n_joints(), |joint| {
                let spec = &robot.sensors[joint];
                map.joint_unit.counts(spec, value(pose, spec))
            }),
            digest: [0; 32],
        };
        let readings: Vec<Reading> = (0..6).map(reading).collect();
        check_unit("run.mcap", &map, &robot, &readings).map_err(|error| error.to_string())
    }

    #[test]
    fn degrees_for_radians_are_refused_and_radians_for_others_are_doubted() {
        let degrees = 1f64.to_degrees();
        assert_eq!((told("rad", 1.0), told("deg", degrees)), (Ok(None), Ok(None)));
        let problem = told("rad", degrees).expect_err("degrees");
        let [in_degrees, in_counts] =
            ["deg", "counts"].map(|unit| told(unit, 1.0).expect("no proof").expect("a doubt"));
        insta::assert_snapshot!("joint_units", [problem, in_degrees, in_counts].join("\n"));
    }
}
