//! Limits of the result, its conditions, rejected observations, and the tool motion per degree of joint error.

use maud::{Markup, html as markup};
use nalgebra::Vector3;

use super::Report;
use armcal_belief::calib::{Calibration, Check, Reservation, VerdictTable};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;

/// Number of rejected observations in the list; the page only counts the others.
const MOST_LISTED: usize = 40;

pub(super) fn section(report: &Report<'_>) -> Markup {
    let calibration = report.calibration;
    markup! {
        h2 { "Limits of this calibration" }
        (unobservable(calibration))
        @if !calibration.reservations.is_empty() { (reservations(&calibration.reservations)) }
        (sensitivity(report))
        (left_out(report))
        @if let Some(verdict) = &calibration.verdict { (checks(verdict)) }
    }
}

fn unobservable(calibration: &Calibration) -> Markup {
    let warnings = calibration.verdict.iter().flat_map(|verdict| &verdict.warnings);
    let not_covered = calibration.verdict.iter().flat_map(|verdict| &verdict.not_covered);
    markup! {
        table.notes {
            @for line in &calibration.unobservable { tr { th scope="row" { "unobservable" } td { (line) } } }
            @for line in not_covered { tr { th scope="row" { "not covered" } td { (line) } } }
            @for line in warnings { tr { th scope="row" { "warning" } td { (line) } } }
        }
    }
}

fn reservations(reservations: &[Reservation]) -> Markup {
    markup! {
        h3 { "Unobservable parameters" }
        table.notes { @for one in reservations { tr { td { (one.to_string()) } } } }
    }
}

/// Joint step for the sensitivity table: one degree in rad, or one millimetre of a slide in m.
fn shown_step(robot: &Robot, joint: usize) -> f64 {
    if robot.sensors[joint].moves.is_slide() { 1e-3 } else { 1f64.to_radians() }
}

/// Tool motion per degree of each joint (per millimetre of a slide), root mean square over the configurations `at`, m.
fn tool_per_degree_m(robot: &Robot, at: &[JointAngles]) -> Vec<f64> {
    let square_m2 = |joint: usize, angles: &JointAngles| {
        let poses = robot.chain.link_poses(angles);
        let tool_m: Vector3<f64> = poses.frame(&robot.tool.mount).translation.vector;
        let by_rad =
            if joint < robot.tool.mount.n_joints { poses.point_jacobian(joint, &tool_m) } else { Vector3::zeros() };
        (by_rad * shown_step(robot, joint)).norm_squared()
    };
    let mean = |joint: usize| at.iter().map(|angles| square_m2(joint, angles)).sum::<f64>() / at.len().max(1) as f64;
    (0..robot.n_joints()).map(|joint| mean(joint).sqrt()).collect()
}

fn sensitivity(report: &Report<'_>) -> Markup {
    let details = &report.calibration.details;
    let by_targets: Vec<JointAngles> = details.targets.iter().map(|target| target.angles).collect();
    let by_views = || details.views.iter().map(|view| view.calibrated_rad).collect();
    let (at, over) = if by_targets.is_empty() { (by_views(), "views") } else { (by_targets, "targets") };
    if at.is_empty() {
        return Markup::default();
    }
    markup! {
        @let has_slide = report.robot.first_slide().is_some();
        h3 { "Tool motion per degree " @if has_slide { "or millimetre " } "of joint error" }
        table {
            tr {
                th { "joint" }
                th { "tool motion, mm per degree" @if has_slide { " or mm" } " (rms over the " (over) ")" }
            }
            @for (joint, m) in report.robot.joint_names().iter().zip(tool_per_degree_m(report.robot, &at)) {
                tr { td { (joint) } td { (format!("{:.1}", 1e3 * m)) } }
            }
        }
    }
}

fn left_out(report: &Report<'_>) -> Markup {
    let (capture, calibration) = (&report.summary.capture, report.calibration);
    let beyond = calibration.outliers.len().saturating_sub(MOST_LISTED);
    let line = |what: &str, text: &str| markup! { tr { th scope="row" { (what) } td { (text) } } };
    let skipped = format!("{} of {}", capture.poses_skipped, capture.poses + capture.poses_skipped);
    let rejected = format!("{} rejected, {} used", capture.rejected, capture.detections);
    markup! {
        h3 { "Rejected data" }
        table.notes {
            (line("poses skipped", &skipped))
            @for skipped in &capture.skipped_targets { (line("target skipped", &skipped.to_string())) }
            (line("tag observations rejected", &rejected))
            @for (why, n) in &capture.rejected_by_reason { (line(&why.replace('_', " "), &n.to_string())) }
            @for outlier in calibration.outliers.iter().take(MOST_LISTED) { (line("outlier", outlier)) }
            @if beyond > 0 { (line("outliers", &format!("and {beyond} more, in calibration.toml"))) }
        }
    }
}

fn checks(verdict: &VerdictTable) -> Markup {
    let row = |check: &Check| {
        markup! {
            tr.out[!check.holds] {
                td { (check.what) } td { (format!("{:.3}", check.value)) } td { (format!("{:.3}", check.limit)) }
                td { (if check.holds { "passes" } else { "FAILS" }) }
            }
        }
    };
    markup! {
        h3 { "Checks of the verdict" }
        div.wide {
            table {
                tr { th { "test" } th { "value" } th { "limit" } th { "result" } }
                @for check in &verdict.checks { (row(check)) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_degree_of_the_first_joint_moves_the_tool_by_its_distance_from_the_axis() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4");
        let robot = armcal_core::robot::load(&folder).expect("the robot reads");
        let at = robot.stowed;
        let poses = robot.chain.link_poses(&at);
        let arm_m = poses.frame(&robot.tool.mount).translation.vector - poses.joint_origin(0);
        let expected_m = arm_m.cross(poses.axis(0)).norm() * 1f64.to_radians();
        let found = tool_per_degree_m(&robot, &[at]);
        assert!((found[0] - expected_m).abs() < 1e-12 && found[0] > 1e-3, "{found:?} against {expected_m}");
        assert!((tool_per_degree_m(&robot, &[at, at])[0] - expected_m).abs() < 1e-12, "a mean, not a sum");
    }
}
