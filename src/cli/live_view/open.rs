//! An open view of a run, and its end.

use armcal_core::codes::Code;
use std::time::Duration;

use anyhow::Result;

use super::ViewOf;
use crate::cli::exit::UsageError;
use crate::cli::stdout::warn;
use armcal_belief::session::MessageListener;
use armcal_replay::{LiveDrawings, LiveView, LiveViewEnd};

/// A view of a running run.
pub struct OpenView {
    view: LiveView,
    address: String,
}

impl OpenView {
    pub fn open(address: &str, of: &ViewOf<'_>) -> Result<Self> {
        let drawings = LiveDrawings { robot: of.robot.clone(), vehicle: of.vehicle.cloned(), scene: of.scene.cloned() };
        let view = LiveView::open(drawings, address)
            .map_err(|error| UsageError::new(Code::UsageInvalid, format!("--live: {error}")))?;
        Ok(Self { view, address: address.to_owned() })
    }

    /// Listener that takes messages; it waits in total at most `patience` for a viewer that is too slow.
    pub fn listener(&self, patience: Duration) -> MessageListener {
        Box::new(self.view.listener(patience))
    }

    /// Ends the view, and reports once the messages that were not shown.
    pub fn end(self) {
        let Self { view, address } = self;
        let LiveViewEnd { was_seen, was_taken, left_out, failure } = view.end();
        if let Some(why) = failure {
            warn(Code::ViewerLost, format_args!("--live ended early: {why}"));
        } else if !was_seen {
            let remedy = "start one before with `rerun --bind 127.0.0.1`";
            warn(Code::ViewerLost, format_args!("--live: no viewer listened at {address}; {remedy}"));
        } else if left_out > 0 {
            warn(Code::ViewerLost, format_args!("--live: the viewer was too slow: {left_out} messages were not shown"));
        } else if !was_taken {
            warn(Code::ViewerLost, "--live: the viewer went away, or was too slow for the end");
        }
    }
}
