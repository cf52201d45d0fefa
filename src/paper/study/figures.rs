//! The study's plots: Figure 2 as curves, Figure 3's two pictures, errors over the noise.

use nalgebra::Point3;

use crate::minimum_variance::Gauge;
use crate::study::PaperStudyError;
use crate::study::contender::MethodVariant;
use crate::study::scene::{Draw, Setting};
use crate::study::trials::PaperRow;
use armcal_belief::model::JointParameters;
use armcal_charts::{Axis, Panel, Series, Style, svg};
use armcal_core::robot::Robot;

/// Number of views in the picture of the clouds.
const CLOUD_VIEWS: usize = 20;

/// Plots by file name, as SVG text.
///
/// # Errors
/// [`PaperStudyError`] when a scene or a plot cannot be drawn.
pub fn paper_figures(
    robot: &Robot,
    rows: &[PaperRow],
    seed: u64,
) -> Result<Vec<(&'static str, String)>, PaperStudyError> {
    let noisy = Setting { noise_m: 0.01, ..Setting::default() };
    let drawn = |panels: &[Panel]| svg(panels).map_err(PaperStudyError::Plot);
    Ok(vec![
        ("convergence.svg", drawn(&convergence(&Draw::new(robot, &Setting::default(), seed, 0)?))?),
        ("noise.svg", drawn(&[over_noise(rows)])?),
        ("tool_positions.svg", drawn(&tool_positions(&Draw::new(robot, &noisy, seed, 0)?, &noisy))?),
        ("clouds.svg", drawn(&clouds(&Draw::new(robot, &noisy, seed, 0)?, &noisy))?),
    ])
}

fn label(text: &str, axis: Axis) -> (String, Axis) {
    (text.to_owned(), axis)
}

/// Figure 2: lowest objective of the search against the number of evaluations, with preconditioning and without.
fn convergence(draw: &Draw) -> [Panel; 2] {
    let panel = |contender: MethodVariant, unit: &str| {
        let curve = |name: &str, contender: &MethodVariant| {
            let mut best = f64::INFINITY;
            let mut points: Vec<[f64; 2]> = Vec::new();
            let mut n = 0.0;
            let mut next = 1.0;
            let _ = contender.solve(draw, &Setting::default(), &mut |cost| {
                (n, best) = (n + 1.0, cost.min(best));
                if n >= next {
                    points.push([n, best]);
                    next = (n * 1.08_f64).max(n + 1.0);
                }
            });
            points.push([n, best]);
            Series { name: name.to_owned(), color: None, style: Style::Line, points }
        };
        Panel {
            title: contender.name.to_owned(),
            x: label("evaluations", Axis::Log),
            y: label(unit, Axis::Log),
            is_map: false,
            series: vec![
                curve("in units of the prior sigma", &contender),
                curve("in raw units", &contender.raw("raw")),
            ],
        }
    };
    [
        panel(MethodVariant::minimum_distance(), "sum of distances, m"),
        panel(MethodVariant::minimum_variance(Gauge::Fixed), "sum of variances, m^2"),
    ]
}

fn over_noise(rows: &[PaperRow]) -> Panel {
    let of_noise: Vec<&PaperRow> = rows.iter().filter(|row| row.experiment == "noise").collect();
    let mut names: Vec<&str> = Vec::new();
    for row in &of_noise {
        if !names.contains(&row.contender) {
            names.push(row.contender);
        }
    }
    let curve = |name: &str| {
        let own = of_noise.iter().filter(|row| row.contender == name);
        let points = own.map(|row| [1e3 * row.setting.noise_m, 1e3 * row.tool_rms_m]).collect();
        Series { name: name.to_owned(), color: None, style: Style::Line, points }
    };
    let mut series: Vec<Series> = names.iter().map(|name| curve(name)).collect();
    let first = of_noise.iter().filter(|row| Some(&row.contender) == names.first());
    let bound = first.filter_map(|row| Some([1e3 * row.setting.noise_m, 1e3 * row.bound_rms_m?])).collect();
    series.push(Series { name: "Cramer-Rao bound".to_owned(), color: None, style: Style::Dashes, points: bound });
    Panel {
        title: "Tool error, 40 poses x 6 landmarks".to_owned(),
        x: label("noise of a position per axis, mm", Axis::Log),
        y: label("rms tool error, mm", Axis::Log),
        is_map: false,
        series,
    }
}

/// Figure 3, left: true tool positions, and their estimates before and after calibration.
fn tool_positions(draw: &Draw, setting: &Setting) -> [Panel; 2] {
    [MethodVariant::minimum_variance(Gauge::Free), MethodVariant::minimum_distance()].map(|contender| {
        let solution = contender.solve(draw, setting, &mut |_| {});
        let series = |name: &str, believed: Option<&JointParameters>| {
            let place = |angles: &armcal_core::joints::JointAngles| {
                let tool = draw.tool_m(&believed.map_or(*angles, |believed| draw.taken_for(angles, believed)));
                [tool.x, tool.y]
            };
            let points = draw.tool_poses.iter().take(40).map(place).collect();
            Series { name: name.to_owned(), color: None, style: Style::Dots, points }
        };
        Panel {
            title: format!("{}, 1 cm", contender.name),
            x: label("tool x, m", Axis::Linear),
            y: label("tool y, m", Axis::Linear),
            is_map: true,
            series: vec![
                series("after", Some(&solution.parameters)),
                series("before", Some(&JointParameters::default())),
                series("true", None),
            ],
        }
    })
}

/// Figure 3, right: the landmark positions from every view, by the datasheet, by the solution and by the true sensors.
fn clouds(draw: &Draw, setting: &Setting) -> [Panel; 2] {
    let solution = MethodVariant::minimum_variance(Gauge::Free).solve(draw, setting, &mut |_| {});
    let series = |name: &str, believed: &JointParameters| {
        let seen = draw.views.iter().take(CLOUD_VIEWS).flat_map(|view| {
            let angles = armcal_core::joints::JointAngles::from_fn(view.travel_rad.len(), |joint| {
                let center_rad = draw.robot.sensors[joint].center_rad;
                center_rad + believed.gain[joint] * view.travel_rad[joint] + believed.offset_rad[joint]
            });
            let base_from_camera = draw.robot.chain.link_poses(&angles).frame(&draw.robot.camera.mount);
            view.tags.iter().map(move |tag| base_from_camera * Point3::from(tag.center_in_camera_m))
        });
        Series { name: name.to_owned(), color: None, style: Style::Dots, points: seen.map(|p| [p.x, p.y]).collect() }
    };
    let places = draw.robot.tags.iter().map(|tag| tag.base_from_tag.origin().vector());
    let landmarks = Series {
        name: "landmarks".to_owned(),
        color: None,
        style: Style::Dots,
        points: places.map(|place| [place.x, place.y]).collect(),
    };
    let panel = |title: &str, clouds: Vec<Series>| Panel {
        title: title.to_owned(),
        x: label("x, m", Axis::Linear),
        y: label("y, m", Axis::Linear),
        is_map: true,
        series: clouds.into_iter().chain([landmarks.clone()]).collect(),
    };
    let after = series("minimum variance, gauge free", &solution.parameters);
    [
        panel("Landmarks by every view, before", vec![series("datasheet", &JointParameters::default())]),
        panel("and after, noise 1 cm", vec![after, series("true sensors", &draw.truth)]),
    ]
}
