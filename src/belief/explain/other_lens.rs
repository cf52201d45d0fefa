//! Search for a lens that is not robot.toml's, before any sensor is blamed: a centre error of about ten pixels looks
//! like occasional wrong readings.

use crate::explain::constants::drawing::{LENS_SCALE, MIN_GAIN_NATS};
use crate::explain::constants::other_lens::MODEL_NATS;
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::{has_unsteady_sensor, is_suspicious};
use crate::explain::model_selection::log_evidence_of_all;
use crate::explain::wrong_input::lens::of_other_model;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;
use armcal_core::optics::CameraModel;
use armcal_core::robot::Robot;

/// Returns `drawing` with the lens of one camera estimated, if that explains an apparent sensor failure. `found` must
/// look like such a failure, the estimate with the lens must not, and no other alternative explains more. A focal
/// length far from the stated one does not count: another image size, another unit or water come first.
pub(crate) fn lens_that_fits(drawing: &Drawing, input: &BundleInput<'_>, found: &Estimate<'_>) -> Option<Drawing> {
    if input.joint_prior.is_some() || found.has_positions() || !seems_of_sensors(found) {
        return None;
    }
    let before = log_evidence_of_all(found);
    let with_lens = |camera: usize| {
        let other = Drawing { lenses: [&drawing.lenses[..], &[camera]].concat(), ..drawing.clone() };
        let mut input = input.clone();
        other.apply(&mut input);
        let by_lens = estimate(&input).filter(|by_lens| !seems_of_sensors(by_lens) && is_near(by_lens, camera))?;
        Some((log_evidence_of_all(&by_lens) - before, other))
    };
    let cameras = found.cameras().filter(|camera| !drawing.lenses.contains(camera));
    let (gain, other) = cameras.filter_map(with_lens).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (gain > MIN_GAIN_NATS && drawing.better(input, found, gain).is_none()).then_some(other)
}

/// Estimated lens of the other model, if it explains the views much better than the estimated lens of the stated model
/// in `input`. It starts with the stated distortion, or without any.
pub(crate) fn of_better_model(input: &BundleInput<'_>, camera: usize) -> Option<CameraModel> {
    let stated = input.robot.camera_at(camera).lens;
    let before = log_evidence_of_all(&estimate(input)?);
    let without = of_other_model(&stated);
    let explained = |lens: CameraModel| {
        let robot = with_lens(input.robot, camera, lens);
        let mut views = input.views.to_vec();
        views.iter_mut().filter(|view| view.camera == camera).for_each(|view| view.see_through(&robot));
        let found = estimate(&BundleInput { robot: &robot, views: &views, ..input.clone() })?;
        Some((log_evidence_of_all(&found) - before, *found.lens(camera)))
    };
    let others = [without.with_intrinsics(stated.intrinsics()), without];
    let (gain, lens) = others.into_iter().filter_map(explained).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (gain > MODEL_NATS).then_some(lens)
}

fn with_lens(robot: &Robot, camera: usize, lens: CameraModel) -> Robot {
    let mut robot = robot.clone();
    match camera.checked_sub(1) {
        None => robot.camera.lens = lens,
        Some(further) => robot.further_cameras[further].lens = lens,
    }
    robot
}

/// Returns true if a sensor would be blamed, for some views or for its errors in all.
fn seems_of_sensors(found: &Estimate<'_>) -> bool {
    is_suspicious(found) || has_unsteady_sensor(found)
}

/// Returns true for a focal length within [`LENS_SCALE`] stated sigmas.
fn is_near(found: &Estimate<'_>, camera: usize) -> bool {
    let stated = found.problem.robot.camera_at(camera);
    let mut axes = found.lens(camera).focal_px().into_iter().zip(stated.lens.focal_px());
    axes.all(|(found_px, stated_px)| (found_px / stated_px - 1.0).abs() <= LENS_SCALE * stated.lens_priors.focal_std)
}
