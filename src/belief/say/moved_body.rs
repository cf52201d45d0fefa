//! What moved between two views, and what to do about it.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What has one place before two views and another one after.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MovedBody {
    /// A camera on the arm, on its mount.
    Camera,
    /// A camera that stands still, or the arm's base before it.
    StandingCamera,
    /// The arm's base, or all tags beside it.
    BaseOrTags,
    /// All tags that the arm carries before a camera that stands still.
    CarriedTags,
}

impl MovedBody {
    /// Advice to keep it in its place.
    pub(crate) fn remedy(self) -> &'static str {
        match self {
            Self::Camera => "fasten the camera, then calibrate again from views after it",
            Self::StandingCamera => "fasten camera and base, then calibrate again from views after it",
            Self::BaseOrTags => "fasten base and tags, then calibrate again from views after it",
            Self::CarriedTags => "fasten the tags, then calibrate again from views after it",
        }
    }

    /// `the camera elbow moved on its mount between views 20 and 21 (by 10.2 mm, 0.86 deg)`.
    pub(crate) fn fmt_motion(
        self,
        f: &mut fmt::Formatter<'_>,
        (camera, [before, after]): (Option<&str>, [u32; 2]),
        [shift_m, turn_rad]: [f64; 2],
    ) -> fmt::Result {
        let name = camera.map_or_else(String::new, |name| format!(" {name}"));
        match self {
            Self::Camera => write!(f, "the camera{name} moved on its mount")?,
            Self::StandingCamera => write!(f, "the camera{name} moved where it stands, or the arm's base did,")?,
            Self::BaseOrTags => f.write_str("the arm's base moved, or all tags together,")?,
            Self::CarriedTags => f.write_str("the tags on the arm moved together")?,
        }
        let (shift_mm, turn_deg) = (1e3 * shift_m, turn_rad.to_degrees());
        write!(f, " between views {before} and {after} (by {shift_mm:.1} mm, {turn_deg:.2} deg)")
    }
}
