//! Check that the recorded joints' numbers are in the unit that the input map states.

use std::f64::consts::TAU;

use super::error::InputError;
use super::joints::{Reading, n_needed};
use super::lerobot::LerobotCalibration;
use super::map::{InputMap, JointAngleLines, JointUnit, SlideUnit};
use crate::robot::{JointSensorSpec, Robot};

/// Tolerance of an angle outside of the joint's range, because sensors have errors.
const RANGE_FACTOR: f64 = 1.1;
const BEYOND_RANGE_RAD: f64 = 0.2;
const BEYOND_RANGE_M: f64 = 0.05;
/// Largest angle of a joint without limits, from its centre: four turns.
const TURNS_RAD: f64 = 8.0 * std::f64::consts::PI;
/// Share of the numbers within the joints' ranges below which the unit is wrong, if nearly all are within in another
/// unit.
const FEW: f64 = 0.7;
const NEARLY_ALL: f64 = 0.99;
/// Largest motion of an arm that was not moved for a calibration; motion above `MOVED_RAD` means that it was.
const STOOD_RAD: f64 = 0.12;
const MOVED_RAD: f64 = 0.3;
/// Upper limit of angles in radians.
const LARGEST_RAD: f64 = 7.0;
/// Tolerance of one count per radian for a sensor that counts radians. Assumed: scales have seven digits or more.
const ONE_RAD: f64 = 1e-6;
/// Rounding tolerance of LeRobot's numbers, which are single precision.
const ROUNDED: f64 = 1e-3;

/// Returns evidence for another unit that does not prove it; `None` if there is none.
///
/// # Errors
/// [`InputError::Unit`] if most numbers lie outside of their joints' ranges, and none do in another unit.
pub(super) fn check_unit(
    file: &str,
    map: &InputMap,
    robot: &Robot,
    readings: &[Reading],
) -> Result<Option<String>, InputError> {
    if let Some(lerobot) = &map.lerobot {
        check_lerobot(file, map, lerobot, (robot, readings))?;
    }
    let stated = stated_unit(map, robot);
    let values = Values { stated, lines: &map.joint_lines, sensors: &robot.sensors[..n_needed(robot)], readings };
    if stated != JointUnit::Counts {
        values.check_slides(file, map.joint_lines.slide_unit)?;
    }
    let others = [JointUnit::Rad, JointUnit::Deg].into_iter().filter(|unit| *unit != stated);
    if let Some((joint, value)) = values.first_outside()
        && stated != JointUnit::Counts
        && values.share(|reading, joint| values.is_within(stated, reading, joint)) < FEW
        && let Some(likely) = others.into_iter().find(|unit| values.prove(*unit))
    {
        let joint = robot.sensors[joint].joint.clone();
        let factors = values.factors_of_some(likely);
        return Err(InputError::Unit { file: file.to_owned(), joint, value, stated, likely, factors });
    }
    let is_small = values.largest() < LARGEST_RAD && values.most_moved_rad(stated) < STOOD_RAD;
    let fits_rad = || values.share(|reading, joint| values.is_within(JointUnit::Rad, reading, joint)) > NEARLY_ALL;
    let would_move = values.most_moved_rad(JointUnit::Rad) > MOVED_RAD && fits_rad();
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

/// Returns the unit of the map; radians if the robot's sensors count these.
fn stated_unit(map: &InputMap, robot: &Robot) -> JointUnit {
    let counts_rad = |spec: &JointSensorSpec| (spec.counts_per_rad - 1.0).abs() < ONE_RAD && spec.offset_counts == 0.0;
    let are_rad = map.lerobot.is_none() && robot.sensors.iter().all(counts_rad);
    if map.joint_unit == JointUnit::Counts && are_rad { JointUnit::Rad } else { map.joint_unit }
}

/// Refuses ticks that match no number of LeRobot's.
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
    lines: &'a JointAngleLines,
    sensors: &'a [JointSensorSpec],
    readings: &'a [Reading],
}

impl Values<'_> {
    /// Returns the number as recorded.
    fn value(&self, reading: &Reading, joint: usize) -> f64 {
        let (spec, counts) = (&self.sensors[joint], reading.counts[joint]);
        match self.lines.of(self.stated, spec) {
            Some(line) => line.recorded((counts - spec.offset_counts) / spec.counts_per_rad),
            None => counts,
        }
    }

    fn angle_rad(&self, unit: JointUnit, reading: &Reading, joint: usize) -> f64 {
        let (spec, value) = (&self.sensors[joint], self.value(reading, joint));
        match self.lines.of(unit, spec) {
            Some(line) => line.angle_rad(value),
            None => (value - spec.offset_counts) / spec.counts_per_rad,
        }
    }

    fn is_within(&self, unit: JointUnit, reading: &Reading, joint: usize) -> bool {
        self.off_center_rad(unit, reading, joint).abs() <= self.most_rad(joint)
    }

    /// Returns true if the number is within the range, or a turn from it: readings may be wrapped to 0 to 360 deg.
    fn is_within_a_turn(&self, unit: JointUnit, reading: &Reading, joint: usize) -> bool {
        let off_rad = self.off_center_rad(unit, reading, joint).abs();
        let turn_rad = if self.sensors[joint].moves.is_slide() { 0.0 } else { TAU };
        off_rad.min((off_rad - turn_rad).abs()) <= self.most_rad(joint)
    }

    fn off_center_rad(&self, unit: JointUnit, reading: &Reading, joint: usize) -> f64 {
        self.angle_rad(unit, reading, joint) - self.sensors[joint].center_rad
    }

    fn most_rad(&self, joint: usize) -> f64 {
        let spec = &self.sensors[joint];
        if spec.is_limited() { RANGE_FACTOR * spec.half_range_rad + BEYOND_RANGE_RAD } else { TURNS_RAD }
    }

    /// Returns true if some joint's numbers are in `unit` and not as stated, and no joint's numbers contradict `unit`.
    fn prove(&self, unit: JointUnit) -> bool {
        let no_other = self.share(|reading, joint| self.is_within_a_turn(unit, reading, joint)) > NEARLY_ALL;
        no_other && (0..self.sensors.len()).any(|joint| self.proves(unit, joint))
    }

    /// Returns true if the numbers of this joint are outside of its range as stated, and within it in `unit`.
    fn proves(&self, unit: JointUnit, joint: usize) -> bool {
        let share = |unit| self.share_of_readings(|reading| self.is_within(unit, reading, joint));
        share(self.stated) < FEW && share(unit) > NEARLY_ALL
    }

    /// Returns the factors of the joints whose numbers are in `unit`, if as many others move as stated and stand still
    /// in `unit`. Empty if all joints are in `unit`.
    fn factors_of_some(&self, unit: JointUnit) -> Vec<(String, f64)> {
        let all = || 0..self.sensors.len();
        let moves_as_stated = |joint: usize| {
            let is_within = self.share_of_readings(|reading| self.is_within(self.stated, reading, joint)) > NEARLY_ALL;
            let [stated_rad, other_rad] = [self.stated, unit].map(|unit| self.moved_rad(unit, joint));
            is_within && stated_rad > MOVED_RAD && other_rad < STOOD_RAD
        };
        let (as_stated, others): (Vec<usize>, Vec<usize>) = all().partition(|&joint| moves_as_stated(joint));
        if as_stated.len() < others.len() || !others.iter().all(|&joint| self.proves(unit, joint)) {
            return Vec::new();
        }
        let factor = |&joint: &usize| {
            let spec = &self.sensors[joint];
            let [stated, other] = [self.lines.of(self.stated, spec)?, self.lines.of(unit, spec)?];
            Some((spec.joint.clone(), stated.factor * other.unit_rad / stated.unit_rad))
        };
        others.iter().filter_map(factor).collect()
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
                let value = self.value(&self.readings[0], joint);
                let (file, joint) = (file.to_owned(), spec.joint.clone());
                return Err(InputError::SlideUnit { file, joint, value, stated, likely });
            }
        }
        Ok(())
    }

    fn each(&self) -> impl Iterator<Item = (&Reading, usize)> {
        self.readings.iter().flat_map(|reading| (0..self.sensors.len()).map(move |joint| (reading, joint)))
    }

    /// Share of the numbers, over all readings and joints, for which `is_so` is true.
    fn share(&self, is_so: impl Fn(&Reading, usize) -> bool) -> f64 {
        let n = (self.readings.len() * self.sensors.len()).max(1) as f64;
        self.each().filter(|(reading, joint)| is_so(reading, *joint)).count() as f64 / n
    }

    /// Share of the readings for which `is_so` is true.
    fn share_of_readings(&self, is_so: impl Fn(&Reading) -> bool) -> f64 {
        self.readings.iter().filter(|reading| is_so(reading)).count() as f64 / self.readings.len().max(1) as f64
    }

    /// First number outside of its joint's range, with the joint.
    fn first_outside(&self) -> Option<(usize, f64)> {
        let (reading, joint) = self.each().find(|(reading, joint)| !self.is_within(self.stated, reading, *joint))?;
        Some((joint, self.value(reading, joint)))
    }

    /// Largest absolute recorded number; only of joints that turn, unless the numbers are counts.
    fn largest(&self) -> f64 {
        let counts = |joint: usize| self.stated == JointUnit::Counts || !self.sensors[joint].moves.is_slide();
        let all = self.each().filter(|(_, joint)| counts(*joint));
        all.map(|(reading, joint)| self.value(reading, joint).abs()).fold(0.0, f64::max)
    }

    /// Motion of the joint that moved most, rad.
    fn most_moved_rad(&self, unit: JointUnit) -> f64 {
        (0..self.sensors.len()).map(|joint| self.moved_rad(unit, joint)).fold(0.0, f64::max)
    }

    fn moved_rad(&self, unit: JointUnit, joint: usize) -> f64 {
        let angles = self.readings.iter().map(|reading| self.angle_rad(unit, reading, joint));
        let (low, high) = angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(a), h.max(a)));
        high - low
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::parse_input_map;
    use crate::joints::JointCounts;
    use crate::time::Stamp;
    use std::path::Path;

    fn titan() -> Robot {
        crate::robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).unwrap()
    }

    /// Checks the unit of the arm at six poses; `recorded` maps a joint and its angle in rad to the recorded number.
    fn checked(keys: &str, recorded: impl Fn(usize, f64) -> f64) -> Result<Option<String>, InputError> {
        checked_of(&titan(), keys, recorded)
    }

    fn checked_of(
        robot: &Robot,
        keys: &str,
        recorded: impl Fn(usize, f64) -> f64,
    ) -> Result<Option<String>, InputError> {
        let text = format!(
            "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\n{keys}\n[tags]\ntopic = \"/t\"\nuse = \
             \"corners\"\n"
        );
        let map = parse_input_map(Path::new("map.toml"), &text).unwrap();
        let angle_rad =
            |pose: i32, spec: &JointSensorSpec| spec.center_rad + spec.half_range_rad * (0.15 * f64::from(pose) - 0.4);
        let reading = |pose: i32| Reading {
            stamp: Stamp::default(),
            counts: JointCounts::from_fn(robot.n_joints(), |joint| {
                let spec = &robot.sensors[joint];
                map.counts(spec, recorded(joint, angle_rad(pose, spec)))
            }),
            digest: [0; 32],
        };
        let readings: Vec<Reading> = (0..6).map(reading).collect();
        check_unit("run.mcap", &map, robot, &readings)
    }

    /// Result of reading the arm's angles in rad times `factor` as `unit`.
    fn told(unit: &str, factor: f64) -> Result<Option<String>, String> {
        let keys = format!("unit = \"{unit}\"");
        checked(&keys, |_, angle_rad| factor * angle_rad).map_err(|error| error.to_string())
    }

    /// Numbers from 0 to 360 deg of one joint neither prove nor refute a unit.
    #[test]
    fn degrees_are_refused_where_a_joint_is_wrapped() {
        for wrapped in 0..n_needed(&titan()) {
            let recorded = |joint: usize, angle_rad: f64| {
                let deg = angle_rad.to_degrees();
                if joint == wrapped { deg.rem_euclid(360.0) } else { deg }
            };
            let found = checked("unit = \"rad\"", recorded);
            assert!(
                matches!(&found, Err(InputError::Unit { likely: JointUnit::Deg, factors, .. }) if factors.is_empty()),
                "{wrapped}: {found:?}"
            );
            assert!(checked("unit = \"deg\"", recorded).is_ok(), "{wrapped}");
        }
    }

    /// Without a unit in the map, numbers are what the sensors count.
    #[test]
    fn degrees_are_refused_without_a_unit_where_the_sensors_count_radians() {
        let mut robot = titan();
        for spec in &mut robot.sensors {
            (spec.counts_per_rad, spec.offset_counts) = (1.0, 0.0);
        }
        assert!(matches!(checked_of(&robot, "", |_, angle_rad| angle_rad), Ok(None)));
        let found = checked_of(&robot, "", |_, angle_rad| angle_rad.to_degrees());
        assert!(matches!(found, Err(InputError::Unit { likely: JointUnit::Deg, .. })), "{found:?}");
    }

    /// The factors that the error names make the numbers angles.
    #[test]
    fn two_joints_in_degrees_are_named_and_the_factors_put_them_right() {
        let robot = titan();
        for [a, b] in [[0, 1], [1, 2], [0, 3]] {
            let recorded =
                |joint: usize, angle_rad: f64| if [a, b].contains(&joint) { angle_rad.to_degrees() } else { angle_rad };
            let Err(InputError::Unit { factors, .. }) = checked("unit = \"rad\"", recorded) else {
                panic!("{a}, {b}: not refused")
            };
            let names: Vec<&String> = factors.iter().map(|(joint, _)| joint).collect();
            assert_eq!(names, [a, b].map(|joint| &robot.sensors[joint].joint));
            let lines: Vec<String> = factors.iter().map(|(joint, by)| format!("factor.{joint} = {by:.7}")).collect();
            let keys = format!("unit = \"rad\"\n{}", lines.join("\n"));
            assert_eq!(checked(&keys, recorded).expect("corrected"), None, "{a}, {b}");
        }
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
