//! Ellipsoid about the estimated tool position that contains the true position with 95 % probability, by the estimate's
//! covariance.
//!
//! In the viewer it belongs to the arm's link and moves with it; its size changes in coarser steps. An ellipsoid too
//! small to be visible is drawn larger, as its entity's name and its label say.

use std::collections::BTreeSet;

use crate::rerun::components::Radius;
use crate::rerun::{Ellipsoids3D, FillMode, Points3D};
use nalgebra::{Isometry3, Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};

use crate::arms::{believed_arm, body_entity};
use crate::colors;
use crate::entity_log::EntityLog;
use crate::poses::{quaternion, vector};
use crate::scene::{ReplayInput, ReplayScene};
use armcal_belief::calib::ConditionHistory;
use armcal_core::stats::chi_square_quantile;
use armcal_core::streams::JointAngles;

/// Names of the entities, in the frame of the link that carries the tool: drawn to scale, and enlarged.
pub(super) const AS_LARGE: &str = "tool_95_percent";
pub(super) const LARGER: &str = "tool_95_percent_drawn_20_times_as_large";
/// Factor by which the second one is enlarged.
pub(super) const FACTOR: f64 = 20.0;
/// Probability that the ellipsoid contains the error.
const PROBABILITY: f64 = 0.95;
/// Rate at which its size is drawn, Hz; `MOST_STEPS` is the largest number of drawn sizes, which lowers the rate of
/// long recordings.
const RATE_HZ: f64 = 5.0;
const MOST_STEPS: f64 = 4000.0;
/// Longest half axis below which the ellipsoid is enlarged, m.
const SMALL_M: f64 = 0.015;
/// Height of the label above the ellipsoid, m.
const LABEL_M: f64 = 0.22;
/// Half axis from which on the tool position is regarded as unknown, m.
const UNKNOWN_M: f64 = 1.5;
/// Relative change of the covariance below which the ellipsoid is not drawn again.
const SAME_SHARE: f64 = 0.02;
/// Motion of the centre below which the ellipsoid is not drawn again, m.
const SAME_M: f64 = 2e-5;

/// Ellipsoid at one time, in the frame of the link.
#[derive(Clone, Copy)]
struct Region {
    time_s: f64,
    center_m: Vector3<f64>,
    /// Covariance of the errors, scaled so that its ellipsoid holds the probability, m^2.
    covariance_m2: Matrix3<f64>,
    half_axes_m: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    /// Upward direction of the base.
    up: Vector3<f64>,
}

/// Draws the ellipsoid for each span of an estimate with a covariance.
pub(super) fn draw(run: &ReplayScene, input: &ReplayInput, stream: &mut EntityLog) {
    let beliefs = input.tool_beliefs;
    if beliefs.is_empty() {
        return;
    }
    let conditions = ConditionHistory::of(input.recording);
    let within = chi_square_quantile(PROBABILITY, 3);
    let since_s: Vec<f64> = beliefs.iter().map(|(since, _)| run.tracks.place_s(*since, *since)).collect();
    let mut spans: Vec<Vec<Region>> = vec![Vec::new(); beliefs.len()];
    for time_s in run.tracks.ticks(RATE_HZ.min(MOST_STEPS / run.tracks.duration_s.max(1.0))) {
        let Some(at) = since_s.partition_point(|since_s| *since_s <= time_s).checked_sub(1) else { continue };
        let (Some(belief), Some(angles)) = (&beliefs[at].1, run.tracks.believed.at(time_s)) else { continue };
        let stamp = run.tracks.stamp_at(time_s);
        let covariance_m2 = belief.position_m2(angles, &conditions.over(stamp, stamp));
        spans[at].extend(covariance_m2.and_then(|m2| Region::new(run, time_s, angles, &(within * m2))));
    }
    draw_spans(run, &since_s, &spans, stream);
}

fn draw_spans(run: &ReplayScene, since_s: &[f64], spans: &[Vec<Region>], stream: &mut EntityLog) {
    let carrier = body_entity(run, believed_arm(run), run.robot.tool.mount.n_joints);
    let names = spans.iter().map(|span| name_of(span));
    for name in names.flatten().collect::<BTreeSet<_>>() {
        let style = Ellipsoids3D::update_fields().with_fill_mode(FillMode::TransparentFillMajorWireframe);
        let style = style.with_colors([colors::TOOL_REGION]).with_line_radii([Radius::new_ui_points(0.7)]);
        stream.log_static(&format!("{carrier}/{name}"), &style);
        let label = Points3D::update_fields().with_colors([colors::TOOL_REGION]).with_radii([0.001]);
        stream.log_static(&format!("{carrier}/{name}/size"), &label.with_show_labels(true));
    }
    let mut shown: Option<&str> = None;
    for (span, since_s) in spans.iter().zip(since_s) {
        let name = name_of(span);
        if let Some(before) = shown.filter(|before| name != Some(before)) {
            stream.clear(&format!("{carrier}/{before}"), *since_s);
            stream.clear(&format!("{carrier}/{before}/size"), *since_s);
        }
        shown = name;
        let Some(name) = name else { continue };
        let entity = format!("{carrier}/{name}");
        let mut drawn: Option<&Region> = None;
        for region in span {
            if drawn.is_none_or(|drawn| !region.is_like(drawn)) {
                region.draw(&entity, if name == LARGER { FACTOR } else { 1.0 }, stream);
                drawn = Some(region);
            }
        }
    }
}

/// Returns the entity's name by the largest ellipsoid of a span, so that the factor is constant within an estimate;
/// `None` if the span is empty.
fn name_of(span: &[Region]) -> Option<&'static str> {
    let largest_m = span.iter().map(|region| region.half_axes_m.max()).fold(0.0, f64::max);
    (!span.is_empty()).then_some(if largest_m > SMALL_M { AS_LARGE } else { LARGER })
}

impl Region {
    fn new(run: &ReplayScene, time_s: f64, angles: &JointAngles, covariance_m2: &Matrix3<f64>) -> Option<Self> {
        let base_from_link = base_from_carrier(run, time_s, angles);
        let turn = base_from_link.rotation.inverse().to_rotation_matrix();
        let up = turn * Vector3::z();
        let covariance_m2 = turn * covariance_m2 * turn.transpose();
        let eigen = SymmetricEigen::new(covariance_m2);
        let half_axes_m = eigen.eigenvalues.map(|variance_m2| variance_m2.max(0.0).sqrt());
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < 0.0 {
            axes.set_column(2, &-axes.column(2));
        }
        let tool = run.believed_poses(time_s, angles).frame(&run.robot.tool.mount);
        let center_m = base_from_link.inverse_transform_point(&tool.translation.vector.into()).coords;
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        (half_axes_m.max() < UNKNOWN_M).then_some(Self { time_s, center_m, covariance_m2, half_axes_m, turn, up })
    }

    fn is_like(&self, other: &Self) -> bool {
        (self.covariance_m2 - other.covariance_m2).norm() < SAME_SHARE * other.covariance_m2.norm()
            && (self.center_m - other.center_m).norm() < SAME_M
    }

    fn draw(&self, entity: &str, factor: f64, stream: &mut EntityLog) {
        let longest_m = self.half_axes_m.max();
        let label = if factor == 1.0 {
            format!("\u{b1}{:.0} mm", 1e3 * longest_m)
        } else {
            format!("\u{b1}{:.1} mm, drawn x{factor:.0}", 1e3 * longest_m)
        };
        let ellipsoid = Ellipsoids3D::update_fields()
            .with_half_sizes([vector(&(factor * self.half_axes_m))])
            .with_centers([vector(&self.center_m)])
            .with_quaternions([quaternion(&self.turn)]);
        stream.draw(entity, self.time_s, &ellipsoid);
        // The label is above the ellipsoid, not to hide it: the viewer writes below the point.
        let above_m = self.center_m + (factor * longest_m + LABEL_M) * self.up;
        let label = Points3D::update_fields().with_positions([vector(&above_m)]).with_labels([label]);
        stream.draw(&format!("{entity}/size"), self.time_s, &label);
    }
}

/// Returns the pose at which the link that carries the tool is drawn.
fn base_from_carrier(run: &ReplayScene, time_s: f64, angles: &JointAngles) -> Isometry3<f64> {
    let poses =
        if run.has_true_joints() { run.believed_poses(time_s, angles) } else { run.robot.chain.link_poses(angles) };
    *poses.link(run.robot.tool.mount.n_joints)
}
