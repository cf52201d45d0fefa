//! TRUTH: a simulated arm on a vehicle at sea, with realistic errors.
//!
//! [`World`] is an `Arm`: it takes set-points in raw counts and returns messages. Its truth (as-built sensors, true
//! poses, contacts) goes into a stream of its own, which only the score reads. Arm and vehicle are one multibody in
//! water, on compliant oil columns; the vehicle moves as prescribed or floats free. Each error of [`WorldSpec`] has a
//! random stream of its own, so that one seed gives one world, byte for byte.
#![warn(missing_docs)]

mod as_built;
mod body_poses;
mod clearance_watch;
mod contact_onset;
mod controller;
mod convert;
pub mod dynamics;
mod error;
mod fault;
#[cfg(test)]
mod fixture;
mod gripper;
mod hydraulics;
pub mod imaging;
mod pair_motion;
mod physics;
mod recorded_motion;
mod sensors;
mod solids;
mod spec;
mod structure;
mod temperatures;
pub mod truth;
mod vehicle;
mod world;

pub use as_built::{
    AsBuilt, AttitudeAsBuilt, GaugesAsBuilt, GeometryAsBuilt, Harmonic, JointAsBuilt, LensAsBuilt, PlaceError,
    PlainPose, ResolverAsBuilt, TagAsBuilt, WornSpot,
};
pub use error::SimError;
pub use fault::{Fault, ScheduledFault};
pub use recorded_motion::{RecordedMotion, VehicleKinematics};
pub use spec::{
    CameraMode, CameraWorldSpec, ClockSpec, EngineKind, Figure, GeometrySpec, GroundSpec, HydraulicsSpec, ImageSpec,
    JointSensorsSpec, MotionKind, PhysicsSpec, Points, PortKind, StructureSpec, TagsSpec, TemperatureSpec,
    UnmodelledObstacles, VehicleMotionSpec, WaterKind, WaterSpec, WorldSpec, routine_schema,
};
pub use world::{World, WorldInput};
