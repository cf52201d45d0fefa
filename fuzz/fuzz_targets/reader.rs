//! The reader that the program is named after, fed with any bytes: a copy under another name feeds another reader.
#![no_main]

#[path = "../readers.rs"]
mod readers;

use std::cell::OnceCell;
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use readers::{READERS, Read, Scratch};

thread_local! {
    static SCRATCH: OnceCell<(Scratch, Read)> = const { OnceCell::new() };
}

fn named_reader() -> Read {
    let program = std::env::current_exe().expect("a program");
    let is_named = |(name, _): &(&str, Read)| program.file_name().is_some_and(|file| file == *name);
    READERS.into_iter().find(is_named).expect("the program is named after a reader").1
}

fuzz_target!(|bytes: &[u8]| {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    SCRATCH.with(|scratch| {
        let (scratch, read) = scratch.get_or_init(|| (Scratch::new(root), named_reader()));
        read(scratch, bytes)
    });
});
