//! Input of `bundle`.

use crate::model::estimated::Model;
use crate::model::layout::Layout;
use crate::model::parameters::JointParameters;
use crate::model::prior::{JointPrior, Prior};
use crate::model::scales::Hyperparameters;
use crate::views::view::{TagMeasurement, View};
use armcal_core::robot::Robot;

/// Robot, views and settings of one estimate.
#[derive(Clone)]
pub struct BundleInput<'a> {
    /// Nominal arm with its tags; their poses are priors.
    pub robot: &'a Robot,
    /// Fitted views.
    pub views: &'a [View],
    /// Which parameters have a column.
    pub model: Model,
    /// Standard deviations of priors and noise, at the start.
    pub scales: Hyperparameters,
    /// Where the search begins, and the reference of the terms.
    pub guess: JointParameters,
    /// Prior of the joints' parameters; `None` uses the datasheet's.
    pub joint_prior: Option<JointPrior>,
    /// How the scales are set.
    pub evidence: HyperparameterMode,
}

impl BundleInput<'_> {
    /// With columns of the tags that the views show.
    pub(crate) fn layout(&self) -> Layout {
        let is_seen = |tag_idx: usize| self.views.iter().flat_map(|v| &v.tags).any(|tag| tag.tag_idx == tag_idx);
        Layout::new(self.robot, &self.model, is_seen)
    }

    /// The prior by datasheet, drawing and survey with these scales; of the joints' parameters the earlier
    /// calibration's, if there is one.
    pub(crate) fn prior(&self) -> Prior {
        let mut prior = Prior::drawn(self.robot, &self.model.parameters(), &self.scales);
        if let Some(known) = &self.joint_prior {
            (prior.joint_mean, prior.information) = (known.mean.clone(), known.information.clone());
        }
        for (tag_idx, std) in prior.std.tags_mut().iter_mut().enumerate() {
            let mut seen = self.views.iter().flat_map(|view| &view.tags).filter(|seen| seen.tag_idx == tag_idx);
            // A landmark that is seen as a position alone has no attitude to speak of.
            if seen.all(|seen| matches!(seen.measured, TagMeasurement::Position)) {
                std[3..6].fill(1.0);
            }
        }
        prior
    }
}

/// How the scales (noise and prior standard deviations) are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HyperparameterMode {
    /// Fitted by the evidence of the data.
    Fitted,
    /// As in [`BundleInput::scales`].
    Given,
}
