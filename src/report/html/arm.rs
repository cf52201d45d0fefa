//! The arm at the same readings with datasheet and with calibrated sensors, drawn from the shapes of its URDF.

use maud::{Markup, html as markup};
use nalgebra::{Point3, Vector3};

use super::Report;
use super::outline::outline;
use armcal_core::joints::JointAngles;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;

/// The arm at the same sensor readings before and after calibration.
struct Posture {
    before: LinkPoses,
    after: LinkPoses,
    tools_m: [Vector3<f64>; 2],
}

/// Projection from base coordinates to the picture: to the right, and up.
type Projection = Box<dyn Fn(&Point3<f64>) -> [f64; 2]>;

pub(super) fn section(report: &Report<'_>) -> Markup {
    let postures = postures(report).unwrap_or_default();
    let most = postures.iter().max_by(|a, b| a.off_m().total_cmp(&b.off_m()));
    let Some(most) = most else { return Markup::default() };
    let has_targets = !report.calibration.details.targets.is_empty();
    let at = if has_targets { "target" } else { "view" };
    let direction = postures.iter().map(|posture| posture.tools_m[1]).sum::<Vector3<f64>>();
    let azimuth = direction.y.atan2(direction.x);
    let side: Projection = Box::new(move |p| [p.x * azimuth.cos() + p.y * azimuth.sin(), p.z]);
    let above: Projection = Box::new(|p| [p.x, p.y]);
    markup! {
        h2 { "Arm before and after calibration" }
        div.figures {
            (picture("From the side", report.robot, most, &postures, &side))
            (picture("From above", report.robot, most, &postures, &above))
        }
        p { small {
            "The same sensor readings with datasheet (grey, dashed) and calibrated sensors (blue), in the view where \
             both "
            "differ most: "
            (format!("{:.0} mm", 1e3 * most.off_m())) " at the tool. Dots: the tool at each " (at)
            ", with a line to its position by the datasheet."
        } }
    }
}

impl Posture {
    fn off_m(&self) -> f64 {
        (self.tools_m[0] - self.tools_m[1]).norm()
    }
}

/// The arm at each target of the task, or else at each view; `None` where the calibration belongs to another arm.
fn postures(report: &Report<'_>) -> Option<Vec<Posture>> {
    let (drawn, details) = (report.robot, &report.calibration.details);
    let calibrated = report.calibration.applied_to(drawn);
    let scaled = report.calibration.scaled_robot(drawn);
    let (nominal, sensors) = (ArmSensors::nominal(drawn), report.calibration.sensors(&scaled).ok()?);
    let pairs: Vec<[JointAngles; 2]> = if details.targets.is_empty() {
        details.views.iter().map(|view| [view.datasheet_rad, view.calibrated_rad]).collect()
    } else {
        let by_datasheet = |angles: &JointAngles| nominal.angles(&sensors.counts(angles));
        details.targets.iter().map(|target| [by_datasheet(&target.angles), target.angles]).collect()
    };
    let posture = |[before, after]: [JointAngles; 2]| {
        let (before, after) = (drawn.chain.link_poses(&before), calibrated.chain.link_poses(&after));
        let tool_m = |poses: &LinkPoses| poses.frame(&drawn.tool.mount).translation.vector;
        Posture { tools_m: [tool_m(&before), tool_m(&after)], before, after }
    };
    Some(pairs.into_iter().map(posture).collect())
}

/// Width and height of a picture in its own units.
const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 330.0;
const MARGIN: f64 = 14.0;

/// Scale from metres to the picture's units, with all drawn points inside.
struct Scale {
    low: [f64; 2],
    high: [f64; 2],
    per_m: f64,
}

impl Scale {
    fn around(points: &[[f64; 2]]) -> Self {
        let fold = |axis: usize, by: fn(f64, f64) -> f64, from: f64| points.iter().map(|p| p[axis]).fold(from, by);
        let low = [0, 1].map(|axis| fold(axis, f64::min, f64::INFINITY));
        let high = [0, 1].map(|axis| fold(axis, f64::max, f64::NEG_INFINITY));
        let free = [WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN - 14.0];
        let per_m = (free[0] / (high[0] - low[0]).max(1e-6)).min(free[1] / (high[1] - low[1]).max(1e-6));
        Self { low, high, per_m }
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let center = 0.5 * (self.low[0] + self.high[0]);
        [0.5 * WIDTH + self.per_m * (x - center), MARGIN + 14.0 + self.per_m * (self.high[1] - y)]
    }

    fn path(&self, points: &[[f64; 2]]) -> String {
        let text = |p: &[f64; 2]| {
            let [x, y] = self.place(*p);
            format!("{x:.1},{y:.1}")
        };
        points.iter().map(text).collect::<Vec<String>>().join(" ")
    }
}

/// Drawing of an arm: outlines of its shapes, and the line through its joints.
struct Drawn {
    outlines: Vec<Vec<[f64; 2]>>,
    line: Vec<[f64; 2]>,
}

fn drawn(robot: &Robot, poses: &LinkPoses, project: &Projection) -> Drawn {
    let of_body = |body: usize| {
        robot.bodies[body].collisions.iter().map(move |placed| outline(placed, poses.link(body), project))
    };
    let joints = (0..robot.n_joints()).map(|joint| project(&Point3::from(poses.joint_origin(joint))));
    let tool = project(&Point3::from(poses.frame(&robot.tool.mount).translation.vector));
    Drawn {
        outlines: (0..robot.bodies.len().min(robot.n_joints() + 1)).flat_map(of_body).collect(),
        line: joints.chain([tool]).collect(),
    }
}

fn picture(title: &str, robot: &Robot, most: &Posture, all: &[Posture], project: &Projection) -> Markup {
    let arms = [drawn(robot, &most.before, project), drawn(robot, &most.after, project)];
    let tools: Vec<[[f64; 2]; 2]> =
        all.iter().map(|posture| posture.tools_m.map(|tool_m| project(&Point3::from(tool_m)))).collect();
    let mut shown: Vec<[f64; 2]> = tools.iter().flatten().copied().collect();
    for arm in &arms {
        shown.extend(arm.outlines.iter().flatten().chain(&arm.line));
    }
    let scale = Scale::around(&shown);
    let strokes = [("#7a8794", "4 3"), ("#1f77b4", "none")];
    markup! {
        figure {
            svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label=(title) {
                text x="220" y="14" text-anchor="middle" font-size="15" { (title) }
                @for (arm, (color, dashes)) in arms.iter().zip(strokes) {
                    @for outline in &arm.outlines {
                        polygon points=(scale.path(outline)) fill=(color) fill-opacity="0.13" stroke=(color)
                            stroke-opacity="0.7" stroke-width="1" stroke-dasharray=(dashes) { }
                    }
                    polyline points=(scale.path(&arm.line)) fill="none" stroke=(color) stroke-width="2"
                        stroke-dasharray=(dashes) { }
                }
                @for (number, [before, after]) in tools.iter().enumerate() {
                    @let [x, y] = scale.place(*after);
                    polyline points=(scale.path(&[*before, *after])) fill="none" stroke="#d62728" stroke-width="1" { }
                    circle cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="3" fill="#2ca02c" {
                        title { (number + 1) ": " (format!("{:.1} mm", 1e3 * all[number].off_m())) }
                    }
                }
                (scale_bar(&scale))
            }
        }
    }
}

/// The longest of a few round lengths that takes no more than a quarter of the width.
fn scale_bar(scale: &Scale) -> Markup {
    let fits = |length_m: &f64| length_m * scale.per_m <= 0.25 * WIDTH;
    let length_m = [2.0, 1.0, 0.5, 0.2, 0.1].into_iter().find(fits).unwrap_or(0.05);
    let (y, end) = (HEIGHT - 6.0, MARGIN + length_m * scale.per_m);
    markup! {
        line x1=(MARGIN) x2=(format!("{end:.1}")) y1=(y) y2=(y) stroke="#000000" stroke-width="2" { }
        text x=(format!("{:.1}", end + 6.0)) y=(y + 3.0) font-size="11" { (format!("{length_m} m")) }
    }
}
