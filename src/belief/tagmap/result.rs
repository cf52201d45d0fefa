//! The map, and its accuracy.

use armcal_core::codes::Warning;
use std::collections::BTreeMap;

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6};

use crate::tagmap::lens_fit::LensErrors;
use crate::tagmap::scale::ScaleWarning;
use crate::tagmap::sparse::Factor;
use crate::tagmap::types::{MapRejection, RejectedDetection};

/// A tag's estimate.
#[derive(Clone, Debug)]
pub struct MappedTag {
    /// Number of the tag.
    pub id: u32,
    /// Side of the black square, as given.
    pub size_m: f64,
    /// Index into [`TagMap::groups`].
    pub group: usize,
    /// Pose in the group's frame.
    pub frame_from_tag: Isometry3<f64>,
    /// Covariance of a perturbation on the right, `frame_from_tag * exp(xi)`, xi = (translation m, rotation rad) along
    /// the tag's axes. It is relative to the anchor of the group: zero for a held tag.
    pub covariance: Matrix6<f64>,
    /// Number of views in the fit that show the tag.
    pub n_views: usize,
    /// Root mean square distance between measured and predicted corners of the tag, px; 0 if no corner is used.
    pub rms_px: f64,
    /// True if the tag is held at its given place, or at the origin.
    pub is_fixed: bool,
    /// Index into the solver's free tags.
    pub(super) node: Option<usize>,
}

impl MappedTag {
    /// Covariance of the tag's position along the axes of the group's frame, m^2.
    #[must_use]
    pub fn position_covariance_m2(&self) -> Matrix3<f64> {
        let turn = self.frame_from_tag.rotation.to_rotation_matrix();
        turn * self.covariance.fixed_view::<3, 3>(0, 0).into_owned() * turn.transpose()
    }

    /// Standard deviations along the axes of the group's frame, m.
    #[must_use]
    pub fn position_std_m(&self) -> [f64; 3] {
        let covariance = self.position_covariance_m2();
        [0, 1, 2].map(|k| covariance[(k, k)].max(0.0).sqrt())
    }

    /// Standard deviations of the rotation about the tag's axes, rad.
    #[must_use]
    pub fn rotation_std_rad(&self) -> [f64; 3] {
        [3, 4, 5].map(|k| self.covariance[(k, k)].max(0.0).sqrt())
    }
}

/// Frame of a group's tags.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GroupFrame {
    /// Frame of the body with this name, from tags whose places on it are known.
    Body(String),
    /// Frame of the tag with this id, because nothing ties the group to any other.
    Tag(u32),
}

/// Tags that views connect with each other, and with no others.
#[derive(Clone, Debug)]
pub struct MapGroup {
    /// Frame of its tags' `frame_from_tag`.
    pub frame: GroupFrame,
    /// Indices into the input's bodies.
    pub bodies: Vec<usize>,
    /// Ids of the tags, ascending.
    pub tags: Vec<u32>,
    /// Views in the fit that show a tag of the group.
    pub n_views: usize,
}

/// Pose of one group in another's frame, in one view that shows both.
#[derive(Clone, Debug)]
pub struct RelativeBodyPose {
    /// Index into the input's views.
    pub view: usize,
    /// Indices into [`TagMap::groups`].
    pub first: usize,
    /// Index into [`TagMap::groups`] of the second group.
    pub second: usize,
    /// Pose of the second group's frame in the first's.
    pub first_from_second: Isometry3<f64>,
    /// Covariance of a perturbation on the right, (translation m, rotation rad) along the axes of the second group's
    /// frame.
    pub covariance: Matrix6<f64>,
}

/// Result of [`super::solve`].
#[derive(Clone, Debug)]
pub struct TagMap {
    /// The anchored groups first, then by their smallest tag.
    pub groups: Vec<MapGroup>,
    /// Tags, sorted by id.
    pub tags: Vec<MappedTag>,
    /// For each view of the input, frame_from_camera of each group with tags in it.
    pub views: Vec<BTreeMap<usize, Isometry3<f64>>>,
    /// Relative poses, sorted by view, then by `second`; `first` is the same for all of a view.
    pub relative: Vec<RelativeBodyPose>,
    /// Number of all detections in the input, including rejected ones.
    pub n_detections: usize,
    /// Number of detections in the fit.
    pub n_used: usize,
    /// Root mean square distance between measured and predicted corners of all detections in the fit, px.
    pub rms_px: f64,
    /// Root mean square distance that also includes rejected detections which have a prediction, px.
    pub rms_all_px: f64,
    /// Median distance between measured and predicted corners of all detections in the fit, px.
    pub median_px: f64,
    /// Sum of squared whitened residuals.
    pub chi_square: f64,
    /// Number of corner and prior residuals less the unknowns of tags and views.
    pub degrees_of_freedom: usize,
    /// Final factor of the corners' standard deviations; 1 if the noise was given.
    pub noise_scale: f64,
    /// Rejected detections, sorted by view, then by id.
    pub rejected: Vec<RejectedDetection>,
    /// Tags whose size disagrees with the known distances between tags.
    pub scale_warnings: Vec<ScaleWarning>,
    /// Warnings as sentences; empty if nothing is doubtful.
    pub warnings: Vec<Warning>,
    /// True if groups that must be one map fell apart, or an id is on two tags.
    pub is_contradicted: bool,
    /// True if the last fit found a minimum.
    pub has_converged: bool,
    /// Number of steps of all fits.
    pub n_steps: usize,
    pub(super) factor: Option<Factor>,
    /// Errors of lenses that were estimated with the map; `None`: lenses count as exact.
    pub(super) lens_errors: Option<LensErrors>,
}

impl TagMap {
    /// Returns the map with the errors of its estimated lenses added to the covariances of its tags.
    pub(super) fn with_lens_errors(mut self, errors: LensErrors) -> Self {
        for tag in &mut self.tags {
            if let Some(node) = tag.node {
                tag.covariance += errors.common(node, node);
            }
        }
        self.lens_errors = Some(errors);
        self
    }

    /// Returns the tag with that id; `None` if the map has none.
    #[must_use]
    pub fn tag(&self, id: u32) -> Option<&MappedTag> {
        self.tags.binary_search_by_key(&id, |tag| tag.id).ok().map(|idx| &self.tags[idx])
    }

    /// Number of rejected detections for each reason.
    #[must_use]
    pub fn rejected_by_reason(&self) -> BTreeMap<MapRejection, usize> {
        let mut counts = BTreeMap::new();
        for rejected in &self.rejected {
            *counts.entry(rejected.reason).or_default() += 1;
        }
        counts
    }

    /// Joint covariance of several tags, 6 rows each in the order of `ids`, in the form of [`MappedTag::covariance`].
    /// `None` if one of them is not in the map.
    #[must_use]
    pub fn joint_covariance(&self, ids: &[u32]) -> Option<DMatrix<f64>> {
        let nodes = ids.iter().map(|id| self.tag(*id).map(|tag| tag.node)).collect::<Option<Vec<_>>>()?;
        let mut out = DMatrix::zeros(6 * ids.len(), 6 * ids.len());
        let Some(factor) = &self.factor else { return Some(out) };
        for (column, node) in nodes.iter().enumerate() {
            let Some(node) = node else { continue };
            let blocks = factor.inverse_column(*node);
            for (row, other) in nodes.iter().enumerate() {
                let Some(other) = other else { continue };
                let of_lens = self.lens_errors.as_ref().map_or_else(Matrix6::zeros, |by| by.common(*other, *node));
                out.fixed_view_mut::<6, 6>(6 * row, 6 * column).copy_from(&(blocks[*other] + of_lens));
            }
        }
        Some(out)
    }
}
