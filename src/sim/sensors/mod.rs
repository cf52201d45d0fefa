//! Simulated sensors: joint counts, tag detections, temperatures, attitude and pressure from the true state.

pub(super) mod attitude;
pub(super) mod camera;
pub(super) mod joint;
mod lag;
mod oil_state;
pub(super) mod thermometer;

pub(super) use oil_state::{OilState, SensorSurroundings};

#[cfg(test)]
mod tests;
