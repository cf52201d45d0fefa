//! The repository itself: its sources keep their structure, its pages lead somewhere and quote commands that exist.

mod commands;
mod links;
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

/// Fails with all of `violations`, one a line.
#[track_caller]
fn expect_none(violations: &[String]) {
    assert!(violations.is_empty(), "{} violations:\n{}", violations.len(), violations.join("\n"));
}
