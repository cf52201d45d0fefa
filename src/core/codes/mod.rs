//! One stable code for each error, refusal, warning and finding.
//!
//! `code.rs` lists the codes, `explanations.toml` says of each what causes it, what was measured, the remedy and the
//! page to read. The words of a message stand where it is made; scripts and tests go by the code.

mod code;
mod explanation;
mod warning;

pub use code::{Code, Coded, UnknownCode};
pub use explanation::{CodeKind, Explanation, explanation};
pub use warning::Warning;
