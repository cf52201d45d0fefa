//! Time stamps.
//!
//! All streams have nanoseconds since a fixed epoch; a duration is seconds in `f64`. The library reads no clock:
//! simulator and recorder give the time, so that the library stays deterministic.

mod calendar;
mod stamp;

pub use calendar::{stamp_of_date, utc};
pub use stamp::{SIMULATION_EPOCH, Stamp};
