//! What an estimate found of how the arm bends.

use nalgebra::DVector;

use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::score_test::ToolJacobian;
use crate::calib::finding::{Finding, FindingKind, FindingUnit};
use crate::calib::parameters::{Parameter, ParameterKind};
use armcal_core::joints::JointAngles;

/// Sigmas of the estimate from which a compliance is named.
const NAMED_SIGMAS: f64 = 3.0;

impl Estimate<'_> {
    /// Compliances that are told, the largest at the tool first, with their words; at least one where they were
    /// estimated. `task`: angles at which the tool matters.
    pub(super) fn sag_findings(&self, task: &[JointAngles]) -> Vec<(Finding, String)> {
        let tool = self.tool_jacobians(task);
        let columns = self.problem.layout.sag.clone();
        let of_column = |column: usize| {
            let parameter = self.problem.layout.parameters[column];
            let (size, variance) = (self.solved.state.joint[column], self.posterior.covariance[(column, column)]);
            let sigmas = size.abs() / variance.max(f64::MIN_POSITIVE).sqrt();
            (parameter, size, sigmas, self.bent_away_m(&tool, column))
        };
        let mut all: Vec<(Parameter, f64, f64, f64)> = columns.map(of_column).collect();
        all.sort_by(|a, b| b.2.total_cmp(&a.2));
        let n = all.iter().filter(|(.., sigmas, _)| *sigmas > NAMED_SIGMAS).count();
        all.truncate(n.max(1));
        all.sort_by(|a, b| b.3.total_cmp(&a.3));
        all.into_iter()
            .map(|(parameter, size, sigmas, tool_m)| self.sag_finding(parameter, size, sigmas, tool_m))
            .collect()
    }

    fn sag_finding(&self, parameter: Parameter, size: f64, sigmas: f64, tool_m: f64) -> (Finding, String) {
        let robot = self.problem.robot;
        let std = (size / sigmas.max(1e-9)).abs();
        let (name, unit, words) = match parameter.kind {
            ParameterKind::ToolLoad => (
                "load at the tool".to_owned(),
                FindingUnit::Newton,
                format!("carries {size:.0} N beyond the drawing's masses (sigma {std:.0} N)"),
            ),
            kind => {
                let name = match kind {
                    ParameterKind::MountCompliance(axis) => {
                        format!("mount about {}", ["x", "y", "z"][usize::from(axis)])
                    }
                    _ => robot.sensors[parameter.joint].joint.clone(),
                };
                let [gives, by] = [size, std].map(|value| (1e3 * value).to_degrees());
                (name, FindingUnit::RadianPerNewtonMetre, format!("gives {gives:.3} deg per kN m (sigma {by:.3})"))
            }
        };
        let words = format!(
            "{name}: {words}: the arm bends under its weight, {:.1} mm at the tool: estimated with the sensors",
            1e3 * tool_m
        );
        let (size, tool_error_m) = (Some(size), Some(tool_m));
        (
            Finding {
                kind: FindingKind::Sag,
                name,
                size,
                unit: Some(unit),
                tool_error_m,
                time_s: None,
                repaired: true,
            },
            words,
        )
    }

    /// Root mean square over the task of how far the tool would be elsewhere without the parameter at `column`, the
    /// others following, m.
    fn bent_away_m(&self, tool: &[ToolJacobian], column: usize) -> f64 {
        let n = self.problem.layout.n_joint();
        let variance = self.posterior.covariance[(column, column)].max(f64::MIN_POSITIVE);
        let follow = self.posterior.covariance.view((0, column), (n, 1)) * (self.solved.state.joint[column] / variance);
        let follow = DVector::from_column_slice(follow.as_slice());
        let squares: f64 = tool.iter().map(|at| at.moved_by(&follow).norm_squared()).sum();
        (squares / tool.len().max(1) as f64).sqrt()
    }
}
