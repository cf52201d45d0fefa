//! Bodies that moved between two views, and the remedy.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A body whose pose differs before and after a gap between two views.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MovedBody {
    /// A camera on the arm that moved on its mount.
    Camera,
    /// A camera that stands still, or the base of the arm that it looks at.
    StandingCamera,
    /// The arm's base, or all tags that stand around it.
    BaseOrTags,
    /// All tags that the arm carries in front of a camera that stands still.
    CarriedTags,
}

impl MovedBody {
    /// Advice to keep the body in its place.
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
