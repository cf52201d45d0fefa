//! Complete sentences from parts of sentences.

/// Capitalises the text and ends it with a full stop; a first word with an underscore is a name and keeps its case.
#[must_use]
pub fn sentence(text: &str) -> String {
    let first_word = text.split([' ', ':']).next().unwrap_or_default();
    let end = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    if first_word.contains('_') {
        return format!("{text}{end}");
    }
    let mut letters = text.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}{end}", letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_sentences() {
        assert_eq!(sentence("capture more views"), "Capture more views.");
        assert_eq!(sentence("So it is."), "So it is.");
        assert_eq!(sentence("wrist_pitch is locked"), "wrist_pitch is locked.", "a name is a name");
        assert_eq!(sentence(""), ".");
    }
}
