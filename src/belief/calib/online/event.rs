//! What happened to the arm, as the online belief tells it.

use serde::{Deserialize, Serialize};

use crate::calib::finding::{Finding, FindingKind, FindingUnit};
use crate::calib::online::diagnosis::Verdict;
use crate::calib::online::hypothesis::Fault;
use armcal_core::codes::Coded;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// An explanation that leads by less than this is told with the next one, in nats (odds of twenty).
const CLEAR_LEAD_NATS: f64 = 3.0;

/// Something that happened, with the evidence for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OnlineEvent {
    /// End of the first view that shows it, ns since the epoch.
    pub since_nanos: i64,
    /// End of the view that decided it.
    pub decided_nanos: i64,
    /// What it is; the size of a slip or of something moved is how far, that of a scale the slope of the angle by the
    /// reading.
    pub finding: Finding,
    /// Of a worn spot: the joint's angle at its middle by the datasheet, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_rad: Option<f64>,
    /// `ln` of the odds against the next explanation.
    pub lead_nats: f64,
    /// The next explanation, where it is not that nothing happened.
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
            // Nothing else is left to lead against.
            lead_nats: verdict.lead_nats.min(1e3),
            or_else: verdict.next.map(|fault| fault.phrase(robot)),
        }
    }

    /// Whether `other` is of the same thing, and began before this was decided.
    pub(crate) fn covers(&self, other: &Self) -> bool {
        self.finding.name == other.finding.name && other.since_nanos <= self.decided_nanos
    }

    /// One line for people.
    #[must_use]
    pub fn to_line(&self) -> String {
        let Finding { kind, name, size, .. } = &self.finding;
        let size = size.unwrap_or(f64::NAN);
        let mut line = match kind {
            FindingKind::SensorSlip => {
                format!("the sensor of {name} slipped on its shaft by {:.2} deg", size.to_degrees())
            }
            FindingKind::SensorScale => {
                format!("the sensor of {name} has another scale: the angle is {size:.3} of the datasheet angle")
            }
            FindingKind::SensorReversed => {
                format!("the sensor of {name} is reversed ({size:.3} of the datasheet angle)")
            }
            FindingKind::SensorFailed => {
                format!("the sensor of {name} failed: only views determine its angle")
            }
            FindingKind::SensorWorn => {
                let at_deg = self.at_rad.unwrap_or(f64::NAN).to_degrees();
                format!(
                    "the sensor of {name} is worn near {at_deg:.1} deg: it reads {:.2} deg more there",
                    size.to_degrees()
                )
            }
            FindingKind::TagMoved => format!("tag {name} was moved by {:.1} mm", 1e3 * size),
            FindingKind::TagsMoved => format!("tags {name} were moved together by {:.1} mm", 1e3 * size),
            FindingKind::CameraMount => format!("the camera turned on its mount by {:.2} deg", size.to_degrees()),
            _ => format!("the {name} or all tags moved by {:.1} mm", 1e3 * size),
        };
        if let Some(other) = self.or_else.as_ref().filter(|_| self.lead_nats < CLEAR_LEAD_NATS) {
            line += &format!(" (or: {other})");
        }
        line + &format!(" [{}]", self.finding.code())
    }
}
