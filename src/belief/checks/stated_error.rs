//! Tool error predicted if noise and sensors are no worse than stated. A limit derived from it does not grow with
//! errors that the model fails to explain.

use crate::model::scales::Hyperparameters;
use crate::solve::covariance::ParameterCovariance;
use crate::solve::estimate::Estimate;
use crate::solve::evidence::Posterior;
use crate::solve::input::BundleInput;
use crate::solve::linearize::NormalEquations;
use armcal_core::joints::JointAngles;
use armcal_core::numeric::Loss;
use armcal_core::stats::quantile;

impl Estimate<'_> {
    /// Median of the predicted tool error over `configurations` with the fitted scales, each at most what robot.toml
    /// states, m; `None` without configurations.
    pub(crate) fn stated_tool_error_m(&self, input: &BundleInput<'_>, configurations: &[JointAngles]) -> Option<f64> {
        let covariance = self.stated_covariance(input)?;
        let sensors = self.parameters().sensors(input.robot);
        let error_m =
            |angles: &JointAngles| covariance.tool_position_m2(input.robot, &sensors, angles).trace().max(0.0).sqrt();
        quantile(&configurations.iter().map(error_m).collect::<Vec<f64>>(), 0.5)
    }

    /// Covariance of the joints' parameters with the fitted scales, each at most what robot.toml states.
    pub(crate) fn stated_covariance(&self, input: &BundleInput<'_>) -> Option<ParameterCovariance> {
        let mut problem = self.problem.clone();
        problem.scales = at_most_stated(&problem.scales, input);
        if input.joint_prior.is_none() {
            problem.rescale_priors();
        }
        let mut normal = NormalEquations::new(&problem);
        normal.update(&problem, &self.solved.state, Loss::Square);
        let n = problem.layout.n_joint();
        let matrix = Posterior::of(&problem, &normal)?.covariance.view((0, 0), (n, n)).into_owned();
        let parameters = self.joint_parameters().to_vec();
        Some(ParameterCovariance { parameters, matrix, residual_std_rad: Some(problem.scales.joint_std_rad) })
    }
}

fn at_most_stated(fitted: &Hyperparameters, input: &BundleInput<'_>) -> Hyperparameters {
    let stated = Hyperparameters::datasheet(input.robot);
    let mut scales = fitted.clone();
    scales.noise = fitted.noise.min(stated.noise);
    for (std, stated) in scales.compliance_std.iter_mut().zip(stated.compliance_std) {
        *std = std.min(stated);
    }
    for (joint, spec) in input.robot.sensors.iter().enumerate() {
        let linearity_std_rad = spec.linearity_std_rad.max(stated.joint_std_rad[joint]);
        scales.joint_std_rad[joint] = fitted.joint_std_rad[joint].min(linearity_std_rad);
        scales.walk_std_rad[joint] = fitted.walk_std_rad[joint].min(stated.walk_std_rad[joint]);
        scales.shape_std_rad[joint] = fitted.shape_std_rad[joint].min(linearity_std_rad);
        for (std, stated) in scales.link_std[joint].iter_mut().zip(stated.link_std[joint]) {
            *std = std.min(stated);
        }
    }
    scales
}
