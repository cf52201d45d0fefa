//! A routine file to checked types.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::campaign::{CampaignFile, CampaignSettings, RegressSettings};
use super::overrides::{Overrides, read_with};
use super::scene::Scene;
use super::script::{self, Script};
use super::site::SiteFile;
use super::step::{MoveGoal, ReachSettings, Step};
use crate::robot::{
    self, BaseTagStd, FailedJoint, FileIssue, MapKnowledge, PartFile, Robot, RobotError, Vehicle, check_parts,
    parse_toml, read_text,
};

/// A calibration method by its name in files and on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Nominal end stops against the readings there (Williams 1991); needs no camera.
    JointLimits,
    /// The paper's first method: least spread of every landmark's positions; needs no map, and cannot find the first offset.
    MinimumVariance,
    /// The paper's proposed method: least sum of distances to known landmarks.
    MinimumDistance,
    /// Maximum a posteriori over all that the measurements depend on.
    #[default]
    Bundle,
}

impl Method {
    pub const ALL: [Self; 4] = [Self::JointLimits, Self::MinimumVariance, Self::MinimumDistance, Self::Bundle];
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::JointLimits => "joint_limits",
            Self::MinimumVariance => "minimum_variance",
            Self::MinimumDistance => "minimum_distance",
            Self::Bundle => "bundle",
        })
    }
}

impl std::str::FromStr for Method {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|method| method.to_string() == name).ok_or_else(|| {
            let known = Self::ALL.map(|method| method.to_string()).join(", ");
            format!("method `{name}` is not known; there are: {known}")
        })
    }
}

/// A checked routine.
#[derive(Clone, Debug)]
pub struct Routine {
    pub file: PathBuf,
    pub name: String,
    pub robot_folder: PathBuf,
    pub vehicle_file: PathBuf,
    pub seed: u64,
    pub method: Method,
    pub scene: Scene,
    /// The only tags that are there; all of the vehicle's or the robot's where it says nothing.
    pub tags: Option<Vec<u32>>,
    /// How much of the tags' places is known.
    pub map: MapKnowledge,
    pub base_tag_std: BaseTagStd,
    /// Joints that are declared to have failed, by name and kind.
    pub failed_joints: Vec<FailedJointEntry>,
    /// The scene alone, as TOML, to travel with a recording.
    pub scene_toml: String,
    pub capture: CaptureSettings,
    pub task: TaskSettings,
    /// What to do, in order.
    pub steps: Vec<Step>,
    /// The truth's settings, unread.
    pub world: toml::Table,
    /// What breaks at the script's `fault` steps, unread.
    pub faults: Vec<toml::Table>,
    /// What `armcal campaign` runs; a single run does not look at it.
    pub campaign: CampaignSettings,
    /// What `armcal regress` lets pass.
    pub regress: RegressSettings,
}

impl Routine {
    /// Reads the robot and its vehicle, with the tags that the routine says are there.
    ///
    /// # Errors
    /// [`RoutineError`] naming file, key and allowed range.
    pub fn load_arm(&self) -> Result<(Robot, Vehicle), RoutineError> {
        let mut vehicle = robot::load_vehicle(&self.vehicle_file)?;
        let mut robot = robot::load(&self.robot_folder)?.mounted_on(&vehicle)?;
        if let Some(ids) = &self.tags {
            let survey =
                robot.survey().only(ids).map_err(|problem| FileIssue::new(&self.file, "site.tags", problem))?;
            robot = robot.with_survey(survey.clone());
            vehicle.survey = Some(survey);
        }
        if self.map != MapKnowledge::Known || self.base_tag_std != BaseTagStd::default() {
            let survey = robot.survey().with_knowledge(&self.map, self.base_tag_std);
            let survey = survey.map_err(|problem| FileIssue::new(&self.file, "site.known_tags", problem))?;
            robot = robot.with_survey(survey.clone());
            vehicle.survey = Some(survey);
        }
        self.check_against(&robot)?;
        let failed = self.failed_of(&robot)?;
        let robot = robot.with_failed(&failed);
        Ok((robot, vehicle))
    }

    fn failed_of(&self, robot: &Robot) -> Result<Vec<FailedJoint>, RoutineError> {
        let of = |(index, entry): (usize, &FailedJointEntry)| {
            FailedJoint::of_names(&entry.joint, &entry.kind, robot)
                .map_err(|problem| FileIssue::new(&self.file, format!("failed_joint.{index}"), problem).into())
        };
        self.failed_joints.iter().enumerate().map(of).collect()
    }

    /// What only the robot can tell: whether the steps fit its joints.
    ///
    /// # Errors
    /// [`RoutineError`] naming the step.
    fn check_against(&self, robot: &Robot) -> Result<(), RoutineError> {
        let joints = robot.joint_names();
        for (index, step) in self.steps.iter().enumerate() {
            let key = format!("step {} ({})", index + 1, step.name());
            let problem = match step {
                Step::Identify(_) if self.map != MapKnowledge::Known => {
                    "needs a survey: a scale is measured before there are views to map the tags from (site.map)"
                        .to_owned()
                }
                Step::Identify(settings) => match joints.iter().position(|name| *name == settings.joint) {
                    None => format!("joint `{}` is none of {joints:?}", settings.joint),
                    Some(joint) if joint >= robot.camera.mount.n_joints => {
                        format!("joint `{}` does not move the camera, so no view can tell its scale", settings.joint)
                    }
                    Some(_) => continue,
                },
                Step::Stops(settings) => match settings.joints.iter().find(|name| !joints.contains(name)) {
                    None => continue,
                    Some(name) => format!("joint `{name}` is none of {joints:?}"),
                },
                Step::Move(MoveGoal::Angles(angles)) if angles.len() != joints.len() => {
                    format!("to_rad has {} angles, robot `{}` has {} joints", angles.len(), robot.name, joints.len())
                }
                Step::Grip { .. } | Step::Reach(ReachSettings { touch: true, .. }) if robot.gripper.is_none() => {
                    format!("robot `{}` has no [gripper] in its robot.toml", robot.name)
                }
                _ => continue,
            };
            return Err(FileIssue::new(&self.file, key, problem).into());
        }
        Ok(())
    }
}

/// `[[failed_joint]]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailedJointEntry {
    pub joint: String,
    /// `locked`, `dead`, `stuck` or `jumps`.
    pub kind: String,
}

/// How views are captured.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaptureSettings {
    /// Views that the fit uses.
    #[serde(default = "CaptureSettings::default_poses")]
    pub poses: u32,
    /// Views that only the verdict uses.
    #[serde(default = "CaptureSettings::default_held_out")]
    pub held_out: u32,
    /// Tags that a planned view must be expected to see.
    #[serde(default = "CaptureSettings::default_min_tags")]
    pub min_tags: u32,
    /// Free water kept between the arm and everything else, beyond the sensors' error.
    #[serde(default = "CaptureSettings::default_clearance_m")]
    pub clearance_m: f64,
    /// How long the settled arm is watched.
    #[serde(default = "CaptureSettings::default_dwell_s")]
    pub dwell_s: f64,
    /// What the views are chosen for.
    #[serde(default, alias = "choose")]
    pub criterion: PoseCriterion,
    /// After so many views, the running estimate renews margins and remaining poses; 0: planned once.
    #[serde(default = "CaptureSettings::default_replan_every")]
    pub replan_every: u32,
    /// No more views once the predicted tool error at the task (root mean square) is below this.
    #[serde(default)]
    pub stop_at_tool_error_m: Option<f64>,
    /// No more views after so long, by the arm's clock.
    #[serde(default)]
    pub max_time_s: Option<f64>,
    /// What is kept clear beyond `clearance_m`.
    #[serde(default)]
    pub margins: Margins,
}

/// What makes one view better than another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseCriterion {
    /// Least predicted tool error at the task (the test-pose criterion of Klimchik et al. 2014).
    #[default]
    ToolError,
    /// Least volume of the parameters' uncertainty.
    DOptimal,
    /// Least sum of the parameters' variances, in units of their priors.
    AOptimal,
    /// Least of the largest variance, in units of their priors.
    EOptimal,
    /// Any that see enough tags and keep clear; to compare with.
    Random,
}

/// For which arms the clearance is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Margins {
    /// Every arm that the present belief allows.
    #[default]
    Belief,
    /// The believed arm alone; to compare with, never on a real arm.
    Off,
}

impl CaptureSettings {
    fn default_poses() -> u32 {
        30
    }
    fn default_replan_every() -> u32 {
        6
    }

    fn default_held_out() -> u32 {
        8
    }
    fn default_min_tags() -> u32 {
        3
    }
    fn default_clearance_m() -> f64 {
        0.05
    }
    fn default_dwell_s() -> f64 {
        1.0
    }
}

impl CaptureSettings {
    /// `prefix` goes before the keys in messages.
    pub(super) fn check(&self, file: &Path, prefix: &str) -> Result<(), FileIssue> {
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("{prefix}{key}"), value, range);
        check("poses", f64::from(self.poses), 3.0..=1000.0)?;
        check("held_out", f64::from(self.held_out), 0.0..=1000.0)?;
        check("min_tags", f64::from(self.min_tags), 1.0..=100.0)?;
        check("clearance_m", self.clearance_m, 0.0..=1.0)?;
        check("dwell_s", self.dwell_s, 0.2..=60.0)?;
        check("replan_every", f64::from(self.replan_every), 0.0..=1000.0)?;
        if let Some(tool_error_m) = self.stop_at_tool_error_m {
            check("stop_at_tool_error_m", tool_error_m, 1e-5..=1.0)?;
        }
        if let Some(seconds) = self.max_time_s {
            check("max_time_s", seconds, 1.0..=1e6)?;
        }
        Ok(())
    }
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self {
            poses: Self::default_poses(),
            held_out: Self::default_held_out(),
            min_tags: Self::default_min_tags(),
            clearance_m: Self::default_clearance_m(),
            dwell_s: Self::default_dwell_s(),
            criterion: PoseCriterion::default(),
            replan_every: Self::default_replan_every(),
            stop_at_tool_error_m: None,
            max_time_s: None,
            margins: Margins::default(),
        }
    }
}

/// What the arm is calibrated for.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskSettings {
    /// How near the tool must come to count as a hit.
    pub tolerance_m: f64,
    /// Tool positions in the base frame.
    pub targets_m: Vec<[f64; 3]>,
}

/// Why a routine was refused.
#[derive(Debug, thiserror::Error)]
pub enum RoutineError {
    #[error(transparent)]
    File(#[from] RobotError),
}

impl From<FileIssue> for RoutineError {
    fn from(issue: FileIssue) -> Self {
        Self::File(issue.into())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RoutineFile {
    version: u32,
    name: String,
    robot: PathBuf,
    vehicle: PathBuf,
    #[serde(default = "first_seed")]
    seed: u64,
    #[serde(default)]
    method: Method,
    #[serde(default)]
    site: SiteFile,
    #[serde(default)]
    obstacle: Vec<PartFile>,
    #[serde(default)]
    capture: CaptureSettings,
    task: TaskSettings,
    #[serde(default)]
    step: Vec<toml::Table>,
    #[serde(default)]
    failed_joint: Vec<FailedJointEntry>,
    #[serde(default)]
    camera: CameraFile,
    #[serde(default)]
    world: toml::Table,
    #[serde(default)]
    campaign: CampaignFile,
    #[serde(default)]
    regress: RegressSettings,
}

fn first_seed() -> u64 {
    1
}

/// What the routine says of the camera as a user sees it.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    mode: Option<String>,
}

impl CameraFile {
    /// The world's table with the mode in it: where images come from is the truth's business.
    fn into_world(self, file: &Path, mut world: toml::Table) -> Result<toml::Table, FileIssue> {
        const MODES: [&str; 2] = ["geometric", "rendered"];
        let Some(mode) = self.mode else { return Ok(world) };
        if !MODES.contains(&mode.as_str()) {
            return Err(FileIssue::new(file, "camera.mode", format!("`{mode}` is none of {}", MODES.join(", "))));
        }
        let camera = world.entry("camera").or_insert_with(|| toml::Table::new().into());
        // What is no table is refused where the world is read.
        if let Some(camera) = camera.as_table_mut() {
            match camera.get("mode").map(|other| other.as_str().unwrap_or_default()) {
                Some(other) if other != mode => {
                    let problem = format!("`{mode}`, but world.camera.mode is `{other}`: leave one of them out");
                    return Err(FileIssue::new(file, "camera.mode", problem));
                }
                _ => drop(camera.insert("mode".to_owned(), mode.into())),
            }
        }
        Ok(world)
    }
}

/// The part of a routine that says what surrounds the vehicle.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    #[serde(default)]
    site: SiteFile,
    #[serde(default)]
    obstacle: Vec<PartFile>,
}

impl SceneFile {
    /// The scene, and itself without the files of meshes.
    fn check(self, file: &Path) -> Result<(Scene, Self), RoutineError> {
        if let Some(z) = self.site.seafloor_z_m {
            FileIssue::check_range(file, "site.seafloor_z_m", z, -1e4..=0.0)?;
        }
        let (obstacles, plain) = check_parts(&self.obstacle, file, "obstacle")?;
        Ok((Scene { seafloor_z_m: self.site.seafloor_z_m, obstacles }, Self { obstacle: plain, ..self }))
    }
}

/// A method that does not leave its own views out in turn needs others for its verdict.
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

/// Reads the scene that travelled with a recording.
///
/// # Errors
/// [`RoutineError`] naming file, key and allowed range.
pub fn load_scene(file: &Path) -> Result<Scene, RoutineError> {
    Ok(parse_toml::<SceneFile>(file, &read_text(file)?)?.check(file)?.0)
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
/// [`RoutineError`] naming file, key and allowed range, or the override that has no place in a routine.
pub fn load_with(file: &Path, overrides: &Overrides) -> Result<Routine, RoutineError> {
    let raw: RoutineFile = read_with(file, &overrides.set)?;
    let check = |key: &str, value: f64, range| FileIssue::check_range(file, key, value, range);
    check("version", f64::from(raw.version), 1.0..=1.0)?;
    raw.capture.check(file, "capture.")?;
    check("task.tolerance_m", raw.task.tolerance_m, 1e-4..=1.0)?;
    if raw.task.targets_m.is_empty() {
        return Err(FileIssue::new(file, "task.targets_m", "needs one target or more").into());
    }
    for (k, target) in raw.task.targets_m.iter().enumerate() {
        for value in target {
            check(&format!("task.targets_m[{k}]"), *value, -100.0..=100.0)?;
        }
    }
    if raw.name.is_empty() || !raw.name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c)) {
        let problem = format!("`{}` must be letters, digits, - and _: it names the output folder", raw.name);
        return Err(FileIssue::new(file, "name", problem).into());
    }
    raw.regress.check(file)?;
    let campaign = raw.campaign.check(file)?;
    let folder = file.parent().unwrap_or(Path::new("."));
    let tags = raw.site.tags.clone();
    let (map, base_tag_std) = (raw.site.map(file)?, raw.site.base_tag_std(file)?);
    let (scene, scene_file) = SceneFile { site: raw.site, obstacle: raw.obstacle }.check(file)?;
    let scene_toml = toml::to_string(&scene_file)
        .map_err(|error| FileIssue::new(file, "obstacle", format!("has no TOML form: {error}")))?;
    let script = if raw.step.is_empty() {
        Script { steps: script::standard(raw.capture, &raw.task), faults: Vec::new() }
    } else {
        script::read(file, raw.step, raw.capture, &raw.task)?
    };
    check_held_out(file, raw.method, &script.steps)?;
    Ok(Routine {
        file: file.to_owned(),
        name: raw.name,
        robot_folder: overrides.robot.clone().unwrap_or_else(|| folder.join(raw.robot)),
        vehicle_file: overrides.vehicle.clone().unwrap_or_else(|| folder.join(raw.vehicle)),
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
