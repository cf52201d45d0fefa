//! Text from files as it may be shown.

use std::borrow::Cow;

/// `text` with control characters escaped, as `\u{1b}`, so that a name in a file cannot steer the terminal; so are
/// those that change the direction of writing. Ends of lines and tabs stay.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if steers(c) { shown.extend(c.escape_unicode()) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// `1 tag`, `3 tags`.
#[must_use]
pub fn counted(n: usize, thing: &str) -> String {
    if n == 1 { format!("1 {thing}") } else { format!("{n} {thing}s") }
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
    fn one_thing_has_no_plural() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "tag")), ["0 tags", "1 tag", "2 tags"]);
    }

    #[test]
    fn control_characters_are_escaped_and_all_else_stays() {
        let plain = "error: Größe \u{1f980}\n  |\t^^^";
        assert!(matches!(printable(plain), Cow::Borrowed(text) if text == plain));
        let steering = "a\u{1b}[2J\u{7}\r\u{7f}\u{9b}31m\u{202e}b\0";
        assert_eq!(printable(steering), "a\\u{1b}[2J\\u{7}\\u{d}\\u{7f}\\u{9b}31m\\u{202e}b\\u{0}");
    }
}
