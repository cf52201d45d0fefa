//! Names that the pages quote in code: files, items and tests of the sources, and the words of the glossary.

use std::collections::BTreeSet;
use std::fs;

use super::{expect_none, pages, sources};
use crate::support::root;

/// Pieces of `page` between backticks, with the number of their line; fenced blocks are left out.
fn quoted(page: &str) -> Vec<(usize, String)> {
    let mut is_fenced = false;
    let mut pieces = Vec::new();
    for (n, line) in page.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        } else if !is_fenced {
            pieces.extend(line.split('`').skip(1).step_by(2).map(|piece| (n + 1, piece.to_owned())));
        }
    }
    pieces
}

/// Identifiers of all sources, and the names of their files and folders.
fn known_words() -> BTreeSet<String> {
    let mut words = BTreeSet::new();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    for file in sources() {
        let text = fs::read_to_string(&file).expect("a source reads");
        words.extend(text.split(|c| !is_word(c)).filter(|word| !word.is_empty()).map(str::to_owned));
        let below = file.strip_prefix(root()).expect("a source of the repository");
        let parts = below.iter().filter_map(|part| part.to_str());
        words.extend(parts.map(|part| part.trim_end_matches(".rs").to_owned()));
    }
    words
}

/// True if `word` is known; a word that ends in `..` is the beginning of a name.
fn is_known(words: &BTreeSet<String>, word: &str) -> bool {
    match word.strip_suffix("..") {
        Some(start) => words.range(start.to_owned()..).next().is_some_and(|next| next.starts_with(start)),
        None => words.contains(word),
    }
}

/// True for `a::b::c`, whose last part may end in `..`.
fn is_path_of_items(piece: &str) -> bool {
    let is_word = |word: &str| {
        !word.is_empty() && word.trim_end_matches("..").chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    piece.contains("::") && piece.split("::").all(is_word)
}

fn is_path_of_file(piece: &str) -> bool {
    let tops = ["src/", "tests/", "docs/", "examples/", "benches/", "routines/", "robots/"];
    tops.iter().any(|top| piece.starts_with(top))
        && piece.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c))
}

#[test]
fn quoted_files_and_items_exist() {
    /// Crates whose items are not ours.
    const EXTERNAL: [&str; 3] = ["std", "rand", "rapier3d"];
    let words = known_words();
    let (mut violations, mut n_checked) = (Vec::new(), 0);
    for page in pages().into_iter().filter(|page| !page.ends_with("decisions.md")) {
        for (line, piece) in quoted(&fs::read_to_string(&page).expect("a page reads")) {
            let is_missing = if is_path_of_file(&piece) {
                !root().join(&piece).exists()
            } else if is_path_of_items(&piece) && !EXTERNAL.iter().any(|name| piece.starts_with(name)) {
                piece.split("::").any(|word| !is_known(&words, word))
            } else {
                continue;
            };
            n_checked += 1;
            if is_missing {
                violations.push(format!("{}:{line}: `{piece}` does not exist", page.display()));
            }
        }
    }
    assert!(n_checked > 100, "only {n_checked} names were found");
    expect_none(&violations);
}

/// The last column of the glossary is the word to search for.
#[test]
fn the_words_of_the_glossary_are_in_the_sources() {
    let words = known_words();
    let text = fs::read_to_string(root().join("docs/glossary.md")).expect("the glossary reads");
    let rows: Vec<&str> = text.lines().filter(|line| line.starts_with("| ") && line.contains('`')).collect();
    assert!(rows.len() > 50, "only {} rows", rows.len());
    let is_missing = |row: &&&str| row.split('`').nth(1).is_none_or(|word| !words.contains(word));
    let missing: Vec<String> = rows.iter().filter(is_missing).map(|row| (*row).to_owned()).collect();
    expect_none(&missing);
}
