//! Fixtures that are made once in a process and shared by the tests that need them.

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock};

/// One value for each key, made when a test first asks for it and kept until the process ends.
pub(crate) struct Shared<K, V: 'static>(Mutex<BTreeMap<K, &'static OnceLock<V>>>);

impl<K: Ord, V> Shared<K, V> {
    pub(crate) const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// Runs `make` once for each key; who asks meanwhile waits.
    pub(crate) fn get(&self, key: K, make: impl FnOnce() -> V) -> &'static V {
        let slot = *self.0.lock().expect("no holder panics").entry(key).or_insert_with(|| Box::leak(Box::default()));
        slot.get_or_init(make)
    }
}
