//! Joint sensors of robot.toml by their datasheets.

use crate::codes::Code;
use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::{FileIssue, RobotError};
pub use super::stated_angle::StatedAngle;
use crate::kinematics::{Chain, ChainJoint, JointKind};
use crate::units::Unit;

/// Kind of a joint sensor; it selects the effects that the estimator models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// Resistive track: nonlinear, and sensitive to temperature and pressure.
    Potentiometer,
    /// Digital word of a disc: its main error is eccentricity.
    Encoder,
    /// Windings: errors periodic in the turn, and a temperature coefficient.
    Resolver,
}

/// Ranges of a joint in one word above which the word stands for readings that never repeat, such as radians.
const NEVER_REPEATS: f64 = 1e3;

/// Datasheet of a joint sensor: `angle = center + wrap(counts - counts(center)) / counts_per_rad`.
///
/// For a slide, figures are in metres although their names say rad: `counts_per_rad` are counts per metre.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSensorSpec {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Type of motion of the joint: rotation or translation.
    pub moves: JointKind,
    /// Kind of the sensor.
    pub kind: SensorKind,
    /// Reading at angle zero.
    pub offset_counts: f64,
    /// Counts per radian; negative if the reading falls as the angle grows.
    pub counts_per_rad: f64,
    /// Counts after which the reading repeats, at least the joint's range.
    pub wrap_counts: f64,
    /// Middle of the joint's range, about which gain errors are defined.
    pub center_rad: f64,
    /// Half of the joint's range; pi for a joint without limits, 1 m for a slide without limits.
    pub half_range_rad: f64,
    /// Standard deviation of the relative gain error.
    pub gain_std: f64,
    /// Standard deviation of the offset error.
    pub offset_std_rad: f64,
    /// Largest relative gain error that planning allows for.
    pub gain_bound: f64,
    /// Largest offset error that planning allows for.
    pub offset_bound_rad: f64,
    /// Standard deviation of a single reading.
    pub noise_std_counts: f64,
    /// Standard deviation of the error left by gain and offset: nonlinearity, temperature, wear.
    pub linearity_std_rad: f64,
    /// Standard deviation of the offset's change with the oil temperature.
    pub temperature_std_rad_per_k: f64,
    /// Standard deviation of the offset's drift in one hour, a random walk.
    pub drift_std_rad_per_sqrt_h: f64,
    /// Largest rate at which the joint is driven.
    pub max_rate_rad_s: f64,
    /// Line from readings to the joint's angle; `None`: readings are counts.
    pub stated: Option<StatedAngle>,
}

impl JointSensorSpec {
    /// Returns the unit in which the joint's coordinate is shown: degrees, or millimetres for a slide.
    #[must_use]
    pub fn unit(&self) -> Unit {
        self.moves.unit()
    }

    /// Returns true if the joint turns within a range of less than a turn, or slides.
    #[must_use]
    pub fn is_limited(&self) -> bool {
        self.moves.is_slide() || self.half_range_rad < 0.999 * std::f64::consts::PI
    }

    /// Returns true if the word is so much longer than the joint's range that its reading never repeats: such a reading
    /// keeps its sign.
    #[must_use]
    pub fn never_repeats(&self) -> bool {
        self.wrap_counts > NEVER_REPEATS * 2.0 * self.half_range_rad * self.counts_per_rad.abs()
    }

    /// Returns the recorded number at an angle, before it wraps: counts, or in the unit of stated angles.
    #[must_use]
    pub fn recorded(&self, angle_rad: f64) -> f64 {
        match &self.stated {
            Some(stated) => stated.recorded(angle_rad),
            None => self.offset_counts + self.counts_per_rad * angle_rad,
        }
    }

    /// Returns the angle of a recorded number.
    #[must_use]
    pub fn angle_rad(&self, recorded: f64) -> f64 {
        match &self.stated {
            Some(stated) => stated.angle_rad(recorded),
            None => (recorded - self.offset_counts) / self.counts_per_rad,
        }
    }

    /// Returns the sensor with `ratio` times as many counts per radian and the same reading in the middle of the range.
    #[must_use]
    pub fn with_scale(&self, ratio: f64) -> Self {
        let counts_per_rad = ratio * self.counts_per_rad;
        let offset_counts = self.offset_counts + (self.counts_per_rad - counts_per_rad) * self.center_rad;
        Self { counts_per_rad, offset_counts, ..self.clone() }
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorFile {
    /// Name of the joint in the URDF.
    pub(super) joint: String,
    /// Kind of the sensor; it selects the effects that the estimator models.
    kind: SensorKind,
    /// Reading at angle zero.
    #[schemars(range(min = -1e9, max = 1e9))]
    offset_counts: f64,
    /// Counts after which the reading repeats, at least the joint's range.
    #[schemars(range(min = 1.0, max = 1e12))]
    wrap_counts: f64,
    /// Relative standard deviation of the gain; 0 holds it fixed.
    #[schemars(range(min = 0.0, max = 10.0))]
    gain_std: f64,
    /// Largest relative gain error that planning allows for.
    #[schemars(range(min = 0.0, max = 0.5))]
    gain_bound: f64,
    /// Noise of one reading, standard deviation; it also distinguishes a still joint from a moving one.
    #[schemars(range(min = 0.0, max = 1e6))]
    noise_std_counts: f64,
    /// Counts per degree of the joint, at least 0.001 in absolute value; negative if the reading falls as the angle
    /// grows.
    #[schemars(range(min = -1e9, max = 1e9))]
    scale_counts_per_deg: Option<f64>,
    /// Standard deviation of the offset; 0 holds it fixed.
    #[schemars(range(min = 0.0, max = 6.3))]
    offset_std_rad: Option<f64>,
    /// Largest offset that planning allows for.
    #[schemars(range(min = 0.0, max = 3.2))]
    offset_bound_rad: Option<f64>,
    /// Standard deviation of the error left by gain and offset; it enters the predicted tool error.
    #[schemars(range(min = 0.0, max = 1.0))]
    linearity_std_rad: Option<f64>,
    /// Standard deviation of the offset's change with the oil temperature.
    #[schemars(range(min = 0.0, max = 0.1))]
    temperature_std_rad_per_k: Option<f64>,
    /// Standard deviation of the offset's random walk in one hour.
    #[schemars(range(min = 0.0, max = 0.1))]
    drift_std_rad_per_sqrt_h: Option<f64>,
    /// Largest rate at which the joint is driven.
    #[schemars(range(min = 1e-3, max = 20.0))]
    max_rate_rad_s: Option<f64>,
    /// Oil per radian; absent: from the URDF's effort.
    #[schemars(range(min = 0.0, max = 100.0))]
    displacement_l_per_rad: Option<f64>,
    /// Counts per millimetre of a slide.
    #[schemars(range(min = -1e9, max = 1e9))]
    scale_counts_per_mm: Option<f64>,
    /// Standard deviation of a slide's offset.
    #[schemars(range(min = 0.0, max = 10.0))]
    offset_std_m: Option<f64>,
    /// Largest offset of a slide that planning allows for.
    #[schemars(range(min = 0.0, max = 10.0))]
    offset_bound_m: Option<f64>,
    /// Standard deviation of the error left by gain and offset of a slide.
    #[schemars(range(min = 0.0, max = 1.0))]
    linearity_std_m: Option<f64>,
    /// Standard deviation of a slide's offset change with the oil temperature.
    #[schemars(range(min = 0.0, max = 0.1))]
    temperature_std_m_per_k: Option<f64>,
    /// Standard deviation of a slide's offset walk in one hour.
    #[schemars(range(min = 0.0, max = 0.1))]
    drift_std_m_per_sqrt_h: Option<f64>,
    /// Largest rate at which a slide is driven.
    #[schemars(range(min = 1e-3, max = 20.0))]
    max_rate_m_s: Option<f64>,
    /// Oil per metre of a slide; absent: from the URDF's effort.
    #[schemars(range(min = 0.0, max = 1000.0))]
    displacement_l_per_m: Option<f64>,
}

/// A key with the unit of its joint: its name for a joint that turns, and for a slide.
struct UnitKey {
    names: [&'static str; 2],
    of_file: fn(&SensorFile) -> [Option<f64>; 2],
    allowed: [RangeInclusive<f64>; 2],
    /// Defaults if the file has no value; `None`: the file must have one.
    usual: Option<[f64; 2]>,
    /// True if only the absolute value must be within `allowed`.
    is_signed: bool,
}

const SCALE: UnitKey = UnitKey {
    names: ["scale_counts_per_deg", "scale_counts_per_mm"],
    of_file: |s| [s.scale_counts_per_deg, s.scale_counts_per_mm],
    allowed: [1e-3..=1e9, 1e-6..=1e9],
    usual: None,
    is_signed: true,
};
const OFFSET_STD: UnitKey = UnitKey {
    names: ["offset_std_rad", "offset_std_m"],
    of_file: |s| [s.offset_std_rad, s.offset_std_m],
    allowed: [0.0..=6.3, 0.0..=10.0],
    usual: None,
    is_signed: false,
};
const OFFSET_BOUND: UnitKey = UnitKey {
    names: ["offset_bound_rad", "offset_bound_m"],
    of_file: |s| [s.offset_bound_rad, s.offset_bound_m],
    allowed: [0.0..=3.2, 0.0..=10.0],
    usual: None,
    is_signed: false,
};
const LINEARITY: UnitKey = UnitKey {
    names: ["linearity_std_rad", "linearity_std_m"],
    of_file: |s| [s.linearity_std_rad, s.linearity_std_m],
    allowed: [0.0..=1.0, 0.0..=1.0],
    usual: None,
    is_signed: false,
};
/// Temperature coefficient: 0.02 deg per kelvin; for a slide 0.02 mm per kelvin, twice that of a metre of steel.
const TEMPERATURE: UnitKey = UnitKey {
    names: ["temperature_std_rad_per_k", "temperature_std_m_per_k"],
    of_file: |s| [s.temperature_std_rad_per_k, s.temperature_std_m_per_k],
    allowed: [0.0..=0.1, 0.0..=0.1],
    usual: Some([0.00035, 0.00002]),
    is_signed: false,
};
/// Drift: 0.02 deg, or 0.02 mm, in one hour.
const DRIFT: UnitKey = UnitKey {
    names: ["drift_std_rad_per_sqrt_h", "drift_std_m_per_sqrt_h"],
    of_file: |s| [s.drift_std_rad_per_sqrt_h, s.drift_std_m_per_sqrt_h],
    allowed: [0.0..=0.1, 0.0..=0.1],
    usual: Some([0.00035, 0.00002]),
    is_signed: false,
};
const MAX_RATE: UnitKey = UnitKey {
    names: ["max_rate_rad_s", "max_rate_m_s"],
    of_file: |s| [s.max_rate_rad_s, s.max_rate_m_s],
    allowed: [1e-3..=20.0, 1e-3..=20.0],
    usual: None,
    is_signed: false,
};
const DISPLACEMENT: UnitKey = UnitKey {
    names: ["displacement_l_per_rad", "displacement_l_per_m"],
    of_file: |s| [s.displacement_l_per_rad, s.displacement_l_per_m],
    allowed: [0.0..=100.0, 0.0..=1000.0],
    usual: None,
    is_signed: false,
};
const UNIT_KEYS: [&UnitKey; 8] =
    [&SCALE, &OFFSET_STD, &OFFSET_BOUND, &LINEARITY, &TEMPERATURE, &DRIFT, &MAX_RATE, &DISPLACEMENT];

/// Table of one sensor in its file, and the joint that it belongs to.
struct OfJoint<'a> {
    file: &'a Path,
    table: &'a SensorFile,
    kind: JointKind,
}

impl OfJoint<'_> {
    /// Returns the index of the applicable entry of a [`UnitKey`].
    fn unit(&self) -> usize {
        usize::from(self.kind.is_slide())
    }

    fn key(&self, name: &str) -> String {
        format!("joint_sensor `{}`: {name}", self.table.joint)
    }

    fn check(&self, name: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, FileIssue> {
        FileIssue::check_range(self.file, &self.key(name), value, range)
    }

    /// Refuses keys in the unit of the other kind of joint.
    fn check_units(&self) -> Result<(), FileIssue> {
        let (own, other) = (self.unit(), 1 - self.unit());
        let is_wrong = |key: &&&UnitKey| (key.of_file)(self.table)[other].is_some();
        let wrong: Vec<&&UnitKey> = UNIT_KEYS.iter().filter(is_wrong).collect();
        let Some(first) = wrong.first() else { return Ok(()) };
        let instead: Vec<&str> = wrong.iter().map(|key| key.names[own]).collect();
        let moves = ["turns", "is prismatic"][own];
        let problem = format!("the joint {moves} in the URDF; write {} in its place", instead.join(", "));
        Err(FileIssue::new(Code::KeyUnknown, self.file, self.key(first.names[other]), problem))
    }

    /// Returns the figure in the file, if it has one.
    fn given(&self, key: &UnitKey) -> Result<Option<f64>, FileIssue> {
        let Some(value) = (key.of_file)(self.table)[self.unit()] else { return Ok(None) };
        let name = key.names[self.unit()];
        let allowed = key.allowed[self.unit()].clone();
        if key.is_signed {
            self.check(&format!("{name} (size)"), value.abs(), allowed)?;
        } else {
            self.check(name, value, allowed)?;
        }
        Ok(Some(value))
    }

    fn figure(&self, key: &UnitKey) -> Result<f64, FileIssue> {
        let usual = key.usual.map(|usual| usual[self.unit()]);
        let missing = || FileIssue::new(Code::KeyMissing, self.file, self.key(key.names[self.unit()]), "is missing");
        self.given(key)?.or(usual).ok_or_else(missing)
    }
}

pub(super) fn check_sensors(
    file: &Path,
    raw: &[SensorFile],
    chain: &Chain,
) -> Result<Vec<JointSensorSpec>, RobotError> {
    let names: Vec<&str> = raw.iter().map(|s| s.joint.as_str()).collect();
    let expected: Vec<&str> = chain.joints().iter().map(|j| j.name.as_str()).collect();
    if names != expected {
        let without: Vec<&&str> = expected.iter().filter(|joint| !names.contains(joint)).collect();
        let beside: Vec<&&str> = names.iter().filter(|name| !expected.contains(name)).collect();
        let mut problem = format!("the chain's moving joints are {expected:?}, one sensor each, in this order");
        if !without.is_empty() {
            problem += &format!("; add one for {without:?}");
        }
        if !beside.is_empty() {
            problem += &format!("; take out {beside:?}, which do not lie between base_link and tool or camera");
        }
        if without.is_empty() && beside.is_empty() {
            problem += &format!("; the sensors name {names:?}");
        }
        return Err(FileIssue::new(Code::JointsMismatch, file, "joint_sensor", problem).into());
    }
    raw.iter().zip(chain.joints()).map(|(s, joint)| check_sensor(file, s, joint)).collect()
}

/// Half of the range of a joint without limits: half a turn; for a slide 1 m, assumed, the order of an arm's reach.
fn free_half_range(kind: JointKind) -> f64 {
    match kind {
        JointKind::Revolute => std::f64::consts::PI,
        JointKind::Prismatic => 1.0,
    }
}

fn check_sensor(file: &Path, s: &SensorFile, joint: &ChainJoint) -> Result<JointSensorSpec, RobotError> {
    let of_joint = OfJoint { file, table: s, kind: joint.kind };
    of_joint.check_units()?;
    let counts_per_unit = of_joint.figure(&SCALE)?;
    if let Some(limits) = joint.limits {
        let range = limits.upper_rad - limits.lower_rad;
        let range = if joint.kind.is_slide() { range * 1e3 } else { range.to_degrees() };
        let range_counts = range * counts_per_unit.abs();
        if s.wrap_counts < range_counts {
            let problem = format!("{} is less than the {range_counts:.0} counts of the joint's range", s.wrap_counts);
            return Err(FileIssue::new(Code::ValueOutOfRange, file, of_joint.key("wrap_counts"), problem).into());
        }
    }
    Ok(JointSensorSpec {
        joint: s.joint.clone(),
        moves: joint.kind,
        kind: s.kind,
        offset_counts: of_joint.check("offset_counts", s.offset_counts, -1e9..=1e9)?,
        counts_per_rad: match joint.kind {
            JointKind::Prismatic => counts_per_unit * 1e3,
            JointKind::Revolute => counts_per_unit * 180.0 / std::f64::consts::PI,
        },
        wrap_counts: of_joint.check("wrap_counts", s.wrap_counts, 1.0..=1e12)?,
        center_rad: joint.limits.map_or(0.0, |l| 0.5 * (l.lower_rad + l.upper_rad)),
        half_range_rad: joint
            .limits
            .map_or(free_half_range(joint.kind), |l| 0.5 * (l.upper_rad - l.lower_rad).max(f64::MIN_POSITIVE)),
        gain_std: of_joint.check("gain_std", s.gain_std, 0.0..=10.0)?,
        offset_std_rad: of_joint.figure(&OFFSET_STD)?,
        gain_bound: of_joint.check("gain_bound", s.gain_bound, 0.0..=0.5)?,
        offset_bound_rad: of_joint.figure(&OFFSET_BOUND)?,
        linearity_std_rad: of_joint.figure(&LINEARITY)?,
        temperature_std_rad_per_k: of_joint.figure(&TEMPERATURE)?,
        drift_std_rad_per_sqrt_h: of_joint.figure(&DRIFT)?,
        noise_std_counts: of_joint.check("noise_std_counts", s.noise_std_counts, 0.0..=1e6)?,
        max_rate_rad_s: of_joint.figure(&MAX_RATE)?,
        stated: None,
    })
}

/// Returns the oil per radian of each joint (per metre of a slide), if the file states it.
pub(super) fn displacements(file: &Path, sensors: &[SensorFile], chain: &Chain) -> Result<Vec<Option<f64>>, FileIssue> {
    let of_joint =
        |(table, joint): (&SensorFile, &ChainJoint)| OfJoint { file, table, kind: joint.kind }.given(&DISPLACEMENT);
    sensors.iter().zip(chain.joints()).map(of_joint).collect()
}

/// Returns the name that others have for a joint: its own, or the only one that begins or ends with it.
#[must_use]
pub fn likely_name<'a>(joint: &str, names: &'a std::collections::BTreeSet<String>) -> Option<&'a String> {
    if let Some(same) = names.get(joint) {
        return Some(same);
    }
    let mut like = names.iter().filter(|name| name.ends_with(joint) || name.starts_with(joint));
    like.next().filter(|_| like.next().is_none())
}
