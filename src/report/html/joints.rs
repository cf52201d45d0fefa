//! Each joint's sensor: the calibrated line, and its distance from the datasheet's over the range.

use armcal_charts::{Color, Style};
use maud::{Markup, html as markup};

use super::Report;
use super::figure::{figure, panel, series};
use armcal_belief::calib::{Calibration, JointAt, JointResult, ParameterCovariance};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, ConditionChange};

/// Number of points of a curve.
const POINTS: usize = 41;

pub(super) fn section(report: &Report<'_>) -> Markup {
    let calibration = report.calibration;
    markup! {
        h2 { "Joint sensors" }
        (table(calibration))
        @if let Some(curves) = Curves::of(report) {
            div.figures {
                @for (joint, result) in calibration.joint.iter().enumerate() {
                    @if is_estimated(result) { (curves.figure(joint)) }
                }
            }
            p { small {
                "Line: calibrated minus datasheet angle over the joint's range. Band: two sigma. "
                "Ticks: readings at which views were captured."
            } }
        }
    }
}

fn is_estimated(joint: &JointResult) -> bool {
    joint.gain_estimated || joint.offset_estimated
}

fn table(calibration: &Calibration) -> Markup {
    let has_slide = calibration.has_slide();
    let (si, shown) = if has_slide { ("rad or m", "deg or mm") } else { ("rad", "deg") };
    markup! {
        div.wide {
            table {
                tr {
                    th { "joint" } th { "gain, " (si) "/count" } th { "1 sigma, %" } th { "offset, " (shown) }
                    th { "1 sigma, " (shown) }
                    th { "covered range, " (shown) } th { "gain change, %" }
                }
                @for joint in &calibration.joint {
                    tr {
                        @let unit = joint.moves.unit();
                        td {
                            (joint.name) @if joint.moves.is_slide() { " (slide, mm)" }
                            @if !is_estimated(joint) { " " small { "(not calibrated)" } }
                        }
                        td { (format!("{:.8}", joint.gain_rad_per_count)) }
                        @let gain_std = joint.gain_std_rad_per_count / joint.gain_rad_per_count.abs();
                        td { (format!("{:.2}", 100.0 * gain_std)) }
                        td { (format!("{:+.3}", joint.offset_rad * unit.scale())) }
                        td { (unit.number(joint.offset_std_rad, 3)) }
                        @let [from, to] = joint.covered_rad.map(|end| unit.number(end, 0));
                        td { (from) " .. " (to) }
                        @let change = joint.gain_over_datasheet.map(|gain| format!("{:+.2}", 100.0 * (gain - 1.0)));
                        td { (change.unwrap_or_else(|| "-".to_owned())) }
                    }
                }
            }
        }
    }
}

/// Inputs of the curves.
struct Curves<'a> {
    calibration: &'a Calibration,
    robot: Robot,
    sensors: ArmSensors,
    covariance: ParameterCovariance,
}

impl<'a> Curves<'a> {
    /// Inputs from a report; `None` where the calibration has other joints than the robot.
    fn of(report: &Report<'a>) -> Option<Self> {
        let calibration = report.calibration;
        let robot = calibration.scaled_robot(report.robot);
        let sensors = calibration.sensors(&robot).ok()?;
        let covariance = calibration.parameter_covariance(&robot);
        (sensors.models.len() == calibration.joint.len()).then_some(Self { calibration, robot, sensors, covariance })
    }

    fn figure(&self, joint: usize) -> Markup {
        let model = &self.sensors.models[joint];
        let (spec, name) = (&model.spec, &self.calibration.joint[joint].name);
        let (scale, symbol) = (spec.unit().scale(), spec.unit().symbol());
        let departure = ConditionChange::default();
        let std_rad = |travel_rad: f64| {
            let at = JointAt { spec, joint, travel_rad };
            self.covariance.angle_var_rad2(at, &departure, 0.0).sqrt()
        };
        let (mut line, mut upper, mut lower) = (Vec::new(), Vec::new(), Vec::new());
        for n in 0..POINTS {
            let travel_rad = (2.0 * n as f64 / (POINTS - 1) as f64 - 1.0) * spec.half_range_rad;
            let read_rad = spec.center_rad + travel_rad;
            let off_rad = model.correction.angle_rad(spec, travel_rad, &departure, 0.0) - read_rad;
            let point = |off_rad: f64| [scale * read_rad, scale * off_rad];
            line.push(point(off_rad));
            upper.push(point(off_rad + 2.0 * std_rad(travel_rad)));
            lower.push(point(off_rad - 2.0 * std_rad(travel_rad)));
        }
        let low = lower.iter().map(|[_, off]| *off).fold(0.0, f64::min);
        let ticks = self.calibration.details.views.iter().map(|view| [scale * view.datasheet_rad[joint], low]);
        upper.extend(lower.into_iter().rev());
        let zero = vec![line[0], line[POINTS - 1]].into_iter().map(|[x, _]| [x, 0.0]).collect();
        let shown = vec![
            series("", Color::Blue, Style::Area, upper),
            series("", Color::Grey, Style::Dashes, zero),
            series("", Color::Blue, Style::Line, line),
            series("", Color::Orange, Style::Dots, ticks.collect()),
        ];
        debug_assert_eq!(self.robot.n_joints(), self.sensors.models.len());
        let [x, y] = ["reading by", "off"].map(|what| format!("{what} the datasheet, {symbol}"));
        figure(&panel(name, &x, &y, shown), "")
    }
}
