//! Other explanations of the same views, compared by their evidence.
//!
//! `setup` estimates under one explanation. Sensors: `failure_detection`, `slips`, `walk`; readings: `reading_search`,
//! `unpaired`; tags: `tags`. Links, lens, sag: `drawing`, chosen by `score_test`; terms of a sensor: `model_selection`.
//! Files that the images contradict: `wrong_input`; an earlier calibration: `calibration_prior`; a knocked camera:
//! `moved_between`.

pub(crate) mod angles_by_camera;
pub(crate) mod baseline;
pub(crate) mod calibration_prior;
pub(crate) mod constants;
pub(crate) mod drawing;
pub(crate) mod failure_detection;
pub(crate) mod failure_pattern;
pub(crate) mod failures;
pub(crate) mod model_selection;
pub(crate) mod moved_between;
pub(crate) mod other_lens;
pub(crate) mod permutation_test;
pub(crate) mod reading_search;
pub(crate) mod score_test;
pub(crate) mod setup;
pub(crate) mod slips;
pub(crate) mod step_test;
pub(crate) mod tags;
pub(crate) mod unpaired;
pub(crate) mod walk;
pub(crate) mod wrong_input;
