//! One bounded scan of a URDF's text before it is parsed.
//!
//! urdf-rs builds a tree by recursion and limits neither depth nor size. So a pull parser reads the text first, within
//! the limits below, and what goes on is written anew: elements and attributes without a namespace, nothing else.
//! Document types and entities are refused. What follows the root element is not looked at.

use quick_xml::Reader;
use quick_xml::escape::{escape, unescape};
use quick_xml::events::{BytesStart, Event};

/// Limit of elements within each other; a drawing's nest five deep, extensions for simulators some ten.
const MAX_DEPTH: usize = 64;
/// Limit of a file's elements; a humanoid's drawing has some 3000.
const MAX_ELEMENTS: usize = 10_000;
/// Limit of an element's attributes; a drawing's have 8 at most.
const MAX_ATTRIBUTES: usize = 32;
/// Limit of a file's namespace declarations.
const MAX_NAMESPACES: usize = 32;

/// The elements and attributes of `text` that have no namespace, in a text of their own.
///
/// # Errors
/// A sentence with the line, where `text` is not well-formed or beyond a limit.
pub(super) fn plain_urdf(text: &str) -> Result<String, String> {
    let mut reader = Reader::from_str(text);
    let mut scan = Scan::default();
    loop {
        let event = reader.read_event().map_err(|error| error.to_string());
        let step = event.and_then(|event| scan.step(&event));
        // The position is that after the event, and that of an error its beginning.
        let at = usize::try_from(reader.buffer_position().max(reader.error_position())).unwrap_or(usize::MAX);
        let line = || 1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count();
        match step {
            Ok(Step::Within) => {}
            Ok(Step::Done) => return Ok(scan.plain),
            Err(problem) => return Err(format!("line {}: {problem}", line())),
        }
    }
}

enum Step {
    Within,
    Done,
}

#[derive(Default)]
struct Scan {
    depth: usize,
    n_elements: usize,
    n_namespaces: usize,
    /// Depth of the outermost open element with a namespace: it is left out with all that it holds.
    extension: Option<usize>,
    plain: String,
}

impl Scan {
    fn step(&mut self, event: &Event<'_>) -> Result<Step, String> {
        match event {
            Event::Start(tag) => {
                self.open(tag)?;
                Ok(Step::Within)
            }
            Event::Empty(tag) => {
                self.open(tag)?;
                self.close(tag.name().as_ref())
            }
            Event::End(tag) => self.close(tag.name().as_ref()),
            Event::DocType(_) => Err("a document type is not supported".to_owned()),
            Event::GeneralRef(entity) => {
                let entity = format!("&{};", text_of(entity)?);
                unescape(&entity).map(|_| Step::Within).map_err(|_| format!("the entity `{entity}` is not supported"))
            }
            Event::Eof if self.n_elements == 0 => Err("the file has no element".to_owned()),
            Event::Eof => Err("the file ends within an element".to_owned()),
            _ => Ok(Step::Within),
        }
    }

    fn open(&mut self, tag: &BytesStart<'_>) -> Result<(), String> {
        self.depth += 1;
        self.n_elements += 1;
        if self.depth > MAX_DEPTH {
            return Err(format!("elements are nested more than {MAX_DEPTH} deep"));
        }
        if self.n_elements > MAX_ELEMENTS {
            return Err(format!("more than {MAX_ELEMENTS} elements"));
        }
        let mut written = format!("<{}", name_of(tag.name().as_ref())?);
        for (n, attribute) in tag.attributes().enumerate() {
            if n == MAX_ATTRIBUTES {
                return Err(format!("an element has more than {MAX_ATTRIBUTES} attributes"));
            }
            let attribute = attribute.map_err(|error| error.to_string())?;
            let name = name_of(attribute.key.as_ref())?;
            self.n_namespaces += usize::from(attribute.key.as_namespace_binding().is_some());
            if self.n_namespaces > MAX_NAMESPACES {
                return Err(format!("more than {MAX_NAMESPACES} namespaces are declared"));
            }
            let value = unescape(text_of(&attribute.value)?).map_err(|error| format!("{name}: {error}"))?;
            if attribute.key.prefix().is_none() && name != "xmlns" {
                written += &format!(" {name}=\"{}\"", escape(&*value));
            }
        }
        if tag.name().prefix().is_some() {
            self.extension.get_or_insert(self.depth);
        }
        if self.extension.is_none() {
            self.plain += &written;
            self.plain.push('>');
        }
        Ok(())
    }

    fn close(&mut self, name: &[u8]) -> Result<Step, String> {
        if self.extension.is_none() {
            self.plain += &format!("</{}>", name_of(name)?);
        }
        self.extension.take_if(|depth| *depth == self.depth);
        self.depth -= 1;
        Ok(if self.depth == 0 { Step::Done } else { Step::Within })
    }
}

/// What other parsers take for a name, too.
fn name_of(bytes: &[u8]) -> Result<&str, String> {
    let name = text_of(bytes)?;
    let is_name = name.starts_with(|first: char| first.is_alphabetic() || first == '_')
        && name.chars().all(|c| c.is_alphanumeric() || "_-.:".contains(c));
    if is_name { Ok(name) } else { Err(format!("`{name}` is not a name")) }
}

fn text_of(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Message about a refused text.
    fn told(text: &str) -> String {
        let problem = plain_urdf(text).expect_err("refused");
        assert!(problem.len() < 200, "{problem}");
        problem
    }

    fn nested(depth: usize) -> String {
        format!("<robot name=\"a\">{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth))
    }

    #[test]
    fn only_what_has_no_namespace_goes_on() {
        let text = "\u{feff}<?xml version=\"1.0\"?><!-- <a> --><robot name='a&lt;\"&#65;' xmlns:x=\"u\" x:y=\"z\">\n\
            text &amp; more <![CDATA[<b>]]><x:sensor><link name=\"no\"/></x:sensor><link name=\"b\"/></robot><c>";
        let plain = "<robot name=\"a&lt;&quot;A\"><link name=\"b\"></link></robot>";
        assert_eq!(plain_urdf(text).as_deref(), Ok(plain));
    }

    #[test]
    fn deep_elements_are_refused_before_they_are_parsed() {
        assert!(plain_urdf(&nested(MAX_DEPTH - 1)).is_ok());
        for deep in [nested(MAX_DEPTH), nested(15_000), "<a>".repeat(1_000_000)] {
            insta::assert_snapshot!("deep", told(&deep));
        }
    }

    #[test]
    fn many_elements_are_refused() {
        let of = |n: usize| format!("<robot name=\"a\">{}</robot>", "<link name=\"b\"/>".repeat(n));
        assert!(plain_urdf(&of(MAX_ELEMENTS - 1)).is_ok());
        insta::assert_snapshot!("many_elements", told(&of(MAX_ELEMENTS)));
    }

    /// RUSTSEC-2026-0194: distinct names in one start tag took quadratic time.
    #[test]
    fn many_attributes_are_refused_at_once() {
        let of = |n: usize| format!("<robot {}/>", (0..n).map(|k| format!(" a{k}=\"\"")).collect::<String>());
        assert!(plain_urdf(&of(MAX_ATTRIBUTES)).is_ok());
        insta::assert_snapshot!("many_attributes", told(&of(MAX_ATTRIBUTES + 1)));
        let started = std::time::Instant::now();
        insta::assert_snapshot!("many_attributes", told(&of(400_000)));
        assert!(started.elapsed().as_secs() < 5, "{:?}", started.elapsed());
        insta::assert_snapshot!("an_attribute_twice", told("<robot name=\"a\" name=\"b\"/>"));
    }

    /// RUSTSEC-2026-0195: namespace declarations were kept without bound.
    #[test]
    fn many_namespaces_are_refused() {
        let of = |n: usize| {
            let links = (0..n).map(|k| format!("<link xmlns:n{k}=\"u{k}\"/>"));
            format!("<robot>{}</robot>", links.collect::<String>())
        };
        assert!(plain_urdf(&of(MAX_NAMESPACES)).is_ok());
        insta::assert_snapshot!("many_namespaces", told(&of(MAX_NAMESPACES + 1)));
    }

    fn told_of<const N: usize>(texts: [&str; N]) -> String {
        texts.map(|text| format!("{text:?}\n  {}\n", told(text))).concat()
    }

    #[test]
    fn document_types_and_entities_are_refused() {
        let texts = [
            "<!DOCTYPE robot [<!ENTITY a \"aaaa\">]><robot name=\"&a;\"/>",
            "<robot name=\"&a;\"/>",
            "<robot>\n&a;</robot>",
        ];
        insta::assert_snapshot!("entities", told_of(texts));
    }

    #[test]
    fn what_is_not_well_formed_is_named_with_its_line() {
        let texts = [
            "",
            "a mere text",
            "<robot>\n<link>\n</robot>",
            "<robot>\n<link/>",
            "<robot>\n<link",
            "</robot>",
            "<robot na<me=\"a\"/>",
            "<1/>",
        ];
        insta::assert_snapshot!("not_well_formed", told_of(texts));
    }
}
