//! `--live`: shows the run in a Rerun viewer that is already open.

use anyhow::Result;
use clap::Args;

#[cfg(feature = "viewer")]
mod open;
#[cfg(feature = "viewer")]
pub(super) use open::OpenView;
#[cfg(not(feature = "viewer"))]
pub(super) use unopened::OpenView;

use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;

#[derive(Debug, Args)]
pub(super) struct LiveViewArgs {
    /// Show the run in the Rerun viewer at HOST:PORT; default: 127.0.0.1:9876
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, require_equals = true)]
    #[arg(default_missing_value = "127.0.0.1:9876")]
    pub live: Option<String>,
}

/// Objects that the view draws in addition to the messages.
#[cfg_attr(not(feature = "viewer"), expect(dead_code, reason = "nothing is drawn"))]
pub(super) struct ViewOf<'a> {
    pub robot: &'a Robot,
    pub vehicle: Option<&'a Vehicle>,
    pub scene: Option<&'a Scene>,
}

impl LiveViewArgs {
    /// Begins to search for the viewer, if one was requested.
    pub fn open(&self, of: &ViewOf<'_>) -> Result<Option<OpenView>> {
        self.live.as_deref().map(|address| OpenView::open(address, of)).transpose()
    }
}

/// Replacement in builds without the viewer.
#[cfg(not(feature = "viewer"))]
mod unopened {
    use std::time::Duration;

    use super::ViewOf;
    use crate::cli::exit::UsageError;
    use armcal_belief::session::MessageListener;
    use armcal_core::codes::Code;

    /// A view that cannot exist.
    pub enum OpenView {}

    impl OpenView {
        pub fn open(_: &str, _: &ViewOf<'_>) -> anyhow::Result<Self> {
            let problem = "this build of armcal knows no viewer; build it with `--features viewer`";
            Err(UsageError::new(Code::UsageInvalid, format!("--live: {problem}")).into())
        }

        pub fn listener(&self, _: Duration) -> MessageListener {
            match *self {}
        }

        pub fn end(self) {
            match self {}
        }
    }
}
