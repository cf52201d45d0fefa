//! docs/words.toml: how many words each page may have, and how often pages, messages and comments may use a phrase that
//! is nearly always wrong. `WORDS=lower cargo test --release --test main words` lowers the table to today's counts.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::sync::LazyLock;

use regex::{Regex, RegexBuilder, RegexSetBuilder};
use serde::Deserialize;

use super::expect_none;
use super::links::prose;
use super::tables::{KEYS, OPTIONS};
use crate::support::{files_below, read, root};

const TABLE: &str = "docs/words.toml";
/// Pattern of a source's comments, strings and characters. It includes characters because one of them is a quotation
/// mark.
static TOKENS: LazyLock<Regex> = LazyLock::new(|| {
    let tokens = r####"(?xs)
        //[^\n]* | /\*.*?\*/
        | r"[^"]*" | r\#".*?"\# | r\#\#".*?"\#\# | "(?:\\.|[^"\\])*"
        | '(?:\\.[^']*|[^'\\])'"####;
    Regex::new(tokens).expect("a regular expression")
});

static TARGETS: LazyLock<Regex> = LazyLock::new(|| Regex::new(r"\]\([^)]*\)").expect("a regular expression"));

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    total: Total,
    pages: BTreeMap<String, Page>,
    phrases: BTreeMap<String, Phrase>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Total {
    words: usize,
    target: usize,
    /// Limits the number of pages above their target, so that no new page exceeds it.
    pages_above_target: usize,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Page {
    words: usize,
    target: usize,
}

/// Allowed number of a phrase's occurrences; without a number there is no limit.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Phrase {
    instead: String,
    docs: Option<usize>,
    messages: Option<usize>,
    comments: Option<usize>,
}

/// Words by page, and hits by phrase in docs, messages and comments.
struct Today {
    pages: BTreeMap<String, usize>,
    hits: BTreeMap<String, [usize; 3]>,
}

/// Paragraphs of one source, each joined into one line. A comment begins with its marker, such as `///`.
#[derive(Debug, Default, PartialEq)]
struct Prose {
    messages: Vec<String>,
    comments: Vec<String>,
}

fn regex(pattern: &str) -> Regex {
    // Without Unicode `\b` costs little; the phrases are ASCII.
    RegexBuilder::new(pattern).unicode(false).build().unwrap_or_else(|e| panic!("{TABLE}: {e}"))
}

/// The text on one line, so that a phrase is found across line breaks.
fn on_one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Removes code: every second piece between backticks.
fn without_code(text: &str) -> String {
    text.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

impl Prose {
    fn of(source: &str) -> Self {
        let mut prose = Self::default();
        // End of the last line comment, and its marker.
        let mut last = (0, "");
        for token in TOKENS.find_iter(source) {
            let text = token.as_str();
            if text.starts_with("//") {
                let marker = ["///", "//!", "//"].into_iter().find(|marker| text.starts_with(marker)).unwrap_or("//");
                let continues = marker == last.1 && source[last.0..token.start()].trim().is_empty();
                match prose.comments.last_mut().filter(|_| continues) {
                    Some(comment) => *comment += &text[marker.len()..],
                    None => prose.comments.push(text.to_owned()),
                }
                last = (token.end(), marker);
            } else if text.starts_with("/*") {
                prose.comments.push(text.to_owned());
            } else if !text.starts_with('\'') {
                prose.messages.push(on_one_line(&text.trim_start_matches(['r', '#']).replace("\\\n", "")));
            }
        }
        prose.comments.iter_mut().for_each(|comment| *comment = on_one_line(&without_code(comment)));
        prose
    }
}

/// Paragraphs of a page, without code and targets of links.
fn paragraphs(page: &str) -> Vec<String> {
    let text = prose(page);
    TARGETS.replace_all(&text, "]").split("\n\n").map(on_one_line).filter(|paragraph| !paragraph.is_empty()).collect()
}

/// Number of each pattern's occurrences in `texts`.
fn hits(patterns: &[&str], texts: &[String]) -> Vec<usize> {
    let set = RegexSetBuilder::new(patterns).unicode(false).build().unwrap_or_else(|e| panic!("{TABLE}: {e}"));
    let each: Vec<Regex> = patterns.iter().map(|pattern| regex(pattern)).collect();
    let mut hits = vec![0; patterns.len()];
    for text in texts {
        set.matches(text).into_iter().for_each(|k| hits[k] += each[k].find_iter(text).count());
    }
    hits
}

impl Today {
    fn count(patterns: &[&str]) -> Self {
        let mut files = files_below(&root().join("docs"), "md");
        files.push(root().join("README.md"));
        // These pages repeat words of comments and of `--help`, which are counted there.
        files.retain(|file| ![KEYS, OPTIONS].iter().any(|made| file.ends_with(made)));
        let (mut pages, mut docs, mut messages, mut comments) = (BTreeMap::new(), vec![], vec![], vec![]);
        for file in files {
            let text = read(&file);
            let name = file.strip_prefix(root()).expect("a page of the repository").to_string_lossy().into_owned();
            pages.insert(name, text.split_whitespace().count());
            docs.extend(paragraphs(&text));
        }
        let test_module = regex(r"#\[cfg\(test\)\]\s*mod tests \{");
        for file in files_below(&root().join("src"), "rs") {
            let text = read(&file);
            comments.extend(Prose::of(&text).comments);
            if !file.iter().any(|part| part == "tests" || part == "tests.rs") {
                messages.extend(Prose::of(test_module.split(&text).next().unwrap_or_default()).messages);
            }
        }
        let [docs, messages, comments] = [docs, messages, comments].map(|texts| hits(patterns, &texts));
        let of = |(k, pattern): (usize, &&str)| ((*pattern).to_owned(), [docs[k], messages[k], comments[k]]);
        Self { pages, hits: patterns.iter().enumerate().map(of).collect() }
    }

    fn words(&self) -> usize {
        self.pages.values().sum()
    }
}

impl Phrase {
    fn allowed(&self) -> [Option<usize>; 3] {
        [self.docs, self.messages, self.comments]
    }
}

impl Table {
    /// Number of pages of `today` that are above their target, with `today`'s words.
    fn n_above_target(&self, today: &Today) -> usize {
        let is_above =
            |(name, words): &(&String, &usize)| self.pages.get(*name).is_some_and(|page| page.target < **words);
        today.pages.iter().filter(is_above).count()
    }

    fn violations(&self, today: &Today) -> Vec<String> {
        let mut found = Vec::new();
        for (name, words) in &today.pages {
            match self.pages.get(name) {
                None => found.push(format!(
                    "{name}: {words} words and no entry in {TABLE}; add one with its target and cut as many words \
                     elsewhere"
                )),
                Some(page) if *words > page.words => {
                    found.push(format!("{name}: {words} words; its entry in {TABLE} allows {}", page.words));
                }
                Some(_) => {}
            }
        }
        let gone = self.pages.keys().filter(|name| !today.pages.contains_key(*name));
        found.extend(gone.map(|name| format!("{name}: no such page; remove its entry from {TABLE}")));
        let (n_above, targets) = (self.n_above_target(today), self.pages.values().map(|page| page.target).sum());
        let limits = [
            ("words in all pages", today.words(), self.total.words),
            ("pages above their target (a new page enters at its target)", n_above, self.total.pages_above_target),
            ("words in all targets", targets, self.total.target),
        ];
        let above = limits.into_iter().filter(|(_, n, allowed)| n > allowed);
        found.extend(above.map(|(what, n, allowed)| format!("{n} {what}; {TABLE} allows {allowed}")));
        for (pattern, phrase) in &self.phrases {
            let places = ["docs", "messages", "comments"].into_iter().zip(today.hits[pattern]).zip(phrase.allowed());
            found.extend(places.filter_map(|((place, n), allowed)| {
                let allowed = allowed.filter(|allowed| n > *allowed)?;
                let instead = &phrase.instead;
                Some(format!("{place}: {n} times `{pattern}`; {TABLE} allows {allowed}. Say: {instead}"))
            }));
        }
        found
    }

    /// This table with each entry that is above `today`'s count lowered to it, and without pages that are gone.
    fn lowered(&self, today: &Today) -> Self {
        let mut table = self.clone();
        table.pages.retain(|name, _| today.pages.contains_key(name));
        table.pages.iter_mut().for_each(|(name, page)| page.words = page.words.min(today.pages[name]));
        table.total.words = table.total.words.min(today.words());
        table.total.pages_above_target = table.total.pages_above_target.min(self.n_above_target(today));
        for (pattern, phrase) in &mut table.phrases {
            let places = [&mut phrase.docs, &mut phrase.messages, &mut phrase.comments];
            for (allowed, n) in places.into_iter().zip(today.hits[pattern]) {
                *allowed = allowed.map(|allowed| allowed.min(n));
            }
        }
        table
    }

    /// The table's file after its head comment.
    fn text(&self) -> String {
        let Total { words, target, pages_above_target } = self.total;
        let mut text = format!(
            "[total]\nwords = {words}\ntarget = {target}\npages_above_target = {pages_above_target}\n\n[pages]\n"
        );
        for (name, Page { words, target }) in &self.pages {
            writeln!(text, "\"{name}\" = {{ words = {words}, target = {target} }}").expect("a string takes it");
        }
        text += "\n[phrases]\n";
        for (pattern, phrase) in &self.phrases {
            write!(text, "'{pattern}' = {{ instead = \"{}\"", phrase.instead).expect("a string takes it");
            for (place, allowed) in ["docs", "messages", "comments"].into_iter().zip(phrase.allowed()) {
                text += &allowed.map(|n| format!(", {place} = {n}")).unwrap_or_default();
            }
            text += " }\n";
        }
        text
    }
}

#[test]
fn words_and_phrases_are_within_their_table() {
    let file = root().join(TABLE);
    let text = read(&file);
    let mut table: Table = toml::from_str(&text).unwrap_or_else(|e| panic!("{TABLE}: {e}"));
    let patterns: Vec<&str> = table.phrases.keys().map(String::as_str).collect();
    let today = Today::count(&patterns);
    if std::env::var("WORDS").is_ok_and(|what| what == "lower") {
        table = table.lowered(&today);
        let head: String =
            text.lines().take_while(|line| line.starts_with('#')).map(|line| format!("{line}\n")).collect();
        fs::write(&file, head + &table.text()).expect("the table is written");
    }
    expect_none(&table.violations(&today));
}

#[test]
fn prose_of_a_source_is_its_comments_and_strings() {
    let source = r####"/// Of the joint,
    /// as it `hangs`.
    // Why.
    fn f<'a>(c: &'a char) { g("a \
        b", '"', r#"no // comment"#, '\'', "say \"c\""); } // End.
    "####;
    let prose = Prose::of(source);
    assert_eq!(prose.comments, ["/// Of the joint, as it `.", "// Why.", "// End."]);
    assert_eq!(prose.messages, ["\"a b\"", "\"no // comment\"#", r#""say \"c\"""#]);
}

#[test]
fn phrases_are_counted_across_lines_and_not_in_code() {
    let page =
        "It rests\non oil, rests on `it rests on` [the base](rests on.md).\n\n```\nrests on\n```\nIt rests\n\non";
    assert_eq!(paragraphs(page).len(), 3);
    let counted = hits(&["rests? on", r"\bbase\b", r"\w \.\. \w"], &paragraphs(page));
    assert_eq!(counted, [2, 1, 0]);
    assert_eq!(hits(&["^//[/!] (Of|Whether) "], &["/// Of it, /// Of".to_owned(), "// Of it".to_owned()]), [1]);
}

#[test]
fn entries_limit_and_only_fall() {
    let total = Total { words: 30, target: 25, pages_above_target: 1 };
    let page = |words, target| Page { words, target };
    let phrase = Phrase { instead: "again".to_owned(), docs: Some(2), messages: Some(1), comments: None };
    let pages = BTreeMap::from([("a".to_owned(), page(20, 5)), ("b".to_owned(), page(10, 10))]);
    let table = Table { total, pages, phrases: BTreeMap::from([("anew".to_owned(), phrase)]) };
    let today = |pages: &[(&str, usize)], hits| Today {
        pages: pages.iter().map(|(name, words)| ((*name).to_owned(), *words)).collect(),
        hits: BTreeMap::from([("anew".to_owned(), hits)]),
    };
    let violations = |pages: &[(&str, usize)], hits| table.violations(&today(pages, hits)).join("\n");
    assert_eq!(violations(&[("a", 20), ("b", 10)], [2, 1, 99]), "");
    let grown = violations(&[("a", 21), ("b", 10)], [2, 2, 0]);
    assert!(grown.contains("a: 21 words") && grown.contains("31 words in all"), "{grown}");
    assert!(grown.contains("messages: 2 times `anew`") && !grown.contains("docs: 2"), "{grown}");
    let exchanged = violations(&[("a", 20), ("c", 3)], [0; 3]);
    assert!(exchanged.contains("c: 3 words and no entry") && exchanged.contains("b: no such page"), "{exchanged}");
    // A page that was added to the table above its target.
    let mut with_new = table.clone();
    with_new.pages.insert("new".to_owned(), page(4, 3));
    let found = with_new.violations(&today(&[("a", 16), ("b", 10), ("new", 4)], [0; 3])).join("\n");
    assert!(found.contains("2 pages above their target"), "{found}");
    let lower = table.lowered(&today(&[("a", 4)], [3, 0, 7]));
    assert_eq!(lower.pages, BTreeMap::from([("a".to_owned(), page(4, 5))]));
    assert_eq!(lower.total, Total { words: 4, target: 25, pages_above_target: 0 });
    assert_eq!(lower.phrases["anew"].allowed(), [Some(2), Some(0), None]);
    assert_eq!(toml::from_str::<Table>(&lower.text()).expect("its own text"), lower);
}
