//! Residuals by tag, by joint, over time, and over the image.

use std::collections::BTreeMap;

use armcal_charts::{Axis, Color, Panel, Series, Style};
use maud::{Markup, html as markup};

use super::Report;
use super::figure::{figure, panel, series};
use armcal_belief::calib::{CornerResidual, ObservedTag, ViewResidual};
use armcal_belief::tagmap::files::spoken_name;
use armcal_core::robot::JointSensorSpec;

/// Magnification of residuals in the picture of the image.
const MAGNIFIED: f64 = 40.0;

pub(super) fn section(report: &Report<'_>) -> Markup {
    let views = &report.calibration.details.views;
    if views.iter().all(|view| view.tags.is_empty()) {
        return Markup::default();
    }
    markup! {
        h2 { "Residuals" }
        div.figures {
            (over_time(views))
            (over_image(views))
            (joint_errors(views, &report.robot.sensors))
        }
        (by_tag(views))
        (by_joint(views, &report.robot.sensors))
    }
}

/// Sums over the observations of one tag.
#[derive(Default)]
struct TagSums {
    views: usize,
    rejected: usize,
    squares_px2: f64,
    mean_px: [f64; 2],
    corners: usize,
    squares_m2: f64,
}

impl TagSums {
    fn add(&mut self, tag: &ObservedTag) {
        if !tag.is_used {
            self.rejected += 1;
            return;
        }
        self.views += 1;
        self.squares_m2 += tag.off_m * tag.off_m;
        for CornerResidual { off_px: [x, y], .. } in tag.corners.iter().flatten().filter(|corner| corner.is_used) {
            self.squares_px2 += x * x + y * y;
            self.mean_px[0] += x;
            self.mean_px[1] += y;
            self.corners += 1;
        }
    }
}

fn by_tag(views: &[ViewResidual]) -> Markup {
    let mut sums: BTreeMap<u32, TagSums> = BTreeMap::new();
    for tag in views.iter().flat_map(|view| &view.tags) {
        sums.entry(tag.id).or_default().add(tag);
    }
    let has_corners = sums.values().any(|sum| sum.corners > 0);
    let rms = |squares: f64, n: usize| (squares / n.max(1) as f64).sqrt();
    let name = |id: u32| spoken_name(id, sums.keys().copied()).trim_start_matches("tag ").to_owned();
    markup! {
        h3 { "By tag" }
        div.wide {
            table {
                tr {
                    th { "tag" } th { "views" } th { "rejected" } th { "position, mm rms" }
                    @if has_corners { th { "corners, px rms" } th { "mean x, px" } th { "mean y, px" } }
                }
                @for (id, sum) in &sums {
                    tr.out[sum.rejected > sum.views] {
                        td { (name(*id)) } td { (sum.views) } td { (sum.rejected) }
                        td { (format!("{:.1}", 1e3 * rms(sum.squares_m2, sum.views))) }
                        @if has_corners {
                            td { (format!("{:.2}", rms(sum.squares_px2, sum.corners))) }
                            @for mean in sum.mean_px { td { (format!("{:+.2}", mean / sum.corners.max(1) as f64)) } }
                        }
                    }
                }
            }
        }
    }
}

fn by_joint(views: &[ViewResidual], sensors: &[JointSensorSpec]) -> Markup {
    let errors: Vec<_> = views.iter().filter_map(|view| view.joint_error_rad).collect();
    if errors.is_empty() {
        return Markup::default();
    }
    let rms = |joint: usize| (errors.iter().map(|of| of[joint].powi(2)).sum::<f64>() / errors.len() as f64).sqrt();
    let worst = |joint: usize| errors.iter().map(|of| of[joint].abs()).fold(0.0, f64::max);
    markup! {
        h3 { "By joint" }
        table {
            @let shown = units(sensors);
            tr { th { "joint" } th { "residual, " (shown) " rms" } th { "largest, " (shown) } }
            @for (joint, spec) in sensors.iter().enumerate() {
                // The residual of an unobservable joint is exactly zero, which says nothing.
                @let is_off = worst(joint) > 0.0;
                @let shown = |rad: f64| if is_off { spec.unit().number(rad, 3) } else { "-".to_owned() };
                tr { td { (spec.joint) } td { (shown(rms(joint))) } td { (shown(worst(joint))) } }
            }
        }
    }
}

/// Units in which the joints' errors are shown.
fn units(sensors: &[JointSensorSpec]) -> &'static str {
    if sensors.iter().any(|spec| spec.moves.is_slide()) { "deg (mm of slides)" } else { "deg" }
}

/// Seconds since the first view.
fn time_s(views: &[ViewResidual], view: &ViewResidual) -> f64 {
    views.iter().map(|view| view.end).min().map_or(0.0, |first| view.end.since_s(first))
}

/// Chart of each observation's residual over time, px; mm where there are no corners.
fn over_time(views: &[ViewResidual]) -> Markup {
    let has_corners = views.iter().flat_map(|view| &view.tags).any(|tag| tag.rms_px().is_some());
    let (mut used, mut rejected) = (Vec::new(), Vec::new());
    for view in views {
        for tag in &view.tags {
            let off = if has_corners { all_corners_px(tag) } else { Some(1e3 * tag.off_m) };
            let points = if tag.is_used { &mut used } else { &mut rejected };
            points.extend(off.map(|off| [time_s(views, view), off]));
        }
    }
    // A large rejected residual would compress the scale, so those stand at the upper edge.
    let top = used.iter().map(|p: &[f64; 2]| p[1]).fold(0.0, f64::max) * 1.1;
    rejected.iter_mut().for_each(|p| p[1] = p[1].min(top));
    let y = if has_corners { "corner residual, px rms" } else { "position residual, mm" };
    let shown = with_rejected(series("used", Color::Blue, Style::Dots, used), rejected);
    figure(&panel("Residual of each tag in each view over time", "time since the first view, s", y, shown), "")
}

fn all_corners_px(tag: &ObservedTag) -> Option<f64> {
    let squares: Vec<f64> = tag.corners.iter().flatten().map(|c| c.off_px.iter().map(|px| px * px).sum()).collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

fn with_rejected(used: Series, rejected: Vec<[f64; 2]>) -> Vec<Series> {
    let mut all = vec![used];
    if !rejected.is_empty() {
        all.push(series("rejected", Color::Red, Style::Crosses, rejected));
    }
    all
}

/// Picture of every observed corner at its place in the image, with its residual as a stroke.
fn over_image(views: &[ViewResidual]) -> Markup {
    let (mut strokes, mut rejected) = (Vec::new(), Vec::new());
    for tag in views.iter().flat_map(|view| &view.tags) {
        for corner in tag.corners.iter().flatten() {
            let (seen, off) = (corner.seen_px, corner.off_px);
            if tag.is_used && corner.is_used {
                strokes.extend([seen, [seen[0] - MAGNIFIED * off[0], seen[1] - MAGNIFIED * off[1]]]);
            } else {
                rejected.push(seen);
            }
        }
    }
    if strokes.is_empty() {
        return Markup::default();
    }
    let shown = with_rejected(series("", Color::Blue, Style::Strokes, strokes), rejected);
    let y = ("y, px".to_owned(), Axis::Downward);
    let chart = Panel { is_map: true, y, ..panel("Corner residuals over the image", "x, px", "", shown) };
    figure(&chart, "Strokes lead from the measured to the predicted corner, 40 times enlarged.")
}

/// Chart of each joint's residual against its calibrated sensor over time.
fn joint_errors(views: &[ViewResidual], sensors: &[JointSensorSpec]) -> Markup {
    let of_joint = |(joint, spec): (usize, &JointSensorSpec)| {
        let scale = spec.unit().scale();
        let point = |view: &ViewResidual| Some([time_s(views, view), scale * view.joint_error_rad?[joint]]);
        let points: Vec<[f64; 2]> = views.iter().filter_map(point).collect();
        let is_still = points.iter().all(|[_, off]| off.abs() < 1e-6);
        (!is_still).then(|| Series { name: spec.joint.clone(), color: None, style: Style::Line, points })
    };
    let shown: Vec<Series> = sensors.iter().enumerate().filter_map(of_joint).collect();
    if shown.is_empty() {
        return Markup::default();
    }
    let y = format!("residual, {}", units(sensors));
    figure(
        &panel("Residual of each joint against its calibrated sensor", "time since the first view, s", &y, shown),
        "",
    )
}
