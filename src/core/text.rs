//! Text from files, made safe to show.

use std::borrow::Cow;

/// Returns `text` with control characters escaped, as `\u001b`, so that a name in a file cannot steer the terminal.
/// Characters that change the direction of writing are escaped too. Line ends and tabs stay. The escape is that of
/// strings in JSON, TOML and YAML, so that a file of these keeps its names.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if steers(c) { shown += &format!("\\u{:04x}", u32::from(c)) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// Returns a number with its noun: `1 tag`, `3 tags`.
#[must_use]
pub fn counted(n: usize, thing: &str) -> String {
    if n == 1 { format!("1 {thing}") } else { format!("{n} {thing}s") }
}

/// Returns the entry of `known` that `word` most likely stands for; `None` if it resembles no entry.
#[must_use]
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let distances = known.into_iter().map(|other| (edits(word, other), other));
    let (edits, other) = distances.min_by_key(|(edits, _)| *edits)?;
    (edits <= 1 + word.chars().count().max(other.chars().count()) / 4).then_some(other)
}

/// Returns the number of inserted, deleted or replaced letters that turn one word into the other (Levenshtein 1966). An
/// exchange of neighbours counts as one.
fn edits(from: &str, to: &str) -> usize {
    let (from, to): (Vec<char>, Vec<char>) = (from.chars().collect(), to.chars().collect());
    let mut rows: Vec<Vec<usize>> = vec![(0..=to.len()).collect()];
    for (i, a) in from.iter().enumerate() {
        let mut row = vec![i + 1];
        for (k, b) in to.iter().enumerate() {
            let replaced = rows[i][k] + usize::from(!a.eq_ignore_ascii_case(b));
            let mut least = replaced.min(rows[i][k + 1] + 1).min(row[k] + 1);
            if i > 0 && k > 0 && *a == to[k - 1] && from[i - 1] == *b {
                least = least.min(rows[i - 1][k - 1] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[from.len()][to.len()]
}

/// The YAML reader's advice to programmers.
const READERS_ADVICE: &str = ", set DuplicateKeyPolicy in Options if acceptable";

/// Returns the text of a YAML reader's error, worded for the author of the file.
#[must_use]
pub fn yaml_problem(error: &str) -> String {
    with_nearest(error).replace(READERS_ADVICE, "; name it once")
}

/// Returns a reader's message about an unknown name, with the nearest of the names that it lists: unknown field `a`,
/// expected one of `b`, `c`.
#[must_use]
pub fn with_nearest(message: &str) -> String {
    let unknown = message.rfind("unknown field `").or_else(|| message.rfind("unknown variant `"));
    let Some(at) = unknown else { return message.to_owned() };
    let mut names = message[at..].split('`').skip(1).step_by(2);
    let Some(hint) = names.next().and_then(|word| nearest(word, names)) else { return message.to_owned() };
    format!("{message}; did you mean `{hint}`?")
}

fn steers(c: char) -> bool {
    let is_bidirectional =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && c != '\n' && c != '\t') || is_bidirectional
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_likeliest_of_the_known_names_is_offered_and_none_where_none_is_like_it() {
        let known = ["poses", "held_out", "min_tags", "clearance_m"];
        let of = |word| nearest(word, known);
        assert_eq!((of("posess"), of("Poses"), of("heldout")), (Some("poses"), Some("poses"), Some("held_out")));
        assert_eq!(
            (of("clearence_m"), of("psoes"), of("depth"), of("")),
            (Some("clearance_m"), Some("poses"), None, None)
        );
        let message = "unknown field `min_tag`, expected one of `poses`, `min_tags`";
        assert_eq!(with_nearest(message), format!("{message}; did you mean `min_tags`?"));
        let unlike = "unknown field `zebra`, expected `poses`";
        for same in ["missing field `poses`", "unknown field `x`, there are no fields", unlike] {
            assert_eq!(with_nearest(same), same);
        }
    }

    #[test]
    fn one_thing_has_no_plural() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "tag")), ["0 tags", "1 tag", "2 tags"]);
    }

    #[test]
    fn control_characters_are_escaped_and_all_else_stays() {
        let plain = "error: Größe \u{1f980}\n  |\t^^^";
        assert!(matches!(printable(plain), Cow::Borrowed(text) if text == plain));
        let steering = "a\u{1b}[2J\u{7}\r\u{7f}\u{9b}31m\u{202e}b\0";
        for c in ['\u{61c}', '\u{200e}', '\u{200f}', '\u{202a}', '\u{2066}', '\u{2069}'] {
            assert!(printable(&format!("a{c}b")).is_ascii());
        }
        assert_eq!(printable(steering), "a\\u001b[2J\\u0007\\u000d\\u007f\\u009b31m\\u202eb\\u0000");
    }
}
