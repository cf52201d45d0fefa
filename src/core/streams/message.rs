//! The messages, free of any file format. Stamps are the sender's clock; the log time is the recorder's.

use crate::joints::{JointAngles, JointCounts};
use crate::robot::FailedJoint;
use crate::time::Stamp;

/// Everything that a recording of an arm may hold.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Raw readings of the joint sensors.
    JointSensors(JointSensorSample),
    /// Set-points sent to the arm's controller.
    JointCommand(JointCommand),
    /// The same joints in radians, under the belief of that moment.
    JointStates(JointStateBelief),
    /// AprilTags seen in one camera image.
    Detections(TagDetections),
    /// What the detector saw in one camera image and did not take for a tag.
    Rejects(DetectionRejects),
    /// One camera image, compressed.
    Image(CameraImage),
    Temperature(TemperatureSample),
    Pressure(PressureSample),
    /// The vehicle's attitude sensor.
    Attitude(Attitude),
    /// How far the gripper is open, as measured.
    Gripper(GripperSample),
    /// How far the gripper is told to open.
    GripperCommand(GripperCommand),
    /// What the arm is calibrated for.
    Task(ReachTask),
    /// Where the tags are, where the vehicle says it and not the robot's file.
    Survey(RecordedSurvey),
    /// The tool against a surveyed surface.
    Touch(ToolTouch),
    /// A span of the recording that means something.
    Mark(Mark),
    Log(LogLine),
}

#[derive(Clone, Debug, PartialEq)]
pub struct JointSensorSample {
    pub stamp: Stamp,
    pub counts: JointCounts,
}

/// Set-points in raw counts: the arm's own controller closes its loop on its own sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct JointCommand {
    pub stamp: Stamp,
    pub counts: JointCounts,
}

#[derive(Clone, Debug, PartialEq)]
pub struct JointStateBelief {
    pub stamp: Stamp,
    pub angles: JointAngles,
}

#[derive(Clone, Debug, PartialEq)]
pub struct TagDetections {
    pub stamp: Stamp,
    pub tags: Vec<TagDetection>,
}

/// One tag in one image. Corners in raw (distorted) pixels: bottom left, bottom right, top right, top left as printed,
/// that is tag-frame (-s/2, -s/2), (s/2, -s/2), (s/2, s/2), (-s/2, s/2).
#[derive(Clone, Debug, PartialEq)]
pub struct TagDetection {
    pub id: u32,
    pub corners_px: [[f64; 2]; 4],
    /// The detector's decision margin, larger is surer; as apriltag gives it.
    pub decision_margin: f64,
}

/// Why a detector did not believe what it saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RejectReason {
    /// More bits are wrong than the code may have corrected.
    WrongBits,
    /// Black and white are too near each other.
    LowContrast,
    /// The sides are too short in the image.
    TooSmall,
    /// The image about the edges is not that of a square tag.
    PoorEdges,
    /// The same id at two places of one image: neither can be trusted.
    SeenTwice,
    /// A corner has no bearing in the lens model, or lies outside of the image.
    OutOfView,
    /// No tag with this id belongs to the vehicle or the arm.
    UnknownId,
}

impl RejectReason {
    pub const ALL: [Self; 7] = [
        Self::WrongBits,
        Self::LowContrast,
        Self::TooSmall,
        Self::PoorEdges,
        Self::SeenTwice,
        Self::OutOfView,
        Self::UnknownId,
    ];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::WrongBits => "wrong_bits",
            Self::LowContrast => "low_contrast",
            Self::TooSmall => "too_small",
            Self::PoorEdges => "poor_edges",
            Self::SeenTwice => "seen_twice",
            Self::OutOfView => "out_of_view",
            Self::UnknownId => "unknown_id",
        }
    }
}

/// Something like a tag that was not taken for one.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionReject {
    /// As decoded, right or wrong.
    pub id: u32,
    pub corners_px: [[f64; 2]; 4],
    pub reason: RejectReason,
}

/// What was rejected in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionRejects {
    pub stamp: Stamp,
    pub rejects: Vec<DetectionReject>,
}

/// A camera image as JPEG.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraImage {
    pub stamp: Stamp,
    pub jpeg: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Thermometer {
    Oil,
    Water,
}

#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureSample {
    pub stamp: Stamp,
    pub thermometer: Thermometer,
    pub temperature_c: f64,
    pub variance_c2: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct PressureSample {
    pub stamp: Stamp,
    pub pressure_pa: f64,
    pub variance_pa2: f64,
}

/// Attitude of the vehicle in the world, with its body rates and specific force, as an IMU gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitude {
    pub stamp: Stamp,
    pub quaternion_wxyz: [f64; 4],
    pub angular_velocity_rad_s: [f64; 3],
    pub specific_force_m_s2: [f64; 3],
}

/// The gap between the jaws, 0 where they meet.
#[derive(Clone, Debug, PartialEq)]
pub struct GripperSample {
    pub stamp: Stamp,
    pub opening_m: f64,
}

/// The gap between the jaws that they are driven to.
#[derive(Clone, Debug, PartialEq)]
pub struct GripperCommand {
    pub stamp: Stamp,
    pub opening_m: f64,
}

/// Positions that the tool is to reach, in the base frame, and how near counts as a hit.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachTask {
    pub stamp: Stamp,
    pub targets_m: Vec<[f64; 3]>,
    pub tolerance_m: f64,
}

/// Tags as surveyed before the dive, in the base frame: what belief takes for known.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedSurvey {
    pub stamp: Stamp,
    /// The tag beside the base; one of `tags`.
    pub base_tag: u32,
    pub tags: Vec<RecordedTag>,
}

/// One tag of a survey: `base_from_tag` as numbers, that they come out of a file as they went in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedTag {
    pub id: u32,
    /// Side of the black square.
    pub size_m: f64,
    pub position_m: [f64; 3],
    pub quaternion_wxyz: [f64; 4],
    /// Infinite, as the rotation's, where only the tag's size is known; the pose is then the identity.
    pub position_std_m: f64,
    pub rotation_std_rad: f64,
}

/// The tool's tip rested against a surveyed plane, felt by the arm or its pilot: `normal . (tool - point) = tip_radius`
/// within one sigma, by the joint sensors' readings from `stamp` on for `duration_s`.
///
/// A tip in a socket is three of these with normals at right angles and no radius.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolTouch {
    pub stamp: Stamp,
    pub duration_s: f64,
    /// Name of the surface, for people.
    pub surface: String,
    /// Any point of the plane, base frame.
    pub point_m: [f64; 3],
    /// Out of the surface, unit length, base frame.
    pub normal: [f64; 3],
    /// Of a ball about the tool point; zero for a tip that is the tool point.
    pub tip_radius_m: f64,
    /// One sigma along the normal: the surface's survey and what is felt of it.
    pub std_m: f64,
}

/// Which share of the data a captured view belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CaptureSet {
    /// The fit uses it.
    Fit,
    /// The fit never sees it; the verdict rests on it.
    HeldOut,
}

/// What a calibration starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PriorSource {
    /// The datasheet.
    Fresh,
    /// The last accepted calibration of the same recording; what the new views do not determine keeps its value.
    Warm,
}

/// Under which sensors a target was reached for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReachAttempt {
    /// The datasheet's.
    Before,
    /// Calibrated ones.
    After,
}

/// What the arm is doing, for people who watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    Plan,
    Move,
    Settle,
    Capture,
    Calibrate,
    Reach,
    /// The arm rests while the world goes on.
    Wait,
    Done,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MarkKind {
    /// The arm stood still over the mark's span: detections and readings in it belong together.
    Capture { set: CaptureSet, pose_idx: u32 },
    /// The arm stood still, and since the first such view of `joint_idx` no other joint was told to move: what the
    /// camera's turn against the readings says about the sensor's scale.
    Identify { joint_idx: u32 },
    /// The joint stood at one of its nominal end stops, where the drawing has this angle.
    Stop { joint_idx: u32, angle_rad: f64 },
    /// Somebody declared that this joint, or its sensor, has failed; it holds for the whole recording.
    Failed(FailedJoint),
    /// A calibration from the views captured within the span.
    Calibrate(PriorSource),
    /// The arm came to rest for a target.
    Reach { attempt: ReachAttempt, target_idx: u32 },
    /// The jaws closed on a target, from wide open.
    Touch { target_idx: u32 },
    /// A phase began at `start`.
    Phase(Phase),
}

/// A span `start..=end` by the joint sensors' clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    pub start: Stamp,
    pub end: Stamp,
    pub kind: MarkKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    Debug,
    Info,
    Warn,
    Error,
}

#[derive(Clone, Debug, PartialEq)]
pub struct LogLine {
    pub stamp: Stamp,
    pub level: LogLevel,
    pub name: String,
    pub text: String,
}
