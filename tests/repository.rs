//! The repository itself: its sources keep their structure, its pages have valid links, quote existing commands and do
//! not grow.

mod commands;
mod links;
mod names;
mod prose;
mod readers;
mod schemas;
mod structure;
mod tables;
mod words;

use std::path::PathBuf;

use crate::support::{files_below, read, root};

/// All pages in Markdown.
fn pages() -> Vec<PathBuf> {
    let mut pages = vec![root().join("README.md")];
    for folder in [".github", "docs", "tests", "benches", "recordings"] {
        pages.extend(files_below(&root().join(folder), "md"));
    }
    pages
}

/// All sources in Rust.
fn sources() -> Vec<PathBuf> {
    let folders = ["src", "tests", "benches", "examples"].map(|folder| root().join(folder));
    folders.iter().flat_map(|folder| files_below(folder, "rs")).collect()
}

#[test]
fn the_citation_has_the_version_of_the_program() {
    let version = concat!("\nversion: ", env!("CARGO_PKG_VERSION"), "\n");
    assert!(read(&root().join("CITATION.cff")).contains(version), "CITATION.cff lacks{version}");
}

/// Fails with all of `violations`, one per line.
#[track_caller]
fn expect_none(violations: &[String]) {
    assert!(violations.is_empty(), "{} violations:\n{}", violations.len(), violations.join("\n"));
}
