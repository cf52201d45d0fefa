//! Inputs that may be wrong, and the code of each.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::codes::{Code, Coded};

/// An input that is not what its file says, and the mismatch of the views with it and with its correction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WrongInput {
    /// The input, and its correct meaning.
    pub input: WrongInputKind,
    /// Quantity of `mismatch`.
    #[serde(default, skip_serializing_if = "MismatchMeasure::is_of_distances")]
    pub measure: MismatchMeasure,
    /// Mismatch of the input as written. Distances: position error between two tags over their distance. Rotations:
    /// rad. Positions: error of the tag's position by the arm over its distance from the camera.
    pub mismatch: f64,
    /// Mismatch with the corrected input; absent where no correction is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mismatch_otherwise: Option<f64>,
    /// Dimension of the tags that was measured instead of their size, in words; absent where their print does not show
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_hint: Option<String>,
}

/// Evidence that an input is wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MismatchMeasure {
    /// Distances of tags that one view shows.
    #[default]
    Distances,
    /// Rotations of one landmark over the views.
    Rotations,
    /// Positions of landmarks, against the arm by its datasheet.
    Positions,
}

impl MismatchMeasure {
    pub(crate) fn is_of_distances(&self) -> bool {
        *self == Self::Distances
    }
}

impl WrongInput {
    /// Returns true if one reading of the whole map or of the lens explains all tags at once.
    pub(crate) fn is_of_all_tags(&self) -> bool {
        !matches!(self.input, WrongInputKind::ExchangedIds(_) | WrongInputKind::OtherMap)
    }
}

/// Kind of a wrong input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WrongInputKind {
    /// The map's quaternions are x, y, z, w.
    MapQuaternions,
    /// The recorded rotations are quaternions in the other order.
    RecordedQuaternions,
    /// The recorded poses are those of the camera in the landmark's frame, or the other way round.
    RecordedDirection,
    /// The recorded rotations are quaternions in the other order, of the inverse poses.
    RecordedOrderAndDirection,
    /// The recorded rotations are inverse, but the positions are not.
    RecordedRotations,
    /// The recorded positions are in this unit, not in metres.
    RecordedUnit(String),
    /// The recorded positions are this many times as far apart as the tags of the map.
    RecordedScale(f64),
    /// The lens belongs to an image of another size.
    ImageSize {
        /// Columns and rows of the image, from robot.toml.
        stated_px: [u32; 2],
        /// Largest column and row of a corner, which the image must reach at least.
        seen_px: [f64; 2],
    },
    /// Corners have negative columns or rows; the value holds the smallest ones.
    NegativePixels([f64; 2]),
    /// Corners are shares of the image, not pixels.
    ImageShares,
    /// The lens belongs to an image this many times the recorded one's size.
    ImageScale(f64),
    /// The lens has this many times its stated focal length.
    FocalLength(f64),
    /// The lens is of the other model: a fisheye called a pinhole, or the other way round.
    LensModel,
    /// The corners come from images without the distortion that robot.toml states.
    Distortion,
    /// All tags have this many times their stated size.
    TagSize(f64),
    /// The map's positions are in this unit, not in metres.
    MapUnit(String),
    /// The map's positions have other axes, in words: `(y, x, z)`, `(x, -y, z)`.
    MapAxes(String),
    /// All tags of the map are turned alike: the rotation, w, x, y, z, that follows each `quaternion_wxyz`.
    TagFrames([f64; 4]),
    /// These tags have one another's places.
    ExchangedIds(Vec<u32>),
    /// The tags are not placed as the map says, and no other reading of the files explains them.
    OtherMap,
}

impl Coded for WrongInput {
    fn code(&self) -> Code {
        match &self.input {
            WrongInputKind::MapQuaternions => Code::InputOrder,
            WrongInputKind::RecordedQuaternions | WrongInputKind::RecordedRotations => Code::InputRotation,
            WrongInputKind::RecordedDirection | WrongInputKind::RecordedOrderAndDirection => Code::InputDirection,
            WrongInputKind::RecordedUnit(_) => Code::InputPoseUnit,
            WrongInputKind::ImageSize { .. }
            | WrongInputKind::ImageScale(_)
            | WrongInputKind::NegativePixels(_)
            | WrongInputKind::ImageShares => Code::InputImageSize,
            WrongInputKind::LensModel | WrongInputKind::Distortion => Code::InputLensModel,
            WrongInputKind::FocalLength(_) => Code::LensContradicted,
            WrongInputKind::TagSize(_) | WrongInputKind::RecordedScale(_) => Code::InputTagSize,
            WrongInputKind::ExchangedIds(_) => Code::InputTagIds,
            WrongInputKind::MapUnit(_) => Code::InputMapUnit,
            WrongInputKind::MapAxes(_) => Code::InputMapAxes,
            WrongInputKind::TagFrames(_) => Code::InputTagFrames,
            WrongInputKind::OtherMap => Code::InputTagMap,
        }
    }
}
