//! Every readable message of any MCAP file or ROS 2 bag, as bytes.
//!
//! A file may be whole, cut off at any byte, still being written, or hold flipped bits. Chunks that pass their checksum
//! are read; damaged ones are skipped and counted. Each length is checked against the file's size before its use. The
//! required memory is that of the largest chunk, not of the file; `limits` bounds the unpacked data. Chunks in another
//! order are read in the order of time, exact copies once. `bag` reads ROS 2 bags in SQLite files.

mod bag;
mod checksum;
mod chunk;
mod completeness;
mod contents;
mod file;
mod file_type;
mod limits;
mod message;
mod order;
mod record;
mod scan;
mod window;

#[cfg(test)]
mod tests;

pub use completeness::{Completeness, RawSummary};
pub use contents::{AttachmentInfo, ChunkTotals, FileContents};
pub use file::{FileIdentity, begin_growing, file_contents, for_each_raw, for_each_raw_twice, identity, of_scan};
pub use file_type::{ROS1_ADVICE, START_BYTES as FILE_START_BYTES, describe as describe_file};
pub use message::{Channel, RawMessage, Schema};
pub use order::ChunkOrder;
pub use scan::{GrowingScan, Growth};
