//! `armcal export`: a calibration in another form, on stdout.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::cli::exit::{Exit, UsageError};
use crate::cli::stdout::say;
use armcal_belief::calib::{Calibration, CalibrationFileError, CompactCalibration, CovarianceTable, LookupTable};
use armcal_core::files::{self, FileKind};
use armcal_core::robot::{self, Robot};
use armcal_core::sensor::{ArmSensors, SensorModel};

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// calibration.toml, or a file with the compact text; - for stdin
    file: PathBuf,
    /// The form that is wanted
    #[arg(long = "as", value_enum)]
    form: Form,
    /// Robot folder: turns a compact text's corrections into the keys of calibration.toml
    #[arg(long)]
    robot: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Form {
    /// All of it, for programs that read YAML
    Yaml,
    /// All of it, as calibration.toml has it
    Toml,
    /// One line below 512 bytes
    Compact,
}

enum Input {
    Full(Box<Calibration>),
    Compact(Box<CompactCalibration>),
}

pub(super) fn export(args: &ExportArgs) -> Result<Exit> {
    let robot = args.robot.as_deref().map(robot::load).transpose()?;
    let text = match (read_input(&args.file)?, args.form) {
        (Input::Full(calibration), form) => {
            if let Some(robot) = &robot {
                calibration.sensors(robot)?;
            }
            of_full(&calibration, form)?
        }
        (Input::Compact(compact), form) => of_compact(&compact, robot.as_ref(), form)?,
    };
    say(text.trim_end())?;
    Ok(Exit::Ok)
}

fn of_full(calibration: &Calibration, form: Form) -> Result<String> {
    Ok(match form {
        Form::Yaml => {
            let covariance = Some(&calibration.covariance).filter(|table| !table.parameters.is_empty());
            to_yaml(&FullView { calibration, lookup: calibration.lookup(), covariance })?
        }
        Form::Toml => calibration.to_toml(),
        Form::Compact => CompactCalibration::of(calibration)?.to_text()?,
    })
}

fn of_compact(compact: &CompactCalibration, robot: Option<&Robot>, form: Form) -> Result<String> {
    let sensors = robot.map(|robot| compact.sensors(robot)).transpose()?;
    let lookup = sensors.iter().flat_map(|sensors| &sensors.models).filter_map(LookupTable::of).collect();
    let view = CompactView { compact, joint_of_robot: sensors.map(joints_of), lookup };
    Ok(match form {
        Form::Yaml => to_yaml(&view)?,
        Form::Toml => toml::to_string(&view).context("the compact calibration has no TOML form")?,
        Form::Compact => compact.to_text()?,
    })
}

fn to_yaml<T: Serialize>(value: &T) -> Result<String> {
    serde_saphyr::to_string(value).context("the calibration has no YAML form")
}

/// A calibration, its covariance where that is at hand, and its terms as tables.
#[derive(Serialize)]
struct FullView<'a> {
    #[serde(flatten)]
    calibration: &'a Calibration,
    #[serde(skip_serializing_if = "Option::is_none")]
    covariance: Option<&'a CovarianceTable>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lookup: Vec<LookupTable>,
}

/// A compact calibration, and with its robot at hand the same corrections under the keys of calibration.toml.
#[derive(Serialize)]
struct CompactView<'a> {
    #[serde(flatten)]
    compact: &'a CompactCalibration,
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_of_robot: Option<Vec<JointOfRobot>>,
    /// Of the joints with terms.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lookup: Vec<LookupTable>,
}

/// As in calibration.toml.
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
        files::read_within(std::io::stdin().lock(), FileKind::Text)
    } else {
        files::read_bytes(file, FileKind::Text)
    };
    let bytes = read.map_err(|error| UsageError(format!("{name}: cannot be read: {error}")))?;
    let not_text = |_| UsageError(format!("{name}: is no text: neither a calibration.toml nor a compact calibration"));
    let text = std::str::from_utf8(&bytes).map_err(not_text)?;
    if text.trim_start().starts_with("armcal") {
        let compact = CompactCalibration::from_text(text).with_context(|| name)?;
        return Ok(Input::Compact(Box::new(compact)));
    }
    if !text.contains("[[joint]]") {
        let what = "neither a calibration.toml nor a compact calibration (which begins with `armcal1` or `armcal2`)";
        return Err(UsageError(format!("{name}: is {what}")).into());
    }
    if !is_stdin {
        match Calibration::read(file) {
            Err(CalibrationFileError::NoCovariance { .. }) => {}
            read => return Ok(Input::Full(Box::new(read?))),
        }
    }
    Ok(Input::Full(Box::new(Calibration::parse(Path::new(&name), text)?)))
}
