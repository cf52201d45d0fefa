//! The verdict, its reasons and the next step; then the details of the report.

use maud::{Markup, html as markup};

use super::Report;
use crate::report::summary::RunSummary;
use crate::report::table::{check_lines, labelled, u95_in_words};
use crate::report::verdict::verdict;
use armcal_belief::calib::ValidRange;
use armcal_belief::say::sentence;
use armcal_core::time::utc;
use armcal_core::units::Unit;

pub(super) fn section(report: &Report<'_>) -> Markup {
    let verdict = verdict(report.summary);
    markup! {
        div class={ "verdict " (verdict.grade.class()) } {
            strong { (verdict.headline) }
            p { (in_one_sentence(report)) }
            @if !verdict.reasons.is_empty() { ul { @for reason in &verdict.reasons { li { (reason) } } } }
            p { b { "Next steps" } }
            ul { @for step in &verdict.next { li { (step) } } }
        }
        (facts(report))
    }
}

/// The decisive figure in words.
fn in_one_sentence(report: &Report<'_>) -> String {
    let mm = |m: f64| Unit::Metres.shown(m, 1);
    let mut words = match u95_in_words(report.summary) {
        Some(words) => sentence(&words),
        None => format!(
            "Tag position error of held-out views: {} rms.",
            Unit::Metres.shown_if(report.calibration.held_out.rms_m, 1)
        ),
    };
    let truth = report.summary.score.as_ref();
    let measured = truth.and_then(|score| Some((score.before.tool_error_m?, score.after.as_ref()?.tool_error_m?)));
    if let Some((before, after)) = measured {
        words += &format!(" Simulated truth: {} before, {} after (medians).", mm(before.median), mm(after.median));
    }
    words
}

/// Table of the report's details, such as arm, vehicle, operator and recordings.
fn facts(report: &Report<'_>) -> Markup {
    let (summary, calibration, about) = (report.summary, report.calibration, &report.about);
    let nanos = u64::try_from(calibration.valid.time_nanos).ok().filter(|nanos| *nanos > 0);
    let simulated = summary.world.as_ref().map(|world| format!("simulated ({})", world.engine));
    let rows = [
        ("arm", Some(summary.robot.clone())),
        ("serial number", report.robot.serial.clone()),
        ("vehicle", about.vehicle.clone()),
        ("operator", about.operator.clone()),
        (
            "last view",
            nanos.map(|nanos| {
                format!("{}{}", utc(nanos), simulated.as_ref().map_or("", |_| ", by the simulator's clock"))
            }),
        ),
        ("arm and sea", simulated),
        ("oil, water", conditions(&calibration.valid)),
        ("depth", depth(&calibration.valid)),
        ("recording", (!about.recordings.is_empty()).then(|| about.recordings.join(", "))),
        ("hash of the messages used", Some(calibration.messages_hash.clone())),
        ("seed", summary.seed.map(|seed| seed.to_string())),
        ("method", Some(summary.method.clone())),
        ("program", Some(format!("armcal {}", env!("CARGO_PKG_VERSION")))),
    ];
    markup! {
        h2 { "Details" }
        table.notes {
            @for (what, value) in rows.iter().filter_map(|(what, value)| Some((what, value.as_ref()?))) {
                tr { th scope="row" { (what) } td { code { (value) } } }
            }
        }
    }
}

fn conditions(valid: &ValidRange) -> Option<String> {
    let range =
        |name: &str, range: Option<[f64; 2]>| range.map(|[low, high]| format!("{name} {low:.1} .. {high:.1} C"));
    let both: Vec<String> = [range("oil", valid.oil_c), range("water", valid.water_c)].into_iter().flatten().collect();
    (!both.is_empty()).then(|| both.join(", "))
}

/// Depth in sea water of 1025 kg/m^3 that has the valid range of pressures, with one atmosphere at the surface.
fn depth(valid: &ValidRange) -> Option<String> {
    let [low, high] = valid.pressure_pa?;
    let metres = |pa: f64| ((pa - 101_325.0) / (1025.0 * 9.806_65)).max(0.0);
    let range = |low: String, high: String| if low == high { low } else { format!("{low} .. {high}") };
    let metres = range(format!("{:.0}", metres(low)), format!("{:.0}", metres(high)));
    let megapascals = range(format!("{:.2}", low * 1e-6), format!("{:.2}", high * 1e-6));
    Some(format!("{metres} m ({megapascals} MPa)"))
}

/// All lines of the terminal's table.
pub(super) fn all_lines(summary: &RunSummary) -> Markup {
    markup! {
        h2 { "Course of the run" }
        table.notes {
            @for (label, text) in check_lines(summary).iter().map(|line| labelled(line)) {
                tr { th scope="row" { (label) } td { (text) } }
            }
        }
    }
}

/// Lines for signatures.
pub(super) fn signatures() -> Markup {
    markup! { div.sign { p { "Date" } p { "Name" } p { "Signature" } } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_that_of_the_water_column() {
        let at = |pa: [f64; 2]| ValidRange { time_nanos: 0, oil_c: None, water_c: None, pressure_pa: Some(pa) };
        // Depth 4000 m in water of 1025 kg/m^3: 40.2 MPa and an atmosphere.
        assert_eq!(depth(&at([101_325.0, 40_308_389.0])).expect("a depth"), "0 .. 4000 m (0.10 .. 40.31 MPa)");
    }
}
