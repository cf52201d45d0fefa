//! Tests that name a fragment of prose: a better sentence would break them. Codes, figures and snapshots do not.

use std::collections::BTreeSet;
use std::fs;

use super::sources;
use crate::support::root;

/// Largest number of tests that may name prose; it may only be lowered.
const MOST: usize = 23;
/// Least number of words for prose in a literal that is searched in a text; `COMPARED_WORDS` is that of a compared
/// text.
const SEARCHED_WORDS: usize = 2;
const COMPARED_WORDS: usize = 3;
const SEARCHES: [&str; 6] = ["contains", "starts_with", "ends_with", "strip_prefix", "find", "matches"];

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Literal(String),
    Sign(char),
}

impl Token {
    fn is(&self, word: &str) -> bool {
        matches!(self, Self::Word(found) if found == word)
    }

    fn opens(&self) -> bool {
        matches!(self, Self::Sign('(' | '[' | '{'))
    }

    fn closes(&self) -> bool {
        matches!(self, Self::Sign(')' | ']' | '}'))
    }
}

/// Returns the end of a literal that begins after `start`, and its text; `#` signs of a raw literal are `n_signs`.
fn literal(text: &[char], start: usize, n_signs: Option<usize>) -> (usize, String) {
    let (mut at, mut found) = (start, String::new());
    while at < text.len() {
        match (text[at], n_signs) {
            ('"', None) => return (at + 1, found),
            ('"', Some(n)) if text[at + 1..].iter().take_while(|c| **c == '#').count() >= n => {
                return (at + 1 + n, found);
            }
            ('\\', None) => {
                // Only an escaped new line differs from the character after the sign: it ends a row of words.
                let escaped = text.get(at + 1).copied().unwrap_or(' ');
                found.push(if escaped == 'n' { '\n' } else { escaped });
                at += 2;
            }
            (c, _) => {
                found.push(c);
                at += 1;
            }
        }
    }
    (at, found)
}

/// Splits a source into words, literals and signs; comments, characters and lifetimes are left out.
fn tokens(source: &str) -> Vec<Token> {
    let text: Vec<char> = source.chars().collect();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let (mut at, mut found) = (0, Vec::new());
    while at < text.len() {
        let (c, next) = (text[at], text.get(at + 1).copied().unwrap_or(' '));
        if c == '/' && next == '/' {
            at += text[at..].iter().take_while(|c| **c != '\n').count();
        } else if c == '"' {
            let (end, literal) = literal(&text, at + 1, None);
            found.push(Token::Literal(literal));
            at = end;
        } else if c == '\'' {
            // 'a', '\n', '\u{1b}'; or the lifetime 'a.
            let is_escape = next == '\\';
            let end = text[at + 2..].iter().take(if is_escape { 10 } else { 1 }).position(|c| *c == '\'');
            at = end.map_or(at + 1, |end| at + 3 + end);
        } else if is_word(c) {
            let word: String = text[at..].iter().take_while(|c| is_word(**c)).collect();
            at += word.chars().count();
            let n_signs = text[at..].iter().take_while(|c| **c == '#').count();
            if ["r", "b", "br"].contains(&word.as_str()) && text.get(at + n_signs) == Some(&'"') {
                let (end, literal) = literal(&text, at + n_signs + 1, word.contains('r').then_some(n_signs));
                // Byte literals are no text.
                found.push(if word.starts_with('b') { Token::Sign('b') } else { Token::Literal(literal) });
                at = end;
            } else {
                found.push(Token::Word(word));
            }
        } else {
            found.extend((!c.is_whitespace()).then_some(Token::Sign(c)));
            at += 1;
        }
    }
    found
}

/// The tokens from the opening sign at `start` to the one that closes it.
fn group(tokens: &[Token], start: usize) -> &[Token] {
    let mut depth = 0;
    for (n, token) in tokens[start..].iter().enumerate() {
        depth += i32::from(token.opens()) - i32::from(token.closes());
        if depth == 0 {
            return &tokens[start..=start + n];
        }
    }
    &tokens[start..]
}

/// An item with a name and a body: a function, a closure, a constant.
struct Item<'a> {
    name: String,
    is_test: bool,
    body: &'a [Token],
}

fn name_after<'a>(tokens: &'a [Token], at: usize, word: &str) -> Option<&'a str> {
    match (&tokens[at], tokens.get(at + 1)?) {
        (first, Token::Word(name)) if first.is(word) => Some(name),
        _ => None,
    }
}

/// Functions, constants and closures of a source, nested ones as well.
fn items(tokens: &[Token]) -> Vec<Item<'_>> {
    let test = [Token::Sign('#'), Token::Sign('['), Token::Word("test".into()), Token::Sign(']')];
    let (mut found, mut is_test) = (Vec::new(), false);
    for at in 0..tokens.len() {
        is_test |= tokens[at..].starts_with(&test);
        if let Some(name) = name_after(tokens, at, "fn") {
            let body = tokens[at..].iter().position(|token| matches!(token, Token::Sign('{' | ';')));
            let body = body.map_or(&tokens[..0], |n| group(tokens, at + n));
            found.push(Item { name: name.to_owned(), is_test, body });
            is_test = false;
        }
        let bound = ["const", "static", "let"].into_iter().find_map(|word| name_after(tokens, at, word));
        if let Some(name) = bound {
            let (mut depth, mut end) = (0, at);
            while end < tokens.len() && (depth > 0 || tokens[end] != Token::Sign(';')) && depth >= 0 {
                depth += i32::from(tokens[end].opens()) - i32::from(tokens[end].closes());
                end += 1;
            }
            found.push(Item { name: name.to_owned(), is_test: false, body: &tokens[at..end] });
        }
    }
    found
}

/// True if `literal` has at least `n` consecutive words of prose. Code, paths, keys with values, and words in capitals
/// such as SQL's and a verdict's do not count.
fn is_prose(literal: &str, n: usize) -> bool {
    let is_code = |word: &str| {
        word.contains(|c: char| "_/=<>\\\n$|{}".contains(c) || c.is_ascii_digit())
            || !word.contains(|c: char| c.is_lowercase())
    };
    let (mut longest, mut in_a_row) = (0, 0);
    for word in literal.split(' ') {
        let letters = word.trim_matches(|c: char| !c.is_alphabetic()).chars().count();
        in_a_row = if letters > 1 && !is_code(word) { in_a_row + 1 } else { 0 };
        longest = longest.max(in_a_row);
        if word.ends_with(':') {
            in_a_row = 0;
        }
    }
    longest >= n
}

/// The arguments of each call of `name` in `body`, split at commas.
fn calls<'a>(body: &'a [Token], name: &str) -> Vec<Vec<&'a [Token]>> {
    let mut found = Vec::new();
    for at in 0..body.len().saturating_sub(2) {
        let open = if body[at + 1] == Token::Sign('!') { at + 2 } else { at + 1 };
        let is_definition = at > 0 && (body[at - 1].is("fn") || body[at - 1].is("let"));
        if body[at].is(name) && !is_definition && body[open] == Token::Sign('(') {
            let inside = group(body, open);
            let inside = &inside[1..inside.len().max(2) - 1];
            let mut depth = 0;
            let arguments = inside.split(|token| {
                depth += i32::from(token.opens()) - i32::from(token.closes());
                depth == 0 && *token == Token::Sign(',')
            });
            found.push(arguments.filter(|argument| !argument.is_empty()).collect());
        }
    }
    found
}

/// True if `body` searches for texts that come from elsewhere, by itself or by a function that does.
fn searches_for_variables(body: &[Token], searching: &BTreeSet<String>) -> bool {
    let is_variable = |argument: &&[Token]| matches!(argument, [Token::Word(_)] | [Token::Sign('*'), Token::Word(_)]);
    let by_itself = SEARCHES
        .iter()
        .any(|name| calls(body, name).iter().any(|arguments| arguments.first().is_some_and(is_variable)));
    // An answer's `expect` takes several texts at once; a result's `expect` has one argument.
    let of_answer = calls(body, "expect").iter().any(|arguments| arguments.len() > 2);
    by_itself || of_answer || searching.iter().any(|name| !calls(body, name).is_empty())
}

/// Literals among tokens, without the messages of a result's `expect`.
fn literals(tokens: &[Token]) -> impl Iterator<Item = &String> {
    let is_said = |at: usize| {
        at > 1 && tokens[at - 1] == Token::Sign('(') && (tokens[at - 2].is("expect") || tokens[at - 2].is("expect_err"))
    };
    tokens.iter().enumerate().filter_map(move |(at, token)| match token {
        Token::Literal(text) if !is_said(at) => Some(text),
        _ => None,
    })
}

/// Literals within brackets, and those given to functions that search.
fn handed_on<'a>(body: &'a [Token], searching: &BTreeSet<String>) -> Vec<&'a String> {
    let brackets = (0..body.len()).filter(|at| body[*at] == Token::Sign('[')).map(|at| group(body, at));
    let is_index = |tokens: &&[Token]| tokens.len() > 2;
    let mut found: Vec<&String> = brackets.filter(is_index).flat_map(literals).collect();
    for arguments in searching.iter().flat_map(|name| calls(body, name)) {
        found.extend(arguments.into_iter().filter(|argument| argument.len() == 1).flat_map(literals));
    }
    found
}

/// Fragments of prose that a test names.
fn named_prose(test: &Item<'_>, all: &[Item<'_>], searching: &BTreeSet<String>) -> BTreeSet<String> {
    let body = test.body;
    let mut found: Vec<&String> = Vec::new();
    for name in SEARCHES {
        let arguments = calls(body, name).into_iter().flat_map(|arguments| arguments.into_iter().take(1));
        found.extend(arguments.flat_map(literals).filter(|text| is_prose(text, SEARCHED_WORDS)));
    }
    if searches_for_variables(body, searching) {
        let is_used = |item: &&Item<'_>| !item.is_test && body.iter().any(|token| token.is(&item.name));
        let is_constant = |item: &&Item<'_>| item.body.first().is_some_and(|word| word.is("const"));
        let constants = all.iter().filter(is_constant).filter(is_used);
        let bodies = std::iter::once(body).chain(constants.map(|item| item.body));
        found.extend(bodies.flat_map(|body| handed_on(body, searching)).filter(|text| is_prose(text, SEARCHED_WORDS)));
    }
    for name in ["assert_eq", "assert_ne"] {
        let sides = calls(body, name).into_iter().flat_map(|arguments| arguments.into_iter().take(2));
        found.extend(sides.flat_map(literals).filter(|text| is_prose(text, COMPARED_WORDS)));
    }
    for three in body.windows(3) {
        if let [Token::Sign('=' | '!'), Token::Sign('='), Token::Literal(text)] = three {
            found.extend(is_prose(text, COMPARED_WORDS).then_some(text));
        }
    }
    found.into_iter().cloned().collect()
}

/// Names of functions and closures that search for their arguments.
fn searching<'a>(items: impl Iterator<Item = &'a Item<'a>> + Clone) -> BTreeSet<String> {
    let mut searching = BTreeSet::new();
    // Three rounds find helpers of helpers.
    for _ in 0..3 {
        let is_helper = |item: &&Item<'_>| !item.is_test && item.name != "expect" && item.body.len() > 3;
        let more = items.clone().filter(is_helper).filter(|item| searches_for_variables(item.body, &searching));
        let more: Vec<String> = more.map(|item| item.name.clone()).collect();
        searching.extend(more);
    }
    searching
}

/// Tests of a source that name prose, with their fragments.
fn tests_of(source: &str) -> Vec<(String, BTreeSet<String>)> {
    let tokens = tokens(source);
    let items = items(&tokens);
    let searching = searching(items.iter());
    let tests = items.iter().filter(|item| item.is_test);
    let named = tests.map(|test| (test.name.clone(), named_prose(test, &items, &searching)));
    named.filter(|(_, prose)| !prose.is_empty()).collect()
}

#[test]
fn few_tests_name_a_fragment_of_prose() {
    let mut found = Vec::new();
    for file in sources().into_iter().filter(|file| !file.ends_with("repository/prose.rs")) {
        let below = file.strip_prefix(root()).expect("a source of the repository").display().to_string();
        for (test, prose) in tests_of(&fs::read_to_string(&file).expect("a source reads")) {
            found.push(format!("{below}: {test}: {:?}", prose.first().expect("one")));
        }
    }
    let (n, list) = (found.len(), found.join("\n"));
    assert!(n <= MOST, "{n} tests name prose, at most {MOST} may: assert codes, figures or snapshots\n{list}");
}

#[test]
fn tests_that_name_prose_are_found() {
    let names = |source: &str| tests_of(source).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    let found = r##"
        const CASES: &[(&str, &str)] = &[("a", "is outside the range")];
        fn refused(words: &[&str]) { for word in words { assert!(said().contains(word)); } }
        #[test] fn direct() { assert!(text.contains("cannot be read")); }
        #[test] fn start() { assert!(text.starts_with(r#"no such "file""#)); }
        #[test] fn formatted() { assert!(text.contains(&format!("{n} rows are left"))); }
        #[test] fn array() { refused(&["a.toml", "is outside the range"]); }
        #[test] fn answered() { answer(x).expect("what", 2, &["cannot be read"]); }
        #[test] fn table() { for (what, word) in CASES { assert!(said(what).contains(word)); } }
        #[test] fn closure() { let check = |word: &str| refused(&[word]); check("cannot be read"); }
        #[test] fn whole() { assert_eq!(text, "nothing was written"); }
        #[test] fn equal() { assert!(text == "nothing was written"); }
        #[test] fn unwrapped() { assert_eq!(read().expect("it reads back"), "nothing was written"); }
    "##;
    let expected =
        ["direct", "start", "formatted", "array", "answered", "table", "closure", "whole", "equal", "unwrapped"];
    assert_eq!(names(found), expected);
    let none = r##"
        #[test] fn code() { assert_eq!(error.code(), Code::ValueOutOfRange); }
        #[test] fn word() { assert!(text.contains("[value_out_of_range]") && text.contains("robot.toml")); }
        #[test] fn message() { let x = load().expect("the robot reads"); assert!(x.ok, "it is not well"); }
        #[test] fn range() { assert!((0.1..0.3).contains(&x), "{x} is too far off"); }
        #[test] fn comment() { /* by hand */ assert!(x); } // .contains("cannot be read")
        #[test] fn answered() { answer(x).expect("what is said", 2, &["robot.toml", "value_out_of_range"]); }
        #[test] fn data() { assert_eq!(read("CREATE TABLE A").expect("it reads back"), "| {a} | $HOME |"); }
        #[test] fn snapshot() { insta::assert_snapshot!("help of run", text); }
    "##;
    assert_eq!(names(none), [""; 0]);
}
