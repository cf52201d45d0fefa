//! The file of a routine and its checks.

use crate::codes::Code;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::camera_mode::CameraFile;
use super::campaign::{CampaignFile, RegressSettings};
use super::definition::{FailedJointEntry, Routine};
use super::error::RoutineError;
use super::method::Method;
use super::overrides::{Overrides, read_with};
use super::scene::SceneFile;
use super::script::{self, Script};
use super::settings::{CaptureSettings, TaskSettings};
use super::site::SiteFile;
use super::step::Step;
use crate::kind::Kind;
use crate::robot::{FileIssue, PartFile, read_text};
use crate::schema::schema_of;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RoutineFile {
    #[serde(rename = "version")]
    _version: u32,
    #[serde(rename = "kind")]
    _kind: Option<Kind>,
    /// Name of the routine (letters, digits, - and _); it names the output folder.
    name: String,
    /// Name of the operator; reports have it, recordings do not.
    operator: Option<String>,
    /// Robot folder, relative to the folder of this file.
    robot: PathBuf,
    /// Vehicle file, relative to the folder of this file.
    vehicle: Option<PathBuf>,
    /// Seed of everything random; `run --seed N` replaces it.
    #[serde(default = "first_seed")]
    seed: u64,
    /// Estimator.
    #[serde(default)]
    method: Method,
    /// Surroundings: seafloor and tags.
    #[serde(default)]
    site: SiteFile,
    /// Obstacles fixed in the world.
    #[serde(default)]
    obstacle: Vec<PartFile>,
    /// Default settings of every capture step.
    #[serde(default)]
    capture: CaptureSettings,
    /// Targets and tolerance.
    task: TaskSettings,
    /// Steps in order; absent: reach, capture, calibrate, reach.
    #[serde(default)]
    #[schemars(schema_with = "super::step_keys::schema")]
    step: Vec<toml::Table>,
    /// Joints whose sensor is known to have failed.
    #[serde(default)]
    failed_joint: Vec<FailedJointEntry>,
    /// Camera of the simulated arm.
    #[serde(default)]
    camera: CameraFile,
    /// The simulated world as it truly is; the estimator does not read it.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, serde_json::Value>")]
    world: toml::Table,
    /// Seeds and settings of `armcal campaign`.
    #[serde(default)]
    campaign: CampaignFile,
    /// Limits of `armcal regress`.
    #[serde(default)]
    regress: RegressSettings,
}

fn first_seed() -> u64 {
    1
}

/// Refuses a capture without held-out views for a method that is not cross-validated.
fn check_held_out(file: &Path, method: Method, steps: &[Step]) -> Result<(), FileIssue> {
    if matches!(method, Method::Bundle | Method::JointLimits) {
        return Ok(());
    }
    let held_out =
        steps.iter().filter_map(|step| if let Step::Capture(settings) = step { Some(settings.held_out) } else { None });
    held_out.min().map_or(Ok(()), |least| {
        FileIssue::check_range(file, "capture.held_out", f64::from(least), 3.0..=1000.0).map(drop)
    })
}

/// Returns the schema of a routine; `[world]` and the keys of faults, which the simulator reads, are open.
#[must_use]
pub fn schema() -> serde_json::Value {
    schema_of::<RoutineFile>(Kind::Routine)
}

/// Reads a routine file.
///
/// # Errors
/// [`RoutineError`] naming file, key and allowed range.
pub fn load(file: &Path) -> Result<Routine, RoutineError> {
    load_with(file, &Overrides::default())
}

/// Reads a routine file with some keys replaced.
///
/// # Errors
/// [`RoutineError`] naming file, key and allowed range, or the override that no key of a routine accepts.
pub fn load_with(file: &Path, overrides: &Overrides) -> Result<Routine, RoutineError> {
    let raw: RoutineFile = read_with(file, &overrides.set)?;
    let check = |key: &str, value: f64, range| FileIssue::check_range(file, key, value, range);
    let vehicle = raw.vehicle.ok_or_else(|| {
        let problem = "is missing; a routine names the vehicle that carries the arm: \
                       robots/vehicles/fixed-base.toml is an arm bolted to the ground";
        FileIssue::new(Code::KeyMissing, file, "vehicle", problem)
    })?;
    raw.capture.check(file, "capture.")?;
    check("task.tolerance_m", raw.task.tolerance_m, 1e-4..=1.0)?;
    if raw.task.targets_m.is_empty() {
        return Err(FileIssue::new(Code::ValueCount, file, "task.targets_m", "needs one target or more").into());
    }
    for (k, target) in raw.task.targets_m.iter().enumerate() {
        for value in target {
            check(&format!("task.targets_m[{k}]"), *value, -100.0..=100.0)?;
        }
    }
    if raw.name.is_empty() || !raw.name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c)) {
        let problem = format!("`{}` must be letters, digits, - and _: it names the output folder", raw.name);
        return Err(FileIssue::new(Code::ValueInvalid, file, "name", problem).into());
    }
    raw.regress.check(file)?;
    let campaign = raw.campaign.check(file)?;
    let folder = file.parent().unwrap_or(Path::new("."));
    let tags = raw.site.tags.clone();
    let (map, base_tag_std) = (raw.site.map(file)?, raw.site.base_tag_std(file)?);
    let (scene, scene_file) = SceneFile::new(raw.site, raw.obstacle).check(file)?;
    let scene_toml = toml::to_string(&scene_file)
        .map_err(|error| FileIssue::new(Code::Internal, file, "obstacle", format!("has no TOML form: {error}")))?;
    let script = if raw.step.is_empty() {
        Script { steps: script::standard(raw.capture, &raw.task), faults: Vec::new() }
    } else {
        let lines = script::step_lines(file, &read_text(file)?);
        script::read(file, (raw.step, &lines), raw.capture, &raw.task)?
    };
    check_held_out(file, raw.method, &script.steps)?;
    Ok(Routine {
        file: file.to_owned(),
        name: raw.name,
        operator: raw.operator,
        robot_folder: overrides.robot.clone().unwrap_or_else(|| folder.join(raw.robot)),
        vehicle_file: overrides.vehicle.clone().unwrap_or_else(|| folder.join(vehicle)),
        seed: raw.seed,
        method: raw.method,
        scene,
        tags,
        map,
        base_tag_std,
        scene_toml,
        capture: raw.capture,
        task: raw.task,
        steps: script.steps,
        world: raw.camera.into_world(file, raw.world)?,
        faults: script.faults,
        campaign,
        regress: raw.regress,
        failed_joints: raw.failed_joint,
    })
}
