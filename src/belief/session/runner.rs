//! State of a script that is carried out.

use std::rc::Rc;

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;

use crate::file::calibration::Calibration;
use crate::plan::{ClearanceModel, JointErrorBounds, PosePlan};
use crate::session::held_joint::StandingJoint;
use crate::session::inputs::SessionInputs;
use crate::session::motion::Driver;
use crate::session::online_belief::AskedPoses;
use crate::session::outcome::{AssertResult, Epoch, EstimateUpdate, ReachStep, SkippedTarget, StillReachable, Visit};
use crate::solve::covariance::ParameterCovariance;
use armcal_core::kinematics::Chain;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::JointAngles;
use armcal_core::time::Stamp;

/// Counts of a run.
#[derive(Default)]
pub(crate) struct Tally {
    pub poses: usize,
    pub poses_skipped: usize,
    pub skipped_targets: Vec<SkippedTarget>,
    pub calibration_wall_s: f64,
}

/// Bounds of a calibration, and when and how warm it was.
pub(crate) struct FreshBounds {
    pub bounds: JointErrorBounds,
    pub at: Stamp,
    pub oil_c: Option<f64>,
}

/// The arm among what surrounds it, by its jaws.
pub(crate) struct Jaws<'a> {
    pub at_rest: Rc<ClearanceModel<'a>>,
    pub open: Rc<ClearanceModel<'a>>,
}

impl<'a> Jaws<'a> {
    /// Of an arm that may bend as far as `chain` can.
    pub(crate) fn new(setup: &SessionInputs<'a>, chain: &Chain) -> Self {
        let model = || ClearanceModel::new(setup.robot, setup.vehicle, &setup.routine.scene).with_sag(chain);
        Self { at_rest: Rc::new(model()), open: Rc::new(model().with_open_jaws()) }
    }
}

pub(crate) struct ScriptRunner<'a, 'b> {
    pub setup: &'a SessionInputs<'a>,
    /// With the sensor scales that were measured on the way.
    pub robot: Robot,
    /// How wrong the sensors believed in may be by now.
    pub bounds: JointErrorBounds,
    /// And how wrong they were when they were new: none for a datasheet's, which hold for good.
    pub fresh: Option<FreshBounds>,
    /// While views are being captured: what was believed before.
    pub before_running: Option<SavedBelief>,
    pub rng: ChaCha8Rng,
    /// With the jaws as they are now.
    pub clearance: Rc<ClearanceModel<'a>>,
    pub jaws: Jaws<'a>,
    pub driver: Driver<'b>,
    pub planned: Option<Planned>,
    /// Views captured from here on are of the arm as it is.
    pub began: Stamp,
    /// Views captured from here on have been in no calibration.
    pub views_since: Stamp,
    /// Normals of the surfaces that were touched, axes of the tool's link.
    pub touched: Vec<Vector3<f64>>,
    /// Views marked so far; numbers them.
    pub poses_marked: u32,
    pub calibration: Option<Calibration>,
    /// The last one that was accepted.
    pub accepted: Option<Calibration>,
    /// Captured views and what was believed there.
    pub visits: Vec<Visit>,
    pub renewals: Vec<EstimateUpdate>,
    pub capture_ended: Option<String>,
    pub tally: Tally,
    pub epochs: Vec<Epoch>,
    pub reaches: Vec<ReachStep>,
    pub asserts: Vec<AssertResult>,
    /// Joints that were given up, of which belief and plans know.
    pub n_held: usize,
    /// By the last reach with a joint that was given up.
    pub still_reachable: Option<StillReachable>,
    /// How many of the joints that were given up were looked for at work, and those found standing still.
    pub n_looked_for: usize,
    pub standing: Vec<StandingJoint>,
    /// What is known of the sensors, while the online belief asks for calibration poses.
    pub known: Option<ParameterCovariance>,
    /// Calibration poses that the online belief asked for.
    pub asked: Vec<AskedPoses>,
}

/// What was planned before anything moved.
pub(crate) struct Planned {
    /// Believed angles at each of the task's targets.
    pub targets: Vec<JointAngles>,
    /// For the first capture, if the sensors are still believed to be the datasheet's by then.
    pub first_capture: Option<PosePlan>,
}

/// The belief before the first interim estimate of a capture.
pub(crate) struct SavedBelief {
    pub sensors: ArmSensors,
    pub bounds: JointErrorBounds,
    pub fresh: Option<FreshBounds>,
}
