//! Report of the estimated sag of the arm.

use crate::checks::constants::drawing_report_sag_report::NAMED_SIGMAS;
use nalgebra::{Cholesky, DVector};

use crate::model::parameters::{Parameter, ParameterKind};
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use crate::solve::estimate::Estimate;
use armcal_core::joints::JointAngles;

/// Estimated parameter of sag.
struct SagFigure {
    parameter: Parameter,
    size: f64,
    std: f64,
    /// Tool displacement by this parameter, root mean square over the task, m.
    tool_m: f64,
}

impl Estimate<'_> {
    /// Findings on the arm's sag with their texts: first the tool error without sag in the model, then each parameter,
    /// the largest at the tool first. Empty if sag was not estimated. `task`: configurations at which the tool matters.
    pub(crate) fn sag_findings(&self, task: &[JointAngles]) -> Vec<(Finding, String)> {
        let columns = self.problem.layout.sag.clone();
        if columns.is_empty() {
            return Vec::new();
        }
        let tool = self.tool_jacobians(task);
        let rms = |squares: f64| (squares / tool.len().max(1) as f64).sqrt();
        let figure = |column: usize| {
            let parameter = self.problem.layout.parameters[column];
            let size = self.solved.state.joint[column];
            let std = self.posterior.covariance[(column, column)].max(0.0).sqrt();
            let tool_m = rms(tool.iter().map(|at| (at.by_parameters[column] * size).norm_squared()).sum());
            SagFigure { parameter, size, std, tool_m }
        };
        let mut figures: Vec<SagFigure> = columns.clone().map(figure).collect();
        figures.retain(|figure| figure.size.abs() > NAMED_SIGMAS * figure.std);
        figures.sort_by(|a, b| b.tool_m.total_cmp(&a.tool_m));
        let unknown_m = rms(self
            .unknown_sag(columns.start)
            .map_or(0.0, |follow| tool.iter().map(|at| at.moved_by(&follow).norm_squared()).sum::<f64>()));
        let whole = format!(
            "the arm bends under its weight: estimated with the sensors, which alone would have left {:.1} mm at the \
             tool",
            1e3 * unknown_m
        );
        let whole = (finding("arm".to_owned(), None, unknown_m), whole);
        [whole].into_iter().chain(figures.iter().map(|figure| self.sag_finding(figure))).collect()
    }

    fn sag_finding(&self, SagFigure { parameter, size, std, tool_m }: &SagFigure) -> (Finding, String) {
        let per_kn_m = |value: &f64| (1e3 * value).to_degrees();
        let (name, unit, what) = match parameter.kind {
            ParameterKind::ToolLoad => {
                let what = format!("{size:.0} N beyond the drawing's masses (sigma {std:.0} N)");
                ("load at the tool".to_owned(), FindingUnit::Newton, what)
            }
            kind => {
                let name = match kind {
                    ParameterKind::MountCompliance(axis) => {
                        format!("mount about {}", ["x", "y", "z"][usize::from(axis)])
                    }
                    _ => self.problem.robot.sensors[parameter.joint].joint.clone(),
                };
                let is_slide =
                    kind == ParameterKind::Compliance && self.problem.robot.sensors[parameter.joint].moves.is_slide();
                if is_slide {
                    let what = format!("gives {:.2} mm per kN (sigma {:.2})", 1e6 * size, 1e6 * std);
                    (name, FindingUnit::MetrePerNewton, what)
                } else {
                    let what = format!("gives {:.2} deg per kN m (sigma {:.2})", per_kn_m(size), per_kn_m(std));
                    (name, FindingUnit::RadianPerNewtonMetre, what)
                }
            }
        };
        let words = format!("{name}: {what}: the tool hangs {:.1} mm by it", 1e3 * tool_m);
        (finding(name, Some((*size, unit)), *tool_m), words)
    }

    /// Change of the joints' and sag's parameters relative to a stiff arm: `C_xz C_zz^-1 z`.
    fn unknown_sag(&self, first: usize) -> Option<DVector<f64>> {
        let n = self.problem.layout.n_joint();
        let covariance = self.posterior.covariance.view((0, 0), (n, n));
        // Scaled by the standard deviations, which differ by orders of magnitude.
        let std = covariance.diagonal().map(|variance| variance.max(f64::MIN_POSITIVE).sqrt());
        let scaled = covariance.component_div(&(&std * std.transpose()));
        let size = self.solved.state.joint.rows(first, n - first).component_div(&std.rows(first, n - first));
        let inverse = Cholesky::new(scaled.view((first, first), (n - first, n - first)).into_owned())?;
        Some((scaled.columns(first, n - first) * inverse.solve(&size)).component_mul(&std))
    }
}

fn finding(name: String, size: Option<(f64, FindingUnit)>, tool_m: f64) -> Finding {
    let (size, unit) = size.unzip();
    Finding { kind: FindingKind::Sag, name, size, unit, tool_error_m: Some(tool_m), time_s: None, repaired: true }
}
