//! The paper's study repeated: gains and offsets from landmark positions with isotropic noise, on its own arm.
//!
//! `scene` draws an arm, landmarks, poses and readings; `contender` is a method with its settings. `trials` runs
//! contenders on the same draws and measures the tool. `experiments` lists the comparisons, with the paper's own
//! figures; `tables` and `figures` show them. `sensitivity` is its Figures 4 and 7. Draws run in parallel and are
//! gathered in order, so results do not depend on the threads.

mod contender;
mod experiments;
mod figures;
mod scene;
mod sensitivity;
mod tables;
#[cfg(test)]
mod tests;
mod trials;

pub use contender::{MethodVariant, Solver};
pub use experiments::{Experiment, Tier, experiments};
pub use figures::paper_figures;
pub use scene::{Draw, Guess, PoseSampling, Readings, Setting};
pub use sensitivity::{Sensitivity, SensitivityPoint, sensitivity};
pub use tables::{paper_csv, paper_markdown};
pub use trials::{PaperRow, run_experiment};

/// Reason that the study cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PaperStudyError {
    #[error("robot `{robot}`: {problem}")]
    Scene { robot: String, problem: String },
    #[error("a plot cannot be drawn: {0}")]
    Plot(String),
}
