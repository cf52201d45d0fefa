//! Pairs of tags in one view: the map's distances against those seen, without the arm.
//!
//! For two tags a and b in one view, a's pose in the camera `C_a` and the map's `a_from_b` predict b's position. The
//! mismatch is its distance from the seen position, over the distance between both; the median over all pairs counts.
//! One scale of all tags is removed first, by the median ratio of the map's distances to the seen ones.

use crate::explain::constants::wrong_input_pairs::MIN_PAIRS;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::views::view::{TagMeasurement, TagObservation, View};
use armcal_core::optics::{CameraModel, solve_square_both};
use armcal_core::robot::SurveyedTag;
use armcal_core::stats::quantile;

/// Median over all pairs of tags in one view: the map's distances over those seen, and the mismatch with that scale.
pub(crate) struct Pairs {
    pub ratio: f64,
    pub mismatch: f64,
}

/// Tag with its poses in one view.
pub(crate) struct PosedTag<'a> {
    pub surveyed: &'a SurveyedTag,
    /// Poses in the camera frame; two if a square has two.
    poses: Vec<Isometry3<f64>>,
}

pub(crate) fn mismatch(views: &[&View], tags: &[SurveyedTag], lens: &CameraModel) -> Option<Pairs> {
    let posed: Vec<Vec<PosedTag<'_>>> = views.iter().map(|view| posed_tags(view, tags, lens)).collect();
    let pairs: Vec<(&PosedTag<'_>, &PosedTag<'_>)> = posed.iter().flat_map(|of_view| ordered_pairs(of_view)).collect();
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let of_pair = |(a, b): &(&PosedTag<'_>, &PosedTag<'_>)| {
        let by_map = a.surveyed.base_from_tag.isometry().inv_mul(b.surveyed.base_from_tag.isometry());
        by_map.translation.vector.norm() / (a.center() - b.center()).norm().max(1e-9)
    };
    let ratio = quantile(&pairs.iter().map(of_pair).collect::<Vec<f64>>(), 0.5)?;
    let mismatches: Vec<f64> = pairs.iter().map(|(a, b)| a.mismatch_of(b, ratio)).collect();
    Some(Pairs { ratio, mismatch: quantile(&mismatches, 0.5)? })
}

/// Mismatch of positions without rotations: deviation of the distance ratio of two tags from the median ratio.
pub(crate) fn distances(views: &[&View], tags: &[SurveyedTag]) -> Option<Pairs> {
    let place_m = |seen: &TagObservation| {
        let tag = tags.get(seen.tag_idx).filter(|tag| tag.is_known())?;
        Some((tag.base_from_tag.origin().vector(), seen.center_in_camera_m))
    };
    let mut ratios = Vec::new();
    for view in views {
        let places: Vec<(Vector3<f64>, Vector3<f64>)> = view.tags.iter().filter_map(place_m).collect();
        for (n, (a, seen_a)) in places.iter().enumerate() {
            let of_pair = |(b, seen_b): &(Vector3<f64>, Vector3<f64>)| (a - b).norm() / (seen_a - seen_b).norm();
            ratios.extend(places[n + 1..].iter().map(of_pair).filter(|ratio| ratio.is_finite() && *ratio > 0.0));
        }
    }
    if ratios.len() < MIN_PAIRS {
        return None;
    }
    let ratio = quantile(&ratios, 0.5)?;
    let off: Vec<f64> = ratios.iter().map(|of_pair| (of_pair / ratio - 1.0).abs()).collect();
    Some(Pairs { ratio, mismatch: quantile(&off, 0.5)? })
}

fn ordered_pairs<'a, 'b>(tags: &'b [PosedTag<'a>]) -> impl Iterator<Item = (&'b PosedTag<'a>, &'b PosedTag<'a>)> {
    let each = move |(n, a)| tags.iter().enumerate().filter(move |(m, _)| *m != n).map(move |(_, b)| (a, b));
    tags.iter().enumerate().flat_map(each)
}

pub(crate) fn posed_tags<'a>(view: &View, tags: &'a [SurveyedTag], lens: &CameraModel) -> Vec<PosedTag<'a>> {
    let posed = |seen: &TagObservation| {
        let surveyed = tags.get(seen.tag_idx).filter(|tag| tag.is_known())?;
        let poses = match &seen.measured {
            TagMeasurement::Corners(corners) => {
                let (best, other) = solve_square_both(lens, surveyed.size_m, &corners.corners_px).ok()?;
                [Some(best), other].into_iter().flatten().map(|pose| *pose.camera_from_tag.isometry()).collect()
            }
            TagMeasurement::Pose(pose) => vec![*pose],
            TagMeasurement::Board(seen) => vec![seen.camera_from_board],
            TagMeasurement::Position => return None,
        };
        Some(PosedTag { surveyed, poses })
    };
    view.tags.iter().filter_map(posed).collect()
}

impl PosedTag<'_> {
    fn center(&self) -> Vector3<f64> {
        self.poses[0].translation.vector
    }

    /// Camera positions by the map and the tag's poses, in the map's frame, m.
    pub(crate) fn camera_places_m(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.poses.iter().map(|pose| (self.surveyed.base_from_tag.isometry() * pose.inverse()).translation.vector)
    }

    /// Distance between the position of `other` by this tag and the map and its seen position, over the distance of
    /// both.
    fn mismatch_of(&self, other: &Self, ratio: f64) -> f64 {
        let (from, to) = (self.surveyed.base_from_tag.isometry(), other.surveyed.base_from_tag.isometry());
        let place = Point3::from(from.inv_mul(to).translation.vector / ratio);
        let off = |pose: &Isometry3<f64>| ((pose * place).coords - other.center()).norm();
        let least = self.poses.iter().map(off).fold(f64::INFINITY, f64::min);
        least / (self.center() - other.center()).norm().max(1e-9)
    }
}

/// Median mismatch of the tag `id` with its position by the tags `others`, if it is mounted at `place`.
pub(crate) fn mismatch_at(
    posed: &[Vec<PosedTag<'_>>],
    id: u32,
    place: &SurveyedTag,
    others: &[&SurveyedTag],
) -> Option<f64> {
    let is_other = |of: u32| of != id && others.iter().any(|other| other.id == of);
    let pairs = posed.iter().flat_map(|of_view| ordered_pairs(of_view));
    let of_tag = pairs.filter(|(a, b)| b.surveyed.id == id && is_other(a.surveyed.id));
    let mismatch = |(a, b): (&PosedTag<'_>, &PosedTag<'_>)| {
        a.mismatch_of(&PosedTag { surveyed: place, poses: b.poses.clone() }, 1.0)
    };
    quantile(&of_tag.map(mismatch).collect::<Vec<f64>>(), 0.5)
}
