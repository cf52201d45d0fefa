//! ROS messages as rosbridge spells them: `null` is no number, bytes are base64, and a time of ROS 1 has fields of its
//! own.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::de::value::{Error, MapDeserializer, SeqDeserializer};
use serde::de::{Error as _, IntoDeserializer, Visitor};
use serde::{Deserialize, Deserializer, forward_to_deserialize_any};
use serde_json::{Value, json};

/// Reads a message of the types of recordings.
pub(super) fn from_json<'de, T: Deserialize<'de>>(json: &'de Value) -> Result<T, String> {
    T::deserialize(Json(json)).map_err(|error| error.to_string())
}

/// Spells times and headers as ROS 1 does.
pub(super) fn spell_as_ros1(json: &mut Value) {
    match json {
        Value::Object(fields) => {
            if let (Some(sec), Some(nanosec)) = (fields.get("sec"), fields.get("nanosec")) {
                *json = json!({ "secs": sec, "nsecs": nanosec });
                return;
            }
            if fields.contains_key("frame_id") {
                fields.insert("seq".to_owned(), json!(0));
            }
            fields.values_mut().for_each(spell_as_ros1);
        }
        Value::Array(items) => items.iter_mut().for_each(spell_as_ros1),
        _ => {}
    }
}

/// Value that is read as any type that it may represent.
struct Json<'a>(&'a Value);

impl<'de> IntoDeserializer<'de, Error> for Json<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Json<'de> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self.0 {
            Value::Null => visitor.visit_f64(f64::NAN),
            Value::Bool(value) => visitor.visit_bool(*value),
            Value::Number(number) => match (number.as_u64(), number.as_i64(), number.as_f64()) {
                (Some(value), ..) => visitor.visit_u64(value),
                (_, Some(value), _) => visitor.visit_i64(value),
                (.., value) => visitor.visit_f64(value.unwrap_or(f64::NAN)),
            },
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Array(items) => {
                let mut items = SeqDeserializer::new(items.iter().map(Json));
                let value = visitor.visit_seq(&mut items)?;
                items.end()?;
                Ok(value)
            }
            Value::Object(fields) => {
                let field = |(name, value): (&'de String, &'de Value)| (ros2_name(name), Json(value));
                visitor.visit_map(MapDeserializer::new(fields.iter().map(field)))
            }
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let Value::String(text) = self.0 else { return self.deserialize_any(visitor) };
        let bytes = STANDARD.decode(text).map_err(|error| Error::custom(format!("base64: {error}")))?;
        visitor.visit_seq(SeqDeserializer::new(bytes.into_iter().map(Byte)))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct tuple tuple_struct map struct enum identifier ignored_any
    }
}

/// Returns the ROS 2 name of a field of ROS 1.
fn ros2_name(name: &str) -> &str {
    match name {
        "secs" => "sec",
        "nsecs" => "nanosec",
        other => other,
    }
}

/// One byte of decoded base64; it deserializes only as a byte.
struct Byte(u8);

impl<'de> IntoDeserializer<'de, Error> for Byte {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Byte {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom("a text where a list belongs"))
    }

    fn deserialize_u8<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_u8(self.0)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::log::ros::{CompressedImage, Header, JointState, Time};

    fn joint_state(position: &Value, velocity: &Value) -> Result<JointState, String> {
        let header = json!({ "seq": 7, "stamp": { "secs": 3, "nsecs": 4 }, "frame_id": "" });
        let names = json!(["a", "b"]);
        let message =
            json!({ "header": header, "name": names, "position": position, "velocity": velocity, "effort": [] });
        from_json(&message)
    }

    #[test]
    fn a_message_of_ros_1_is_read() {
        let read = joint_state(&json!([1, -2.5]), &json!([null, 1e300])).unwrap();
        assert_eq!(read.header, Header { stamp: Time { sec: 3, nanosec: 4 }, frame_id: String::new() });
        assert_eq!(read.position, [1.0, -2.5]);
        assert!(read.velocity[0].is_nan());
    }

    #[test]
    fn what_stands_where_something_else_belongs_is_refused() {
        let none = json!([]);
        for position in [json!("AAAA"), json!(["1"]), json!([[1]]), json!({}), json!([true]), Value::Null] {
            let problem = joint_state(&position, &none).expect_err(&position.to_string());
            assert!(!problem.is_empty());
        }
        for stamp in
            [json!({ "secs": 1 }), json!({ "secs": 1, "sec": 1, "nsecs": 0 }), json!({ "secs": 1.5, "nsecs": 0 })]
        {
            assert!(from_json::<Header>(&json!({ "stamp": stamp, "frame_id": "" })).is_err(), "{stamp}");
        }
        assert!(from_json::<[f64; 2]>(&json!([1, 2, 3])).is_err());
        assert!(from_json::<[f64; 2]>(&json!([1])).is_err());
    }

    #[test]
    fn bytes_are_base64_or_numbers() {
        let image = |data: Value| {
            let header = json!({ "stamp": { "sec": 3, "nanosec": 4 }, "frame_id": "" });
            from_json::<CompressedImage>(&json!({ "header": header, "format": "jpeg", "data": data }))
        };
        let expected = image(json!([255, 216, 0])).unwrap();
        assert_eq!(expected.data, [255, 216, 0]);
        assert_eq!(image(json!("/9gA")), Ok(expected));
        for data in [json!("/9g"), json!("/9g*"), json!([256]), json!([-1]), json!([null]), json!(7)] {
            assert!(image(data.clone()).is_err(), "{data}");
        }
    }

    #[test]
    fn times_are_spelled_as_ros_1_does_wherever_they_are() {
        let time = json!({ "sec": 1, "nanosec": 2 });
        let mut message =
            json!({ "header": { "stamp": time, "frame_id": "" }, "points": [{ "time_from_start": time }] });
        spell_as_ros1(&mut message);
        let time = json!({ "secs": 1, "nsecs": 2 });
        let header = json!({ "seq": 0, "stamp": time, "frame_id": "" });
        assert_eq!(message, json!({ "header": header, "points": [{ "time_from_start": time }] }));
    }
}
