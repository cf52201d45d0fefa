//! Why a calibration is refused: cause, evidence and remedy as data. The words are made here and nowhere else.

use std::fmt;

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

    /// A short code, for narrow links.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::TooFewViews { .. } => "few_views",
            Self::NotSolved { .. } => "solver",
            Self::TooFewHeldOutViews { .. } => "few_held_out",
            Self::NoHeldOutTag => "no_held_out",
            Self::NoBetterThanDatasheet { .. } | Self::NoBetterThanBaseline { .. } => "no_better",
            Self::Overfitted { .. } => "overfitted",
            Self::BeyondTolerance { .. } | Self::PriorsBeyondTolerance { .. } => "tool_error",
            _ => "other",
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::TooFewViews { .. } | Self::PriorUntested => "capture more views",
            Self::TooFewViewsSinceSlip { .. } => "fasten that sensor on its shaft, then capture more views",
            Self::NotSolved { .. } => "capture views that move each joint over more of its range",
            Self::TooFewHeldOutViews { .. } | Self::NoHeldOutTag => "hold out more views that show tags",
            Self::NoBetterThanDatasheet { .. } | Self::NoBetterThanBaseline { .. } => {
                "keep the datasheet's sensors, or check tag map, camera mount and time stamps"
            }
            Self::Overfitted { .. } => "capture more views, or more different ones",
            Self::PriorsBeyondTolerance { most: Some(most), .. } if most.starts_with("tag survey") => {
                "measure how the frame of the tags stands to the arm's base and state the sigmas in [geometry] of \
                 robot.toml, or touch three surveyed surfaces (step `touch`)"
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
                "calibrate right before the work and again during it, keep the belief up online, or replace the sensor"
            }
            Self::BeyondDatasheet { .. } => "check joint and sensor, and robot.toml against the sensor that is there",
            Self::Outliers { .. } => "check tag map, tag ids and the drawing",
            Self::Innovations { .. } => "look for what moved or warmed up during the capture",
            Self::Touch { .. } => {
                "measure the tool point ([tool] point_m of robot.toml), the links beyond the camera and its \
                 mount"
            }
            Self::PriorReused => "give a prior that was made from other views",
            Self::PriorSingular => "make the prior anew",
            Self::PriorContradicted { .. } => "calibrate without the prior (leave --prior out)",
        }
    }
}

/// Cause, evidence, and what to do next.
impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fmt_cause(f)?;
        write!(f, "; {}", self.remedy())
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
                write!(f, "{views} views to fit are too few for {parameters} parameters, however many tags each shows")
            }
            Self::NotSolved { outcome, evaluations } => {
                write!(f, "the solver {} after {evaluations} steps", outcome.name())
            }
            Self::TooFewHeldOutViews { views, needed } => {
                write!(f, "only {views} held-out views show a tag; {needed} are needed for a verdict")
            }
            Self::NoHeldOutTag => write!(f, "the held-out views hold no usable tag (0 seen)"),
            Self::NoBetterThanDatasheet { held_out_m, datasheet_m } => write!(
                f,
                "held-out views are no better than with the datasheet: {:.1} mm against {:.1} mm",
                mm(*held_out_m),
                mm(*datasheet_m)
            ),
            Self::NoBetterThanBaseline { held_out_m, baseline_m, p_value } => write!(
                f,
                "held-out views are no better than with the datasheet's sensors once camera mount and tag map are \
                 fitted: {:.1} mm against {:.1} mm (p = {p_value:.2}, below {SIGNIFICANCE} wanted)",
                mm(*held_out_m),
                mm(*baseline_m)
            ),
            Self::Overfitted { held_out_m, fit_m } => write!(
                f,
                "held-out views are off by {:.1} mm, fitted ones by {:.1} mm: overfitted",
                mm(*held_out_m),
                mm(*fit_m)
            ),
            Self::BeyondTolerance { predicted_m, tolerance_m } => {
                let [predicted, tolerance] = told_apart_mm([*predicted_m, *tolerance_m]);
                write!(f, "the predicted tool error of {predicted} mm exceeds the task's tolerance of {tolerance} mm")
            }
            Self::PriorsBeyondTolerance { predicted_m, tolerance_m, most } => {
                let [predicted, tolerance] = told_apart_mm([*predicted_m, *tolerance_m]);
                write!(
                    f,
                    "predicted tool error with what no view shows is {predicted} mm (95 % of the targets), the task \
                     tolerates {tolerance} mm"
                )?;
                most.as_ref().map_or(Ok(()), |most| write!(f, "; most of it by the {most}"))
            }
            Self::Outliers { outliers, observations } => write!(
                f,
                "{outliers} of {observations} tag observations fit no arm of this drawing: other tags, or links that \
                 are not as in the drawing"
            ),
            Self::CornerNoise { residual_px, stated_px, limit_px } => write!(
                f,
                "the model does not explain the corners: averaged over a view they are {residual_px:.2} px off, above \
                 {limit_px:.2} px; robot.toml has {stated_px:.2} px for one frame"
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
                "joint sensors do not explain the data: {joint} needs a random error of {} from view to view, its \
                 datasheet has {}: a joint that slips, or links that are not as in the drawing",
                moves.unit().shown(*std_rad, 2),
                moves.unit().shown(*datasheet_std_rad, 2)
            ),
            Self::BeyondDatasheet { parameter, sigmas } => write!(
                f,
                "{parameter} is estimated {sigmas:.0} sigma from its datasheet: the joint or its sensor has failed, \
                 or it is another sensor"
            ),
            Self::Nonlinearity { joint, std_rad, datasheet_std_rad, moves } => write!(
                f,
                "{joint} is farther from a straight line than a sensor of its datasheet: {}, {:.1} times the \
                 datasheet's {}",
                moves.unit().shown(*std_rad, 2),
                std_rad / datasheet_std_rad,
                moves.unit().shown(*datasheet_std_rad, 2)
            ),
            Self::SensorLine { joint, slope } => {
                let what = if *slope < 0.0 { "reversed" } else { "of another scale than its datasheet's" };
                write!(f, "the sensor of {joint} is {what}: the camera's angles follow it with a slope of {slope:.2}")
            }
            Self::SensorFailed { joint, kind, tool_error_m, tool_error_by_camera_m, tolerance_m } => {
                let mm = |m: Option<f64>| m.unwrap_or(f64::INFINITY) * 1e3;
                write!(
                    f,
                    "the sensor of {joint} {}, and the task needs that joint: without it the tool error is {:.0} \
                     mm for a tolerance of {:.1} mm; while the camera sees tags and tells the joint's angle it is \
                     {:.1} mm",
                    kind.predicate(),
                    mm(*tool_error_m),
                    tolerance_m * 1e3,
                    mm(*tool_error_by_camera_m)
                )
            }
            Self::TooFewViewsSinceSlip { joint, evidence, views } => {
                write!(f, "{joint}: {evidence}; the {views} views since are too few to calibrate it as it is now")
            }
            Self::Touch { off_m, surface, chi2, limit, causes, link, tool_point_m: [x, y, z] } => write!(
                f,
                "touch: the tool is {:.0} mm from where it should be at {surface} (chi-square {chi2:.0}, limit \
                 {limit:.0}): {}; a tool point [{:.1}, {:.1}, {:.1}] mm from the drawn one, in the axes of {link}, \
                 would explain it best",
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
                "{}: chi-square per degree of freedom is {per_dof:.2}, above {limit:.2} (expected in 95 % of cases: \
                 {low:.2} .. {high:.2}): views that the fit did not use are worse than it predicts",
                quantity.name()
            ),
            Self::OffsetsWalk { joint, walked_rad, moves, predicted_m, tolerance_m } => write!(
                f,
                "the offset of {joint} walked at random by {} while the views were captured; when as much time has \
                 gone by again the tool is {:.1} mm off, the task tolerates {:.1} mm",
                moves.unit().shown(*walked_rad, 2),
                predicted_m * 1e3,
                tolerance_m * 1e3
            ),
            Self::PriorReused => write!(f, "the prior rests on these very messages, which must not count twice"),
            Self::PriorSingular => write!(f, "the prior's covariance has no inverse"),
            Self::PriorUntested => write!(f, "the views determine too little to be tested against the prior"),
            Self::PriorContradicted { joint, off_rad, joints_off, moves, .. } => {
                let off = moves.unit().shown(*off_rad, 2);
                write!(f, "the new views contradict the prior: ")?;
                if *joints_off > 1 {
                    write!(f, "{joints_off} joints are off, {joint} the most, by {off}, so that it is of ")?;
                    write!(f, "another arm, or of one whose sensors were changed since")?;
                } else {
                    write!(f, "{joint} is off by {off}, so that its sensor slipped or was changed since")?;
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
        write!(f, " (chi-square {chi2:.1} of {degrees_of_freedom}, expected below {limit:.1} in 99.9 % of cases; ")?;
        write!(f, "{std} allowed, one sigma")?;
        if *used_share < MIN_USED_SHARE {
            write!(f, "; only {:.0} % of the tag observations fit anything near it", 100.0 * used_share)?;
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
    (!words.is_empty()).then(|| words.join("; besides, "))
}

#[cfg(test)]
mod tests;
