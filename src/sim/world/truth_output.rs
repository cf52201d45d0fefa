//! Stream of a world's truth: states, clearances and contacts.

use crate::clearance_watch::ClearanceWatch;
use crate::error::SimError;
use crate::pair_motion::ArmPlace;
use crate::spec::CONTROL_PERIOD_S;
use crate::truth::{TruthClearance, TruthContact, TruthSink, TruthState};
use crate::world::simulation::World;
use armcal_core::spatial::Pose;
use armcal_core::streams::ArmError;
use armcal_core::time::SIMULATION_EPOCH;

impl World {
    /// Sends the truth to `sink` from now on.
    ///
    /// # Errors
    /// [`SimError::Truth`] when the sink refuses.
    pub fn set_truth_sink(&mut self, mut sink: Box<dyn TruthSink>) -> Result<(), SimError> {
        sink.begin(&self.header).map_err(SimError::Truth)?;
        self.truth = Some(sink);
        let place = self.arm_place();
        self.clearance = Some(ClearanceWatch::new(&self.robot.chain, &self.solids, &place));
        Ok(())
    }

    /// Ends the truth's stream, if there is one.
    ///
    /// # Errors
    /// [`SimError::Truth`] when the sink cannot store the truth.
    pub fn finish_truth(&mut self) -> Result<(), SimError> {
        self.truth.take().map_or(Ok(()), |sink| sink.finish().map_err(SimError::Truth))
    }

    pub(super) fn watch_contacts(&mut self) -> Result<(), ArmError> {
        let stamp = self.stamp();
        let began = self.contacts.update(&self.physics, self.step);
        let Some(truth) = &mut self.truth else { return Ok(()) };
        for &(a, b) in began {
            let name = |part| self.solids.part_name(part).to_owned();
            let contact = TruthContact { stamp, part_a: name(a), part_b: name(b) };
            truth.contact(&contact).map_err(ArmError::Sink)?;
        }
        Ok(())
    }

    fn arm_place(&self) -> ArmPlace {
        ArmPlace {
            angles: self.physics.angles(),
            base_from_ground: *self.base.world_from_base.inverse().isometry(),
            first_place: self.structure.first_place(),
        }
    }

    pub(super) fn watch_clearance(&mut self) {
        let place = self.arm_place();
        let Self { clearance: Some(watch), solids, physics, step, .. } = self else { return };
        watch.follow(solids, &place, *step, || physics.poses());
    }

    pub(super) fn record_truth(&mut self) -> Result<(), ArmError> {
        if self.truth.is_none() {
            return Ok(());
        }
        let period = self.step / self.spec.steps_per_period();
        let is_due = |rate_hz: f64| period.is_multiple_of(periods_between(rate_hz));
        if is_due(self.spec.physics.truth_rate_hz) {
            let state = self.truth_state();
            if let Some(truth) = &mut self.truth {
                truth.state(&state).map_err(ArmError::Sink)?;
            }
        }
        if is_due(self.spec.physics.clearance_rate_hz) {
            self.place_solids();
            let sampled = self.solids.nearest().map(|nearest| (nearest, self.step));
            // Least of all steps since the last sample, if nothing was nearer before.
            let low = self.clearance.as_mut().zip(sampled).and_then(|(watch, (now, _))| watch.take_low(now.distance_m));
            if let (Some((nearest, step)), Some(truth)) = (low.or(sampled), &mut self.truth) {
                let stamp = SIMULATION_EPOCH.plus_s(self.spec.time_s(step));
                let name = |part| self.solids.part_name(part).to_owned();
                let (part_a, part_b) = (name(nearest.part_a), name(nearest.part_b));
                let clearance = TruthClearance { stamp, distance_m: nearest.distance_m, part_a, part_b };
                truth.clearance(&clearance).map_err(ArmError::Sink)?;
            }
        }
        Ok(())
    }

    pub(super) fn truth_state(&self) -> TruthState {
        let (angles, rates) = (self.physics.angles(), self.physics.rates());
        let (shaft_angles, shaft_rates) = self.shafts();
        let links = self.physics.poses();
        let t_s = self.time_s();
        TruthState {
            stamp: self.stamp(),
            angles,
            rates,
            torques: self.hydraulics.torques(&shaft_angles, &shaft_rates),
            // The engine's raw poses get their frames here: the tool and the camera in the base frame.
            base_from_tool: Pose::from_isometry(links.frame(&self.robot.tool.mount)),
            base_from_camera: Pose::from_isometry(self.camera.base_from_camera(&links)),
            world_from_vehicle: self.base.world_from_vehicle,
            oil_c: self.temperatures.oil_c(t_s),
            water_c: self.temperatures.water_c(t_s),
        }
    }
}

/// Returns the whole number of control periods between samples of about `rate_hz`.
fn periods_between(rate_hz: f64) -> u64 {
    (1.0 / (rate_hz * CONTROL_PERIOD_S)).round().max(1.0) as u64
}
