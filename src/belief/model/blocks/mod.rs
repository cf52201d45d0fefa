//! Blocks: parameters that move together, next to those of the joints.
//!
//! Each has a file with what the drawing says of it, how well, and its name; `value` is what a step does to it. A new
//! block is a file, and in `block` a variant and a line in each function; everything else iterates.

mod block;
mod clock;
mod gripper_tag;
mod lens;
mod mount;
mod per_block;
mod tag;
mod value;

pub use block::Block;
pub(crate) use block::Shown;
pub(crate) use per_block::PerBlock;
pub(crate) use value::{MAX_COLUMNS, Std, Value, six};
