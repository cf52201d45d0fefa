//! `[world.physics]`.

use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, table};
use armcal_core::robot::FileIssue;

/// Length of a control period, s: the arm's own controller runs at 100 Hz.
pub(crate) const CONTROL_PERIOD_S: f64 = 0.01;

table!(
    /// Engine, integrator and rates of the truth's record.
    #[derive(Copy)]
    PhysicsSpec {
        /// Step of the rigid-body integration; a control period (10 ms) must be a whole number of steps.
        step_s = 0.002, in 5e-5..=0.005;
        /// Rate of the truth's states, at most that of the controller.
        truth_rate_hz = 50.0, in 5.0..=100.0;
        /// Rate at which the clearance is measured.
        clearance_rate_hz = 5.0, in 0.1..=100.0;
        /// Stiffness of two parts in contact (assumed: structure and hoses yield, not only steel), shared by their
        /// points of contact.
        contact_stiffness_n_m = 5e5, in 1e3..=1e9;
        /// Damping of a contact over its stiffness (assumed: it hardly rebounds).
        contact_damping_s = 0.01, in 0.0..=1.0;
        /// Coulomb friction of a contact (assumed: wet steel); viscous below 1 mm/s.
        contact_friction = 0.3, in 0.0..=2.0;
    }
    and {
        /// Engine that moves the arm; without it, that of `WorldSpec::engine`.
        #[serde(skip_serializing_if = "Option::is_none")]
        engine: Option<EngineKind> = None;
    }
);

/// Engines of rigid bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// Our own equations of motion, of second order in the step.
    Featherstone,
    /// Rapier's multibody, of first order; on a prescribed vehicle only.
    Rapier,
}

impl EngineKind {
    /// Returns the name as routines write it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Featherstone => "featherstone",
            Self::Rapier => "rapier",
        }
    }
}
