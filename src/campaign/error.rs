//! Errors that keep a campaign from being run, continued or merged. A failed run is none of these: it is a row.

use armcal_core::codes::{Code, Coded};
use std::path::PathBuf;

use crate::campaign::Shard;
use crate::output::OutputError;
use crate::run::RunError;
use armcal_core::routine::RoutineError;

/// Reason that a campaign did not start, or could not keep its rows.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    #[error("{0}")]
    Routine(#[from] RoutineError),
    #[error("{0}")]
    Input(#[from] RunError),
    #[error("{}: cannot be read: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: {problem}", path.display())]
    Table { path: PathBuf, problem: String },
    #[error(
        "{}: these rows are of another campaign: routine, overrides, robot, vehicle or program have changed since; \
         --fresh throws them away and begins anew, --out keeps them and writes elsewhere",
        path.display()
    )]
    OtherCampaign { path: PathBuf },
    #[error("{}: another campaign is writing to it at this moment", path.display())]
    Busy { path: PathBuf },
    #[error("{}: the row of setting {setting}, seed {seed} is not the same in both files", path.display())]
    Conflict { path: PathBuf, setting: u32, seed: u64 },
    #[error("{}: this campaign is not at its end; the command that began it goes on with it", path.display())]
    Unfinished { path: PathBuf },
    #[error(
        "{} has no table: name it, or run the command of the shard again; --allow-missing merges without it",
        listed(shards)
    )]
    MissingShards { shards: Vec<Shard> },
    #[error("seed {seed}: {source}; the rows before are kept, and the same command goes on from there")]
    Machine { seed: u64, source: Box<RunError> },
    #[error("{0}")]
    Usage(String),
    #[error("{0}")]
    Output(#[from] OutputError),
    #[cfg(feature = "parquet")]
    #[error("{}: cannot be written: {source}", path.display())]
    Parquet { path: PathBuf, source: parquet::errors::ParquetError },
    #[error("the summary has no text: {0}")]
    Json(#[from] serde_json::Error),
    #[error("no threads can be made: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// "shard 2/8" or "shards 2/8, 5/8".
fn listed(shards: &[Shard]) -> String {
    let names: Vec<String> = shards.iter().map(Shard::to_string).collect();
    format!("shard{} {}", if names.len() == 1 { "" } else { "s" }, names.join(", "))
}

impl CampaignError {
    /// True if the user's input is at fault, not the machine. For [`Self::Input`] the source decides.
    #[must_use]
    pub fn is_invalid_input(&self) -> bool {
        #[cfg(feature = "parquet")]
        if matches!(self, Self::Parquet { .. }) {
            return false;
        }
        !matches!(self, Self::Output(_) | Self::Machine { .. } | Self::Input(_) | Self::Json(_) | Self::Threads(_))
    }
}

impl Coded for CampaignError {
    fn code(&self) -> Code {
        match self {
            Self::Routine(error) => error.code(),
            Self::Input(error) => error.code(),
            Self::Read { .. } => Code::FileUnreadable,
            Self::Table { .. } => Code::TableInvalid,
            Self::OtherCampaign { .. } | Self::Conflict { .. } => Code::CampaignChanged,
            Self::Busy { .. } => Code::CampaignBusy,
            Self::Unfinished { .. } | Self::MissingShards { .. } => Code::CampaignIncomplete,
            Self::Machine { source, .. } => source.code(),
            Self::Usage(_) => Code::UsageInvalid,
            Self::Output(error) => error.code(),
            #[cfg(feature = "parquet")]
            Self::Parquet { .. } => Code::FileUnwritable,
            Self::Json(_) | Self::Threads(_) => Code::Internal,
        }
    }
}
