//! What a real arm's sensors make of the truth: counts, pixels, temperatures, attitude, pressure.

pub(super) mod attitude;
pub(super) mod camera;
pub(super) mod pot;
pub(super) mod thermometer;
