//! Poses of camera, links and tags, each with its standard deviation.

use armcal_core::codes::Coded;
use maud::{Markup, html as markup};

use armcal_belief::calib::{Calibration, CameraMount, FurtherCamera, LinkResult, ModelTable, SagTable};
use armcal_belief::say::Finding;
use armcal_core::units::Unit;

pub(super) fn section(calibration: &Calibration) -> Markup {
    markup! {
        @if !calibration.findings.is_empty() { (findings(&calibration.findings)) }
        h2 { "Camera and geometry" }
        @if let Some(mount) = &calibration.camera_mount { (camera_mount(mount)) }
        @for camera in &calibration.further_camera { (further_camera(camera)) }
        @if !calibration.link.is_empty() { (links(&calibration.link)) }
        @if let Some(sag) = &calibration.sag { (bending(sag)) }
        @if let Some(model) = &calibration.model { (model_lines(model)) }
    }
}

fn findings(findings: &[Finding]) -> Markup {
    markup! {
        h2 { "Findings" }
        table.notes {
            tr { th { "finding" } th { "name" } th { "size" } th { "tool error" } th { "repaired" } }
            @for finding in findings {
                tr {
                    td { (finding.kind.words()) " [" (finding.code()) "]" }
                    td { (finding.name) }
                    td { (finding.size_in_words().unwrap_or_else(|| "-".to_owned())) }
                    td { (Unit::Metres.shown_if(finding.tool_error_m, 1)) }
                    td { (if finding.repaired { "yes" } else { "no" }) }
                }
            }
        }
    }
}

/// `x, y, z` with a fixed number of digits.
fn triple(values: [f64; 3], scale: f64, digits: usize) -> String {
    values.map(|value| format!("{:.digits$}", value * scale)).join(", ")
}

/// Rows of a camera's pose on its link, with standard deviations.
fn place_rows(
    position_m: [f64; 3],
    position_std_m: [f64; 3],
    rotation_std_rad: [f64; 3],
) -> [(&'static str, String); 3] {
    [
        ("position on its link, mm", triple(position_m, 1e3, 2)),
        ("one sigma, mm", triple(position_std_m, 1e3, 2)),
        ("rotation, one sigma, deg", triple(rotation_std_rad, 1f64.to_degrees(), 3)),
    ]
}

fn further_camera(camera: &FurtherCamera) -> Markup {
    let FurtherCamera { name, position_m, position_std_m, rotation_std_rad, views, .. } = camera;
    markup! {
        table.notes {
            tr { th scope="row" { (name) ", views" } td { (views) } }
            @for (what, value) in place_rows(*position_m, *position_std_m, *rotation_std_rad) {
                tr { th scope="row" { (name) ", " (what) } td { (value) } }
            }
        }
    }
}

fn camera_mount(mount: &CameraMount) -> Markup {
    let rows = place_rows(mount.position_m, mount.position_std_m, mount.rotation_std_rad);
    markup! {
        table.notes {
            @if let Some(why) = &mount.left_out { tr { th { "nominal" } td { (why) } } }
            @for (what, value) in rows { tr { th scope="row" { "camera, " (what) } td { (value) } } }
        }
    }
}

fn links(links: &[LinkResult]) -> Markup {
    markup! {
        div.wide {
            table {
                tr {
                    th { "link" } th { "shift, mm" } th { "1 sigma, mm" } th { "turn, deg" } th { "1 sigma, deg" }
                }
                @for link in links {
                    tr {
                        td { (link.joint) }
                        td { (triple(link.shift_m, 1e3, 1)) } td { (triple(link.shift_std_m, 1e3, 1)) }
                        td { (triple(link.turn_rad, 1f64.to_degrees(), 2)) }
                        td { (triple(link.turn_std_rad, 1f64.to_degrees(), 2)) }
                    }
                }
            }
        }
    }
}

fn bending(sag: &SagTable) -> Markup {
    let scale = 1e3 * 1f64.to_degrees();
    markup! {
        table {
            tr { th { "compliance" } th { "deg per kN m" } th { "1 sigma" } }
            @for joint in &sag.joint {
                tr {
                    td { (joint.joint) } td { (format!("{:.3}", joint.rad_per_nm * scale)) }
                    td { (format!("{:.3}", joint.std_rad_per_nm * scale)) }
                }
            }
        }
    }
}

fn model_lines(model: &ModelTable) -> Markup {
    markup! {
        table.notes {
            tr {
                th scope="row" { "corner noise over the stated noise" }
                td { (format!("{:.2}", model.noise_scale)) }
            }
            @if let Some([offset_s, std_s]) = model.time_offset_s {
                tr {
                    th scope="row" { "delay of the joint sensors' clock against the camera's" }
                    td { (format!("{:.1} ms, one sigma {:.1} ms", 1e3 * offset_s, 1e3 * std_s)) }
                }
            }
            @for line in &model.decided { tr { th scope="row" { "chosen by evidence" } td { (line) } } }
        }
    }
}
