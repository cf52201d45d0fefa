//! report.html: its contents, its independence of other files, and the agreement of its figures with the calibration.

use armcal::calib::{Calibration, CornerResidual, calibrate as estimate};
use armcal::log::read_recording;
use armcal::routine::Method;

use crate::support::texts::{Texts, note};
use crate::support::{calibrate, edit, program, read, robot_copy, robot_folder, shared_run, temp, titan};

/// Headings of the page in their order.
fn headings(html: &str) -> Vec<&str> {
    html.split("<h2>").skip(1).filter_map(|rest| Some(rest.split_once("</h2>")?.0)).collect()
}

#[test]
fn the_verdict_comes_first_and_every_question_has_its_place() {
    let _texts = Texts::of("the_verdict_comes_first_and_every_question_has_its_place");
    let html = String::from_utf8(shared_run().bytes("report.html")).expect("text");
    note("headings", &headings(&html).join("\n"));
    let (verdict, facts) = (html.find("class=\"verdict "), html.find("<h2>"));
    assert!(verdict.is_some() && verdict < facts);
    assert!(html.contains("ACCEPTED") && html.contains("Signature"));
    let summary = shared_run().summary();
    let score = summary.score.expect("a score");
    assert_eq!(score.targets.len(), score.before.targets);
    for target in &score.targets {
        let [before, after] =
            [target.tool_error_before_m, target.tool_error_after_m].map(|m| m.expect("reached") * 1e3);
        let row = format!("<td>{}</td><td>{before:.2} mm</td><td>{after:.2} mm</td>", target.target + 1);
        assert!(html.contains(&row), "{row}");
    }
    let n = |text: &str| html.matches(text).count();
    assert_eq!(n("<figure>"), n("<svg") - n("<svg class=\"swatch\""), "every figure was drawn");
}

#[test]
fn a_report_needs_nothing_beside_it() {
    let html = String::from_utf8(shared_run().bytes("report.html")).expect("text");
    for outside in [" src=", " href=", "@import", "url(", "<script", "http:", "https:"] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
}

/// The residuals in the report are those of the fit.
#[test]
fn the_residuals_that_are_shown_are_those_of_the_fit() {
    let recording = read_recording(shared_run().file("run.mcap")).expect("it reads");
    let calibration = estimate(&recording, &titan(), Method::Bundle).expect("a calibration");
    let tags = || calibration.details.views.iter().flat_map(|view| &view.tags);
    assert_eq!(tags().count(), calibration.fit.tags_seen);
    let corners: Vec<&CornerResidual> = tags().flat_map(|tag| tag.corners.iter().flatten()).collect();
    assert_eq!(corners.len(), 4 * calibration.fit.tags_seen);
    let squares: f64 = corners.iter().map(|corner| corner.off_px.iter().map(|px| px * px).sum::<f64>()).sum();
    let (rms_px, stated_px) = ((squares / corners.len() as f64).sqrt(), calibration.fit.rms_px.expect("corners"));
    assert!((rms_px - stated_px).abs() < 1e-9, "{rms_px} against {stated_px}");
    let mut errors: Vec<f64> = calibration.details.targets.iter().map(|target| target.error_m).collect();
    errors.sort_by(f64::total_cmp);
    let predicted = calibration.predicted_tool_error_m.expect("a task");
    assert_eq!((errors.len(), *errors.last().expect("targets")), (predicted.n, predicted.max));
    assert!(calibration.details.targets.iter().all(|target| target.with_priors_m > Some(target.error_m)));
    let kept = Calibration { details: Default::default(), ..calibration.clone() };
    assert_eq!(kept.to_toml(), calibration.to_toml(), "none of it is in the file");
}

/// Names come from files of unknown origin.
#[test]
fn names_from_files_are_text_and_no_markup() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "name = \"titan4\"", "name = \"<b>arm&\"\nserial = \"<script>7\"");
    let out = folder.path().join("out");
    calibrate(&shared_run().file("run.mcap"), &robot, &out).expect("calibrate", 0, &["ACCEPTED"]);
    let html = read(&out.join("report.html"));
    assert!(html.contains("&lt;b&gt;arm&amp;") && html.contains("&lt;script&gt;7"));
    assert!(!html.contains("<b>arm") && !html.contains("<script"));
}

#[test]
fn a_refusal_says_why_and_what_to_do_before_anything_else() {
    let folder = temp();
    let mut refused = program();
    refused.arg("calibrate").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder());
    refused.args(["--method", "minimum_variance"]).arg("--out").arg(folder.path());
    crate::support::answer(&mut refused).expect("too few views", 4, &["REFUSED"]);
    let html = read(&folder.path().join("report.html"));
    let (verdict, rest) = html.split_once("<h2>").expect("sections");
    assert!(verdict.contains("REFUSED") && verdict.contains("class=\"verdict red"));
    let calibration = read(&folder.path().join("calibration.toml"));
    let calibration = Calibration::parse("calibration.toml".as_ref(), &calibration).expect("it reads");
    let refusal = calibration.refusals.first().expect("a reason");
    let in_html = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let tail = |text: &str| in_html(&text.chars().skip(1).collect::<String>());
    assert!(verdict.contains(&tail(&refusal.cause())) && verdict.contains(&tail(&refusal.remedy())), "{verdict}");
    assert!(!rest.contains("ACCEPTED"));
}
