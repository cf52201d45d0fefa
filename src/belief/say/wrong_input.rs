//! Inputs that may be wrong, and the code of each.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::codes::{Code, Coded};

/// An input that is not what it is said to be, and how well the views fit with it and without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WrongInput {
    /// Which, and how it should be read.
    pub input: WrongInputKind,
    /// Quantity of `mismatch`.
    #[serde(default, skip_serializing_if = "MismatchMeasure::is_of_distances")]
    pub measure: MismatchMeasure,
    /// As it is written: of two tags, where the one is not seen over its distance from the other; of rotations, rad; of
    /// positions, where the tag is not by the arm over its distance from the camera.
    pub mismatch: f64,
    /// The same with the input put right; absent where nothing puts it right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mismatch_otherwise: Option<f64>,
    /// What of the tags was measured in place of their size, in words, where their print tells it.
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
    /// One reading of the whole map or of the lens, which explains all tags at once.
    pub(crate) fn is_of_all_tags(&self) -> bool {
        !matches!(self.input, WrongInputKind::ExchangedIds(_) | WrongInputKind::OtherMap)
    }
}

/// What may be wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WrongInputKind {
    /// The map's quaternions are x, y, z, w.
    MapQuaternions,
    /// The recorded rotations are quaternions in the other order.
    RecordedQuaternions,
    /// The recorded poses are those of the camera in the landmark's frame, or the other way round.
    RecordedDirection,
    /// Both: quaternions in the other order, of the inverse poses.
    RecordedOrderAndDirection,
    /// The recorded rotations are inverse, the positions are not.
    RecordedRotations,
    /// The recorded positions are in this unit, and not in metres.
    RecordedUnit(String),
    /// The recorded positions are so many times as far apart as the map has the tags.
    RecordedScale(f64),
    /// The lens is that of an image of another size: columns and rows by robot.toml, and the largest ones of a corner.
    ImageSize {
        /// By robot.toml.
        stated_px: [u32; 2],
        /// At least.
        seen_px: [f64; 2],
    },
    /// Corners have negative columns or rows; the smallest ones.
    NegativePixels([f64; 2]),
    /// Corners are shares of the image, not pixels.
    ImageShares,
    /// The lens is that of an image of so many times the recorded one's size.
    ImageScale(f64),
    /// The lens has so many times its stated focal length.
    FocalLength(f64),
    /// The lens is of the other model: a fisheye called a pinhole, or the other way round.
    LensModel,
    /// The corners come from images without the distortion that robot.toml states.
    Distortion,
    /// All tags are of so many times their stated size.
    TagSize(f64),
    /// The map's positions are in this unit, and not in metres.
    MapUnit(String),
    /// The map's axes are others, in words: `(y, x, z)`, `(x, -y, z)`.
    MapAxes(String),
    /// All tags of the map are turned alike: the rotation, w, x, y, z, that follows each `quaternion_wxyz`.
    TagFrames([f64; 4]),
    /// These tags hang in one another's places.
    ExchangedIds(Vec<u32>),
    /// The tags do not stand to one another as the map says, whatever is tried.
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
