//! Drawings about the arm: the uncertainty of its tool, the residuals of the tags, and the nearest part.

use std::path::Path;

use crate::rerun::components::{Color, HalfSize3D, LineStrip3D, Text, Translation3D};
use crate::rerun::{Boxes3D, Component, ComponentDescriptor, Ellipsoids3D, LineStrips3D, Points3D};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::{chunks, entities, input, small};
use crate::*;
use armcal_belief::calib::{CornerResidual, ObservedTag, ViewResidual};
use armcal_belief::session::ToolBelief;
use armcal_core::log::{RecordingHeader, RecordingWriter, ros};
use armcal_core::robot::{Part, PlacedShape, Robot, Shape};
use armcal_core::routine::Scene;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::streams::JointAngles;
use armcal_core::time::SIMULATION_EPOCH;

/// Returns the rows of one component of an entity: times, s, and values.
fn rows<C: Component>(rrd: &Path, entity: &str, component: &ComponentDescriptor) -> Vec<(f64, Vec<C>)> {
    let mut rows = Vec::new();
    for chunk in chunks(rrd).iter().filter(|chunk| chunk.entity_path().to_string() == entity && !chunk.is_static()) {
        let (_, times) = chunk.timelines().iter().next().expect("a timeline");
        for (row, time) in times.times_raw().iter().enumerate() {
            if let Some(batch) = chunk.component_batch::<C>(component.component, row) {
                rows.push((*time as f64 * 1e-9, batch.expect("it decodes")));
            }
        }
    }
    rows
}

/// The ellipsoid has the size of the estimate's covariance: sensors by the datasheet, then a hundred times as accurate,
/// then unknown.
#[test]
fn the_ellipsoid_is_about_the_believed_tool_and_as_large_as_the_belief_says() {
    let (dir, recording, truth, robot) = small();
    let mut better = robot.clone();
    for spec in &mut better.sensors {
        spec.offset_std_rad *= 0.01;
        spec.gain_std *= 0.01;
        spec.linearity_std_rad *= 0.01;
    }
    let of = |robot: &Robot| Some(ToolBelief::by_datasheet(robot, &ArmSensors::nominal(robot)));
    let at = |time_s: f64| SIMULATION_EPOCH.plus_s(time_s);
    let beliefs = [(at(0.0), of(&robot)), (at(8.0), of(&better)), (at(12.0), None)];
    let shown = ReplayInput { truth: Some(&truth), tool_beliefs: &beliefs, ..input(&recording, &robot) };
    let out = dir.path().join("run.rrd");
    write_rrd(&shown, &out).unwrap();
    let run = crate::recording::scene(&shown).unwrap();
    let carrier = entities(&out).into_keys().find(|entity| entity.ends_with("/tool_95_percent")).expect("an ellipsoid");
    let carrier = carrier.trim_end_matches("tool_95_percent");
    assert!(carrier.contains("/base/believed_arm/6_"), "{carrier}");
    for (name, belief, span_s, factor) in [
        ("tool_95_percent", &beliefs[0].1, 0.0..8.0, 1.0),
        ("tool_95_percent_drawn_20_times_as_large", &beliefs[1].1, 8.0..12.0, 20.0),
    ] {
        let entity = format!("{carrier}{name}");
        let centers = rows::<Translation3D>(&out, &entity, &Ellipsoids3D::descriptor_centers());
        let sizes = rows::<HalfSize3D>(&out, &entity, &Ellipsoids3D::descriptor_half_sizes());
        assert!(sizes.len() > 2 && centers.len() == sizes.len(), "{name}: {}", sizes.len());
        for ((time_s, center), (_, size)) in centers.iter().zip(&sizes) {
            assert!(span_s.contains(time_s), "{name}: {time_s}");
            let angles = run.tracks.believed.at(*time_s).unwrap();
            let poses = run.believed_poses(*time_s, angles);
            let center = Point3::from(Vector3::from(center[0].0.0.map(f64::from)));
            let off_m = (poses.link(6) * center).coords - poses.frame(&robot.tool.mount).translation.vector;
            assert!(off_m.norm() < 1e-6, "{name}: {off_m}");
            let covariance_m2 = belief.as_ref().unwrap().position_m2(angles, &Conditions::default()).unwrap();
            // 95 % of three dimensions are 2.7955 sigma.
            let longest_m = 2.7955 * covariance_m2.symmetric_eigenvalues().max().sqrt();
            let drawn_m = size[0].0.0.into_iter().map(f64::from).fold(0.0, f64::max);
            assert!((drawn_m / (factor * longest_m) - 1.0).abs() < 0.02, "{name}: {drawn_m} {longest_m}");
        }
        let style = entities(&out)[&entity] - sizes.len();
        assert_eq!(style, 2, "{name}: its style, and its end");
    }
}

/// Without truth there is one arm, and without an estimate no ellipsoid.
#[test]
fn the_ellipsoid_belongs_to_the_one_arm_that_is_shown() {
    let (dir, recording, _, robot) = small();
    let out = dir.path().join("run.rrd");
    let beliefs = [(SIMULATION_EPOCH, Some(ToolBelief::by_datasheet(&robot, &ArmSensors::nominal(&robot))))];
    write_rrd(&ReplayInput { tool_beliefs: &beliefs, ..input(&recording, &robot) }, &out).unwrap();
    let found = |out: &Path| entities(out).into_keys().filter(|entity| entity.contains("tool_95")).collect::<Vec<_>>();
    assert!(found(&out).iter().all(|entity| entity.contains("/base/arm/6_")) && found(&out).len() == 2);
    write_rrd(&input(&recording, &robot), &out).unwrap();
    assert!(found(&out).is_empty());
}

/// Returns the residuals of one view: each tag's corners are off by the given number of px; a negative number is
/// rejected.
fn seen(offs: &[(u32, f64)]) -> ViewResidual {
    let tag = |&(id, off_px): &(u32, f64)| {
        let corner = CornerResidual { seen_px: [9.0; 2], off_px: [off_px, 0.0], is_used: true };
        ObservedTag { id, off_m: 0.001, corners: [Some(corner); 4], is_used: off_px >= 0.0 }
    };
    ViewResidual {
        pose_idx: 0,
        end: SIMULATION_EPOCH,
        datasheet_rad: JointAngles::zeros(6),
        calibrated_rad: JointAngles::zeros(6),
        joint_error_rad: None,
        tags: offs.iter().map(tag).collect(),
    }
}

/// Frames about the observed tags appear from the calibration on.
#[test]
fn tags_are_coloured_by_what_the_calibration_left_of_them() {
    let (dir, recording, _, robot) = small();
    let out = dir.path().join("run.rrd");
    let ids: Vec<u32> = robot.tags.iter().map(|tag| tag.id).collect();
    let offs = [0.3, 0.2, 0.4, 0.7, 2.0, -1.0];
    let [first, second] = [1.0, 0.0].map(|more_px| {
        let offs = ids.iter().copied().zip(offs.map(|px: f64| if px > 0.0 { px + more_px } else { px }));
        vec![seen(&offs.collect::<Vec<_>>()), seen(&[])]
    });
    let at = |time_s: f64| SIMULATION_EPOCH.plus_s(time_s);
    let residuals = [(at(5.0), &first[..]), (at(9.0), &second[..])];
    write_rrd(&ReplayInput { residuals: &residuals, ..input(&recording, &robot) }, &out).unwrap();
    let entity = "/world/vehicle/base/tags/residuals";
    let shades = rows::<Color>(&out, entity, &Boxes3D::descriptor_colors());
    let times_s: Vec<f64> = shades.iter().map(|(time_s, _)| *time_s).collect();
    assert_eq!(times_s, [5.0, 9.0]);
    let [green, amber, red] = [colors::HIT, colors::TARGET, colors::MISS].map(Color::from);
    assert_eq!(shades[0].1, [green, green, green, green, amber, red], "off alike");
    assert_eq!(shades[1].1, [green, green, green, amber, red, red]);
    let centers = rows::<Translation3D>(&out, entity, &Boxes3D::descriptor_centers());
    for (center, tag) in centers[1].1.iter().zip(&robot.tags) {
        let off_m = Vector3::from(center.0.0.map(f64::from)) - tag.base_from_tag.origin().vector();
        assert!(off_m.norm() < 1e-6, "{}: {off_m}", tag.id);
    }
    let labels = rows::<Text>(&out, "/world/vehicle/base/tags/ids", &Points3D::descriptor_labels());
    let of_row = |row: usize| labels[row].1.iter().map(|text| text.as_str().to_owned()).collect::<Vec<_>>();
    let (before, after) = (of_row(0), of_row(2));
    assert_eq!(before.len(), robot.tags.len());
    assert_eq!(after[..3], before[..3], "green");
    assert_eq!(after[3], format!("{}: 0.70 px", before[3]));
    assert_eq!(after[5], format!("{}: rejected", before[5]));
    assert_eq!(after[6..], before[6..], "not seen");
}

/// Writes the nearest two parts at given times, s, as truth.mcap has them.
fn write_clearances(truth: &Path, robot: &Robot, clearances: &[(f64, f64)]) {
    #[derive(serde::Serialize)]
    struct Clearance {
        header: ros::Header,
        distance_m: f64,
        part_a: String,
        part_b: &'static str,
    }
    let mut writer = RecordingWriter::create(truth, RecordingHeader::new(Vec::new())).unwrap();
    let schema = armcal_core::log::RosSchema { name: "armcal_msgs/msg/Clearance", text: "" };
    for &(time_s, distance_m) in clearances {
        let stamp = SIMULATION_EPOCH.plus_s(time_s);
        let header = ros::Header { stamp: stamp.try_into().unwrap(), frame_id: String::new() };
        let part_a = robot.bodies[6].name.clone();
        let clearance = Clearance { header, distance_m, part_a, part_b: "rock" };
        writer.write_ros("/truth/clearance", &schema, stamp, &clearance).unwrap();
    }
    writer.finish().unwrap();
}

/// The line leads from the last link to a rock below the tool, by the truth's distances. Beyond three times the
/// required clearance there is none.
#[test]
fn a_line_shows_how_near_the_nearest_part_is() {
    let (dir, recording, _, robot) = small();
    let (out, truth) = (dir.path().join("run.rrd"), dir.path().join("clearances.mcap"));
    write_clearances(&truth, &robot, &[(3.0, 0.13), (9.0, 0.19), (6.0, 0.07), (13.0, 0.04)]);
    let run = crate::recording::scene(&input(&recording, &robot)).unwrap();
    let tool_m = |time_s: f64| run.believed_tool(time_s).unwrap().origin().vector();
    let placed = PlacedShape {
        owner_from_shape: Isometry3::from(Translation3::from(tool_m(3.0) - Vector3::new(0.0, 0.0, 0.2))),
        shape: Shape::Sphere { radius_m: 0.05 },
        color_rgb: [9; 3],
    };
    let scene = Scene { seafloor_z_m: None, obstacles: vec![Part { name: "rock".into(), placed: placed.clone() }] };
    let shown =
        ReplayInput { truth: Some(&truth), scene: Some(&scene), clearance_m: Some(0.06), ..input(&recording, &robot) };
    write_rrd(&shown, &out).unwrap();
    let entity = "/world/vehicle/base/nearest";
    let shades = rows::<Color>(&out, entity, &LineStrips3D::descriptor_colors());
    let [green, amber, red] = [colors::HIT, colors::TARGET, colors::MISS].map(Color::from);
    let found: Vec<(f64, Color)> = shades.iter().map(|(time_s, shades)| (*time_s, shades[0])).collect();
    assert_eq!(found, [(3.0, green), (6.0, amber), (13.0, red)]);
    assert_eq!(entities(&out)[entity], 3 + 2, "with its style, and its end");
    let strips = rows::<LineStrip3D>(&out, entity, &LineStrips3D::descriptor_strips());
    let ends = strips[0].1[0].0.iter().map(|end| Vector3::from(end.0.map(f64::from))).collect::<Vec<_>>();
    let center_m = placed.owner_from_shape.translation.vector;
    assert!(((ends[1] - center_m).norm() - 0.05).abs() < 1e-6, "on the rock: {}", ends[1]);
    let link = run.robot.chain.link_poses(run.tracks.believed.at(3.0).unwrap());
    let on_link = |shape: &PlacedShape| {
        let local = link.link(6).inverse_transform_point(&ends[0].into());
        shape.distance_m(&local)
    };
    let off_m = robot.bodies[6].collisions.iter().map(on_link).fold(f64::INFINITY, f64::min);
    assert!(off_m < 1e-6, "on the link: {off_m}");
}
