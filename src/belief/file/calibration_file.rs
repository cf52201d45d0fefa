//! calibration.toml as a file: written, read, checked, and converted to sensors.

use crate::file::constants::calibration_file::{LEAST_SLOPE, SAME};
use armcal_core::codes::Code;
use armcal_core::schema::first_line;
use std::path::Path;

use crate::file::calibration::{Calibration, JointResult, Status};
use crate::file::camera_mount::{CameraMount, FurtherCamera};
use crate::file::covariance_file::CovarianceTable;
use crate::file::file_error::CalibrationFileError;
use crate::file::link_table::LinkResult;
use crate::file::slide_keys::{SLIDE_HEAD, in_metres, named_as_angles};
use crate::file::terms_table::TermsTable;
use crate::model::parameters::{JointParameters, Parameter};
use crate::say;
use crate::say::finding::FindingKind;
use crate::solve::covariance::ParameterCovariance;
use crate::views::view::View;
use armcal_core::document::parse_file;
use armcal_core::joints::JointAngles;
use armcal_core::kind::Kind;
use armcal_core::kinematics::LinkCorrections;
use armcal_core::robot::{FileIssue, JointSensorSpec, Robot, RobotError, from_table, read_text, syntax_code};
use armcal_core::sensor::{ArmSensors, Correction};

/// Texts of a calibration's two files, to be written together because each holds the other's hash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CalibrationFiles {
    /// Text of calibration.toml.
    pub calibration: String,
    /// Text of the covariance file, for [`covariance_file`](crate::file::covariance_file).
    pub covariance: String,
}

impl JointResult {
    /// Returns the ratio of the gain's reference scale to the counts per radian of `spec`, if the scale was measured.
    fn ratio_to(&self, spec: &JointSensorSpec) -> Option<f64> {
        let gain = self.gain_over_datasheet? * self.identified_ratio?;
        let ratio = gain / self.gain_rad_per_count / spec.counts_per_rad;
        Some(ratio).filter(|ratio| (ratio - 1.0).abs() > SAME)
    }
}

const TERMS_HEAD: &str = "\
# With [joint.terms], in rad, the angle has beyond that
#   sum_h nonlinearity_rad[h] phi_h(x) + offset_rad_per_k T + gain_per_k T travel / (counts per rad)
#   + offset_rad_per_mpa P + drift_rad_per_h t + half_backlash_rad a
# with phi_h(x) = sin(pi h (x + L) / 2 L) / sqrt(L), h = 1, 2, .., L = 1.25, x = travel / (counts per rad) /
# half_range_rad held to -1 .. 1; T K, P MPa and t hours from [reference], a = -1 or 1 the way that the joint moved
# last (0: not known).
";

impl Calibration {
    /// Returns the sensors of `robot` under this calibration. `robot` may have a measured scale, so that its datasheet
    /// is not compared: see [`check_robot`](Self::check_robot).
    ///
    /// # Errors
    /// [`CalibrationFileError::OtherRobot`] if the calibration was made for another arm.
    pub fn sensors(&self, robot: &Robot) -> Result<ArmSensors, CalibrationFileError> {
        self.check_joints(Path::new("calibration.toml"), robot)?;
        let mut sensors = ArmSensors::nominal(robot);
        sensors.reference = self.reference.map(|table| table.conditions()).unwrap_or_default();
        for (model, joint) in sensors.models.iter_mut().zip(&self.joint) {
            if let Some(table) = &joint.terms {
                model.spec.half_range_rad = table.half_range_rad;
                if let Some(ratio) = joint.ratio_to(&model.spec) {
                    model.spec = model.spec.with_scale(ratio);
                }
            }
            let gain = joint.gain_rad_per_count * model.spec.counts_per_rad;
            let terms = joint.terms.as_ref().map(TermsTable::terms).unwrap_or_default();
            model.correction = Correction { gain, offset_rad: joint.offset_rad, terms };
            let (least, most) = model.slope_over_gain();
            if !(LEAST_SLOPE..=2.0 - LEAST_SLOPE).contains(&least) || most > 2.0 - LEAST_SLOPE {
                let (file, joint) = ("calibration.toml".to_owned(), joint.name.clone());
                return Err(CalibrationFileError::Bent { file, joint, least, most });
            }
        }
        Ok(sensors)
    }

    /// Returns `robot` with measured sensor scales, which the covariance's gains refer to. Its sensors have the
    /// nonlinearity that the residuals show, and its links are as calibrated.
    #[must_use]
    pub fn scaled_robot(&self, robot: &Robot) -> Robot {
        let mut scaled = robot.clone().with_linearity(self.fit.linearity_scale);
        for (spec, joint) in scaled.sensors.iter_mut().zip(&self.joint) {
            if let Some(ratio) = joint.identified_ratio {
                *spec = spec.with_scale(ratio);
            }
        }
        self.parameters(robot).with_links(scaled)
    }

    /// Returns the parameters relative to the sensors of `robot`, whose joints must be this calibration's.
    #[must_use]
    pub fn parameters(&self, robot: &Robot) -> JointParameters {
        let mut parameters = JointParameters::default();
        for (joint, (result, spec)) in self.joint.iter().zip(&robot.sensors).enumerate() {
            parameters.gain[joint] = result.gain_rad_per_count * spec.counts_per_rad;
            parameters.offset_rad[joint] = result.offset_rad;
            parameters.terms[joint] = result.terms.as_ref().map(TermsTable::terms).unwrap_or_default();
        }
        parameters.reference = self.reference.map(|table| table.conditions()).unwrap_or_default();
        parameters.links = self.link_corrections();
        parameters
    }

    /// Returns the corrections of the joints' poses on their parent links and of the arm's compliance; zero where not
    /// estimated.
    #[must_use]
    pub fn link_corrections(&self) -> LinkCorrections {
        let mut corrections = LinkCorrections::default();
        for (joint, correction) in self.joint.iter().zip(&mut corrections.places) {
            let link = self.link.iter().find(|link| link.joint == joint.name);
            *correction = link.map(LinkResult::correction).unwrap_or_default();
        }
        let names = self.joint.iter().map(|joint| joint.name.as_str());
        corrections.sag = self.sag.as_ref().map(|sag| sag.sag(names)).unwrap_or_default();
        corrections
    }

    /// Returns the correction of a joint's angle before its sensor slipped, at a time since the first view, rad.
    #[must_use]
    pub fn slipped_rad(&self, joint: &str, since_first_view_s: f64) -> f64 {
        let slips = self.findings.iter().filter(|found| found.kind == FindingKind::SensorSlip && found.name == joint);
        let later = slips.filter(|slip| slip.time_s.is_some_and(|time_s| since_first_view_s < time_s));
        later.filter_map(|slip| slip.size).sum()
    }

    /// Returns the joint angles of each view under this calibration, slips included, rad. `views` have the travels by
    /// the datasheet.
    ///
    /// # Errors
    /// [`CalibrationFileError::OtherRobot`] if the calibration was made for another arm.
    pub fn view_angles(&self, robot: &Robot, views: &[View]) -> Result<Vec<JointAngles>, CalibrationFileError> {
        let (nominal, sensors, names) = (ArmSensors::nominal(robot), self.sensors(robot)?, robot.joint_names());
        let first = views.iter().map(|view| view.end).min();
        let angles_of = |view: &View| {
            let read = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
            let counts = nominal.counts(&JointAngles::from_fn(robot.n_joints(), read));
            let angles = sensors.angles_under(&counts, &view.conditions);
            let time_s = first.map_or(0.0, |first| view.end.since_s(first));
            let slipped_rad = |joint: usize| self.slipped_rad(&names[joint], time_s);
            JointAngles::from_fn(robot.n_joints(), |joint| angles[joint] + slipped_rad(joint))
        };
        Ok(views.iter().map(angles_of).collect())
    }

    /// Returns `robot` with links, camera mounts and lenses as calibrated; sensors and tags stay.
    #[must_use]
    pub fn applied_to(&self, robot: &Robot) -> Robot {
        let mut robot = robot.clone();
        robot.chain = robot.chain.corrected(&self.link_corrections());
        let mount = self.camera_mount.as_ref().filter(|mount| mount.left_out.is_none());
        if let Some(link_from_camera) = mount.and_then(CameraMount::link_from_camera) {
            robot.camera.mount.link_from_frame = link_from_camera;
        }
        for camera in &mut robot.further_cameras {
            let found = self.further_camera.iter().find(|found| found.name == camera.name);
            if let Some(link_from_camera) = found.and_then(FurtherCamera::link_from_camera) {
                camera.mount.link_from_frame = link_from_camera;
            }
        }
        self.with_lenses(&robot)
    }

    /// Returns `robot` with its lenses and their standard deviations as calibrated.
    #[must_use]
    pub fn with_lenses(&self, robot: &Robot) -> Robot {
        let mut robot = robot.clone();
        for found in &self.lens {
            let mut further = robot.further_cameras.iter_mut();
            let camera = match &found.camera {
                None => Some(&mut robot.camera),
                Some(name) => further.find(|camera| camera.name == *name),
            };
            if let Some(camera) = camera.filter(|camera| camera.lens.is_known()) {
                found.apply(camera);
            }
        }
        robot
    }

    /// Returns the covariance of the estimated parameters of `robot`'s joints; rows of other joints are omitted.
    #[must_use]
    pub fn parameter_covariance(&self, robot: &Robot) -> ParameterCovariance {
        let all = Parameter::all(robot.n_joints());
        let rows: Vec<(usize, Parameter)> =
            all.filter_map(|p| Some((self.covariance.row(&p.name(robot))?, p))).collect();
        let at = |row: usize, column: usize| self.covariance.rows[row].get(column).copied().unwrap_or(f64::NAN);
        let is_known = self.joint.iter().any(|joint| joint.residual_std_rad.is_some());
        let residual_std_rad = |j: usize| {
            let (result, spec) = (self.joint.get(j), robot.sensors.get(j));
            result.and_then(|result| result.residual_std_rad).or(spec.map(|spec| spec.linearity_std_rad)).unwrap_or(0.0)
        };
        ParameterCovariance {
            residual_std_rad: is_known.then(|| std::array::from_fn(residual_std_rad)),
            parameters: rows.iter().map(|(_, p)| *p).collect(),
            matrix: nalgebra::DMatrix::from_fn(rows.len(), rows.len(), |i, j| at(rows[i].0, rows[j].0)),
        }
    }

    /// Returns the texts of calibration.toml and of its covariance file.
    #[must_use]
    pub fn to_files(&self) -> CalibrationFiles {
        let calibration = self.to_toml();
        let covariance = self.covariance.to_file(&calibration);
        CalibrationFiles { calibration, covariance }
    }

    /// Returns the text of calibration.toml, without the covariance but with its hash.
    ///
    /// # Panics
    /// Never: every value here has a TOML form.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let head = "# Joint sensors as calibrated. angle = center_rad + offset_rad + gain_rad_per_count * travel,\n\
                    # travel = reading - the datasheet's reading at center_rad, in counts, wrapped to half a word.\n";
        let more = if self.reference.is_some() { TERMS_HEAD } else { "" };
        let hashed = Self { covariance_hash: self.hash_of_covariance(), ..self.clone() };
        let body = toml::to_string(&hashed).expect("plain tables and finite numbers have a TOML form");
        let slides = if self.has_slide() { SLIDE_HEAD } else { "" };
        format!("{}{head}{more}{slides}{}", first_line(Kind::Calibration), in_metres(&body))
    }

    /// Returns the hash of the covariance, or the hash that the file states if its covariance was not read.
    fn hash_of_covariance(&self) -> Option<String> {
        let not_read = self.covariance.parameters.is_empty() && self.covariance_hash.is_some();
        if not_read { self.covariance_hash.clone() } else { Some(self.covariance.hash()) }
    }

    /// Reads a calibration file and the covariance file next to it.
    ///
    /// # Errors
    /// [`CalibrationFileError`] naming file, key and allowed range; also for a covariance that is missing or belongs to
    /// another calibration.
    pub fn read(file: &Path) -> Result<Self, CalibrationFileError> {
        let text = read_text(file)?;
        let mut calibration = Self::parse(file, &text)?;
        if let Some(hash) = &calibration.covariance_hash {
            calibration.covariance = CovarianceTable::read_beside(file, &text, hash)?;
        }
        Ok(calibration)
    }

    /// Reads only the text of a calibration file, for uses that need no covariance. The covariance of the result is
    /// empty, unless an older file contains it. `file` is for messages.
    ///
    /// # Errors
    /// [`CalibrationFileError`] naming file, key and allowed range.
    pub fn parse(file: &Path, text: &str) -> Result<Self, CalibrationFileError> {
        let calibration: Self = if text.contains("prismatic") {
            let table = named_as_angles(file, parse_file(Kind::Calibration, file, text)?).map_err(RobotError::from)?;
            from_table(&table).map_err(|message| RobotError::Syntax {
                code: syntax_code(&message),
                file: file.to_owned(),
                message,
            })?
        } else {
            parse_file(Kind::Calibration, file, text)?
        };
        calibration.check(file).map_err(RobotError::from)?;
        Ok(calibration)
    }

    fn check(&self, file: &Path) -> Result<(), FileIssue> {
        self.check_status(file)?;
        self.check_joint_tables(file)?;
        self.camera_mount.as_ref().map_or(Ok(()), |mount| mount.check(file))?;
        self.further_camera.iter().try_for_each(|camera| camera.check(file))?;
        for joint in &self.joint {
            let Some(terms) = &joint.terms else { continue };
            terms.check(file, &joint.name)?;
            if self.reference.is_none() {
                let problem = format!("is missing; the terms of joint `{}` are counted from it", joint.name);
                return Err(FileIssue::new(Code::KeyMissing, file, "reference", problem));
            }
        }
        self.reference.map_or(Ok(()), |reference| reference.check(file))?;
        self.sag.as_ref().map_or(Ok(()), |sag| sag.check(file))?;
        self.lens.iter().try_for_each(|lens| lens.check(file))?;
        let n = self.covariance.parameters.len();
        if self.covariance.rows.len() != n || self.covariance.rows.iter().any(|row| row.len() != n) {
            return Err(FileIssue::new(
                Code::ValueCount,
                file,
                "covariance.rows",
                format!("needs {n} rows of {n} numbers"),
            ));
        }
        Ok(())
    }

    /// A result that was refused must not be called accepted.
    fn check_status(&self, file: &Path) -> Result<(), FileIssue> {
        let is_contradicted = self.refusal.is_some() || !self.refusals.is_empty();
        if self.status == Status::Accepted && is_contradicted {
            let problem = say::accepted_and_refused(self.refusal.as_deref());
            return Err(FileIssue::new(Code::KeysConflict, file, "status", problem));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
