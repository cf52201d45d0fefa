//! Relative links and anchors of the pages.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{expect_none, pages};

/// A page without its code: fenced blocks and inline code.
pub(super) fn prose(page: &str) -> String {
    let mut is_fenced = false;
    let mut text = String::new();
    for line in page.lines() {
        let is_fence = line.trim_start().starts_with("```");
        is_fenced ^= is_fence;
        if !is_fenced && !is_fence {
            text += line;
        }
        text.push('\n');
    }
    // Every second piece between backticks is code; its line breaks stay.
    let pieces = text.split('`').enumerate();
    pieces
        .map(
            |(k, piece)| {
                if k % 2 == 0 { piece.to_owned() } else { "\n".repeat(piece.lines().count().saturating_sub(1)) }
            },
        )
        .collect()
}

/// Targets of links and images, with the number of their line.
fn targets(page: &str) -> Vec<(usize, String)> {
    let prose = prose(page);
    let ends = prose.match_indices("](").filter_map(|(at, _)| {
        let target = prose[at + 2..].split(')').next()?;
        Some((prose[..at].lines().count(), target.split_whitespace().next()?.to_owned()))
    });
    ends.collect()
}

/// Anchors of a page's headings by GitHub's rule: lower case, punctuation dropped, hyphens for spaces, repetitions
/// numbered.
fn anchors(page: &str) -> Vec<String> {
    let mut is_fenced = false;
    let mut n_of: BTreeMap<String, usize> = BTreeMap::new();
    let mut anchors = Vec::new();
    for line in page.lines() {
        is_fenced ^= line.trim_start().starts_with("```");
        let heading = line.trim_start_matches('#');
        if is_fenced || heading.len() == line.len() || !heading.starts_with(' ') {
            continue;
        }
        let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        let slug: String = kept.collect::<String>().to_lowercase().replace(' ', "-");
        let n = n_of.entry(slug.clone()).or_default();
        anchors.push(if *n == 0 { slug } else { format!("{slug}-{n}") });
        *n += 1;
    }
    anchors
}

/// Reason that a link of `page` is broken.
fn problem(page: &Path, target: &str) -> Option<String> {
    let (file, anchor) = target.split_once('#').map_or((target, None), |(file, anchor)| (file, Some(anchor)));
    let linked = if file.is_empty() { page.to_owned() } else { page.parent()?.join(file) };
    if !linked.exists() {
        return Some("no such file".to_owned());
    }
    let anchor = anchor.filter(|_| linked.extension().is_some_and(|extension| extension == "md"))?;
    let known = anchors(&fs::read_to_string(&linked).ok()?);
    (!known.iter().any(|known| known == anchor)).then(|| format!("no such heading among {known:?}"))
}

#[test]
fn links_lead_somewhere() {
    let mut violations = Vec::new();
    let mut n_links = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("the page reads");
        let is_relative = |target: &String| !["http:", "https:", "mailto:"].iter().any(|s| target.starts_with(s));
        for (line, target) in targets(&text).into_iter().filter(|(_, target)| is_relative(target)) {
            n_links += 1;
            let why = problem(&page, &target);
            violations.extend(why.map(|why| format!("{}:{line}: {target}: {why}", page.display())));
        }
    }
    assert!(n_links > 100, "{n_links} links");
    expect_none(&violations);
}

#[test]
fn anchors_are_those_of_github() {
    let page =
        "# `[world]` and faults\n```sh\n# no heading\n```\n## Sensor: noise, drift\n## Sensor: noise, drift\n#no\n";
    assert_eq!(anchors(page), ["world-and-faults", "sensor-noise-drift", "sensor-noise-drift-1"]);
    assert_eq!(
        targets("a [b](c.md#d)\n`[x](y)` ![e](f.png \"t\")"),
        [(1, "c.md#d".to_owned()), (2, "f.png".to_owned())]
    );
}
