//! The pose of a square tag from its four corner pixels.
//!
//! A homography between the tag's plane and the bearings gives the initial guess; Levenberg-Marquardt on the pixels
//! refines it. The bearings are turned so that the tag lies ahead, which keeps fisheye angles beyond 90 deg regular. A
//! square viewed nearly head-on has two poses that fit almost equally well (Collins and Bartoli 2014). Both are
//! refined, the better one is taken, and the ratio of their costs is reported. The tag's centre hardly depends on this
//! choice.

use nalgebra::{Isometry3, Matrix2x6, Matrix3, Matrix6, Point3, Rotation3, SMatrix, SVector, Translation3};
use nalgebra::{UnitQuaternion, Vector2, Vector3, Vector6};

use super::camera::Lens;
use crate::numeric::{Damping, LeastSquares, Outcome, Proposal, StopRule, minimize};
use crate::spatial::{Camera, Pose, Tag, skew};

/// Pose of a tag in the camera frame, with its residual and covariance.
#[derive(Clone, Copy, Debug)]
pub struct SquarePose {
    /// Pose of the tag; its z axis points out of the printed side.
    pub camera_from_tag: Pose<Camera, Tag>,
    /// Root mean square residual over the 8 corner coordinates, px.
    pub rms_px: f64,
    /// Cost of the other solution over this one's, 1 or more; near 1 the tilt is ambiguous.
    pub ambiguity: f64,
    /// Covariance of the pose for 1 px corners, on the right: (translation m, rotation rad), tag frame.
    pub covariance_unit_px: Matrix6<f64>,
}

/// Reason why corners have no pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum SquareError {
    #[error("a corner lies outside of the lens's field of view")]
    OutOfView,
    #[error("the corners do not form a square seen from its front")]
    Degenerate,
}

/// The four corners of a square in its own frame, m, in the order of a detection: bottom left, bottom right, top right,
/// top left as printed.
#[must_use]
pub fn square_corners(size_m: f64) -> [Point3<f64>; 4] {
    let h = 0.5 * size_m;
    [[-h, -h], [h, -h], [h, h], [-h, h]].map(|[x, y]| Point3::new(x, y, 0.0))
}

/// Solves for the pose of a tag of `size_m` whose corners have the pixels `corners_px`.
///
/// # Errors
/// [`SquareError`] if a pixel has no bearing or no square fits them.
pub fn solve_square(lens: &impl Lens, size_m: f64, corners_px: &[[f64; 2]; 4]) -> Result<SquarePose, SquareError> {
    let (best, other) = both(lens, &square_corners(size_m), corners_px)?;
    best.pose(other.map(|o| o.cost)).ok_or(SquareError::Degenerate)
}

/// Returns both poses that a square with corners at `corners_px` may have, the better one first. The second is `None`
/// if there is only one.
///
/// # Errors
/// The errors of [`solve_square`].
pub fn solve_square_both(
    lens: &impl Lens,
    size_m: f64,
    corners_px: &[[f64; 2]; 4],
) -> Result<(SquarePose, Option<SquarePose>), SquareError> {
    let corners_tag = square_corners(size_m);
    let (best, other) = both(lens, &corners_tag, corners_px)?;
    let differs = |o: &Refined| o.pose.rotation.angle_to(&best.pose.rotation) > SAME_SOLUTION_RAD;
    // Both starts may have led to one pose. The mirror image of the result is a better start than that of the
    // homography.
    let other = other.filter(differs);
    let other = other.or_else(|| refine(lens, flipped(&best.pose), &corners_tag, corners_px).filter(differs));
    let first = best.pose(other.as_ref().map(|o| o.cost)).ok_or(SquareError::Degenerate)?;
    Ok((first, other.and_then(|o| o.pose(Some(best.cost)))))
}

/// Returns both solutions, the better one first.
fn both(
    lens: &impl Lens,
    corners_tag: &[Point3<f64>; 4],
    corners_px: &[[f64; 2]; 4],
) -> Result<(Refined, Option<Refined>), SquareError> {
    let mut bearings = [Vector3::zeros(); 4];
    for (bearing, corner) in bearings.iter_mut().zip(corners_px) {
        *bearing = lens.unproject(&Vector2::from(*corner)).ok_or(SquareError::OutOfView)?.into_inner();
    }
    let first = start_from_homography(&bearings, corners_tag)?;
    let best = refine(lens, first, corners_tag, corners_px);
    let other = refine(lens, flipped(&first), corners_tag, corners_px);
    match (best, other) {
        (Some(a), Some(b)) if b.cost < a.cost => Ok((b, Some(a))),
        (Some(a), b) => Ok((a, b)),
        (None, Some(b)) => Ok((b, None)),
        (None, None) => Err(SquareError::Degenerate),
    }
}

/// Angle between two solutions below which they count as one.
const SAME_SOLUTION_RAD: f64 = 1e-4;

/// Computes the square's homography by the direct linear transform, with bearings turned so that their mean is the z
/// axis.
fn start_from_homography(
    bearings: &[Vector3<f64>; 4],
    corners_tag: &[Point3<f64>; 4],
) -> Result<Isometry3<f64>, SquareError> {
    let mean = bearings.iter().sum::<Vector3<f64>>();
    let turn = UnitQuaternion::rotation_between(&mean, &Vector3::z()).ok_or(SquareError::Degenerate)?;
    let mut system = SMatrix::<f64, 8, 8>::zeros();
    let mut right = SVector::<f64, 8>::zeros();
    for (k, (bearing, corner)) in bearings.iter().zip(corners_tag).enumerate() {
        let ahead = turn * bearing;
        if ahead.z < 0.05 {
            return Err(SquareError::Degenerate);
        }
        let (u, v) = (ahead.x / ahead.z, ahead.y / ahead.z);
        let (x, y) = (corner.x, corner.y);
        system.set_row(2 * k, &SMatrix::from([[x], [y], [1.0], [0.0], [0.0], [0.0], [-u * x], [-u * y]]));
        system.set_row(2 * k + 1, &SMatrix::from([[0.0], [0.0], [0.0], [x], [y], [1.0], [-v * x], [-v * y]]));
        right[2 * k] = u;
        right[2 * k + 1] = v;
    }
    let h = system.lu().solve(&right).ok_or(SquareError::Degenerate)?;
    pose_of_homography(&h, &turn)
}

/// Returns the pose by a homography whose last number is 1, of bearings turned by `turn`.
pub(super) fn pose_of_homography(
    h: &SVector<f64, 8>,
    turn: &UnitQuaternion<f64>,
) -> Result<Isometry3<f64>, SquareError> {
    let (h1, h2, h3) = (Vector3::new(h[0], h[3], h[6]), Vector3::new(h[1], h[4], h[7]), Vector3::new(h[2], h[5], 1.0));
    let scale = 2.0 / (h1.norm() + h2.norm());
    if !scale.is_finite() {
        return Err(SquareError::Degenerate);
    }
    let (r1, r2) = (h1 * scale, h2 * scale);
    let raw = Matrix3::from_columns(&[r1, r2, r1.cross(&r2)]);
    let svd = raw.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Err(SquareError::Degenerate) };
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * vt).determinant())) * vt;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let ahead = Isometry3::from_parts(Translation3::from(h3 * scale), rotation);
    Ok(Isometry3::from_parts(Translation3::identity(), turn.inverse()) * ahead)
}

/// Returns the mirror solution: the tag's normal reflected about the line of sight.
pub(super) fn flipped(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let sight = pose.translation.vector.normalize();
    let normal = pose.rotation * Vector3::z();
    let mirrored = 2.0 * normal.dot(&sight) * sight - normal;
    let turn = UnitQuaternion::rotation_between(&normal, &mirrored).unwrap_or_else(UnitQuaternion::identity);
    Isometry3::from_parts(pose.translation, turn * pose.rotation)
}

pub(super) struct Refined {
    pub pose: Isometry3<f64>,
    /// Sum of squared residuals, px^2.
    pub cost: f64,
    normal: Matrix6<f64>,
}

impl Refined {
    /// Returns the pose with its covariance; `None` if the corners do not determine it.
    fn pose(&self, other_cost: Option<f64>) -> Option<SquarePose> {
        Some(SquarePose {
            camera_from_tag: Pose::from_isometry(self.pose),
            rms_px: (self.cost / 8.0).sqrt(),
            ambiguity: other_cost.map_or(f64::INFINITY, |other| (other / self.cost.max(1e-12)).max(1.0)),
            covariance_unit_px: self.normal.try_inverse()?,
        })
    }
}

const DAMPING: Damping = Damping { first: 1e-4, min: 1e-12, max: 1e8, down: 0.1, up: 10.0, min_after_rejection: 0.0 };
/// Rule that stops at a twist (m, rad) too small to move a corner.
const STOP: StopRule = StopRule { step_length: 1e-12, ..StopRule::after(30) };

struct Refinement<'a, L> {
    lens: &'a L,
    corners_tag: &'a [Point3<f64>],
    corners_px: &'a [[f64; 2]],
    here: Linearized,
    trial_pose: Isometry3<f64>,
    trial: Option<Linearized>,
}

impl<L: Lens> LeastSquares for Refinement<'_, L> {
    fn cost(&self) -> f64 {
        self.here.cost
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        let mut normal = self.here.normal;
        for k in 0..6 {
            normal[(k, k)] *= 1.0 + damping;
        }
        let step = normal.cholesky()?.solve(&self.here.gradient);
        self.trial_pose = self.here.pose * crate::spatial::exp(&step);
        Some(Proposal { length: step.norm(), predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.trial = linearize(self.lens, &self.trial_pose, self.corners_tag, self.corners_px);
        self.trial.as_ref().map(|trial| trial.cost)
    }

    fn accept(&mut self) {
        if let Some(trial) = self.trial.take() {
            self.here = trial;
        }
    }
}

/// Refines a tag's pose. A tag is printed on one side, so its z axis must point towards the camera.
fn refine(
    lens: &impl Lens,
    start: Isometry3<f64>,
    corners_tag: &[Point3<f64>; 4],
    corners_px: &[[f64; 2]; 4],
) -> Option<Refined> {
    let faces_camera = |pose: &Isometry3<f64>| (pose.rotation * Vector3::z()).dot(&pose.translation.vector) < 0.0;
    refine_points(lens, start, corners_tag, corners_px).filter(|found| faces_camera(&found.pose))
}

/// Returns the pose of points, from either side, that is nearest to `start`; `None` if they do not determine it.
pub(super) fn refine_points(
    lens: &impl Lens,
    start: Isometry3<f64>,
    corners_tag: &[Point3<f64>],
    corners_px: &[[f64; 2]],
) -> Option<Refined> {
    let here = linearize(lens, &start, corners_tag, corners_px)?;
    let mut refinement = Refinement { lens, corners_tag, corners_px, here, trial_pose: start, trial: None };
    if minimize(&mut refinement, &DAMPING, &STOP).outcome() == Outcome::Degenerate {
        return None;
    }
    let best = refinement.here;
    Some(Refined { pose: best.pose, cost: best.cost, normal: best.normal })
}

struct Linearized {
    pose: Isometry3<f64>,
    cost: f64,
    normal: Matrix6<f64>,
    gradient: Vector6<f64>,
}

/// Linearizes the residual, measured - predicted. The Jacobian is that of the prediction for a perturbation on the
/// right, pose * exp(xi).
fn linearize(
    lens: &impl Lens,
    pose: &Isometry3<f64>,
    corners_tag: &[Point3<f64>],
    corners_px: &[[f64; 2]],
) -> Option<Linearized> {
    let rotation = pose.rotation.to_rotation_matrix();
    let mut out = Linearized { pose: *pose, cost: 0.0, normal: Matrix6::zeros(), gradient: Vector6::zeros() };
    for (corner, measured) in corners_tag.iter().zip(corners_px) {
        let point = pose * corner;
        let (pixel, by_point) = lens.project_with_jacobian(&point.coords)?;
        let mut jacobian = Matrix2x6::zeros();
        let by_translation = by_point * rotation.matrix();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&by_translation);
        jacobian.fixed_columns_mut::<3>(3).copy_from(&(-by_translation * skew(&corner.coords)));
        let residual = Vector2::from(*measured) - pixel;
        out.cost += residual.norm_squared();
        out.normal += jacobian.transpose() * jacobian;
        out.gradient += jacobian.transpose() * residual;
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::fixture::lens;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn recovers_the_pose_of_a_noiseless_tag(
            x in -0.8f64..0.8, y in -0.8f64..0.8, z in 0.3f64..1.5,
            tilt in 0.2f64..0.9, azimuth in -3.0f64..3.0, spin in -3.0f64..3.0,
        ) {
            // The tag's z axis points towards the camera, tilted away from the line of sight.
            let sight = Vector3::new(x, y, z);
            let facing = UnitQuaternion::rotation_between(&Vector3::z(), &-sight).expect("not opposite");
            let lean = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt);
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * spin);
            let pose = Isometry3::from_parts(Translation3::from(sight), facing * lean * turn);
            let mut corners = [[0.0; 2]; 4];
            for (pixel, corner) in corners.iter_mut().zip(square_corners(0.15)) {
                let Some(p) = lens().project(&(pose * corner).coords) else { return Ok(()) };
                *pixel = p.into();
            }
            let solved = solve_square(&lens(), 0.15, &corners).expect("a clean square");
            prop_assert!(solved.rms_px < 1e-6, "rms {}", solved.rms_px);
            let error = crate::spatial::log(&(solved.camera_from_tag.isometry().inverse() * pose));
            prop_assert!(error.norm() < 1e-6, "error {}", error.norm());
        }
    }
}
