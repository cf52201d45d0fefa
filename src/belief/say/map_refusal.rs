//! Refusals of tag maps: reasons not to write the map.

use std::fmt;

use crate::say::refusal::Refusal;
use crate::say::wrong_input::{MismatchMeasure, WrongInput, WrongInputKind};
use armcal_core::codes::{Code, Coded};

/// The file that states an arm's lenses, as sentences name it.
pub(crate) const ROBOT_FILE: &str = "robot.toml";

/// A cause for which a map must not be used.
#[derive(Clone, Debug, PartialEq)]
pub struct MapRefusal {
    /// The fault of the inputs.
    pub cause: MapRefusalCause,
    /// Name of the file that states the lenses.
    pub lens_file: String,
}

/// Fault in the inputs of a map.
#[derive(Clone, Debug, PartialEq)]
pub enum MapRefusalCause {
    /// A reason that would also refuse a calibration.
    OfCalibration(Refusal),
    /// Another reading of the lens with which the corners fit one map.
    OtherLens {
        /// The reading: another image size or model.
        reading: WrongInputKind,
        /// Distance of measured and predicted corners with it, root mean square.
        rms_px: f64,
        /// Root mean square distance with the lens as stated.
        stated_rms_px: f64,
    },
    /// No tag whose place is known fits the views.
    AnchorLost {
        /// The known tags.
        tags: Vec<u32>,
        /// Sizes with which they would fit.
        sizes: Option<WrongSizes>,
    },
}

/// Sizes that the views contradict.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongSizes {
    /// The tag with the wrong size; `None` for all tags.
    pub tag: Option<u32>,
    /// Ratio of the sizes to the stated ones.
    pub factor: f64,
}

impl WrongSizes {
    fn of_what(self) -> String {
        self.tag.map_or_else(|| "all tags".to_owned(), |id| format!("tag {id}"))
    }
}

impl MapRefusalCause {
    fn as_wrong_input(&self) -> Option<WrongInput> {
        let Self::OtherLens { reading, rms_px, stated_rms_px } = self else { return None };
        let measure = MismatchMeasure::Distances;
        let (input, mismatch_otherwise) = (reading.clone(), Some(*rms_px));
        Some(WrongInput { input, measure, mismatch: *stated_rms_px, mismatch_otherwise, size_hint: None })
    }

    fn remedy(&self) -> String {
        match self {
            Self::OfCalibration(refusal) => refusal.remedy().into_owned(),
            Self::OtherLens { .. } => {
                self.as_wrong_input().map(|wrong| wrong.remedy().into_owned()).unwrap_or_default()
            }
            Self::AnchorLost { sizes: Some(sizes), .. } => {
                format!("measure the border square of {} and correct size_m", sizes.of_what())
            }
            Self::AnchorLost { sizes: None, .. } => "check their size_m, their ids and the lens".to_owned(),
        }
    }
}

impl fmt::Display for MapRefusalCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (reading, rms_px, stated_rms_px) = match self {
            Self::OfCalibration(refusal) => return refusal.fmt(f),
            Self::AnchorLost { tags, sizes } => return anchor_lost(tags, *sizes, f),
            Self::OtherLens { reading, rms_px, stated_rms_px } => (reading, rms_px, stated_rms_px),
        };
        match reading {
            WrongInputKind::ImageScale(scale) => write!(
                f,
                "the lens of {ROBOT_FILE} belongs to an image {scale} times the size of the recorded image: scaled, "
            ),
            _ => write!(
                f,
                "the lens has another model than {ROBOT_FILE} says (fisheye or pinhole): with the other model "
            ),
        }?;
        write!(f, "the corners fit one map within {rms_px:.2} px instead of {stated_rms_px:.2} px")
    }
}

fn anchor_lost(tags: &[u32], sizes: Option<WrongSizes>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let ids: Vec<String> = tags.iter().map(u32::to_string).collect();
    write!(f, "no tag whose place is known ({}) fits the views with the other tags", ids.join(", "))?;
    let Some(sizes) = sizes else { return Ok(()) };
    write!(f, ": size_m of {} times {:.3} would", sizes.of_what(), sizes.factor)
}

impl Coded for MapRefusal {
    fn code(&self) -> Code {
        match &self.cause {
            MapRefusalCause::OfCalibration(refusal) => refusal.code(),
            MapRefusalCause::AnchorLost { sizes: Some(_), .. } => Code::InputTagSize,
            MapRefusalCause::AnchorLost { sizes: None, .. } => Code::MapFailed,
            MapRefusalCause::OtherLens { reading: WrongInputKind::ImageScale(_), .. } => Code::InputImageSize,
            MapRefusalCause::OtherLens { .. } => Code::InputLensModel,
        }
    }
}

/// Cause and remedy.
impl fmt::Display for MapRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{}; {}", self.cause, self.cause.remedy());
        f.write_str(&in_lens_file(&text, &self.lens_file))
    }
}

/// Returns the sentence with the name of the file that states this lens.
pub(crate) fn in_lens_file(text: &str, lens_file: &str) -> String {
    text.replace("[camera] of robot.toml", if lens_file == ROBOT_FILE { "[camera] of robot.toml" } else { lens_file })
        .replace(ROBOT_FILE, lens_file)
}
