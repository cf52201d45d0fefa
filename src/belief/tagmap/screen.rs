//! Observations from detections: sorted, so that the order of the input does not matter, with each square solved
//! individually.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix2, UnitQuaternion, Vector2};

use crate::tagmap::problem::{Observation, TagState};
use crate::tagmap::types::{MapDetection, MapInput, MapMode, MapRejection, MapSettings, MapView, RejectedDetection};
use crate::tagmap::vote::is_finite;
use armcal_core::optics::{SquareError, solve_square_both, square_corners};

/// A view in the solver's order.
pub(super) struct SortedView {
    /// Index into the input.
    pub(super) input: usize,
    pub(super) attitude: Option<UnitQuaternion<f64>>,
}

pub(super) struct Screened {
    pub(super) views: Vec<SortedView>,
    /// Tags that views show, sorted by id.
    pub(super) tags: Vec<TagState>,
    /// Observations, sorted by view and tag.
    pub(super) observations: Vec<Observation>,
    pub(super) rejected: Vec<RejectedDetection>,
    pub(super) n_detections: usize,
}

pub(super) fn screen(input: &MapInput<'_>, settings: &MapSettings) -> Screened {
    let mut order: Vec<usize> = (0..input.views.len()).collect();
    order.sort_by_cached_key(|idx| sort_key(&input.views[*idx]));
    let known = known_tags(input, settings);
    let mut rejected = Vec::new();
    let mut found: Vec<(usize, u32, Observation)> = Vec::new();
    let mut n_detections = 0;
    for (at, &view) in order.iter().enumerate() {
        let mut tags: Vec<&MapDetection> = input.views[view].tags.iter().collect();
        tags.sort_by_key(|tag| tag.id);
        n_detections += tags.len();
        for tag in &tags {
            let twice = tags.iter().filter(|other| other.id == tag.id).count() > 1;
            let size_m = known.get(&tag.id).map(|tag| tag.size_m).or(settings.default_tag.map(|(size, _)| size));
            let outcome = match size_m {
                _ if twice => Err(MapRejection::SeenTwice),
                None => Err(MapRejection::UnknownTag),
                Some(size_m) => observe(input, settings, view, tag, size_m),
            };
            match outcome {
                Ok(observation) => found.push((at, tag.id, observation)),
                Err(reason) => rejected.push(RejectedDetection { view, id: tag.id, reason }),
            }
        }
    }
    let ids: BTreeSet<u32> = found.iter().map(|(_, id, _)| *id).collect();
    let ids: Vec<u32> = ids.into_iter().collect();
    let tags = ids.iter().map(|id| known.get(id).cloned().unwrap_or_else(|| default_tag(*id, settings))).collect();
    let observations = found.into_iter().map(|(at, id, mut observation)| {
        observation.view = at;
        observation.tag = ids.partition_point(|other| *other < id);
        observation
    });
    Screened {
        views: order.iter().map(|&view| SortedView { input: view, attitude: input.views[view].attitude }).collect(),
        tags,
        observations: observations.collect(),
        rejected,
        n_detections,
    }
}

/// Key of a view that holds all its data, so that equal keys mean equal views.
fn sort_key(view: &MapView) -> (i64, usize, Vec<(u32, [u64; 8])>) {
    let bits = |tag: &MapDetection| {
        let [[a, b], [c, d], [e, f], [g, h]] = tag.corners_px;
        (tag.id, [a, b, c, d, e, f, g, h].map(f64::to_bits))
    };
    let mut tags: Vec<_> = view.tags.iter().map(bits).collect();
    tags.sort_unstable();
    (view.stamp.nanos, view.camera, tags)
}

/// Known data of each tag, as the mode permits.
fn known_tags(input: &MapInput<'_>, settings: &MapSettings) -> BTreeMap<u32, TagState> {
    let with_pose = || input.tags.iter().filter(|tag| tag.pose.is_some()).map(|tag| tag.id);
    let seen: BTreeSet<u32> = input.views.iter().flat_map(|view| view.tags.iter().map(|tag| tag.id)).collect();
    let base = settings.base_tag.or_else(|| with_pose().filter(|id| seen.contains(id)).min());
    let state = |tag: &crate::tagmap::TagPrior| {
        let is_base = base == Some(tag.id);
        let given = match (tag.pose, settings.mode) {
            (Some(pose), MapMode::Known) => Some((pose, None)),
            (Some(pose), MapMode::PartlyKnown) => Some((pose, tag.std)),
            (Some(pose), MapMode::Unknown) if is_base => Some((pose, None)),
            (None, _) if settings.base_tag == Some(tag.id) => Some((Isometry3::identity(), None)),
            _ => None,
        };
        TagState { given, ..blank(tag.id, tag.size_m, tag.body) }
    };
    input.tags.iter().map(|tag| (tag.id, state(tag))).collect()
}

fn default_tag(id: u32, settings: &MapSettings) -> TagState {
    let (size_m, body) = settings.default_tag.unwrap_or((1.0, 0));
    let given = (settings.base_tag == Some(id)).then_some((Isometry3::identity(), None));
    TagState { given, ..blank(id, size_m, body) }
}

fn blank(id: u32, size_m: f64, body: usize) -> TagState {
    let pose = Isometry3::identity();
    TagState { id, size_m, body, given: None, group: usize::MAX, node: None, prior: None, pose }
}

fn observe(
    input: &MapInput<'_>,
    settings: &MapSettings,
    view: usize,
    tag: &MapDetection,
    size_m: f64,
) -> Result<Observation, MapRejection> {
    let camera = input.views[view].camera;
    if tag.corners_px.iter().flatten().any(|value| !value.is_finite()) {
        return Err(MapRejection::OutOfView);
    }
    let (best, other) =
        solve_square_both(&input.cameras[camera], size_m, &tag.corners_px).map_err(|error| match error {
            SquareError::OutOfView => MapRejection::OutOfView,
            SquareError::Degenerate => MapRejection::NotASquare,
        })?;
    let is_square = best.rms_px <= settings.max_square_rms_px && is_finite(best.camera_from_tag.isometry());
    if !is_square {
        return Err(MapRejection::NotASquare);
    }
    // A second solution with a misfit beyond any detector's error does not count.
    let other =
        other.filter(|other| other.rms_px <= settings.max_square_rms_px && is_finite(other.camera_from_tag.isometry()));
    let plain = Matrix2::identity() / settings.corner_std_px;
    let whiten = match tag.covariance_px2 {
        None => [plain; 4],
        Some(covariances) => covariances.map(|c| c.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or(plain)),
    };
    Ok(Observation {
        view: usize::MAX,
        tag: usize::MAX,
        camera,
        corners_px: tag.corners_px.map(Vector2::from),
        whiten,
        corners_m: square_corners(size_m).map(|corner| corner.coords),
        best,
        other,
        is_used: true,
    })
}
