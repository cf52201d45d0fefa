//! The note at the head of an exported file that its calibration was refused.

/// Comments of a file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comments {
    /// A line that begins with a hash sign: YAML and CSV.
    Hash,
    /// XML.
    Xml,
}

/// Returns `text` with a first comment that the calibration was refused, with the code of the first reason.
#[must_use]
pub fn marked_as_refused(text: &str, comments: Comments, code: &str) -> String {
    let note = format!("REFUSED [{code}]: do not move an arm by this calibration.");
    match comments {
        Comments::Hash => format!("# {note}\n{text}"),
        Comments::Xml => {
            // No comment may stand before the declaration.
            let is_declared = text.trim_start_matches('\u{feff}').starts_with("<?xml");
            match text.split_once("?>").filter(|_| is_declared) {
                Some((declaration, rest)) => format!("{declaration}?>\n<!-- {note} -->{rest}"),
                None => format!("<!-- {note} -->\n{text}"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_note_stands_first_where_the_form_allows_it() {
        let of = |text, comments| marked_as_refused(text, comments, "too_few_views");
        assert!(of("a,b\n1,2\n", Comments::Hash).starts_with("# REFUSED [too_few_views]"));
        assert!(of("<ros2_control/>", Comments::Xml).starts_with("<!-- REFUSED [too_few_views]"));
        let declared = of("<?xml version=\"1.0\"?>\n<robot/>", Comments::Xml);
        assert!(declared.starts_with("<?xml version=\"1.0\"?>\n<!-- REFUSED [too_few_views]"), "{declared}");
        assert!(declared.ends_with("-->\n<robot/>"), "{declared}");
    }
}
