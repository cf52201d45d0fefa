//! Priors of the common parameters.

use crate::model::constants::prior::MIN_STD;
use nalgebra::{DMatrix, DVector};

use crate::model::blocks::{Block, MAX_COLUMNS, PerBlock, Std, Value};
use crate::model::layout::Layout;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::scales::Hyperparameters;
use crate::model::state::State;
use armcal_core::robot::Robot;

/// One sigma of a standard deviation that is in use: never zero.
pub(crate) fn at_least(std: f64) -> f64 {
    std.max(MIN_STD)
}

/// Which columns, from the first on, a matrix of information is of. A block beyond them is known by a sigma of each
/// column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Covers {
    /// The joints' parameters.
    Parameters,
    /// These and the first camera's mount.
    ParametersAndMount,
    /// All of the layout.
    All,
}

/// Information (inverse covariance) on the first columns, about their means.
#[derive(Clone, Debug)]
pub struct Information {
    pub(crate) matrix: DMatrix<f64>,
    pub(crate) covers: Covers,
}

/// An earlier calibration's prior of the joints' parameters, and of the first camera's mount with them.
#[derive(Clone, Debug)]
pub struct JointPrior {
    pub(crate) mean: DVector<f64>,
    pub(crate) information: Information,
}

impl JointPrior {
    /// A prior of the parameters alone.
    #[must_use]
    pub fn of_parameters(mean: DVector<f64>, information: DMatrix<f64>) -> Self {
        Self { mean, information: Information { matrix: information, covers: Covers::Parameters } }
    }

    /// A prior of the parameters and the six columns of the mount, about where the robot has it.
    #[must_use]
    pub fn with_mount(mean: DVector<f64>, information: DMatrix<f64>) -> Self {
        Self { mean, information: Information { matrix: information, covers: Covers::ParametersAndMount } }
    }
}

/// Priors of all but the views' own parameters.
#[derive(Clone, Debug)]
pub(crate) struct Prior {
    /// Prior mean of the joints' parameters.
    pub joint_mean: DVector<f64>,
    pub information: Information,
    pub mean: PerBlock<Value>,
    /// Infinite where nothing is known; not looked at where `information` covers the block.
    pub std: PerBlock<Std>,
}

impl Prior {
    /// The prior by datasheet, drawing and survey.
    pub(crate) fn drawn(robot: &Robot, parameters: &[Parameter], scales: &Hyperparameters) -> Self {
        let nominal = JointParameters::default();
        let mean = parameters.iter().map(|p| nominal.get(*p));
        Self {
            joint_mean: DVector::from_iterator(parameters.len(), mean),
            information: Information {
                matrix: joint_information(robot, parameters, scales),
                covers: Covers::Parameters,
            },
            mean: PerBlock::new(robot, |block| block.drawn(robot)),
            std: PerBlock::new(robot, |block| block.drawn_std(robot, scales)),
        }
    }

    /// Takes the sizes of `scales` over, where the datasheet's priors depend on them.
    pub(crate) fn rescale(&mut self, robot: &Robot, parameters: &[Parameter], scales: &Hyperparameters) {
        self.information.matrix = joint_information(robot, parameters, scales);
        for (block, std) in self.std.iter_mut().filter(|(block, _)| !block.is_tag()) {
            *std = block.drawn_std(robot, scales);
        }
    }

    /// Forgets what is known of each block that `which` names.
    pub(crate) fn forget(&mut self, which: impl Fn(Block) -> bool) {
        let blocks = self.std.iter_mut().filter(|(block, _)| which(*block));
        blocks.for_each(|(_, std)| *std = [f64::INFINITY; MAX_COLUMNS]);
    }

    /// Returns true where `information` covers all columns.
    pub(crate) fn is_full(&self) -> bool {
        self.information.covers == Covers::All
    }

    /// Number of columns that `information` covers.
    pub(crate) fn n_covered(&self) -> usize {
        self.information.matrix.nrows()
    }

    /// The blocks with columns that a sigma of each column tells of: block, first column, sigmas.
    pub(crate) fn by_std<'a>(&'a self, layout: &'a Layout) -> impl Iterator<Item = (Block, usize, &'a [f64])> {
        let blocks = layout.blocks().filter(|(_, at)| *at >= self.n_covered());
        blocks.map(|(block, at)| (block, at, &self.std[block][..block.n_columns()]))
    }

    /// Deviations of the columns that `information` covers from their means.
    pub(crate) fn off(&self, layout: &Layout, state: &State) -> DVector<f64> {
        off_by(layout, (&self.joint_mean, &self.mean), state, self.n_covered())
    }
}

/// Deviations of the first `n` columns of `state` from the means of the joints' parameters and of the blocks.
pub(crate) fn off_by(
    layout: &Layout,
    (joint, mean): (&DVector<f64>, &PerBlock<Value>),
    state: &State,
    n: usize,
) -> DVector<f64> {
    let mut off = (&state.joint - joint).resize_vertically(n, 0.0);
    for (block, at) in layout.blocks().take_while(|(_, at)| *at < n) {
        let by = state.blocks[block].off(&mean[block]);
        let n_columns = block.n_columns();
        off.as_mut_slice()[at..at + n_columns].copy_from_slice(&by[..n_columns]);
    }
    off
}

/// Information on the joints' parameters by the datasheet, under `scales`.
///
/// The datasheet tells of the offset before the sensor slipped: of the offset as it is now plus all steps. Since the
/// slip the offset is as uncertain as the slip is.
fn joint_information(robot: &Robot, parameters: &[Parameter], scales: &Hyperparameters) -> DMatrix<f64> {
    let info = |p: &Parameter| {
        let std = scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind);
        at_least(std).powi(-2)
    };
    let mut matrix = DMatrix::from_diagonal(&DVector::from_iterator(parameters.len(), parameters.iter().map(info)));
    for (offset, p) in parameters.iter().enumerate().filter(|(_, p)| p.kind == ParameterKind::Offset) {
        let steps = steps_of(parameters, p.joint);
        for &step in &steps {
            matrix[(offset, step)] += info(p);
            matrix[(step, offset)] += info(p);
            steps.iter().for_each(|&other| matrix[(step, other)] += info(p));
        }
    }
    matrix
}

/// Columns of what the sensor of `joint` slipped by.
pub(crate) fn steps_of(parameters: &[Parameter], joint: usize) -> Vec<usize> {
    let is_step = |&column: &usize| parameters[column].joint == joint && parameters[column].is_step();
    (0..parameters.len()).filter(is_step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::titan;
    use crate::model::scales::STEP_STD_RAD;
    use armcal_core::time::SIMULATION_EPOCH;

    /// Two slips of one sensor, and none of the next.
    #[test]
    fn the_datasheet_tells_of_the_offset_before_the_slips() {
        let robot = titan();
        let steps = [1.0, 2.0].map(|s| ParameterKind::StepBefore(SIMULATION_EPOCH.plus_s(s)));
        let kinds = [ParameterKind::Gain, ParameterKind::Offset, steps[0], steps[1]];
        let mut parameters = kinds.map(|kind| Parameter { joint: 1, kind }).to_vec();
        parameters.push(Parameter { joint: 2, kind: ParameterKind::Offset });
        let scales = Hyperparameters::datasheet(&robot);
        let covariance = joint_information(&robot, &parameters, &scales).try_inverse().expect("regular");
        let by = |weights: [f64; 5]| {
            let by = DVector::from_row_slice(&weights);
            (&covariance * &by).dot(&by).sqrt()
        };
        let is = |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
        let stated_rad = robot.sensors[1].offset_std_rad;
        is(by([0.0, 1.0, 1.0, 1.0, 0.0]), stated_rad);
        is(by([0.0, 1.0, 0.0, 0.0, 0.0]), stated_rad.hypot(2.0_f64.sqrt() * STEP_STD_RAD));
        is(by([0.0, 0.0, 1.0, 0.0, 0.0]), STEP_STD_RAD);
        is(by([1.0, 0.0, 0.0, 0.0, 0.0]), robot.sensors[1].gain_std);
        is(by([0.0, 0.0, 0.0, 0.0, 1.0]), robot.sensors[2].offset_std_rad);
    }
}
