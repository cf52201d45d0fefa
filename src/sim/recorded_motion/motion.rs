//! A recorded motion: interpolation and checks.

use armcal_core::codes::Code;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::error::SimError;
use crate::recorded_motion::kinematics::VehicleKinematics;
use crate::recorded_motion::spline::{Spline, Value};
use crate::recorded_motion::table::{self, Header, Sample};
use armcal_core::robot::{FileIssue, read_table};

/// Recorded motion, checked and ready to be followed.
///
/// The file is a CSV with the columns `time_s, x_m, y_m, z_m` and then either `roll_rad, pitch_rad, yaw_rad`
/// (`R = Rz(yaw) Ry(pitch) Rx(roll)`) or `qw, qx, qy, qz` (Hamilton); a line that begins with `#` is a comment.
/// Positions are those of the vehicle's origin against its station, which is the world's origin; z up. Time counts from
/// the first sample.
#[derive(Clone, Debug)]
pub struct RecordedMotion {
    spline: Spline,
    text: String,
}

/// Largest time between two samples, s: a longer one is a gap in which the motion is unknown.
const MAX_GAP_S: f64 = 1.0;
/// Largest turn of a vehicle between two samples, rad: beyond it, the shorter way round need not be the actual one.
const MAX_TURN_RAD: f64 = 1.0;
/// Largest acceleration, m/s2: a jump in the recording exceeds it, but no vehicle with an arm does.
const MAX_ACCELERATION_M_S2: f64 = 50.0;
/// Largest angular acceleration, rad/s2, for the same reason.
const MAX_ANGULAR_ACCELERATION_RAD_S2: f64 = 50.0;
/// Duration of the last part of the recording, which plays slower, s; half of a recording that is shorter than twice
/// this.
const EASED_S: f64 = 2.0;

impl PartialEq for RecordedMotion {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl RecordedMotion {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`SimError`] naming the file, and where it can the line, the column and the allowed range.
    pub fn read(path: &Path) -> Result<Self, SimError> {
        Self::parse(path, read_table(path)?)
    }

    /// Reads and checks the motion in `text`; `file` is for error messages.
    ///
    /// # Errors
    /// Errors as in [`Self::read`].
    pub fn parse(file: &Path, text: String) -> Result<Self, SimError> {
        let (header, samples) = table::parse(file, &text)?;
        check_times(file, &samples)?;
        let values = continuous(file, &header, &samples)?;
        let start_s = samples[0].time_s;
        let times_s = samples.iter().map(|sample| sample.time_s - start_s).collect();
        let motion = Self { spline: Spline::natural(times_s, values), text };
        motion.check_accelerations(file, &header, &samples)?;
        Ok(motion)
    }

    /// Returns the file's text, which makes the recording of a run complete.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the BLAKE3 hash of the file's text, hexadecimal.
    #[must_use]
    pub fn hash(&self) -> String {
        blake3::hash(self.text.as_bytes()).to_hex().to_string()
    }

    /// Returns the time from the first sample to the last, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.spline.end_s()
    }

    /// Returns the state `t_s` seconds after the first sample; before it, that of the first sample at rest.
    #[must_use]
    pub fn at(&self, t_s: f64) -> VehicleKinematics {
        self.jet(&self.played(t_s))
    }

    /// Returns the time in the recording (s) at run time `t_s`, with its first and second derivative.
    ///
    /// `1 - 3 s2 + 2 s3` of the last [`EASED_S`] stretched to twice their length: the recording's rate falls from one
    /// to zero, and its derivative is zero at both ends, so that the whole stays twice differentiable.
    fn played(&self, t_s: f64) -> [f64; 3] {
        let end_s = self.duration_s();
        let eased_s = EASED_S.min(0.5 * end_s);
        let (start_s, length_s) = (end_s - eased_s, 2.0 * eased_s);
        if t_s < 0.0 {
            return [0.0; 3];
        }
        if t_s <= start_s {
            return [t_s, 1.0, 0.0];
        }
        let s = (t_s - start_s) / length_s;
        if s >= 1.0 {
            return [end_s, 0.0, 0.0];
        }
        [
            start_s + length_s * s * (1.0 + s * s * (-1.0 + 0.5 * s)),
            1.0 + s * s * (-3.0 + 2.0 * s),
            6.0 * s * (s - 1.0) / length_s,
        ]
    }

    fn jet(&self, &[at_s, speed, change]: &[f64; 3]) -> VehicleKinematics {
        let [value, first, second] = self.spline.at(at_s);
        // The chain rule: the recording plays at `speed`.
        let first_in_run = first.map(|v| v * speed);
        let second_in_run: Value = std::array::from_fn(|k| second[k] * speed * speed + first[k] * change);
        let part = |v: &Value| Vector3::new(v[0], v[1], v[2]);
        let quaternion = |v: &Value| Quaternion::new(v[3], v[4], v[5], v[6]);
        let (q, dq, ddq) = (quaternion(&value), quaternion(&first_in_run), quaternion(&second_in_run));
        // With n = |q|: normalising changes only the scalar part of q* dq, so that w = 2 vec(q* dq)/n2 in body axes,
        // and dw = 2 vec(q* ddq)/n2 - 2 w (q . dq)/n2.
        let n2 = q.norm_squared();
        let rate = (q.conjugate() * dq).imag() * (2.0 / n2);
        let angular_acceleration = ((q.conjugate() * ddq).imag() - rate * q.dot(&dq)) * (2.0 / n2);
        VehicleKinematics {
            position: part(&value),
            velocity: part(&first_in_run),
            acceleration: part(&second_in_run),
            rotation: UnitQuaternion::from_quaternion(q),
            rate,
            angular_acceleration,
        }
    }

    /// Checks accelerations: a jump shows as one that no vehicle has, and the largest names the line.
    fn check_accelerations(&self, file: &Path, header: &Header, samples: &[Sample]) -> Result<(), FileIssue> {
        let jets: Vec<_> = self.spline.times_s().iter().map(|&t| self.jet(&[t, 1.0, 0.0])).collect();
        let check = |sizes: &mut dyn Iterator<Item = f64>, limit: f64, unit: &str, columns: String| {
            // Samples that are too close for their number of decimals give NaN.
            let size = |value: f64| if value.is_nan() { f64::INFINITY } else { value };
            match sizes.map(size).enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, worst)| *worst > limit) {
                None => Ok(()),
                Some((row, worst)) => {
                    let problem = format!("a jump: it would take {worst:.3} {unit}; allowed is 0 .. {limit} {unit}");
                    Err(FileIssue::new(
                        Code::TableInvalid,
                        file,
                        format!("line {}, {columns}", samples[row].line),
                        problem,
                    ))
                }
            }
        };
        let (mut linear, mut angular) =
            (jets.iter().map(|jet| jet.acceleration.norm()), jets.iter().map(|jet| jet.angular_acceleration.norm()));
        check(&mut linear, MAX_ACCELERATION_M_S2, "m/s2", header.position_columns())?;
        check(&mut angular, MAX_ANGULAR_ACCELERATION_RAD_S2, "rad/s2", header.attitude_columns())
    }
}

/// Checks that times rise, without gaps.
fn check_times(file: &Path, samples: &[Sample]) -> Result<(), FileIssue> {
    for pair in samples.windows(2) {
        let step_s = pair[1].time_s - pair[0].time_s;
        if step_s <= 0.0 {
            let problem = format!("{} s does not come after {} s; times must rise", pair[1].time_s, pair[0].time_s);
            return Err(FileIssue::new(
                Code::TableInvalid,
                file,
                format!("line {}, column time_s", pair[1].line),
                problem,
            ));
        }
        if step_s > MAX_GAP_S {
            let problem = format!("a gap of {step_s:.3} s since the line before; at most {MAX_GAP_S} s are allowed");
            return Err(FileIssue::new(
                Code::TableInvalid,
                file,
                format!("line {}, column time_s", pair[1].line),
                problem,
            ));
        }
    }
    Ok(())
}

/// Returns values for the spline: of the two quaternions of each attitude, the one nearer to the sample before.
fn continuous(file: &Path, header: &Header, samples: &[Sample]) -> Result<Vec<Value>, FileIssue> {
    let mut values: Vec<Value> = Vec::with_capacity(samples.len());
    let mut before = samples[0].rotation.into_inner();
    for sample in samples {
        let mut q = sample.rotation.into_inner();
        if q.dot(&before) < 0.0 {
            q = -q;
        }
        let turn_rad = 2.0 * q.dot(&before).clamp(-1.0, 1.0).acos();
        if turn_rad > MAX_TURN_RAD {
            let key = format!("line {}, {}", sample.line, header.attitude_columns());
            let problem =
                format!("turns by {turn_rad:.3} rad since the line before; allowed is 0 .. {MAX_TURN_RAD} rad");
            return Err(FileIssue::new(Code::TableInvalid, file, key, problem));
        }
        let p = sample.position_m;
        values.push([p[0], p[1], p[2], q.w, q.i, q.j, q.k]);
        before = q;
    }
    Ok(values)
}
