//! One run in one line.

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunStatus {
    Accepted,
    /// The calibration was accepted, but an `assert` of the routine does not hold.
    Missed,
    /// The calibration was refused; the figures say why.
    Refused,
    /// There is no result.
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

/// What a run gave. Its texts hold no line breaks, so a row is a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Index of the matrix point, and the point itself as text.
    pub setting: u32,
    pub settings: String,
    pub seed: u64,
    pub status: RunStatus,
    /// What `armcal run` would have exited with.
    pub exit_code: u8,
    /// How far a failed run came; empty for others.
    pub stage: String,
    /// Why it failed or was refused; empty where accepted.
    pub failure: String,
    /// Repeats the run.
    pub command: String,
    /// In the order of the table's figures.
    pub figures: Vec<Option<f64>>,
}

impl Row {
    /// Rows are sorted and told apart by this.
    #[must_use]
    pub fn key(&self) -> (u32, u64) {
        (self.setting, self.seed)
    }
}

/// `text` on one line.
pub(super) fn one_line(text: &str) -> String {
    text.split(['\n', '\r']).map(str::trim).filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}
