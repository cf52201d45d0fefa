//! Files that replace others only once they are whole, and the folder of a run.

mod files;
#[cfg(feature = "sim")]
mod folder;

pub use files::OutputError;
#[cfg(feature = "sim")]
pub(crate) use files::complete;
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(crate) use files::{check_replaceable, check_writable, parent, partial, with_suffix, write_whole};
pub(crate) use files::{make_folder, write_together};
#[cfg(feature = "sim")]
pub use folder::OutputFolder;
