//! Joint sensors of robot.toml by their datasheets.

use std::path::Path;

use serde::Deserialize;

use super::error::{FileIssue, RobotError};
use crate::kinematics::{Chain, ChainJoint};

/// Kind of joint sensor; it selects the effects that belief models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// Resistive track: nonlinear, and sensitive to temperature and pressure.
    Potentiometer,
    /// Digital word of a disc: its main error is eccentricity.
    Encoder,
    /// Windings: errors periodic in the turn, and a temperature coefficient.
    Resolver,
}

/// A joint sensor by its datasheet: `angle = center + wrap(counts - counts(center)) / counts_per_rad`.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSensorSpec {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// See [`SensorKind`].
    pub kind: SensorKind,
    /// The reading at angle zero.
    pub offset_counts: f64,
    /// Negative where the reading falls as the angle grows.
    pub counts_per_rad: f64,
    /// The reading repeats after so many counts, at least the joint's range.
    pub wrap_counts: f64,
    /// The middle of the joint's range, about which gain errors are defined.
    pub center_rad: f64,
    /// Half of the joint's range; pi for a joint without limits.
    pub half_range_rad: f64,
    /// One sigma of the relative gain error.
    pub gain_std: f64,
    /// One sigma of the offset error.
    pub offset_std_rad: f64,
    /// Largest relative gain error that planning allows for.
    pub gain_bound: f64,
    /// Largest offset error that planning allows for.
    pub offset_bound_rad: f64,
    /// One sigma of a single reading.
    pub noise_std_counts: f64,
    /// One sigma of the error left by gain and offset: nonlinearity, temperature, wear.
    pub linearity_std_rad: f64,
    /// One sigma of the offset's change with the oil temperature.
    pub temperature_std_rad_per_k: f64,
    /// One sigma of the offset's drift in one hour, a random walk.
    pub drift_std_rad_per_sqrt_h: f64,
    /// Largest rate that the joint is driven at.
    pub max_rate_rad_s: f64,
}

impl JointSensorSpec {
    /// The same sensor with `ratio` times as many counts per radian; the reading in the middle of the range stays.
    #[must_use]
    pub fn with_scale(&self, ratio: f64) -> Self {
        let counts_per_rad = ratio * self.counts_per_rad;
        let offset_counts = self.offset_counts + (self.counts_per_rad - counts_per_rad) * self.center_rad;
        Self { counts_per_rad, offset_counts, ..self.clone() }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorFile {
    pub(super) joint: String,
    kind: SensorKind,
    offset_counts: f64,
    /// Counts per degree: datasheets give this round figure.
    scale_counts_per_deg: f64,
    wrap_counts: f64,
    gain_std: f64,
    offset_std_rad: f64,
    gain_bound: f64,
    offset_bound_rad: f64,
    noise_std_counts: f64,
    linearity_std_rad: f64,
    #[serde(default = "default_change")]
    temperature_std_rad_per_k: f64,
    #[serde(default = "default_change")]
    drift_std_rad_per_sqrt_h: f64,
    max_rate_rad_s: f64,
    /// Computed from the URDF's effort where absent.
    pub(super) displacement_l_per_rad: Option<f64>,
}

/// 0.02 deg per kelvin, or in one hour, for datasheets without a value.
fn default_change() -> f64 {
    0.00035
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
        return Err(FileIssue::new(file, "joint_sensor", problem).into());
    }
    raw.iter().zip(chain.joints()).map(|(s, joint)| check_sensor(file, s, joint)).collect()
}

fn check_sensor(file: &Path, s: &SensorFile, joint: &ChainJoint) -> Result<JointSensorSpec, RobotError> {
    let check = |key: &str, value: f64, range| {
        FileIssue::check_range(file, &format!("joint_sensor `{}`: {key}", s.joint), value, range)
    };
    if let Some(limits) = joint.limits {
        let range_counts = (limits.upper_rad - limits.lower_rad).to_degrees() * s.scale_counts_per_deg.abs();
        if s.wrap_counts < range_counts {
            let key = format!("joint_sensor `{}`: wrap_counts", s.joint);
            let problem = format!("{} is less than the {range_counts:.0} counts of the joint's range", s.wrap_counts);
            return Err(FileIssue::new(file, key, problem).into());
        }
    }
    let sign = if s.scale_counts_per_deg < 0.0 { -1.0 } else { 1.0 };
    Ok(JointSensorSpec {
        joint: s.joint.clone(),
        kind: s.kind,
        offset_counts: check("offset_counts", s.offset_counts, -1e9..=1e9)?,
        counts_per_rad: sign * check("scale_counts_per_deg (size)", s.scale_counts_per_deg.abs(), 1e-3..=1e9)? * 180.0
            / std::f64::consts::PI,
        wrap_counts: check("wrap_counts", s.wrap_counts, 1.0..=1e12)?,
        center_rad: joint.limits.map_or(0.0, |l| 0.5 * (l.lower_rad + l.upper_rad)),
        half_range_rad: joint
            .limits
            .map_or(std::f64::consts::PI, |l| 0.5 * (l.upper_rad - l.lower_rad).max(f64::MIN_POSITIVE)),
        gain_std: check("gain_std", s.gain_std, 0.0..=10.0)?,
        offset_std_rad: check("offset_std_rad", s.offset_std_rad, 0.0..=6.3)?,
        gain_bound: check("gain_bound", s.gain_bound, 0.0..=0.5)?,
        offset_bound_rad: check("offset_bound_rad", s.offset_bound_rad, 0.0..=3.2)?,
        linearity_std_rad: check("linearity_std_rad", s.linearity_std_rad, 0.0..=1.0)?,
        temperature_std_rad_per_k: check("temperature_std_rad_per_k", s.temperature_std_rad_per_k, 0.0..=0.1)?,
        drift_std_rad_per_sqrt_h: check("drift_std_rad_per_sqrt_h", s.drift_std_rad_per_sqrt_h, 0.0..=0.1)?,
        noise_std_counts: check("noise_std_counts", s.noise_std_counts, 0.0..=1e6)?,
        max_rate_rad_s: check("max_rate_rad_s", s.max_rate_rad_s, 1e-3..=20.0)?,
    })
}

/// The name that others have for a joint: its own, or the only one that begins or ends with it.
#[must_use]
pub fn likely_name<'a>(joint: &str, names: &'a std::collections::BTreeSet<String>) -> Option<&'a String> {
    if let Some(same) = names.get(joint) {
        return Some(same);
    }
    let mut like = names.iter().filter(|name| name.ends_with(joint) || name.starts_with(joint));
    like.next().filter(|_| like.next().is_none())
}
