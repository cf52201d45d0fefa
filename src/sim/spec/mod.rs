//! The routine's `[world]`: differences of the truth from the nominal arm and scene.
//!
//! One file has one table. Every key is optional; a missing one has the value of the standard world.
//! Angles are rad, temperatures Celsius.

mod camera;
mod geometry;
mod ground;
mod hydraulics;
mod image;
mod joint_sensors;
mod obstacles;
mod physics;
mod points;
mod schema;
mod structure;
mod table;
mod temperature;
mod vehicle;
mod water;
mod world_spec;

pub use camera::{CameraWorldSpec, ClockSpec, CornerNoiseKind, PortKind, TagsSpec};
pub use geometry::GeometrySpec;
pub use ground::GroundSpec;
pub use hydraulics::HydraulicsSpec;
pub use image::{CameraMode, ImageSpec, WaterKind};
pub use joint_sensors::JointSensorsSpec;
pub use obstacles::UnmodelledObstacles;
pub(crate) use physics::CONTROL_PERIOD_S;
pub use physics::{EngineKind, PhysicsSpec};
pub use points::Points;
pub use schema::routine_schema;
pub use structure::StructureSpec;
pub use table::Figure;
pub use temperature::TemperatureSpec;
pub use vehicle::{MotionKind, VehicleMotionSpec};
pub use water::WaterSpec;
pub use world_spec::WorldSpec;

#[cfg(test)]
mod tests;
