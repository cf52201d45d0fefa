//! Delay of the joint sensors' stamps after the camera's, s.

use crate::model::blocks::{MAX_COLUMNS, Std, Value};
use crate::model::constants::blocks_clock::CLOCK_STD_S;

pub(super) fn drawn() -> Value {
    Value::Number(0.0)
}

pub(super) fn drawn_std() -> Std {
    let mut std = [0.0; MAX_COLUMNS];
    std[0] = CLOCK_STD_S;
    std
}

pub(super) fn name() -> String {
    "time offset".to_owned()
}
