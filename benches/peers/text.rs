//! The problems as plain text: words and numbers with 17 digits, separated by blanks, in the order that problem.h
//! reads.

use std::fmt::Write;

use armcal::calib::{JointParameters, TagMeasurement};
use armcal::sensor::ConditionChange;
use nalgebra::Isometry3;

use crate::problems::Problem;

fn numbers(out: &mut String, values: impl IntoIterator<Item = f64>) {
    for value in values {
        // Writing to a string does not fail.
        let _ = write!(out, " {value:.17e}");
    }
    out.push('\n');
}

/// Rotation row by row, then translation.
fn pose(out: &mut String, pose: &Isometry3<f64>) {
    let rotation = pose.rotation.to_rotation_matrix();
    let by_row = rotation.matrix().transpose();
    numbers(out, by_row.iter().chain(pose.translation.vector.iter()).copied());
}

fn arm(out: &mut String, problem: &Problem) {
    let (robot, mount) = (&problem.robot, &problem.robot.camera.mount);
    let _ = writeln!(out, "joints {}", mount.n_joints);
    for (joint, spec) in robot.chain.joints()[..mount.n_joints].iter().zip(&robot.sensors) {
        pose(out, &joint.parent_from_joint);
        numbers(out, joint.axis.iter().copied().chain([spec.center_rad]));
    }
    out.push_str("mount\n");
    pose(out, &mount.link_from_frame);
    numbers(out, [robot.camera.mount_std_m, robot.camera.mount_std_rad]);
    let _ = writeln!(out, "tags {}", robot.tags.len());
    for tag in &robot.tags {
        pose(out, tag.base_from_tag.isometry());
        numbers(out, [0.5 * tag.size_m, tag.position_std_m, tag.rotation_std_rad]);
    }
}

/// What `bundle_ceres` reads.
pub fn bundle(problem: &Problem, relative_gain: f64) -> String {
    let mut out = String::new();
    let robot = &problem.robot;
    arm(&mut out, problem);
    let lens = &robot.camera.lens;
    out.push_str("lens\n");
    numbers(&mut out, lens.focal_px().into_iter().chain(lens.center_px()).chain(lens.distortion()));
    let parameters = problem.parameters();
    let _ = writeln!(out, "parameters {}", parameters.len());
    for p in &parameters {
        let std = problem.scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
        numbers(&mut out, [p.joint as f64, JointParameters::default().get(*p), std]);
    }
    let _ = writeln!(out, "views {}", problem.views.len());
    let info = robot.camera.corner_std_px.powi(-2);
    for view in &problem.views {
        let by = |p: &armcal::calib::Parameter| {
            let travel_rad = view.travel_rad[p.joint];
            p.kind.angle_derivative(&robot.sensors[p.joint], travel_rad, &ConditionChange::default(), 0.0)
        };
        numbers(&mut out, parameters.iter().map(by));
        let _ = writeln!(out, "{}", view.tags.len());
        for tag in &view.tags {
            if let TagMeasurement::Corners(seen) = &tag.measured {
                numbers(&mut out, [tag.tag_idx as f64, info].into_iter().chain(seen.corners_px.into_iter().flatten()));
            }
        }
    }
    out.push_str("relative_gain\n");
    numbers(&mut out, [relative_gain]);
    out
}

/// What `distance_nlopt` reads. `box_sigmas`: half-width of the box.
pub fn distance(problem: &Problem, box_sigmas: f64, rho: [f64; 2]) -> String {
    let mut out = String::new();
    let robot = &problem.robot;
    arm(&mut out, problem);
    let n_joints = robot.camera.mount.n_joints;
    out.push_str("gain_and_offset_std\n");
    for spec in &robot.sensors[..n_joints] {
        numbers(&mut out, [spec.gain_std, spec.offset_std_rad]);
    }
    let _ = writeln!(out, "views {}", problem.views.len());
    for view in &problem.views {
        numbers(&mut out, view.travel_rad[..n_joints].iter().copied());
        let _ = writeln!(out, "{}", view.tags.len());
        for tag in &view.tags {
            let center = tag.center_in_camera_m.iter().copied();
            numbers(&mut out, [tag.tag_idx as f64].into_iter().chain(center));
        }
    }
    out.push_str("box_and_rho\n");
    numbers(&mut out, [box_sigmas].into_iter().chain(rho));
    out
}
