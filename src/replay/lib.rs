//! Mirrors a run into a file for the Rerun viewer, after the fact and from recorded streams alone.
//!
//! [`write_rrd`] draws what the arm believed, what it saw and, where the simulator's truth file is at hand, what was true;
//! [`write_plan_rrd`] draws what an arm would do; [`open_viewer`] hands the file to an installed viewer. The viewer itself is not linked. Everything lies on one timeline,
//! `sim_time`: seconds since the recording's first log time. The same input gives the same bytes.
//!
//! Entities: `/world/vehicle/base` has the scene in the frames World, Vehicle and Base, `/camera` the image plane of the
//! wrist camera in raw pixels, `/plots` scalars, `/state`, `/log` and `/summary` what they say.

mod arms;
mod camera;
mod colors;
mod error;
mod eye;
mod layout;
mod phases;
mod plan;
mod plots;
mod rrd;
mod scenery;
mod shapes;
mod summary;
mod targets;
#[cfg(test)]
mod tests;
mod tracks;
mod truth;
mod viewer;

use std::path::Path;

use armcal_core::log::Recording;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;

pub use error::ReplayError;
pub use plan::{PlanInput, write_plan_rrd};
pub use viewer::{ViewerError, open_viewer};

use rrd::EntityLog;
use tracks::Tracks;
use truth::Truth;

/// What to show.
pub struct ReplayInput<'a> {
    pub recording: &'a Recording,
    /// The simulator's truth file, if there is one.
    pub truth: Option<&'a Path>,
    pub robot: &'a Robot,
    pub vehicle: Option<&'a Vehicle>,
    pub scene: Option<&'a Scene>,
    /// Shown as it is, in place of a short description of the recording.
    pub summary_markdown: Option<&'a str>,
}

/// Everything that the drawing modules share.
struct ReplayScene<'a> {
    tracks: Tracks<'a>,
    truth: Option<Truth>,
    robot: &'a Robot,
    vehicle: Option<&'a Vehicle>,
    scene: Option<&'a Scene>,
}

/// Writes `out`, an .rrd file with its layout, replacing one of that name.
///
/// # Errors
/// [`ReplayError`]: nothing to show, a truth file or joints that do not fit, or a file that cannot be written.
pub fn write_rrd(input: &ReplayInput, out: &Path) -> Result<(), ReplayError> {
    let mut tracks = Tracks::new(input.recording, input.robot)?;
    // A recording that was never in a file has no images.
    if input.recording.path.is_file() {
        tracks.take_images(&input.recording.path)?;
    }
    let truth = match input.truth {
        Some(path) => Some(Truth::read(path, input.robot, &tracks)?),
        None => None,
    };
    let run = ReplayScene { tracks, truth, robot: input.robot, vehicle: input.vehicle, scene: input.scene };
    let stream = draw(&run, input);
    let identity = rrd::Identity::of(input)?;
    rrd::write(out, &identity, &layout::build(&run), stream)
}

/// All that a recording shows, whoever made it.
fn draw(run: &ReplayScene<'_>, input: &ReplayInput<'_>) -> EntityLog {
    let mut stream = EntityLog::default();
    scenery::draw(run, &mut stream);
    arms::draw(run, &mut stream);
    targets::draw(run, &mut stream);
    camera::draw(run, &mut stream);
    plots::draw(run, &mut stream);
    phases::draw(run, &mut stream);
    summary::draw(run, input, &mut stream);
    stream
}
