//! Words of a refusal: cause and evidence.

use std::fmt;

use crate::judge::baseline_comparison::SIGNIFICANCE;
use crate::say::constants::refusal_words::MORE_DIGITS_BELOW;
use crate::say::length_unit::unit_of;
use crate::say::refusal::{CameraMoved, HeldOutLimitSource, MIN_USED_SHARE, Refusal, with_advice};
use crate::say::wrong_input_words::medium_of_lens;
use armcal_core::codes::Coded;
use armcal_core::robot::FailedKind;

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
    pub(crate) fn fmt_cause(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lens { .. }
            | Self::RepairTooLarge { .. }
            | Self::TagSizeRepair { .. }
            | Self::BeyondDatasheet { .. } => self.fmt_of_size(f),
            Self::WrongInput(_)
            | Self::MisreadReadings(_)
            | Self::MovedBetweenViews { .. }
            | Self::Geometry(_)
            | Self::SensorUnit { .. }
            | Self::SensorError { .. }
            | Self::Nonlinearity { .. }
            | Self::SensorLine { .. }
            | Self::TooFewViewsSinceSlip { .. }
            | Self::SlipNotEstimated { .. }
            | Self::Length { .. }
            | Self::Touch { .. } => self.fmt_of_arm(f),
            Self::Innovations { .. }
            | Self::CornerNoise { .. }
            | Self::CornerNoiseUnderstated { .. }
            | Self::OffsetsWalk { .. }
            | Self::PriorReused
            | Self::PriorSingular
            | Self::PriorUntested
            | Self::PriorContradicted { .. } => self.fmt_of_prediction(f),
            Self::BeyondTolerance { .. }
            | Self::PriorsBeyondTolerance { .. }
            | Self::TargetsNotJudged { .. }
            | Self::TargetsNotCovered { .. }
            | Self::RotationNoise { .. }
            | Self::HeldOutError { .. } => self.fmt_of_decision(f),
            Self::SensorFailed { .. } => self.fmt_of_failed_sensor(f),
            _ => self.fmt_of_data(f),
        }
    }

    fn fmt_of_failed_sensor(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SensorFailed { joint, kind, since_view, tolerance_m: None, .. } => write!(
                f,
                "the sensor of {joint} {}; without a task each joint up to the tool is needed",
                failed_since(*kind, *since_view)
            ),
            Self::SensorFailed {
                joint,
                kind,
                since_view,
                tool_error_m,
                tool_error_by_camera_m,
                tolerance_m: Some(tolerance_m),
            } => {
                let mm = |m: Option<f64>| m.unwrap_or(f64::INFINITY) * 1e3;
                write!(
                    f,
                    "the sensor of {joint} {}, and the task needs this joint: without it the tool error is {:.0} mm, \
                     the tolerance {:.1} mm; while the camera sees tags the error is {:.1} mm",
                    failed_since(*kind, *since_view),
                    mm(*tool_error_m),
                    tolerance_m * 1e3,
                    mm(*tool_error_by_camera_m)
                )
            }
            _ => Ok(()),
        }
    }

    /// Causes by the decision rule and by the held-out error.
    fn fmt_of_decision(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm = |m: f64| m * 1e3;
        match self {
            Self::BeyondTolerance { target, probability, u95_m, tolerance_m, .. } => {
                let [u95, tolerance] = told_apart_mm([*u95_m, *tolerance_m]);
                let percent = percent(*probability);
                write!(
                    f,
                    "at target {target} the tool error exceeds the tolerance of {tolerance} mm with probability \
                     {percent} (U95 {u95} mm)"
                )
            }
            Self::PriorsBeyondTolerance { target, probability, u95_m, tolerance_m, most } => {
                let [u95, tolerance] = told_apart_mm([*u95_m, *tolerance_m]);
                let percent = percent(*probability);
                write!(
                    f,
                    "at target {target} the tool error, unobservable parameters included, exceeds the tolerance of \
                     {tolerance} mm with probability {percent} (U95 {u95} mm)"
                )?;
                most.as_ref().map_or(Ok(()), |most| write!(f, "; the largest part: {most}"))
            }
            Self::TargetsNotJudged { targets } => {
                let numbers: Vec<String> = targets.iter().map(ToString::to_string).collect();
                write!(
                    f,
                    "the tool error cannot be judged at target {}: out of reach or undetermined",
                    numbers.join(", ")
                )
            }
            Self::TargetsNotCovered { targets, ranges } => {
                let numbers: Vec<String> = targets.iter().map(ToString::to_string).collect();
                let numbers = numbers.join(", ");
                write!(f, "the tool error cannot be judged at target {numbers}, far from the captured views: ")?;
                write!(f, "{}", ranges.join("; "))
            }
            Self::RotationNoise { rotation_rad, limit_rad, stated_rad } => {
                let [rotation, limit] = [rotation_rad, limit_rad].map(|rad| rad.to_degrees());
                write!(f, "rotations of the recorded poses vary by {rotation:.1} deg about the arm's; ")?;
                match stated_rad {
                    Some(rad) => {
                        write!(f, "five times the stated noise of {:.2} deg is {limit:.1} deg", rad.to_degrees())
                    }
                    None => write!(f, "without a stated noise the limit is {limit:.1} deg"),
                }
            }
            Self::HeldOutError { held_out_m, limit_m, source } => {
                let limit = match source {
                    HeldOutLimitSource::StatedNoise => "the stated noise and the estimate explain at most",
                    HeldOutLimitSource::Tolerance => "without a stated noise the limit is the tolerance,",
                    HeldOutLimitSource::Reach => "without a stated noise the limit is 1 % of the reach,",
                };
                write!(
                    f,
                    "tag error in held-out views is {:.1} mm rms; {limit} {:.1} mm",
                    mm(*held_out_m),
                    mm(*limit_m)
                )
            }
            _ => Ok(()),
        }
    }

    /// Causes in the data.
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
            Self::Outliers { outliers, observations } => write!(
                f,
                "{outliers} of {observations} tag observations fit no arm of this URDF: the tags or the links differ"
            ),
            _ => Ok(()),
        }
    }

    /// Causes where an estimate differs from its stated size by more than a repair may.
    fn fmt_of_size(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lens { camera, ratio, std, stated_std, most_sigmas, .. } => {
                let [std, stated] = [std, stated_std].map(|share| 100.0 * share);
                let of = camera.as_ref().map_or_else(String::new, |name| format!(" of the camera {name}"));
                write!(
                    f,
                    "the lens{of} is not that of robot.toml: its focal length is {ratio:.3} times the stated one"
                )?;
                f.write_str(" (sigma ")?;
                write!(f, "{std:.2} %; stated sigma {stated:.1} %, at most {most_sigmas:.0} of these are repaired)")?;
                f.write_str(medium_of_lens(*ratio))
            }
            Self::RepairTooLarge { element, size, unit, stated_std, most_sigmas, length_m } => {
                let sigmas = size / stated_std;
                let [size, std] = [size, stated_std].map(|value| unit.in_words(*value));
                write!(f, "{element} would be {size} from its nominal pose: {sigmas:.1} sigmas of {std}")?;
                match length_m {
                    Some(length_m) => write!(f, ", and longer than the link itself ({:.0} mm)", 1e3 * length_m),
                    None => write!(f, ", at most {most_sigmas:.0} are repaired"),
                }
            }
            Self::TagSizeRepair { element, ratio, stated_m } => {
                write!(f, "{element} would have {ratio:.3} times the stated size ({:.0} mm)", 1e3 * stated_m)?;
                f.write_str(": a size is repaired up to twice or half of it")
            }
            Self::BeyondDatasheet { parameter, sigmas, off, unit } => {
                let [off, std] = [*off, off.abs() / sigmas].map(|value| unit.in_words(value));
                write!(
                    f,
                    "{parameter} is {off} from its datasheet, {sigmas:.0} sigmas of {std}: joint or sensor failed, or \
                     another sensor is installed"
                )
            }
            _ => Ok(()),
        }
    }

    /// Causes in the arm or in its files.
    fn fmt_of_arm(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongInput(wrong) => write!(f, "{wrong}"),
            Self::MisreadReadings(misread) => write!(f, "{misread}"),
            Self::MovedBetweenViews { body, camera, views, shift_m, turn_rad } => {
                body.fmt_motion(f, (camera.as_deref(), *views), [*shift_m, *turn_rad])
            }
            Self::Geometry(geometry) => write!(f, "{geometry}"),
            Self::SensorUnit { joint, gain, moves, .. } => {
                let [small, large] = if moves.is_slide() { ["mm", "m"] } else { ["deg", "rad"] };
                let [found, stated] = if *gain < 1.0 { [small, large] } else { [large, small] };
                write!(f, "the readings of {joint} are in {found}, not in {stated}: {:.4} times its motion", 1.0 / gain)
            }
            Self::SensorError { joint, std_rad, datasheet_std_rad, moves } => write!(
                f,
                "{joint} varies by {} between views; its datasheet linearity is {}: a slipping sensor or wrong link \
                 geometry",
                moves.unit().shown(*std_rad, 2),
                moves.unit().shown(*datasheet_std_rad, 2)
            ),
            Self::Nonlinearity { joint, std_rad, datasheet_std_rad, moves } => write!(
                f,
                "the nonlinearity of {joint} is {}, {:.1} times the {} of its datasheet",
                moves.unit().shown(*std_rad, 2),
                std_rad / datasheet_std_rad,
                moves.unit().shown(*datasheet_std_rad, 2)
            ),
            Self::SensorLine { joint, slope, .. } => {
                let what = if *slope < 0.0 { "is reversed" } else { "has another scale than its datasheet" };
                let digits = if slope.abs() < MORE_DIGITS_BELOW { 4 } else { 2 };
                write!(
                    f,
                    "the sensor of {joint} {what}: the camera's angles follow it with a slope of {slope:.digits$}"
                )
            }
            Self::TooFewViewsSinceSlip { joint, evidence, views } => {
                write!(f, "{joint}: {evidence}; {views} views since then cannot calibrate it")
            }
            Self::SlipNotEstimated { joint, evidence } => {
                write!(f, "{joint}: {evidence}; this method takes its offset as the same in all views")
            }
            Self::Length { what, key, measured_m, by_views_m, std_m } => {
                fmt_length(f, [what, key], [*measured_m, *by_views_m, *std_m])
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

    /// Causes that contradict predictions of the fit or the prior.
    fn fmt_of_prediction(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Innovations { quantity, per_dof, limit, expected: [low, high] } => write!(
                f,
                "{} are less precise than predicted: chi-square per degree of freedom {per_dof:.2}, limit {limit:.2} \
                 (95 % expected in {low:.2} to {high:.2})",
                quantity.name()
            ),
            Self::OffsetsWalk { joint, walked_rad, moves, u95_m, tolerance_m } => write!(
                f,
                "the offset of {joint} walked at random by {} during the capture; after as much time again the \
                 tool error is up to {:.1} mm (U95), the tolerance is {:.1} mm",
                moves.unit().shown(*walked_rad, 2),
                u95_m * 1e3,
                tolerance_m * 1e3
            ),
            Self::CornerNoise { residual_px, stated_px, limit_px } => write!(
                f,
                "corner residuals averaged over a view are {residual_px:.2} px rms, above {limit_px:.2} px; \
                 robot.toml states {stated_px:.2} px for one frame"
            ),
            Self::CornerNoiseUnderstated { residual_px, stated_px, outliers, observations } => {
                write!(f, "corner_std_px of robot.toml, {stated_px:.3} px, is too small: under it {outliers} of ")?;
                write!(f, "{observations} tag observations fit no arm, and with {residual_px:.2} px nearly all do")
            }
            Self::PriorReused => write!(f, "the prior was made from the same messages, which must not count twice"),
            Self::PriorSingular => write!(f, "the prior's covariance has no inverse"),
            Self::PriorUntested => write!(f, "the views determine too little to be tested against the prior"),
            Self::PriorContradicted { camera_moved: Some(CameraMoved { shift_m, turn_rad }), .. } => {
                let (shift_mm, turn_deg) = (1e3 * shift_m, turn_rad.to_degrees());
                write!(f, "the new views contradict the prior: the camera was remounted since, {shift_mm:.1} mm ")?;
                write!(f, "and {turn_deg:.2} deg from where it was; the sensors are as they were")
            }
            Self::PriorContradicted { joints_off: 0, used_share, .. } if *used_share < MIN_USED_SHARE => {
                let percent = 100.0 * used_share;
                write!(
                    f,
                    "the new views contradict the prior: only {percent:.0} % of the tag observations fit near it, "
                )?;
                write!(f, "and no joint's change explains the others")
            }
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

/// `is dead since view 27`.
fn failed_since(kind: FailedKind, since_view: Option<u32>) -> String {
    let since = since_view.map_or_else(String::new, |number| format!(" since view {number}"));
    format!("{}{since}", kind.predicate())
}

/// Two lengths in mm, with the fewest decimals, 1 to 4, that make them differ.
pub(crate) fn told_apart_mm(lengths_m: [f64; 2]) -> [String; 2] {
    let with = |digits: usize| lengths_m.map(|m| format!("{:.digits$}", m * 1e3));
    (1..4).map(with).find(|[a, b]| a != b).unwrap_or_else(|| with(4))
}

/// A probability in percent, with no more digits than it needs.
fn percent(probability: f64) -> String {
    let digits = if probability < MORE_DIGITS_BELOW { 1 } else { 0 };
    format!("{:.digits$} %", 100.0 * probability)
}

/// All reasons in one line, the first one first; `None` if there is no reason.
#[must_use]
pub fn in_words(refusals: &[Refusal]) -> Option<String> {
    let advised = with_advice(refusals).len();
    let (full, causes) = refusals.split_at(advised);
    let causes = causes.iter().map(|refusal| format!("{} [{}]", refusal.cause(), refusal.code()));
    let words: Vec<String> = full.iter().map(ToString::to_string).chain(causes).collect();
    (!words.is_empty()).then(|| words.join("; also: "))
}

/// A length that the views contradict: `[what, key]`, and `[measured, by the views, standard deviation]`, m.
fn fmt_length(f: &mut fmt::Formatter<'_>, [what, key]: [&str; 2], lengths_m: [f64; 3]) -> fmt::Result {
    let [measured, by_views, std] = lengths_m.map(|m| 1e3 * m);
    write!(f, "{what} is {measured:.1} mm by {key} and {by_views:.1} mm by the views: ")?;
    match unit_of(measured / by_views) {
        Some(unit) => write!(f, "it is written in {unit}, not in metres"),
        None => write!(f, "{:.0} sigmas of {std:.1} mm apart", (measured - by_views).abs() / std),
    }
}
