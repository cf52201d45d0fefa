//! Blocks: parameters that move together, in addition to those of the joints.
//!
//! Each block has a file with its nominal value, the standard deviation of that and its name; `value` applies a step. A
//! new block needs a file, and a variant and a line in each function of `list`; everything else iterates.

mod clock;
mod gripper_tag;
mod lens;
mod list;
mod mount;
mod per_block;
mod tag;
mod value;

pub use list::Block;
pub(crate) use list::Shown;
pub(crate) use per_block::PerBlock;
pub(crate) use value::{MAX_COLUMNS, Std, Value, six};
