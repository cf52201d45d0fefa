//! The closing table on the terminal. Millimetres and degrees: people read it.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, ContentArrangement, Table};

use crate::report::online::online_lines;
use crate::report::summary::{
    AssertSummary, CalibrationSummary, CaptureSummary, GainChange, HeldJointSummary, RenewalSummary, RunSummary,
};
use crate::report::verdict::{attention, beside_refusal, repairs};
use crate::score::{ReachScore, ScoreSide};
use armcal_belief::calib::{
    CameraMount, FailedJointTable, FurtherCamera, MapResult, PriorTable, Refusal, Status, SurveyCoverage,
};
use armcal_belief::say::skipped_poses;
use armcal_core::codes::{Code, Warning};
use armcal_core::stats::Summary;
use armcal_core::text::counted;
use armcal_core::units::Unit;

/// Fits a table to the given number of terminal columns; words that do not fit go to a further line.
pub(crate) fn fit_columns(table: &mut Table, width: Option<usize>) {
    if let Some(width) = width.and_then(|width| u16::try_from(width).ok()) {
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
    }
}

/// Lays a summary out for a terminal.
#[must_use]
pub fn table(summary: &RunSummary) -> String {
    let mut text = String::new();
    if let Some(score) = &summary.score {
        text.push_str(&score_table(&score.before, score.after.as_ref()).to_string());
        text.push('\n');
    }
    text.push_str(&joint_table(summary).map_or_else(String::new, |t| format!("{t}\n")));
    text.push_str(&check_lines(summary).join("\n"));
    text
}

/// Verdict, three figures and the urgent lines: failed sensors, abandoned joints, limits of the script, the first
/// warning.
#[must_use]
pub fn closing(summary: &RunSummary) -> String {
    let mut accuracy = accuracy_lines(summary).into_iter();
    let mut lines: Vec<String> = accuracy.by_ref().take(1).collect();
    lines.extend(summary.asserts.iter().map(assert_line));
    lines.extend(summary.stopped.iter().map(|why| format!("stopped      {why}")));
    // The first line already names the first failed joint of an accepted result.
    let n_told = if summary.status == Status::Accepted { 1 } else { 0 };
    lines.extend(summary.calibration.failed_joint.iter().skip(n_told).map(failed_line));
    lines.extend(summary.held_joints.iter().map(held_line));
    lines.extend(summary.still_reachable.iter().map(|still| format!("reachable    {still}")));
    lines.extend(score_line(summary));
    // The truth of a real arm is unknown: the held-out views stand for it.
    let n_figures = if summary.score.is_some() { 2 } else { 3 };
    let held_out = usize::from(summary.score.is_some());
    lines.extend(accuracy.skip(held_out).take(n_figures));
    lines.extend(first_warning(summary));
    lines.join("\n")
}

/// Tool error of the targets from the simulator's truth.
fn score_line(summary: &RunSummary) -> Option<String> {
    let score = summary.score.as_ref()?;
    let median = |side: &ScoreSide| Unit::Metres.shown_if(side.tool_error_m.map(|error| error.median), 2);
    let before = median(&score.before);
    Some(match &score.after {
        Some(after) => format!(
            "tool error   {before} before, {} after (medians, simulated truth); {} of {} targets hit",
            median(after),
            after.hits,
            after.targets
        ),
        None => format!("tool error   {before} before (median, simulated truth); no reach task followed"),
    })
}

/// The first warning and the number of all others. A warning that only names unobservable parameters is never the
/// first: the figures with priors include those.
fn first_warning(summary: &RunSummary) -> Option<String> {
    let warnings = &summary.calibration.verdict.as_ref()?.warnings;
    let is_known = |warning: &&Warning| warning.code == Code::LinksUnobservable;
    let first = warnings.iter().find(|warning| !is_known(warning))?;
    Some(match warnings.len() - 1 {
        0 => format!("warning      {first}"),
        n => format!("warning      {first}; and {}", counted(n, "more warning")),
    })
}

/// One line of the score: statistic, its value, and the unit for people.
struct Figure {
    name: &'static str,
    pick: fn(&ScoreSide) -> Option<Summary>,
    of: fn(&Summary) -> f64,
    unit: Unit,
}

const FIGURES: [Figure; 6] = [
    Figure { name: "tool position error, median", pick: |s| s.tool_error_m, of: |s| s.median, unit: Unit::Metres },
    Figure { name: "tool position error, 95 %", pick: |s| s.tool_error_m, of: |s| s.p95, unit: Unit::Metres },
    Figure { name: "tool position error, worst", pick: |s| s.tool_error_m, of: |s| s.max, unit: Unit::Metres },
    Figure {
        name: "tool orientation error, median",
        pick: |s| s.tool_error_rad,
        of: |s| s.median,
        unit: Unit::Radians,
    },
    Figure { name: "distance to target, median", pick: |s| s.reach_error_m, of: |s| s.median, unit: Unit::Metres },
    Figure { name: "distance to target, worst", pick: |s| s.reach_error_m, of: |s| s.max, unit: Unit::Metres },
];

/// Rows of (what, before, after, ratio); shared with the HTML report.
pub(super) fn score_rows(before: &ScoreSide, after: Option<&ScoreSide>) -> Vec<[String; 4]> {
    let mut rows = Vec::new();
    for figure in &FIGURES {
        let value = |side: &ScoreSide| (figure.pick)(side).map(|s| (figure.of)(&s));
        let (b, a) = (value(before), after.and_then(value));
        let show = |v: Option<f64>| figure.unit.shown_if(v, 2);
        let ratio = match (b, a) {
            (Some(b), Some(a)) if a > 0.0 => format!("{:.1} x better", b / a),
            _ => "-".to_owned(),
        };
        rows.push([figure.name.to_owned(), show(b), show(a), ratio]);
    }
    let hits = |side: &ScoreSide| match side.targets {
        0 => "-".to_owned(),
        asked => format!("{} of {asked}", side.hits),
    };
    rows.push([
        "targets hit within tolerance".to_owned(),
        hits(before),
        after.map_or_else(|| "-".to_owned(), hits),
        String::new(),
    ]);
    rows
}

fn score_table(before: &ScoreSide, after: Option<&ScoreSide>) -> Table {
    let mut table = Table::new();
    table.load_preset(UTF8_FULL_CONDENSED).set_header(["reach task, simulated truth", "before", "after", ""]);
    for row in score_rows(before, after) {
        table.add_row(row);
    }
    align_right(&mut table, 1..4);
    table
}

fn joint_table(summary: &RunSummary) -> Option<Table> {
    let score = summary.score.as_ref()?;
    let mut table = Table::new();
    table.load_preset(UTF8_FULL_CONDENSED).set_header(["joint angle error, rms", "before", "after", ""]);
    for joint in &score.joints {
        let show = |v: Option<f64>| Unit::Radians.shown_if(v, 3);
        let note = if joint.estimated { "" } else { "not calibrated" };
        let (before, after) = (show(joint.angle_error_before_rad), show(joint.angle_error_after_rad));
        table.add_row([joint.name.as_str(), &before, &after, note]);
    }
    align_right(&mut table, 1..3);
    Some(table)
}

fn align_right(table: &mut Table, columns: std::ops::Range<usize>) {
    for index in columns {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

/// Every check line begins with a label of this width.
const LABEL_WIDTH: usize = 13;

/// A check line as its label and its text.
pub(super) fn labelled(line: &str) -> (&str, &str) {
    let (label, text) = line.split_at_checked(LABEL_WIDTH).unwrap_or((line, ""));
    (label.trim_end(), text)
}

/// Checks that need no truth, and losses during the run; shared with the HTML report.
pub(super) fn check_lines(summary: &RunSummary) -> Vec<String> {
    let mut lines = accuracy_lines(summary);
    lines.extend(capture_lines(&summary.capture));
    lines.extend(calibration_lines(&summary.calibration));
    lines.extend(contact_line(&summary.capture));
    lines.extend(coverage_lines(&summary.calibration));
    lines.extend(compared_line(summary));
    lines.extend(reach_lines(summary));
    lines.extend(online_lines(summary));
    lines.extend(summary.asserts.iter().map(assert_line));
    lines.extend(summary.held_joints.iter().map(held_line));
    lines.extend(summary.still_reachable.iter().map(|still| format!("reachable    {still}")));
    lines.extend(summary.stopped.iter().map(|why| format!("stopped      {why}")));
    lines.extend(time_line(summary));
    lines
}

/// The verdict and the errors that it depends on.
fn accuracy_lines(summary: &RunSummary) -> Vec<String> {
    let mut lines = vec![match (summary.status, &summary.refusal) {
        (Status::Accepted, _) => format!("calibration  ACCEPTED{}", repaired(summary)),
        (Status::Refused, why) => {
            format!("calibration  REFUSED: {}{}", why.as_deref().unwrap_or("no reason given"), beside(summary))
        }
    }];
    let held_out = &summary.held_out;
    lines.push(format!(
        "held out     {} views, {}: tag position error {} rms (datasheet sensors {}{}){}",
        held_out.views,
        if held_out.cross_validated { "5-fold cross-validation" } else { "not fitted" },
        Unit::Metres.shown_if(held_out.rms_m, 1),
        Unit::Metres.shown_if(held_out.nominal_rms_m, 1),
        held_out.baseline.map_or_else(String::new, |baseline| format!(
            ", with fitted mount and map {}",
            Unit::Metres.shown(baseline.rms_m, 1)
        )),
        held_out
            .rms_px
            .map_or_else(String::new, |px| format!(", reprojection error {} rms", Unit::Pixels.shown(px, 1))),
    ));
    lines.extend(u95_in_words(summary).map(|words| format!("U95          {words}")));
    lines
}

/// U95 and the risk in words; `None` for a refused result, which states no error.
pub(super) fn u95_in_words(summary: &RunSummary) -> Option<String> {
    let u95 = &summary.calibration.u95;
    let max = Unit::Metres.shown(u95.max_m.filter(|_| summary.status == Status::Accepted)?, 1);
    Some(match u95.tolerance_m.zip(u95.p_beyond_tolerance) {
        Some((tolerance_m, risk)) => format!(
            "the tool is within {max} of each target with 95 % probability; P(error > {}) is {}",
            Unit::Metres.shown(tolerance_m, 1),
            risk_in_words(risk)
        ),
        None => format!("the tool is within {max} with 95 % probability over the recorded configurations"),
    })
}

/// A small probability in percent; below the accuracy of a normal distribution it is only called small.
pub(super) fn risk_in_words(risk: f64) -> String {
    if risk < 1e-4 { "below 0.01 %".to_owned() } else { format!("at most {:.2} %", 100.0 * risk) }
}

/// Faults that the calibration corrects: the first one, and its remedy.
fn repaired(summary: &RunSummary) -> String {
    let repairs = repairs(summary);
    let points = attention(summary);
    let Some(first) = repairs.first() else {
        let Some(first) = points.first() else { return String::new() };
        let more = if points.len() > 1 { format!("; and {} more", points.len() - 1) } else { String::new() };
        return format!(", with points to look at: {first}{more}");
    };
    let more = match repairs.len() - 1 {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    format!(", repaired: {}; {} [{}]{more}", first.cause, first.remedy_and_result(), first.code)
}

/// The first further fault that may be the cause of a refusal.
fn beside(summary: &RunSummary) -> String {
    let CaptureSummary { poses, poses_skipped, .. } = summary.capture;
    if let Some(why) = few_views(&summary.refusals, [poses_skipped, poses]) {
        return format!("; also: {why}");
    }
    let first = beside_refusal(summary).into_iter().next();
    first.map_or_else(String::new, |repair| format!("; also: {}; {} [{}]", repair.cause, repair.remedy, repair.code))
}

/// Returns the cause of a refusal for too few views if poses were skipped.
fn few_views(refusals: &[Refusal], [skipped, captured]: [usize; 2]) -> Option<String> {
    let is_for_few = matches!(refusals.first(), Some(Refusal::TooFewViews { .. }));
    (is_for_few && skipped > 0).then(|| skipped_poses(skipped, captured))
}

/// Number of views, counts of what was rejected, and the reason that the capture ended.
fn capture_lines(capture: &CaptureSummary) -> Vec<String> {
    let mut lines = vec![format!(
        "captured     {} poses ({} skipped); {} tag observations in {} fitted views, {} rejected{}; {} targets skipped",
        capture.poses,
        capture.poses_skipped,
        capture.detections,
        capture.views,
        capture.rejected,
        capture.rejected_corners.map_or(String::new(), |n| format!(" and {n} single corners")),
        capture.targets_skipped
    )];
    if !capture.rejected_by_reason.is_empty() {
        let reasons = capture.rejected_by_reason.iter().map(|(why, n)| format!("{n} {}", why.replace('_', " ")));
        lines.push(format!("rejected     {}", reasons.collect::<Vec<_>>().join(", ")));
    }
    lines.extend(capture.skipped_targets.iter().map(|skipped| format!("skipped      {skipped}")));
    lines.extend(capture.stop_reason.as_ref().map(|why| stop_reason_line(why, &capture.renewals)));
    lines
}

/// Results other than joint angles.
fn calibration_lines(calibration: &CalibrationSummary) -> Vec<String> {
    let mut lines: Vec<String> = calibration.largest_gain_change.as_ref().map(gain_line).into_iter().collect();
    lines.extend(calibration.camera_mount.as_ref().map(mount_line));
    lines.extend(calibration.further_camera.iter().map(further_camera_line));
    lines.extend(calibration.time_offset_s.map(clock_line));
    lines.extend(calibration.failed_joint.iter().map(failed_line));
    lines.extend(calibration.prior.as_ref().map(prior_line));
    lines.extend(calibration.map.iter().flat_map(map_lines));
    lines
}

/// Collisions, which only the truth knows.
fn contact_line(capture: &CaptureSummary) -> Option<String> {
    let clearance = Unit::Metres.shown_if(capture.min_clearance_m, 1);
    let collisions = capture.collisions?;
    Some(format!("contacts     {collisions}; minimum clearance to vehicle, obstacles, seafloor: {clearance}"))
}

/// Targets and ranges that the result does not hold for.
fn coverage_lines(calibration: &CalibrationSummary) -> Vec<String> {
    let mut lines: Vec<String> =
        calibration.reservations.iter().map(|reservation| format!("reservation  {reservation}")).collect();
    if let Some(verdict) = &calibration.verdict {
        lines.extend(verdict.warnings.iter().map(|line| format!("warning      {line}")));
        lines.extend(verdict.not_covered.iter().map(|line| format!("not covered  {line} [{}]", Code::NotCovered)));
    }
    lines.extend(calibration.unobservable.iter().map(|line| format!("unobservable {line}")));
    lines
}

fn time_line(summary: &RunSummary) -> Option<String> {
    let (simulated_s, motion_s) = (summary.simulated_s?, summary.motion_s?);
    let waited_s = summary.waited_s.unwrap_or(0.0);
    let waited = if waited_s > 0.0 { format!(", {waited_s:.0} s waiting") } else { String::new() };
    if summary.world.is_none() {
        return Some(format!(
            "time         {simulated_s:.0} s of arm time ({motion_s:.0} s moving{waited}), {:.1} s in all",
            summary.wall_s
        ));
    }
    Some(format!(
        "time         {simulated_s:.0} s simulated ({motion_s:.0} s moving{waited}) in {:.1} s, {:.0} times real time",
        summary.wall_s,
        (simulated_s - waited_s) / summary.wall_s.max(1e-9)
    ))
}

/// Reason that the last capture ended, and the tool errors predicted during it.
fn stop_reason_line(why: &str, renewals: &[RenewalSummary]) -> String {
    let last = renewals.chunk_by(|before, after| before.views < after.views).last().unwrap_or_default();
    if last.is_empty() {
        return format!("stop reason  {why}");
    }
    let joined = |of: fn(&RenewalSummary) -> String| last.iter().map(of).collect::<Vec<_>>().join(", ");
    format!(
        "stop reason  {why}; predicted tool error after {} views: {} mm",
        joined(|renewal| renewal.views.to_string()),
        joined(|renewal| Unit::Metres.number(renewal.predicted_tool_error_m, 1))
    )
}

/// Sigmas of a gain below which its change may be chance.
const CHANCE_SIGMAS: f64 = 3.0;

fn gain_line(largest: &GainChange) -> String {
    let GainChange { joint, change, std } = largest;
    let [change_percent, std_percent] = [change, std].map(|share| 100.0 * share);
    let within = if change.abs() < CHANCE_SIGMAS * std { ", no more than chance" } else { "" };
    format!("gains        changed by up to {change_percent:+.2} % ({joint}), sigma {std_percent:.2} %{within}")
}

/// Delay of the joint sensors' stamps behind the camera's and its standard deviation, both in s.
fn clock_line([offset_s, std_s]: [f64; 2]) -> String {
    let which = if offset_s < 0.0 {
        "the camera's stamps are later than the joints'"
    } else {
        "the joints' stamps are later than the camera's"
    };
    format!("clock        {which} by {:.1} ms, sigma {:.1} ms", 1e3 * offset_s.abs(), 1e3 * std_s)
}

fn mount_line(mount: &CameraMount) -> String {
    match &mount.left_out {
        Some(why) => format!("camera mount nominal: {why}"),
        None => {
            let by_tag = match (mount.views, mount.rms_px) {
                (0, _) => "from the tags".to_owned(),
                (views, Some(rms_px)) => format!("from the gripper tag in {views} views ({rms_px:.2} px rms)"),
                (views, None) => format!("from the tags and the gripper tag in {views} views"),
            };
            format!("camera mount {by_tag}: {}", known_to(mount.position_std_m, mount.rotation_std_rad))
        }
    }
}

fn further_camera_line(camera: &FurtherCamera) -> String {
    let FurtherCamera { name, position_std_m, rotation_std_rad, views, .. } = camera;
    format!("camera {name}: {}, mount {}", counted(*views, "view"), known_to(*position_std_m, *rotation_std_rad))
}

/// Largest standard deviations of position and rotation, which bound those of the other axes.
fn known_to(position_std_m: [f64; 3], rotation_std_rad: [f64; 3]) -> String {
    let worst = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
    let (std_mm, std_deg) = (worst(position_std_m) * 1e3, worst(rotation_std_rad).to_degrees());
    format!("sigma {std_mm:.1} mm and {std_deg:.2} deg along its worst axis")
}

fn failed_line(failed: &FailedJointTable) -> String {
    let FailedJointTable { joint, kind, found, evidence, .. } = failed;
    let colon = if evidence.is_empty() { "" } else { ": " };
    format!("failed       {joint} {} ({found}){colon}{evidence}; {}", kind.predicate(), failed.told().remedy())
}

fn held_line(held: &HeldJointSummary) -> String {
    let HeldJointSummary { joint, kind, angle_rad, bound_rad } = held;
    let (kind, [angle_deg, bound_deg]) = (kind.name(), [angle_rad, bound_rad].map(|rad| rad.to_degrees()));
    format!(
        "held         {joint} ({kind}): it did not follow its set-points; it is at {angle_deg:.1} deg, \
         ±{bound_deg:.2} deg"
    )
}

fn prior_line(prior: &PriorTable) -> String {
    let says = match (prior.agrees, prior.used) {
        (true, _) => "agrees with the views",
        (false, true) => "CONTRADICTS the views, still used",
        (false, false) => "contradicted the views and was dropped",
    };
    format!(
        "prior        {:.1} h old, {says}: chi-square {:.1} of {} (0.999 below {:.1})",
        prior.elapsed_h, prior.chi_square, prior.degrees_of_freedom, prior.chi_square_limit
    )
}

fn map_lines(map: &MapResult) -> Vec<String> {
    let surveyed = match map.known {
        SurveyCoverage::Partly => "some of it surveyed",
        SurveyCoverage::BaseTagAlone => "only the base tag surveyed",
    };
    let worst_m = map.tag.iter().flat_map(|tag| tag.position_std_m).fold(0.0, f64::max);
    let mut lines = vec![format!(
        "tag map      {} from {}, {surveyed}: {:.2} px rms, largest sigma {:.1} mm",
        counted(map.tag.len(), "tag"),
        counted(map.views, "view"),
        map.rms_px,
        worst_m * 1e3
    )];
    lines.extend(map.left_out.iter().map(|why| format!("rejected     {why}")));
    lines
}

/// The targets over which errors before and after are compared, where those are not all.
fn compared_line(summary: &RunSummary) -> Option<String> {
    let score = summary.score.as_ref()?;
    let after = score.after.as_ref()?;
    let (common, all) = (&score.compared_targets, score.before.targets.max(after.targets));
    if common.is_empty() && score.before.reach_error_m.is_some() {
        return Some(
            "compared     no target was reached both before and after: the two errors are of different targets"
                .to_owned(),
        );
    }
    let numbers = common.iter().map(|target| (target + 1).to_string()).collect::<Vec<_>>().join(", ");
    (!common.is_empty() && common.len() < all)
        .then(|| format!("compared     errors before and after: targets {numbers} of {all}"))
}

/// Every reach of a script that has more than the usual two, or in which targets are touched.
fn reach_lines(summary: &RunSummary) -> Vec<String> {
    let reaches = summary.score.as_ref().map(|score| score.reaches.as_slice()).unwrap_or_default();
    if reaches.len() <= 2 && reaches.iter().all(|reach| reach.touches.is_none()) {
        return Vec::new();
    }
    let mm = |v: Option<Summary>| Unit::Metres.shown_if(v.map(|v| v.median), 2);
    let line = |reach: &ReachScore| {
        let belief = if reach.calibrated { "calibrated" } else { "datasheet" };
        let (tool, miss) = (mm(reach.side.tool_error_m), mm(reach.side.reach_error_m));
        let touches = reach.touches.map(|t| format!("; touched {} of {}", t.touched, t.tried)).unwrap_or_default();
        format!(
            "reach        step {} ({belief}): tool position error {tool}, distance to target {miss} (medians){touches}",
            reach.step
        )
    };
    reaches.iter().map(line).collect()
}

fn assert_line(limit: &AssertSummary) -> String {
    let verdict = if limit.holds { "holds" } else { "FAILS" };
    let unit = limit.key.unit();
    let digits = if unit == Unit::Count { 0 } else { 2 };
    let value = limit.value.map_or_else(
        || "no such figure (the step did not run, or nothing was measured)".to_owned(),
        |value| unit.shown(value, digits),
    );
    let asked = unit.shown(limit.limit, digits);
    format!("assert       {verdict}: step {}, {} {asked}, measured {value}", limit.step, limit.key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_last_capture_says_how_it_went() {
        let renewal = |(views, mm): &(usize, f64)| RenewalSummary {
            views: *views,
            elapsed_s: 1.0,
            predicted_tool_error_m: mm / 1e3,
        };
        let both: Vec<_> = [(1, 50.0), (3, 6.0), (1, 3.04), (7, 1.96)].iter().map(renewal).collect();
        let lines = [&both[..], &both[..2], &[]].map(|renewals| stop_reason_line("so", renewals));
        insta::assert_snapshot!("stop_reasons", lines.join("\n"));
    }

    #[test]
    fn a_change_of_a_gain_is_told_by_its_sigmas() {
        let line = |change: f64, std: f64| gain_line(&GainChange { joint: "lift".to_owned(), change, std });
        let [clear, large, small] = [line(0.0038, 0.0004), line(-0.0436, 0.0036), line(0.0038, 0.002)];
        assert!(clear.contains("+0.38 %") && clear.ends_with("0.04 %"), "{clear}");
        assert!(large.contains("-4.36 %") && large.ends_with("0.36 %"), "{large}");
        // A change within three sigmas may be chance, and the line says so.
        assert!(small.contains("+0.38 %") && !small.ends_with("0.20 %"), "{small}");
    }

    #[test]
    fn skipped_poses_are_told_beside_too_few_views_alone() {
        let few = [Refusal::TooFewViews { views: 6, parameters: 10 }];
        assert!(few_views(&few, [6, 8]).is_some_and(|why| why.contains("6 of 14")));
        assert_eq!(few_views(&few, [0, 8]), None);
        assert_eq!(few_views(&[Refusal::NoHeldOutTag], [6, 8]), None);
    }
}
