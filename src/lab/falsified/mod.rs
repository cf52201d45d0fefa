//! What the verdict says when the drawing, the survey or a sensor is not what the estimator is told.
//!
//! For each seed one capture of a routine (`capture`). `cases` is the table of falsifications; `perturbation` applies
//! one to the robot's description or to recorded counts. `run` calibrates under each and scores the result by the
//! truth; `naming` says which cause the result names first. `oracle` computes what the data can see of a falsification
//! and what it means at the tool, `classes` which causes the data cannot tell apart. `report` makes table and CSV.

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
