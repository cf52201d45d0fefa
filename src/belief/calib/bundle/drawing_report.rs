//! What an estimate found of the drawing: links, base, camera mount and lens that are not as drawn.
//!
//! An element counts whose estimate z is many sigmas of the drawing's prior from it. Were the drawing kept, the sensors'
//! parameters x would follow the posterior's covariance, `dx = C_xz C_zz^-1 z`, and the tool would be off by what both
//! move it together.

use nalgebra::{DVector, Matrix3, Vector3};

use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::score_test::ToolJacobian;
use crate::calib::finding::{Finding, FindingKind, FindingUnit};
use crate::calib::result::calibration::Calibration;
use armcal_core::joints::JointAngles;
use armcal_core::spatial::log;

/// Sigmas of the drawing's prior, over three axes together, from which an element is named.
const NAMED_SIGMAS: f64 = 6.0;
/// Times its own uncertainty that an element must be off, too.
const SURE_SIGMAS: f64 = 4.0;

/// Three numbers of the drawing that were estimated.
struct Departure {
    kind: FindingKind,
    name: String,
    unit: FindingUnit,
    size: Vector3<f64>,
    /// Of the size, by the posterior: the root of the largest eigenvalue of its covariance.
    std: f64,
    /// Over the drawing's prior.
    sigmas: f64,
    tool_m: Option<f64>,
}

impl Estimate<'_> {
    /// Writes what is not as drawn to `calibration`, the most telling first; `task`: angles at which the tool matters.
    pub(crate) fn report_drawing(&self, task: &[JointAngles], calibration: &mut Calibration) {
        let mut found: Vec<Departure> = self.link_departures(task).collect();
        if self.problem.layout.links.is_empty() {
            found.clear();
        } else {
            found.extend(self.mount_departures());
        }
        found
            .retain(|departure| departure.sigmas > NAMED_SIGMAS && departure.size.norm() > SURE_SIGMAS * departure.std);
        found.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
        let mut findings: Vec<Finding> = found.iter().map(Departure::finding).collect();
        let mut words: Vec<String> = found.iter().map(Departure::words).collect();
        if let Some((finding, word)) = self.lens_finding() {
            findings.push(finding);
            words.push(word);
        }
        calibration.findings.splice(0..0, findings);
        if let Some(verdict) = &mut calibration.verdict {
            verdict.warnings.extend(words);
        }
    }

    fn link_departures(&self, task: &[JointAngles]) -> impl Iterator<Item = Departure> {
        let robot = self.problem.robot;
        let tool = self.tool_jacobians(task);
        let links = self.problem.layout.links.clone();
        let priors = [robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad];
        (0..links.len() / 3).map(move |k| {
            let (joint, kind, first) = (k / 2, k % 2, links.start + 3 * k);
            let covariance = self.covariance3(first);
            let size = self.solved.state.joint.fixed_rows::<3>(first).into_owned();
            let name = match joint {
                0 => "base (or all tags)".to_owned(),
                _ => robot.chain.joints()[joint - 1].child_link.clone(),
            };
            Departure {
                kind: if joint == 0 { FindingKind::Base } else { FindingKind::Link },
                name,
                unit: [FindingUnit::Metre, FindingUnit::Radian][kind],
                sigmas: size.norm() / priors[kind].max(1e-9),
                std: largest_std(&covariance),
                tool_m: Some(self.tool_moved_m(&tool, first, &size)),
                size,
            }
        })
    }

    fn mount_departures(&self) -> impl Iterator<Item = Departure> {
        let camera = &self.problem.robot.camera;
        let priors = [camera.mount_std_m, camera.mount_std_rad];
        let off = log(&self.problem.prior.mount.inv_mul(&self.solved.state.mount));
        let columns = self.problem.layout.mount.into_iter().flat_map(|at| [(at, 0), (at + 3, 1)]);
        columns.map(move |(first, kind)| {
            let size = off.fixed_rows::<3>(3 * kind).into_owned();
            Departure {
                kind: FindingKind::CameraMount,
                name: "camera mount".to_owned(),
                unit: [FindingUnit::Metre, FindingUnit::Radian][kind],
                sigmas: size.norm() / priors[kind].max(1e-9),
                std: largest_std(&self.covariance3(first)),
                size,
                tool_m: None,
            }
        })
    }

    /// The lens, where it has columns.
    fn lens_finding(&self) -> Option<(Finding, String)> {
        let at = self.problem.layout.lens?;
        let (lens, drawn) = (&self.solved.state.lens, &self.problem.prior.lens);
        let std = |k: usize| self.posterior.covariance[(at + k, at + k)].max(0.0).sqrt();
        let ratio = lens.focal_px[0] / drawn.focal_px[0] - 1.0;
        let shift = [0, 1].map(|k| lens.center_px[k] - drawn.center_px[k]);
        let words = format!(
            "camera: focal length {:+.2} % of robot.toml's (sigma {:.2} %), centre off by {:.1}, {:.1} px: estimated \
             with the rest; measure the intrinsics again",
            100.0 * ratio,
            100.0 * std(0) / drawn.focal_px[0],
            shift[0],
            shift[1],
        );
        let (size, unit) = (Some(ratio), Some(FindingUnit::One));
        let name = "camera".to_owned();
        Some((
            Finding { kind: FindingKind::Lens, name, size, unit, tool_error_m: None, time_s: None, repaired: true },
            words,
        ))
    }

    fn covariance3(&self, first: usize) -> Matrix3<f64> {
        self.posterior.covariance.fixed_view::<3, 3>(first, first).into_owned()
    }

    /// Root mean square over the task of how far the tool would be elsewhere with the drawing kept, m.
    fn tool_moved_m(&self, tool: &[ToolJacobian], first: usize, size: &Vector3<f64>) -> f64 {
        let n = self.problem.layout.n_joint();
        let Some(inverse) = self.covariance3(first).try_inverse() else { return 0.0 };
        let follow = self.posterior.covariance.view((0, first), (n, 3)) * (inverse * size);
        let square = |at: &ToolJacobian| at.moved_by(&DVector::from_column_slice(follow.as_slice())).norm_squared();
        (tool.iter().map(square).sum::<f64>() / tool.len().max(1) as f64).sqrt()
    }
}

fn largest_std(covariance: &Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

impl Departure {
    fn finding(&self) -> Finding {
        Finding {
            kind: self.kind,
            name: self.name.clone(),
            size: Some(self.size.norm()),
            unit: Some(self.unit),
            tool_error_m: self.tool_m,
            time_s: None,
            repaired: true,
        }
    }

    fn words(&self) -> String {
        let (factor, unit, what) = match self.unit {
            FindingUnit::Radian => (1f64.to_degrees(), "deg", "turned about"),
            _ => (1e3, "mm", "shifted along"),
        };
        let [x, y, z] = <[f64; 3]>::from(self.size * factor);
        let at_tool = self.tool_m.map_or(String::new(), |m| format!(", {:.1} mm at the tool", 1e3 * m));
        format!(
            "{}: {what} its axes by [{x:.2}, {y:.2}, {z:.2}] {unit} (sigma {:.2}) against the drawing{at_tool}: \
             estimated with the sensors; correct the drawing",
            self.name,
            factor * self.std,
        )
    }
}
