//! Why a calibration is refused: cause, evidence and remedy as data. The words are made here and nowhere else.

use std::fmt;

use armcal_core::codes::{Code, Coded};
use armcal_core::kinematics::JointKind;
use armcal_core::numeric::Outcome;
use armcal_core::robot::FailedKind;
use serde::{Deserialize, Serialize};

use crate::calib::baseline_comparison::SIGNIFICANCE;
use crate::calib::geometry_error::GeometryError;
use crate::calib::wrong_input::WrongInput;

/// One reason to refuse. Angles in rad, lengths in m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// The predicted tool error (95 % of the targets) exceeds the task's tolerance.
    BeyondTolerance {
        /// 95th percentile over the targets.
        predicted_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
    },
    /// The same with what rests on the drawing alone.
    PriorsBeyondTolerance {
        /// 95th percentile over the targets.
        predicted_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
        /// The largest part of it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        most: Option<String>,
    },
    /// A file is not as it is said to be, and the images show it without the arm.
    WrongInput(WrongInput),
    /// Another link geometry explains the data, and joint sensors do not.
    Geometry(GeometryError),
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
        /// 95th percentile over the targets, with as much again.
        predicted_m: f64,
        /// The task's tolerance.
        tolerance_m: f64,
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
        /// Of one frame, by robot.toml.
        stated_px: f64,
        /// Largest residual that is accepted.
        limit_px: f64,
    },
    /// A gain or offset that no sensor of this datasheet has.
    BeyondDatasheet {
        /// Name of the parameter: `shoulder_yaw gain`.
        parameter: String,
        /// Distance from the datasheet in its prior's standard deviations.
        sigmas: f64,
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
    /// A sensor that reads the other way, or of another scale, and the rest does not fit with its gain estimated.
    SensorLine {
        /// The joint.
        joint: String,
        /// Of the angle by the reading, 1 by the datasheet.
        slope: f64,
    },
    /// A sensor failed whose joint the task needs.
    SensorFailed {
        /// Name of the joint in the URDF.
        joint: String,
        /// What is wrong with its sensor.
        kind: FailedKind,
        /// Over the task's targets, 95th percentile, without the sensor; absent where nothing predicts it.
        tool_error_m: Option<f64>,
        /// The same while the camera shows the joint's angle.
        tool_error_by_camera_m: Option<f64>,
        /// The task's tolerance.
        tolerance_m: f64,
    },
}

/// Which innovations of held-out views are tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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

/// A smaller share of used observations means that the views fit nothing near the prior.
pub(crate) const MIN_USED_SHARE: f64 = 0.6;

impl Refusal {
    /// Whether it is about the data themselves, so that it comes before what a fit of them shows.
    #[must_use]
    pub fn is_about_data(&self) -> bool {
        matches!(self, Self::TooFewViews { .. } | Self::NotSolved { .. } | Self::TooFewViewsSinceSlip { .. })
    }

    /// Which reason is told first: what makes all others a consequence. Those of one rank stay in their order.
    pub(crate) fn rank(&self) -> u8 {
        match self {
            Self::TooFewViews { .. } | Self::TooFewViewsSinceSlip { .. } => 0,
            Self::WrongInput(_) | Self::PriorReused => 1,
            // Under a prior that does not hold, links and sensors seem to be off.
            Self::PriorContradicted { .. } => 2,
            // Where hardly any observation fits, the solver's end and every test of the rest say nothing.
            Self::Outliers { outliers, observations } if 2 * outliers > *observations => 3,
            _ => 4,
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::TooFewViews { .. } | Self::PriorUntested => "capture more views",
            Self::TooFewViewsSinceSlip { .. } => "fasten the sensor on its shaft, then capture more views",
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
            Self::PriorsBeyondTolerance { .. } => {
                "put a tag on the gripper, touch three surveyed surfaces (step `touch`), or measure the arm and state \
                 its sigmas in [geometry] of robot.toml"
            }
            Self::BeyondTolerance { .. } => "capture more views, or put a tag on the gripper",
            Self::WrongInput(wrong) => wrong.remedy(),
            Self::Geometry(geometry) => geometry.remedy(),
            Self::CornerNoise { .. } => "check lens, corner noise and tag sizes in robot.toml, and the tag map",
            Self::SensorError { .. } | Self::SensorFailed { .. } => "check that joint's sensor",
            Self::SensorLine { .. } => "swap its ends, or correct scale_counts_per_deg and its sign in robot.toml",
            Self::Nonlinearity { .. } => "replace the sensor, or state its linearity in robot.toml",
            Self::OffsetsWalk { .. } => {
                "calibrate right before the work and again during it, follow the estimate online, or replace the sensor"
            }
            Self::BeyondDatasheet { .. } => "check joint and sensor, and robot.toml against the installed sensor",
            Self::Outliers { .. } => "check tag map, tag ids and the URDF",
            Self::Innovations { .. } => "look for what moved or warmed up during the capture",
            Self::Touch { .. } => {
                "measure the tool point ([tool] point_m of robot.toml), the links beyond the camera and the camera \
                 mount"
            }
            Self::PriorReused => "give a prior that was made from other views",
            Self::PriorSingular => "make the prior again",
            Self::PriorContradicted { .. } => "calibrate without --prior",
        }
    }
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
            Self::PriorsBeyondTolerance { .. } => Code::PriorsBeyondTolerance,
            Self::WrongInput(wrong) => wrong.code(),
            Self::Geometry(_) => Code::GeometryContradicted,
            Self::SensorError { .. } => Code::SensorError,
            Self::OffsetsWalk { .. } => Code::OffsetsWalk,
            Self::Nonlinearity { .. } => Code::Nonlinearity,
            Self::CornerNoise { .. } => Code::CornerNoise,
            Self::BeyondDatasheet { .. } => Code::BeyondDatasheet,
            Self::Outliers { .. } => Code::TooManyOutliers,
            Self::Innovations { .. } => Code::Innovations,
            Self::Touch { .. } => Code::TouchContradicted,
            Self::PriorReused => Code::PriorReused,
            Self::PriorSingular => Code::PriorSingular,
            Self::PriorUntested => Code::PriorUntested,
            Self::PriorContradicted { .. } => Code::PriorContradicted,
            Self::TooFewViewsSinceSlip { .. } => Code::TooFewViewsSinceSlip,
            Self::SensorLine { .. } => Code::SensorLine,
            Self::SensorFailed { .. } => Code::SensorNeeded,
        }
    }
}

/// A refusal without its remedy.
struct Cause<'a>(&'a Refusal);

impl fmt::Display for Cause<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt_cause(f)
    }
}

impl Refusal {
    /// Cause and evidence in words, without [`Self::remedy`].
    #[must_use]
    pub fn cause(&self) -> String {
        Cause(self).to_string()
    }

    /// Cause and evidence.
    fn fmt_cause(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongInput(_)
            | Self::Geometry(_)
            | Self::SensorError { .. }
            | Self::BeyondDatasheet { .. }
            | Self::Nonlinearity { .. }
            | Self::SensorLine { .. }
            | Self::SensorFailed { .. }
            | Self::TooFewViewsSinceSlip { .. }
            | Self::Touch { .. } => self.fmt_of_arm(f),
            Self::Innovations { .. }
            | Self::CornerNoise { .. }
            | Self::OffsetsWalk { .. }
            | Self::PriorReused
            | Self::PriorSingular
            | Self::PriorUntested
            | Self::PriorContradicted { .. } => self.fmt_of_prediction(f),
            _ => self.fmt_of_data(f),
        }
    }

    /// What views and figures lack.
    fn fmt_of_data(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm = |m: f64| m * 1e3;
        match self {
            Self::TooFewViews { views, parameters } => {
                write!(
                    f,
                    "{views} views cannot determine {parameters} parameters, at least {parameters} views are needed"
                )
            }
            Self::NotSolved { outcome, evaluations } => {
                write!(f, "the solver {} after {evaluations} steps", outcome.name())
            }
            Self::TooFewHeldOutViews { views, needed } => {
                write!(f, "only {views} held-out views show a tag; the verdict needs {needed}")
            }
            Self::NoHeldOutTag => write!(f, "no held-out view shows a usable tag (0 seen)"),
            Self::NoBetterThanDatasheet { held_out_m, datasheet_m } => write!(
                f,
                "held-out tag error is no better than with the datasheet: {:.1} mm against {:.1} mm rms",
                mm(*held_out_m),
                mm(*datasheet_m)
            ),
            Self::NoBetterThanBaseline { held_out_m, baseline_m, p_value } => write!(
                f,
                "held-out tag error is no better than with datasheet sensors, fitted mount and fitted map: {:.1} mm \
                 against {:.1} mm rms (p = {p_value:.2}, required below {SIGNIFICANCE})",
                mm(*held_out_m),
                mm(*baseline_m)
            ),
            Self::Overfitted { held_out_m, fit_m } => write!(
                f,
                "tag error is {:.1} mm rms in held-out views and {:.1} mm in fitted views: overfitted",
                mm(*held_out_m),
                mm(*fit_m)
            ),
            Self::BeyondTolerance { predicted_m, tolerance_m } => {
                let [predicted, tolerance] = told_apart_mm([*predicted_m, *tolerance_m]);
                write!(
                    f,
                    "the predicted tool error is {predicted} mm (95 % of the targets); the task tolerates {tolerance} \
                     mm"
                )
            }
            Self::PriorsBeyondTolerance { predicted_m, tolerance_m, most } => {
                let [predicted, tolerance] = told_apart_mm([*predicted_m, *tolerance_m]);
                write!(
                    f,
                    "the predicted tool error with unobservable parameters is {predicted} mm (95 % of the targets); \
                     the task tolerates {tolerance} mm"
                )?;
                most.as_ref().map_or(Ok(()), |most| write!(f, "; the largest part: {most}"))
            }
            Self::Outliers { outliers, observations } => write!(
                f,
                "{outliers} of {observations} tag observations fit no arm of this URDF: the tags or the links differ"
            ),
            _ => Ok(()),
        }
    }

    /// What is wrong with the arm.
    fn fmt_of_arm(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongInput(wrong) => write!(f, "{wrong}"),
            Self::Geometry(geometry) => write!(f, "{geometry}"),
            Self::SensorError { joint, std_rad, datasheet_std_rad, moves } => write!(
                f,
                "{joint} varies by {} between views; its datasheet linearity is {}: a slipping sensor or wrong link \
                 geometry",
                moves.unit().shown(*std_rad, 2),
                moves.unit().shown(*datasheet_std_rad, 2)
            ),
            Self::BeyondDatasheet { parameter, sigmas } => write!(
                f,
                "{parameter} is {sigmas:.0} sigma from its datasheet: joint or sensor failed, or another sensor is \
                 installed"
            ),
            Self::Nonlinearity { joint, std_rad, datasheet_std_rad, moves } => write!(
                f,
                "the nonlinearity of {joint} is {}, {:.1} times the {} of its datasheet",
                moves.unit().shown(*std_rad, 2),
                std_rad / datasheet_std_rad,
                moves.unit().shown(*datasheet_std_rad, 2)
            ),
            Self::SensorLine { joint, slope } => {
                let what = if *slope < 0.0 { "is reversed" } else { "has another scale than its datasheet" };
                write!(f, "the sensor of {joint} {what}: the camera's angles follow it with a slope of {slope:.2}")
            }
            Self::SensorFailed { joint, kind, tool_error_m, tool_error_by_camera_m, tolerance_m } => {
                let mm = |m: Option<f64>| m.unwrap_or(f64::INFINITY) * 1e3;
                write!(
                    f,
                    "the sensor of {joint} {}, and the task needs this joint: without it the tool error is {:.0} mm, \
                     the tolerance {:.1} mm; while the camera sees tags the error is {:.1} mm",
                    kind.predicate(),
                    mm(*tool_error_m),
                    tolerance_m * 1e3,
                    mm(*tool_error_by_camera_m)
                )
            }
            Self::TooFewViewsSinceSlip { joint, evidence, views } => {
                write!(f, "{joint}: {evidence}; {views} views since then cannot calibrate it")
            }
            Self::Touch { off_m, surface, chi2, limit, causes, link, tool_point_m: [x, y, z] } => write!(
                f,
                "touch: the tool is {:.0} mm from its predicted position at {surface} (chi-square {chi2:.0}, limit \
                 {limit:.0}): {}; best explained by a tool point [{:.1}, {:.1}, {:.1}] mm from the nominal one in the \
                 axes of {link}",
                off_m.abs() * 1e3,
                causes.join(", or "),
                x * 1e3,
                y * 1e3,
                z * 1e3
            ),
            _ => Ok(()),
        }
    }

    /// What is not as it was predicted: by the fit, or by the prior.
    fn fmt_of_prediction(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Innovations { quantity, per_dof, limit, expected: [low, high] } => write!(
                f,
                "{} are less precise than predicted: chi-square per degree of freedom {per_dof:.2}, limit {limit:.2} \
                 (95 % expected in {low:.2} to {high:.2})",
                quantity.name()
            ),
            Self::OffsetsWalk { joint, walked_rad, moves, predicted_m, tolerance_m } => write!(
                f,
                "the offset of {joint} walked at random by {} during the capture; after as much time again the \
                 predicted tool error is {:.1} mm, the task tolerates {:.1} mm",
                moves.unit().shown(*walked_rad, 2),
                predicted_m * 1e3,
                tolerance_m * 1e3
            ),
            Self::CornerNoise { residual_px, stated_px, limit_px } => write!(
                f,
                "corner residuals averaged over a view are {residual_px:.2} px rms, above {limit_px:.2} px; \
                 robot.toml states {stated_px:.2} px for one frame"
            ),
            Self::PriorReused => write!(f, "the prior was made from the same messages, which must not count twice"),
            Self::PriorSingular => write!(f, "the prior's covariance has no inverse"),
            Self::PriorUntested => write!(f, "the views determine too little to be tested against the prior"),
            Self::PriorContradicted { joint, off_rad, joints_off, moves, .. } => {
                let off = moves.unit().shown(*off_rad, 2);
                write!(f, "the new views contradict the prior: ")?;
                if *joints_off > 1 {
                    write!(f, "{joints_off} joints differ, {joint} the most by {off}: another arm, or ")?;
                    write!(f, "sensors were replaced since")?;
                } else {
                    write!(f, "{joint} differs by {off}: its sensor slipped or was replaced since")?;
                }
                self.fmt_evidence_against_prior(f)
            }
            _ => Ok(()),
        }
    }

    fn fmt_evidence_against_prior(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::PriorContradicted { off_std_rad, moves, chi2, degrees_of_freedom, limit, used_share, .. } = self
        else {
            return Ok(());
        };
        let std = moves.unit().shown(*off_std_rad, 3);
        write!(f, " (chi-square {chi2:.1} of {degrees_of_freedom}, 99.9 % expected below {limit:.1}; ")?;
        write!(f, "sigma {std}")?;
        if *used_share < MIN_USED_SHARE {
            write!(f, "; only {:.0} % of the tag observations fit near it", 100.0 * used_share)?;
        }
        write!(f, ")")
    }
}

/// Two lengths in mm with one digit, or with as many as tell them apart, up to four.
fn told_apart_mm(lengths_m: [f64; 2]) -> [String; 2] {
    let with = |digits: usize| lengths_m.map(|m| format!("{:.digits$}", m * 1e3));
    (1..4).map(with).find(|[a, b]| a != b).unwrap_or_else(|| with(4))
}

/// All reasons in one line, the first one first; `None` where there is none.
#[must_use]
pub fn in_words(refusals: &[Refusal]) -> Option<String> {
    let words: Vec<String> = refusals.iter().map(ToString::to_string).collect();
    (!words.is_empty()).then(|| words.join("; also: "))
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
