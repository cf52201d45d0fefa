//! A run in simulation: the world, and the score against its truth.

use super::execution::{Run, Source, assert_summary};
use crate::report::{RunSummary, WorldSummary};
use crate::run::{Failure, Finished, RunError, RunInputs, RunOutput, Stage};
use crate::score::{ScoreInput, score};
use armcal_belief::session::{MessageListener, Outcome, Progress};
use armcal_core::log::Recording;
use armcal_sim::truth::TruthRecorder;
use armcal_sim::{World, WorldInput};

/// Runs the closed loop with `seed` and scores it. The watcher's clock must start with the command: its reading at the
/// end is the summary's `wall_s`. Results come into place all at once at the end, if they are kept.
///
/// # Errors
/// [`Failure`] with the stage, and the current path of the recording. It stays readable if the loop is interrupted.
pub fn execute(
    inputs: &RunInputs,
    seed: u64,
    output: RunOutput<'_>,
    progress: &mut dyn Progress,
) -> Result<Finished, Failure> {
    let RunOutput { folder, keep, listener } = output;
    let run = Run { inputs, seed, output: folder, keep, source: Source::World };
    run.simulated(listener, progress).map_err(|failure| run.broken_off(failure))
}

impl Run<'_> {
    fn simulated(&self, listener: Option<MessageListener>, progress: &mut dyn Progress) -> Result<Finished, Failure> {
        let mut world = self.world().map_err(Failure::at(Stage::World))?;
        let driven = self.drive(&mut world, listener, progress);
        let finished = world.finish_truth();
        let (outcome, recorder) = driven?;
        finished.map_err(Failure::at(Stage::Motion))?;
        self.keep_all(outcome, recorder, progress)
    }

    fn world(&self) -> Result<World, RunError> {
        let inputs = self.inputs;
        let mut world = World::new(WorldInput {
            robot: &inputs.robot,
            vehicle: &inputs.vehicle,
            scene: &inputs.routine.scene,
            spec: inputs.spec.clone(),
            seed: self.seed,
        })?;
        let truth = TruthRecorder::create(self.partial("truth.mcap"))?;
        world.set_truth_sink(Box::new(truth))?;
        Ok(world)
    }

    /// Adds the figures that need the truth.
    pub(super) fn add_score(
        &self,
        summary: &mut RunSummary,
        outcome: &Outcome,
        recording: &Recording,
    ) -> Result<(), RunError> {
        let truth = self.partial("truth.mcap");
        let scored = score(&ScoreInput {
            recording,
            truth: &truth,
            robot: &self.inputs.robot,
            outcome,
            tolerance_m: self.inputs.routine.task.tolerance_m,
        })?;
        summary.world = Some(WorldSummary { engine: self.inputs.spec.engine().name().to_owned() });
        summary.asserts = scored.asserts.iter().map(assert_summary).collect();
        summary.capture.collisions = Some(scored.collisions);
        summary.capture.min_clearance_m = scored.min_clearance_m;
        summary.capture.margins = scored.margins;
        summary.score = Some(scored.score);
        Ok(())
    }
}
