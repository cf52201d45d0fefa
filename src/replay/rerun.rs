//! The parts of Rerun's SDK that are used, under the names of its crate `rerun`. That crate and `re_sdk` bring 93
//! further crates: a client of its servers, a store of recordings, readers of other formats and telemetry.

pub(crate) use re_build_info::CrateVersion;
pub(crate) use re_log_types::{EntityPath, StoreId, StoreKind};
pub(crate) use re_sdk_types::archetypes::*;
pub(crate) use re_sdk_types::components::{self, FillMode, Radius, TextLogLevel};
pub(crate) use re_sdk_types::datatypes::{Quaternion, Rgba32};
pub(crate) use re_sdk_types::{AsComponents, SerializedComponentBatch};
#[cfg(test)]
pub(crate) use re_sdk_types::{Component, ComponentDescriptor};

pub(crate) mod log {
    pub(crate) use re_chunk::{Chunk, ChunkId, RowId, TimeColumn};
    pub(crate) use re_log_types::LogMsg;
}
pub(crate) mod time {
    pub(crate) use re_log_types::{TimeCell, TimePoint, Timeline};
}
