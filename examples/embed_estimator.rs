//! The estimator inside an application: it takes messages one by one and returns a calibration with covariance and
//! verdict.
//!
//! Run `cargo run --release --example embed_estimator`. The messages come from `recordings/sample/run.mcap`; an
//! application passes on the messages of its own drivers. The estimator reads only recorded bytes, so the messages go
//! to a file first.

#![allow(clippy::print_stdout, reason = "a small program, for a terminal")]

use std::error::Error;
use std::path::Path;

use armcal::streams::MarkKind;
use armcal::{Message, Method, Recorder, RecordingHeader, RecordingWriter, Sink};
use armcal::{calibrate, interim_estimate, load_robot, read_recording};

/// Number of views between two interim estimates.
const ESTIMATE_EVERY: usize = 6;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let robot = load_robot(&root.join("robots/titan4"))?;
    let received = read_recording(root.join("recordings/sample/run.mcap"))?.messages;

    let folder = tempfile::tempdir()?;
    let header = RecordingHeader::new(robot.joint_names());
    let mut recorder = Recorder::new(RecordingWriter::create(folder.path().join("application.mcap"), header)?);
    let start = received.first().ok_or("the sample holds no messages")?.0;
    let mut n_views = 0;
    for (log_time, message) in &received {
        recorder.record(*log_time, message).map_err(|error| error.to_string())?;
        // A capture mark gives the span in which the arm was at rest; it ends the view.
        let Message::Mark(mark) = message else { continue };
        if !matches!(mark.kind, MarkKind::Capture { .. }) {
            continue;
        }
        n_views += 1;
        if n_views % ESTIMATE_EVERY == 0 {
            let interim = interim_estimate(&recorder.read_back()?, &robot, start, None)?;
            let predicted = interim.predicted_tool_error_m.ok_or("the recording names no task")?;
            println!("{n_views:>2} views: predicted tool error {:.1} mm median", 1e3 * predicted.median);
        }
    }

    let calibration = calibrate(&recorder.read_back()?, &robot, Method::Bundle)?;
    println!("verdict: {:?} {}", calibration.status, calibration.refusal.as_deref().unwrap_or_default());
    for joint in &calibration.joint {
        let (offset, std) = (joint.offset_rad.to_degrees(), joint.offset_std_rad.to_degrees());
        println!("{:<15} offset {offset:7.3} deg, std {std:.3} deg", joint.name);
    }
    let covariance = &calibration.covariance;
    for (k, name) in covariance.parameters.iter().enumerate().take(4) {
        println!("{name}: standard deviation {:.2e}", covariance.rows[k][k].sqrt());
    }
    Ok(())
}
