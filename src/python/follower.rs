//! `Follower`: the calibration that lasts through a dive, message by message.

use std::sync::Arc;

use armcal::calib::online::{Follower as Belief, OnlineEvent, OnlineSettings};
use armcal::input::TagUse;
use armcal::joints::JointCounts;
use armcal::streams::{
    CaptureSet, JointSensorSample, Mark, MarkKind, Message, TagDetection, TagDetections, TemperatureSample, Thermometer,
};
use armcal_core::time::Stamp;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::numbers;
use crate::calibration::{Calibration, as_python};
use crate::errors::{not_pickled, raised, wrong_value};
use crate::robot::{Robot, TagMap, Task};

/// Unix times until the year 2096.
const MAX_TIME_S: f64 = 4e9;

/// Follows the messages of an arm and keeps its sensors' estimate up to date.
#[pyclass(module = "armcal")]
pub struct Follower {
    belief: Belief,
    robot: Arc<armcal::Robot>,
}

#[pymethods]
impl Follower {
    /// Begins at a calibration, or at the datasheet. tags: instead of those of the robot's folder. task: targets that
    /// the tool's error is predicted for.
    #[new]
    #[pyo3(signature = (robot, cal=None, *, tags=None, task=None))]
    fn new(robot: &Robot, cal: Option<&Calibration>, tags: Option<&TagMap>, task: Option<&Task>) -> PyResult<Self> {
        let robot = Arc::clone(&robot.inner);
        let survey = match tags {
            Some(tags) => tags.inner.survey(&tags.file, &robot, TagUse::Corners).map_err(raised)?.survey,
            None => robot.survey(),
        };
        if survey.tags.is_empty() {
            return Err(wrong_value("the robot's folder has no tags; give those around it as tags, a TagMap"));
        }
        let guess = cal.map(|cal| cal.inner.parameters(&robot));
        let surveyed = (*robot).clone().with_survey(survey);
        let mut belief = Belief::new(surveyed, OnlineSettings { guess, ..OnlineSettings::default() });
        if let Some(task) = task {
            belief.set_task(&task.of(&robot)?);
        }
        Ok(Self { belief, robot })
    }

    /// Takes a message in; returns what it made known, as a list of dictionaries.
    ///
    /// One of: {"t_s": .., "counts": (j,)}, {"t_s": .., "tags": {id: (4, 2), ..}} with raw pixels of the corners as in
    /// Views.from_arrays, {"t_s": .., "oil_c": ..}. Times are by one clock, s since any moment, and rise.
    fn push<'py>(&mut self, py: Python<'py>, message: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
        let t_s: f64 = item(message, "t_s")?.extract().map_err(|_| wrong_value("t_s is no number; give seconds"))?;
        if !(0.0..=MAX_TIME_S).contains(&t_s) {
            return Err(wrong_value(format!("t_s is {t_s}; it must be 0 to {MAX_TIME_S:e} s")));
        }
        let stamp = Stamp::default().plus_s(t_s);
        let message = self.message(message, stamp)?;
        let events = self.belief.push(stamp, &message);
        events_in_python(py, &events)
    }

    /// The arm stood still from `start_s` to `end_s`: what was pushed of this span makes a view. Say so after each
    /// pose; rests that nobody marks count after 20 s only, and images of a moving arm by themselves.
    fn rest<'py>(&mut self, py: Python<'py>, start_s: f64, end_s: f64) -> PyResult<Bound<'py, PyAny>> {
        if !((0.0..=MAX_TIME_S).contains(&start_s) && (start_s..=MAX_TIME_S).contains(&end_s)) {
            return Err(wrong_value(format!("the rest is from {start_s} to {end_s} s; give times of pushed messages")));
        }
        let [start, end] = [start_s, end_s].map(|t_s| Stamp::default().plus_s(t_s));
        let kind = MarkKind::Capture { set: CaptureSet::Fit, pose_idx: self.belief.estimator().n_views() as u32 };
        let events = self.belief.push(end, &Message::Mark(Mark { start, end, kind }));
        events_in_python(py, &events)
    }

    /// After the last message.
    fn finish<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let events = self.belief.finish();
        events_in_python(py, &events)
    }

    /// Views taken in so far.
    #[getter]
    fn n_views(&self) -> usize {
        self.belief.estimator().n_views()
    }

    /// Belief of now, as a line of belief.jsonl; None before the first view.
    #[getter]
    fn belief<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.belief.belief().map(|row| as_python(py, &serde_json::to_string(&row))).transpose()
    }

    /// Joint angles (j,) of a raw reading (j,) as believed now, rad.
    fn angles<'py>(&self, counts: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let angles = self.belief.sensors().angles_under(&self.counts(counts)?, self.belief.conditions());
        Ok(PyArray1::from_slice(counts.py(), &angles))
    }

    /// Radius that contains the tool's error with 95 % probability at a raw reading (j,), now, m; None before the first
    /// view.
    fn u95_m(&self, counts: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
        let angles = self.belief.sensors().angles_under(&self.counts(counts)?, self.belief.conditions());
        Ok(self.belief.u95_at_m(&angles))
    }

    fn __reduce__(&self) -> PyResult<()> {
        not_pickled("Follower", "push the messages to one that is made there")
    }
}

impl Follower {
    fn counts(&self, counts: &Bound<'_, PyAny>) -> PyResult<JointCounts> {
        let n = self.robot.n_joints();
        let meaning = format!("({n},): a reading each for the joints {:?}", self.robot.joint_names());
        let read = numbers(counts, "counts", &[Some(n)], &meaning)?;
        if read.as_array().iter().any(|count| !count.is_finite()) {
            return Err(wrong_value("counts has values that are not finite; leave such readings out"));
        }
        Ok(JointCounts::from_fn(n, |joint| read.as_array()[joint]))
    }

    fn message(&self, message: &Bound<'_, PyDict>, stamp: Stamp) -> PyResult<Message> {
        if let Some(counts) = message.get_item("counts")? {
            return Ok(Message::JointSensors(JointSensorSample { stamp, counts: self.counts(&counts)? }));
        }
        if let Some(oil_c) = message.get_item("oil_c")? {
            let temperature_c: f64 = oil_c.extract().map_err(|_| wrong_value("oil_c is no number; give deg C"))?;
            let thermometer = Thermometer::Oil;
            return Ok(Message::Temperature(TemperatureSample { stamp, thermometer, temperature_c, variance_c2: 0.0 }));
        }
        let tags = item(message, "tags")?;
        let tags =
            tags.cast::<PyDict>().map_err(|_| wrong_value("tags is no dictionary; give {id: corners (4, 2)}"))?;
        let detection = |(id, corners): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let id: u32 = id.extract().map_err(|_| wrong_value("a tag's number must be a whole number from 0 on"))?;
            let corners = numbers(&corners, "corners of a tag", &[Some(4), Some(2)], "(4, 2): four corners, px")?;
            let at = corners.as_array();
            if at.iter().any(|px| !px.is_finite()) {
                return Err(wrong_value(format!("tag {id} has corners that are not finite; leave such tags out")));
            }
            Ok(TagDetection {
                id,
                corners_px: std::array::from_fn(|corner| [at[[corner, 0]], at[[corner, 1]]]),
                decision_margin: 0.0,
            })
        };
        let tags = tags.iter().map(detection).collect::<PyResult<_>>()?;
        Ok(Message::Detections(TagDetections { stamp, tags }))
    }
}

fn item<'py>(message: &Bound<'py, PyDict>, key: &str) -> PyResult<Bound<'py, PyAny>> {
    let missing = || wrong_value(format!("the message has no {key}; it needs t_s and one of counts, tags and oil_c"));
    message.get_item(key)?.ok_or_else(missing)
}

fn events_in_python<'py>(py: Python<'py>, events: &[OnlineEvent]) -> PyResult<Bound<'py, PyAny>> {
    as_python(py, &serde_json::to_string(events))
}
