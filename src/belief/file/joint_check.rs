//! Refusals of a joint's table in calibration.toml that no calibration writes.

use std::collections::BTreeSet;
use std::path::Path;

use armcal_core::codes::Code;
use armcal_core::robot::FileIssue;

use crate::file::calibration::{Calibration, JointResult, Status};
use crate::file::constants::joint_check::{LARGEST_RATIO, LARGEST_SCALE, SAME_GAIN};

impl Calibration {
    /// Refuses joints with values that are out of range or contradict each other, and a joint that stands twice.
    pub(crate) fn check_joint_tables(&self, file: &Path) -> Result<(), FileIssue> {
        let mut names = BTreeSet::new();
        for joint in &self.joint {
            if !names.insert(joint.name.as_str()) {
                let key = format!("joint `{}`: name", joint.name);
                let problem = "stands twice; each joint has one table, so the file was edited: calibrate again";
                return Err(FileIssue::new(Code::ValueDuplicate, file, key, problem));
            }
            if self.status == Status::Accepted {
                joint.check_values(file)?;
                joint.check_covered(file)?;
            }
            joint.check_gain(file)?;
            joint.check_deviations(file, self.status)?;
        }
        Ok(())
    }
}

impl JointResult {
    fn key(&self, key: &str) -> String {
        format!("joint `{}`: {key}", self.name)
    }

    fn check_values(&self, file: &Path) -> Result<(), FileIssue> {
        let check = |key: &str, value: f64, range| FileIssue::check_range(file, &self.key(key), value, range);
        check("gain_rad_per_count (size)", self.gain_rad_per_count.abs(), 1e-12..=1e3)?;
        check("offset_rad", self.offset_rad, -10.0..=10.0)?;
        check("center_rad", self.center_rad, -1e6..=1e6)?;
        for (key, value, largest) in [
            ("residual_std_rad", self.residual_std_rad, 10.0),
            ("gain_over_datasheet (size)", self.gain_over_datasheet.map(f64::abs), LARGEST_RATIO),
            ("identified_ratio (size)", self.identified_ratio.map(f64::abs), LARGEST_RATIO),
            ("counts_per_rad (size)", self.counts_per_rad.map(f64::abs), LARGEST_SCALE),
            ("offset_counts (size)", self.offset_counts.map(f64::abs), LARGEST_SCALE),
        ] {
            value.map_or(Ok(0.0), |value| check(key, value, 0.0..=largest))?;
        }
        Ok(())
    }

    /// The gain is stated twice: in rad per count, and over the datasheet's scale, which newer files have.
    fn check_gain(&self, file: &Path) -> Result<(), FileIssue> {
        let Some((scale, ratio)) = self.counts_per_rad.zip(self.gain_over_datasheet) else { return Ok(()) };
        let expected = ratio / scale;
        if (self.gain_rad_per_count / expected - 1.0).abs() <= SAME_GAIN {
            return Ok(());
        }
        let problem = format!(
            "{} is not {expected}, which gain_over_datasheet / counts_per_rad gives: it was edited; calibrate again",
            self.gain_rad_per_count
        );
        Err(FileIssue::new(Code::KeysConflict, file, self.key("gain_rad_per_count"), problem))
    }

    /// A range descends only where the counts run the other way than the datasheet says.
    fn check_covered(&self, file: &Path) -> Result<(), FileIssue> {
        let [from, to] = self.covered_rad;
        let gain = self.gain_over_datasheet.map(|gain| gain * self.identified_ratio.unwrap_or(1.0));
        if gain.is_some_and(|gain| (to - from) * gain < 0.0) {
            let problem = format!("{from} .. {to} is reversed: it was edited; calibrate again");
            return Err(FileIssue::new(Code::ValueInvalid, file, self.key("covered_rad"), problem));
        }
        Ok(())
    }

    /// A deviation is never negative, and that of an accepted estimate is never zero.
    fn check_deviations(&self, file: &Path, status: Status) -> Result<(), FileIssue> {
        for (key, std, is_estimated) in [
            ("gain_std_rad_per_count", self.gain_std_rad_per_count, self.gain_estimated),
            ("offset_std_rad", self.offset_std_rad, self.offset_estimated),
        ] {
            if std < 0.0 {
                FileIssue::check_range(file, &self.key(key), std, 0.0..=1e3)?;
            }
            if std == 0.0 && is_estimated && status == Status::Accepted {
                let problem = "is 0, and must be above 0, because no estimate is exact: it was edited; calibrate again";
                return Err(FileIssue::new(Code::ValueOutOfRange, file, self.key(key), problem));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::camera_mount::CameraMount;
    use crate::fixture::{sample, titan};
    use armcal_core::codes::Coded;

    /// The sample as a newer file: with the datasheet's values and a mount.
    fn good() -> Calibration {
        let mut good = sample();
        for (joint, spec) in good.joint.iter_mut().zip(&titan().sensors) {
            (joint.offset_counts, joint.counts_per_rad) = (Some(spec.offset_counts), Some(spec.counts_per_rad));
        }
        good.camera_mount = CameraMount::of(&titan(), &Err("no view of the tag".to_owned()));
        good
    }

    fn code_after(change: impl Fn(&mut Calibration)) -> Option<(Code, String)> {
        let mut changed = good();
        change(&mut changed);
        let error = Calibration::parse(Path::new("calibration.toml"), &changed.to_toml()).err()?;
        Some((error.code(), error.to_string()))
    }

    #[test]
    fn edits_that_no_calibration_writes_are_refused_by_key() {
        assert_eq!(code_after(|_| ()), None);
        type Change = fn(&mut Calibration);
        let changes: [(&str, Code, Change); 10] = [
            ("gain_rad_per_count", Code::KeysConflict, |c| c.joint[1].gain_rad_per_count *= -1.0),
            ("gain_rad_per_count", Code::KeysConflict, |c| c.joint[1].gain_rad_per_count *= 100.0),
            ("name", Code::ValueDuplicate, |c| c.joint[0].name = c.joint[1].name.clone()),
            ("covered_rad", Code::ValueInvalid, |c| c.joint[1].covered_rad.reverse()),
            ("offset_std_rad", Code::ValueOutOfRange, |c| c.joint[1].offset_std_rad = -0.001),
            ("offset_std_rad", Code::ValueOutOfRange, |c| c.joint[1].offset_std_rad = 0.0),
            ("gain_std_rad_per_count", Code::ValueOutOfRange, |c| c.joint[1].gain_std_rad_per_count = 0.0),
            ("gain_over_datasheet", Code::ValueOutOfRange, |c| c.joint[1].gain_over_datasheet = Some(f64::NAN)),
            ("quaternion_wxyz", Code::ValueOutOfRange, |c| {
                c.camera_mount.as_mut().expect("a mount").quaternion_wxyz = [1.0, 0.6, 0.4, -0.6];
            }),
            ("position_std_m", Code::ValueOutOfRange, |c| {
                c.camera_mount.as_mut().expect("a mount").position_std_m[1] = -0.001;
            }),
        ];
        for (key, code, change) in changes {
            let (found, told) = code_after(change).expect(key);
            assert_eq!(found, code, "{key}: {told}");
            assert!(told.contains(key), "{told}");
        }
    }

    /// A range descends where the counts run the other way, and a held parameter has no deviation.
    #[test]
    fn what_a_calibration_may_write_reads() {
        let turned = code_after(|c| {
            let joint = &mut c.joint[1];
            joint.gain_rad_per_count *= -1.0;
            joint.gain_over_datasheet = joint.gain_over_datasheet.map(|gain| -gain);
            joint.covered_rad.reverse();
        });
        assert_eq!(turned, None);
        let held = code_after(|c| (c.joint[1].offset_std_rad, c.joint[1].offset_estimated) = (0.0, false));
        assert_eq!(held, None);
    }
}
