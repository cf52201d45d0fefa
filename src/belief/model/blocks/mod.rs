//! Blocks: parameters that move together, next to those of the joints.
//!
//! Each has a file with what the drawing says of it, how well, and its name; `value` is what a step does to it. A new
//! block is a file, and in `list` a variant and a line in each function; everything else iterates.

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
