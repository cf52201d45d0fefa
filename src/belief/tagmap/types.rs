//! Input and settings of a tag map.

use armcal_core::codes::{Code, Coded};
use nalgebra::{Isometry3, Matrix2, UnitQuaternion};

use crate::say::map_refusal::{MapRefusal, ROBOT_FILE};
use crate::say::map_words::mirrored_corners;
use crate::tagmap::constants::types::{ATTITUDE_STD_RAD, CORNER_STD_PX, MIN_LINK_VIEWS, REJECT_SIGMAS};
use crate::views::constants::association::MAX_SQUARE_RMS_PX;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::robot::{LensPriors, MAX_TAGS};
use armcal_core::time::Stamp;

/// One tag in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct MapDetection {
    /// Id as detected.
    pub id: u32,
    /// Corners in raw pixels, in the order of `optics::square_corners`.
    pub corners_px: [[f64; 2]; 4],
    /// Covariance of each corner; `None` means [`MapSettings::corner_std_px`] in both directions.
    pub covariance_px2: Option<[Matrix2<f64>; 4]>,
}

/// Detections of one camera in one image.
#[derive(Clone, Debug, PartialEq)]
pub struct MapView {
    /// Index into [`MapInput::cameras`].
    pub camera: usize,
    /// Time of the exposure.
    pub stamp: Stamp,
    /// Detections in any order, including unknown tags.
    pub tags: Vec<MapDetection>,
    /// world_from_body of the moving body that carries an attitude sensor ([`MapSettings::attitude_body`]), at the
    /// stamp.
    pub attitude: Option<UnitQuaternion<f64>>,
}

/// A rigid body that carries tags.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name in files.
    pub name: String,
    /// Static bodies do not move relative to each other, so that their tags make one map; a moving one has its own.
    pub is_static: bool,
    /// Pose frame_from_body of a static body in the common frame; `None` if the tags shall determine it.
    pub pose: Option<Isometry3<f64>>,
}

/// Prior knowledge of a tag.
#[derive(Clone, Debug, PartialEq)]
pub struct TagPrior {
    /// Number of the tag.
    pub id: u32,
    /// Side of the black square.
    pub size_m: f64,
    /// Index into [`MapInput::bodies`].
    pub body: usize,
    /// Pose body_from_tag; `None` if unknown.
    pub pose: Option<Isometry3<f64>>,
    /// Standard deviations of `pose`: translation (m) and rotation (rad) along the tag's axes. `None` means exact.
    pub std: Option<[f64; 6]>,
}

/// Use of the given poses of tags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MapMode {
    /// Every given pose is exact: cameras are located, and disagreeing tags are reported.
    Known,
    /// Given poses hold within their standard deviations.
    #[default]
    PartlyKnown,
    /// Only the base tag's pose is used, as exact.
    Unknown,
}

/// Source of the scale of the covariances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NoiseScale {
    /// The corners' covariances are as given.
    Given,
    /// The residuals scale the corners' covariances.
    #[default]
    Estimated,
}

/// Settings of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct MapSettings {
    /// Use of the given poses of tags.
    pub mode: MapMode,
    /// The tag that anchors the map; `None`: the tags with poses do, or else the first tag of each group.
    pub base_tag: Option<u32>,
    /// Standard deviation of a corner in each direction, px; used if the detections have no covariances.
    pub corner_std_px: f64,
    /// Source of the scale of the covariances.
    pub noise: NoiseScale,
    /// Size and body of tags that no prior names; `None` rejects them.
    pub default_tag: Option<(f64, usize)>,
    /// Largest misfit of a detection to a square, px rms; beyond it the detection is rejected. Assumed; three pixels is
    /// far beyond any detector.
    pub max_square_rms_px: f64,
    /// Largest misfit of a detection's corners in standard deviations (rms); beyond it the detection is rejected.
    /// Assumed.
    pub reject_beyond_sigmas: f64,
    /// Number of images in which two groups of tags must be seen together to become one.
    pub min_link_views: usize,
    /// The body with the attitude sensor.
    pub attitude_body: Option<usize>,
    /// Standard deviation of the attitude, rad.
    pub attitude_std_rad: f64,
    /// Family of the tags.
    pub tag_family: TagFamily,
    /// Standard deviation of the stated focal lengths, relative.
    pub focal_std: f64,
    /// Name of the file that states the lenses, for messages.
    pub lens_file: String,
}

impl Default for MapSettings {
    fn default() -> Self {
        Self {
            mode: MapMode::default(),
            base_tag: None,
            corner_std_px: CORNER_STD_PX,
            noise: NoiseScale::default(),
            default_tag: None,
            max_square_rms_px: MAX_SQUARE_RMS_PX,
            reject_beyond_sigmas: REJECT_SIGMAS,
            min_link_views: MIN_LINK_VIEWS,
            attitude_body: None,
            attitude_std_rad: ATTITUDE_STD_RAD,
            tag_family: TagFamily::default(),
            focal_std: LensPriors::default().focal_std,
            lens_file: ROBOT_FILE.to_owned(),
        }
    }
}

/// Input of [`super::solve`].
#[derive(Clone, Copy, Debug)]
pub struct MapInput<'a> {
    /// Lens of each camera.
    pub cameras: &'a [CameraModel],
    /// Views in any order.
    pub views: &'a [MapView],
    /// Bodies that carry the tags.
    pub bodies: &'a [Body],
    /// Tags, each id once.
    pub tags: &'a [TagPrior],
}

/// Reason why a detection is not in the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MapRejection {
    /// No prior names the tag, and there is no default size.
    UnknownTag,
    /// Two detections in the image have this id, and nothing shows which one is right.
    SeenTwice,
    /// A corner has no bearing in the lens model.
    OutOfView,
    /// The corners are not those of a square seen from its front.
    NotASquare,
    /// The corners disagree with all other data on camera and tag: a wrong id, or a strong blur.
    Inconsistent,
}

impl MapRejection {
    /// Name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UnknownTag => "unknown_tag",
            Self::SeenTwice => "seen_twice",
            Self::OutOfView => "out_of_view",
            Self::NotASquare => "not_a_square",
            Self::Inconsistent => "inconsistent",
        }
    }

    /// Returns true if the reason indicates a fault in the data; a tag without a prior does not.
    #[must_use]
    pub fn is_fault(self) -> bool {
        self != Self::UnknownTag
    }
}

/// A detection that was not used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RejectedDetection {
    /// Index into [`MapInput::views`].
    pub view: usize,
    /// Id as detected.
    pub id: u32,
    /// First check that the detection failed.
    pub reason: MapRejection,
}

/// Reason why no map is returned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum TagMapError {
    #[error("no view shows a tag, so there is nothing to map")]
    NoDetections,
    #[error("the base tag {base_tag} was not seen in any view; tags seen: {seen:?}")]
    NoBaseTag { base_tag: u32, seen: Vec<u32> },
    #[error("none of the tags whose places are known ({known:?}) was seen in any view; tags seen: {seen:?}")]
    NoKnownTag { known: Vec<u32>, seen: Vec<u32> },
    #[error("the views show {n} different tags, 0 .. {MAX_TAGS} are allowed; choose another topic")]
    ManyTags { n: usize },
    #[error("tag {id}: size_m {size_m} is outside 0.001 .. 10")]
    TagSize { id: u32, size_m: f64 },
    #[error("tag {id}: stands twice among the known tags")]
    TagTwice { id: u32 },
    #[error("tag {id}: names body {body}, of {n_bodies}")]
    NoSuchBody { id: u32, body: usize, n_bodies: usize },
    #[error("view {view}: names camera {camera}, of {n_cameras}")]
    NoSuchCamera { view: usize, camera: usize, n_cameras: usize },
    #[error("{what} is {value}; it must be a number above 0")]
    Setting { what: &'static str, value: f64 },
    #[error("every one of {rejected} detections was rejected: {reasons}")]
    NothingLeft { rejected: usize, reasons: String },
    #[error("{}", mirrored_corners(*n, *of))]
    CornerOrder { n: usize, of: usize },
    #[error("{0}")]
    Refused(Box<MapRefusal>),
}

impl Coded for TagMapError {
    fn code(&self) -> Code {
        match self {
            Self::NoDetections | Self::NoBaseTag { .. } | Self::NoKnownTag { .. } => Code::TagsNotSeen,
            Self::ManyTags { .. } | Self::TagSize { .. } | Self::Setting { .. } => Code::ValueOutOfRange,
            Self::TagTwice { .. } => Code::ValueDuplicate,
            Self::NoSuchBody { .. } | Self::NoSuchCamera { .. } => Code::NameUnknown,
            Self::NothingLeft { .. } => Code::MapFailed,
            Self::CornerOrder { .. } => Code::InputCornerOrder,
            Self::Refused(refusal) => refusal.code(),
        }
    }
}
