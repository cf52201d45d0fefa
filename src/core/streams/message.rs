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
    /// Temperature of oil or water.
    Temperature(TemperatureSample),
    /// Pressure at the depth sensor.
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
    /// A line of text for people.
    Log(LogLine),
}

/// Raw readings of all joints at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSensorSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// One per joint, base first.
    pub counts: JointCounts,
}

/// Set-points in raw counts: the arm's own controller closes its loop on its own sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct JointCommand {
    /// Sender's clock.
    pub stamp: Stamp,
    /// One per joint, base first.
    pub counts: JointCounts,
}

/// Angles of all joints under the belief of the moment.
#[derive(Clone, Debug, PartialEq)]
pub struct JointStateBelief {
    /// Sender's clock.
    pub stamp: Stamp,
    /// One per joint, base first, rad.
    pub angles: JointAngles,
}

/// All tags of one image.
#[derive(Clone, Debug, PartialEq)]
pub struct TagDetections {
    /// Time of the exposure.
    pub stamp: Stamp,
    /// In the detector's order; empty where it saw none.
    pub tags: Vec<TagDetection>,
}

/// One tag in one image. Corners in raw (distorted) pixels: bottom left, bottom right, top right, top left as printed,
/// that is tag-frame (-s/2, -s/2), (s/2, -s/2), (s/2, s/2), (-s/2, s/2).
#[derive(Clone, Debug, PartialEq)]
pub struct TagDetection {
    /// Number in the family of the arm's tags.
    pub id: u32,
    /// Order and frame: see above.
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
    /// Every reason once.
    pub const ALL: [Self; 7] = [
        Self::WrongBits,
        Self::LowContrast,
        Self::TooSmall,
        Self::PoorEdges,
        Self::SeenTwice,
        Self::OutOfView,
        Self::UnknownId,
    ];

    /// As recordings write it.
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
    /// As a [`TagDetection`]'s.
    pub corners_px: [[f64; 2]; 4],
    /// The first check that it failed.
    pub reason: RejectReason,
}

/// What was rejected in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionRejects {
    /// Time of the exposure.
    pub stamp: Stamp,
    /// In the detector's order.
    pub rejects: Vec<DetectionReject>,
}

/// A camera image as JPEG.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraImage {
    /// Time of the exposure.
    pub stamp: Stamp,
    /// Bytes of the JPEG file.
    pub jpeg: Vec<u8>,
}

/// What a thermometer measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Thermometer {
    /// Hydraulic oil of the arm.
    Oil,
    /// Sea water about the vehicle.
    Water,
}

/// One reading of a thermometer.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// What is measured.
    pub thermometer: Thermometer,
    /// Degrees Celsius.
    pub temperature_c: f64,
    /// Noise of a reading; 0 where it is unknown.
    pub variance_c2: f64,
}

/// One reading of the depth sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct PressureSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Absolute pressure.
    pub pressure_pa: f64,
    /// Noise of a reading; 0 where it is unknown.
    pub variance_pa2: f64,
}

/// Attitude of the vehicle in the world, with its body rates and specific force, as an IMU gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitude {
    /// Sender's clock.
    pub stamp: Stamp,
    /// `world_from_vehicle`, unit.
    pub quaternion_wxyz: [f64; 4],
    /// In the vehicle's axes.
    pub angular_velocity_rad_s: [f64; 3],
    /// In the vehicle's axes, +g upwards at rest.
    pub specific_force_m_s2: [f64; 3],
}

/// The gap between the jaws, 0 where they meet.
#[derive(Clone, Debug, PartialEq)]
pub struct GripperSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Measured.
    pub opening_m: f64,
}

/// The gap between the jaws that they are driven to.
#[derive(Clone, Debug, PartialEq)]
pub struct GripperCommand {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Set-point.
    pub opening_m: f64,
}

/// Positions that the tool is to reach, in the base frame, and how near counts as a hit.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachTask {
    /// Sender's clock.
    pub stamp: Stamp,
    /// In the order by which marks number them.
    pub targets_m: Vec<[f64; 3]>,
    /// Largest distance that counts as a hit.
    pub tolerance_m: f64,
    /// Angles at the last of the targets, which the task gives as poses; a recording does not hold them.
    pub poses: Vec<JointAngles>,
}

impl ReachTask {
    /// Angles at the target of that number, from 0; `None` where the task gives a position.
    #[must_use]
    pub fn pose(&self, target_idx: usize) -> Option<&JointAngles> {
        let first = self.targets_m.len().checked_sub(self.poses.len())?;
        self.poses.get(target_idx.checked_sub(first)?)
    }
}

/// Tags as surveyed before the dive: what belief takes for known.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedSurvey {
    /// Sender's clock.
    pub stamp: Stamp,
    /// The link that carries the tags before a camera that stands still, in whose frame they are; `None`: the base's.
    pub link: Option<String>,
    /// The tag beside the base; one of `tags`.
    pub base_tag: u32,
    /// Each id once.
    pub tags: Vec<RecordedTag>,
}

/// One tag of a survey: its pose in the survey's frame as numbers, that they come out of a file as they went in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedTag {
    /// Number in the family of the arm's tags.
    pub id: u32,
    /// Side of the black square.
    pub size_m: f64,
    /// Origin of the tag in the survey's frame.
    pub position_m: [f64; 3],
    /// Of the tag's axes in that frame, unit.
    pub quaternion_wxyz: [f64; 4],
    /// Infinite, as the rotation's, where only the tag's size is known; the pose is then the identity.
    pub position_std_m: f64,
    /// One sigma per axis, as the position's.
    pub rotation_std_rad: f64,
}

/// The tool's tip rested against a surveyed plane, felt by the arm or its pilot: `normal . (tool - point) = tip_radius`
/// within one sigma, by the joint sensors' readings from `stamp` on for `duration_s`.
///
/// A tip in a socket is three of these with normals at right angles and no radius.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolTouch {
    /// When the tip began to rest there.
    pub stamp: Stamp,
    /// How long it did.
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
    /// Plans paths and views.
    Plan,
    /// On the way.
    Move,
    /// Waits for the arm to come to rest.
    Settle,
    /// Records a view at rest.
    Capture,
    /// Estimates the sensors.
    Calibrate,
    /// Goes to a target of the task.
    Reach,
    /// The arm rests while the world goes on.
    Wait,
    /// The script has ended.
    Done,
}

/// What a span of a recording was for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MarkKind {
    /// The arm stood still over the mark's span: detections and readings in it belong together.
    Capture {
        /// Whether the fit may use the view.
        set: CaptureSet,
        /// Number of the view in the recording, from 0.
        pose_idx: u32,
    },
    /// The arm stood still, and since the first such view of `joint_idx` no other joint was told to move: what the
    /// camera's turn against the readings says about the sensor's scale.
    Identify {
        /// Index of the joint, base first.
        joint_idx: u32,
    },
    /// The joint stood at one of its nominal end stops, where the drawing has this angle.
    Stop {
        /// Index of the joint, base first.
        joint_idx: u32,
        /// Nominal angle of the stop.
        angle_rad: f64,
    },
    /// Somebody declared that this joint, or its sensor, has failed; it holds for the whole recording.
    Failed(FailedJoint),
    /// A calibration from the views captured within the span.
    Calibrate(PriorSource),
    /// The arm came to rest for a target.
    Reach {
        /// Under which sensors.
        attempt: ReachAttempt,
        /// Number of the task's target, from 0.
        target_idx: u32,
    },
    /// The jaws closed on a target, from wide open.
    Touch {
        /// Number of the task's target, from 0.
        target_idx: u32,
    },
    /// A phase began at `start`.
    Phase(Phase),
}

/// A span `start..=end` by the joint sensors' clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// First instant.
    pub start: Stamp,
    /// Last instant, not before `start`.
    pub end: Stamp,
    /// What was done in it.
    pub kind: MarkKind,
}

/// Severity of a log line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// Of use to developers alone.
    Debug,
    /// The normal course of things.
    Info,
    /// Unexpected; the run goes on.
    Warn,
    /// Something failed.
    Error,
}

/// A line of text for people.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLine {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Severity.
    pub level: LogLevel,
    /// Part of the program that says it.
    pub name: String,
    /// The message itself.
    pub text: String,
}
