//! `plan`: views and paths of a capture, without moving.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;

use crate::arrays::whole;
use crate::calibration::{Calibration, as_python};
use crate::errors::{of_any, wrong_value};
use crate::interruptible::interruptible;
use crate::robot::{Robot, Task, check_prior};

/// Plans the views of a capture and certified paths to them; returns a dictionary with the keys of plan.toml.
///
/// vehicle: what carries the arm; without one it stands on the ground. prior: an accepted Calibration, which makes the
/// margins smaller. poses: views to fit, 30 where it is not given. seed: of all that is random, else 1.
#[pyfunction]
#[pyo3(signature = (robot, task, *, vehicle=None, prior=None, poses=None, seed=None))]
pub fn plan<'py>(
    py: Python<'py>,
    robot: &Robot,
    task: &Task,
    vehicle: Option<PathBuf>,
    prior: Option<&Calibration>,
    poses: Option<&Bound<'py, PyAny>>,
    seed: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let prior = prior.map(|prior| Arc::clone(&prior.inner));
    prior.as_deref().map_or(Ok(()), check_prior)?;
    let number = |of: Option<&Bound<'py, PyAny>>, name, usual, most| of.map_or(Ok(usual), |of| whole(of, name, most));
    let (poses, seed) = (number(poses, "poses", 30, 1000)?, number(seed, "seed", 1, u64::MAX >> 1)?);
    let reach = task.of(&robot.inner)?;
    let vehicle =
        vehicle.unwrap_or_else(|| armcal::front::robot_folder(&PathBuf::from("vehicles")).join("fixed-base.toml"));
    let absolute = |path: PathBuf| std::path::absolute(&path).unwrap_or(path).display().to_string();
    let text = |value: String| toml::Value::String(value);
    let targets = reach.targets_m.iter().map(|target| toml::Value::from(target.to_vec())).collect::<Vec<_>>();
    let routine = toml::toml! {
        version = 1
        kind = "routine"
        name = "plan"
    };
    let mut routine = routine;
    routine.insert("seed".into(), toml::Value::Integer(seed as i64));
    routine.insert("robot".into(), text(absolute(robot.inner.folder.clone())));
    routine.insert("vehicle".into(), text(absolute(vehicle)));
    let mut reached = toml::Table::new();
    reached.insert("tolerance_m".into(), reach.tolerance_m.into());
    reached.insert("targets_m".into(), targets.into());
    routine.insert("task".into(), reached.into());
    let mut capture = toml::Table::new();
    capture.insert("poses".into(), toml::Value::Integer(poses as i64));
    routine.insert("capture".into(), capture.into());
    let folder =
        tempfile::tempdir().map_err(|error| wrong_value(format!("no temporary folder can be made: {error}")))?;
    let file = folder.path().join("plan.toml");
    std::fs::write(&file, routine.to_string()).map_err(|error| wrong_value(format!("{}: {error}", file.display())))?;
    let prior = prior.map(|prior| (*prior).clone());
    let planned = interruptible(py, move || armcal::cli::plan_routine(&file, prior))?;
    let planned = planned.map_err(|error| of_any(&error))?;
    as_python(py, &serde_json::to_string(&planned))
}
