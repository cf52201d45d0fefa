//! The map, and how good it is.

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
    /// In the group's frame.
    pub frame_from_tag: Isometry3<f64>,
    /// Of a perturbation on the right, `frame_from_tag * exp(xi)`, xi = (translation m, rotation rad) along the tag's
    /// axes. It is relative to what anchors the group: zero for a tag that is held.
    pub covariance: Matrix6<f64>,
    /// Number of views in the fit that show it.
    pub n_views: usize,
    /// Of its corners: root mean square distance between measured and predicted pixel; 0 where none is used.
    pub rms_px: f64,
    /// Held at the place it was given, or at the origin.
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

/// In which frame a group's tags are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GroupFrame {
    /// That of a body, by tags whose places on it are known.
    Body(String),
    /// That of one of its tags, for nothing ties the group to any other.
    Tag(u32),
}

/// Tags that views connect with each other, and with no others.
#[derive(Clone, Debug)]
pub struct MapGroup {
    /// Frame of its tags' `frame_from_tag`.
    pub frame: GroupFrame,
    /// Indices into the input's bodies.
    pub bodies: Vec<usize>,
    /// Ascending.
    pub tags: Vec<u32>,
    /// Views in the fit that show a tag of the group.
    pub n_views: usize,
}

/// Where one group was seen from another's frame, in one view that shows both.
#[derive(Clone, Debug)]
pub struct RelativeBodyPose {
    /// Index into the input's views.
    pub view: usize,
    /// Indices into [`TagMap::groups`].
    pub first: usize,
    /// See `first`.
    pub second: usize,
    /// Frame of the first group from that of the second.
    pub first_from_second: Isometry3<f64>,
    /// On the right, (translation m, rotation rad) along the axes of the second group's frame.
    pub covariance: Matrix6<f64>,
}

/// What [`super::solve`] finds.
#[derive(Clone, Debug)]
pub struct TagMap {
    /// The anchored groups first, then by their smallest tag.
    pub groups: Vec<MapGroup>,
    /// By id.
    pub tags: Vec<MappedTag>,
    /// For each view of the input and each group: frame_from_camera, where it shows tags of the group.
    pub views: Vec<BTreeMap<usize, Isometry3<f64>>>,
    /// By view, then by `second`; `first` is the same for all of a view.
    pub relative: Vec<RelativeBodyPose>,
    /// All of the input, rejected ones included.
    pub n_detections: usize,
    /// Detections in the fit.
    pub n_used: usize,
    /// Root mean square distance between measured and predicted corner over all that are in the fit, px.
    pub rms_px: f64,
    /// The same over those too that were rejected as inconsistent but have a prediction.
    pub rms_all_px: f64,
    /// Median distance between measured and predicted corner over all that are in the fit.
    pub median_px: f64,
    /// Sum of squared whitened residuals and its degrees of freedom.
    pub chi_square: f64,
    /// Corner and prior residuals less the unknowns of tags and views.
    pub degrees_of_freedom: usize,
    /// By what the corners' standard deviations were multiplied in the end; 1 if the noise was given.
    pub noise_scale: f64,
    /// By view, then by id.
    pub rejected: Vec<RejectedDetection>,
    /// Tags whose size disagrees with the known distances between tags.
    pub scale_warnings: Vec<ScaleWarning>,
    /// Sentences for people; empty where nothing is doubtful.
    pub warnings: Vec<Warning>,
    /// Whether groups that must be one map fell apart, or an id is on two tags.
    pub is_contradicted: bool,
    /// Whether the last fit found a minimum.
    pub has_converged: bool,
    /// Steps of all fits.
    pub n_steps: usize,
    pub(super) factor: Option<Factor>,
    /// Of lenses that were estimated with the map; without, they count as exact.
    pub(super) lens_errors: Option<LensErrors>,
}

impl TagMap {
    /// The map with what its estimated lenses add to the covariances of its tags.
    pub(super) fn with_lens_errors(mut self, errors: LensErrors) -> Self {
        for tag in &mut self.tags {
            if let Some(node) = tag.node {
                tag.covariance += errors.common(node, node);
            }
        }
        self.lens_errors = Some(errors);
        self
    }

    /// The tag of that id; `None` where the map lacks it.
    #[must_use]
    pub fn tag(&self, id: u32) -> Option<&MappedTag> {
        self.tags.binary_search_by_key(&id, |tag| tag.id).ok().map(|idx| &self.tags[idx])
    }

    /// How many detections were rejected for each reason.
    #[must_use]
    pub fn rejected_by_reason(&self) -> BTreeMap<MapRejection, usize> {
        let mut counts = BTreeMap::new();
        for rejected in &self.rejected {
            *counts.entry(rejected.reason).or_default() += 1;
        }
        counts
    }

    /// Joint covariance of several tags, 6 rows for each in the order asked for, as [`MappedTag::covariance`]; `None`
    /// if one of them is not in the map.
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
