//! Error of the study.

use armcal_belief::session::SessionError;
use armcal_sim::SimError;

/// Reason that the study has no result.
#[derive(Debug, thiserror::Error)]
pub enum FalsifiedError {
    #[error("{0}")]
    Scene(String),
    #[error("{what}: {problem}")]
    File { what: &'static str, problem: String },
    #[error("seed {seed}: {n} touches were recorded, the cases have {n_touches}")]
    Touches { seed: u64, n: usize, n_touches: usize },
    #[error(transparent)]
    World(#[from] SimError),
    #[error(transparent)]
    Session(#[from] SessionError),
}

impl FalsifiedError {
    pub(super) fn of<E: std::fmt::Display>(what: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::File { what, problem: error.to_string() }
    }
}
