//! What a real arm's sensors make of the truth: counts, pixels, temperatures, attitude, pressure.

pub(super) mod attitude;
pub(super) mod camera;
pub(super) mod joint;
mod oil_state;
pub(super) mod thermometer;

pub(super) use oil_state::OilState;

#[cfg(test)]
mod tests;
