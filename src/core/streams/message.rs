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
    /// Joint angles in radians, under the estimate of that moment.
    JointStates(JointStateBelief),
    /// AprilTags seen in one camera image.
    Detections(TagDetections),
    /// Candidates in one camera image that the detector rejected.
    Rejects(DetectionRejects),
    /// One camera image, compressed.
    Image(CameraImage),
    /// Temperature of oil or water.
    Temperature(TemperatureSample),
    /// Pressure at the depth sensor.
    Pressure(PressureSample),
    /// The vehicle's attitude sensor.
    Attitude(Attitude),
    /// Measured opening of the gripper.
    Gripper(GripperSample),
    /// Commanded opening of the gripper.
    GripperCommand(GripperCommand),
    /// Task that the arm is calibrated for.
    Task(ReachTask),
    /// Poses of the tags, if the vehicle states them instead of the robot's file.
    Survey(RecordedSurvey),
    /// Contact of the tool with a surveyed surface.
    Touch(ToolTouch),
    /// A span of the recording with a meaning.
    Mark(Mark),
    /// A line of text for people.
    Log(LogLine),
}

/// Raw readings of all joints at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSensorSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Raw readings, one per joint, base first.
    pub counts: JointCounts,
}

/// Set-points in raw counts: the arm's own controller closes its loop on its own sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct JointCommand {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Raw set-points, one per joint, base first.
    pub counts: JointCounts,
}

/// Angles of all joints under the estimate of the moment.
#[derive(Clone, Debug, PartialEq)]
pub struct JointStateBelief {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Angles, one per joint, base first, rad.
    pub angles: JointAngles,
}

/// All tags detected in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct TagDetections {
    /// Time of the exposure.
    pub stamp: Stamp,
    /// Tags in the detector's order; empty if it detected none.
    pub tags: Vec<TagDetection>,
}

/// Detection of one tag in one image. Corners are in raw (distorted) pixels: bottom left, bottom right, top right, top
/// left as printed. In the tag's frame they are (-s/2, -s/2), (s/2, -s/2), (s/2, s/2), (-s/2, s/2).
#[derive(Clone, Debug, PartialEq)]
pub struct TagDetection {
    /// Number in the family of the arm's tags.
    pub id: u32,
    /// Corners, px; [`TagDetection`] gives their order and frame.
    pub corners_px: [[f64; 2]; 4],
    /// Decision margin of the detector, as apriltag gives it; a larger one is more certain.
    pub decision_margin: f64,
}

/// Reason why a detector rejected a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RejectReason {
    /// More bits are wrong than the code may have corrected.
    WrongBits,
    /// The grey levels of black and white are too similar.
    LowContrast,
    /// The sides are too short in the image.
    TooSmall,
    /// The image near the edges is not that of a square tag.
    PoorEdges,
    /// The same id appears twice in one image, so neither detection can be trusted.
    SeenTwice,
    /// A corner has no bearing in the lens model, or lies outside the image.
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

    /// Returns the name that recordings use.
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

/// A candidate that resembles a tag and was rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionReject {
    /// Decoded id, right or wrong.
    pub id: u32,
    /// Corners, px, in the order of [`TagDetection`].
    pub corners_px: [[f64; 2]; 4],
    /// First check that the candidate failed.
    pub reason: RejectReason,
}

/// Rejected candidates of one image.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionRejects {
    /// Time of the exposure.
    pub stamp: Stamp,
    /// Candidates in the detector's order.
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

/// Quantity that a thermometer measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Thermometer {
    /// Hydraulic oil of the arm.
    Oil,
    /// Sea water around the vehicle.
    Water,
}

/// A reading of a thermometer.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// The measured medium.
    pub thermometer: Thermometer,
    /// Degrees Celsius.
    pub temperature_c: f64,
    /// Variance of a reading; 0 if it is unknown.
    pub variance_c2: f64,
}

/// A reading of the depth sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct PressureSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Absolute pressure.
    pub pressure_pa: f64,
    /// Variance of a reading; 0 if it is unknown.
    pub variance_pa2: f64,
}

/// Attitude of the vehicle in the world, with its body rates and specific force, as an IMU gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitude {
    /// Sender's clock.
    pub stamp: Stamp,
    /// `world_from_vehicle`, unit.
    pub quaternion_wxyz: [f64; 4],
    /// Angular velocity in the vehicle's axes.
    pub angular_velocity_rad_s: [f64; 3],
    /// Specific force in the vehicle's axes, +g upwards at rest.
    pub specific_force_m_s2: [f64; 3],
}

/// The gap between the jaws, 0 where they meet.
#[derive(Clone, Debug, PartialEq)]
pub struct GripperSample {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Measured gap.
    pub opening_m: f64,
}

/// The commanded gap between the jaws.
#[derive(Clone, Debug, PartialEq)]
pub struct GripperCommand {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Commanded gap.
    pub opening_m: f64,
}

/// Positions that the tool is to reach, in the base frame, and the distance that counts as a hit.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachTask {
    /// Sender's clock.
    pub stamp: Stamp,
    /// Targets in the order in which marks number them, base frame, m.
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

/// Tags as surveyed before the dive, which the estimator takes as known.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedSurvey {
    /// Sender's clock.
    pub stamp: Stamp,
    /// The link that carries the tags in front of a stationary camera; the tags are in its frame. `None`: the base's
    /// link.
    pub link: Option<String>,
    /// Id of the tag next to the base; one of `tags`.
    pub base_tag: u32,
    /// Surveyed tags, each id once.
    pub tags: Vec<RecordedTag>,
}

/// A surveyed tag: its pose in the survey's frame as plain numbers, so that a file returns exactly what it was given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedTag {
    /// Number in the family of the arm's tags.
    pub id: u32,
    /// Side of the black square.
    pub size_m: f64,
    /// Origin of the tag in the survey's frame.
    pub position_m: [f64; 3],
    /// Orientation of the tag's axes in the survey's frame, unit quaternion.
    pub quaternion_wxyz: [f64; 4],
    /// Standard deviation per axis. Infinite, like the rotation's, if only the tag's size is known; the pose is then
    /// the identity.
    pub position_std_m: f64,
    /// Standard deviation of the rotation, per axis like the position's.
    pub rotation_std_rad: f64,
}

/// Contact of the tool's tip with a surveyed plane, felt by the arm or its pilot.
/// `normal . (tool - point) = tip_radius` holds within one standard deviation, by the joint sensors' readings from
/// `stamp` on for `duration_s`.
///
/// A tip in a socket is three contacts with normals at right angles and no radius.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolTouch {
    /// Start of the contact.
    pub stamp: Stamp,
    /// Duration of the contact.
    pub duration_s: f64,
    /// Name of the surface, for people.
    pub surface: String,
    /// Any point of the plane, base frame.
    pub point_m: [f64; 3],
    /// Unit normal out of the surface, base frame.
    pub normal: [f64; 3],
    /// Radius of a ball about the tool point; zero if the tip is the tool point.
    pub tip_radius_m: f64,
    /// Standard deviation along the normal: the surface's survey and the sense of contact.
    pub std_m: f64,
}

/// Share of the data that a captured view belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CaptureSet {
    /// The fit uses the view.
    Fit,
    /// The fit never sees the view; the verdict depends on it.
    HeldOut,
}

/// Prior that a calibration starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PriorSource {
    /// The datasheet.
    Fresh,
    /// The last accepted calibration of the same recording; it keeps the values that the new views do not determine.
    Warm,
}

/// Sensor models under which the tool went to a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReachAttempt {
    /// The datasheet's sensor models.
    Before,
    /// Calibrated sensor models.
    After,
}

/// Activity of the arm, for people who watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Planning of paths and views.
    Plan,
    /// Motion along a path.
    Move,
    /// Wait for the arm to come to rest.
    Settle,
    /// Recording of a view at rest.
    Capture,
    /// Estimation of the sensors.
    Calibrate,
    /// Motion to a target of the task.
    Reach,
    /// Rest of the arm while the world goes on.
    Wait,
    /// End of the script.
    Done,
}

/// Purpose of a span of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MarkKind {
    /// The arm stood still over the mark's span: detections and readings in it belong together.
    Capture {
        /// Set that the view belongs to: fitted or held out.
        set: CaptureSet,
        /// Number of the view in the recording, from 0.
        pose_idx: u32,
    },
    /// The arm stood still; since the first such view of `joint_idx` no other joint was commanded to move. The camera's
    /// rotation against the readings then measures the sensor's scale.
    Identify {
        /// Index of the joint, base first.
        joint_idx: u32,
    },
    /// The joint stood at one of its nominal end stops, whose nominal angle is given.
    Stop {
        /// Index of the joint, base first.
        joint_idx: u32,
        /// Nominal angle of the stop.
        angle_rad: f64,
    },
    /// Somebody declared that this joint or its sensor has failed; it applies to the whole recording.
    Failed(FailedJoint),
    /// A calibration from the views captured within the span.
    Calibrate(PriorSource),
    /// The arm came to rest for a target.
    Reach {
        /// Sensor models under which the arm moved.
        attempt: ReachAttempt,
        /// Number of the task's target, from 0.
        target_idx: u32,
    },
    /// The jaws closed on a target, starting wide open.
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
    /// First instant of the span.
    pub start: Stamp,
    /// Last instant of the span, not before `start`.
    pub end: Stamp,
    /// Purpose of the span.
    pub kind: MarkKind,
}

/// Severity of a log line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// Useful to developers only.
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
    /// Part of the program that writes the line.
    pub name: String,
    /// The message itself.
    pub text: String,
}
