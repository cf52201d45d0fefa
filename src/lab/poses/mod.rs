//! Number of poses and arm time that a tool accuracy needs, for poses chosen by each criterion and at random.
//!
//! The study runs in the routine's scene, with only the datasheets' bounds known. Each seed has one pool of poses that
//! see enough tags and keep clear. From it come the poses of each criterion for 3 to 30 views, and views of an arm
//! drawn as the world draws it (`arm`: no dynamics). `bundle` gives the estimate. The rows have the tool's error at the
//! task's targets: true, as `bundle` predicts it, and as planned. `study` does that; `report` makes table and chart of
//! it.

mod arm;
mod report;
mod study;
#[cfg(test)]
mod tests;

pub use report::{poses_csv, poses_figure, poses_table};
pub use study::{PoseGrid, PoseRow, PoseStudyError, pose_study};
