//! Events of the arm, as the online estimator reports them.

use crate::follow::constants::event::CLEAR_LEAD_NATS;
use serde::{Deserialize, Serialize};

use crate::follow::diagnosis::Verdict;
use crate::follow::hypothesis::Fault;
use crate::say;
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use armcal_core::codes::Coded;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// An event, with the evidence for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OnlineEvent {
    /// End of the first view that shows it, ns since the epoch.
    pub since_nanos: i64,
    /// End of the view that decided it, ns since the epoch.
    pub decided_nanos: i64,
    /// The finding. Its size is the displacement of a slipped sensor or a moved part, or the slope of the angle by the
    /// reading for a scale fault.
    pub finding: Finding,
    /// Joint angle by the datasheet at the middle of a worn spot, rad; absent for other findings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_rad: Option<f64>,
    /// Logarithm of the odds against the next hypothesis, nats.
    pub lead_nats: f64,
    /// The next hypothesis; absent if that is no fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub or_else: Option<String>,
}

impl OnlineEvent {
    pub(crate) fn of_verdict(robot: &Robot, verdict: &Verdict, since: Stamp, now: Stamp) -> Self {
        let unit = match verdict.fault {
            Fault::Slip(joint) | Fault::Worn(joint, ..) => FindingUnit::of_joint(robot.sensors[joint].moves),
            Fault::Mount => FindingUnit::Radian,
            Fault::Tag(_) | Fault::Tags(_) | Fault::Base => FindingUnit::Metre,
            Fault::Scale(_) | Fault::Failed(_) | Fault::Drift => FindingUnit::One,
        };
        let is_reversed = matches!(verdict.fault, Fault::Scale(_)) && verdict.size.is_some_and(|slope| slope < 0.0);
        let finding = Finding {
            kind: if is_reversed { FindingKind::SensorReversed } else { verdict.fault.kind() },
            name: verdict.fault.name(robot),
            size: verdict.size,
            unit: verdict.size.map(|_| unit),
            tool_error_m: None,
            time_s: None,
            repaired: true,
        };
        Self {
            since_nanos: since.nanos,
            decided_nanos: now.nanos,
            finding,
            at_rad: match verdict.fault {
                Fault::Worn(joint, spot) => Some(robot.sensors[joint].center_rad + spot.at_rad()),
                _ => None,
            },
            // No other hypothesis is left to compare with.
            lead_nats: verdict.lead_nats.min(1e3),
            or_else: verdict.next.map(|fault| fault.phrase(robot)),
        }
    }

    /// True if `other` is about the same joint or tag, and began before this was decided.
    pub(crate) fn covers(&self, other: &Self) -> bool {
        self.finding.name == other.finding.name && other.since_nanos <= self.decided_nanos
    }

    /// Returns the event as one line of text.
    #[must_use]
    pub fn to_line(&self) -> String {
        let mut line = say::event(&self.finding, self.at_rad);
        if let Some(other) = self.or_else.as_ref().filter(|_| self.lead_nats < CLEAR_LEAD_NATS) {
            line += &format!(" (or: {other})");
        }
        line + &format!(" [{}]", self.finding.code())
    }
}
