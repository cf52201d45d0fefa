//! `calibrate` and `Calibration`: the result, its arrays and its files.

use std::ffi::CString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use armcal::front::MAX_OIL_C;
use armcal::joints::JointCounts;
use armcal::report::{About, Report, RunSummary, html};
use armcal::sensor::Conditions;
use armcal::{CalibratedArm, Calibrator, Method, Status};
use numpy::ndarray::ArrayView1;
use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::numbers;
use crate::errors::{not_pickled, of_any, raised, wrong_value};
use crate::interruptible::interruptible;
use crate::robot::{Robot, TagMap, Task, by_rows, check_prior};
use crate::views::Views;

/// Calibrates the joint sensors of `robot` by `views`; returns a Calibration, accepted or refused.
///
/// tags: landmarks instead of those that the recording or the robot's folder has. task: targets and tolerance that the
/// result is judged for. prior: an accepted Calibration to start from. method: "bundle", or one of the paper's.
#[pyfunction]
#[pyo3(signature = (robot, views, *, tags=None, task=None, prior=None, method="bundle"))]
pub fn calibrate(
    py: Python<'_>,
    robot: &Robot,
    views: &Views,
    tags: Option<&TagMap>,
    task: Option<&Task>,
    prior: Option<&Calibration>,
    method: &str,
) -> PyResult<Calibration> {
    let method: Method = method.parse().map_err(|problem| wrong_value(format!("method: {problem}")))?;
    let prior = prior.map(|prior| Arc::clone(&prior.inner));
    prior.as_deref().map_or(Ok(()), check_prior)?;
    let task = task.map(|task| task.of(&robot.inner)).transpose()?;
    let tags = tags.map(|tags| (tags.file.clone(), tags.inner.clone()));
    let (arm, measured) = (Arc::clone(&robot.inner), Arc::clone(&views.inner));
    let (found, wall_s) = interruptible(py, move || {
        let started = Instant::now();
        let mut calibrator = Calibrator::new(&arm).method(method);
        if let Some((file, tags)) = tags {
            calibrator = calibrator.tags(&file, tags);
        }
        if let Some(task) = task {
            calibrator = calibrator.task(task);
        }
        if let Some(prior) = &prior {
            calibrator = calibrator.prior(prior);
        }
        let found = calibrator.calibrate(&measured);
        (found, started.elapsed().as_secs_f64())
    })?;
    Calibration::new(&robot.inner, found.map_err(raised)?, wall_s)
}

/// A calibration of the joint sensors, accepted or refused.
#[pyclass(frozen, module = "armcal")]
pub struct Calibration {
    pub inner: Arc<armcal::Calibration>,
    robot: Arc<armcal::Robot>,
    arm: CalibratedArm,
    summary: RunSummary,
}

impl Calibration {
    pub fn new(robot: &Arc<armcal::Robot>, inner: armcal::Calibration, wall_s: f64) -> PyResult<Self> {
        Ok(Self {
            arm: inner.arm(robot).map_err(raised)?,
            summary: RunSummary::of_calibration(&inner, wall_s).judged(),
            robot: Arc::clone(robot),
            inner: Arc::new(inner),
        })
    }

    fn conditions(&self, oil_c: Option<f64>, pressure_pa: Option<f64>) -> PyResult<Conditions> {
        for (name, value, most) in [("oil_c", oil_c, MAX_OIL_C), ("pressure_pa", pressure_pa, 2e8)] {
            if value.is_some_and(|value| !value.is_finite() || value.abs() > most) {
                return Err(wrong_value(format!("{name} must be within {most}; leave it out where it is not known")));
            }
        }
        let reference = self.arm.sensors().reference;
        Ok(Conditions {
            oil_c: oil_c.or(reference.oil_c),
            pressure_pa: pressure_pa.or(reference.pressure_pa),
            ..reference
        })
    }

    /// `number` of one reading (j,) or of each of several (n, j), as one array of `shape` or (n, `shape`).
    fn by_reading<'py>(
        &self,
        counts: &Bound<'py, PyAny>,
        (oil_c, pressure_pa): (Option<f64>, Option<f64>),
        shape: &[usize],
        number: impl Fn(&JointCounts, &Conditions) -> Vec<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let py = counts.py();
        let conditions = self.conditions(oil_c, pressure_pa)?;
        let (n, names) = (self.robot.n_joints(), self.robot.joint_names());
        let meaning = format!("({n},) or (n, {n}): a reading each for the joints {names:?}");
        let is_one = py.import("numpy")?.call_method1("ndim", (counts,))?.extract::<usize>()? == 1;
        let wanted: &[Option<usize>] = if is_one { &[Some(n)] } else { &[None, Some(n)] };
        let read = numbers(counts, "counts", wanted, &meaning)?;
        let array = read.as_array();
        if array.iter().any(|count| !count.is_finite()) {
            return Err(wrong_value("counts has values that are not finite; leave such readings out"));
        }
        let rows = array.to_shape((array.len() / n, n)).map_err(|_| wrong_value(format!("give counts {meaning}")))?;
        let of_row = |row: ArrayView1<'_, f64>| number(&JointCounts::from_fn(n, |joint| row[joint]), &conditions);
        let each: Vec<f64> = rows.rows().into_iter().flat_map(of_row).collect();
        let first = (!is_one).then_some(rows.nrows());
        let full: Vec<usize> = first.into_iter().chain(shape.iter().copied()).collect();
        PyArray1::from_vec(py, each).reshape(full)
    }
}

#[pymethods]
impl Calibration {
    /// Reads calibration.toml, and the covariance next to it.
    #[staticmethod]
    fn load(file: PathBuf, robot: &Robot) -> PyResult<Self> {
        let inner = armcal::Calibration::read(&file).map_err(raised)?;
        Self::new(&robot.inner, inner, 0.0)
    }

    /// "accepted" or "refused".
    #[getter]
    fn status(&self) -> &str {
        if self.inner.status == Status::Accepted { "accepted" } else { "refused" }
    }

    /// Why it was refused, in words; None where it was accepted.
    #[getter]
    fn refusal(&self) -> Option<&str> {
        self.inner.refusal.as_deref()
    }

    /// Grade, codes and rule.
    #[getter]
    fn verdict(&self) -> Verdict {
        let of = &self.summary.verdict;
        Verdict {
            grade: of.grade.clone(),
            codes: of.codes.iter().map(ToString::to_string).collect(),
            rule: of.rule.clone(),
            tolerance_m: of.tolerance_m,
            p_beyond_tolerance: of.p_beyond_tolerance,
        }
    }

    /// Radius (k,) that contains the tool's error with 95 % probability at each target of the task, m; NaN at a target
    /// that cannot be judged, empty without a task.
    #[getter]
    fn u95_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let targets = self.inner.u95.target.iter().map(|target| target.u95_m.unwrap_or(f64::NAN));
        PyArray1::from_iter(py, targets)
    }

    /// Largest of them, or over the recorded views without a task; None where it is not known.
    #[getter]
    fn u95_max_m(&self) -> Option<f64> {
        self.inner.u95.max_m
    }

    /// Gain (j,) over that of the datasheet.
    #[getter]
    fn gain<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.arm.sensors().models.iter().map(|model| model.correction.gain))
    }

    /// Gain (j,), rad (m for slides) per count.
    #[getter]
    fn gain_rad_per_count<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.joint.iter().map(|joint| joint.gain_rad_per_count))
    }

    /// Offset (j,) at the middle of each joint's range, rad (m for slides).
    #[getter]
    fn offset_rad<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.joint.iter().map(|joint| joint.offset_rad))
    }

    /// One sigma (j,) of the offset.
    #[getter]
    fn offset_std_rad<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.joint.iter().map(|joint| joint.offset_std_rad))
    }

    /// Names (p,) of the estimated parameters.
    #[getter]
    fn parameters(&self) -> Vec<String> {
        self.inner.covariance.parameters.clone()
    }

    /// Covariance (p, p) of the parameters: gains relative, offsets in rad.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = &self.inner.covariance.rows;
        PyArray1::from_vec(py, rows.concat()).reshape([rows.len(), rows.len()])
    }

    /// Residuals of the fit, tag by tag: view (m,), tag (m,), off_m (m,), used (m,), and off_px (m, 4, 2) of the
    /// corners, seen less predicted, NaN for a corner that was not seen.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let views = &self.inner.details.views;
        let tags: Vec<_> = views.iter().flat_map(|view| view.tags.iter().map(|tag| (view.pose_idx, tag))).collect();
        let corner = |corner: &Option<armcal::calib::CornerResidual>| corner.map_or([f64::NAN; 2], |seen| seen.off_px);
        let off_px = tags.iter().flat_map(|(_, tag)| tag.corners.iter().flat_map(corner));
        let found = PyDict::new(py);
        found.set_item("view", PyArray1::from_iter(py, tags.iter().map(|(view, _)| i64::from(*view))))?;
        found.set_item("tag", PyArray1::from_iter(py, tags.iter().map(|(_, tag)| i64::from(tag.id))))?;
        found.set_item("off_m", PyArray1::from_iter(py, tags.iter().map(|(_, tag)| tag.off_m)))?;
        found.set_item("used", PyArray1::from_iter(py, tags.iter().map(|(_, tag)| tag.is_used)))?;
        found.set_item("off_px", PyArray1::from_iter(py, off_px).reshape([tags.len(), 4, 2])?)?;
        Ok(found)
    }

    /// Figures of the views that were held out, as in summary.json.
    #[getter]
    fn held_out<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        as_python(py, &serde_json::to_string(&self.summary.held_out))
    }

    /// All figures, as summary.json has them.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        as_python(py, &serde_json::to_string(&self.summary))
    }

    /// Joint angles, rad, of raw readings (j,) or (n, j), at an oil temperature and an ambient pressure; those of the
    /// calibration where they are not given.
    #[pyo3(signature = (counts, *, oil_c=None, pressure_pa=None))]
    fn angles<'py>(
        &self,
        counts: &Bound<'py, PyAny>,
        oil_c: Option<f64>,
        pressure_pa: Option<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let shape = [self.robot.n_joints()];
        self.by_reading(counts, (oil_c, pressure_pa), &shape, |counts, at| self.arm.angles(counts, at).to_vec())
    }

    /// Pose of the tool (4, 4) or (n, 4, 4) in the frame of the base, m, by raw readings (j,) or (n, j).
    #[pyo3(signature = (counts, *, oil_c=None, pressure_pa=None))]
    fn tool_pose<'py>(
        &self,
        counts: &Bound<'py, PyAny>,
        oil_c: Option<f64>,
        pressure_pa: Option<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let pose = |counts: &JointCounts, at: &Conditions| by_rows(&self.arm.tool_pose(counts, at).to_homogeneous());
        self.by_reading(counts, (oil_c, pressure_pa), &[4, 4], pose)
    }

    /// Covariance of the tool's position (3, 3) or (n, 3, 3) in the frame of the base, m^2, by raw readings: of the
    /// estimated parameters and of what each sensor leaves. U95 also has links and tool point by their stated sigmas.
    #[pyo3(signature = (counts, *, oil_c=None, pressure_pa=None))]
    fn tool_covariance<'py>(
        &self,
        counts: &Bound<'py, PyAny>,
        oil_c: Option<f64>,
        pressure_pa: Option<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let covariance = |counts: &JointCounts, at: &Conditions| by_rows(&self.arm.tool_covariance_m2(counts, at));
        self.by_reading(counts, (oil_c, pressure_pa), &[3, 3], covariance)
    }

    /// Writes the report, an HTML page that needs no other file.
    fn report(&self, file: PathBuf) -> PyResult<()> {
        let report = Report {
            summary: &self.summary,
            calibration: &self.inner,
            robot: &self.robot,
            online: None,
            about: About::default(),
        };
        write(&file, &html(&report))
    }

    /// Writes calibration.toml, its covariance, summary.json and report.html into a folder; returns the folder, which
    /// is another one next to it where an accepted calibration stays and this one is refused or worse.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> PyResult<PathBuf> {
        let used = armcal::cli::save_results(&folder, &self.robot, (&self.inner, &self.summary));
        let used = used.map_err(|error| of_any(&error))?;
        if used != folder {
            warned(
                py,
                &format!("{} keeps its better calibration; this one is in {}", folder.display(), used.display()),
            )?;
        }
        Ok(used)
    }

    /// Writes another form, by the names of `armcal export --as`: "urdf", "table", "ros2-control", "ros-parameters" and
    /// others; what that form cannot hold is a warning. A refused calibration needs refused=True.
    #[pyo3(signature = (form, file, *, input=None, refused=false))]
    fn export(&self, py: Python<'_>, form: &str, file: PathBuf, input: Option<PathBuf>, refused: bool) -> PyResult<()> {
        if self.inner.status == Status::Refused && !refused {
            let why = self.inner.refusal.as_deref().unwrap_or_default();
            return Err(wrong_value(format!("the calibration is refused: {why}; export it with refused=True")));
        }
        let made = armcal::cli::export_text(&self.inner, &self.robot, form, input.as_deref());
        let (text, left_out) = made.map_err(|error| of_any(&error))?;
        left_out.iter().try_for_each(|sentence| warned(py, sentence))?;
        write(&file, &text)
    }

    fn __repr__(&self) -> String {
        let within = self.inner.u95.max_m.map_or("unknown".to_owned(), |max_m| format!("{max_m:.4}"));
        format!("Calibration({:?}, {}, u95_max_m={within})", self.inner.robot, self.status())
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Calibration", "save it to a folder, and load it there with Calibration.load")
    }
}

/// May the result be used, and by what rule.
#[pyclass(frozen, get_all, module = "armcal")]
pub struct Verdict {
    /// "green", "amber" or "refused".
    grade: String,
    /// Reasons of the grade, the most telling first.
    codes: Vec<String>,
    /// The rule in words.
    rule: String,
    /// Tolerance of the task, m; None without a task.
    tolerance_m: Option<f64>,
    /// Largest probability over the targets that the error exceeds the tolerance.
    p_beyond_tolerance: Option<f64>,
}

#[pymethods]
impl Verdict {
    fn __repr__(&self) -> String {
        format!("Verdict(grade={:?}, codes={:?})", self.grade, self.codes)
    }
}

/// JSON as Python's dictionaries and lists.
pub fn as_python<'py>(py: Python<'py>, json: &Result<String, serde_json::Error>) -> PyResult<Bound<'py, PyAny>> {
    let text = json.as_ref().map_err(|error| wrong_value(format!("no JSON form: {error}")))?;
    py.import("json")?.call_method1("loads", (text,))
}

fn warned(py: Python<'_>, text: &str) -> PyResult<()> {
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)
}

/// Writes a text so that nothing half-written replaces something whole.
fn write(file: &Path, text: &str) -> PyResult<()> {
    armcal::output::write_together(&[(file, text.as_bytes())]).map_err(raised)
}
