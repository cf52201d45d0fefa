//! One stable code for each error, refusal, warning and finding.
//!
//! `code.rs` lists the codes. `explanations.toml` gives the cause, measured quantity, remedy and page of each. The
//! words of a message stand where it is made; scripts and tests go by the code.

mod code;
mod explanation;
mod warning;

pub use code::{Code, Coded, UnknownCode};
pub use explanation::{CodeKind, Explanation, explanation};
pub use warning::Warning;
