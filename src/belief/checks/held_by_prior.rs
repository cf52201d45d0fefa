//! Keys of robot.toml whose priors cause most of the tool error where no view constrains it.
//!
//! If a parameter were known exactly, the tool's variance would fall by `|cov(tool, parameter)|^2 / var(parameter)`:
//! its share. A parameter with a large share that keeps most of its prior's variance is held by that prior; more views
//! do not determine it. The camera mount counts with it if both have large shares, because a known mount would
//! determine that parameter.

use nalgebra::DMatrix;

use crate::checks::constants::held_by_prior::LEAST_SHARE;
use crate::checks::constants::reservations::UNSEEN_SHARE;
use crate::model::blocks::Block;
use crate::model::parameters::{Parameter, ParameterKind};
use crate::say::key_of_joint;
use crate::solve::estimate::Estimate;
use armcal_core::joints::JointAngles;

impl Estimate<'_> {
    /// Keys of robot.toml whose priors cause most of `tool_m2`, the tool's variance at `at`, m^2; the keys of the first
    /// camera come last. Empty if the views determine it.
    pub(crate) fn keys_that_hold(&self, at: &JointAngles, tool_m2: f64) -> Vec<String> {
        let layout = &self.problem.layout;
        let Some(tool) = self.tool_jacobians(std::slice::from_ref(at)).into_iter().next() else { return Vec::new() };
        let covariance = self.wide_covariance();
        let mut by = DMatrix::zeros(3, covariance.ncols());
        for (k, column) in tool.by_parameters.iter().enumerate() {
            by.set_column(k, column);
        }
        let with_tool = covariance * by.transpose();
        let is_large = |column: usize| {
            let variance = covariance[(column, column)];
            with_tool.row(column).norm_squared() > LEAST_SHARE * tool_m2 * variance && variance > 0.0
        };
        let is_held = |column: usize, prior_std: f64| {
            is_large(column) && covariance[(column, column)] > UNSEEN_SHARE * prior_std.powi(2)
        };
        let sensors = layout.parameters.iter().enumerate().filter(|(column, p)| is_held(*column, self.prior_std(**p)));
        let mut keys: Vec<String> = sensors.filter_map(|(_, p)| self.key_of(*p)).collect();
        let Some(first) = layout.at(Block::Mount(0)) else { return keys };
        let mount_std = &self.problem.prior.std[Block::Mount(0)];
        let is_mount_held = (0..6).any(|k| is_held(first + k, mount_std[k]));
        if is_mount_held || !keys.is_empty() {
            let of_mount = [("mount_std_m", 0..3), ("mount_std_rad", 3..6)];
            let large = of_mount.into_iter().filter(|(_, axes)| axes.clone().any(|k| is_large(first + k)));
            keys.extend(large.map(|(key, _)| key.to_owned()));
        }
        keys
    }

    fn prior_std(&self, parameter: Parameter) -> f64 {
        let spec = &self.problem.robot.sensors[parameter.joint];
        self.scales().prior_std(spec, parameter.joint, parameter.kind)
    }

    /// Key of robot.toml for the parameter's prior; `None` if it has no key of its own.
    fn key_of(&self, parameter: Parameter) -> Option<String> {
        let spec = &self.problem.robot.sensors[parameter.joint];
        let key = match parameter.kind {
            ParameterKind::Gain => "gain_std",
            ParameterKind::Offset if spec.moves.is_slide() => "offset_std_m",
            ParameterKind::Offset => "offset_std_rad",
            _ => return None,
        };
        Some(key_of_joint(key, &spec.joint))
    }
}
