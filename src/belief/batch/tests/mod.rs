//! Tests on data of the estimator's own model: equations against differences, the estimate against its bound.

mod arms;
mod baseline;
mod calibration_prior;
mod cameras;
mod corner_outliers;
pub(crate) mod data;
mod drawing;
mod equations;
mod failures;
mod growth;
mod lenses;
mod moved_between;
mod moved_tags;
mod readings;
mod recorded_poses;
mod reservations;
mod sag;
mod score_test;
mod slips;
mod small_samples;
mod stated_noise;
mod statistics;
mod tag_distances;
mod touches;
mod unusual_sensors;
mod walks;
mod within_sigmas;
