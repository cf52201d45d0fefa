//! Measurement of a sensor's scale if the counts per radian and their sign are unknown.
//!
//! One joint moves a little while the others stand still. Between two such views the camera turns by the joint's own
//! rotation, regardless of the other joints' errors: `R_0^T R_v = exp(axis * (theta_v - theta_0))` with the axis fixed
//! in the camera. Each view's camera pose comes from all its tags' corners. The common axis is the principal one of the
//! rotation vectors, and the nominal model (URDF) gives its sign. The slope of the rotation against the readings is the
//! gain.

use crate::views::constants::scale_identification::{
    CONSTANT_RAD2, DAMPING, DRAWING_STD, MAX_RELATIVE_STD, MIN_VIEWS, STOP, TURN_FLOOR_RAD,
};
use nalgebra::{DVector, Isometry3, Matrix3, Matrix6, Vector3, Vector6};

use crate::measure::{ImagePoint, TwistSums};
use crate::views::error::CalibError;
use crate::views::view::{CaptureData, View};
use armcal_core::numeric::{LeastSquares, Outcome, Proposal, minimize};
use armcal_core::optics::{solve_square, square_corners};
use armcal_core::robot::Robot;
use armcal_core::spatial::exp;
use armcal_core::streams::JointAngles;

/// Measured scale of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifiedScale {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Ratio of the counts per radian to the datasheet's; negative if they run the other way.
    pub ratio: f64,
    /// Standard deviation of the ratio, relative to the ratio.
    pub relative_std: f64,
}

/// Measures the scale of every joint with `identify` views; returns the robot with these scales.
///
/// # Errors
/// [`CalibError::Identify`] if the views of a joint do not determine its scale.
pub fn identify_scales(data: &CaptureData, robot: &Robot) -> Result<(Robot, Vec<IdentifiedScale>), CalibError> {
    let mut scaled = robot.clone();
    let mut identified = Vec::new();
    for (&joint, views) in &data.identify {
        let scale = identify(robot, joint as usize, views)?;
        scaled.sensors[scale.joint] = robot.sensors[scale.joint].with_scale(scale.ratio);
        identified.push(scale);
    }
    Ok((scaled, identified))
}

fn identify(robot: &Robot, joint: usize, views: &[View]) -> Result<IdentifiedScale, CalibError> {
    let name = robot.sensors.get(joint).map_or_else(|| format!("number {joint}"), |s| s.joint.clone());
    let wrong = |problem: String| CalibError::Identify { joint: name.clone(), problem };
    if joint >= robot.n_seen_joints() {
        return Err(wrong("it does not move the camera".to_owned()));
    }
    if robot.sensors[joint].moves.is_slide() {
        return Err(wrong("it slides, and scales are found by how the camera turns".to_owned()));
    }
    let seen: Vec<(f64, Isometry3<f64>)> =
        views.iter().filter_map(|view| Some((view.travel_rad[joint], camera_pose(robot, view)?))).collect();
    if seen.len() < MIN_VIEWS {
        return Err(wrong(format!("only {} views show a tag, {MIN_VIEWS} are needed", seen.len())));
    }
    let first = seen[0].1;
    let turns: Vec<Vector3<f64>> =
        seen.iter().map(|(_, pose)| (first.rotation.inverse() * pose.rotation).scaled_axis()).collect();
    let axis = common_axis(&turns, &drawn_axis(robot, joint, &views[0].travel_rad));
    let turn_rad = DVector::from_iterator(turns.len(), turns.iter().map(|turn| turn.dot(&axis)));
    let (gain, gain_std) =
        slope(&DVector::from_iterator(seen.len(), seen.iter().map(|(travel, _)| *travel)), &turn_rad)
            .ok_or_else(|| wrong("its reading did not change".to_owned()))?;
    let relative_std = (gain_std / gain.abs()).hypot(DRAWING_STD);
    if relative_std.is_nan() || relative_std > MAX_RELATIVE_STD {
        let problem = format!("the camera turned by {gain:.3} +- {gain_std:.3} of what the datasheet says");
        return Err(wrong(problem));
    }
    Ok(IdentifiedScale { joint, ratio: 1.0 / gain, relative_std })
}

/// Returns the slope of `y` against `x` and its standard deviation; `None` if `x` is constant.
fn slope(x: &DVector<f64>, y: &DVector<f64>) -> Option<(f64, f64)> {
    let (x, y) = (x.add_scalar(-x.mean()), y.add_scalar(-y.mean()));
    let spread = x.norm_squared();
    if spread < CONSTANT_RAD2 {
        return None;
    }
    let slope = x.dot(&y) / spread;
    let freedoms = x.len().saturating_sub(2).max(1) as f64;
    let residual_std = ((y - x * slope).norm_squared() / freedoms).sqrt();
    Some((slope, residual_std.max(TURN_FLOOR_RAD) / spread.sqrt()))
}

/// Returns the nominal axis of `joint` in the camera frame; the joint's own angle does not matter.
fn drawn_axis(robot: &Robot, joint: usize, travel_rad: &JointAngles) -> Vector3<f64> {
    let angles = JointAngles::from_fn(robot.n_joints(), |j| robot.sensors[j].center_rad + travel_rad[j]);
    let poses = robot.chain.link_poses(&angles);
    let axis = poses.frame(&robot.camera.mount).rotation.inverse() * poses.axis(joint);
    // If a joint turns the tags one way, a camera that stands still seems to turn the other way.
    if robot.is_watched() { -axis } else { axis }
}

/// Returns the principal direction of the rotation vectors, towards `drawn`.
fn common_axis(turns: &[Vector3<f64>], drawn: &Vector3<f64>) -> Vector3<f64> {
    let scatter: Matrix3<f64> = turns.iter().map(|turn| turn * turn.transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    let axis: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
    if axis.dot(drawn) < 0.0 { -axis } else { axis }
}

/// Returns the `base_from_camera` that fits all corners of the view best; `None` without a tag.
fn camera_pose(robot: &Robot, view: &View) -> Option<Isometry3<f64>> {
    let starts = view.tags.iter().filter_map(|seen| {
        let tag = &robot.tags[seen.tag_idx];
        let solved = solve_square(&robot.camera.lens, tag.size_m, &seen.corners()?.corners_px).ok()?;
        Some(tag.base_from_tag.isometry() * solved.camera_from_tag.isometry().inverse())
    });
    // A tag seen head-on may start from its mirrored tilt; the other tags then decide.
    let refined = starts.filter_map(|start| refine(robot, view, start));
    refined.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(pose, _)| pose)
}

/// Pose, normal equations (perturbed on the right) and cost, px^2.
struct Linearized {
    pose: Isometry3<f64>,
    normal: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
}

impl Linearized {
    fn at(robot: &Robot, view: &View, pose: Isometry3<f64>) -> Option<Self> {
        let (mut sums, mut cost) = (TwistSums::default(), 0.0);
        let camera_from_base = pose.inverse();
        for seen in &view.tags {
            let tag = &robot.tags[seen.tag_idx];
            let Some(corners) = seen.corners() else { continue };
            for (corner, measured) in square_corners(tag.size_m).iter().zip(&corners.corners_px) {
                let in_camera = (camera_from_base * (tag.base_from_tag.isometry() * corner)).coords;
                let image = ImagePoint::of(&robot.camera.lens, &in_camera)?;
                for (row, residual) in image.by_twist.iter().zip(image.residual_px(measured)) {
                    sums.add(row, residual, 1.0);
                    cost += residual * residual;
                }
            }
        }
        let (normal, gradient) = sums.weighted(1.0);
        let out = Self { pose, normal, gradient, cost };
        out.cost.is_finite().then_some(out)
    }
}

struct Refinement<'a> {
    robot: &'a Robot,
    view: &'a View,
    here: Linearized,
    trial_pose: Isometry3<f64>,
    there: Option<Linearized>,
}

impl LeastSquares for Refinement<'_> {
    fn cost(&self) -> f64 {
        self.here.cost
    }

    fn propose(&mut self, _: f64) -> Option<Proposal> {
        let step = self.here.normal.cholesky()?.solve(&self.here.gradient);
        self.trial_pose = self.here.pose * exp(&step);
        Some(Proposal { length: step.norm(), predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.there = Linearized::at(self.robot, self.view, self.trial_pose);
        self.there.as_ref().map(|there| there.cost)
    }

    fn accept(&mut self) {
        if let Some(there) = self.there.take() {
            self.here = there;
        }
    }
}

/// Returns the pose of least cost from `start` on, and the cost, px^2.
fn refine(robot: &Robot, view: &View, start: Isometry3<f64>) -> Option<(Isometry3<f64>, f64)> {
    let here = Linearized::at(robot, view, start)?;
    let mut refinement = Refinement { robot, view, here, trial_pose: start, there: None };
    let outcome = minimize(&mut refinement, &DAMPING, &STOP).outcome();
    (outcome != Outcome::Degenerate).then_some((refinement.here.pose, refinement.here.cost))
}
