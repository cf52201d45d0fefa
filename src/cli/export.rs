//! `armcal export`: a calibration in another form, on stdout.

use armcal_core::codes::{Code, Coded};
use armcal_core::kind::Kind;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::Value;

use crate::cli::calibration_inputs::load_robot;
use crate::cli::exit::{Exit, UsageError};
use crate::cli::file_kind::{FileKind, expect_kind};
use crate::cli::named;
use crate::cli::stdout::{complain, say, warn};
use crate::export::{
    Comments, LinkPoseForm, MAX_POINTS, MIN_POINTS, SensorTable, calibrated_link_poses, calibrated_urdf, camchain,
    csv_rows, joints_with_terms, lerobot_homings, marked_as_refused, ros_parameters, ros2_control,
    ros2_control_offsets, tagslam_map,
};
use armcal_belief::calib::{
    Calibration, CalibrationFileError, CompactCalibration, CovarianceTable, LookupTable, Status, metric,
};
use armcal_core::files::{self, FileKind as Size};
use armcal_core::input::read_input_map;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, SensorModel};

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// calibration.toml, or a file with the compact text; - for stdin
    file: PathBuf,
    /// Output form
    #[arg(long = "as", value_enum)]
    form: Form,
    /// Robot folder that the calibration was made with: required by urdf, ros2-control, ros-parameters, table,
    /// kalibr, ur, franka and lerobot; expands a compact line to the keys of calibration.toml
    #[arg(long, value_name = "DIR", value_parser = named::robot())]
    robot: Option<PathBuf>,
    /// Points per joint of a table, 2 to 10000; default: as few as keep the tool within 0.02 mm
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(MIN_POINTS as i64..=MAX_POINTS as i64))]
    points: Option<u16>,
    /// Input map of the recording, which names LeRobot's JSON: required by lerobot
    #[arg(long, value_name = "MAP")]
    input: Option<PathBuf>,
    /// Also write a refused calibration
    #[arg(long)]
    refused: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Form {
    /// Complete calibration as YAML
    Yaml,
    /// Complete calibration with the keys of calibration.toml
    Toml,
    /// One line below 512 bytes
    Compact,
    /// URDF with link corrections and camera mount; sensors are not included
    Urdf,
    /// `ros2_control` block with each joint's gain and offset as a transmission
    Ros2Control,
    /// ROS 2 parameter file: each joint's gain, offset, terms and their covariance
    RosParameters,
    /// CSV: counts to radians at points over the range of each joint
    Table,
    /// CSV: one row per joint, with standard deviations
    Csv,
    /// Complete calibration as JSON, keys as in YAML
    Json,
    /// Camera as Kalibr's camchain.yaml
    Kalibr,
    /// Mapped tags as TagSLAM's tagslam.yaml
    Tagslam,
    /// Each joint's offset as a `<param>` of its `ros2_control` joint
    Ros2ControlOffset,
    /// LeRobot's calibration JSON with homing offsets as calibrated
    Lerobot,
    /// Link poses as Universal Robots' kinematics.yaml; sensors are not included
    Ur,
    /// Link poses as Franka's kinematics.yaml; sensors are not included
    Franka,
}

impl Form {
    fn link_poses(self) -> LinkPoseForm {
        if self == Self::Ur { LinkPoseForm::Ur } else { LinkPoseForm::Franka }
    }

    /// Comments of the form; `None` for JSON, and for forms with the calibration's status among their keys.
    fn comments(self) -> Option<Comments> {
        match self {
            Self::Urdf | Self::Ros2Control | Self::Ros2ControlOffset => Some(Comments::Xml),
            Self::Table | Self::Csv | Self::Kalibr | Self::Tagslam | Self::Ur | Self::Franka => Some(Comments::Hash),
            Self::Yaml | Self::Toml | Self::Compact | Self::RosParameters | Self::Json | Self::Lerobot => None,
        }
    }

    fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }
}

enum Input {
    Full(Box<Calibration>),
    Compact(Box<CompactCalibration>),
}

impl Input {
    /// Reason that the calibration must not be used; `None` for an accepted one.
    fn refusal(&self) -> Option<String> {
        let (status, why) = match self {
            Self::Full(calibration) => (calibration.status, &calibration.refusal),
            Self::Compact(compact) => (compact.status, &compact.refusal_code),
        };
        let why = || why.clone().unwrap_or_else(|| "no reason given".to_owned());
        (status == Status::Refused).then(why)
    }

    /// Code of the first reason; `None` for an accepted calibration.
    fn refusal_code(&self) -> Option<String> {
        match self {
            Self::Full(calibration) => refusal_code(calibration),
            Self::Compact(compact) => {
                let code = || compact.refusal_code.clone().unwrap_or_else(|| UNNAMED.to_owned());
                (compact.status == Status::Refused).then(code)
            }
        }
    }
}

/// Code of a reason that a file holds only as a sentence.
const UNNAMED: &str = "other";

fn refusal_code(calibration: &Calibration) -> Option<String> {
    let code = calibration.refusals.first().map_or(UNNAMED, |refusal| refusal.code().as_str());
    (calibration.status == Status::Refused).then(|| code.to_owned())
}

/// Text with a note that its calibration was refused, if it was; adds the note to `left_out` for a form that can hold
/// none.
fn noted(form: Form, text: String, code: Option<&str>, left_out: &mut Vec<String>) -> String {
    match (form.comments(), code) {
        (Some(comments), Some(code)) => marked_as_refused(&text, comments, code),
        (None, Some(code)) if form == Form::Lerobot => {
            lacking("LeRobot's JSON", &[format!("that the calibration was REFUSED, {code}")], left_out);
            text
        }
        _ => text,
    }
}

pub(super) fn export(args: &ExportArgs) -> Result<Exit> {
    if args.points.is_some() && args.form != Form::Table {
        return Err(UsageError::new(
            Code::UsageInvalid,
            format!("--points goes with --as table, not with --as {}", args.form.name()),
        )
        .into());
    }
    expect_kind(&args.file, &[FileKind::Toml(Kind::Calibration)])?;
    let robot = args.robot.as_deref().map(|folder| load_robot(folder, &[])).transpose()?;
    let input = read_input(&args.file)?;
    if !args.refused
        && let Some(why) = input.refusal()
    {
        let (file, form) = (args.file.display(), args.form.name());
        complain(format!("error: {file}: the calibration is refused: {why}; add --refused to export it as {form}"));
        return Ok(Exit::Refused);
    }
    let mut left_out = Vec::new();
    let refusal = input.refusal_code();
    let text = match input {
        Input::Full(calibration) => {
            if let Some(robot) = &robot {
                calibration.check_robot(&args.file, robot)?;
                calibration.sensors(robot)?;
            }
            of_full(&calibration, robot.as_ref(), args, &mut left_out)?
        }
        Input::Compact(compact) => of_compact(&compact, robot.as_ref(), args, &mut left_out)?,
    };
    let text = noted(args.form, text, refusal.as_deref(), &mut left_out);
    left_out.iter().for_each(|sentence| warn(Code::ExportIncomplete, sentence));
    say(text.trim_end())?;
    Ok(Exit::Ok)
}

/// The calibration in the named form, and the parts that this form cannot hold; `input` is the input map that `lerobot`
/// needs.
///
/// # Errors
/// An unknown name, or a calibration of another robot.
pub fn export_text(
    calibration: &Calibration,
    robot: &Robot,
    form: &str,
    input: Option<&Path>,
) -> Result<(String, Vec<String>)> {
    let known = || Form::value_variants().iter().map(|form| form.name()).collect::<Vec<_>>().join(", ");
    let form = Form::from_str(form, false).map_err(|_| {
        UsageError::new(Code::UsageInvalid, format!("`{form}` is no form of a calibration; it is one of {}", known()))
    })?;
    let file = PathBuf::from("calibration");
    calibration.check_robot(&file, robot)?;
    calibration.sensors(robot)?;
    let args = ExportArgs { file, form, robot: None, points: None, input: input.map(Path::to_owned), refused: true };
    let mut left_out = Vec::new();
    let text = of_full(calibration, Some(robot), &args, &mut left_out)?;
    let text = noted(form, text, refusal_code(calibration).as_deref(), &mut left_out);
    Ok((text, left_out))
}

fn of_full(
    calibration: &Calibration,
    robot: Option<&Robot>,
    args: &ExportArgs,
    left_out: &mut Vec<String>,
) -> Result<String> {
    let file = &args.file;
    Ok(match args.form {
        Form::Yaml if calibration.has_slide() => to_yaml(&FullView::of(calibration).in_own_units()?)?,
        Form::Yaml => to_yaml(&FullView::of(calibration))?,
        Form::Json if calibration.has_slide() => format!("{:#}", FullView::of(calibration).in_own_units()?),
        Form::Json => {
            serde_json::to_string_pretty(&FullView::of(calibration)).context("the calibration has no JSON form")?
        }
        Form::Toml => calibration.to_toml(),
        Form::Compact => CompactCalibration::of(calibration)?.to_text()?,
        Form::Csv => csv_rows(calibration),
        Form::Tagslam => tagslam_map(file, calibration)?,
        Form::Kalibr => camchain(file, calibration, drawing(robot, args.form)?)?,
        Form::RosParameters => ros_parameters(drawing(robot, args.form)?, calibration),
        Form::Urdf => {
            let urdf = calibrated_urdf(file, calibration, drawing(robot, args.form)?)?;
            lacking("a URDF", &urdf.left_out, left_out);
            urdf.text
        }
        Form::Ros2ControlOffset => {
            let robot = drawing(robot, args.form)?;
            let (text, lacks) = ros2_control_offsets(robot, &calibration.sensors(robot)?);
            lacking("an offset", &lacks, left_out);
            text
        }
        Form::Lerobot => of_lerobot(calibration, drawing(robot, args.form)?, args, left_out)?,
        Form::Ur | Form::Franka => {
            let poses = calibrated_link_poses(file, calibration, drawing(robot, args.form)?, args.form.link_poses())?;
            lacking("a file of link poses", &poses.left_out, left_out);
            poses.text
        }
        Form::Ros2Control | Form::Table => {
            let robot = drawing(robot, args.form)?;
            of_sensors(robot, &calibration.sensors(robot)?, args, left_out)
        }
    })
}

/// LeRobot's JSON, which the input map names, with new homing offsets.
fn of_lerobot(
    calibration: &Calibration,
    robot: &Robot,
    args: &ExportArgs,
    left_out: &mut Vec<String>,
) -> Result<String> {
    let missing = || UsageError::new(Code::UsageInvalid, NO_MAP.to_owned());
    let map_file = args.input.as_deref().ok_or_else(missing)?;
    let map = read_input_map(map_file)?;
    let sensors = calibration.sensors(robot)?;
    let homings = lerobot_homings((map_file, &map), calibration, (robot, &sensors))?;
    lacking("LeRobot's JSON", &homings.left_out, left_out);
    Ok(homings.text)
}

const NO_MAP: &str = "--as lerobot needs the input map that names LeRobot's JSON: add --input MAP";

/// Adds a sentence for each part that a form cannot hold.
fn lacking(form: &str, lacks: &[String], left_out: &mut Vec<String>) {
    left_out.extend(lacks.iter().map(|what| format!("left out, for {form} cannot hold it: {what}")));
}

fn of_compact(
    compact: &CompactCalibration,
    robot: Option<&Robot>,
    args: &ExportArgs,
    left_out: &mut Vec<String>,
) -> Result<String> {
    let sensors = robot.map(|robot| compact.sensors(robot)).transpose()?;
    let view = |sensors: Option<ArmSensors>| {
        let lookup = sensors.iter().flat_map(|sensors| &sensors.models).filter_map(LookupTable::of).collect();
        CompactView { compact, joint_of_robot: sensors.map(joints_of), lookup }
    };
    Ok(match (args.form, sensors) {
        (Form::Yaml, sensors) => to_yaml(&view(sensors))?,
        (Form::Json, sensors) => {
            serde_json::to_string_pretty(&view(sensors)).context("the compact calibration has no JSON form")?
        }
        (Form::Toml, sensors) => toml::to_string(&view(sensors)).context("the compact calibration has no TOML form")?,
        (Form::Compact, _) => compact.to_text()?,
        (Form::Ros2Control | Form::Table, sensors) => {
            let robot = drawing(robot, args.form)?;
            of_sensors(robot, &sensors.map_or_else(|| compact.sensors(robot), Ok)?, args, left_out)
        }
        (
            Form::Urdf
            | Form::RosParameters
            | Form::Csv
            | Form::Kalibr
            | Form::Tagslam
            | Form::Ur
            | Form::Franka
            | Form::Lerobot
            | Form::Ros2ControlOffset,
            _,
        ) => {
            let (file, form) = (args.file.display(), args.form.name());
            let problem =
                format!("{file}: is a compact calibration, which lacks what {form} needs; give calibration.toml");
            return Err(UsageError::new(Code::UsageInvalid, problem).into());
        }
    })
}

/// Text of the forms that need only sensors. Adds terms that a transmission cannot hold to `left_out`.
fn of_sensors(robot: &Robot, sensors: &ArmSensors, args: &ExportArgs, left_out: &mut Vec<String>) -> String {
    if args.form == Form::Table {
        return SensorTable::new(robot, sensors, args.points.map(usize::from)).to_csv(robot);
    }
    let bent = joints_with_terms(sensors).collect::<Vec<_>>().join(", ");
    if !bent.is_empty() {
        let text = "left out, for a transmission is a straight line: the terms of";
        left_out.push(format!("{text} {bent}; a table has them"));
    }
    ros2_control(robot, sensors)
}

fn drawing(robot: Option<&Robot>, form: Form) -> Result<&Robot> {
    let missing = || {
        UsageError::new(Code::UsageInvalid, format!("--as {} needs the arm's drawing: add --robot DIR", form.name()))
    };
    Ok(robot.ok_or_else(missing)?)
}

fn to_yaml<T: Serialize>(value: &T) -> Result<String> {
    serde_saphyr::to_string(value).context("the calibration has no YAML form")
}

/// A calibration, its covariance if it has one, and its terms as tables.
#[derive(Serialize)]
struct FullView<'a> {
    #[serde(flatten)]
    calibration: &'a Calibration,
    #[serde(skip_serializing_if = "Option::is_none")]
    covariance: Option<&'a CovarianceTable>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lookup: Vec<LookupTable>,
}

impl<'a> FullView<'a> {
    fn of(calibration: &'a Calibration) -> Self {
        let covariance = Some(&calibration.covariance).filter(|table| !table.parameters.is_empty());
        Self { calibration, lookup: calibration.lookup(), covariance }
    }

    /// Converts the view to JSON, with the keys of slides in metres, as in calibration.toml.
    fn in_own_units(&self) -> Result<Value> {
        let mut view = serde_json::to_value(self).context("the calibration has no JSON form")?;
        let is_slide = |name: Option<&str>| {
            self.calibration.joint.iter().any(|joint| joint.moves.is_slide() && Some(joint.name.as_str()) == name)
        };
        for (list, name) in [("joint", "name"), ("lookup", "joint")] {
            let entries = view.get_mut(list).and_then(Value::as_array_mut);
            for entry in entries.into_iter().flatten() {
                if is_slide(entry.get(name).and_then(Value::as_str)) {
                    *entry = in_metres(entry);
                }
            }
        }
        Ok(view)
    }
}

fn in_metres(value: &Value) -> Value {
    let Value::Object(table) = value else { return value.clone() };
    Value::Object(table.iter().map(|(key, value)| (metric(key), in_metres(value))).collect())
}

/// A compact calibration. With its robot given, it has the same corrections under the keys of calibration.toml.
#[derive(Serialize)]
struct CompactView<'a> {
    #[serde(flatten)]
    compact: &'a CompactCalibration,
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_of_robot: Option<Vec<JointOfRobot>>,
    /// Tables of the joints with terms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lookup: Vec<LookupTable>,
}

/// One joint's correction with the keys of calibration.toml.
#[derive(Serialize)]
struct JointOfRobot {
    name: String,
    center_rad: f64,
    gain_rad_per_count: f64,
    offset_rad: f64,
}

fn joints_of(sensors: ArmSensors) -> Vec<JointOfRobot> {
    let one = |model: SensorModel| JointOfRobot {
        gain_rad_per_count: model.correction.gain / model.spec.counts_per_rad,
        offset_rad: model.correction.offset_rad,
        center_rad: model.spec.center_rad,
        name: model.spec.joint,
    };
    sensors.models.into_iter().map(one).collect()
}

fn read_input(file: &Path) -> Result<Input> {
    let is_stdin = file == Path::new("-");
    let name = if is_stdin { "stdin".to_owned() } else { file.display().to_string() };
    let read = if is_stdin {
        files::read_within(std::io::stdin().lock(), Size::Text)
    } else {
        files::read_bytes(file, Size::Text)
    };
    let bytes =
        read.map_err(|error| UsageError::new(Code::FileUnreadable, format!("{name}: cannot be read: {error}")))?;
    let not_text = |_| {
        UsageError::new(
            Code::FileFormat,
            format!("{name}: is no text: neither a calibration.toml nor a compact calibration"),
        )
    };
    let text = std::str::from_utf8(&bytes).map_err(not_text)?;
    if text.trim_start().starts_with("armcal") {
        let compact = CompactCalibration::from_text(text).with_context(|| name)?;
        return Ok(Input::Compact(Box::new(compact)));
    }
    if !text.contains("[[joint]]") {
        let what = "neither a calibration.toml nor a compact calibration (which begins with `armcal1` or `armcal2`)";
        return Err(UsageError::new(Code::FileKind, format!("{name}: is {what}")).into());
    }
    if !is_stdin {
        match Calibration::read(file) {
            Err(CalibrationFileError::NoCovariance { .. }) => {}
            read => return Ok(Input::Full(Box::new(read?))),
        }
    }
    Ok(Input::Full(Box::new(Calibration::parse(Path::new(&name), text)?)))
}
