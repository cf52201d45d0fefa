//! Joint readings that do not mean what the input map and robot.toml say: as data and in words.

use std::fmt;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::say::constants::reading_error::UNTURNED;
use crate::say::length_unit::unit_of;
use crate::say::sensor_keys::Rescaled;
use crate::say::wrong_input_words::turn_in_words;
use armcal_core::codes::{Code, Coded};
use armcal_core::kinematics::JointKind;

/// A joint whose sensor has its zero elsewhere than robot.toml says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointZero {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Angle minus reading, rad; for a slide, way minus reading, m.
    pub off_rad: f64,
    /// Kind of the joint: turns or slides.
    #[serde(default, skip_serializing_if = "JointKind::is_turning")]
    pub moves: JointKind,
    /// The reading at angle zero that explains the views.
    pub offset_counts: f64,
    /// `zero` of the input map that explains the views; absent: readings are counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_zero: Option<f64>,
}

/// A joint whose angle is in another joint's reading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SignedJoint {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// 1 if its angle is added, -1 if it is subtracted.
    pub sign: f64,
}

/// One kind of difference between the readings and the angles that they are read as.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "error")]
pub enum ReadingError {
    /// Two joints have each other's readings.
    Exchanged {
        /// Names of the two joints in the URDF.
        joints: [String; 2],
    },
    /// All joints are in the reverse order.
    Reversed {
        /// Names of the joints in the URDF, base first.
        joints: Vec<String>,
    },
    /// Several joints have one another's readings, in a circle.
    InCircle {
        /// Names of the joints in the URDF.
        joints: Vec<String>,
        /// For each of `joints`, the joint under whose name its readings are recorded.
        recorded: Vec<String>,
    },
    /// One joint's reading is a sum of its own angle and those of other joints.
    Sum {
        /// Name of the joint in the URDF.
        joint: String,
        /// 1 if the joint's own angle is added, -1 if it is subtracted.
        own: f64,
        /// The other joints of the sum.
        with: Vec<SignedJoint>,
    },
    /// One joint's reading contains another joint's angle.
    Coupled {
        /// Name of the joint in the URDF.
        joint: String,
        /// The joint whose angle is added.
        with: String,
        /// 1 if that angle is added, -1 if it is subtracted.
        sign: f64,
    },
    /// One joint has the readings of another one.
    Alike {
        /// Name in the URDF of the joint whose angles these are not.
        joint: String,
        /// The joint that the readings belong to.
        with: String,
        /// Number of views in which the readings of both joints are the same.
        views: usize,
    },
    /// Readings of 0 to 360 deg, of joints whose ranges lie about zero.
    OtherTurns {
        /// Names of the joints in the URDF.
        joints: Vec<String>,
        /// One turn of the first of `joints`, counts.
        wrap_counts: f64,
    },
    /// Joint zeros differ from robot.toml.
    Zeros {
        /// The joints concerned; for a parallel pair, both.
        joints: Vec<JointZero>,
    },
    /// One joint's readings are in another unit or scale.
    Scaled {
        /// Name of the joint in the URDF.
        joint: String,
        /// Angle over reading.
        factor: f64,
        /// `factor` of the input map with that slope; absent: readings are counts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        input_factor: Option<f64>,
    },
    /// Each view has the readings of another view.
    Shifted {
        /// Number of views from a view to the one with its readings; negative if that one is earlier.
        views: i32,
    },
    /// The views have the joint readings of other instants, in no order that the search found.
    Unpaired {
        /// Number of views in the search.
        views: usize,
        /// Probability that readings in a random order agree as well with the camera's positions.
        p: f64,
    },
    /// The tag map is in another frame than the base's.
    MapFrame {
        /// Position of the map's frame in the base frame, m.
        position_m: [f64; 3],
        /// Rotation of the map's frame in the base frame: w, x, y, z.
        turn: [f64; 4],
    },
    /// Sizes and distances of all tags differ from the stated ones by one factor.
    MapScale {
        /// True size or distance over the stated one.
        factor: f64,
        /// True for tags that are recorded as corners in pixels; false for positions and poses.
        is_in_pixels: bool,
        /// Dimension of the tags that was measured instead of their size, in words; absent where their print does not
        /// show it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        hint: Option<String>,
    },
    /// The camera is not where robot.toml says.
    Camera {
        /// The link that carries the camera; absent where it is the stated one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        link: Option<String>,
        /// Rotation that follows the stated `quaternion_wxyz`: w, x, y, z.
        turn: [f64; 4],
    },
}

/// The reading error that explains the views, with those that explain them nearly as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MisreadReadings {
    /// The most probable error.
    pub found: ReadingError,
    /// Other errors within the margin of evidence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<ReadingError>,
    /// Root mean square distance between predicted and surveyed tags, by the datasheet and the readings as they are, m.
    pub tag_error_m: f64,
    /// Root mean square distance after correction and calibration, m; absent where no tag was predicted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corrected_m: Option<f64>,
}

impl fmt::Display for ReadingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exchanged { joints: [a, b] } => write!(f, "the readings of {a} and {b} are exchanged"),
            Self::Reversed { .. } => write!(f, "the joints are in the reverse order, tool first"),
            Self::OtherTurns { joints, .. } => {
                write!(f, "readings of {} run from 0 to 360 deg, beyond the joint limits by a turn", joints.join(", "))
            }
            Self::Coupled { joint, with, sign } => {
                let (verb, preposition) = if *sign > 0.0 { ("added", "to") } else { ("subtracted", "from") };
                write!(f, "the angle of {with} is {verb} {preposition} the reading of {joint}")
            }
            Self::Alike { joint, with, views } => {
                write!(f, "{joint} and {with} have the same readings in all {views} views, those of {with}")
            }
            Self::Zeros { joints } => {
                let one = |zero: &JointZero| {
                    let less = if zero.off_rad > 0.0 { "less" } else { "more" };
                    let size = zero.moves.unit().shown(zero.off_rad.abs(), 1);
                    format!("{} reads {size} {less} than its angle", zero.joint)
                };
                let all: Vec<String> = joints.iter().map(one).collect();
                write!(f, "joint zeros differ: {}", all.join(", "))
            }
            Self::Scaled { joint, factor, .. } => {
                write!(
                    f,
                    "the sensor of {joint} has another scale than its datasheet: {joint} moves {factor:.4} times as \
                     far as it says"
                )
            }
            Self::Shifted { views } => {
                let side = if *views > 0 { "previous" } else { "next" };
                write!(f, "each view has the joint readings of the {side} one")
            }
            Self::Unpaired { views, p } => {
                write!(
                    f,
                    "joint readings and tags are not of the same instants: the tags of each view fit the map, but the \
                     readings of {views} views follow the camera no better than in a random order (p = {p:.2})"
                )
            }
            Self::InCircle { joints, recorded } => fmt_in_circle(f, joints, recorded),
            Self::Sum { joint, own, with } => fmt_sum(f, joint, *own, with),
            Self::MapFrame { position_m: [x, y, z], turn } => {
                write!(f, "the frame of the tag map is not the base's: it lies at ({x:.3}, {y:.3}, {z:.3}) m in it, ")?;
                write!(f, "turned by {}", any_turn_in_words(turn))
            }
            Self::MapScale { factor, is_in_pixels: true, hint } => fmt_size(f, *factor, hint.as_deref()),
            Self::MapScale { factor, .. } => fmt_unit(f, *factor),
            Self::Camera { link, turn } => {
                f.write_str("the camera is not as robot.toml says: ")?;
                match link {
                    Some(link) if is_turned(turn) => {
                        write!(f, "it is on {link}, its frame turned by {}", turn_in_words(turn))
                    }
                    Some(link) => write!(f, "it is on {link}"),
                    None => write!(f, "its frame is turned by {}", turn_in_words(turn)),
                }
            }
        }
    }
}

const MEASURE_TAGS: &str = "measure the border square of one tag (of tag36h11 the black one), correct size_m, and make \
                            the tag map again";
const BY_ARM: &str = "by the way that the arm moves the camera, ";

fn fmt_size(f: &mut fmt::Formatter<'_>, factor: f64, hint: Option<&str>) -> fmt::Result {
    write!(f, "{BY_ARM}the tags are {factor:.3} times as large and as far apart as size_m and the tag map say")?;
    hint.map_or(Ok(()), |hint| write!(f, ", {hint}"))
}

fn fmt_unit(f: &mut fmt::Formatter<'_>, factor: f64) -> fmt::Result {
    write!(f, "{BY_ARM}the distances of tags, as recorded and in the tag map, ")?;
    match unit_of(1.0 / factor) {
        Some(unit) => write!(f, "are in {unit}, not in metres"),
        None => write!(f, "are {:.3} times the true ones", 1.0 / factor),
    }
}

fn is_turned(turn: &[f64; 4]) -> bool {
    turn[0].abs() < UNTURNED
}

impl fmt::Display for MisreadReadings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.found)?;
        if let Some(corrected_m) = self.corrected_m {
            let [as_read, corrected] = [self.tag_error_m, corrected_m].map(|m| 1e3 * m);
            write!(f, ": corrected, the tags fit within {corrected:.1} mm rms instead of {as_read:.1} mm")?;
        }
        self.alternatives.iter().try_for_each(|other| write!(f, " (nearly as likely: {other})"))
    }
}

/// `the readings of 3 joints are recorded under one another's names: those of waist under elbow`.
fn fmt_in_circle(f: &mut fmt::Formatter<'_>, joints: &[String], recorded: &[String]) -> fmt::Result {
    let one = |(joint, from): (&String, &String)| format!("those of {joint} under {from}");
    let all: Vec<String> = joints.iter().zip(recorded).map(one).collect();
    let n = joints.len();
    write!(f, "the readings of {n} joints are recorded under one another's names: {}", all.join(", "))
}

fn fmt_sum(f: &mut fmt::Formatter<'_>, joint: &str, own: f64, with: &[SignedJoint]) -> fmt::Result {
    let of_others = with.iter().map(|other| (other.sign, other.joint.as_str()));
    let sum = signed_sum(std::iter::once((own, joint)).chain(of_others));
    write!(f, "the reading of {joint} is a sum of angles: {sum}")
}

/// `elbow + shoulder`, `-elbow - shoulder`.
fn signed_sum<'a>(terms: impl Iterator<Item = (f64, &'a str)>) -> String {
    let mut sum = String::new();
    for (sign, name) in terms {
        let sign = match (sign < 0.0, sum.is_empty()) {
            (true, true) => "-",
            (false, true) => "",
            (true, false) => " - ",
            (false, false) => " + ",
        };
        sum.push_str(sign);
        sum.push_str(name);
    }
    sum
}

/// Remedy for wrong zeros; `None` for any other error.
fn zeros_remedy(error: &ReadingError) -> Option<String> {
    let ReadingError::Zeros { joints } = error else { return None };
    let one = |zero: &JointZero| match zero.input_zero {
        Some(input_zero) => format!("zero.{} = {input_zero:.5}", zero.joint),
        None => format!("{}: offset_counts = {:.5}", zero.joint, zero.offset_counts),
    };
    let lines: Vec<String> = joints.iter().map(one).collect();
    let is_of_map = joints.iter().all(|zero| zero.input_zero.is_some());
    let table = if is_of_map { "[joint_sensors] of the input map" } else { "[[joint_sensor]] of robot.toml" };
    Some(format!("set the zeros in {table}, if the URDF is right: {}", lines.join("; ")))
}

/// Remedy for a map in another frame; `None` for any other error.
fn frame_remedy(error: &ReadingError) -> Option<String> {
    let ReadingError::MapFrame { position_m: [x, y, z], turn } = error else { return None };
    let [qw, qx, qy, qz] = turn.map(|value| format!("{value:.4}"));
    Some(format!(
        "write the tag map in the base's frame: multiply each pose from the left by that of the map's frame, \
         position_m = [{x:.3}, {y:.3}, {z:.3}], quaternion_wxyz = [{qw}, {qx}, {qy}, {qz}]"
    ))
}

/// `89.7 deg about (0.00, 0.01, 1.00)`.
fn any_turn_in_words([w, x, y, z]: &[f64; 4]) -> String {
    let turn = UnitQuaternion::new_normalize(Quaternion::new(*w, *x, *y, *z));
    let axis = turn.axis().map_or(Vector3::z(), |axis| axis.into_inner());
    let degrees = turn.angle().to_degrees();
    format!("{degrees:.1} deg about ({:.2}, {:.2}, {:.2})", axis.x, axis.y, axis.z)
}

impl MisreadReadings {
    /// Remedy for zeros and the frame of the map, which only a look at the arm can distinguish.
    fn remedy_of_zeros_or_frame(&self) -> String {
        let all = || std::iter::once(&self.found).chain(&self.alternatives);
        let (zeros, frame) = (all().find_map(zeros_remedy), all().find_map(frame_remedy));
        match (zeros, frame) {
            (Some(zeros), Some(frame)) => {
                format!("see where the joint stands when it reads zero, to tell which; {zeros}; or {frame}")
            }
            (zeros, frame) => zeros.or(frame).unwrap_or_default(),
        }
    }

    /// Advice with the lines to change.
    #[must_use]
    pub fn remedy(&self) -> String {
        match &self.found {
            ReadingError::Exchanged { joints: [a, b] } => {
                format!(
                    "exchange the two in [joint_sensors] of the input map: names = {{ {a} = \"{b}\", {b} = \"{a}\" }}"
                )
            }
            ReadingError::Reversed { joints } => {
                let pairs = joints.iter().zip(joints.iter().rev());
                let names: Vec<String> = pairs.map(|(joint, recorded)| format!("{joint} = \"{recorded}\"")).collect();
                format!("reverse the names in [joint_sensors] of the input map: names = {{ {} }}", names.join(", "))
            }
            ReadingError::InCircle { joints, recorded } => {
                let lines: Vec<String> = joints.iter().zip(recorded).map(|(a, b)| format!("{a} = \"{b}\"")).collect();
                format!("name their readings in [joint_sensors] of the input map: names = {{ {} }}", lines.join(", "))
            }
            ReadingError::Sum { joint, own, with } => {
                let of_others = with.iter().map(|other| (-own * other.sign, other.joint.as_str()));
                let sum = signed_sum(std::iter::once((*own, joint.as_str())).chain(of_others));
                format!(
                    "record the angle of {joint} relative to the link before it, which is {sum} of the recorded \
                     columns; the input map has no key for sums"
                )
            }
            ReadingError::Coupled { joint, with, .. } => {
                format!("record the angle of {joint} relative to the link before it, without that of {with}")
            }
            ReadingError::Alike { joint, .. } => {
                format!("name the readings of {joint} in joint_sensors.names of the input map, or record them")
            }
            ReadingError::OtherTurns { wrap_counts, .. } => {
                format!("state in [[joint_sensor]] of robot.toml that the word repeats: wrap_counts = {wrap_counts:.6}")
            }
            ReadingError::Zeros { .. } | ReadingError::MapFrame { .. } => self.remedy_of_zeros_or_frame(),
            ReadingError::Scaled { joint, factor, input_factor } => {
                let found = Rescaled { joint, slope: *factor, input_factor: *input_factor };
                format!("correct the unit of {joint} in the input map, or its scale: {}", found.line())
            }
            ReadingError::Shifted { .. } => {
                "give each view the joint readings of its own pose: check the rows of the table, or the stamps"
                    .to_owned()
            }
            ReadingError::Unpaired { .. } => {
                "give each view the joint readings of its own pose: check the time column or the stamps, the order of \
                 the rows, and how joints and tags were put together"
                    .to_owned()
            }
            ReadingError::MapScale { is_in_pixels: true, .. } => MEASURE_TAGS.to_owned(),
            ReadingError::MapScale { factor, .. } => {
                format!("multiply the recorded positions of tags and position_m of the tag map by {factor:.5}")
            }
            ReadingError::Camera { link, turn } => {
                let link = link.as_ref().map(|link| format!("link = \"{link}\""));
                let [w, x, y, z] = turn.map(|value| format!("{value:.4}"));
                let by = is_turned(turn)
                    .then(|| format!("quaternion_wxyz multiplied by [{w}, {x}, {y}, {z}] from the right"));
                let lines: Vec<String> = link.into_iter().chain(by).collect();
                format!("set in [camera] of robot.toml: {}", lines.join(", "))
            }
        }
    }
}

impl Coded for MisreadReadings {
    fn code(&self) -> Code {
        match self.found {
            ReadingError::Exchanged { .. } | ReadingError::Reversed { .. } | ReadingError::InCircle { .. } => {
                Code::JointsExchanged
            }
            ReadingError::Coupled { .. } | ReadingError::Sum { .. } => Code::JointsCoupled,
            ReadingError::Alike { .. } => Code::JointsAlike,
            ReadingError::OtherTurns { .. } => Code::JointTurns,
            ReadingError::Zeros { .. } => Code::JointZeros,
            ReadingError::Scaled { .. } => Code::SensorLine,
            ReadingError::Shifted { .. } | ReadingError::Unpaired { .. } => Code::ReadingsShifted,
            ReadingError::Camera { .. } => Code::InputCamera,
            ReadingError::MapFrame { .. } => Code::MapFrame,
            ReadingError::MapScale { .. } => Code::InputTagSize,
        }
    }
}
