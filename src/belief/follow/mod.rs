//! ONLINE: the belief kept up through a dive, message by message.
//!
//! `view_stream` makes views of messages. `estimator` holds a `member` for each lag of the sensors' temperature; each
//! starts from the first views by `bundle` and carries its belief on: `filter` is state and information,
//! `process_noise` how fast sensors change. `diagnosis` races `hypothesis` against hypothesis where a view does not
//! fit, each with a `branch` of the belief; `hindsight` gathers what looks minutes apart say of one place of a sensor's
//! track; `event` tells what happened, `doubts` what speaks against all of it. `follower` is all of it, `belief_log` what it said over time; `oracle` and
//! `batch` are what it is compared with.

pub(crate) mod batch;
pub(crate) mod belief_log;
pub(crate) mod branch;
pub(crate) mod constants;
pub(crate) mod diagnosis;
pub(crate) mod doubts;
pub(crate) mod estimator;
pub(crate) mod event;
pub(crate) mod filter;
pub(crate) mod follower;
pub(crate) mod hindsight;
pub(crate) mod hypothesis;
pub(crate) mod image_noise;
pub(crate) mod lagged_temperature;
pub(crate) mod member;
pub(crate) mod oracle;
pub(crate) mod process_noise;
pub(crate) mod settings;
pub(crate) mod view_stream;

pub use batch::Batch;
pub use belief_log::{BeliefLine, BeliefLog};
pub use estimator::OnlineEstimator;
pub use event::OnlineEvent;
pub use follower::{BeliefRow, Follower};
pub use hypothesis::{Fault, TagSet};
pub use oracle::{Oracle, OracleGain};
pub use settings::{DriftModel, FaultSearch, OnlineSettings};
pub use view_stream::ViewStream;

#[cfg(test)]
mod tests;
