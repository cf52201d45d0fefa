//! `Recording` and `Views`: what an arm measured.

use std::path::PathBuf;
use std::sync::Arc;

use armcal::input::RawMeasurement;
use armcal::joints::JointCounts;
use armcal::sensor::ArmSensors;
use armcal::{JointAngles, Measurements, PoseAtRest};
use nalgebra::{Isometry3, Translation3, Vector3};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;

use crate::arrays::{Numbers, indices, numbers};
use crate::errors::{not_pickled, raised, wrong_value};
use crate::interruptible::interruptible;
use crate::robot::{Robot, rigid};

/// A recording of an arm.
#[pyclass(frozen, module = "armcal")]
pub struct Recording {
    files: Vec<PathBuf>,
    measured: Arc<Measurements>,
}

#[pymethods]
impl Recording {
    /// Reads a recording that armcal made, or, by an input map, that of a real arm (MCAP, ROS 2 bag, CSV, YAML).
    #[staticmethod]
    #[pyo3(signature = (file, robot, *, input=None))]
    fn open(py: Python<'_>, file: PathBuf, robot: &Robot, input: Option<PathBuf>) -> PyResult<Self> {
        let (robot, files) = (Arc::clone(&robot.inner), vec![file.clone()]);
        let read = interruptible(py, move || Measurements::read(&[file], &robot, input.as_deref()))?;
        Ok(Self { files, measured: Arc::new(read.map_err(raised)?) })
    }

    /// The views of the arm at rest that it holds.
    fn views(&self) -> Views {
        Views { inner: Arc::clone(&self.measured) }
    }

    fn __repr__(&self) -> String {
        format!("Recording({:?})", self.files[0])
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Recording", "give its file, and open it there")
    }
}

/// An arm at rest, pose by pose, and the tags that its camera saw.
#[pyclass(frozen, module = "armcal")]
pub struct Views {
    pub inner: Arc<Measurements>,
}

/// Arguments that say how tags were measured, one of which must be there.
#[derive(Clone, Copy)]
enum Seen<'a, 'py> {
    Corners(&'a Numbers<'py>),
    Positions(&'a Numbers<'py>),
    Poses(&'a Numbers<'py>),
}

impl Seen<'_, '_> {
    fn at(self, k: usize) -> PyResult<RawMeasurement> {
        Ok(match self {
            Self::Corners(of) => {
                let at = of.as_array();
                RawMeasurement::Corners(std::array::from_fn(|corner| [at[[k, corner, 0]], at[[k, corner, 1]]]))
            }
            Self::Positions(of) => {
                let at = of.as_array();
                RawMeasurement::Position(Vector3::from_fn(|axis, _| at[[k, axis]]))
            }
            Self::Poses(of) => {
                let at = of.as_array();
                let (rotation, position) = rigid(|row, column| at[[k, row, column]], &format!("poses[{k}]"))?;
                RawMeasurement::Pose(Isometry3::from_parts(Translation3::from(position), rotation))
            }
        })
    }
}

const ONE_OF: &str = "give one of corners_px (m, 4, 2), positions_m (m, 3) and poses (m, 4, 4)";

#[pymethods]
impl Views {
    /// Views of arrays: n poses at rest, and m tags seen in them.
    ///
    /// counts (n, j): raw reading of each joint, base first; or angles_rad (n, j): angles by the datasheet, rad.
    /// t_s (n,): times, at least 0.3 s apart; without them poses count as a second apart. oil_c (n,): temperatures of
    /// the oil, which offsets may follow.
    /// view (m,): the pose in which a tag was seen, from 0. tag (m,): its number.
    /// corners_px (m, 4, 2): raw pixels of bottom left, bottom right, top right and top left as printed; or
    /// positions_m (m, 3): the tag in the camera's frame, m; or poses (m, 4, 4): camera_from_tag.
    #[staticmethod]
    #[pyo3(signature = (robot, *, counts=None, angles_rad=None, t_s=None, oil_c=None, view, tag, corners_px=None,
                        positions_m=None, poses=None))]
    fn from_arrays<'py>(
        robot: &Robot,
        counts: Option<&Bound<'py, PyAny>>,
        angles_rad: Option<&Bound<'py, PyAny>>,
        t_s: Option<&Bound<'py, PyAny>>,
        oil_c: Option<&Bound<'py, PyAny>>,
        view: &Bound<'py, PyAny>,
        tag: &Bound<'py, PyAny>,
        corners_px: Option<&Bound<'py, PyAny>>,
        positions_m: Option<&Bound<'py, PyAny>>,
        poses: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let robot = &robot.inner;
        let readings = readings(robot, counts, angles_rad)?;
        let n = readings.len();
        let of_poses = |of: Option<&Bound<'py, PyAny>>, name: &str, what: &str| {
            of.map(|of| numbers(of, name, &[Some(n)], &format!("({n},): {what} each pose"))).transpose()
        };
        let times = of_poses(t_s, "t_s", "a time, s,")?;
        let oil = of_poses(oil_c, "oil_c", "a temperature, deg C,")?;
        let measured = |of: Option<&Bound<'py, PyAny>>, name, shape: &[Option<usize>], meaning| {
            of.map(|of| numbers(of, name, shape, meaning)).transpose()
        };
        let corners =
            measured(corners_px, "corners_px", &[None, Some(4), Some(2)], "(m, 4, 2): four corners a tag, px")?;
        let positions = measured(positions_m, "positions_m", &[None, Some(3)], "(m, 3): a position each tag, m")?;
        let poses = measured(poses, "poses", &[None, Some(4), Some(4)], "(m, 4, 4): camera_from_tag of each tag")?;
        let (seen, m) = match (&corners, &positions, &poses) {
            (Some(of), None, None) => (Seen::Corners(of), of.shape()[0]),
            (None, Some(of), None) => (Seen::Positions(of), of.shape()[0]),
            (None, None, Some(of)) => (Seen::Poses(of), of.shape()[0]),
            _ => return Err(wrong_value(ONE_OF)),
        };
        let view = indices(view, "view", m, &format!("({m},): the pose of each tag, from 0"))?;
        let tag = indices(tag, "tag", m, &format!("({m},): the number of each tag"))?;
        let mut all: Vec<PoseAtRest> = readings
            .into_iter()
            .enumerate()
            .map(|(k, counts)| PoseAtRest {
                t_s: times.as_ref().map(|t| t.as_array()[k]),
                counts,
                oil_c: oil.as_ref().map(|oil| oil.as_array()[k]),
                tags: Vec::new(),
            })
            .collect();
        for (k, (view, tag)) in view.into_iter().zip(tag).enumerate() {
            let Some(pose) = all.get_mut(view) else {
                return Err(wrong_value(format!("view[{k}] is {view}, but there are {n} poses; count them from 0")));
            };
            pose.tags.push((tag as u32, seen.at(k)?));
        }
        let measured = Measurements::at_rest(robot, &all).map_err(raised)?;
        Ok(Self { inner: Arc::new(measured) })
    }

    /// Number of images with tags, or of captured views of a recording that armcal made.
    fn __len__(&self) -> usize {
        self.inner.n_frames()
    }

    fn __repr__(&self) -> String {
        format!("Views({})", self.inner.n_frames())
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Views object", "make it there from its arrays or recording")
    }
}

/// The raw readings, or those that the datasheet has for the angles.
fn readings<'py>(
    robot: &armcal::Robot,
    counts: Option<&Bound<'py, PyAny>>,
    angles_rad: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<JointCounts>> {
    let (n_joints, names) = (robot.n_joints(), robot.joint_names());
    let meaning = format!("(n, {n_joints}): a row each pose, and a column each for the joints {names:?}");
    let read = |of, name| numbers(of, name, &[None, Some(n_joints)], &meaning);
    let is_counts = counts.is_some();
    let values = match (counts, angles_rad) {
        (Some(counts), None) => read(counts, "counts")?,
        (None, Some(angles)) => read(angles, "angles_rad")?,
        _ => return Err(wrong_value(format!("give either counts or angles_rad, {meaning}"))),
    };
    let nominal = ArmSensors::nominal(robot);
    let row = |row: numpy::ndarray::ArrayView1<'_, f64>| {
        let at = |joint: usize| row[joint];
        match is_counts {
            true => JointCounts::from_fn(n_joints, at),
            false => nominal.counts(&JointAngles::from_fn(n_joints, at)),
        }
    };
    Ok(values.as_array().rows().into_iter().map(row).collect())
}
