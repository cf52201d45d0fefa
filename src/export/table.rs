//! Counts to radians at points, for drivers that interpolate.

use std::fmt::Write as _;

use armcal_belief::calib::metric;
use armcal_core::kinematics::{ChainJoint, JointKind, JointLimits};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, ConditionChange, SensorModel};

/// The fewest points of a table.
pub const MIN_POINTS: usize = 2;
/// The most points of a table.
pub const MAX_POINTS: usize = 10_000;
/// Largest tool error of linear interpolation where the number of points is chosen automatically, m.
const CHOSEN_ERROR_M: f64 = 2e-5;
/// Number of places between two points at which the straight line is compared with the sensor.
const PLACES_BETWEEN: usize = 8;

/// Tables of all joints, each with the same number of points.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorTable {
    /// Tables of the joints, base first.
    joints: Vec<JointTable>,
    /// Bound on the tool error that linear interpolation between points causes, m.
    pub interpolation_error_m: f64,
    /// The estimated change of each joint with conditions, in words.
    conditions: Vec<String>,
}

#[derive(Clone, Debug, PartialEq)]
struct JointTable {
    name: String,
    moves: JointKind,
    wrap_counts: f64,
    /// Pairs of counts, ascending and unwrapped, and the joint's position there, rad, or m for a slide.
    points: Vec<(f64, f64)>,
}

/// Travel from the middle of a joint's range by the datasheet, rad.
#[derive(Clone, Copy, Debug)]
struct TravelRange {
    low_rad: f64,
    high_rad: f64,
    /// Half of the datasheet's range, rad; the sensor is a straight line beyond it.
    half_rad: f64,
}

impl SensorTable {
    /// Tables with `points` per joint (2 .. 10000). Without a number, the fewest with at most 0.02 mm of interpolation
    /// error at the tool, all joints together. A joint counts with its error times the tool's largest distance from its
    /// axis. Angles hold under the calibration's reference conditions, in the middle of the backlash.
    #[must_use]
    pub fn new(robot: &Robot, sensors: &ArmSensors, points: Option<usize>) -> Self {
        let limits = robot.chain.joints().iter().map(|joint| joint.limits);
        let ranges: Vec<TravelRange> =
            sensors.models.iter().zip(limits).map(|(model, limits)| TravelRange::of(model, limits)).collect();
        let error_m = |points: usize| -> f64 {
            let of = |(model, (range, lever_m)): (&SensorModel, (&TravelRange, f64))| {
                lever_m * range.interpolation_error_rad(model, points)
            };
            sensors.models.iter().zip(ranges.iter().zip(levers_m(robot))).map(of).sum()
        };
        let chosen = || {
            let doubled = std::iter::successors(Some(MIN_POINTS), |n| Some((2 * n - 1).min(MAX_POINTS)));
            doubled.take_while(|n| *n < MAX_POINTS).find(|n| error_m(*n) <= CHOSEN_ERROR_M).unwrap_or(MAX_POINTS)
        };
        let points = points.unwrap_or_else(chosen);
        let joints = sensors.models.iter().zip(&ranges).map(|(model, range)| range.table(model, points));
        Self {
            joints: joints.collect(),
            interpolation_error_m: error_m(points),
            conditions: sensors.models.iter().filter_map(conditions_of).collect(),
        }
    }

    /// CSV with head lines that begin with `#`: joint, counts, angle_rad.
    #[must_use]
    pub fn to_csv(&self, robot: &Robot) -> String {
        let points = self.joints.first().map_or(0, |joint| joint.points.len());
        let mut text = format!(
            "# Counts to calibrated joint angles of {}, by armcal: {points} points a joint, over its whole range.\n\
             # counts: the raw reading, unwrapped. Add or subtract a joint's wrap_counts until it is within the rows.\n\
             # angle_rad: exact at the points; straight lines between them are within {:.4} mm at the tool, all\n\
             # joints together. Apply it alone: no gain, offset or transmission before or after it. The angles are\n\
             # those of the exported URDF.\n",
            robot.name.escape_debug(),
            (self.interpolation_error_m * 1e7).ceil() * 1e-4,
        );
        for joint in &self.joints {
            let _ = writeln!(text, "# {}: wrap_counts {}", joint.name.escape_debug(), joint.wrap_counts);
        }
        for line in &self.conditions {
            let _ = writeln!(text, "# {line}");
        }
        let has_slide = self.joints.iter().any(|joint| joint.moves.is_slide());
        if has_slide {
            // The head's description of the column applies to the renamed one.
            text = text.replace("# angle_rad: exact", "# position: of joints that turn rad, of slides m; exact");
        }
        text += if has_slide { "joint,counts,position,unit\n" } else { "joint,counts,angle_rad\n" };
        for joint in &self.joints {
            let name = csv_field(&joint.name);
            let unit = if has_slide { format!(",{}", joint.moves.si()) } else { String::new() };
            for (counts, angle_rad) in &joint.points {
                let _ = writeln!(text, "{name},{counts},{angle_rad}{unit}");
            }
        }
        text
    }
}

/// A field of a CSV line, quoted where necessary.
pub(super) fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

impl TravelRange {
    /// The datasheet's range, extended to the calibrated readings at the joint's limits. It is at most the word's
    /// range, which a joint without limits has.
    fn of(model: &SensorModel, limits: Option<JointLimits>) -> Self {
        let spec = &model.spec;
        let half_rad = spec.half_range_rad;
        let word_rad = 0.5 * spec.wrap_counts / spec.counts_per_rad.abs();
        let Some(JointLimits { lower_rad, upper_rad }) = limits else {
            return Self { low_rad: -word_rad, high_rad: word_rad, half_rad };
        };
        let ends = [lower_rad, upper_rad].map(|angle| model.travel_under_rad(angle, &ConditionChange::default()));
        let (low_rad, high_rad) = (ends[0].min(ends[1]).min(-half_rad), ends[0].max(ends[1]).max(half_rad));
        Self { low_rad: low_rad.max(-word_rad), high_rad: high_rad.min(word_rad), half_rad }
    }

    /// Points evenly spaced over the datasheet's range, plus the two ends beyond it. With too few points for that, they
    /// are spaced over the whole range.
    fn places_rad(&self, points: usize) -> Vec<f64> {
        let (inner_low, inner_high) = (self.low_rad.max(-self.half_rad), self.high_rad.min(self.half_rad));
        let [before, behind] = [self.low_rad < inner_low, self.high_rad > inner_high].map(usize::from);
        let even = |low: f64, high: f64, n: usize| (0..n).map(move |k| low + k as f64 / (n - 1) as f64 * (high - low));
        match points.checked_sub(before + behind) {
            Some(inner) if inner >= MIN_POINTS => {
                let ends = [(before, self.low_rad), (behind, self.high_rad)];
                let [first, last] = ends.map(|(n, end_rad)| std::iter::repeat_n(end_rad, n));
                first.chain(even(inner_low, inner_high, inner)).chain(last).collect()
            }
            _ => even(self.low_rad, self.high_rad, points).collect(),
        }
    }

    fn table(&self, model: &SensorModel, points: usize) -> JointTable {
        let spec = &model.spec;
        let center_counts = spec.offset_counts + spec.counts_per_rad * spec.center_rad;
        let place = |travel_rad: f64| (center_counts + spec.counts_per_rad * travel_rad, angle_rad(model, travel_rad));
        let mut points: Vec<(f64, f64)> = self.places_rad(points).into_iter().map(place).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        JointTable { name: spec.joint.clone(), moves: spec.moves, wrap_counts: spec.wrap_counts, points }
    }

    /// The largest difference between the sensor and straight lines between its points, rad.
    fn interpolation_error_rad(&self, model: &SensorModel, points: usize) -> f64 {
        if model.correction.terms.are_zero() {
            return 0.0;
        }
        let between = |pair: &[f64]| {
            let [low, high] = [pair[0], pair[1]];
            let [angle_low, angle_high] = [low, high].map(|travel_rad| angle_rad(model, travel_rad));
            let off_rad = |k: usize| {
                let share = k as f64 / PLACES_BETWEEN as f64;
                let straight_rad = angle_low + share * (angle_high - angle_low);
                (angle_rad(model, low + share * (high - low)) - straight_rad).abs()
            };
            (1..PLACES_BETWEEN).map(off_rad).fold(0.0, f64::max)
        };
        self.places_rad(points).windows(2).map(between).fold(0.0, f64::max)
    }
}

fn angle_rad(model: &SensorModel, travel_rad: f64) -> f64 {
    model.correction.angle_rad(&model.spec, travel_rad, &ConditionChange::default(), 0.0)
}

/// Largest distance of the tool from each joint's axis, m: with every link beyond it stretched out.
fn levers_m(robot: &Robot) -> Vec<f64> {
    let joints = robot.chain.joints();
    let mut lever_m = robot.tool.mount.link_from_frame.translation.vector.norm();
    let mut levers_m = vec![0.0; joints.len()];
    for joint in (0..joints.len()).rev() {
        // One metre of a slide moves the tool by one metre.
        levers_m[joint] = if joints[joint].kind.is_slide() { 1.0 } else { lever_m };
        lever_m += joints[joint].parent_from_joint.translation.vector.norm() + stroke_m(&joints[joint]);
    }
    levers_m
}

/// Largest distance by which a slide moves its load from its own origin, m.
fn stroke_m(joint: &ChainJoint) -> f64 {
    let limits = joint.limits.filter(|_| joint.kind.is_slide());
    limits.map_or(0.0, |limits| limits.lower_rad.abs().max(limits.upper_rad.abs()))
}

/// Name of a calibration.toml key for a joint: in m for a slide.
pub(super) fn own_key(moves: JointKind, key: &str) -> String {
    if moves.is_slide() { metric(key) } else { key.to_owned() }
}

fn conditions_of(model: &SensorModel) -> Option<String> {
    let terms = &model.correction.terms;
    let coefficients = [
        ("offset_rad_per_k", terms.offset_rad_per_k),
        ("gain_per_k", terms.gain_per_k),
        ("offset_rad_per_mpa", terms.offset_rad_per_mpa),
        ("drift_rad_per_h", terms.drift_rad_per_h),
        ("half_backlash_rad", terms.half_backlash_rad),
    ];
    let known: Vec<String> = coefficients
        .iter()
        .filter(|(_, value)| *value != 0.0)
        .map(|(key, value)| format!("{} {value}", own_key(model.spec.moves, key)))
        .collect();
    let name = model.spec.joint.escape_debug();
    (!known.is_empty())
        .then(|| format!("{name}, not in its rows (calibration.toml, [joint.terms]): {}", known.join(", ")))
}
