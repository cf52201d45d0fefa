//! The repository itself: its sources keep their structure, its pages lead somewhere and quote commands that exist.

mod commands;
mod links;
mod names;
mod prose;
mod readers;
mod structure;

use std::path::PathBuf;

use crate::support::{files_below, root};

/// All pages in Markdown.
fn pages() -> Vec<PathBuf> {
    let mut pages = vec![root().join("README.md")];
    for folder in ["docs", "tests", "benches", "recordings"] {
        pages.extend(files_below(&root().join(folder), "md"));
    }
    pages
}

/// All sources in Rust.
fn sources() -> Vec<PathBuf> {
    let folders = ["src", "tests", "benches", "examples"].map(|folder| root().join(folder));
    folders.iter().flat_map(|folder| files_below(folder, "rs")).collect()
}

/// Fails with all of `violations`, one a line.
#[track_caller]
fn expect_none(violations: &[String]) {
    assert!(violations.is_empty(), "{} violations:\n{}", violations.len(), violations.join("\n"));
}
