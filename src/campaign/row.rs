//! One run as one line of a table.

/// Ending of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunStatus {
    Accepted,
    /// The calibration was accepted, but an `assert` of the routine does not hold.
    Missed,
    /// The calibration was refused; `failure` has the reason.
    Refused,
    /// The run has no result.
    Failed,
}

impl RunStatus {
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Missed => "missed",
            Self::Refused => "refused",
            Self::Failed => "failed",
        }
    }

    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        [Self::Accepted, Self::Missed, Self::Refused, Self::Failed].into_iter().find(|status| status.name() == name)
    }
}

/// Results of a run. Its texts hold no line breaks, so a row is a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Index of the matrix point; `settings` is the point as text.
    pub setting: u32,
    pub settings: String,
    pub seed: u64,
    pub status: RunStatus,
    /// Exit code that `armcal run` would have returned.
    pub exit_code: u8,
    /// Stage that a failed run reached; empty for others.
    pub stage: String,
    /// Reason of the failure or refusal; empty for an accepted run.
    pub failure: String,
    /// Command that repeats the run.
    pub command: String,
    /// Figures in the order of the table's columns.
    pub figures: Vec<Option<f64>>,
}

impl Row {
    /// Setting and seed, by which rows are sorted and identified.
    #[must_use]
    pub fn key(&self) -> (u32, u64) {
        (self.setting, self.seed)
    }
}

/// The text on one line.
pub(super) fn one_line(text: &str) -> String {
    text.split(['\n', '\r']).map(str::trim).filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}
