//! Files that replace others only once they are whole, and the folder of a run.

mod accepted;
mod beside;
mod files;
#[cfg(feature = "sim")]
mod folder;
mod lock;

#[cfg(feature = "sim")]
pub use accepted::AcceptedKept;
pub(crate) use accepted::accepted_kept;
#[cfg(feature = "viewer")]
pub(crate) use beside::Beside;
#[cfg(feature = "sim")]
pub(crate) use beside::write_whole;
pub(crate) use beside::{check_takes_files, check_writable, write_together};
pub use files::OutputError;
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(crate) use files::remove;
pub(crate) use files::{as_written, check_replaceable, make_folder, parent, refuse_link};
#[cfg(feature = "sim")]
pub(crate) use files::{complete, partial, with_suffix};
#[cfg(feature = "sim")]
pub use folder::OutputFolder;
pub(crate) use lock::FolderLock;
