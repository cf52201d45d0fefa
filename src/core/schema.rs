//! JSON Schemas of the TOML files, derived from the types that read them.

use schemars::generate::SchemaSettings;
use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value, json};

use crate::document::VERSION;
use crate::kind::Kind;

/// Folder of the committed schemas on the web; the name of the kind and `.json` follow.
const HOME: &str = "https://raw.githubusercontent.com/armcal/armcal/main/src/core/schemas/";

/// Returns the address of a kind's schema.
#[must_use]
pub fn address(kind: Kind) -> String {
    format!("{HOME}{}.json", kind.name())
}

/// Returns the first line of a file of this kind: editors complete and explain keys by the schema that it names.
#[must_use]
pub fn first_line(kind: Kind) -> String {
    format!("#:schema {}\n", address(kind))
}

/// Returns the committed schema of a kind. A test compares each with the types that read its files.
#[must_use]
pub fn committed(kind: Kind) -> &'static str {
    match kind {
        Kind::Robot => include_str!("schemas/robot.json"),
        Kind::SelfCollision => include_str!("schemas/self_collision.json"),
        Kind::Vehicle => include_str!("schemas/vehicle.json"),
        Kind::Routine => include_str!("schemas/routine.json"),
        Kind::Scene => include_str!("schemas/scene.json"),
        Kind::Input => include_str!("schemas/input.json"),
        Kind::TagMap => include_str!("schemas/tag_map.json"),
        Kind::Task => include_str!("schemas/task.json"),
        Kind::Arm => include_str!("schemas/arm.json"),
        Kind::Calibration => include_str!("schemas/calibration.json"),
        Kind::Covariance => include_str!("schemas/covariance.json"),
        Kind::Plan => include_str!("schemas/plan.json"),
    }
}

/// Returns the JSON Schema (draft 7, which editors of TOML read) of a file of this kind that `T` reads.
#[must_use]
pub fn schema_of<T: JsonSchema>(kind: Kind) -> Value {
    let settings = SchemaSettings::draft07().with_transform(Tidy);
    let mut schema = settings.into_generator().into_root_schema_for::<T>().to_value();
    let title = format!("{}, version {VERSION}", kind.in_words());
    if let Value::Object(root) = &mut schema {
        root.insert("$id".to_owned(), address(kind).into());
        root.insert("title".to_owned(), title.into());
        state_head(root, kind);
    }
    schema
}

/// Fixes version and kind, and requires both.
fn state_head(root: &mut Map<String, Value>, kind: Kind) {
    let head = [
        ("version", json!({ "const": VERSION, "description": "Version of the format." })),
        ("kind", json!({ "const": kind.name(), "description": "Kind of the file." })),
    ];
    for (key, value) in head {
        member(root, "properties").insert(key.to_owned(), value);
        let required = root.entry("required").or_insert_with(|| json!([]));
        if let Value::Array(keys) = required {
            keys.retain(|other| other != key);
            keys.insert(0, key.into());
        }
    }
    // The definition is left over from the type of the key.
    if let Some(Value::Object(definitions)) = root.get_mut("definitions") {
        definitions.remove("Kind");
    }
}

/// Returns the object under `key`, and inserts it if it is missing.
fn member<'a>(of: &'a mut Map<String, Value>, key: &str) -> &'a mut Map<String, Value> {
    let value = of.entry(key).or_insert_with(|| json!({}));
    if !value.is_object() {
        *value = json!({});
    }
    match value {
        Value::Object(object) => object,
        _ => unreachable!("an object was put there"),
    }
}

/// Removes what TOML lacks (null) and what only Rust uses (formats of numbers), and joins the lines of sentences.
#[derive(Clone, Debug)]
struct Tidy;

impl Transform for Tidy {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else { return };
        if let Some(Value::String(text)) = object.get_mut("description") {
            *text = text.replace('\n', " ");
        }
        let is_number = |name: &Value| name == "number" || name == "integer";
        let is_of_numbers = object.get("type").is_some_and(|kind| match kind {
            Value::Array(kinds) => kinds.iter().any(is_number),
            one => is_number(one),
        });
        if is_of_numbers {
            object.remove("format");
        }
        if object.get("default") == Some(&Value::Null) {
            object.remove("default");
        }
        if let Some(Value::Array(kinds)) = object.get_mut("type") {
            kinds.retain(|kind| kind != "null");
            if let [only] = kinds.as_slice() {
                let only = only.clone();
                object.insert("type".to_owned(), only);
            }
        }
        without_null(object);
        state_units(object);
    }
}

/// Replaces `anyOf` of a schema and null by that schema.
fn without_null(object: &mut Map<String, Value>) {
    let Some(Value::Array(any)) = object.get_mut("anyOf") else { return };
    any.retain(|one| one.get("type").is_none_or(|kind| kind != "null"));
    if let [Value::Object(only)] = any.as_slice() {
        let only = only.clone();
        object.remove("anyOf");
        if only.contains_key("$ref") && !object.is_empty() {
            object.insert("allOf".to_owned(), json!([only]));
        } else {
            object.extend(only);
        }
    }
}

/// Units by the suffix of a key's name, longer suffixes first.
const UNITS: [(&str, &str); 45] = [
    ("_counts_per_deg", "counts/deg"),
    ("_counts_per_mm", "counts/mm"),
    ("_rad_per_sqrt_turn", "rad/sqrt(turn)"),
    ("_rad_per_sqrt_h", "rad/sqrt(h)"),
    ("_rad_per_count", "rad/count"),
    ("_rad_per_mpa", "rad/MPa"),
    ("_rad_per_nm", "rad/(N m)"),
    ("_rad_per_k", "rad/K"),
    ("_rad_per_h", "rad/h"),
    ("_m_per_sqrt_h", "m/sqrt(h)"),
    ("_m_per_k", "m/K"),
    ("_m_per_n", "m/N"),
    ("_l_per_min", "L/min"),
    ("_l_per_rad", "L/rad"),
    ("_l_per_m", "L/m"),
    ("_j_per_k", "J/K"),
    ("_n_m_s_rad", "N m s/rad"),
    ("_electrons_per_cd_m2", "m2/cd"),
    ("_per_mpa", "1/MPa"),
    ("_per_m3", "1/m3"),
    ("_per_px", "1/px"),
    ("_per_sr", "1/sr"),
    ("_per_m", "1/m"),
    ("_per_s", "1/s"),
    ("_per_k", "1/K"),
    ("_cd_m2", "cd/m2"),
    ("_kg_m2", "kg m2"),
    ("_kg_m3", "kg/m3"),
    ("_rad_s", "rad/s"),
    ("_m_s", "m/s"),
    ("_n_m", "N m"),
    ("_mpa", "MPa"),
    ("_ppm", "ppm"),
    ("_deg", "deg"),
    ("_rad", "rad"),
    ("_lux", "lux"),
    ("_lm", "lm"),
    ("_kg", "kg"),
    ("_pa", "Pa"),
    ("_px", "px"),
    ("_hz", "Hz"),
    ("_m", "m"),
    ("_s", "s"),
    ("_n", "N"),
    ("_c", "deg C"),
];

/// Returns the unit that a key's name states.
fn unit_of(key: &str) -> Option<&'static str> {
    let ends = |(end, unit): &(&str, &'static str)| key.ends_with(end).then_some(*unit);
    UNITS.iter().find_map(ends).or_else(|| key.ends_with("_k").then_some("K"))
}

/// Annotates numbers, and lists of them, with their unit.
fn state_units(object: &mut Map<String, Value>) {
    let Some(Value::Object(keys)) = object.get_mut("properties") else { return };
    for (key, schema) in keys {
        let Value::Object(schema) = schema else { continue };
        let mut innermost = &*schema;
        while let Some(Value::Object(items)) = innermost.get("items") {
            innermost = items;
        }
        let is_number = innermost.get("type").is_some_and(|kind| kind == "number");
        if let Some(unit) = unit_of(key).filter(|_| is_number) {
            schema.insert("unit".to_owned(), unit.into());
        }
    }
}

/// Returns the schema of a table whose key `tag` has this value, given the schema of its other keys.
#[must_use]
pub fn tagged(mut schema: Schema, tag: &str, value: &str, description: &str) -> Schema {
    let object = schema.ensure_object();
    object.insert("type".to_owned(), "object".into());
    object.insert("description".to_owned(), description.into());
    member(object, "properties").insert(tag.to_owned(), json!({ "const": value }));
    if let Value::Array(keys) = object.entry("required").or_insert_with(|| json!([])) {
        keys.insert(0, tag.into());
    }
    schema
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_the_longest_end_of_a_keys_name() {
        let units = [
            ("clearance_m", "m"),
            ("noise_rad_per_sqrt_h", "rad/sqrt(h)"),
            ("max_rate_rad_s", "rad/s"),
            ("oil_rise_k", "K"),
            ("joint_compliance_std_rad_per_nm", "rad/(N m)"),
        ];
        for (key, unit) in units {
            assert_eq!(unit_of(key), Some(unit), "{key}");
        }
        assert_eq!(unit_of("gain_std"), None);
        for (at, (end, _)) in UNITS.iter().enumerate() {
            let hides = |(shorter, _): &&(&str, &str)| end.ends_with(shorter);
            assert!(UNITS[..at].iter().find(hides).is_none(), "{end} is never reached");
        }
    }
}
