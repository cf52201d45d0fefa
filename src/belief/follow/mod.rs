//! ONLINE: the estimate kept up to date during a dive, message by message.
//!
//! `view_stream` makes views of messages. `estimator` holds a `member` for each lag of the sensors' temperature. Each
//! starts from the first views by `bundle` and continues with a filter: `filter` is state and information,
//! `process_noise` the rate of sensor changes. If a view does not fit, `diagnosis` races each `hypothesis` with its own
//! `branch` of the belief. `hindsight` adds up scores of views that lie minutes apart. `event` reports the result, and
//! `doubts` lists reasons not to rely on any of it.
//! `follower` combines all of it, and `belief_log` records its reports; `oracle` and `batch` are references for
//! comparison.

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
