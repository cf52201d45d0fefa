//! Problems as plain text: words and numbers with 17 digits, separated by blanks, in the order that arm.h, bundle.h and
//! distance_nlopt.cpp read.

use std::fmt::Write;
use std::ops::Range;

use armcal::calib::TagMeasurement;
use armcal::model::{JointParameters, Parameter};
use armcal::robot::Robot;
use armcal::sensor::ConditionChange;
use nalgebra::Isometry3;

use crate::problems::{Problem, lens_std};

fn numbers(out: &mut String, values: impl IntoIterator<Item = f64>) {
    for value in values {
        // Writing to a string cannot fail.
        let _ = write!(out, " {value:.17e}");
    }
    out.push('\n');
}

/// Writes the rotation row by row, then the translation.
fn pose(out: &mut String, pose: &Isometry3<f64>) {
    let rotation = pose.rotation.to_rotation_matrix();
    let by_row = rotation.matrix().transpose();
    numbers(out, by_row.iter().chain(pose.translation.vector.iter()).copied());
}

fn joints(out: &mut String, robot: &Robot, range: Range<usize>) {
    for (joint, spec) in robot.chain.joints()[range.clone()].iter().zip(&robot.sensors[range]) {
        assert!(!joint.kind.is_slide(), "the C++ programs know joints that turn");
        pose(out, &joint.parent_from_joint);
        numbers(out, joint.axis.iter().copied().chain([spec.center_rad]));
    }
}

fn arm(out: &mut String, problem: &Problem) {
    let (robot, mount) = (&problem.robot, &problem.robot.camera.mount);
    let _ = writeln!(out, "joints {}", mount.n_joints);
    joints(out, robot, 0..mount.n_joints);
    out.push_str("mount\n");
    pose(out, &mount.link_from_frame);
    numbers(out, [robot.camera.mount_std_m, robot.camera.mount_std_rad]);
    let _ = writeln!(out, "tags {}", robot.tags.len());
    for tag in &robot.tags {
        pose(out, tag.base_from_tag.isometry());
        numbers(out, [0.5 * tag.size_m, tag.position_std_m, tag.rotation_std_rad]);
    }
}

/// Input of `bundle_ceres`.
pub fn bundle(problem: &Problem, relative_gain: f64) -> String {
    let mut out = String::new();
    let robot = &problem.robot;
    arm(&mut out, problem);
    let lens = &robot.camera.lens;
    out.push_str("lens\n");
    numbers(&mut out, lens.focal_px().into_iter().chain(lens.center_px()).chain(lens.distortion()));
    let (parameters, of_body): (Vec<_>, Vec<_>) =
        problem.model.parameters().into_iter().partition(|p| !p.kind.is_of_body());
    let _ = writeln!(out, "parameters {}", parameters.len());
    let prior_std = |p: &Parameter| problem.scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
    for p in &parameters {
        numbers(&mut out, [p.joint as f64, JointParameters::default().get(*p), prior_std(p)]);
    }
    let _ = writeln!(out, "views {}", problem.views.len());
    let info = robot.camera.corner_std_px.powi(-2);
    for view in &problem.views {
        let by = |p: &Parameter| {
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
    let _ = writeln!(out, "body {}", u8::from(!of_body.is_empty()));
    if !of_body.is_empty() {
        body(&mut out, problem, &of_body.iter().map(prior_std).collect::<Vec<_>>());
    }
    out
}

/// Writes the inputs of links, sag and lens: the joints beyond the camera, the weight of all links, one sigma of each
/// column.
fn body(out: &mut String, problem: &Problem, stds: &[f64]) {
    let robot = &problem.robot;
    let (n, loads) = (robot.camera.mount.n_joints, robot.chain.loads());
    let beyond = n..robot.n_joints();
    let _ = writeln!(out, "{}", beyond.len());
    joints(out, robot, beyond.clone());
    numbers(out, loads.up.iter().copied());
    let _ = writeln!(out, "{}", robot.n_joints() + 1);
    for load in &loads.links[..=robot.n_joints()] {
        numbers(out, [load.weight_n].into_iter().chain(load.moment_nm.iter().copied()));
    }
    numbers(
        out,
        [loads.tool.n_joints as f64].into_iter().chain(loads.tool.link_from_frame.translation.vector.iter().copied()),
    );
    let _ = writeln!(out, "{}", stds.len());
    numbers(out, stds.iter().copied());
    numbers(out, lens_std(&robot.camera));
    for view in &problem.views {
        let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
        numbers(out, beyond.clone().map(angle_rad));
    }
}

/// Input of `distance_nlopt`. `box_sigmas` is the half-width of the box.
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
