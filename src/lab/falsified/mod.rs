//! Study of the verdict where nominal model, survey or a sensor differs from the estimator's input.
//!
//! Each seed has one capture of a routine (`capture`). `cases` is the table of falsifications; `perturbation` applies
//! one to the robot's description or to recorded counts. `run` calibrates under each and scores the result by the
//! truth; `naming` finds the cause that the result names first. `oracle` computes whether the data can show a
//! falsification and its effect at the tool. `classes` finds the causes that the data cannot distinguish. `report`
//! makes table and CSV.

mod capture;
mod cases;
mod classes;
mod error;
mod naming;
mod oracle;
mod perturbation;
mod report;
mod run;
#[cfg(test)]
mod tests;

pub use cases::{Case, CaseKind, Tier, falsified_cases, touched_cases};
pub use classes::EquivalenceClasses;
pub use error::FalsifiedError;
pub use report::{falsified_csv, falsified_markdown};
pub use run::{FalsifiedRow, FalsifiedStudy, RunStatus, falsified_study};
