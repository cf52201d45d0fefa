//! Error that all tags of a map share: the error of its anchor tag.
//!
//! The anchor has the place A and the error `A exp(xi)`, `xi = (rho, omega)`. A tag at x in its frame then has the
//! error `R (rho - [x] omega)`, where R is the rotation of A. A prior of each single tag does not model that. Such
//! priors hold no more information than all tags have together if the shared variance counts 1/w times in each. The sum
//! of all w is one (covariance intersection, Julier and Uhlmann 1997).

use crate::model::constants::shared_survey_error::{ANCHOR_WEIGHT, POSITION_WEIGHT};
use nalgebra::{Isometry3, Matrix3x6};

use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::spatial::skew;

/// The error of a map's anchor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedSurveyError {
    /// Place of the anchor in the frame of the map.
    pub(crate) anchor: Isometry3<f64>,
    /// One sigma of the anchor's position per axis.
    pub(crate) position_std_m: f64,
    /// One sigma of the anchor's rotation per axis.
    pub(crate) rotation_std_rad: f64,
}

impl SharedSurveyError {
    /// Returns the error that the tags of `robot` share; `None` if each was surveyed independently.
    pub(crate) fn of(robot: &Robot) -> Option<Self> {
        let anchor = robot.tag(robot.anchor_tag?).filter(|tag| tag.is_known())?;
        let SurveyedTag { position_std_m, rotation_std_rad, .. } = *anchor;
        Some(Self { anchor: *anchor.base_from_tag.isometry(), position_std_m, rotation_std_rad })
    }

    /// Shared part of the variances of a tag's position, m^2, and rotation, rad^2, limited to `std`.
    fn variances(&self, tag: &Isometry3<f64>, std: [f64; 2]) -> [f64; 2] {
        let by_turn_m = self.rotation_std_rad * self.anchor.inv_mul(tag).translation.vector.norm();
        let shared = [self.position_std_m.powi(2) + by_turn_m.powi(2), self.rotation_std_rad.powi(2)];
        [0, 1].map(|k| shared[k].min(std[k].powi(2)))
    }

    /// Standard deviations of position and rotation under which the tag may count as independent.
    fn independent_std(&self, tag: &Isometry3<f64>, std: [f64; 2], weights: [f64; 2]) -> [f64; 2] {
        let shared = self.variances(tag, std);
        [0, 1].map(|k| (std[k].powi(2) + (1.0 / weights[k] - 1.0) * shared[k]).sqrt())
    }

    /// Part of a tag's position variance that it does not share, m^2.
    pub(crate) fn own_variance_m2(&self, tag: &SurveyedTag) -> f64 {
        let std = [tag.position_std_m, tag.rotation_std_rad];
        tag.position_std_m.powi(2) - self.variances(tag.base_from_tag.isometry(), std)[0]
    }

    /// Motion of a tag's position in the frame of the map for one sigma of each axis of the anchor, m.
    pub(crate) fn motion_m(&self, tag: &SurveyedTag) -> Matrix3x6<f64> {
        let turn = *self.anchor.rotation.to_rotation_matrix().matrix();
        let x = self.anchor.inv_mul(tag.base_from_tag.isometry()).translation.vector;
        let (shift, turned) = (turn * self.position_std_m, -turn * skew(&x) * self.rotation_std_rad);
        Matrix3x6::from_fn(|row, k| if k < 3 { shift[(row, k)] } else { turned[(row, k - 3)] })
    }
}

/// Weights of the tags' positions and rotations in the estimate of their map's place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    anchor: [f64; 2],
    other: [f64; 2],
}

impl Weights {
    /// Returns the weights for `n_anchors` (none or one) and for `n_others` other tags.
    pub(crate) fn of(n_anchors: usize, n_others: usize) -> Self {
        let anchor = if n_others == 0 { 1.0 } else { ANCHOR_WEIGHT };
        let left = if n_anchors > 0 { 1.0 - ANCHOR_WEIGHT } else { 1.0 };
        let other = left / n_others.max(1) as f64;
        // An anchor's own position and rotation are independent.
        Self { anchor: [anchor; 2], other: [POSITION_WEIGHT, 1.0 - POSITION_WEIGHT].map(|weight| weight * other) }
    }

    /// Six standard deviations of a tag, the shift's before the turn's, under which it counts as independent.
    pub(crate) fn independent(
        &self,
        shared: &SharedSurveyError,
        (tag, is_anchor): (&Isometry3<f64>, bool),
        std: &[f64; 6],
    ) -> [f64; 6] {
        let weights = if is_anchor { self.anchor } else { self.other };
        std::array::from_fn(|k| shared.independent_std(tag, [std[k]; 2], weights)[usize::from(k > 2)])
    }
}

/// Gives the known tags of `robot` standard deviations under which those with `is_seen` count as independent.
pub(crate) fn count_as_independent(robot: &mut Robot, is_seen: impl Fn(usize) -> bool) {
    let Some(shared) = SharedSurveyError::of(robot) else { return };
    let anchor_tag = robot.anchor_tag;
    let is_anchor = |tag: &SurveyedTag| Some(tag.id) == anchor_tag;
    let seen = || robot.tags.iter().enumerate().filter(|(idx, tag)| is_seen(*idx) && tag.is_known());
    let n_others = seen().filter(|(_, tag)| !is_anchor(tag)).count();
    let weights = Weights::of(seen().count() - n_others, n_others);
    for tag in robot.tags.iter_mut().filter(|tag| tag.is_known()) {
        let (m, rad) = (tag.position_std_m, tag.rotation_std_rad);
        let place = (tag.base_from_tag.isometry(), is_anchor(tag));
        let std = weights.independent(&shared, place, &[m, m, m, rad, rad, rad]);
        (tag.position_std_m, tag.rotation_std_rad) = (std[0], std[3]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

    use crate::fixture::titan;
    use armcal_core::spatial::{Pose, adjoint, exp};
    use armcal_core::stats::stream_rng;
    use rand::RngExt;

    /// A robot with tags around an anchor whose errors are only the anchor's.
    fn robot(seed: u64) -> Robot {
        let mut rng = stream_rng(seed, "anchored");
        let mut robot = titan();
        for tag in &mut robot.tags {
            let at = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)));
            tag.base_from_tag = Pose::from_isometry(Isometry3::from_parts(at.into(), turn));
        }
        robot.anchor_tag = Some(robot.tags[0].id);
        (robot.tags[0].position_std_m, robot.tags[0].rotation_std_rad) = (1e-3, 3e-3);
        let shared = SharedSurveyError::of(&robot).expect("an anchor");
        for tag in &mut robot.tags[1..] {
            let off_m = shared.anchor.inv_mul(tag.base_from_tag.isometry()).translation.vector.norm();
            (tag.position_std_m, tag.rotation_std_rad) = (1e-3_f64.hypot(3e-3 * off_m), 3e-3);
        }
        robot
    }

    /// The information of all tags on a motion of the map must not exceed the anchor's own in any direction.
    #[test]
    fn tags_together_are_not_surer_of_the_map_than_its_anchor_is() {
        for seed in 0..20 {
            let mut robot = robot(seed);
            let shared = SharedSurveyError::of(&robot).expect("an anchor");
            let own = Vector6::from_fn(|k, _| if k < 3 { 1e-3 } else { 3e-3 });
            let together = |robot: &Robot| -> Matrix6<f64> {
                let each = robot.tags.iter().map(|tag| {
                    let by =
                        adjoint(&tag.base_from_tag.isometry().inv_mul(&shared.anchor)) * Matrix6::from_diagonal(&own);
                    let info = |k: usize| if k < 3 { tag.position_std_m } else { tag.rotation_std_rad }.powi(-2);
                    by.transpose() * Matrix6::from_diagonal(&Vector6::from_fn(|k, _| info(k))) * by
                });
                each.sum()
            };
            let before = together(&robot).symmetric_eigen().eigenvalues;
            count_as_independent(&mut robot, |_| true);
            let after = together(&robot).symmetric_eigen().eigenvalues;
            assert!(before.max() > 2.0, "seed {seed}: {before}");
            assert!(after.max() < 1.0 + 1e-9 && after.min() > ANCHOR_WEIGHT - 1e-9, "seed {seed}: {after}");
        }
    }

    /// Compares the motion of each tag by the anchor with the motion of the whole map.
    #[test]
    fn tags_move_with_their_anchor() {
        let robot = robot(3);
        let shared = SharedSurveyError::of(&robot).expect("an anchor");
        for (tag, k) in robot.tags.iter().flat_map(|tag| (0..6).map(move |k| (tag, k))) {
            let std = if k < 3 { shared.position_std_m } else { shared.rotation_std_rad };
            let moved = shared.anchor * exp(&Vector6::ith(k, 1e-3 * std)) * shared.anchor.inverse();
            let by = (moved * tag.base_from_tag.isometry()).translation.vector
                - tag.base_from_tag.isometry().translation.vector;
            let off = by * 1e3 - shared.motion_m(tag).column(k);
            assert!(off.norm() < 1e-7, "tag {}, {k}: {off}", tag.id);
        }
    }

    #[test]
    fn a_survey_without_anchor_stays_as_it_is() {
        let (mut now, before) = (titan(), titan());
        count_as_independent(&mut now, |_| true);
        let std = |robot: &Robot| -> Vec<[f64; 2]> {
            robot.tags.iter().map(|tag| [tag.position_std_m, tag.rotation_std_rad]).collect()
        };
        assert_eq!(std(&now), std(&before));
    }
}
