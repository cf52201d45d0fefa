//! Other readings of known places that the views contradict: tests of a calibration that need no arm.
//!
//! Each test uses the tags of one rigid body in the views of one camera (`explain::wrong_input`).

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::explain::wrong_input::pairs::mismatch;
use crate::explain::wrong_input::{GOOD, StatedCamera, wrong_input_of_camera};
use crate::say::wrong_input::{WrongInput, WrongInputKind};
use crate::tagmap::constants::known_places::{MAX_REJECTED_SHARE, MAX_STD_M, MAX_STD_RAD, MAX_VIEWS, MIN_TAGS};
use crate::tagmap::constants::lens_test::NOISY;
use crate::tagmap::result::TagMap;
use crate::tagmap::types::{MapDetection, MapInput, MapMode, MapSettings, MapView, TagPrior};
use crate::views::view::{CaptureData, MeanCorners, TagMeasurement, TagObservation, View};
use armcal_core::codes::Code;
use armcal_core::robot::SurveyedTag;
use armcal_core::spatial::Pose;
use armcal_core::streams::JointAngles;

/// Evidence against a map before the cause is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Doubt {
    /// True if there is any evidence.
    pub(super) is_any: bool,
    /// True if most tags, or the fit as a whole, are in doubt.
    is_of_most: bool,
    /// True if the sizes disagree with the known distances.
    is_of_scale: bool,
}

impl Doubt {
    /// The doubt where no map exists.
    pub(super) const NO_MAP: Self = Self { is_any: true, is_of_most: true, is_of_scale: true };

    pub(super) fn of(map: &TagMap) -> Self {
        let n_rejected = map.rejected.iter().filter(|rejected| rejected.reason.is_fault()).count();
        let are_many = n_rejected as f64 > MAX_REJECTED_SHARE * map.n_detections as f64;
        let disagreeing = map.warnings.iter().filter(|warning| warning.code == Code::MapTagDisagrees).count();
        let is_of_most = !map.has_converged || are_many || 2 * disagreeing > map.tags.len();
        let is_of_scale = !map.scale_warnings.is_empty();
        let is_any = is_of_most || is_of_scale || disagreeing > 0 || map.noise_scale > NOISY;
        Self { is_any, is_of_most, is_of_scale }
    }
}

/// Returns the reading of the known places, the lens or the corners that explains why the views contradict them.
pub(super) fn wrong_input(input: &MapInput<'_>, settings: &MapSettings, doubt: Doubt) -> Option<WrongInput> {
    let bodies = rigid_bodies(input);
    let cameras = 0..input.cameras.len();
    let mut found = cameras.flat_map(|camera| bodies.iter().map(move |tags| (camera, tags)));
    found.find_map(|(camera, tags)| of_body(input, settings, doubt, (camera, tags)))
}

fn of_body(
    input: &MapInput<'_>,
    settings: &MapSettings,
    doubt: Doubt,
    (camera, tags): (usize, &Vec<SurveyedTag>),
) -> Option<WrongInput> {
    let data = data_of(input, camera, tags);
    let stated = StatedCamera { lens: &input.cameras[camera], tag_family: settings.tag_family };
    if !doubt.is_any {
        let views: Vec<&View> = data.fit.iter().collect();
        // Places that the views confirm have no other reading.
        mismatch(&views, tags, stated.lens).filter(|pairs| pairs.mismatch >= GOOD)?;
    }
    let wrong = wrong_input_of_camera(&data, tags, stated)?;
    is_said(&wrong.input, settings.mode, doubt, tags.len()).then_some(wrong)
}

/// Returns true if a map reports the finding. Where given places are not used, they may be outdated. Then only a
/// reading of all of them is a cause, because the base tag's place is written in the same form.
fn is_said(found: &WrongInputKind, mode: MapMode, doubt: Doubt, n_tags: usize) -> bool {
    use WrongInputKind as Kind;
    match (found, mode) {
        (Kind::ImageSize { .. } | Kind::NegativePixels(_) | Kind::ImageShares, _) => doubt.is_any,
        (Kind::MapQuaternions | Kind::TagFrames(_) | Kind::MapAxes(_), MapMode::Unknown) => n_tags >= MIN_TAGS,
        (Kind::MapUnit(_) | Kind::TagSize(_), MapMode::Unknown) => doubt.is_of_scale,
        (_, MapMode::Unknown) => false,
        (Kind::OtherMap, _) => doubt.is_of_most,
        _ => doubt.is_any,
    }
}

/// The tags with known places, grouped by the rigid body that carries them.
fn rigid_bodies(input: &MapInput<'_>) -> Vec<Vec<SurveyedTag>> {
    let mut bodies: BTreeMap<Option<usize>, Vec<SurveyedTag>> = BTreeMap::new();
    for tag in input.tags {
        let body = &input.bodies[tag.body];
        let (key, pose) = match (body.pose.filter(|_| body.is_static), tag.pose) {
            (Some(of_body), Some(pose)) => (None, of_body * pose),
            (None, Some(pose)) => (Some(tag.body), pose),
            (_, None) => continue,
        };
        if is_known(tag) {
            bodies.entry(key).or_default().push(SurveyedTag {
                id: tag.id,
                size_m: tag.size_m,
                base_from_tag: Pose::from_isometry(pose),
                position_std_m: 0.0,
                rotation_std_rad: 0.0,
            });
        }
    }
    bodies.into_values().collect()
}

fn is_known(tag: &TagPrior) -> bool {
    let is_within = |[a, b, c, d, e, f]: [f64; 6]| {
        [a, b, c].iter().all(|std| *std <= MAX_STD_M) && [d, e, f].iter().all(|std| *std <= MAX_STD_RAD)
    };
    tag.std.is_none_or(is_within)
}

/// The views of a camera that show two of the tags, spread evenly over all views.
fn data_of(input: &MapInput<'_>, camera: usize, tags: &[SurveyedTag]) -> CaptureData {
    let mut data = CaptureData::default();
    let mut views = Vec::new();
    for view in input.views.iter().filter(|view| view.camera == camera) {
        view.tags.iter().for_each(|seen| data.note_corners(&seen.corners_px));
        let shown = view_of(view, tags);
        views.extend((shown.tags.len() > 1).then_some(shown));
    }
    let stride = views.len().div_ceil(MAX_VIEWS).max(1);
    data.fit = views.into_iter().step_by(stride).collect();
    data
}

fn view_of(view: &MapView, tags: &[SurveyedTag]) -> View {
    let observed = |seen: &MapDetection| {
        let tag_idx = tags.iter().position(|tag| tag.id == seen.id)?;
        let corners = MeanCorners { corners_px: seen.corners_px, n_frames: 1, scatter_px2: 0.0 };
        let measured = TagMeasurement::Corners(corners);
        Some(TagObservation { id: seen.id, tag_idx, center_in_camera_m: Vector3::zeros(), measured })
    };
    let tags = view.tags.iter().filter_map(observed).collect();
    View { tags, ..View::of_reading(0, view.stamp, JointAngles::zeros(0)) }
}
