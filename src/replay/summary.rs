//! Page of text: the run's summary or the recording's contents, then a legend of the picture.

use std::fmt::Write;

use crate::rerun::TextDocument;

use crate::entities::SUMMARY;
use crate::entity_log::EntityLog;
use crate::scene::{ReplayInput, ReplayScene};
use armcal_core::log::Completeness;
use armcal_core::streams::ReachAttempt;

/// Draws the page.
pub(super) fn draw(run: &ReplayScene, input: &ReplayInput, stream: &mut EntityLog) {
    let text = match input.summary_markdown {
        Some(text) => format!("{}\n\n{}", text.trim_end(), legend(run, input)),
        None => format!("{}\n{}", contents(run, input), legend(run, input)),
    };
    stream.log_static(SUMMARY, &TextDocument::from_markdown(text));
}

fn contents(run: &ReplayScene, input: &ReplayInput) -> String {
    let recording = input.recording;
    let mut text = format!("# {}\n\n", run.robot.name);
    // Writing to a String cannot fail.
    let _ = writeln!(text, "- {:.0} s, {} messages", run.tracks.duration_s, recording.messages.len());
    if recording.completeness != Completeness::Whole {
        let _ = writeln!(text, "- **the recording is cut or damaged**");
    }
    let rejected: u64 = recording.rejected.values().sum();
    if rejected > 0 {
        let _ = writeln!(text, "- {rejected} messages were rejected");
    }
    if let Some((_, task)) = run.tracks.task {
        let arrivals = run.arrivals();
        for (attempt, name) in [(ReachAttempt::Before, "before"), (ReachAttempt::After, "after")] {
            let of_attempt: Vec<_> = arrivals.iter().filter(|arrival| arrival.attempt == attempt).collect();
            let hits = of_attempt.iter().filter(|arrival| arrival.hit).count();
            if !of_attempt.is_empty() {
                let (n, tolerance_mm) = (of_attempt.len(), 1000.0 * task.tolerance_m);
                let _ =
                    writeln!(text, "- reached {name} calibration: {hits} of {n} targets within {tolerance_mm:.0} mm");
            }
        }
    }
    text
}

fn legend(run: &ReplayScene, input: &ReplayInput) -> String {
    let arms = if run.has_true_joints() {
        "- solid arm: true pose; **pink ghost**: estimated pose\n"
    } else {
        "- arm: estimated pose (this recording has no truth)\n"
    };
    let rests = if run.has_true_tool() {
        "; a line leads to where the tool truly came to rest (red missed, green hit, grey: before calibration), \
         the latest says by how much"
    } else {
        ""
    };
    let region = if input.tool_beliefs.iter().any(|(_, belief)| belief.is_some()) {
        "- **violet ellipsoid**: where the arm believes its tool to be with 95 %, with the longest half axis; \
         where the label says x20 it is drawn 20 times as large as it is\n"
    } else {
        ""
    };
    let residuals = if input.residuals.is_empty() {
        ""
    } else {
        "- frames about tags, once calibrated: how far off their corners are, root mean square; **green** fits, \
         **amber** is worse than the others, **red** contradicts them or was rejected, both with the figure\n"
    };
    let nearest = input.clearance_m.map_or_else(String::new, |kept_m| {
        let kept_mm = 1e3 * kept_m;
        format!(
            "- line from the arm to the nearest body: **red** below the required clearance of {kept_mm:.0} mm, \
             **amber** below twice that, **green** below three times that\n"
        )
    });
    format!(
        "### How to read the picture\n\n{arms}\
         - numbered yellow balls: targets{rests}\n{region}{residuals}{nearest}\
         - white line: the tool's last seconds; blue cone: the camera's line of sight\n\
         - blue and orange dots: where views were taken to fit and to check the calibration\n\
         - camera: **green** outlines are tags as seen, **pink** ones are where the believed arm expects them; \
         they agree once the calibration is right. Circles: 30 and 60 degrees off axis\n"
    )
}
