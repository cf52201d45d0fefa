//! Steps and limits of the compact text.

pub use crate::file::constants::compact_precision::MAX_COMPACT_BYTES;
pub(crate) use crate::file::constants::compact_precision::{HASH_DIGITS, MAX_STEPS, STEPS, STEPS_WITH_TERMS, UM_PER_M};
