//! Types of recorded messages.

use super::error::InputError;
use crate::log::{RawMessage, RosSchema, is_type};

/// Checks a message's type by its whole name: types of other packages may have the same last name and another layout.
pub(super) fn check_type(file: &str, raw: &RawMessage<'_>, types: &[RosSchema]) -> Result<(), InputError> {
    let (file, topic) = (|| file.to_owned(), || raw.topic().to_owned());
    if raw.channel.message_encoding != "cdr" {
        let found = raw.channel.message_encoding.clone();
        return Err(InputError::Encoding { file: file(), topic: topic(), found });
    }
    let found = raw.schema_name();
    if types.iter().any(|schema| is_type(found, schema.name)) {
        return Ok(());
    }
    let last = |name: &str| name.rsplit('/').next().map(str::to_owned);
    let namesake = types.iter().find(|schema| last(schema.name) == last(found)).map(|schema| schema.name);
    let expected = types.iter().map(|schema| schema.name).collect::<Vec<_>>().join(", ");
    Err(InputError::Type { file: file(), topic: topic(), found: found.to_owned(), namesake, expected })
}
