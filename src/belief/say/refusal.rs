//! Why a calibration is refused: cause, evidence and remedy as data. Their words are made in `words` and nowhere else.

pub(crate) use crate::say::constants::refusal::MIN_USED_SHARE;
use std::borrow::Cow;
use std::fmt;

use armcal_core::codes::{Code, Coded};
use armcal_core::kinematics::JointKind;
use armcal_core::numeric::Outcome;
use armcal_core::robot::FailedKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::say::finding::FindingUnit;
use crate::say::geometry_error::GeometryError;
use crate::say::length_unit::unit_of;
use crate::say::moved_body::MovedBody;
use crate::say::reading_error::MisreadReadings;
use crate::say::sensor_keys::Rescaled;
use crate::say::wrong_input::WrongInput;

pub(crate) mod words;

/// One reason to refuse. Angles in rad, lengths in m.
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
        /// Stalled or degenerate.
        outcome: Outcome,
        /// Steps or evaluations until then.
        #[serde(default)]
        evaluations: usize,
    },
    /// Fewer held-out views than a verdict needs.
    TooFewHeldOutViews {
        /// Held-out views that show a tag.
        views: usize,
        /// The fewest that are enough.
        needed: usize,
    },
    /// No held-out view shows a usable tag.
    NoHeldOutTag,
    /// Held-out views fit no better than with the datasheet's sensors.
    NoBetterThanDatasheet {
        /// Root mean square distance between predicted and surveyed tags.
        held_out_m: f64,
        /// The same with the datasheet's sensors.
        datasheet_m: f64,
    },
    /// Held-out views fit no better, beyond chance, than with mount and map fitted and the datasheet's sensors.
    NoBetterThanBaseline {
        /// Position error of the tags in held-out views.
        held_out_m: f64,
        /// The same with mount and map alone.
        baseline_m: f64,
        /// Probability of as large an improvement where there is none.
        p_value: f64,
    },
    /// Held-out views fit much worse than fitted ones.
    Overfitted {
        /// Root mean square distance between predicted and surveyed tags.
        held_out_m: f64,
        /// The same of the fitted views.
        fit_m: f64,
    },
    /// The tool error, by the recording alone, exceeds the tolerance with more than 5 % probability.
    BeyondTolerance {
        /// Number of the target where that is most likely, from 1.
        target: usize,
        /// Probability there.
        probability: f64,
        /// U95 there.
        u95_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
        /// Keys of robot.toml with the sigmas that are most of it: what they state no view tells.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        survey: Vec<String>,
        /// Whether the camera stands still.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        is_watched: bool,
    },
    /// Stated sigmas of unobservable parameters make it exceed the tolerance.
    PriorsBeyondTolerance {
        /// Number of the target where that is most likely, from 1.
        target: usize,
        /// Probability there.
        probability: f64,
        /// U95 there.
        u95_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
        /// The largest part of it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        most: Option<String>,
    },
    /// Targets of the task that cannot be judged.
    TargetsNotJudged {
        /// Their numbers, from 1.
        targets: Vec<usize>,
    },
    /// Targets that need angles far beyond the captured views.
    TargetsNotCovered {
        /// Their numbers, from 1.
        targets: Vec<usize>,
        /// Each joint concerned, its captured range and the excess, in words.
        ranges: Vec<String>,
    },
    /// Held-out positions or poses are off by more than their stated noise explains, or than may be without one.
    HeldOutError {
        /// Root mean square distance between predicted and surveyed tags.
        held_out_m: f64,
        /// The largest that is accepted.
        limit_m: f64,
        /// Source of the limit.
        source: HeldOutLimitSource,
    },
    /// Rotations of recorded poses contradict the positions and the joints.
    RotationNoise {
        /// Their noise as fitted, one sigma.
        rotation_rad: f64,
        /// The largest that is accepted.
        limit_rad: f64,
        /// The noise that the input map states.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stated_rad: Option<f64>,
    },
    /// A file is not as it is said to be, and the images show it without the arm.
    WrongInput(WrongInput),
    /// Joint readings mean something else than the input map and robot.toml say.
    MisreadReadings(MisreadReadings),
    /// Camera, base or tags moved while the views were captured.
    MovedBetweenViews {
        /// What moved.
        body: MovedBody,
        /// Name of the camera, where there are several.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        camera: Option<String>,
        /// Numbers of the last view before it and of the first one after it.
        views: [u32; 2],
        /// How far it moved; a base or tags at the origin of the frame of the tag map.
        shift_m: f64,
        /// By how much it turned.
        turn_rad: f64,
    },
    /// Another link geometry explains the data, and joint sensors do not.
    Geometry(GeometryError),
    /// An element of the geometry departs from its nominal pose by more than a repair may.
    RepairTooLarge {
        /// The link, mount or base.
        element: String,
        /// The estimated departure, in `unit`.
        size: f64,
        /// Metres or radians.
        unit: FindingUnit,
        /// One sigma, stated or the default.
        stated_std: f64,
        /// The largest repair in these sigmas.
        most_sigmas: f64,
        /// Length of the link, where the departure exceeds it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        length_m: Option<f64>,
    },
    /// The size of a tag, or of all, differs from the tag map's by more than a repair may.
    TagSizeRepair {
        /// The tag, or all.
        element: String,
        /// Estimated size over the stated one.
        ratio: f64,
        /// The stated one of the tag, or of the first, m.
        stated_m: f64,
    },
    /// The focal length differs from the stated one by more than a repair may.
    Lens {
        /// Name of the further camera; `None`: the first.
        camera: Option<String>,
        /// Estimated focal length over that of robot.toml.
        ratio: f64,
        /// One sigma of `ratio`.
        std: f64,
        /// One sigma of the stated focal length, as a share of it.
        stated_std: f64,
        /// The largest repair in these sigmas.
        most_sigmas: f64,
        /// As estimated, px.
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
        /// Whether the joint slides: figures are in m then, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
    },
    /// Sensors' offsets walk at random, and what they do after the views is more than the task tolerates.
    OffsetsWalk {
        /// Name of the joint whose offset walks most.
        joint: String,
        /// One sigma of its walk from the first view to the last.
        walked_rad: f64,
        /// Whether the joint slides: figures are in m then, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
        /// U95 at the worst target, with as much again.
        u95_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
    },
    /// A joint's readings are in another unit than the input map says.
    SensorUnit {
        /// Name of the joint in the URDF.
        joint: String,
        /// Angle or way over reading.
        gain: f64,
        /// Turns or slides.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
        /// `factor` of the input map with that gain; absent: readings are counts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        input_factor: Option<f64>,
    },
    /// A sensor is farther from a straight line than one of its datasheet can be.
    Nonlinearity {
        /// The joint's name.
        joint: String,
        /// Fitted size of the nonlinearity.
        std_rad: f64,
        /// Linearity by the datasheet.
        datasheet_std_rad: f64,
        /// Whether the joint slides: figures are in m then, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
    },
    /// Corners are farther off than the stated noise explains.
    CornerNoise {
        /// Of corners averaged over a view.
        residual_px: f64,
        /// Noise of one frame, by robot.toml.
        stated_px: f64,
        /// Largest residual that is accepted.
        limit_px: f64,
    },
    /// Under the stated corner noise most observations fit nothing, under a larger one nearly all do.
    CornerNoiseUnderstated {
        /// Residual of corners averaged over a view, with the larger noise.
        residual_px: f64,
        /// Of one frame, by robot.toml.
        stated_px: f64,
        /// Number of tag observations that are rejected under the stated noise.
        outliers: usize,
        /// Number of all.
        observations: usize,
    },
    /// A gain or offset that no sensor of this datasheet has.
    BeyondDatasheet {
        /// Name of the parameter: `shoulder_yaw gain`.
        parameter: String,
        /// Distance from the datasheet in its prior's standard deviations.
        sigmas: f64,
        /// Estimated departure: a share of a gain; an offset, rad, of a slide, m.
        off: f64,
        /// Share, radians or metres.
        unit: FindingUnit,
    },
    /// Too many tag observations do not fit.
    Outliers {
        /// Number of rejected tag observations.
        outliers: usize,
        /// Number of all.
        observations: usize,
    },
    /// Held-out views are predicted worse than the estimate says.
    Innovations {
        /// Which innovations.
        quantity: InnovationQuantity,
        /// Chi-square over its degrees of freedom; 1 is expected.
        per_dof: f64,
        /// Largest `per_dof` that is no warning.
        limit: f64,
        /// Range of `per_dof` in 95 % of cases, by chance alone.
        expected: [f64; 2],
    },
    /// The tool touched surveyed surfaces elsewhere than it was predicted to.
    Touch {
        /// Along the normal of the surface that is farthest off: positive is out of it.
        off_m: f64,
        /// That surface.
        surface: String,
        /// Of all touches together.
        chi2: f64,
        /// Largest `chi2` that is no reason.
        limit: f64,
        /// What explains it, alike.
        causes: Vec<String>,
        /// The link that carries the tool.
        link: String,
        /// From the drawn tool point to one that would explain it best, axes of `link`.
        tool_point_m: [f64; 3],
    },
    /// A measured length and the views contradict each other.
    Length {
        /// What was measured.
        what: String,
        /// The key that states it.
        key: String,
        /// As stated.
        measured_m: f64,
        /// By the views and all else.
        by_views_m: f64,
        /// One sigma of the difference.
        std_m: f64,
    },
    /// The prior rests on the same messages.
    PriorReused,
    /// The prior's covariance has no inverse.
    PriorSingular,
    /// The views determine too little to be tested against the prior.
    PriorUntested,
    /// Prior and views cannot both be right.
    PriorContradicted {
        /// The joint that is off the most in its own sigma.
        joint: String,
        /// Mean over the views; positive where the new views put its angle above the prior's.
        off_rad: f64,
        /// One sigma of `off_rad`.
        off_std_rad: f64,
        /// Whether the joint slides: figures are in m then, not in rad.
        #[serde(default, skip_serializing_if = "JointKind::is_turning")]
        moves: JointKind,
        /// Square of the estimate's move from the prior under its covariance.
        chi2: f64,
        /// Number of directions that the views tell enough of to be tested.
        degrees_of_freedom: usize,
        /// The 0.999 quantile of `chi2`.
        limit: f64,
        /// Share of the observations that fit anything near the prior.
        used_share: f64,
        /// How many joints are off by more than chance.
        #[serde(default)]
        joints_off: usize,
        /// How far the camera was moved since, where that alone explains it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        camera_moved: Option<CameraMoved>,
    },
    /// A sensor slipped, and too few views show it as it is now.
    TooFewViewsSinceSlip {
        /// Name of the joint in the URDF.
        joint: String,
        /// What shows the slip, in words.
        evidence: String,
        /// Views since the slip.
        views: usize,
    },
    /// A sensor slipped during the capture, and the method knows no step.
    SlipNotEstimated {
        /// Name of the joint in the URDF.
        joint: String,
        /// What shows the slip, in words.
        evidence: String,
    },
    /// A sensor that reads the other way, or of another scale, and the rest does not fit with its gain estimated.
    SensorLine {
        /// The joint.
        joint: String,
        /// Of the angle by the reading, 1 by the datasheet.
        slope: f64,
        /// `factor` of the input map with that slope; absent: readings are counts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        input_factor: Option<f64>,
    },
    /// A sensor failed whose joint the task needs.
    SensorFailed {
        /// Name of the joint in the URDF.
        joint: String,
        /// What is wrong with its sensor.
        kind: FailedKind,
        /// Number of the first view in which it is wrong; absent where all are.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        since_view: Option<u32>,
        /// Over the task's targets, 95th percentile, without the sensor; absent where nothing predicts it.
        tool_error_m: Option<f64>,
        /// The same while the camera shows the joint's angle.
        tool_error_by_camera_m: Option<f64>,
        /// The task's tolerance; absent without a task.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        tolerance_m: Option<f64>,
    },
}

/// A camera that was mounted anew.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CameraMoved {
    /// How far it was shifted.
    pub shift_m: f64,
    /// By how much it was turned.
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

/// Which innovations of held-out views are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InnovationQuantity {
    /// Poses of the cameras, six numbers a view.
    CameraPoses,
    /// All measured coordinates.
    Coordinates,
}

impl InnovationQuantity {
    /// As sentences call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CameraPoses => "held-out camera poses",
            Self::Coordinates => "held-out coordinates",
        }
    }
}

impl Refusal {
    /// Whether it is about the data themselves, so that it comes before what a fit of them shows.
    #[must_use]
    pub fn is_about_data(&self) -> bool {
        matches!(self, Self::TooFewViews { .. } | Self::NotSolved { .. } | Self::TooFewViewsSinceSlip { .. })
    }

    /// Which reason is told first: what makes all others a consequence. Those of one rank stay in their order.
    pub(crate) fn rank(&self) -> u8 {
        match self {
            // A wrong file or a motion explains why few views are left.
            Self::WrongInput(_) | Self::MovedBetweenViews { .. } => 0,
            Self::TooFewViews { .. } | Self::TooFewViewsSinceSlip { .. } => 1,
            Self::MisreadReadings(_) | Self::Lens { .. } | Self::PriorReused => 2,
            // Under a prior that does not hold, links and sensors seem to be off.
            Self::PriorContradicted { .. } => 3,
            // Where hardly any observation fits, the solver's end and every test of the rest say nothing.
            Self::Outliers { outliers, observations } if 2 * outliers > *observations => 4,
            Self::CornerNoiseUnderstated { .. } => 4,
            // Another scale makes offsets and links seem off.
            Self::SensorLine { .. } | Self::SensorUnit { .. } => 5,
            _ => 6,
        }
    }

    /// A wrong file or reading, or a motion, which the further reasons follow from: what they advise is moot.
    fn explains_others(&self) -> bool {
        matches!(
            self,
            Self::WrongInput(_) | Self::MisreadReadings(_) | Self::MovedBetweenViews { .. } | Self::Lens { .. }
        )
    }

    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> Cow<'static, str> {
        match self {
            Self::MisreadReadings(misread) => misread.remedy().into(),
            Self::WrongInput(wrong) => wrong.remedy(),
            Self::SensorLine { joint, slope, input_factor } => {
                let found = Rescaled { joint, slope: *slope, input_factor: *input_factor };
                remedy_of_line(found.with_own_scale_if_reversed()).into()
            }
            Self::SensorUnit { joint, gain, moves, input_factor } => {
                let found = Rescaled { joint, slope: *gain, input_factor: *input_factor };
                format!("convert the readings of {joint}, or {}", found.of_another_unit(*moves).line()).into()
            }
            Self::CornerNoiseUnderstated { residual_px, .. } => {
                format!("state corner_std_px = {residual_px:.2} in [camera] of robot.toml, or check lens and tag map")
                    .into()
            }
            Self::Lens { focal_px: [x, y], .. } => format!(
                "measure the intrinsics in the water or air that the arm works in; these views show focal_px = \
                 [{x:.1}, {y:.1}] for [camera] of robot.toml"
            )
            .into(),
            Self::BeyondTolerance { survey, is_watched, .. } if !survey.is_empty() => {
                let otherwise = if *is_watched { "" } else { ", or put a tag on the gripper" };
                let keys = survey.join(", ");
                format!("measure what no view tells and state its smaller sigma in robot.toml ({keys}){otherwise}")
                    .into()
            }
            _ => self.usual_remedy().into(),
        }
    }

    /// Advice without figures of this result.
    fn usual_remedy(&self) -> &'static str {
        match self {
            Self::MisreadReadings(_)
            | Self::WrongInput(_)
            | Self::Lens { .. }
            | Self::SensorLine { .. }
            | Self::SensorUnit { .. }
            | Self::CornerNoiseUnderstated { .. } => "",
            Self::MovedBetweenViews { body, .. } => body.remedy(),
            Self::TooFewViews { .. } | Self::PriorUntested | Self::BeyondTolerance { is_watched: true, .. } => {
                "capture more views"
            }
            Self::TooFewViewsSinceSlip { .. } => "fasten the sensor on its shaft, then capture more views",
            Self::SlipNotEstimated { .. } => {
                "fasten the sensor on its shaft, then calibrate with --method bundle, which estimates the slip, or \
                 capture anew"
            }
            Self::NotSolved { .. } => "capture views that move each joint over more of its range",
            Self::TooFewHeldOutViews { .. } | Self::NoHeldOutTag => "hold out more views that show tags",
            Self::NoBetterThanDatasheet { .. } | Self::NoBetterThanBaseline { .. } => {
                "keep the datasheet values, or check tag map, camera mount and time stamps"
            }
            Self::Overfitted { .. } => "capture more views at other configurations",
            Self::PriorsBeyondTolerance { most: Some(most), .. } if most.starts_with("tag survey") => {
                "measure the frame of the tags in the arm's base and state its sigmas in [geometry] of robot.toml, or \
                 touch three surveyed surfaces (step `touch`)"
            }
            Self::PriorsBeyondTolerance { most: Some(most), .. } if most.starts_with("camera mount") => {
                "measure where the camera is and state its smaller sigmas in [camera] of robot.toml (mount_std_m, \
                 mount_std_rad), or touch three surveyed surfaces (step `touch`)"
            }
            Self::PriorsBeyondTolerance { .. } => {
                "put a tag on the gripper, touch three surveyed surfaces (step `touch`), or measure the arm and state \
                 its sigmas in [geometry] of robot.toml"
            }
            Self::BeyondTolerance { .. } => "capture more views, or put a tag on the gripper",
            Self::TargetsNotJudged { .. } => "remove these targets from the task, or free the joints that they need",
            Self::TargetsNotCovered { .. } => "capture views that move these joints as far as the targets need",
            Self::HeldOutError { .. } => {
                "check units, rotation form, joint order and directions in the input map, and the tag map; state the \
                 noise with tags.position_std_m"
            }
            Self::Geometry(geometry) => geometry.remedy(),
            Self::RotationNoise { .. } => {
                "check rotation form, order and direction in the input map, or use the positions only (tags.use)"
            }
            Self::RepairTooLarge { .. } => {
                "check the zeros, order and units of the joint readings; then measure this element and correct its file"
            }
            Self::TagSizeRepair { .. } => "measure the border square of one tag and correct size_m, in metres",
            Self::CornerNoise { .. } => "check lens, corner noise and tag sizes in robot.toml, and the tag map",
            Self::SensorError { .. } | Self::SensorFailed { .. } => "check that joint's sensor",
            Self::Nonlinearity { .. } => "replace the sensor, or state its linearity in robot.toml",
            Self::OffsetsWalk { .. } => {
                "calibrate right before the work and again during it, follow the estimate online, or replace the sensor"
            }
            Self::BeyondDatasheet { .. } => "check joint and sensor, and robot.toml against the installed sensor",
            Self::Outliers { .. } => "check tag map, tag ids, the lens and the URDF",
            Self::Innovations { .. } => "look for what moved or warmed up during the capture",
            Self::Touch { .. } => {
                "measure the tool point ([tool] point_m of robot.toml), the links beyond the camera and the camera \
                 mount"
            }
            Self::Length { measured_m, by_views_m, .. } if unit_of(measured_m / by_views_m).is_some() => {
                "write this length in metres"
            }
            Self::Length { .. } => "measure again, and correct this length or the tags' size_m in robot.toml",
            Self::PriorReused => "give a prior that was made from other views",
            Self::PriorSingular => "make the prior again",
            Self::PriorContradicted { camera_moved: Some(_), .. } => {
                "put the camera back, or calibrate without --prior from as many views as the first time"
            }
            Self::PriorContradicted { .. } => "calibrate without --prior",
        }
    }
}

/// Advice for a sensor that is reversed or of another scale.
fn remedy_of_line(found: Rescaled<'_>) -> String {
    let (joint, line) = (found.joint, found.line());
    match (found.slope, found.input_factor) {
        (-1.0, None) => "swap its ends, or change the sign of its scale in robot.toml".to_owned(),
        (-1.0, Some(_)) => format!("swap its ends, or {line}"),
        _ => format!("correct the scale of {joint}: {line}, or correct the unit of its readings"),
    }
}

/// Those whose advice counts: all, or the first one where it explains the others.
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
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(refusals: &[Refusal], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(refusals.iter().map(|evidence| {
            let text = format!("{}; {}", evidence.cause(), evidence.remedy());
            Entry { code: evidence.code(), text, evidence }
        }))
    }

    /// Reads the evidence; code and text follow from it.
    ///
    /// # Errors
    /// Those of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Refusal>, D::Error> {
        Vec::deserialize(deserializer)
    }
}

#[cfg(test)]
mod tests;
