//! What happened to the arm, as the online belief tells it.

use serde::{Deserialize, Serialize};

use crate::calib::finding::{FindingKind, FindingUnit};
use crate::calib::online::diagnosis::Verdict;
use crate::calib::online::hypothesis::Fault;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// Something that happened, with the evidence for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OnlineEvent {
    /// End of the first view that shows it, ns since the epoch.
    pub since_nanos: i64,
    /// End of the view that decided it.
    pub decided_nanos: i64,
    /// What it is.
    pub kind: FindingKind,
    /// Joint or tag.
    pub name: String,
    /// In `unit`; absent where it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    /// Absent where there is no size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<FindingUnit>,
    /// `ln` of the odds against the next explanation.
    pub lead_nats: f64,
    /// The next explanation, where it is not that nothing happened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub or_else: Option<String>,
}

impl OnlineEvent {
    pub(crate) fn of_verdict(robot: &Robot, verdict: &Verdict, since: Stamp, now: Stamp) -> Self {
        let unit = match verdict.fault {
            Fault::Slip(_) | Fault::Mount => FindingUnit::Radian,
            Fault::Tag(_) | Fault::Base => FindingUnit::Metre,
            Fault::Scale(_) | Fault::Failed(_) | Fault::Drift => FindingUnit::One,
        };
        Self {
            since_nanos: since.nanos,
            decided_nanos: now.nanos,
            kind: verdict.fault.kind(),
            name: verdict.fault.name(robot),
            size: verdict.size,
            unit: verdict.size.map(|_| unit),
            // Nothing else is left to lead against.
            lead_nats: verdict.lead_nats.min(1e3),
            or_else: verdict.next.map(|fault| fault.name(robot)),
        }
    }

    /// One line for people.
    #[must_use]
    pub fn to_line(&self) -> String {
        let what = match self.kind {
            FindingKind::SensorSlip => "the sensor of {} slipped on its shaft",
            FindingKind::SensorScale => "the sensor of {} has another scale",
            FindingKind::SensorFailed => "the sensor of {} says nothing any more: the camera takes its place",
            FindingKind::TagMoved => "tag {} was moved",
            FindingKind::CameraMount => "the {} has moved",
            _ => "the {} or all tags have moved",
        };
        let mut line = what.replace("{}", &self.name);
        match (self.size, self.unit) {
            (Some(size), Some(FindingUnit::Radian)) => line += &format!(" by {:.2} deg", size.to_degrees()),
            (Some(size), Some(FindingUnit::Metre)) => line += &format!(" by {:.1} mm", 1e3 * size),
            (Some(size), Some(_)) => line += &format!(": {size:.3} of the believed one"),
            _ => {}
        }
        if let Some(other) = self.or_else.as_ref().filter(|_| self.lead_nats < 3.0) {
            line += &format!(" (or: {other})");
        }
        line
    }
}
