//! How many poses, and how much of the arm's time, it takes to know the tool: chosen by each criterion, and at random.
//!
//! In the routine's scene, before anything is known (the datasheets' bounds): for each seed one pool of poses that see
//! enough tags and keep clear, from it the poses of each criterion for 3 to 30 views; views of an arm drawn as the
//! world draws it (`arm`: no dynamics); the estimate by `bundle`; and the tool's error at the task's targets, true, as
//! `bundle` predicts it and as it was planned. `study` does that; `report` makes table and chart of it.

mod arm;
mod report;
mod study;
#[cfg(test)]
mod tests;

pub use report::{poses_csv, poses_figure, poses_table};
pub use study::{PoseGrid, PoseRow, PoseStudyError, pose_study};
