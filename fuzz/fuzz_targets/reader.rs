//! The reader that the target is named after, fed with any bytes.
#![no_main]

#[path = "../readers.rs"]
mod readers;

use std::cell::OnceCell;
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use readers::{READERS, Scratch};

thread_local! {
    static SCRATCH: OnceCell<Scratch> = const { OnceCell::new() };
}

fuzz_target!(|bytes: &[u8]| {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let (_, read) = READERS.into_iter().find(|(name, _)| *name == env!("CARGO_BIN_NAME")).expect("a reader's name");
    SCRATCH.with(|scratch| read(scratch.get_or_init(|| Scratch::new(root)), bytes));
});
