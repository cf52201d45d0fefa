//! Reader of LeRobot's calibration JSON, which converts recorded numbers to ticks of the motors and holds the homing
//! offsets.
//!
//! huggingface/lerobot 7427f31, src/lerobot/motors/motors_bus.py, lines 176 to 181 (fields) and 854 to 881
//! (`_normalize`): degrees are `(tick - (range_min + range_max) / 2) 360 / 4095`. `drive_mode` reverses only percents,
//! and only those of Feetech (motors/feetech/feetech.py, line 95), not of Dynamixel (motors/dynamixel/dynamixel.py,
//! line 100). Ticks are the motor's `Present_Position`: `Actual - Homing_Offset` of Feetech (feetech.py, line 281),
//! `Actual + Homing_Offset` of Dynamixel (dynamixel.py, line 226). The older form, before e23b41e, is in
//! robot_devices/motors/feetech.py, lines 448 to 478: degrees are `(+-tick + homing_offset) / 2048 * 180`, percents
//! `(tick - start_pos) / (end_pos - start_pos) * 100`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::codes::Code;
use crate::robot::{FileIssue, JointSensorSpec, RobotError, read_text, syntax_code};
use crate::text::yaml_problem;

/// Ticks of a turn: feetech/tables.py, lines 186 to 192; dynamixel/tables.py, lines 132 to 141.
const TICKS: f64 = 4096.0;
/// Tolerance, as a share, within which the counts of robot.toml are ticks.
const TICK_WITHIN: f64 = 0.1;
/// Ticks of a range that a motor can have, and of its homing offset (feetech/tables.py, line 209: 11 bits and a sign).
const FEETECH_RANGE: [f64; 2] = [0.0, 4095.0];
const DYNAMIXEL_RANGE: [f64; 2] = [-1_048_575.0, 1_048_575.0];
const FEETECH_HOMING: f64 = 2047.0;
const DYNAMIXEL_HOMING: f64 = 1_044_479.0;
/// Degrees that a joint can have.
const MAX_DEG: f64 = 400.0;

/// Make of the motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LerobotMotors {
    /// STS and SMS series.
    Feetech,
    /// X series.
    Dynamixel,
}

impl LerobotMotors {
    fn range(self) -> [f64; 2] {
        if self == Self::Feetech { FEETECH_RANGE } else { DYNAMIXEL_RANGE }
    }

    fn homing(self) -> f64 {
        if self == Self::Feetech { FEETECH_HOMING } else { DYNAMIXEL_HOMING }
    }
}

/// Kind of the recorded numbers, by LeRobot's own names (`MotorNormMode`, motors_bus.py, lines 169 to 172).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LerobotValues {
    /// Degrees from the middle of the range; the older form's `DEGREE`.
    Degrees,
    /// Percents of half the range, about its middle.
    #[serde(rename = "range_m100_100")]
    RangeM100To100,
    /// Percents of the range; the older form's `LINEAR`.
    #[serde(rename = "range_0_100")]
    Range0To100,
    /// Ticks, not normalized.
    Ticks,
}

impl LerobotValues {
    /// Returns the name in the input map.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::Degrees => "degrees",
            Self::RangeM100To100 => "range_m100_100",
            Self::Range0To100 => "range_0_100",
            Self::Ticks => "ticks",
        }
    }

    /// The allowed numbers.
    pub(super) fn allowed(self) -> [f64; 2] {
        match self {
            Self::Degrees => [-MAX_DEG, MAX_DEG],
            Self::RangeM100To100 => [-100.0, 100.0],
            Self::Range0To100 => [0.0, 100.0],
            Self::Ticks => DYNAMIXEL_RANGE,
        }
    }
}

/// LeRobot part of an input map.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LerobotToml {
    /// LeRobot's calibration JSON, from the folder of this file.
    file: PathBuf,
    /// Make of the motors.
    motors: LerobotMotors,
    /// Kind of the recorded numbers.
    values: LerobotValues,
}

/// Entry of one motor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Motor {
    id: u32,
    drive_mode: u32,
    homing_offset: i64,
    range_min: i64,
    range_max: i64,
}

/// The older form: lists in the order of `motor_names`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct OlderFile {
    homing_offset: Vec<i64>,
    drive_mode: Vec<u32>,
    start_pos: Vec<i64>,
    end_pos: Vec<i64>,
    calib_mode: Vec<String>,
    motor_names: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum Form {
    Newer(BTreeMap<String, Motor>),
    Older(OlderFile),
}

/// The calibration of an arm's motors.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct LerobotCalibration {
    form: Form,
    #[serde(skip)]
    file: PathBuf,
    #[serde(skip)]
    motors: LerobotMotors,
    #[serde(skip)]
    values: LerobotValues,
}

/// A motor's numbers as a straight line: `tick = at_zero + per_unit value`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    at_zero: f64,
    per_unit: f64,
}

impl LerobotCalibration {
    /// Reads the file that an input map names, relative to the map's folder.
    pub(super) fn read(map: &Path, raw: &LerobotToml) -> Result<Self, RobotError> {
        let file = map.parent().unwrap_or(Path::new("")).join(&raw.file);
        Self::parse(&file, &read_text(&file)?, raw)
    }

    fn parse(file: &Path, text: &str, raw: &LerobotToml) -> Result<Self, RobotError> {
        let form = if text.contains("\"motor_names\"") {
            Form::Older(json(file, text)?)
        } else {
            Form::Newer(json(file, text)?)
        };
        let found = Self { form, file: file.to_owned(), motors: raw.motors, values: raw.values };
        found.check()?;
        Ok(found)
    }

    fn check(&self) -> Result<(), FileIssue> {
        let range = |key: String, value: f64, [low, high]: [f64; 2]| {
            FileIssue::check_range(&self.file, &key, value, low..=high)
        };
        let names = self.names();
        if names.is_empty() {
            return Err(FileIssue::new(Code::KeyMissing, &self.file, "motor", "the file names no motor"));
        }
        match &self.form {
            Form::Newer(motors) => {
                for (name, motor) in motors {
                    let Motor { drive_mode, homing_offset, range_min, range_max, .. } = *motor;
                    range(format!("{name}.drive_mode"), f64::from(drive_mode), [0.0, 1.0])?;
                    let most = self.motors.homing();
                    range(format!("{name}.homing_offset"), homing_offset as f64, [-most, most])?;
                    range(format!("{name}.range_min"), range_min as f64, self.motors.range())?;
                    range(format!("{name}.range_max"), range_max as f64, self.motors.range())?;
                    if range_min >= range_max {
                        let problem = format!("is {range_max}, not above range_min = {range_min}; calibrate the range");
                        let key = format!("{name}.range_max");
                        return Err(FileIssue::new(Code::ValueInvalid, &self.file, key, problem));
                    }
                }
            }
            Form::Older(older) => self.check_older(older)?,
        }
        Ok(())
    }

    fn check_older(&self, older: &OlderFile) -> Result<(), FileIssue> {
        let issue = |code, key: &str, problem: String| Err(FileIssue::new(code, &self.file, key, problem));
        let n = older.motor_names.len();
        let lists = [
            ("homing_offset", older.homing_offset.len()),
            ("drive_mode", older.drive_mode.len()),
            ("start_pos", older.start_pos.len()),
            ("end_pos", older.end_pos.len()),
            ("calib_mode", older.calib_mode.len()),
        ];
        if let Some((key, has)) = lists.into_iter().find(|(_, has)| *has != n) {
            return issue(Code::ValueInvalid, key, format!("has {has} entries; motor_names has {n}"));
        }
        let mut once = BTreeSet::new();
        if let Some(twice) = older.motor_names.iter().find(|name| !once.insert(*name)) {
            return issue(Code::ValueDuplicate, "motor_names", format!("has `{twice}` twice; name each motor once"));
        }
        for at in 0..n {
            let name = &older.motor_names[at];
            let key = |of: &str| format!("{of} of {name}");
            FileIssue::check_range(&self.file, &key("drive_mode"), f64::from(older.drive_mode[at]), 0.0..=1.0)?;
            for (of, value) in [
                ("homing_offset", older.homing_offset[at]),
                ("start_pos", older.start_pos[at]),
                ("end_pos", older.end_pos[at]),
            ] {
                let [low, high] = DYNAMIXEL_RANGE;
                FileIssue::check_range(&self.file, &key(of), value as f64, low..=high)?;
            }
            match older.calib_mode[at].as_str() {
                "DEGREE" => {}
                "LINEAR" if older.start_pos[at] != older.end_pos[at] => {}
                "LINEAR" => {
                    return issue(Code::ValueInvalid, &key("end_pos"), "is start_pos; calibrate again".to_owned());
                }
                other => {
                    let problem = format!("is `{other}`; \"DEGREE\" and \"LINEAR\" are known");
                    return issue(Code::NameUnknown, &key("calib_mode"), problem);
                }
            }
        }
        Ok(())
    }

    fn names(&self) -> Vec<&String> {
        match &self.form {
            Form::Newer(motors) => motors.keys().collect(),
            Form::Older(older) => older.motor_names.iter().collect(),
        }
    }

    /// Kind of the recorded numbers.
    pub(super) fn values(&self) -> LerobotValues {
        self.values
    }

    /// Checks that the joint has a motor, that its numbers are known, and that robot.toml counts ticks.
    pub(super) fn check_joint(&self, recorded: &str, spec: &JointSensorSpec) -> Result<(), FileIssue> {
        let per_turn = spec.counts_per_rad.abs() * std::f64::consts::TAU;
        if (per_turn / TICKS - 1.0).abs() > TICK_WITHIN {
            let problem = format!(
                "joint {} has {per_turn:.1} counts per turn; LeRobot's ticks are {TICKS} per turn: \
                 scale_counts_per_deg = {:.5} and wrap_counts = {TICKS}, offset_counts = the tick at angle zero",
                spec.joint,
                TICKS / 360.0
            );
            return Err(FileIssue::new(Code::ValueInvalid, &self.file, "robot.toml", problem));
        }
        self.line(motor_name(recorded)).map(|_| ())
    }

    /// Returns the tick of a recorded number; NaN for a joint without a motor, which `check_joint` refuses.
    pub(super) fn tick(&self, recorded: &str, value: f64) -> f64 {
        self.line(motor_name(recorded)).map_or(f64::NAN, |line| line.at_zero + line.per_unit * value)
    }

    fn line(&self, name: &str) -> Result<Line, FileIssue> {
        let unknown = || {
            let problem = format!("has no motor `{name}`; it has {:?}. joint_sensors.names maps joints", self.names());
            FileIssue::new(Code::NameUnknown, &self.file, "motor", problem)
        };
        if self.values == LerobotValues::Ticks && self.names().iter().any(|motor| *motor == name) {
            return Ok(Line { at_zero: 0.0, per_unit: 1.0 });
        }
        match &self.form {
            Form::Newer(motors) => motors.get(name).map(|motor| self.newer_line(motor)).ok_or_else(unknown),
            Form::Older(older) => {
                let at = older.motor_names.iter().position(|motor| motor == name).ok_or_else(unknown)?;
                self.older_line(older, at)
            }
        }
    }

    fn newer_line(&self, motor: &Motor) -> Line {
        let (low, high) = (motor.range_min as f64, motor.range_max as f64);
        let is_turned = self.motors == LerobotMotors::Feetech && motor.drive_mode == 1;
        let span = high - low;
        let line = match self.values {
            LerobotValues::Degrees => return Line { at_zero: 0.5 * (low + high), per_unit: (TICKS - 1.0) / 360.0 },
            LerobotValues::RangeM100To100 => Line { at_zero: 0.5 * (low + high), per_unit: span / 200.0 },
            LerobotValues::Range0To100 => Line { at_zero: if is_turned { high } else { low }, per_unit: span / 100.0 },
            LerobotValues::Ticks => return Line { at_zero: 0.0, per_unit: 1.0 },
        };
        Line { per_unit: if is_turned { -line.per_unit } else { line.per_unit }, ..line }
    }

    fn older_line(&self, older: &OlderFile, at: usize) -> Result<Line, FileIssue> {
        let sign = if older.drive_mode[at] == 1 { -1.0 } else { 1.0 };
        let (start, end) = (older.start_pos[at] as f64, older.end_pos[at] as f64);
        match (self.values, older.calib_mode[at].as_str()) {
            (LerobotValues::Degrees, "DEGREE") => {
                Ok(Line { at_zero: -sign * older.homing_offset[at] as f64, per_unit: sign * TICKS / 360.0 })
            }
            (LerobotValues::Range0To100, "LINEAR") => Ok(Line { at_zero: start, per_unit: (end - start) / 100.0 }),
            (_, mode) => {
                let problem =
                    format!("is {mode}; with values = \"degrees\" a joint needs DEGREE, with \"range_0_100\" LINEAR");
                let key = format!("calib_mode of {}", older.motor_names[at]);
                Err(FileIssue::new(Code::ValueInvalid, &self.file, key, problem))
            }
        }
    }

    /// Returns the tick that LeRobot shows as the middle of a joint: zero of its degrees.
    ///
    /// # Errors
    /// [`FileIssue`] if the joint, as recorded, has no motor, or a motor without degrees.
    pub fn middle_tick(&self, recorded: &str) -> Result<f64, FileIssue> {
        let degrees = Self { values: LerobotValues::Degrees, ..self.clone() };
        degrees.line(motor_name(recorded)).map(|line| line.at_zero)
    }

    /// Shifts a motor's homing offset so that the tick shown as `from_tick` is then shown as `to_tick`, rounded to a
    /// tick.
    ///
    /// # Errors
    /// [`FileIssue`] if the motor cannot hold the offset.
    pub fn rehome(&mut self, recorded: &str, from_tick: f64, to_tick: f64) -> Result<(), FileIssue> {
        let name = motor_name(recorded);
        let ahead = (from_tick - to_tick).round();
        let (motors, file) = (self.motors, self.file.clone());
        let check = |value: f64, most: f64| {
            let key = format!("{name}.homing_offset");
            FileIssue::check_range(&file, &key, value, -most..=most).map(|value| value as i64)
        };
        match &mut self.form {
            Form::Newer(all) => {
                if let Some(motor) = all.get_mut(name) {
                    let sign = if motors == LerobotMotors::Feetech { 1.0 } else { -1.0 };
                    motor.homing_offset = check(motor.homing_offset as f64 + sign * ahead, motors.homing())?;
                }
            }
            Form::Older(older) => {
                if let Some(at) = older.motor_names.iter().position(|motor| motor == name) {
                    let sign = if older.drive_mode[at] == 1 { -1.0 } else { 1.0 };
                    let homing = older.homing_offset[at] as f64 - sign * ahead;
                    older.homing_offset[at] = check(homing, DYNAMIXEL_HOMING)?;
                }
            }
        }
        Ok(())
    }
}

/// Returns the motor's name, such as `shoulder_pan`, of a LeRobot feature such as `shoulder_pan.pos` (so_follower.py,
/// line 67).
fn motor_name(recorded: &str) -> &str {
    recorded.strip_suffix(".pos").unwrap_or(recorded)
}

/// Reads JSON as YAML, whose reader refuses a duplicate key.
fn json<T: serde::de::DeserializeOwned>(file: &Path, text: &str) -> Result<T, RobotError> {
    serde_saphyr::from_str(text).map_err(|error| {
        let message = yaml_problem(&error.to_string());
        RobotError::Syntax { code: syntax_code(&message), file: file.to_owned(), message }
    })
}

#[cfg(test)]
mod tests;
