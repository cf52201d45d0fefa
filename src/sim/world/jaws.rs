//! Gripper in step with the world: one motion per control period, and a message when the gap changes.

use crate::spec::CONTROL_PERIOD_S;
use crate::world::readings::SLOW_PERIODS;
use crate::world::simulation::World;
use armcal_core::streams::{ArmError, GripperSample, Message};

/// Number of periods between messages of the gap while the jaws move: 25 Hz.
const TOLD_EVERY: u64 = 4;
/// Resolution of the measured gap, m (assumed).
const RESOLUTION_M: f64 = 1e-4;

impl World {
    pub(super) fn tell_jaws(&mut self, opening: f64) -> Result<(), ArmError> {
        if !(0.0..=1.0).contains(&opening) {
            return Err(ArmError::Opening { opening });
        }
        self.gripper.as_mut().ok_or(ArmError::NoGripper)?.command(opening);
        Ok(())
    }

    /// Moves the jaws for a control period.
    pub(super) fn move_jaws(&mut self, period: u64) {
        let Some(jaws) = &mut self.gripper else { return };
        let was_moving = jaws.is_moving();
        jaws.step(CONTROL_PERIOD_S);
        // The slow streams send it in any case.
        if was_moving && period.is_multiple_of(TOLD_EVERY) && !period.is_multiple_of(SLOW_PERIODS) {
            self.report_gap();
        }
    }

    /// Moves the jaws to rest in a stride that is skipped.
    pub(super) fn settle_jaws(&mut self) {
        if let Some(jaws) = &mut self.gripper {
            jaws.arrive();
        }
    }

    pub(super) fn report_gap(&mut self) {
        let stamp = self.stamp();
        if let Some(jaws) = &self.gripper {
            let opening_m = (jaws.opening_m / RESOLUTION_M).round() * RESOLUTION_M;
            self.tell(stamp, Message::Gripper(GripperSample { stamp, opening_m }));
        }
    }
}
