//! Joints by the names that others give them.

use std::collections::BTreeSet;

/// The name that others have for a joint: its own, or the only one that begins or ends with it.
#[must_use]
pub fn likely_name<'a>(joint: &str, names: &'a BTreeSet<String>) -> Option<&'a String> {
    if let Some(same) = names.get(joint) {
        return Some(same);
    }
    let mut like = names.iter().filter(|name| name.ends_with(joint) || name.starts_with(joint));
    like.next().filter(|_| like.next().is_none())
}
