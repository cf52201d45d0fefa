//! Linearized planned view: the information of its tags' corners on the camera's pose.
//!
//! A perturbation of the camera's pose on the right by `xi` (translation, rotation) moves a point p of its frame by
//! `-rho - omega x p`. So one tag has the information `H = sum over corners J^T W J`, with J = d(pixel)/d(xi) and W the
//! inverse of the corner noise. Parameters move the camera in the frame of the tags by `xi = sum_j d_j (b_j . p_j) +
//! mount - Ad(camera from tags) survey`, with d_j the camera's twist by joint j. For a fixed camera before tags on the
//! arm, d_j is the opposite of the tags' twist. The joints' own errors of a view add `sum_j d_j d_j^T s_j^2` to the
//! noise `H^-1`.

use crate::plan::constants::view_planning_view_information::{FRAMES_PER_S, OWN_SURVEY_SHARE, REFERENCE_RANGE_M};
use nalgebra::{Cholesky, Isometry3, Matrix6, SMatrix, Vector3};

use crate::measure::ImagePoint;
use crate::plan::view_planning::parameter_prior::{Basis, N_DIRECTIONS, ParameterPrior, WIDTH, basis};
use armcal_core::optics::{CornerNoise, square_corners};
use armcal_core::robot::Robot;
use armcal_core::spatial::adjoint;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Twists of the camera; columns: each joint's angle, mount, survey.
pub(crate) type Twists = SMatrix<f64, 6, N_DIRECTIONS>;

/// Information of one tag of a view.
#[derive(Clone, Debug)]
pub(crate) struct TagInformation {
    pub tag: usize,
    /// Information on the camera's pose, perturbed on the right.
    pub info: Matrix6<f64>,
    /// Adjoint Ad(camera from tag).
    pub adjoint: Matrix6<f64>,
}

/// Linearized view.
#[derive(Clone, Debug)]
pub(crate) struct ViewJacobian {
    pub basis: Basis,
    pub twists: Twists,
    pub sights: Vec<TagInformation>,
}

/// Information of a view, whitened: `z = twists (basis p, common) + unit noise`.
#[derive(Clone, Debug)]
pub(crate) struct WhitenedView {
    pub basis: Basis,
    pub twists: Twists,
}

/// Noise model of the tags' corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CornerModel {
    /// Number of images over which a view's corners are averaged.
    pub n_frames: f64,
    /// Corner noise over the datasheet's.
    pub noise: f64,
}

impl CornerModel {
    pub(crate) fn new(dwell_s: f64, noise: f64) -> Self {
        Self { n_frames: (FRAMES_PER_S * dwell_s).floor().max(1.0), noise }
    }

    /// Returns the information of one tag on the camera's pose; `None` if the lens does not see all its corners.
    pub(crate) fn information(
        &self,
        robot: &Robot,
        camera_from_tag: &Isometry3<f64>,
        size_m: f64,
    ) -> Option<Matrix6<f64>> {
        let lens = &robot.camera.lens;
        let points = square_corners(size_m).map(|corner| (camera_from_tag * corner).coords);
        let mut corners_px = [[0.0; 2]; 4];
        let mut rows = [SMatrix::<f64, 2, 6>::zeros(); 4];
        for ((pixel_px, row), point) in corners_px.iter_mut().zip(&mut rows).zip(&points) {
            let image = ImagePoint::of(lens, point)?;
            (*pixel_px, *row) = (image.pixel.into(), image.jacobian());
        }
        let weights = self.weights(robot, &corners_px, camera_from_tag.translation.vector.norm(), size_m);
        Some(rows.iter().zip(weights).map(|(row, weight)| row.tr_mul(row) * weight).sum())
    }

    /// Returns the inverse variance of each corner's coordinates, px^-2: that of robot.toml at the reference range,
    /// scaled by the corner-noise model at other ranges.
    fn weights(&self, robot: &Robot, corners_px: &[[f64; 2]; 4], range_m: f64, size_m: f64) -> [f64; 4] {
        let usual_px2 = reference_px2(robot.camera.lens.focal_px()[0], size_m);
        let stated_px2 = (robot.camera.corner_std_px * self.noise).powi(2) / self.n_frames;
        let variances = CornerNoise::COASTAL.covariances_px2(corners_px, range_m, 0.0);
        variances.map(|variance| usual_px2 / (0.5 * variance.trace() * stated_px2))
    }

    #[cfg(test)]
    pub(crate) fn corner_weights(
        &self,
        robot: &Robot,
        camera_from_tag: &Isometry3<f64>,
        size_m: f64,
    ) -> Option<[f64; 4]> {
        let mut corners_px = [[0.0; 2]; 4];
        for (pixel_px, corner) in corners_px.iter_mut().zip(square_corners(size_m)) {
            let pixel = robot.camera.lens.project(&(camera_from_tag * corner).coords)?;
            *pixel_px = [pixel.x, pixel.y];
        }
        Some(self.weights(robot, &corners_px, camera_from_tag.translation.vector.norm(), size_m))
    }
}

/// Returns a coordinate's variance by that model at the reference range, px^2.
fn reference_px2(focal_px: f64, size_m: f64) -> f64 {
    let half_px = 0.5 * focal_px * size_m / REFERENCE_RANGE_M;
    let square = [[-half_px, -half_px], [half_px, -half_px], [half_px, half_px], [-half_px, half_px]];
    0.5 * CornerNoise::COASTAL.covariances_px2(&square, REFERENCE_RANGE_M, 0.0)[0].trace()
}

impl WhitenedView {
    /// Returns a view without information.
    pub(crate) fn nothing() -> Self {
        Self { basis: [[0.0; WIDTH]; MAX_JOINTS], twists: Twists::zeros() }
    }
}

impl ViewJacobian {
    /// Linearizes a view. `tags`: index, and probability that the camera sees it.
    pub(crate) fn new(robot: &Robot, optics: CornerModel, angles: &JointAngles, tags: &[(usize, f64)]) -> Self {
        let poses = robot.chain.link_poses(angles).in_frame(&robot.tag_frame);
        let tags_from_camera = poses.frame(&robot.camera.mount);
        let camera_from_tags = tags_from_camera.inverse();
        let (eye_m, turn) = (tags_from_camera.translation.vector, camera_from_tags.rotation);
        let n_joints = robot.n_seen_joints();
        // For a fixed camera the joints move the tags.
        let sign = if robot.is_watched() { -1.0 } else { 1.0 };
        let mut twists = Twists::zeros();
        let mut by_joint: Basis = [[0.0; WIDTH]; MAX_JOINTS];
        for (joint, by_parameter) in by_joint.iter_mut().enumerate().take(n_joints) {
            *by_parameter = basis(robot, joint, angles[joint]);
            let moved: Vector3<f64> = turn * poses.point_jacobian(joint, &eye_m) * sign;
            let turned: Vector3<f64> = turn * poses.turn_jacobian(joint) * sign;
            twists.fixed_view_mut::<3, 1>(0, joint).copy_from(&moved);
            twists.fixed_view_mut::<3, 1>(3, joint).copy_from(&turned);
        }
        twists.fixed_view_mut::<6, 6>(0, MAX_JOINTS).fill_diagonal(1.0);
        twists.fixed_view_mut::<6, 6>(0, MAX_JOINTS + 6).copy_from(&-adjoint(&camera_from_tags));
        let sight = |&(tag, probability): &(usize, f64)| {
            let surveyed = &robot.tags[tag];
            let camera_from_tag = camera_from_tags * surveyed.base_from_tag.isometry();
            let info = optics.information(robot, &camera_from_tag, surveyed.size_m)? * probability;
            Some(TagInformation { tag, info, adjoint: adjoint(&camera_from_tag) })
        };
        Self { basis: by_joint, twists, sights: tags.iter().filter_map(sight).collect() }
    }

    /// Whitens the view; `None` if the tags give no information on the camera's pose.
    pub(crate) fn telling(&self, robot: &Robot, unknowns: &ParameterPrior) -> Option<WhitenedView> {
        let mut info = Matrix6::zeros();
        for sight in &self.sights {
            info += with_own_survey_error(robot, sight)?;
        }
        let mut noise = Cholesky::new(info)?.inverse();
        for joint in 0..unknowns.n_joints {
            let twist = self.twists.column(joint);
            noise += twist * twist.transpose() * unknowns.joint_std_rad[joint].powi(2);
        }
        let lower = Cholesky::new(noise)?.unpack();
        let twists = lower.solve_lower_triangular(&self.twists)?;
        Some(WhitenedView { basis: self.basis, twists })
    }
}

/// Returns the information left when the tag's own survey error is noise: `(H^-1 + A P A^T)^-1`.
fn with_own_survey_error(robot: &Robot, sight: &TagInformation) -> Option<Matrix6<f64>> {
    let tag = &robot.tags[sight.tag];
    if !tag.is_known() {
        // The views themselves map this tag.
        return Some(sight.info);
    }
    let std = |k: usize| OWN_SURVEY_SHARE * if k < 3 { tag.position_std_m } else { tag.rotation_std_rad };
    let own = Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|k, _| std(k).powi(2)));
    let noise = Cholesky::new(sight.info)?.inverse() + sight.adjoint * own * sight.adjoint.transpose();
    Some(Cholesky::new(noise)?.inverse())
}
