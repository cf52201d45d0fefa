//! Files that replace others only once they are whole, and the folder of a run.

mod files;
#[cfg(feature = "sim")]
mod folder;

pub use files::OutputError;
#[cfg(feature = "sim")]
pub(crate) use files::complete;
pub(crate) use files::{check_replaceable, make_folder, parent, write_together};
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(crate) use files::{partial, with_suffix, write_whole};
#[cfg(feature = "sim")]
pub use folder::OutputFolder;
