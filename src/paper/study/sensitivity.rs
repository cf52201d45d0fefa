//! The paper's Figures 4 and 7: the effect of one wrong offset on both objectives, and on the tool.
//!
//! The sensors are exact and the data have no noise; the offset of one joint at a time is swept from 0 to 180 deg.
//! Poses are drawn from a seed among those in which the routine's tags are visible from the routine's vehicle.

use std::fmt::Write as _;

use nalgebra::Point3;
use rand::RngExt;

use crate::position_method::PositionMethod;
use armcal_belief::calib::{PositionProblem, TagMeasurement, TagObservation, View};
use armcal_belief::model::JointParameters;
use armcal_belief::plan::{ClearanceModel, VisibilityModel};
use armcal_charts::{Axis, Panel, Series, Style, svg};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::stats::stream_rng;
use armcal_core::time::SIMULATION_EPOCH;

/// Objectives and tool error for one offset of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensitivityPoint {
    pub joint: usize,
    pub offset_deg: f64,
    /// Objective of minimum variance, m^2; `distance_m` is that of minimum distance, m.
    pub variance_m2: f64,
    pub distance_m: f64,
    /// Mean distance over the poses between the estimated and the true tool, m; `tool_max_m` is the largest.
    pub tool_mean_m: f64,
    pub tool_max_m: f64,
}

/// All points, with the poses and tags behind them.
#[derive(Clone, Debug)]
pub struct Sensitivity {
    pub joints: Vec<String>,
    /// Number of joints that move the camera.
    pub n_seen: usize,
    pub poses: usize,
    pub tags_seen: usize,
    pub points: Vec<SensitivityPoint>,
}

/// Number of random poses that are tried for one in which enough tags are visible.
const MAX_TRIES: usize = 200_000;
const STEP_DEG: f64 = 5.0;
const STEPS: u32 = 36;

/// Sweeps each joint's offset. `poses` poses see `min_tags` tags or more each.
///
/// # Errors
/// An error if too few poses see so many tags.
pub fn sensitivity(
    robot: &Robot,
    clearance: &ClearanceModel<'_>,
    poses: usize,
    min_tags: usize,
    seed: u64,
) -> Result<Sensitivity, String> {
    let views = views(robot, clearance, poses, min_tags, seed)?;
    let problem = PositionProblem::new(robot, &views);
    let point = |joint: usize, step: u32| {
        let offset_deg = STEP_DEG * f64::from(step);
        let mut off = JointParameters::default();
        off.offset_rad[joint] = offset_deg.to_radians();
        let errors_m: Vec<f64> = views.iter().map(|view| tool_error_m(robot, view, &off)).collect();
        SensitivityPoint {
            joint,
            offset_deg,
            variance_m2: PositionMethod::MinimumVariance.cost(&problem, &off),
            distance_m: PositionMethod::MinimumDistance.cost(&problem, &off),
            tool_mean_m: errors_m.iter().sum::<f64>() / errors_m.len() as f64,
            tool_max_m: errors_m.iter().copied().fold(0.0, f64::max),
        }
    };
    let points = (0..robot.n_joints()).flat_map(|joint| (0..=STEPS).map(move |step| (joint, step)));
    Ok(Sensitivity {
        joints: robot.joint_names(),
        n_seen: robot.camera.mount.n_joints,
        poses: views.len(),
        tags_seen: problem.n_observations(),
        points: points.map(|(joint, step)| point(joint, step)).collect(),
    })
}

/// Views with readings of exact sensors, and positions without noise.
fn views(
    robot: &Robot,
    clearance: &ClearanceModel<'_>,
    poses: usize,
    min_tags: usize,
    seed: u64,
) -> Result<Vec<View>, String> {
    let visibility = VisibilityModel::default();
    let mut rng = stream_rng(seed, "poses of the sensitivity study");
    let mut views = Vec::with_capacity(poses);
    for _ in 0..MAX_TRIES {
        if views.len() == poses {
            break;
        }
        let angles = JointAngles::from_fn(robot.n_joints(), |joint| {
            let part: f64 = rng.random_range(0.0..1.0);
            robot.chain.joints()[joint].limits.map_or(0.0, |l| l.lower_rad + part * (l.upper_rad - l.lower_rad))
        });
        if visibility.in_view(robot, &robot.chain.link_poses(&angles)).count() < min_tags
            || clearance.is_nearer_than(&angles, 0.0)
        {
            continue;
        }
        let seen = visibility.visible(robot, clearance, &angles);
        if seen.len() < min_tags {
            continue;
        }
        let camera_from_base = robot.chain.link_poses(&angles).frame(&robot.camera.mount).inverse();
        let tag = |&tag_idx: &usize| {
            let tag = &robot.tags[tag_idx];
            let place = camera_from_base * Point3::from(tag.base_from_tag.origin().vector());
            TagObservation { id: tag.id, tag_idx, center_in_camera_m: place.coords, measured: TagMeasurement::Position }
        };
        let travel_rad = JointAngles::from_fn(robot.n_joints(), |j| angles[j] - robot.sensors[j].center_rad);
        let tags = seen.iter().map(tag).collect();
        views.push(View { tags, ..View::of_reading(views.len() as u32, SIMULATION_EPOCH, travel_rad) });
    }
    if views.len() < poses {
        let found = views.len();
        return Err(format!("only {found} of {poses} random poses were found that see {min_tags} tags"));
    }
    Ok(views)
}

fn tool_error_m(robot: &Robot, view: &View, off: &JointParameters) -> f64 {
    let tool = |off: &JointParameters| {
        let angles = JointAngles::from_fn(robot.n_joints(), |j| {
            robot.sensors[j].center_rad + off.gain[j] * view.travel_rad[j] + off.offset_rad[j]
        });
        robot.chain.link_poses(&angles).frame(&robot.tool.mount).translation.vector
    };
    (tool(off) - tool(&JointParameters::default())).norm()
}

impl Sensitivity {
    /// Points of one joint in the order of the offset.
    fn of(&self, joint: usize) -> impl Iterator<Item = &SensitivityPoint> {
        self.points.iter().filter(move |point| point.joint == joint)
    }

    /// Largest change of minimum variance's objective by an offset of `joint`, m^2.
    #[must_use]
    pub fn largest_change_m2(&self, joint: usize) -> f64 {
        let right = self.of(joint).next().map_or(f64::NAN, |point| point.variance_m2);
        self.of(joint).map(|point| (point.variance_m2 - right).abs()).fold(0.0, f64::max)
    }

    /// CSV with one line per joint and offset; lengths in m.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut out = String::from("joint,offset_deg,minimum_variance_m2,minimum_distance_m,tool_mean_m,tool_max_m\n");
        for p in &self.points {
            let name = &self.joints[p.joint];
            let _ = writeln!(
                out,
                "{name},{},{:.9e},{:.9e},{:.9e},{:.9e}",
                p.offset_deg, p.variance_m2, p.distance_m, p.tool_mean_m, p.tool_max_m
            );
        }
        out
    }

    /// Figures 4 and 7: objective over the offset, with the tool error above it.
    ///
    /// # Errors
    /// An error of the drawing library.
    pub fn figures(&self) -> Result<[(&'static str, String); 2], String> {
        let figure = |title: &str, unit: &str, objective: fn(&SensitivityPoint) -> f64| {
            let panel = |title: &str, unit: &str, value: fn(&SensitivityPoint) -> f64| {
                let curve = |joint: usize| Series {
                    name: self.joints[joint].clone(),
                    color: None,
                    style: Style::Line,
                    points: self.of(joint).map(|p| [p.offset_deg, value(p)]).collect(),
                };
                Panel {
                    title: title.to_owned(),
                    x: ("added to one joint's offset, deg".to_owned(), Axis::Linear),
                    y: (unit.to_owned(), Axis::Linear),
                    is_map: false,
                    series: (0..self.joints.len()).map(curve).collect(),
                }
            };
            svg(&[panel(title, unit, objective), panel("End effector", "mean error, m", |p| p.tool_mean_m)])
        };
        Ok([
            ("figure4.svg", figure("Minimum variance", "sum of variances, m^2", |p| p.variance_m2)?),
            ("figure7.svg", figure("Minimum distance", "sum of distances, m", |p| p.distance_m)?),
        ])
    }

    /// Summary of the figures in Markdown.
    #[must_use]
    pub fn statement(&self) -> String {
        let mut out = format!(
            "True sensors, no noise, {} poses that see {} tags in all. Each joint's offset alone is wrong by 0 to 180 \
             deg.\n\n",
            self.poses, self.tags_seen
        );
        out.push_str(
            "| joint | variance at 5 deg m^2 | at 25 deg | distance at 5 deg m | at 25 deg | tool at 5 deg mm | at 25 \
             deg | largest change of variance m^2 \
             |\n|---|--:|--:|--:|--:|--:|--:|--:|\n",
        );
        for (joint, name) in self.joints.iter().enumerate() {
            let at = |deg: f64, value: fn(&SensitivityPoint) -> f64| {
                self.of(joint).find(|p| p.offset_deg == deg).map_or(f64::NAN, value)
            };
            let _ = writeln!(
                out,
                "| {name} | {:.4} | {:.3} | {:.2} | {:.2} | {:.1} | {:.0} | {:.1e} |",
                at(5.0, |p| p.variance_m2),
                at(25.0, |p| p.variance_m2),
                at(5.0, |p| p.distance_m),
                at(25.0, |p| p.distance_m),
                at(5.0, |p| 1e3 * p.tool_mean_m),
                at(25.0, |p| 1e3 * p.tool_mean_m),
                self.largest_change_m2(joint),
            );
        }
        let first = &self.joints[0];
        let _ = writeln!(
            out,
            "\n{first}: minimum variance is exactly blind to its offset. Over 0 to 180 deg the objective changes by \
             {:.1e} m^2, which is rounding: an offset of the first joint turns every landmark about the first axis \
             alike, and no distance \
             between any two changes. This is a freedom of gauge, not a weak response: no amount of data and no lack \
             of noise removes it. Minimum distance sees it, for it knows where the landmarks \
             are.",
            self.largest_change_m2(0)
        );
        for name in &self.joints[self.n_seen.min(self.joints.len())..] {
            let _ = writeln!(out, "{name}: the camera hangs before it, so that neither objective sees it at all.");
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use armcal_core::robot::{load, load_vehicle};
    use armcal_core::routine::Scene;

    fn swept(seed: u64) -> Sensitivity {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("a vehicle");
        let robot = load(&root.join("titan4")).expect("a robot").mounted_on(&vehicle).expect("mounted");
        let clearance = ClearanceModel::new(&robot, &vehicle, &Scene { seafloor_z_m: None, obstacles: Vec::new() });
        sensitivity(&robot, &clearance, 12, 3, seed).expect("poses")
    }

    #[test]
    fn the_first_joints_offset_changes_no_spread_and_the_others_do() {
        for seed in 1..4 {
            let found = swept(seed);
            assert_eq!(found.points.len(), 6 * 37);
            let at = |joint, deg: f64| *found.of(joint).find(|p| p.offset_deg == deg).expect("a point");
            assert!(found.largest_change_m2(0) < 1e-14, "{}", found.largest_change_m2(0));
            for joint in 1..5 {
                assert!(at(joint, 5.0).variance_m2 > 1e-4, "joint {joint}");
            }
            for joint in 0..5 {
                assert!(at(joint, 0.0).distance_m < 1e-9 && at(joint, 5.0).distance_m > 0.1);
                assert!(at(joint, 0.0).tool_mean_m == 0.0);
            }
            // The camera is mounted before the last joint, and the tool lies on that joint's axis.
            assert!(found.largest_change_m2(5) == 0.0 && at(5, 90.0).tool_max_m < 1e-9);
            // A turn by 25 deg moves no point by more than the reach of 1.922 m allows: 0.83 m.
            assert!((0.3..0.832).contains(&at(0, 25.0).tool_max_m), "{}", at(0, 25.0).tool_max_m);
        }
    }

    #[test]
    fn plots_table_and_statement_hold_every_joint() {
        let found = swept(1);
        let (csv, statement) = (found.csv(), found.statement());
        assert_eq!(csv.lines().count(), 1 + 6 * 37);
        for name in &found.joints {
            assert!(csv.contains(name.as_str()) && statement.contains(name.as_str()), "{name}");
        }
        for (name, svg) in found.figures().expect("figures") {
            assert!(svg.starts_with("<svg") && svg.len() < 60_000, "{name}: {}", svg.len());
        }
    }
}
