//! Studies of single parts against known truth.
//!
//! `detection`: tags at set ranges and incidences in three kinds of water, at rest and in motion (`scenes`), rendered,
//! detected and compared with the projection (`trials`). Results are rates and errors by condition (`tables`), and the
//! model of corner noise and detection for the geometric camera (`noise_fit`). tests/oracle/compare_detectors.py runs
//! other detectors on the same images. `poses`: error against the number of poses and the arm's time, by the choice of
//! poses; armcal-charts draws it. The paper's study is in armcal-paper. `falsified`: the verdict where nominal model,
//! survey or a sensor is wrong. `edges`: certified edges against brute force; `paths`: planning between random poses.
//! `worlds`: closed loops in any allowed world; `bound`: closed loops against the Bayesian bound of their views.
//! `dive`: the online estimate over a dive; `dive_faults`: the time until it names a fault.

mod bound;
mod dive;
mod dive_faults;
mod edges;
mod falsified;
mod noise_fit;
mod paths;
mod poses;
mod scenes;
mod tables;
mod trials;
mod worlds;

pub use bound::{AS_MODELLED, BoundFigures, BoundInput, BoundRun, BoundTarget, bound_csv, bound_run, bound_table};
pub use dive::{AtStart, DiveStudy, DiveTask, dive_csv, dive_study, dive_table};
pub use dive_faults::{
    DiveFault, DiveFaultKind, DiveFaultRow, dive_fault_study, dive_faults_csv, dive_faults_table, drawn_dive_fault,
};
pub use edges::{Edge, EdgeRow, EdgeStudy, edge_study, edges_csv, edges_json, mean_time_under_s, random_edges};
pub use falsified::{
    Case, CaseKind, EquivalenceClasses, FalsifiedError, FalsifiedRow, FalsifiedStudy, RunStatus, Tier, falsified_cases,
    falsified_csv, falsified_markdown, falsified_study, touched_cases,
};
pub use noise_fit::{FittedNoise, fit_noise};
pub use paths::{Belief, PathQueries, PathRow, PathSite, PathStudy, path_study, paths_csv, problem_json, queries_json};
pub use poses::{PoseGrid, PoseRow, PoseStudyError, pose_study, poses_csv, poses_figure, poses_table};
pub use scenes::{Condition, TAG_SIZE_M, conditions, water_name};
pub use tables::{conditions_csv, report, trials_csv, truth_csv};
pub use trials::{DetectionStudy, Outcome, StudyError, TagTrial, Watcher, detection_study};
pub use worlds::{DrawnWorld, drawn_world};
