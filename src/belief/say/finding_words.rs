//! Findings and events in words.

use crate::say::finding::{Finding, FindingKind, FindingUnit};
use armcal_core::optics::{CameraModel, LensModel};

impl FindingKind {
    /// Name of the kind in words: `tag moved`.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::TagMoved => "tag moved",
            Self::TagsMoved => "tags moved together",
            Self::TagSize => "tag of another size",
            Self::TagSwapped => "tags swapped",
            Self::TagLeftOut => "tag left out",
            Self::Lens => "lens differs from robot.toml",
            Self::LensModel => "lens of another model than robot.toml says",
            Self::Link => "link differs from the URDF",
            Self::Sag => "compliance under weight",
            Self::CameraMount => "camera mount differs",
            Self::Base => "base displaced from the survey",
            Self::Tool => "tool point differs",
            Self::SensorSlip => "sensor slipped",
            Self::SensorReversed => "sensor reversed",
            Self::SensorScale => "sensor scale differs",
            Self::SensorFailed => "joint or sensor failed",
            Self::SensorWorn => "sensor worn",
            Self::SensorUnusual => "far from its datasheet",
            Self::OffsetWalks => "offset walks at random",
            Self::Outliers => "tag observations rejected",
        }
    }
}

impl Finding {
    /// The size in everyday units: `12.0 mm`.
    #[must_use]
    pub fn size_in_words(&self) -> Option<String> {
        Some(self.unit?.in_words(self.size?))
    }
}

impl FindingUnit {
    /// A value in an everyday unit: `12.0 mm`.
    #[must_use]
    pub fn in_words(self, value: f64) -> String {
        match self {
            Self::Metre => format!("{:.1} mm", value * 1e3),
            Self::Radian => format!("{:.2} deg", value.to_degrees()),
            Self::One => format!("{value:.3}"),
            Self::RadianPerNewtonMetre => format!("{:.3} deg per kN m", 1e3 * value.to_degrees()),
            Self::MetrePerNewton => format!("{:.3} mm per kN", 1e6 * value),
            Self::Newton => format!("{value:.0} N"),
        }
    }
}

/// An event of the online estimate in words; `at_rad` is the joint angle at the middle of a worn spot.
pub(crate) fn event(finding: &Finding, at_rad: Option<f64>) -> String {
    let Finding { kind, name, size, .. } = finding;
    let size = size.unwrap_or(f64::NAN);
    match kind {
        FindingKind::SensorSlip => {
            format!("the sensor of {name} slipped on its shaft by {:.2} deg", size.to_degrees())
        }
        FindingKind::SensorScale => {
            format!("the sensor of {name} has another scale: the angle is {size:.3} of the datasheet angle")
        }
        FindingKind::SensorReversed => {
            format!("the sensor of {name} is reversed ({size:.3} of the datasheet angle)")
        }
        FindingKind::SensorFailed => {
            format!("the sensor of {name} failed: only views determine its angle")
        }
        FindingKind::SensorWorn => {
            let at_deg = at_rad.unwrap_or(f64::NAN).to_degrees();
            format!(
                "the sensor of {name} is worn near {at_deg:.1} deg: it reads {:.2} deg more there",
                size.to_degrees()
            )
        }
        FindingKind::TagMoved => format!("tag {name} was moved by {:.1} mm", 1e3 * size),
        FindingKind::TagsMoved => format!("tags {name} were moved together by {:.1} mm", 1e3 * size),
        FindingKind::CameraMount => format!("the camera turned on its mount by {:.2} deg", size.to_degrees()),
        _ => format!("the {name} or all tags moved by {:.1} mm", 1e3 * size),
    }
}

/// One of several explanations: `the sensor of elbow slipped on its shaft`.
pub(crate) fn explanation(kind: FindingKind, name: &str) -> String {
    match kind {
        FindingKind::SensorSlip => format!("the sensor of {name} slipped on its shaft"),
        FindingKind::SensorScale => format!("the sensor of {name} has another scale"),
        FindingKind::SensorFailed => format!("the sensor of {name} says nothing any more"),
        FindingKind::SensorWorn => format!("the sensor of {name} is worn at one place"),
        FindingKind::TagMoved => format!("tag {name} was moved"),
        FindingKind::TagsMoved => format!("tags {name} were moved together"),
        FindingKind::CameraMount => "the camera has moved on its mount".to_owned(),
        _ => "the base or all tags have moved".to_owned(),
    }
}

/// The explanation that blames no single joint.
pub(crate) fn drift() -> String {
    "all sensors drifted more than expected".to_owned()
}

/// `the sensor slipped by 1.00 deg after 9 of 20 views, before view 10`.
pub(crate) fn slip(step: &str, [n_before, n]: [usize; 2], number: u32) -> String {
    format!("the sensor slipped by {step} after {n_before} of {n} views, before view {number}")
}

/// `offset_std_rad of wrist_yaw`.
pub(crate) fn key_of_joint(key: &str, joint: &str) -> String {
    format!("{key} of {joint}")
}

/// `the reading is off in 3 of 20 views (2, 9, 15)`; `what` says what is wrong with the reading there.
pub(crate) fn reading_in_views(what: &str, [n_there, n]: [usize; 2], numbers: &[String]) -> String {
    format!("the reading {what} in {n_there} of {n} views ({})", numbers.join(", "))
}

/// `the reading is off in 13 of the last 14 views, since view 27`.
pub(crate) fn lost_reading([n_off, n_since]: [usize; 2], number: u32) -> String {
    format!("the reading is off in {n_off} of the last {n_since} views, since view {number}")
}

/// A lens of the other model, with its estimated intrinsics.
pub(crate) fn other_lens_model(camera: &str, lens: &CameraModel) -> String {
    let model = if matches!(lens.lens, LensModel::Radtan(_)) { "pinhole" } else { "equidistant" };
    let ([fx, fy], [cx, cy]) = (lens.focal_px(), lens.center_px());
    let distortion: Vec<String> = lens.distortion().iter().map(|k| format!("{k:.4}")).collect();
    format!(
        "{camera}: model = \"{model}\" explains the images better, with focal_px = [{fx:.1}, {fy:.1}], center_px = \
         [{cx:.1}, {cy:.1}], distortion = [{}]; the estimate uses the stated model. Measure the intrinsics again",
        distortion.join(", ")
    )
}

/// Says how many poses of a capture were skipped, as the cause of few views.
#[must_use]
pub fn skipped_poses(skipped: usize, captured: usize) -> String {
    format!(
        "{skipped} of {} poses were skipped: the arm did not come to rest there, or did not get there; look for a \
         locked joint, a dead sensor or weak hydraulics",
        skipped + captured
    )
}

/// Says that a file with the status `accepted` states reasons for a refusal.
pub(crate) fn accepted_and_refused(refusal: Option<&str>) -> String {
    let key = refusal.map_or("[[refusals]]", |_| "refusal");
    format!("is `accepted`, but {key} says why the result was refused: it was edited; calibrate again")
}

/// Warning of an offset that walks at random; `walked` is the std of the walk over the views.
pub(crate) fn offset_walks(joint: &str, walked: &str) -> String {
    format!(
        "the offset of {joint} walks at random, by {walked} (std) during the capture; the predicted tool error \
         includes as much again. Calibrate again soon, or follow the estimate online"
    )
}
