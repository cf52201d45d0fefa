//! `simulate`: a routine's closed loop on a simulated arm.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armcal::output::OutputFolder;
use armcal::report::RunSummary;
use armcal::routine::Overrides;
use armcal::run::{Keep, RunInputs, RunOutput, execute};
use armcal::session::Unwatched;
use pyo3::prelude::*;
use tempfile::TempDir;

use crate::arrays::whole;
use crate::calibration::{Calibration, as_python};
use crate::errors::{not_pickled, of_any, raised, wrong_value};
use crate::interruptible::interruptible;
use crate::robot::Robot;

/// Runs a routine on a simulated arm: reach, plan, capture, calibrate, reach again; returns a Run.
///
/// routine: its file, or the name of one that comes with armcal, such as "titan4-quickstart". seed: of all that is
/// random. out: folder of the results; without one they are removed with the Run. set: keys of the routine that are
/// replaced, such as {"capture.poses": 20}.
#[pyfunction]
#[pyo3(signature = (routine, *, seed=None, out=None, set=None))]
pub fn simulate(
    py: Python<'_>,
    routine: PathBuf,
    seed: Option<&Bound<'_, PyAny>>,
    out: Option<PathBuf>,
    set: Option<std::collections::BTreeMap<String, Bound<'_, PyAny>>>,
) -> PyResult<Run> {
    let seed = seed.map(|seed| whole(seed, "seed", u64::MAX >> 1)).transpose()?;
    let file = armcal::front::routine_file(&routine);
    let mut overrides = Overrides::default();
    for (key, value) in set.iter().flatten() {
        let value = py.import("json")?.call_method1("dumps", (value,))?.extract::<String>()?;
        let one = format!("{key}={value}").parse().map_err(|problem| wrong_value(format!("set: {problem}")))?;
        overrides.set.push(one);
    }
    let inputs = RunInputs::load(&file, &overrides).map_err(raised)?;
    let temporary = out.is_none().then(TempDir::new).transpose();
    let temporary =
        temporary.map_err(|error| wrong_value(format!("no temporary folder can be made: {error}; give out")))?;
    let folder = out.or_else(|| Some(temporary.as_ref()?.path().join(&inputs.routine.name))).unwrap_or_default();
    let (output, _) = OutputFolder::open(&folder).map_err(raised)?;
    let robot = Arc::new(inputs.robot.clone());
    let finished = interruptible(py, move || {
        let seed = seed.unwrap_or(inputs.routine.seed);
        let output = RunOutput { folder: &output, keep: Keep::Everything, listener: None };
        execute(&inputs, seed, output, &mut Unwatched)
    })?;
    let finished = finished.map_err(|failure| of_any(&anyhow::Error::new(*failure.error)))?;
    let folder = finished.kept.map_or(folder, |kept| kept.folder);
    Ok(Run { folder, _temporary: temporary, summary: finished.summary, calibration: finished.calibration, robot })
}

/// Results of a simulated run.
#[pyclass(frozen, module = "armcal")]
pub struct Run {
    folder: PathBuf,
    _temporary: Option<TempDir>,
    summary: RunSummary,
    calibration: armcal::Calibration,
    robot: Arc<armcal::Robot>,
}

#[pymethods]
impl Run {
    /// Folder of recording, truth, replay, calibration and report.
    #[getter]
    fn folder(&self) -> &Path {
        &self.folder
    }

    /// The recording, for Recording.open.
    #[getter]
    fn recording(&self) -> PathBuf {
        self.folder.join("run.mcap")
    }

    /// Its robot.
    #[getter]
    fn robot(&self) -> Robot {
        Robot { inner: Arc::clone(&self.robot) }
    }

    /// The calibration at its end.
    #[getter]
    fn calibration(&self) -> PyResult<Calibration> {
        Calibration::new(&self.robot, self.calibration.clone(), self.summary.calibration.wall_s)
    }

    /// All figures, as summary.json has them; those under "score" are of the simulated truth.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        as_python(py, &serde_json::to_string(&self.summary))
    }

    fn __repr__(&self) -> String {
        format!("Run({:?}, {:?})", self.summary.routine.as_deref().unwrap_or_default(), self.folder)
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Run", "give its folder to the other process")
    }
}
