//! State of a running script.

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

/// Bounds of a calibration, with its time and oil temperature.
pub(crate) struct FreshBounds {
    pub bounds: JointErrorBounds,
    pub at: Stamp,
    pub oil_c: Option<f64>,
}

/// Clearance models of the arm, by its jaws.
pub(crate) struct Jaws<'a> {
    pub at_rest: Rc<ClearanceModel<'a>>,
    pub open: Rc<ClearanceModel<'a>>,
}

impl<'a> Jaws<'a> {
    /// Returns the models of an arm that may sag as far as `chain` can.
    pub(crate) fn new(setup: &SessionInputs<'a>, chain: &Chain) -> Self {
        let model = || ClearanceModel::new(setup.robot, setup.vehicle, &setup.routine.scene).with_sag(chain);
        Self { at_rest: Rc::new(model()), open: Rc::new(model().with_open_jaws()) }
    }
}

pub(crate) struct ScriptRunner<'a, 'b> {
    pub setup: &'a SessionInputs<'a>,
    /// Nominal robot with the sensor scales measured during the run.
    pub robot: Robot,
    /// Present error bounds of the believed sensors.
    pub bounds: JointErrorBounds,
    /// Error bounds of the last calibration; `None` for the datasheet's, which do not age.
    pub fresh: Option<FreshBounds>,
    /// Belief before the capture, while views are captured.
    pub before_running: Option<SavedBelief>,
    pub rng: ChaCha8Rng,
    /// Clearance model with the jaws as they are now.
    pub clearance: Rc<ClearanceModel<'a>>,
    pub jaws: Jaws<'a>,
    pub driver: Driver<'b>,
    pub planned: Option<Planned>,
    /// Time from which on captured views show the present arm.
    pub began: Stamp,
    /// Time from which on captured views have been in no calibration.
    pub views_since: Stamp,
    /// Normals of the touched surfaces, in axes of the tool's link.
    pub touched: Vec<Vector3<f64>>,
    /// Number of views marked so far, which numbers the next one.
    pub poses_marked: u32,
    pub calibration: Option<Calibration>,
    /// The last accepted calibration.
    pub accepted: Option<Calibration>,
    /// Captured views, with the belief at each.
    pub visits: Vec<Visit>,
    pub renewals: Vec<EstimateUpdate>,
    pub capture_ended: Option<String>,
    pub tally: Tally,
    pub epochs: Vec<Epoch>,
    pub reaches: Vec<ReachStep>,
    pub asserts: Vec<AssertResult>,
    /// Number of held joints that belief and plans include.
    pub n_held: usize,
    /// Targets still reachable by the last reach with a held joint.
    pub still_reachable: Option<StillReachable>,
    /// Number of held joints that were searched at work, and the joints found standing still.
    pub n_looked_for: usize,
    pub standing: Vec<StandingJoint>,
    /// Present covariance of the sensors, while the online estimate requests calibration poses.
    pub known: Option<ParameterCovariance>,
    /// Calibration poses that the online estimate requested.
    pub asked: Vec<AskedPoses>,
}

/// Plans made before any motion.
pub(crate) struct Planned {
    /// Believed angles at each of the task's targets.
    pub targets: Vec<JointAngles>,
    /// View plan of the first capture, valid if the belief is still the datasheet's by then.
    pub first_capture: Option<PosePlan>,
}

/// The belief before the first interim estimate of a capture.
pub(crate) struct SavedBelief {
    pub sensors: ArmSensors,
    pub bounds: JointErrorBounds,
    pub fresh: Option<FreshBounds>,
}
