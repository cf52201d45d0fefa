//! JSON Schemas: the committed ones are those of the types that read the files. Every TOML file of the repository
//! states a kind that has one. `INSTA_UPDATE=always` updates them. The schema of a connection map is tested in
//! `tests/live`.

use std::fs;
use std::path::Path;

use armcal_core::kind::Kind;
use armcal_core::schema::{committed, first_line};
use armcal_core::{input, robot, routine};
use serde_json::Value;

use super::expect_none;
use crate::support::{answer, program, read, root, temp, write};

/// Kinds and the schemas of their types.
fn of_types() -> [(Kind, Value); 11] {
    [
        (Kind::Robot, robot::robot_schema()),
        (Kind::SelfCollision, robot::self_collision_schema()),
        (Kind::Vehicle, robot::vehicle_schema()),
        (Kind::Routine, armcal::sim::routine_schema()),
        (Kind::Scene, routine::scene_schema()),
        (Kind::Input, input::input_schema()),
        (Kind::Task, input::task_schema()),
        (Kind::TagMap, armcal::tagmap::files::tag_map_schema()),
        (Kind::Calibration, armcal::calib::calibration_schema()),
        (Kind::Covariance, armcal::calib::covariance_schema()),
        (Kind::Plan, armcal::plan::plan_schema()),
    ]
}

#[test]
fn the_committed_schemas_are_those_of_the_types() {
    let is_renewed = std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always");
    let mut stale = Vec::new();
    for (kind, schema) in of_types() {
        let text = format!("{}\n", serde_json::to_string_pretty(&schema).expect("JSON"));
        if is_renewed {
            let file = root().join("src/core/schemas").join(format!("{}.json", kind.name()));
            fs::write(file, text).expect("written");
        } else if committed(kind) != text {
            stale.push(format!("{}: not the schema of its type; INSTA_UPDATE=always renews it", kind.name()));
        }
    }
    expect_none(&stale);
}

/// Editors explain a key by its description.
#[test]
fn each_key_of_a_schema_has_a_description() {
    let mut silent = Vec::new();
    for kind in Kind::ALL {
        let schema: Value = serde_json::from_str(committed(kind)).expect("JSON");
        look_below(&schema, kind.name(), &mut silent);
        assert_eq!(first_line(kind), format!("#:schema {}\n", schema["$id"].as_str().expect("an address")));
    }
    expect_none(&silent);
}

fn look_below(schema: &Value, place: &str, silent: &mut Vec<String>) {
    let Value::Object(object) = schema else {
        schema.as_array().into_iter().flatten().for_each(|one| look_below(one, place, silent));
        return;
    };
    for (name, below) in object {
        if name == "properties" {
            for (key, of_key) in below.as_object().into_iter().flatten() {
                let is_tag = of_key.get("const").is_some();
                // The description of a variant is next to its only key.
                let is_variant =
                    below.as_object().is_some_and(|keys| keys.len() == 1) && object.contains_key("description");
                let has_words = is_variant || of_key["description"].as_str().is_some_and(|text| text.ends_with('.'));
                if !has_words && !is_tag {
                    silent.push(format!("{place}: {key} has no sentence"));
                }
                look_below(of_key, &format!("{place}.{key}"), silent);
            }
        } else {
            look_below(below, place, silent);
        }
    }
}

/// An independent validator refuses these files by the schemas: tests/oracle/schemas.py.
#[test]
fn check_refuses_what_the_schemas_refuse() {
    let folder = temp();
    for part in ["robots", "routines", "tests/cases", "recordings/sample"] {
        copy_folder(&root().join(part), &folder.path().join(part));
    }
    let falsified = read(&root().join("tests/golden/falsified-files.csv"));
    let mut rows = csv::Reader::from_reader(falsified.as_bytes());
    let (mut n_rows, mut accepted) = (0, Vec::new());
    for row in rows.records() {
        let row = row.expect("a row");
        let (file, key, value) = (folder.path().join(&row[0]), &row[1], &row[2]);
        let text = read(&file);
        write(&file, &falsified_text(&text, key, value));
        let checked = if file.ends_with("robot.toml") { file.parent().expect("a folder") } else { &file };
        let told = answer(program().arg("check").arg(checked));
        if told.code != 2 {
            accepted.push(format!("{}: {key} = {value}: {told:?}", &row[0]));
        }
        write(&file, &text);
        n_rows += 1;
    }
    assert!(n_rows >= 30, "{n_rows}");
    expect_none(&accepted);
}

/// The text with `value` at the dotted `key`, or without the key for an empty value.
fn falsified_text(text: &str, key: &str, value: &str) -> String {
    let mut table = toml::Value::Table(text.parse().expect("TOML"));
    falsify(&mut table, key, value);
    table.to_string()
}

fn falsify(place: &mut toml::Value, key: &str, value: &str) {
    let wrong = || format!("x = {value}").parse::<toml::Table>().expect("TOML").remove("x").expect("a value");
    let (step, below) = key.split_once('.').map_or((key, None), |(step, below)| (step, Some(below)));
    let index = || step.parse::<usize>().expect("an index");
    match (place, below) {
        (toml::Value::Table(table), Some(below)) => falsify(table.get_mut(step).expect("there"), below, value),
        (toml::Value::Array(list), Some(below)) => falsify(&mut list[index()], below, value),
        (toml::Value::Table(table), None) if value.is_empty() => drop(table.remove(step)),
        (toml::Value::Table(table), None) => drop(table.insert(step.to_owned(), wrong())),
        (toml::Value::Array(list), None) => list[index()] = wrong(),
        (other, _) => panic!("{key}: {other}"),
    }
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("made");
    for entry in fs::read_dir(from).expect("a folder").flatten() {
        let (path, copy) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy_folder(&path, &copy);
        } else {
            fs::copy(path, copy).expect("copied");
        }
    }
}
