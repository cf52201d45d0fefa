//! Many runs of one routine: seeds times settings, one row of figures per run.
//!
//! `Prepared` holds the settings' checked inputs, `jobs` lists the runs, `run_jobs` runs them on some threads. `Store`
//! keeps every finished row at once and puts the sorted files in place at the end. `until` ends a campaign once a rate
//! is known, `merge` merges shards, `statistics` summarises rows. `regress` compares rows with those of a baseline,
//! pair by pair. Rows hold no wall time: files do not depend on the number of threads, nor on interruptions of the
//! campaign. The command line provides the exit codes.

mod baseline;
mod columns;
mod engine;
mod error;
mod fingerprint;
mod html;
mod jobs;
mod matrix;
mod merge;
mod metric;
mod origin;
#[cfg(feature = "parquet")]
mod parquet_file;
mod regress;
mod regress_report;
mod row;
mod shard;
mod single;
mod statistics;
mod store;
mod table_file;
mod tables;
mod until;
mod weights;
mod worst;

pub use baseline::{baseline_text, read_baseline, read_rows};
pub use columns::Columns;
pub use engine::{Engine, run_jobs};
pub use error::CampaignError;
pub use fingerprint::fingerprint;
pub use html::regress_page;
pub use jobs::{Job, Prepared, Request, jobs};
pub use matrix::{Setting, settings};
pub use merge::{MissingShards, merge};
pub use metric::{Metric, Worsening};
pub use origin::Origin;
pub use regress::{Comparison, Verdict, compare};
pub use regress_report::{Undecided, regress_junit, regress_markdown, regress_table};
pub use row::{Row, RunStatus};
pub use shard::{Shard, Share};
pub use single::{SingleRun, run_job};
pub use statistics::{CampaignSummary, FigureStatistics, SettingStatistics, statistics};
pub use store::{ExistingRows, Store, write_results};
pub(crate) use table_file::parse_table;
pub use table_file::{Table, read_table, table_text};
pub use tables::{markdown, table};
pub use until::{Answer, MetSeed, Stopping, Until, UntilResult};
pub use weights::{MixedRate, Weights};
pub use worst::worst_rows;
