//! An online estimate in your own program: it takes messages and returns sensors, predicted tool error and events.
//!
//! Run `cargo run --release --example follow_messages -- RECORDING.mcap ROBOT_FOLDER`; without arguments it uses the
//! sample. Here the messages come from a recording; a driver pushes the messages that it receives.

#![allow(clippy::print_stdout, reason = "a small program, for a terminal")]

use std::env::args;
use std::error::Error;
use std::path::{Path, PathBuf};

use armcal::calib::online::{Follower, OnlineSettings};
use armcal::{load_robot, read_recording};

fn main() -> Result<(), Box<dyn Error>> {
    let file = |number, default: &str| {
        args().nth(number).map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(default), PathBuf::from)
    };
    let recording = read_recording(file(1, "recordings/sample/run.mcap"))?;
    let robot = load_robot(&file(2, "robots/titan4"))?;

    let mut follower = Follower::new(robot, OnlineSettings::default());
    for (log_time, message) in &recording.messages {
        for event in follower.push(*log_time, message) {
            println!("{}", event.to_line());
        }
    }
    follower.finish();
    let belief = follower.belief().ok_or("the recording shows no tags")?;
    println!(
        "{} views: the tool is known to {:.2} mm, to {:.2} mm in an hour without views",
        belief.views,
        1e3 * belief.tool_error_m.median,
        1e3 * belief.tool_error_in_an_hour_m.median
    );
    for (model, [offset_rad, std_rad]) in follower.sensors().models.iter().zip(&belief.offset_rad) {
        println!("  {}: offset {offset_rad:.4} rad, std {std_rad:.4} rad", model.spec.joint);
    }
    Ok(())
}
