//! Files with random changes: no reader and no command panics, hangs or exhausts the memory.
//!
//! Each reader of `fuzz/readers.rs` is called in this process; `program` runs the program under limits.

mod bytes;
mod program;
#[path = "../fuzz/readers.rs"]
mod readers;
mod recording;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use armcal::stats::stream_rng;

use crate::support::root;
use bytes::mutated;
use readers::{READERS, Scratch};

/// Number of changed copies of each file of a corpus, a tenth of that where each is calibrated;
/// `ARMCAL_READER_MUTATIONS` raises it.
const ROUNDS: u32 = 20;
/// Time limit for one file of at most 4 MiB, on a machine with other load.
const LONGEST: Duration = Duration::from_secs(20);

fn corpus(reader: &str) -> Vec<PathBuf> {
    let folder = root().join("fuzz/corpus").join(reader);
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("a corpus").map(|entry| entry.expect("a file").path()).collect();
    files.sort();
    files
}

/// The URDF names in the corpus differ from those in robot.toml, except the first's.
#[test]
fn every_file_of_the_corpora_reads() {
    let scratch = Scratch::new(root());
    for (name, read) in READERS {
        let files = corpus(name);
        assert!(!files.is_empty(), "{name}: no corpus");
        for file in files {
            let bytes = std::fs::read(&file).expect("it reads");
            let is_foreign = name == "urdf" && !file.ends_with("titan4.urdf");
            assert!(read(&scratch, &bytes) != is_foreign, "{}", file.display());
        }
    }
}

fn expect_mutated_files_to_be_survived(rounds: std::ops::Range<u32>) {
    let scratch = Scratch::new(root());
    let (mut n, mut n_taken) = (0, 0);
    for (name, read) in READERS {
        for file in corpus(name) {
            let seed = std::fs::read(&file).expect("it reads");
            let every = if name == "views" { 10 } else { 1 };
            for round in rounds.clone().step_by(every) {
                let given = mutated(&seed, &mut stream_rng(u64::from(round), name));
                let started = Instant::now();
                n_taken += u32::from(read(&scratch, &given));
                let took = started.elapsed();
                assert!(took < LONGEST, "{name}, round {round}: {took:?} for {} bytes", given.len());
                n += 1;
            }
        }
    }
    eprintln!("{n} files, {n_taken} taken");
    assert!(n_taken > 0 && n_taken < n, "{n_taken} of {n}: changes that always or never matter show nothing");
}

#[test]
fn mutated_files_never_panic_and_never_take_long() {
    let rounds = std::env::var("ARMCAL_READER_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(ROUNDS);
    expect_mutated_files_to_be_survived(0..rounds);
}

#[test]
#[ignore = "second tier: 40 more copies of each file, 7 s"]
fn more_mutated_files_never_panic_and_never_take_long() {
    expect_mutated_files_to_be_survived(ROUNDS..3 * ROUNDS);
}
