//! Steps and limits of the compact text.

/// The text is shorter than this, bytes.
pub const MAX_COMPACT_BYTES: usize = 512;
/// Corrections and their deviations are whole multiples of 1e-7 (gains: relative, offsets: rad). Half of that at 8
/// joints of a 5 m arm at the ends of their ranges moves the tool by less than 0.01 mm.
pub(crate) const STEPS: f64 = 1e7;
/// With terms of 1e-6, which leaves room for them; the tool of a 2 m arm moves by less than 0.02 mm.
pub(crate) const STEPS_WITH_TERMS: f64 = 1e6;
/// Predicted tool errors are whole micrometres.
pub(crate) const UM_PER_M: f64 = 1e6;
/// The largest correction, in steps: 10 times the datasheet's gain, 10 rad.
pub(crate) const MAX_STEPS: i64 = 99_999_999;
/// Digits of the messages' hash that are sent.
pub(crate) const HASH_DIGITS: usize = 12;
