//! `Robot`, `TagMap` and `Task`: what is known before anything is measured.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use armcal::calib::Calibration;
use armcal::input::{TaskFile, read_task};
use armcal::joints::JointAngles;
use armcal::streams::ReachTask;
use armcal::tagmap::files::{Landmark, LandmarkFile, read_landmarks};
use armcal_core::time::Stamp;
use nalgebra::{Matrix3, Rotation3, SMatrix, UnitQuaternion};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{indices, numbers};
use crate::errors::{not_pickled, raised, wrong_value};

/// An arm by its folder: robot.toml and the URDF.
#[pyclass(frozen, module = "armcal")]
pub struct Robot {
    pub inner: Arc<armcal::Robot>,
}

#[pymethods]
impl Robot {
    /// Reads a robot's folder, or one that comes with armcal by its name, such as "titan4".
    #[staticmethod]
    fn load(folder: PathBuf) -> PyResult<Self> {
        let folder = armcal::front::robot_folder(&folder);
        Ok(Self { inner: Arc::new(armcal::load_robot(&folder).map_err(raised)?) })
    }

    /// Name of the arm.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// Folder that it was read from.
    #[getter]
    fn folder(&self) -> &Path {
        &self.inner.folder
    }

    /// Names of the joints, base first.
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.inner.joint_names()
    }

    /// Pose of the tool (4, 4) in the frame of the base, m, at joint angles (j,), rad, by the URDF.
    fn tool_pose<'py>(&self, angles_rad: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let n = self.inner.n_joints();
        let meaning = format!("({n},): an angle each for the joints {:?}, rad", self.inner.joint_names());
        let angles = numbers(angles_rad, "angles_rad", &[Some(n)], &meaning)?;
        let angles = JointAngles::from_fn(n, |joint| angles.as_array()[joint]);
        let pose = self.inner.chain.frame(&angles, &self.inner.tool.mount).to_homogeneous();
        PyArray1::from_vec(angles_rad.py(), by_rows(&pose)).reshape([4, 4])
    }

    fn __repr__(&self) -> String {
        format!("Robot({:?}, joints={:?})", self.inner.name, self.inner.joint_names())
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Robot", "give its folder, and load it there with Robot.load")
    }
}

/// The numbers of a matrix row by row, as numpy has them.
pub fn by_rows<const N: usize>(matrix: &SMatrix<f64, N, N>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

/// Tags or landmarks around an arm, with their poses.
#[pyclass(frozen, module = "armcal")]
pub struct TagMap {
    pub file: PathBuf,
    pub inner: LandmarkFile,
}

#[pymethods]
impl TagMap {
    /// Reads a tag map (.toml), a tagslam.yaml or a Kalibr target (.yaml).
    #[staticmethod]
    fn load(file: PathBuf) -> PyResult<Self> {
        let inner = read_landmarks(&file).map_err(raised)?;
        Ok(Self { file, inner })
    }

    /// Tags by their poses (m, 4, 4) in `frame`, a link of the URDF, with one sigma of position and rotation.
    ///
    /// In a tag's frame x points right and y up as it is printed, z out of it.
    #[staticmethod]
    #[pyo3(signature = (frame, ids, poses, *, size_m, position_std_m, rotation_std_rad))]
    fn from_poses(
        frame: String,
        ids: &Bound<'_, PyAny>,
        poses: &Bound<'_, PyAny>,
        size_m: f64,
        position_std_m: f64,
        rotation_std_rad: f64,
    ) -> PyResult<Self> {
        let poses = numbers(poses, "poses", &[None, Some(4), Some(4)], "(m, 4, 4): the pose of each tag")?;
        let n = poses.shape()[0];
        let ids = indices(ids, "ids", n, "(m,): the number of each tag")?;
        for (name, value, most) in [
            ("size_m", size_m, 10.0),
            ("position_std_m", position_std_m, 1.0),
            ("rotation_std_rad", rotation_std_rad, 1.0),
        ] {
            if !(value > 0.0 && value <= most) {
                return Err(wrong_value(format!("{name} is {value}; it must be above 0 and at most {most}")));
            }
        }
        let landmark = |k: usize| -> PyResult<Landmark> {
            let (rotation, position_m) =
                rigid(|row, column| poses.as_array()[[k, row, column]], &format!("poses[{k}]"))?;
            Ok(Landmark {
                id: ids[k] as u32,
                name: None,
                size_m: Some(size_m),
                position_m: Some(position_m),
                quaternion_wxyz: Some([rotation.w, rotation.i, rotation.j, rotation.k]),
                position_std_m,
                rotation_std_rad,
                board: None,
            })
        };
        let landmarks = (0..n).map(landmark).collect::<PyResult<Vec<_>>>()?;
        let mut seen = ids.clone();
        seen.sort_unstable();
        if let Some(pair) = seen.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(wrong_value(format!("ids has {} twice; give each tag once", pair[0])));
        }
        Ok(Self {
            file: PathBuf::from("tag map in memory"),
            inner: LandmarkFile { frame, base_tag: None, anchor_tag: None, landmarks },
        })
    }

    /// Frame of the poses.
    #[getter]
    fn frame(&self) -> &str {
        &self.inner.frame
    }

    /// Numbers of the tags.
    #[getter]
    fn ids(&self) -> Vec<u32> {
        self.inner.landmarks.iter().map(|landmark| landmark.id).collect()
    }

    fn __len__(&self) -> usize {
        self.inner.landmarks.len()
    }

    fn __repr__(&self) -> String {
        format!("TagMap(frame={:?}, {} tags)", self.inner.frame, self.inner.landmarks.len())
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("TagMap", "make it there from its file or arrays")
    }
}

/// Rotation and position of a homogeneous matrix.
pub fn rigid(at: impl Fn(usize, usize) -> f64, name: &str) -> PyResult<(UnitQuaternion<f64>, [f64; 3])> {
    let turn = Matrix3::from_fn(&at);
    let last = [at(3, 0), at(3, 1), at(3, 2), at(3, 3) - 1.0];
    let is_turn = (turn * turn.transpose() - Matrix3::identity()).amax() < 1e-3 && turn.determinant() > 0.0;
    if !is_turn || last.iter().any(|value| value.abs() > 1e-6) {
        return Err(wrong_value(format!(
            "{name} is no rigid pose; give a rotation and a position above the row [0, 0, 0, 1], m"
        )));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&turn));
    Ok((rotation, [at(0, 3), at(1, 3), at(2, 3)]))
}

/// Task that the arm is calibrated for: targets and a tolerance.
#[pyclass(frozen, module = "armcal")]
pub struct Task {
    pub file: PathBuf,
    pub inner: TaskFile,
}

#[pymethods]
impl Task {
    /// Tool positions (k, 3) in the base frame, m, or joint angles (k, j) at which the tool shall be, rad, or both.
    #[new]
    #[pyo3(signature = (targets_m=None, tolerance_m=None, *, poses_rad=None))]
    fn new(
        targets_m: Option<&Bound<'_, PyAny>>,
        tolerance_m: Option<f64>,
        poses_rad: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let Some(tolerance_m) = tolerance_m else {
            return Err(wrong_value("tolerance_m is missing; give the largest error that counts as a hit, m"));
        };
        if !(1e-6..=10.0).contains(&tolerance_m) {
            return Err(wrong_value(format!("tolerance_m is {tolerance_m}; it must be 1e-6 to 10 m")));
        }
        let targets = targets_m
            .map(|targets| numbers(targets, "targets_m", &[None, Some(3)], "(k, 3): a tool position a row, m"))
            .transpose()?;
        let poses = poses_rad
            .map(|poses| numbers(poses, "poses_rad", &[None, None], "(k, j): the joint angles of a pose a row, rad"))
            .transpose()?;
        let targets_m: Vec<[f64; 3]> = targets
            .iter()
            .flat_map(|all| all.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect::<Vec<_>>())
            .collect();
        let poses_rad: Vec<Vec<f64>> = poses
            .iter()
            .flat_map(|all| all.as_array().rows().into_iter().map(|row| row.to_vec()).collect::<Vec<_>>())
            .collect();
        if targets_m.is_empty() && poses_rad.is_empty() {
            return Err(wrong_value("there are no targets; give targets_m (k, 3), poses_rad (k, j) or both"));
        }
        if !targets_m.as_flattened().iter().chain(poses_rad.iter().flatten()).all(|value| value.abs() <= 100.0) {
            return Err(wrong_value("a target is not within 100 m or 100 rad; give metres and radians"));
        }
        Ok(Self { file: PathBuf::from("task in memory"), inner: TaskFile { tolerance_m, targets_m, poses_rad } })
    }

    /// Reads a task file (.toml).
    #[staticmethod]
    fn load(file: PathBuf) -> PyResult<Self> {
        let inner = read_task(&file).map_err(raised)?;
        Ok(Self { file, inner })
    }

    /// Largest error that counts as a hit, m.
    #[getter]
    fn tolerance_m(&self) -> f64 {
        self.inner.tolerance_m
    }

    /// Number of targets.
    fn __len__(&self) -> usize {
        self.inner.targets_m.len() + self.inner.poses_rad.len()
    }

    fn __repr__(&self) -> String {
        format!("Task({} targets, tolerance_m={})", self.__len__(), self.inner.tolerance_m)
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Task", "make it there from its arrays")
    }
}

impl Task {
    /// The task of this robot.
    pub fn of(&self, robot: &armcal::Robot) -> PyResult<ReachTask> {
        self.inner.check_poses(&self.file, robot).map_err(raised)?;
        let task = self.inner.for_robot(&self.file, robot).map_err(raised)?;
        Ok(ReachTask { stamp: Stamp::default(), ..task })
    }
}

/// A prior must be of this arm, and accepted.
pub fn check_prior(prior: &Calibration) -> PyResult<()> {
    if prior.status == armcal::Status::Refused {
        let why = prior.refusal.as_deref().unwrap_or_default();
        return Err(wrong_value(format!("prior was refused itself ({why}); give an accepted calibration")));
    }
    Ok(())
}
