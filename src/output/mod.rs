//! Files that replace others only once they are complete, and the folder of a run.

mod accepted;
mod beside;
mod files;
#[cfg(feature = "closed-loop")]
mod folder;
mod lock;

#[cfg(feature = "closed-loop")]
pub use accepted::AcceptedKept;
pub(crate) use accepted::accepted_kept;
#[cfg(feature = "viewer")]
pub(crate) use beside::Beside;
pub use beside::check_takes_files;
pub(crate) use beside::check_writable;
pub use beside::write_together;
#[cfg(feature = "sim")]
pub(crate) use beside::write_whole;
pub use files::OutputError;
pub use files::make_folder;
#[cfg(any(feature = "closed-loop", feature = "viewer"))]
pub use files::remove;
#[cfg(feature = "sim")]
pub(crate) use files::with_suffix;
pub(crate) use files::{as_written, check_replaceable, parent, refuse_link};
#[cfg(feature = "closed-loop")]
pub(crate) use files::{complete, partial};
#[cfg(feature = "closed-loop")]
pub use folder::OutputFolder;
#[cfg(feature = "closed-loop")]
pub(crate) use folder::RESULTS;
pub(crate) use lock::FolderLock;
