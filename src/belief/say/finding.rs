//! Differences that a calibration found from robot.toml, survey and nominal model (URDF).

use armcal_core::codes::{Code, Coded};
use armcal_core::kinematics::JointKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One finding; a repaired one does not refuse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    /// Cause; written as its code in files.
    #[serde(rename = "code")]
    pub kind: FindingKind,
    /// Joint, tag id or link.
    pub name: String,
    /// Size in `unit`; absent where the finding has no size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    /// Unit of `size`; absent where the finding has no size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<FindingUnit>,
    /// Tool error, root mean square over the task, m; absent where it was not predicted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_m: Option<f64>,
    /// Time of the event, s since the first view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// True if the estimate takes account of the finding.
    pub repaired: bool,
}

/// Kind of a difference from the stated values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// A surveyed tag; the size is its distance from the survey.
    TagMoved,
    /// Tags that were moved together; the size is their median distance from the survey.
    TagsMoved,
    /// A tag of another size than the survey's; the size is the relative difference.
    TagSize,
    /// Tags with one another's ids: two, or more in a ring.
    TagSwapped,
    /// A tag without any observation that fits the others; the size is the number of its observations.
    TagLeftOut,
    /// A lens that differs from robot.toml; the size is the relative error of its focal length.
    Lens,
    /// The lens is of the other model: a fisheye called a pinhole, or the other way round.
    LensModel,
    /// A link whose length or twist differs from the nominal model (URDF).
    Link,
    /// A joint or the base's mount that gives under the arm's weight, or a load at the tool: the size is its compliance
    /// or the load.
    Sag,
    /// A camera mount that differs from its nominal pose beyond its prior.
    CameraMount,
    /// The base, or all tags together, displaced from the survey.
    Base,
    /// The tool point or links distal to the camera, by touches of surveyed surfaces.
    Tool,
    /// A sensor that slipped on its shaft; the size is the step.
    SensorSlip,
    /// A sensor that reads the other way; the size is the slope of the angle by the reading.
    SensorReversed,
    /// A sensor of another scale than its datasheet's; the size is the slope of the angle by the reading.
    SensorScale,
    /// A joint or sensor that failed otherwise.
    SensorFailed,
    /// A sensor with more error from view to view than its datasheet allows; the size is one sigma.
    SensorWorn,
    /// A gain or offset that few sensors of the datasheet have; the size is its departure from the datasheet.
    SensorUnusual,
    /// A sensor whose offset walks at random; the size is one sigma over the views.
    OffsetWalks,
    /// Tag observations that the fit rejected; the size is their number.
    Outliers,
}

impl Coded for FindingKind {
    fn code(&self) -> Code {
        match self {
            Self::TagMoved => Code::TagMoved,
            Self::TagsMoved => Code::TagsMoved,
            Self::TagSize => Code::TagSize,
            Self::TagSwapped => Code::TagSwapped,
            Self::TagLeftOut => Code::TagLeftOut,
            Self::Lens | Self::LensModel => Code::Lens,
            Self::Link => Code::Link,
            Self::Sag => Code::Sag,
            Self::CameraMount => Code::CameraMount,
            Self::Base => Code::Base,
            Self::Tool => Code::Tool,
            Self::SensorSlip => Code::SensorSlip,
            Self::SensorReversed => Code::SensorReversed,
            Self::SensorScale => Code::SensorScale,
            Self::SensorFailed => Code::SensorFailed,
            Self::SensorWorn => Code::SensorWorn,
            Self::SensorUnusual => Code::SensorUnusual,
            Self::OffsetWalks => Code::OffsetWalks,
            Self::Outliers => Code::Outliers,
        }
    }
}

impl Coded for Finding {
    fn code(&self) -> Code {
        self.kind.code()
    }
}

/// Unit of a finding's size: SI, or 1 for plain numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum FindingUnit {
    /// Metre, for lengths.
    #[serde(rename = "m")]
    Metre,
    /// Radian, for angles.
    #[serde(rename = "rad")]
    Radian,
    /// One, for counts and ratios.
    #[serde(rename = "1")]
    One,
    /// Radian per newton metre, for compliances of joints and mounts.
    #[serde(rename = "rad/(N m)")]
    RadianPerNewtonMetre,
    /// Metre per newton, for compliances of slides.
    #[serde(rename = "m/N")]
    MetrePerNewton,
    /// Newton, for loads.
    #[serde(rename = "N")]
    Newton,
}

impl FindingUnit {
    /// Unit of a joint's coordinate: metre for a slide, else radian.
    #[must_use]
    pub fn of_joint(kind: JointKind) -> Self {
        if kind.is_slide() { Self::Metre } else { Self::Radian }
    }
}
