//! Reasons why a calibration is refused: cause, evidence and remedy as data. Only `words` puts them into words.

pub(crate) use crate::say::constants::refusal::MIN_USED_SHARE;
use std::fmt;

use armcal_core::codes::{Code, Coded};
use armcal_core::kinematics::JointKind;
use armcal_core::numeric::Outcome;
use armcal_core::robot::FailedKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::say::finding::FindingUnit;
use crate::say::geometry_error::GeometryError;
use crate::say::moved_body::MovedBody;
use crate::say::reading_error::MisreadReadings;
use crate::say::wrong_input::WrongInput;

mod remedies;
pub(crate) mod words;

/// One reason for a refusal. Angles in rad, lengths in m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "cause", rename_all = "snake_case")]
pub enum Refusal {
    /// Fewer fitted views than gains and offsets to estimate.
    TooFewViews {
        /// Fitted views that show a tag.
        views: usize,
        /// Gains and offsets of the sensors that move the camera.
        parameters: usize,
    },
    /// The solver did not converge.
    NotSolved {
        /// Outcome of the solver: stalled or degenerate.
        outcome: Outcome,
        /// Number of steps or evaluations until the solver stopped.
        #[serde(default)]
        evaluations: usize,
    },
    /// Fewer held-out views than a verdict needs.
    TooFewHeldOutViews {
        /// Held-out views that show a tag.
        views: usize,
        /// Least number of views for a verdict.
        needed: usize,
    },
    /// No held-out view shows a usable tag.
    NoHeldOutTag,
    /// Held-out views fit no better than with the datasheet's sensors.
    NoBetterThanDatasheet {
        /// Root mean square distance between predicted and surveyed tags.
        held_out_m: f64,
        /// Root mean square distance with the datasheet's sensors.
        datasheet_m: f64,
    },
    /// Held-out views fit no better, beyond chance, than a baseline: the datasheet's sensors, with mount and map
    /// fitted.
    NoBetterThanBaseline {
        /// Position error of the tags in held-out views.
        held_out_m: f64,
        /// Position error of the tags in held-out views with only mount and map fitted.
        baseline_m: f64,
        /// Probability of at least this improvement by chance.
        p_value: f64,
    },
    /// Held-out views fit much worse than fitted ones.
    Overfitted {
        /// Root mean square distance between predicted and surveyed tags.
        held_out_m: f64,
        /// Root mean square distance in the fitted views.
        fit_m: f64,
    },
    /// The tool error due to the uncertainty of the recording alone exceeds the tolerance with more than 5 %
    /// probability.
    BeyondTolerance {
        /// Number of the target with the highest probability, from 1.
        target: usize,
        /// Probability of exceeding the tolerance at that target.
        probability: f64,
        /// U95 at that target: radius that holds the tool error with 95 % probability.
        u95_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
        /// Keys of robot.toml whose sigmas cause most of the tool error: no view constrains the values that they state.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        survey: Vec<String>,
        /// True if the camera stands still.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        is_watched: bool,
    },
    /// Stated sigmas of unobservable parameters make the tool error exceed the tolerance.
    PriorsBeyondTolerance {
        /// Number of the target with the highest probability, from 1.
        target: usize,
        /// Probability of exceeding the tolerance at that target.
        probability: f64,
        /// U95 at that target: radius that holds the tool error with 95 % probability.
        u95_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
        /// The parameter with the largest part of the tool error.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        most: Option<String>,
    },
    /// Targets of the task that cannot be judged.
    TargetsNotJudged {
        /// Numbers of these targets, from 1.
        targets: Vec<usize>,
    },
    /// Targets that need angles far beyond the captured views.
    TargetsNotCovered {
        /// Numbers of these targets, from 1.
        targets: Vec<usize>,
        /// For each joint concerned, its captured range and the excess, in words.
        ranges: Vec<String>,
    },
    /// Held-out positions or poses have larger errors than their stated noise explains, or than the limit without a
    /// stated one.
    HeldOutError {
        /// Root mean square distance between predicted and surveyed tags.
        held_out_m: f64,
        /// Largest accepted distance.
        limit_m: f64,
        /// Source of the limit.
        source: HeldOutLimitSource,
    },
    /// Rotations of recorded poses contradict the positions and the joints.
    RotationNoise {
        /// Noise of the rotations as fitted, one sigma.
        rotation_rad: f64,
        /// Largest accepted noise.
        limit_rad: f64,
        /// The noise that the input map states.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stated_rad: Option<f64>,
    },
    /// A file does not hold what it should, and the images show it without the arm.
    WrongInput(WrongInput),
    /// Joint readings do not mean what the input map and robot.toml say.
    MisreadReadings(MisreadReadings),
    /// Camera, base or tags moved while the views were captured.
    MovedBetweenViews {
        /// The body that moved.
        body: MovedBody,
        /// Name of the camera; absent where there is only one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        camera: Option<String>,
        /// Numbers of the last view before the motion and of the first view after it.
        views: [u32; 2],
        /// Shift of the body; for a base or tags, at the origin of the tag map's frame.
        shift_m: f64,
        /// Rotation angle of the body.
        turn_rad: f64,
    },
    /// Another link geometry explains the data, and joint sensors do not.
    Geometry(GeometryError),
    /// An element of the geometry departs from its nominal pose by more than a repair may.
    RepairTooLarge {
        /// The link, mount or base that departs.
        element: String,
        /// The estimated departure, in `unit`.
        size: f64,
        /// Unit of `size`: metres or radians.
        unit: FindingUnit,
        /// One sigma of the nominal pose, stated or the default.
        stated_std: f64,
        /// Largest repair, in multiples of `stated_std`.
        most_sigmas: f64,
        /// Length of the link; absent where the departure does not exceed it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        length_m: Option<f64>,
    },
    /// The size of one tag, or of all, differs from the tag map's by more than a repair may.
    TagSizeRepair {
        /// The tag with the other size, or `all`.
        element: String,
        /// Estimated size over the stated one.
        ratio: f64,
        /// Stated size of that tag, or of the first tag, m.
        stated_m: f64,
    },
    /// The focal length differs from the stated one by more than a repair may.
    Lens {
        /// Name of the camera; `None` for the first one.
        camera: Option<String>,
        /// Estimated focal length over that of robot.toml.
        ratio: f64,
        /// One sigma of `ratio`.
        std: f64,
        /// One sigma of the stated focal length, relative.
        stated_std: f64,
        /// Largest repair, in multiples of `stated_std`.
        most_sigmas: f64,
        /// Estimated focal lengths along columns and rows, px.
        focal_px: [f64; 2],
    },
    /// A joint's error from view to view is beyond what such a sensor can have.
    SensorError {
        /// Name of the joint in the URDF.
        joint: String,
        /// One sigma from view to view, as fitted.
        std_rad: f64,
        /// The datasheet's linearity.
        datasheet_std_rad: f64,
        /// Kind of the joint; the figures of a slide are in m, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
    },
    /// Sensors' offsets walk at random, and their walk after the views exceeds the task's tolerance.
    OffsetsWalk {
        /// Name of the joint with the largest walk.
        joint: String,
        /// One sigma of its walk from the first view to the last.
        walked_rad: f64,
        /// Kind of the joint; the figures of a slide are in m, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
        /// U95 at the worst target, including as large a walk again.
        u95_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
    },
    /// A joint's readings are in a unit other than the input map says.
    SensorUnit {
        /// Name of the joint in the URDF.
        joint: String,
        /// Angle, or way of a slide, over reading.
        gain: f64,
        /// Kind of the joint: turns or slides.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
        /// `factor` of the input map with that gain; absent: readings are counts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        input_factor: Option<f64>,
    },
    /// A sensor departs farther from a straight line than one of its datasheet can.
    Nonlinearity {
        /// Name of the joint.
        joint: String,
        /// One sigma of the nonlinearity, as fitted.
        std_rad: f64,
        /// Linearity in the datasheet.
        datasheet_std_rad: f64,
        /// Kind of the joint; the figures of a slide are in m, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
    },
    /// Corner residuals are larger than the stated noise explains.
    CornerNoise {
        /// Residual of corners averaged over a view.
        residual_px: f64,
        /// Noise of one frame, from robot.toml.
        stated_px: f64,
        /// Largest accepted residual.
        limit_px: f64,
    },
    /// Most observations do not fit under the stated corner noise; nearly all fit under a larger one.
    CornerNoiseUnderstated {
        /// Residual of corners averaged over a view, with the larger noise.
        residual_px: f64,
        /// Noise of one frame, from robot.toml.
        stated_px: f64,
        /// Number of tag observations that are rejected under the stated noise.
        outliers: usize,
        /// Number of all tag observations.
        observations: usize,
    },
    /// A gain or offset that no sensor of this datasheet has.
    BeyondDatasheet {
        /// Name of the parameter: `shoulder_yaw gain`.
        parameter: String,
        /// Distance from the datasheet in its prior's standard deviations.
        sigmas: f64,
        /// Estimated departure: relative for a gain; for an offset in rad, of a slide in m.
        off: f64,
        /// Unit of `off`: share, radians or metres.
        unit: FindingUnit,
    },
    /// Too many tag observations do not fit.
    Outliers {
        /// Number of rejected tag observations.
        outliers: usize,
        /// Number of all tag observations.
        observations: usize,
    },
    /// The errors of predicted held-out views exceed the uncertainty of the estimate.
    Innovations {
        /// Quantity whose innovations are tested.
        quantity: InnovationQuantity,
        /// Chi-square over its degrees of freedom; 1 is expected.
        per_dof: f64,
        /// Largest `per_dof` without a warning.
        limit: f64,
        /// Range of `per_dof` in 95 % of cases, by chance alone.
        expected: [f64; 2],
    },
    /// The tool touched surveyed surfaces at other places than predicted.
    Touch {
        /// Error along the normal of the surface with the largest error; positive points out of it.
        off_m: f64,
        /// Name of that surface.
        surface: String,
        /// Chi-square of all touches together.
        chi2: f64,
        /// Largest `chi2` that does not refuse.
        limit: f64,
        /// Causes that explain the touches about equally well.
        causes: Vec<String>,
        /// The link that carries the tool.
        link: String,
        /// Shift from the nominal tool point to the one that explains the touches best, axes of `link`.
        tool_point_m: [f64; 3],
    },
    /// A measured length and the views contradict each other.
    Length {
        /// The measured length, in words.
        what: String,
        /// The key that states the length.
        key: String,
        /// Length as stated.
        measured_m: f64,
        /// Length from the views and all other data.
        by_views_m: f64,
        /// One sigma of the difference.
        std_m: f64,
    },
    /// The prior was made from the same messages.
    PriorReused,
    /// The prior's covariance has no inverse.
    PriorSingular,
    /// The views determine too little to be tested against the prior.
    PriorUntested,
    /// Prior and views cannot both be right.
    PriorContradicted {
        /// The joint with the largest error in units of its own sigma.
        joint: String,
        /// Mean angle difference over the views; positive if the new views put the joint's angle above the prior's.
        off_rad: f64,
        /// One sigma of `off_rad`.
        off_std_rad: f64,
        /// Kind of the joint; the figures of a slide are in m, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
        /// Square of the estimate's move from the prior under its covariance.
        chi2: f64,
        /// Number of directions that the views determine well enough to test.
        degrees_of_freedom: usize,
        /// The 0.999 quantile of `chi2`.
        limit: f64,
        /// Share of observations that fit near the prior.
        used_share: f64,
        /// Number of joints whose errors are larger than chance explains.
        #[serde(default)]
        joints_off: usize,
        /// Motion of the camera since the prior; absent unless it alone explains the contradiction.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        camera_moved: Option<CameraMoved>,
    },
    /// A sensor slipped, and too few views show it after the slip.
    TooFewViewsSinceSlip {
        /// Name of the joint in the URDF.
        joint: String,
        /// Evidence of the slip, in words.
        evidence: String,
        /// Number of views since the slip.
        views: usize,
    },
    /// A sensor slipped during the capture, and the method does not model steps.
    SlipNotEstimated {
        /// Name of the joint in the URDF.
        joint: String,
        /// Evidence of the slip, in words.
        evidence: String,
    },
    /// A sensor is reversed or has another scale, and the other data do not fit with its gain estimated.
    SensorLine {
        /// Name of the joint.
        joint: String,
        /// Slope of the angle by the reading; 1 by the datasheet.
        slope: f64,
        /// `factor` of the input map with that slope; absent: readings are counts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        input_factor: Option<f64>,
    },
    /// A sensor failed, and the task needs its joint.
    SensorFailed {
        /// Name of the joint in the URDF.
        joint: String,
        /// Failure of the sensor.
        kind: FailedKind,
        /// Number of the first view with the failure; absent where all views have it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        since_view: Option<u32>,
        /// Tool error without the sensor, 95th percentile over the task's targets; absent where nothing predicts it.
        tool_error_m: Option<f64>,
        /// Tool error while the camera shows the joint's angle, same percentile; absent where nothing predicts it.
        tool_error_by_camera_m: Option<f64>,
        /// The task's tolerance; absent without a task.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        tolerance_m: Option<f64>,
    },
}

/// Motion of a camera that was mounted again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CameraMoved {
    /// Shift of the camera.
    pub shift_m: f64,
    /// Rotation angle of the camera.
    pub turn_rad: f64,
}

/// Source of the limit of a held-out error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeldOutLimitSource {
    /// The noise that the input map states.
    StatedNoise,
    /// The task's tolerance, where no noise is stated.
    Tolerance,
    /// 1 % of the arm's reach, where neither is given.
    Reach,
}

/// Quantity whose held-out innovations are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InnovationQuantity {
    /// Camera poses, six numbers per view.
    CameraPoses,
    /// All measured coordinates.
    Coordinates,
}

impl InnovationQuantity {
    /// Name of the quantity in sentences.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraPoses => "held-out camera poses",
            Self::Coordinates => "held-out coordinates",
        }
    }
}

impl Refusal {
    /// Returns true if the reason concerns the data themselves, so that it precedes results of their fit.
    #[must_use]
    pub fn is_about_data(&self) -> bool {
        matches!(self, Self::TooFewViews { .. } | Self::NotSolved { .. } | Self::TooFewViewsSinceSlip { .. })
    }

    /// Rank in the order of reasons, ascending: a cause comes before its consequences. Equal ranks keep their order.
    pub(crate) fn rank(&self) -> u8 {
        match self {
            // A wrong file or a motion explains why few views are left.
            Self::WrongInput(_) | Self::MovedBetweenViews { .. } => 0,
            Self::TooFewViews { .. } | Self::TooFewViewsSinceSlip { .. } => 1,
            Self::MisreadReadings(_) | Self::Lens { .. } | Self::PriorReused => 2,
            // Under a wrong prior, links and sensors seem to have errors.
            Self::PriorContradicted { .. } => 3,
            // Where hardly any observation fits, the solver's outcome and all tests of the rest mean nothing.
            Self::Outliers { outliers, observations } if 2 * outliers > *observations => 4,
            Self::CornerNoiseUnderstated { .. } => 4,
            // Another scale imitates errors of offsets and links.
            Self::SensorLine { .. } | Self::SensorUnit { .. } => 5,
            _ => 6,
        }
    }

    /// Returns true for a wrong file or reading, or a motion, that causes the further reasons: their advice is moot.
    fn explains_others(&self) -> bool {
        matches!(
            self,
            Self::WrongInput(_) | Self::MisreadReadings(_) | Self::MovedBetweenViews { .. } | Self::Lens { .. }
        )
    }
}

/// Returns the refusals whose advice counts: all, or only the first one where it explains the others.
#[must_use]
pub fn with_advice(refusals: &[Refusal]) -> &[Refusal] {
    let explains = refusals.first().is_some_and(Refusal::explains_others);
    if explains { &refusals[..1] } else { refusals }
}

/// Cause, evidence, what to do next, and the code.
impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fmt_cause(f)?;
        write!(f, "; {} [{}]", self.remedy(), self.code())
    }
}

impl Coded for Refusal {
    fn code(&self) -> Code {
        match self {
            Self::TooFewViews { .. } => Code::TooFewViews,
            Self::NotSolved { .. } => Code::NotSolved,
            Self::TooFewHeldOutViews { .. } => Code::TooFewHeldOutViews,
            Self::NoHeldOutTag => Code::NoHeldOutTag,
            Self::NoBetterThanDatasheet { .. } => Code::NoBetterThanDatasheet,
            Self::NoBetterThanBaseline { .. } => Code::NoBetterThanBaseline,
            Self::Overfitted { .. } => Code::Overfitted,
            Self::BeyondTolerance { .. } => Code::BeyondTolerance,
            Self::TargetsNotJudged { .. } => Code::TargetsNotJudged,
            Self::TargetsNotCovered { .. } => Code::TargetsNotCovered,
            Self::HeldOutError { .. } => Code::HeldOutError,
            Self::PriorsBeyondTolerance { .. } => Code::PriorsBeyondTolerance,
            Self::WrongInput(wrong) => wrong.code(),
            Self::MisreadReadings(misread) => misread.code(),
            Self::MovedBetweenViews { .. } => Code::MovedBetweenViews,
            Self::Geometry(_) => Code::GeometryContradicted,
            Self::RepairTooLarge { .. } | Self::TagSizeRepair { .. } => Code::RepairTooLarge,
            Self::Lens { .. } => Code::LensContradicted,
            Self::SensorUnit { .. } => Code::SensorUnit,
            Self::RotationNoise { .. } => Code::RotationNoise,
            Self::SensorError { .. } => Code::SensorError,
            Self::OffsetsWalk { .. } => Code::OffsetsWalk,
            Self::Nonlinearity { .. } => Code::Nonlinearity,
            Self::CornerNoise { .. } | Self::CornerNoiseUnderstated { .. } => Code::CornerNoise,
            Self::BeyondDatasheet { .. } => Code::BeyondDatasheet,
            Self::Outliers { .. } => Code::TooManyOutliers,
            Self::Innovations { .. } => Code::Innovations,
            Self::Touch { .. } => Code::TouchContradicted,
            Self::Length { .. } => Code::LengthContradicted,
            Self::PriorReused => Code::PriorReused,
            Self::PriorSingular => Code::PriorSingular,
            Self::PriorUntested => Code::PriorUntested,
            Self::PriorContradicted { .. } => Code::PriorContradicted,
            Self::TooFewViewsSinceSlip { .. } => Code::TooFewViewsSinceSlip,
            Self::SlipNotEstimated { .. } => Code::SlipNotEstimated,
            Self::SensorLine { .. } => Code::SensorLine,
            Self::SensorFailed { .. } => Code::SensorNeeded,
        }
    }
}

/// Refusals in files: code, sentence and evidence.
pub mod in_files {
    use super::{Code, Coded, Refusal};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize)]
    struct Entry<'a> {
        code: Code,
        text: String,
        #[serde(flatten)]
        evidence: &'a Refusal,
    }

    /// Writes code, text and evidence of each refusal.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn serialize<S: Serializer>(refusals: &[Refusal], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(refusals.iter().map(|evidence| {
            let text = format!("{}; {}", evidence.cause(), evidence.remedy());
            Entry { code: evidence.code(), text, evidence }
        }))
    }

    /// Reads the evidence; code and text follow from it.
    ///
    /// # Errors
    /// Errors of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Refusal>, D::Error> {
        Vec::deserialize(deserializer)
    }
}

#[cfg(test)]
mod tests;
