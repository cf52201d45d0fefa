//! The online estimator against the batch and against known truths, on views drawn from the estimator's own model.

mod doubts;
mod drifting;
mod failing;
mod faults;
mod moving;
mod stationary;
mod view_stream;
