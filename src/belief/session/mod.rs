//! Sessions: a routine's script carried out on any [`Arm`](armcal_core::streams::Arm), known only through its messages.
//!
//! `prepare` plans before the first motion. `script` carries out the steps: `reach`, `work`, `capture` (with
//! `belief_update`), `grip`, `touch`, `scale_identification`, `end_stops`. `motion` drives the arm, `settling` detects
//! rest, `contact` detects contacts, `following` joints that do not follow (`held_joint`, `failed_joints`). `approval`
//! asks an operator before a motion. `online_belief` takes in the recorded messages, and `keeping_up` works with it.
//! `recorder` keeps every message, with `transforms` and `annotations` for viewers. `outcome` is the result, with the
//! arm's uncertainty of its tool (`tool_belief`).

mod annotations;
mod approval;
mod belief_update;
mod capture;
pub(crate) mod constants;
mod contact;
mod end_stops;
mod error;
mod failed_joints;
mod flow;
mod following;
mod grip;
mod held_joint;
mod inputs;
mod keeping_up;
mod motion;
mod online_belief;
mod outcome;
mod prepare;
mod progress;
mod reach;
mod recorder;
mod runner;
mod scale_identification;
mod script;
mod settling;
mod tool_belief;
mod touch;
mod transforms;
mod unwatched;
mod work;

pub use error::SessionError;
pub use held_joint::HeldJoint;
pub use inputs::SessionInputs;
pub use online_belief::{AskedPoses, OnlineOutcome};
pub use outcome::{AssertResult, Epoch, EstimateUpdate, Outcome, ReachStep, SkippedTarget, StillReachable, Visit};
pub use progress::{Approval, MotionAhead, Progress};
pub use recorder::{MessageListener, Recorder};
pub use script::run;
pub use tool_belief::{Certainty, ToolBelief};
pub use transforms::BelievedFrames;
pub use unwatched::Unwatched;
