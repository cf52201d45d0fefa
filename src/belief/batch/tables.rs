//! The tables of calibration.toml that only `bundle` fills.

use crate::explain::calibration_prior::{MOUNT_ROWS, PriorConsistency, with_mount_rows};
use crate::explain::model_selection::{OptionalTerm, Selection};
use crate::explain::setup::BundleSetup;
use crate::file::calibration::Calibration;
use crate::file::camera_mount::{CameraMount, FurtherCamera};
use crate::file::covariance_file::CovarianceTable;
use crate::file::failed_joint::PriorTable;
use crate::file::lens_table::LensResult;
use crate::file::map_table::MapResult;
use crate::file::model_table::ModelTable;
use crate::model::blocks::Block;
use crate::model::parameters::{Parameter, ParameterKind};
use crate::positions::unobservable::Unobservable;
use crate::solve::estimate::Estimate;
use crate::solve::model_for_views::MIN_GRIPPER_VIEWS;
use crate::solve::outliers::Outlier;
use crate::views::view::View;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::spatial::{Base, Camera, Link, Pose, Tag};

pub(crate) fn model_table(robot: &Robot, found: &Estimate<'_>, selections: &[Selection]) -> ModelTable {
    let scales = found.scales();
    let n_estimated = found.joint_parameters().last().map_or(0, |p| p.joint + 1);
    ModelTable {
        noise_scale: scales.noise,
        position_std_m: found.has_positions().then_some(scales.position_std_m),
        rotation_std_rad: found.has_poses().then_some(scales.rotation_std_rad),
        variance_factor: found.marginal.as_ref().map(|marginal| marginal.factor),
        camera_error_std: scales.camera_error_std,
        time_offset_s: found.time_offset_s(),
        nonlinearity_std_rad: scales.shape_std_rad[..n_estimated.min(robot.n_joints())].to_vec(),
        decided: selections.iter().map(decided).collect(),
    }
}

fn decided(selection: &Selection) -> String {
    let name = match selection.term {
        OptionalTerm::CameraError => "camera error shared by a view",
        OptionalTerm::TimeOffset => "time offset",
        OptionalTerm::Drift => "drift",
        OptionalTerm::Walk => "random walk of offsets",
    };
    format!("{name}: {}, {:+.1} nats", if selection.is_in { "in" } else { "out" }, selection.gain_nats)
}

/// Adds the offset by which the readings had already been moved to the camera's clock: the estimate is the remainder.
pub(crate) fn add_clock(model: &mut ModelTable, offset_s: f64, selection: &Selection) {
    if let Some([left_s, _]) = &mut model.time_offset_s {
        *left_s += offset_s;
    }
    model.decided.insert(0, decided(selection));
}

/// The camera mount as estimated; tags determine it, too.
pub(crate) fn camera_mount_table(robot: &Robot, found: &Estimate<'_>, views: &[View]) -> CameraMount {
    let (mount, covariance) = found.mount(0);
    let link_from_camera: Pose<Link, Camera> = Pose::from_isometry(mount);
    let std = |row: usize| covariance[(row, row)].max(0.0).sqrt();
    let seen = views.iter().filter(|view| view.gripper_tag.is_some()).count();
    let left_out = robot.gripper_tag.filter(|_| !found.has(Block::GripperTag)).map(|tag| {
        format!("the tag on the gripper ({}) was seen in {seen} views; {MIN_GRIPPER_VIEWS} are needed", tag.id)
    });
    CameraMount {
        left_out,
        position_m: link_from_camera.origin().to_array(),
        quaternion_wxyz: link_from_camera.quaternion_wxyz(),
        position_std_m: [0, 1, 2].map(std),
        rotation_std_rad: [3, 4, 5].map(std),
        views: if found.has(Block::GripperTag) { seen } else { 0 },
        rms_px: None,
    }
}

/// Tables of the further cameras with an estimated mount.
pub(crate) fn further_camera_tables(robot: &Robot, found: &Estimate<'_>, views: &[View]) -> Vec<FurtherCamera> {
    let table = |number: usize| {
        let (mount, covariance) = found.mount(number);
        let link_from_camera: Pose<Link, Camera> = Pose::from_isometry(mount);
        let std = |row: usize| covariance[(row, row)].max(0.0).sqrt();
        FurtherCamera {
            name: robot.camera_at(number).name.clone(),
            position_m: link_from_camera.origin().to_array(),
            quaternion_wxyz: link_from_camera.quaternion_wxyz(),
            position_std_m: [0, 1, 2].map(std),
            rotation_std_rad: [3, 4, 5].map(std),
            views: views.iter().filter(|view| view.camera == number).count(),
        }
    };
    (1..=robot.further_cameras.len()).filter(|&number| found.has(Block::Mount(number))).map(table).collect()
}

/// Tables of the estimated lenses.
pub(crate) fn lens_tables(robot: &Robot, found: &Estimate<'_>) -> Vec<LensResult> {
    let table = |number: usize| {
        let at = found.problem.layout.at(Block::Lens(number))?;
        let std = std::array::from_fn(|k| found.wide_covariance()[(at + k, at + k)].max(0.0).sqrt());
        let camera = (number > 0).then(|| robot.camera_at(number).name.clone());
        Some(LensResult::new(camera, found.lens(number), std))
    };
    found.cameras().filter_map(table).collect()
}

/// The tag map with the poses that `bundle` estimated.
#[must_use]
pub(crate) fn map_table(mut map: MapResult, robot: &Robot, found: &Estimate<'_>) -> MapResult {
    for tag in &mut map.tag {
        let Some(tag_idx) = robot.tags.iter().position(|known| known.id == tag.id) else { continue };
        let (pose, Some(covariance)) = found.tag(tag_idx) else { continue };
        let pose: Pose<Base, Tag> = Pose::from_isometry(pose);
        let turn = *pose.rotation().to_rotation_matrix().matrix();
        let position = turn * covariance.fixed_view::<3, 3>(0, 0) * turn.transpose();
        tag.position_m = pose.origin().to_array();
        tag.quaternion_wxyz = pose.quaternion_wxyz();
        tag.position_std_m = [0, 1, 2].map(|k| position[(k, k)].max(0.0).sqrt());
        tag.rotation_std_rad = [3, 4, 5].map(|k| covariance[(k, k)].max(0.0).sqrt());
    }
    map
}

/// The prior and its consistency with the views.
pub(crate) fn prior_table(
    prior: &Calibration,
    elapsed_h: f64,
    consistency: &PriorConsistency,
    robot: &Robot,
) -> PriorTable {
    PriorTable {
        agrees: !consistency.is_beyond_chance(),
        used: true,
        messages_hash: prior.messages_hash.clone(),
        elapsed_h,
        chi_square: consistency.chi2,
        degrees_of_freedom: consistency.degrees_of_freedom,
        chi_square_limit: consistency.limit,
        worst_joint: robot.sensors[consistency.joint].joint.clone(),
        moves: robot.sensors[consistency.joint].moves,
        worst_off_rad: consistency.off_rad,
        worst_off_std_rad: consistency.off_std_rad,
    }
}

/// Covariance of the camera mount and of the joint parameters in `kept`, so that a warm start knows their correlation.
pub(crate) fn covariance_with_mount(robot: &Robot, found: &Estimate<'_>, kept: &[String]) -> Option<CovarianceTable> {
    let full = with_mount_rows(found)?;
    let all = found.joint_parameters();
    let rows: Vec<usize> =
        (0..full.nrows()).filter(|&k| all.get(k).is_none_or(|p| kept.contains(&p.name(robot)))).collect();
    let name = |&k: &usize| match all.get(k) {
        Some(parameter) => parameter.name(robot),
        None => MOUNT_ROWS[k - all.len()].to_owned(),
    };
    let matrix = nalgebra::DMatrix::from_fn(rows.len(), rows.len(), |i, k| full[(rows[i], rows[k])]);
    Some(CovarianceTable::new(rows.iter().map(name).collect(), &matrix))
}

/// The sensors as estimated; joints without a sensor keep their datasheets.
pub(crate) fn with_datasheets(estimated: &Robot, datasheet: &Robot, setup: &BundleSetup) -> Vec<JointSensorSpec> {
    let pairs = estimated.sensors.iter().zip(&datasheet.sensors).enumerate();
    pairs.map(|(joint, (own, nominal))| if setup.has_no_sensor(joint) { nominal } else { own }.clone()).collect()
}

/// `view 12: tag 3: 45 sigma`, or `view 12: tag 3, corner 0: 45 sigma`; views count from 1.
pub(crate) fn outlier_name(outlier: &Outlier, views: &[View]) -> String {
    let number = views.get(outlier.view_idx).map_or(0, |view| view.pose_idx) + 1;
    let corner = outlier.corner.map_or(String::new(), |corner| format!(", corner {corner}"));
    format!("view {number}: tag {}{corner}: {:.0} sigma", outlier.tag_id, outlier.sigmas)
}

/// Gains and offsets that keep the datasheet's value: those of joints distal to the camera, and of failed ones.
pub(crate) fn unobservable(robot: &Robot, setup: &BundleSetup, estimate: &Estimate<'_>) -> Vec<Unobservable> {
    let all = (0..robot.n_joints())
        .flat_map(|joint| [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind }));
    let missing = all.filter(|p| {
        p.prior_std(robot) > 0.0 && !estimate.joint_parameters().contains(p) && !setup.has_no_sensor(p.joint)
    });
    missing.map(Unobservable::distal).chain(setup.unobservable()).collect()
}
