//! Command lines that the pages quote.

use std::fs;

use armcal::cli::command;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use super::{expect_none, pages};

/// Place of a command line in a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Block,
    /// Inline code may name a command without its required arguments.
    Inline,
}

/// The command lines of a page, from their subcommand on.
fn quoted(page: &str) -> Vec<(Place, String)> {
    let mut is_fenced = false;
    let (mut found, mut prose) = (Vec::new(), String::new());
    for line in page.lines() {
        let is_fence = line.trim_start().starts_with("```");
        is_fenced ^= is_fence;
        if is_fenced || is_fence || line.starts_with("    ") {
            // A prompt or a host name may come before the program.
            let after = |start: &str| line.split_once(start).map(|(_, rest)| rest);
            let rest = after("cargo run --release -- ").or_else(|| after(" armcal ")).or(line.strip_prefix("armcal "));
            let rest = rest.map(|rest| rest.split(" #").next().unwrap_or_default().trim().to_owned());
            found.extend(rest.map(|rest| (Place::Block, rest)));
        } else {
            prose += line;
            prose.push(' ');
        }
    }
    let spans = prose.split('`').skip(1).step_by(2);
    found.extend(spans.filter_map(|span| Some((Place::Inline, span.strip_prefix("armcal ")?.to_owned()))));
    found.retain(|(_, rest)| rest.starts_with(|first: char| first.is_ascii_lowercase()));
    found
}

/// Words as a shell splits them, without the brackets that mark optional ones.
fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let (mut quote, mut is_optional) = (None, false);
    for c in line.chars() {
        let word = words.last_mut().expect("never empty");
        match c {
            _ if quote == Some(c) => quote = None,
            '\'' | '"' if quote.is_none() => quote = Some(c),
            ' ' if quote.is_none() => words.push(String::new()),
            '[' if quote.is_none() && word.is_empty() => is_optional = true,
            ']' if quote.is_none() && is_optional => is_optional = false,
            c => word.push(c),
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// True for a placeholder of a value: `N`, `A..B`, `KEY=VALUE`, `...`
fn is_placeholder(word: &str) -> bool {
    !word.contains(|c: char| c.is_ascii_lowercase() || c.is_ascii_digit())
}

/// Reason that a command line does not parse. Placeholders count as values of any type.
fn problem(place: Place, line: &str) -> Option<String> {
    let mut args = words(line);
    loop {
        let error = command().try_get_matches_from(std::iter::once(&"armcal".to_owned()).chain(&args)).err()?;
        let rejected = match (error.kind(), error.get(ContextKind::InvalidValue)) {
            (ErrorKind::MissingRequiredArgument | ErrorKind::MissingSubcommand, _) if place == Place::Inline => {
                return None;
            }
            // A group of commands, named without one of them.
            (ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand, _) if place == Place::Inline => return None,
            (ErrorKind::ValueValidation | ErrorKind::InvalidValue, Some(ContextValue::String(value))) => value,
            _ => return Some(error.to_string().lines().next().unwrap_or_default().to_owned()),
        };
        let at = args.iter().position(|word| word == rejected).filter(|_| is_placeholder(rejected));
        let Some(at) = at else { return Some(format!("{rejected}: {}", error.kind())) };
        args.remove(at);
        if args[at - 1].starts_with("--") {
            args.remove(at - 1);
        }
    }
}

#[test]
fn quoted_command_lines_parse() {
    let mut violations = Vec::new();
    let mut n_lines = 0;
    for page in pages() {
        for (place, line) in quoted(&fs::read_to_string(&page).expect("the page reads")) {
            n_lines += 1;
            violations.extend(problem(place, &line).map(|why| format!("{}: armcal {line}: {why}", page.display())));
        }
    }
    assert!(n_lines > 50, "{n_lines} command lines");
    expect_none(&violations);
}

#[test]
fn command_lines_are_found_and_judged() {
    let page = "```sh\n$ armcal run r.toml # now\n```\nas `armcal explain\nsky` and `armcal_msgs` say\n\n    \
        armcal run R [--seed N]\n";
    let lines = quoted(page);
    let found: Vec<&str> = lines.iter().map(|(_, line)| line.as_str()).collect();
    assert_eq!(found, ["run r.toml", "run R [--seed N]", "explain sky"]);
    assert!(lines.iter().all(|(place, line)| problem(*place, line).is_none()));
    for (place, line) in [
        (Place::Block, "run"),
        (Place::Inline, "run r.toml --sed 3"),
        (Place::Inline, "fly"),
        (Place::Inline, "run R --seed three"),
    ] {
        assert!(problem(place, line).is_some(), "{line}");
    }
    assert!(problem(Place::Inline, "run").is_none());
}
