//! Doubts about an online estimate as a whole, in words.

use std::fmt;

use armcal_core::codes::{Code, Coded};
use armcal_core::units::Unit;

/// A reason not to rely on an online estimate, however small its covariance is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// The images stand still while joints proximal to the camera move.
    FrozenImages {
        /// Views whose images repeat an earlier one.
        views: usize,
    },
    /// The base seems to have moved often or far.
    Base {
        /// Number of motions.
        times: usize,
        /// Largest of these motions, m.
        most_m: f64,
    },
    /// Camera or tags that had moved seem to keep moving.
    Lens {
        /// Number of these events.
        events: usize,
    },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FrozenImages { views } => write!(
                f,
                "the images of {views} views repeat an earlier one although joints moved: the stream of images is \
                 frozen, and these views are not used; restart camera and detector"
            ),
            Self::Base { times, most_m } => {
                let times = if *times == 1 { "once".to_owned() } else { format!("{times} times") };
                write!(
                    f,
                    "the base seems to have moved {times}, by up to {}: the clock of camera or joint sensors jumped, \
                     images are frozen, or the base keeps moving; check these and follow again",
                    Unit::Metres.shown(*most_m, 1)
                )
            }
            Self::Lens { events } => write!(
                f,
                "camera or tags seem to move again and again ({events} events): the lens was changed, or they are \
                 loose; check focus, zoom and housing, then their fastening, and follow again"
            ),
        }
    }
}

impl Coded for Doubt {
    fn code(&self) -> Code {
        match self {
            Self::FrozenImages { .. } => Code::ImagesFrozen,
            Self::Base { .. } => Code::BaseDoubtful,
            Self::Lens { .. } => Code::LensChanged,
        }
    }
}
