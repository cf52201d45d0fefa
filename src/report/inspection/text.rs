//! An inspection for people: plain lines.

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};

use crate::report::inspection::observable_parameters::ObservableParameters;
use crate::report::inspection::{Inspection, State};
use armcal_core::time::utc;

/// Pressure increase per metre of sea water, at its surface, Pa/m.
const PA_PER_M: f64 = 10_055.0;
const SURFACE_PA: f64 = 101_325.0;

/// Lays an inspection out for a terminal with `width` columns, or without a limit of the width.
#[must_use]
pub fn to_text(inspection: &Inspection, width: Option<usize>) -> String {
    let mut lines = head(inspection);
    if !inspection.topics.is_empty() {
        lines.push(String::new());
        lines.extend(topic_lines(inspection, width.unwrap_or(usize::MAX)));
    }
    lines.push(String::new());
    lines.extend(arm_lines(inspection));
    if let Some(determined) = &inspection.observable {
        lines.push(String::new());
        lines.extend(determined_lines(determined));
    }
    if let Some(tracking_error) = &inspection.tracking_error {
        lines.push(String::new());
        lines.push(tracking_error.to_text());
    }
    if !inspection.hints.is_empty() {
        lines.push(String::new());
        lines.extend(inspection.hints.iter().map(|hint| format!("note         {hint}")));
    }
    lines.join("\n")
}

/// Library name that the reader of SQLite bags reports for their writer.
const BAG_LIBRARY: &str = "rosbag2, SQLite";

fn head(inspection: &Inspection) -> Vec<String> {
    let i = inspection;
    let mut lines = vec![format!("recording    {}, {}", i.recording, size(i.bytes))];
    let by = if i.library.is_empty() { String::new() } else { format!(", written by {}", i.library) };
    let profile = if i.profile.is_empty() { "no profile" } else { i.profile.as_str() };
    let kind = if i.library == BAG_LIBRARY { "bag" } else { "MCAP" };
    lines.push(format!("format       {kind}, {profile}{by}"));
    let state = match i.completeness.state {
        State::Whole => "whole".to_owned(),
        State::Cut => format!("cut: {}", i.completeness.reason.as_deref().unwrap_or_default()),
        State::Damaged => {
            let c = &i.completeness;
            let messages = c.lost_messages.map_or_else(|| "unknown".to_owned(), |n| n.to_string());
            format!(
                "damaged: {}; lost: {} chunks, {}, {messages} messages",
                c.reason.as_deref().unwrap_or_default(),
                c.lost_chunks,
                size(c.lost_bytes)
            )
        }
    };
    lines.push(format!("state        {state}"));
    match (i.time_nanos, i.duration_s) {
        (Some([first, last]), Some(duration_s)) => {
            lines.push(format!("time         {} to {}, {duration_s:.1} s", utc(first), utc(last)));
        }
        _ => lines.push("time         -".to_owned()),
    }
    lines.push(format!("messages     {} on {} topics", i.messages, i.topics.len()));
    for c in &i.compression {
        let (packed, plain) = (size(c.compressed_bytes), size(c.uncompressed_bytes));
        lines.push(format!("chunks       {} with compression {}: {packed} of {plain}", c.chunks, c.name));
    }
    for (what, n) in &i.rejected {
        lines.push(format!("unusable     {n} messages on {what}"));
    }
    if i.non_monotonic > 0 {
        lines.push(format!("order        log time goes backwards {} times", i.non_monotonic));
    }
    if i.chunks_moved > 0 {
        lines.push(format!("order        {} chunks are out of order; they were sorted", i.chunks_moved));
    }
    if i.chunk_copies > 0 {
        lines.push(format!("copies       {} chunks are exact copies; they were skipped", i.chunk_copies));
    }
    for a in &i.attachments {
        lines.push(format!("attachment   {} ({}), {}", a.name, a.media_type, size(a.bytes)));
    }
    for m in &i.metadata {
        let entries: Vec<String> = m.entries.iter().map(|(key, value)| format!("{key} = {}", short(value))).collect();
        lines.push(format!("metadata     {}: {}", m.name, entries.join(", ")));
    }
    lines
}

/// Table of the topics; it omits their types where the lines would not fit.
fn topic_lines(inspection: &Inspection, width: usize) -> Vec<String> {
    let fits = |lines: &[String]| lines.iter().all(|line| line.chars().count() <= width);
    let whole = topic_table(inspection, &[0, 1, 2, 3, 4, 5, 6, 7]);
    if fits(&whole) {
        return whole;
    }
    let mut narrow = topic_table(inspection, &[0, 3, 4, 7]);
    narrow.push("note         --json or a wider terminal shows types and times of the topics".to_owned());
    narrow
}

/// Table of the topics with the given columns.
fn topic_table(inspection: &Inspection, columns: &[usize]) -> Vec<String> {
    const NAMES: [&str; 8] = ["topic", "type", "encoding", "messages", "Hz", "first s", "last s", "what"];
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(columns.iter().map(|&n| NAMES[n]));
    let start = inspection.time_nanos.map_or(0, |[first, _]| first);
    let seconds = |nanos: u64| format!("{:.2}", (nanos - start) as f64 * 1e-9);
    for t in &inspection.topics {
        let what = t.known_as.or(t.may_be.as_ref().map(|_| "see below")).unwrap_or_default();
        let cells = [
            t.topic.clone(),
            t.schema.clone(),
            t.encoding.clone(),
            t.messages.to_string(),
            t.rate_hz.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.2}")),
            seconds(t.time_nanos[0]),
            seconds(t.time_nanos[1]),
            what.to_owned(),
        ];
        table.add_row(columns.iter().map(|&n| &cells[n]));
    }
    for (column, n) in table.column_iter_mut().zip(columns) {
        if (3..7).contains(n) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    // The last column is padded.
    table.to_string().lines().map(|line| line.trim_end().to_owned()).collect()
}

fn arm_lines(inspection: &Inspection) -> Vec<String> {
    let arm = &inspection.arm;
    let mut lines = Vec::new();
    let none = || "none".to_owned();
    let joints = if arm.joints.is_empty() { none() } else { arm.joints.join(", ") };
    lines.push(format!("joints       {joints}; {} readings", arm.joint_readings));
    lines.push(format!("views        {} for the fit, {} held out", arm.views_fit, arm.views_held_out));
    let tags: Vec<String> = arm.tags.iter().map(|tag| format!("{} ({})", tag.id, tag.detections)).collect();
    let frames = arm.detection_frames;
    let tags = if tags.is_empty() { none() } else { format!("{}; id (detections)", tags.join(", ")) };
    lines.push(format!("tags         {tags} in {frames} frames"));
    if !arm.detections_rejected.is_empty() {
        let reasons = arm.detections_rejected.iter().map(|(why, n)| format!("{} ({n})", why.replace('_', " ")));
        lines.push(format!("rejected     {}; reason (candidates)", reasons.collect::<Vec<_>>().join(", ")));
    }
    if let Some(task) = &arm.task {
        let (n, mm) = (task.targets_m.len(), task.tolerance_m * 1e3);
        lines.push(format!("task         {n} targets within {mm:.1} mm"));
    }
    lines.push(format!("reaches      {} before, {} after calibration", arm.reaches_before, arm.reaches_after));
    for (what, range) in [("oil", arm.oil_c), ("water", arm.water_c)] {
        if let Some([low, high]) = range {
            lines.push(format!("{what:<13}{low:.1} to {high:.1} C"));
        }
    }
    if let Some([low, high]) = arm.pressure_pa {
        let depth = |pa: f64| (pa - SURFACE_PA) / PA_PER_M;
        lines.push(format!(
            "pressure     {low:.0} to {high:.0} Pa, about {:.0} to {:.0} m of sea",
            depth(low),
            depth(high)
        ));
    }
    lines
}

fn determined_lines(d: &ObservableParameters) -> Vec<String> {
    let mut lines = vec![format!(
        "robot        {}: {} views and {} held-out views show its tags, {} tags to fit",
        d.robot, d.views, d.held_out_views, d.tags_used
    )];
    if !d.unknown_tags.is_empty() {
        let ids: Vec<String> = d.unknown_tags.iter().map(u32::to_string).collect();
        lines.push(format!("unknown      tags outside its survey: {}", ids.join(", ")));
    }
    if !d.parameters.is_empty() {
        lines.push(format!("determined   {}", d.parameters.join(", ")));
    }
    lines.extend(d.undetermined.iter().map(|line| format!("undetermined {line}")));
    lines.extend(d.missing.iter().map(|line| format!("missing      {line}")));
    if d.missing.is_empty() {
        lines.push("enough       the views suffice for a calibration and its verdict".to_owned());
    }
    lines
}

/// A value shortened for display: it may be a whole file.
fn short(value: &str) -> String {
    let line = value.lines().next().unwrap_or_default();
    let told: String = line.chars().take(60).collect();
    if told.len() == value.len() { told } else { format!("{told} ..") }
}

fn size(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["bytes", "kB", "MB", "GB"];
    let mut value = bytes as f64;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < UNITS.len() {
        value /= 1000.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} bytes") } else { format!("{value:.2} {}", UNITS[unit]) }
}
