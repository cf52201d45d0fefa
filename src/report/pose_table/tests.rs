use std::path::Path;

use armcal_core::input::{InputMap, SlideUnit, Source, parse_input_map, read_table_contents};
use armcal_core::robot::{Robot, load};

use super::{LookedAt, propose_table_map};
use crate::report::proposed_map::ProposalError;

/// An arm whose first joints have these names.
fn arm(names: &[&str]) -> Robot {
    let mut robot = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4")).expect("it reads");
    for (spec, name) in robot.sensors.iter_mut().zip(names) {
        spec.joint = (*name).to_owned();
    }
    robot
}

fn looked_at(folder: &Path, name: &str, text: &str) -> LookedAt {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    let contents = read_table_contents(&path).expect("a table's ending").expect("it reads");
    LookedAt { path, contents }
}

/// The map that is proposed for tables of these texts.
fn proposed(texts: &[&str], robot: &Robot) -> Result<InputMap, ProposalError> {
    let folder = tempfile::tempdir().expect("a folder");
    let named = texts.iter().zip(["a.csv", "b.csv"]);
    let tables: Vec<LookedAt> = named.map(|(text, name)| looked_at(folder.path(), name, text)).collect();
    let map = folder.path().join("map.toml");
    let found = propose_table_map((&tables[0], tables.get(1)), Some(robot), &map)?;
    Ok(parse_input_map(&map, &found.text)?)
}

const CORNERS: &str = "tag,u0,v0,u1,v1,u2,v2,u3,v3";

#[test]
fn joints_of_a_gantry_are_no_position_of_a_tag() {
    let robot = arm(&["gx", "gy", "gz", "a", "b", "c"]);
    let rows = "600,-70,-33,14,15,16,3,1,1,9,1,9,9,1,9\n500,70,33,24,25,26,3,1,1,9,1,9,9,1,9\n";
    let text = format!("gx [mm],gy [mm],gz [mm],a [deg],b [deg],c [deg],{CORNERS}\n{rows}");
    let map = proposed(&[&text], &robot).expect("a map");
    assert_eq!(map.tag_use, armcal_core::input::TagUse::Corners);
    assert_eq!(map.joint_names["gx"], "gx [mm]");
    assert_eq!(map.joint_lines.slide_unit, SlideUnit::M, "no joint slides");
}

#[test]
fn a_column_of_times_out_of_order_is_used_where_its_rows_are_poses() {
    let robot = arm(&["a1", "a2", "a3", "a4", "a5", "a6"]);
    let has_time = |times: [f64; 4]| {
        let row = |(k, time): (usize, f64)| format!("{time},{}.5,2,3,1,2,3,{k},1,1,9,1,9,9,1,9\n", k / 2);
        let rows: String = [2, 0, 3, 1].map(|k| row((k, times[k]))).concat();
        let map = proposed(&[&format!("time,a1,a2,a3,a4,a5,a6,{CORNERS}\n{rows}")], &robot).expect("a map");
        let Source::Table(layout) = map.source else { panic!("a table") };
        layout.time.is_some()
    };
    assert!(has_time([10.0, 10.0, 12.0, 12.0]));
    // Other joints at one time, and rows too near to each other to be poses.
    assert!(!has_time([12.0, 10.0, 10.0, 12.0]));
    assert!(!has_time([10.0, 10.1, 10.2, 10.3]));
}

#[test]
fn images_with_the_same_names_in_two_folders_join_by_their_whole_names() {
    let robot = arm(&["a1", "a2", "a3", "a4", "a5", "a6"]);
    let names: Vec<String> = (0..6).map(|k| format!("day{}/img_{}.png", k / 3, k % 3)).collect();
    let joints: String = names.iter().enumerate().map(|(k, name)| format!("{name},{k}.5,2,3,1,2,3\n")).collect();
    let joints = format!("image,a1,a2,a3,a4,a5,a6\n{joints}");
    let tags = |name: &dyn Fn(&str) -> String| {
        let rows: String = names.iter().map(|of| format!("{},3,1,1,9,1,9,9,1,9\n", name(of))).collect();
        format!("image,{CORNERS}\n{rows}")
    };
    assert!(proposed(&[&joints, &tags(&str::to_owned)], &robot).is_ok());
    let without_folder = tags(&|of| of.rsplit('/').next().unwrap_or(of).to_owned());
    assert!(matches!(proposed(&[&joints, &without_folder], &robot), Err(ProposalError::Columns { .. })));
}

#[test]
fn tags_side_by_side_are_refused_and_numbered_columns_are_proposed() {
    let robot = arm(&["a1", "a2", "a3", "a4", "a5", "a6"]);
    let wide = |second: &str| {
        let rows = "0.5,2,3,1,2,3,0,0,1,0,0,1\n1.5,2,3,1,2,3,0,0,1,0,0,1\n";
        format!("a1,a2,a3,a4,a5,a6,tag3_x,tag3_y,tag3_z,{second}_x,{second}_y,{second}_z\n{rows}")
    };
    assert!(matches!(proposed(&[&wide("tag5")], &robot), Err(ProposalError::Columns { .. })));
    // The arm's own pose and one tag in one row.
    assert!(proposed(&[&wide("tool0")], &robot).is_ok());
    let columns = "target.translation.0,target.translation.1,target.translation.2,target.quaternion.0,\
        target.quaternion.1,target.quaternion.2,target.quaternion.3,id";
    let text = format!("a1,a2,a3,a4,a5,a6,{columns}\n0.5,2,3,1,2,3,0,0,1,0,0,0,1,4\n1.5,2,3,1,2,3,0,0,1,0,0,0,1,4\n");
    let map = proposed(&[&text], &robot).expect("a map");
    assert_eq!(map.tag_use, armcal_core::input::TagUse::Pose);
}
