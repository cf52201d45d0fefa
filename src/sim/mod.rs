//! TRUTH: a simulated arm on a vehicle at sea, with the errors that real ones have.
//!
//! [`World`] is an `Arm` like any other: it takes set-points in raw counts and answers with messages. What it knows
//! beyond them (as-built sensors, true poses, contacts) goes into a truth stream of its own, which only the score
//! reads. The arm is a multibody in base axes on compliant oil columns; the vehicle moves as prescribed; every error of
//! [`WorldSpec`] is drawn from a random stream named after it, so that one seed gives one world, byte for byte.

mod as_built;
mod contact;
mod controller;
mod convert;
mod error;
mod fault;
mod hydraulics;
mod loads;
mod physics;
mod places;
mod sensors;
mod solids;
mod spec;
pub mod truth;
mod vehicle;
mod world;

pub use as_built::{AsBuilt, Harmonic, JointAsBuilt, PlainPose, TagAsBuilt};
pub use error::SimError;
pub use fault::Fault;
pub use spec::{
    CameraWorldSpec, ClockSpec, HydraulicsSpec, JointSensorsSpec, PhysicsSpec, TagsSpec, TemperatureSpec,
    VehicleMotionSpec, WaterSpec, WorldSpec,
};
pub use world::{World, WorldInput};
