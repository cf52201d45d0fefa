//! The priors of an estimate: datasheet, drawing and survey, or an earlier calibration.

use nalgebra::{DMatrix, DVector, Isometry3};

use crate::calib::bundle::input::BundleInput;
use crate::calib::bundle::model::Hyperparameters;
use crate::calib::bundle::problem::{BundleProblem, Layout, Prior};
use crate::calib::parameters::{JointParameters, Parameter};
use crate::calib::views::view::TagMeasurement;
use armcal_core::robot::{CameraSpec, LensPriors, Robot};

/// The datasheet's and the survey's priors.
pub(crate) fn prior(input: &BundleInput<'_>, scales: &Hyperparameters) -> Prior {
    let robot = input.robot;
    let layout = Layout::new(robot, &input.model, input.views);
    let nominal = JointParameters::default();
    let mean = layout.parameters.iter().map(|p| nominal.get(*p));
    let variance = |p: &Parameter| BundleProblem::at_least(scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind));
    let info = layout.parameters.iter().map(|p| variance(p).powi(-2));
    let n = layout.n_joint();
    let (mut joint_mean, joint_info) = input.joint_prior.clone().unwrap_or_else(|| {
        let info = DMatrix::from_diagonal(&DVector::from_iterator(n, info));
        (DVector::from_iterator(n, mean), info)
    });
    if joint_mean.len() > n {
        joint_mean = joint_mean.rows(0, n).into_owned();
    }
    let six = |position: f64, rotation: f64| [position, position, position, rotation, rotation, rotation];
    let camera = &robot.camera;
    let gripper = robot.gripper_tag;
    Prior {
        joint_mean,
        joint_info,
        mount: camera.mount.link_from_frame,
        mount_std: mount_std(robot, scales),
        further_mounts: further_mounts(robot, scales),
        time_s: 0.0,
        time_std_s: 0.05,
        lens: camera.lens,
        lens_std: lens_std(camera).map(|std| std * scales.lens_scale),
        tags: robot.tags.iter().map(|tag| *tag.base_from_tag.isometry()).collect(),
        tags_std: (0..robot.tags.len()).map(|tag_idx| tag_std(input, tag_idx)).collect(),
        gripper_tag: gripper.map_or_else(Isometry3::identity, |tag| tag.mount.link_from_frame),
        gripper_tag_std: gripper.map_or([0.0; 6], |tag| six(tag.position_std_m, tag.rotation_std_rad)),
    }
}

/// One sigma of the lens's columns: focal lengths and centre px, then distortion.
pub(crate) fn lens_std(camera: &CameraSpec) -> [f64; 8] {
    let LensPriors { focal_std, center_std_px, distortion_std } = camera.lens_priors;
    let [fx, fy] = camera.lens.focal_px().map(|px| px * focal_std);
    let [center, k] = [center_std_px, distortion_std];
    [fx, fy, center, center, k, k, k, k]
}

/// One sigma of the camera mount.
pub(crate) fn mount_std(robot: &Robot, scales: &Hyperparameters) -> [f64; 6] {
    let (camera, [shift, turn]) = (&robot.camera, scales.mount_scale);
    std::array::from_fn(|k| if k < 3 { shift * camera.mount_std_m } else { turn * camera.mount_std_rad })
}

/// Each further camera's mount by the drawing, and one sigma of it.
pub(crate) fn further_mounts(robot: &Robot, scales: &Hyperparameters) -> Vec<(Isometry3<f64>, [f64; 6])> {
    let cameras = robot.further_cameras.iter().zip(&scales.further_mount_scale);
    let of_camera = |(camera, [shift, turn]): (&CameraSpec, &[f64; 2])| {
        let [shift, turn] = [shift * camera.mount_std_m, turn * camera.mount_std_rad];
        (camera.mount.link_from_frame, [shift, shift, shift, turn, turn, turn])
    };
    cameras.map(of_camera).collect()
}

/// One sigma of a tag's place; a landmark that is seen as a position alone has no attitude to speak of.
fn tag_std(input: &BundleInput<'_>, tag_idx: usize) -> [f64; 6] {
    let tag = &input.robot.tags[tag_idx];
    let mut observations = input.views.iter().flat_map(|view| &view.tags).filter(|seen| seen.tag_idx == tag_idx);
    let is_point = observations.all(|seen| matches!(seen.measured, TagMeasurement::Position));
    let (position, rotation) = (tag.position_std_m, if is_point { 1.0 } else { tag.rotation_std_rad });
    [position, position, position, rotation, rotation, rotation]
}
