//! A recording as a file for the viewer.

use std::path::Path;

use crate::entity_log::EntityLog;
use crate::error::ReplayError;
use crate::identity::Identity;
use crate::scene::{ReplayInput, ReplayScene, RunState};
use crate::shown::Shown;
use crate::tracks::Tracks;
use crate::truth::Truth;
use crate::{
    arms, blueprint, camera, nearest, online, phases, plots, residuals, rrd, scenery, summary, targets, touches,
    uncertainty,
};

/// Writes `out`, an .rrd file with its blueprint, replacing one of that name.
///
/// # Errors
/// [`ReplayError`]: nothing to show, a truth file or joints that do not fit, or a file that cannot be written.
pub fn write_rrd(input: &ReplayInput, out: &Path) -> Result<(), ReplayError> {
    let run = scene(input)?;
    let stream = draw(&run, input);
    let identity = Identity::of(input)?;
    rrd::write(out, &identity, &blueprint::build(&run), stream)
}

/// Returns the recording as the drawing modules share it.
pub(super) fn scene<'a>(input: &ReplayInput<'a>) -> Result<ReplayScene<'a>, ReplayError> {
    let mut tracks = Tracks::new(input.recording, input.robot)?;
    // A recording that was never in a file has no images.
    if input.recording.path.is_file() {
        tracks.take_images(&input.recording.path)?;
    }
    let truth = match input.truth {
        Some(path) => Some(Truth::read(path, input.robot, &tracks)?),
        None => None,
    };
    let believed = input.believed_links.iter();
    let believed_chains =
        believed.map(|(since, links)| (tracks.place_s(*since, *since), input.robot.chain.corrected(links))).collect();
    let ReplayInput { robot, vehicle, scene, online, .. } = *input;
    Ok(ReplayScene { tracks, truth, robot, vehicle, scene, believed_chains, online, state: RunState::Over })
}

/// Draws all entities of a recording, measured or planned.
pub(super) fn draw(run: &ReplayScene<'_>, input: &ReplayInput<'_>) -> EntityLog {
    draw_into(EntityLog::of_recording(), run, input)
}

/// Draws all entities except those that were already shown.
pub(super) fn draw_news(run: &ReplayScene<'_>, input: &ReplayInput<'_>, shown: Shown) -> EntityLog {
    draw_into(EntityLog::of_news(shown), run, input)
}

fn draw_into(mut stream: EntityLog, run: &ReplayScene<'_>, input: &ReplayInput<'_>) -> EntityLog {
    scenery::draw(run, &mut stream);
    residuals::draw(run, input.residuals, &mut stream);
    arms::draw(run, &mut stream);
    uncertainty::draw(run, input, &mut stream);
    nearest::draw(run, input, &mut stream);
    targets::draw(run, &mut stream);
    touches::draw(run, &mut stream);
    camera::draw(run, &mut stream);
    plots::draw(run, &mut stream);
    online::draw(run, &mut stream);
    phases::draw(run, &mut stream);
    summary::draw(run, input, &mut stream);
    stream
}
