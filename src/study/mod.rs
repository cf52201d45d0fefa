//! Studies of parts on their own, against known truth.
//!
//! `detection`: tags at set ranges and incidences in three kinds of water, at rest and in motion (`scenes`), rendered,
//! detected and compared with the projection (`trials`). From that: rates and errors by condition (`tables`), and the model
//! of corner noise and detection that the geometric camera may draw from (`noise_fit`). tests/oracle/compare_detectors.py
//! runs other detectors on the same images. `paper`: the paper's comparison of methods, and `sensitivity` its Figures 4 and 7;
//! `charts` draws both.

mod charts;
mod noise_fit;
pub mod paper;
mod scenes;
mod sensitivity;
mod tables;
mod trials;

pub use noise_fit::{FittedNoise, fit_noise};
pub use scenes::{Condition, TAG_SIZE_M, conditions, water_name};
pub use sensitivity::{Sensitivity, SensitivityPoint, sensitivity};
pub use tables::{conditions_csv, report, trials_csv, truth_csv};
pub use trials::{DetectionStudy, Outcome, StudyError, TagTrial, Watcher, detection_study};
