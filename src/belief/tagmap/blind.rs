//! A map of some of the views from the tags' sizes only: no wrong known place can disturb it.

use crate::tagmap::adjust::{degrees_of_freedom, scale};
use crate::tagmap::constants::adjust::HUBER_WIDTH;
use crate::tagmap::constants::blind::{MAX_DETECTIONS, MIN_FREEDOM, MIN_VIEWS};
use crate::tagmap::linearize::cost;
use crate::tagmap::solve::Solved;
use crate::tagmap::types::{Body, MapInput, MapMode, MapSettings, MapView, TagPrior};
use armcal_core::numeric::Loss;
use armcal_core::optics::CameraModel;

/// Some of the views, and the tags without their places.
pub(super) struct Blind {
    views: Vec<MapView>,
    tags: Vec<TagPrior>,
    bodies: Vec<Body>,
    settings: MapSettings,
}

/// Misfit of a map.
#[derive(Clone, Copy, Debug)]
pub(super) struct Misfit {
    /// Variance of the corners over the stated one.
    pub(super) variance: f64,
    pub(super) freedom: usize,
    pub(super) n_used: usize,
}

impl Blind {
    pub(super) fn of(input: &MapInput<'_>, settings: &MapSettings) -> Self {
        let n_detections: usize = input.views.iter().map(|view| view.tags.len()).sum();
        let most = (input.views.len() / MIN_VIEWS).max(1);
        let stride = n_detections.div_ceil(MAX_DETECTIONS).clamp(1, most);
        let mut views: Vec<MapView> = input.views.to_vec();
        views.sort_by_key(|view| (view.stamp.nanos, view.camera));
        let tags = input.tags.iter().map(|tag| TagPrior { pose: None, std: None, ..tag.clone() });
        Self {
            views: views.into_iter().step_by(stride).collect(),
            tags: tags.collect(),
            bodies: input.bodies.to_vec(),
            settings: MapSettings { mode: MapMode::Unknown, base_tag: None, attitude_body: None, ..settings.clone() },
        }
    }

    pub(super) fn solved<'a>(&'a self, cameras: &'a [CameraModel]) -> Option<Solved<'a>> {
        let input = MapInput { cameras, views: &self.views, bodies: &self.bodies, tags: &self.tags };
        Solved::of(&input, &self.settings).ok().filter(|solved| degrees_of_freedom(&solved.problem) >= MIN_FREEDOM)
    }
}

impl Misfit {
    pub(super) fn of(solved: &Solved<'_>) -> Self {
        let freedom = degrees_of_freedom(&solved.problem);
        let chi_square = cost(&solved.problem, loss_of(solved));
        let n_used = solved.problem.observations.iter().filter(|seen| seen.is_used).count();
        Self { variance: solved.noise_scale.powi(2) * chi_square / freedom.max(1) as f64, freedom, n_used }
    }

    /// Log evidence of this misfit over `other`, without the cost of its further unknowns.
    pub(super) fn gain_over(&self, other: &Self) -> f64 {
        0.5 * self.freedom.min(other.freedom) as f64 * (other.variance / self.variance).ln()
    }

    /// Variance with a penalty for rejected detections; lower is better.
    pub(super) fn rank(&self) -> f64 {
        self.variance * (self.n_used.max(1) as f64).powi(-2)
    }
}

/// Loss under which such a solution is a minimum.
pub(super) fn loss_of(solved: &Solved<'_>) -> Loss {
    Loss::Huber { k: HUBER_WIDTH * scale(&solved.problem) }
}
