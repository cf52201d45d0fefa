//! A ROS 2 parameter file with gain, offset, terms and covariance of each joint.

use std::fmt::Write as _;

use crate::export::table::own_key;
use crate::export::yaml_text::{double, doubles, quoted};
use armcal_belief::calib::{Calibration, JointResult, Status, TermsTable};
use armcal_core::kinematics::JointKind;
use armcal_core::robot::Robot;

const HEAD: &str = "\
# Joint sensors as calibrated by armcal. For each joint, in rad:
#   travel = reading - center_counts, wrapped to half of wrap_counts either way
#   angle = center_rad + offset_rad + gain_rad_per_count * travel
# and terms where there are any; docs/reference/files.md of armcal, calibration.toml, has their equation. Apply them
# once: no transmission or table beside them. Zeros are those of the exported URDF. covariance.matrix is square, row by
# row, of covariance.parameters: gains relative to the datasheet's, all else in the units of the keys; across joints it
# is in calibration.covariance.toml.
";

const SLIDES: &str = "# Of joints with unit m, which slide, keys have _m in the place of _rad.\n";

/// Parameters of `calibration`, which belongs to `robot`, under `/**` and the prefix `calibration`.
#[must_use]
pub fn ros_parameters(robot: &Robot, calibration: &Calibration) -> String {
    let has_slide = calibration.has_slide();
    let head = if has_slide { format!("{HEAD}{SLIDES}") } else { HEAD.to_owned() };
    let mut file = Parameters {
        text: format!("{head}/**:\n  ros__parameters:\n    calibration:\n"),
        indent: 6,
        moves: JointKind::Revolute,
    };
    let status = if calibration.status == Status::Accepted { "accepted" } else { "refused" };
    file.text("robot", &calibration.robot);
    file.text("status", status);
    file.text("messages_hash", &calibration.messages_hash);
    let names: Vec<String> = calibration.joint.iter().map(|joint| quoted(&joint.name)).collect();
    file.line("joints", &format!("[{}]", names.join(", ")));
    if let Some(reference) = &calibration.reference {
        file.open("reference");
        file.optional("oil_c", reference.oil_c);
        file.optional("pressure_pa", reference.pressure_pa);
        reference.time_nanos.into_iter().for_each(|nanos| file.line("time_nanos", &nanos.to_string()));
        file.close();
    }
    for (joint, spec) in calibration.joint.iter().zip(&robot.sensors) {
        file.open(&quoted(&joint.name));
        file.moves = joint.moves;
        if joint.moves.is_slide() {
            file.text("unit", joint.moves.si());
        }
        file.number("center_rad", joint.center_rad);
        file.number("center_counts", spec.offset_counts + spec.counts_per_rad * spec.center_rad);
        file.number("wrap_counts", spec.wrap_counts);
        file.number("gain_rad_per_count", joint.gain_rad_per_count);
        file.number("offset_rad", joint.offset_rad);
        if let Some(terms) = &joint.terms {
            file.terms(terms, joint, spec.counts_per_rad);
        }
        file.covariance(calibration, &joint.name);
        file.moves = JointKind::Revolute;
        file.close();
    }
    file.text
}

struct Parameters {
    text: String,
    indent: usize,
    /// Kind of the joint whose keys are written.
    moves: JointKind,
}

impl Parameters {
    fn line(&mut self, key: &str, value: &str) {
        let _ = writeln!(self.text, "{:1$}{2}: {value}", "", self.indent, own_key(self.moves, key));
    }

    fn open(&mut self, key: &str) {
        let _ = writeln!(self.text, "{:1$}{key}:", "", self.indent);
        self.indent += 2;
    }

    fn close(&mut self) {
        self.indent -= 2;
    }

    fn text(&mut self, key: &str, value: &str) {
        self.line(key, &quoted(value));
    }

    fn number(&mut self, key: &str, value: f64) {
        self.line(key, &double(value));
    }

    fn optional(&mut self, key: &str, value: Option<f64>) {
        value.into_iter().for_each(|value| self.number(key, value));
    }

    fn numbers(&mut self, key: &str, values: impl Iterator<Item = f64>) {
        self.line(key, &doubles(values));
    }

    /// Writes the terms. `counts_per_rad` is the datasheet's value; the terms may count by a measured one.
    fn terms(&mut self, terms: &TermsTable, joint: &JointResult, counts_per_rad: f64) {
        let gain = joint.gain_over_datasheet.map(|gain| gain * joint.identified_ratio.unwrap_or(1.0));
        self.open("terms");
        self.number("counts_per_rad", gain.map_or(counts_per_rad, |gain| gain / joint.gain_rad_per_count));
        self.number("half_range_rad", terms.half_range_rad);
        if let Some(values) = &terms.nonlinearity_rad {
            self.numbers("nonlinearity_rad", values.iter().copied());
        }
        self.optional("offset_rad_per_k", terms.offset_rad_per_k);
        self.optional("gain_per_k", terms.gain_per_k);
        self.optional("offset_rad_per_mpa", terms.offset_rad_per_mpa);
        self.optional("drift_rad_per_h", terms.drift_rad_per_h);
        self.optional("half_backlash_rad", terms.half_backlash_rad);
        self.close();
    }

    /// Writes the covariance of the joint's own parameters, as far as they were estimated and have one.
    fn covariance(&mut self, calibration: &Calibration, joint: &str) {
        let table = &calibration.covariance;
        let prefix = format!("{joint} ");
        let rows = table.parameters.iter().enumerate();
        let (rows, names): (Vec<usize>, Vec<String>) =
            rows.filter_map(|(row, name)| Some((row, quoted(name.strip_prefix(&prefix)?)))).unzip();
        // ROS refuses an empty list because it has no type.
        if rows.is_empty() {
            return;
        }
        self.open("covariance");
        self.line("parameters", &format!("[{}]", names.join(", ")));
        self.numbers("matrix", rows.iter().flat_map(|row| rows.iter().map(|column| table.rows[*row][*column])));
        self.close();
    }
}
