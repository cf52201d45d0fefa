//! JSON Schema of a routine with the keys that only the simulator reads: `[world]` and faults.

use armcal_core::kind::Kind;
use armcal_core::routine;
use armcal_core::schema::schema_of;
use serde_json::{Map, Value, json};

use crate::fault::{Fault, LATEST_FAULT_S};
use crate::spec::world_spec::WorldSpec;

/// Returns the schema of a routine.
#[must_use]
pub fn routine_schema() -> Value {
    let mut routine = routine::schema();
    let world = world_schema();
    let faults = parts_of(schema_of::<Fault>(Kind::Routine)).0;
    routine["properties"]["world"] = world.0;
    let at_s =
        json!({ "type": "number", "minimum": 0.0, "maximum": LATEST_FAULT_S, "description": "Time since the start." });
    routine["properties"]["world"]["properties"]["fault"]["items"] =
        json!({ "type": "object", "oneOf": faults_with(&faults, "at_s", &at_s) });
    if let Some(Value::Array(steps)) = routine.pointer_mut("/properties/step/items/oneOf") {
        let is_fault = |step: &Value| step.pointer("/properties/do/const").is_some_and(|name| name == "fault");
        steps.retain(|step| !is_fault(step));
        steps.extend(faults_with(&faults, "do", &json!({ "const": "fault" })));
    }
    if let Value::Object(definitions) = &mut routine["definitions"] {
        definitions.extend(world.1);
        definitions.remove("ScheduledFault");
    }
    routine
}

/// Returns a schema without its head, and its definitions.
fn parts_of(mut schema: Value) -> (Value, Map<String, Value>) {
    let Value::Object(root) = &mut schema else { return (schema, Map::new()) };
    let definitions = root.remove("definitions");
    for key in ["$schema", "$id", "title"] {
        root.remove(key);
    }
    for key in ["version", "kind"] {
        root.get_mut("properties").and_then(Value::as_object_mut).map(|keys| keys.remove(key));
    }
    root.remove("required");
    let definitions = if let Some(Value::Object(definitions)) = definitions { definitions } else { Map::new() };
    (schema, definitions)
}

/// Returns the schema of `[world]` and its definitions, with the allowed ranges of numbers.
fn world_schema() -> (Value, Map<String, Value>) {
    let (mut world, mut definitions) = parts_of(schema_of::<WorldSpec>(Kind::Routine));
    for figure in WorldSpec::figures() {
        let mut path = figure.key.split('.').skip(1);
        let (Some(table), Some(key)) = (path.next(), path.next()) else { continue };
        let reference = &world["properties"][table];
        let of_table = reference.get("$ref").or_else(|| reference.pointer("/allOf/0/$ref")).and_then(Value::as_str);
        let Some(name) = of_table.and_then(|of| of.rsplit('/').next()) else { continue };
        let Some(property) = definitions.get_mut(name).map(|of| &mut of["properties"][key]) else { continue };
        property["minimum"] = json!(figure.range.start());
        property["maximum"] = json!(figure.range.end());
    }
    // Tables state their own defaults.
    if let Some(Value::Object(tables)) = world.get_mut("properties") {
        tables.values_mut().filter_map(Value::as_object_mut).for_each(|table| drop(table.remove("default")));
    }
    (world, definitions)
}

/// Returns each kind of fault with one more key, which it needs.
fn faults_with(faults: &Value, key: &str, value: &Value) -> Vec<Value> {
    let each = faults["oneOf"].as_array().into_iter().flatten();
    each.map(|fault| {
        let mut table = fault.clone();
        table["properties"][key] = value.clone();
        if let Some(keys) = table["required"].as_array_mut() {
            keys.insert(0, key.into());
        }
        table
    })
    .collect()
}
