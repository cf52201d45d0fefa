//! Files that users name are opened in one place, which limits the size that is read.

use super::expect_none;
use super::structure::without_tests;
use crate::support::{files_below, read, root};

/// Calls that open or read a file without limits.
const UNBOUNDED: [&str; 5] = ["fs::read(", "read_to_string(", "File::open(", "OpenOptions::new(", "toml::from_str"];
/// Files that may use them, with reasons: the bounded reader itself; a run's own files, synced to disk; a campaign's
/// own rows, locked; a plan's picture, read back. Further: TOML with its entries counted, and read again for missing
/// ones; a value of the command line; the truth of the run itself; settings of tests. Further: the system's data on
/// this process; the lock of a growing file; the explanations of codes, which are in the program.
const ALLOWED: [(&str, &str); 13] = [
    ("core/files.rs", "File::open("),
    ("output/folder.rs", "File::open("),
    ("campaign/store.rs", "OpenOptions::new("),
    ("cli/plan.rs", "fs::read("),
    ("core/codes/explanation.rs", "toml::from_str"),
    ("core/robot/error.rs", "toml::from_str"),
    ("core/robot/error/toml_errors.rs", "toml::from_str"),
    ("core/routine/overrides.rs", "toml::from_str"),
    ("sim/truth/reader.rs", "toml::from_str"),
    ("belief/plan/view_planning/fixture.rs", "toml::from_str"),
    ("cli/interrupt.rs", "read_to_string("),
    ("live/memory.rs", "read_to_string("),
    ("output/beside.rs", "File::open("),
];

#[test]
fn no_file_is_read_without_limits() {
    let src = root().join("src");
    let mut violations = Vec::new();
    let mut used = Vec::new();
    for file in files_below(&src, "rs") {
        let place = file.strip_prefix(&src).expect("below").to_string_lossy().into_owned();
        if place.ends_with("tests.rs") || place.contains("/tests/") {
            continue;
        }
        let text = without_tests(&read(&file));
        for what in UNBOUNDED.into_iter().filter(|what| text.contains(what)) {
            match ALLOWED.iter().find(|allowed| **allowed == (place.as_str(), what)) {
                Some(allowed) => used.push(allowed),
                None => violations.push(format!("src/{place}: `{what}..)` reads without limits; use core::files")),
            }
        }
    }
    let unused = ALLOWED.iter().filter(|allowed| !used.contains(allowed));
    violations.extend(unused.map(|(place, what)| format!("src/{place} no longer has `{what}..)`: strike it off")));
    expect_none(&violations);
}
