//! Elements of a bounded XML text, each with its line and column.
//!
//! A pull parser reads the text within the given limits, which are checked before anything is stored; nothing is read
//! by recursion. Document types with declarations are refused, and so are entities other than XML's own. The text after
//! the root element is not read.

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

/// Limit of the nesting of elements: a URDF has five levels, extensions for simulators about ten.
const MAX_DEPTH: usize = 64;
/// Limit of an element's attributes: those of URDF and COLLADA have 8 at most.
const MAX_ATTRIBUTES: usize = 32;

/// Limits of one format that depend on its content.
#[derive(Clone, Copy, Debug)]
pub(super) struct XmlLimits {
    /// Maximum number of elements of a file.
    pub elements: usize,
    /// Maximum number of namespace declarations of a file.
    pub namespaces: usize,
}

/// Position of an element in its file, both counted from 1; the column in characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub line: usize,
    pub column: usize,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// An element. Names are without their prefixes.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub name: String,
    /// Prefix of a namespace; empty for the format's own elements.
    pub prefix: String,
    /// Start of the element's tag.
    pub place: Place,
    attributes: Vec<(String, String)>,
    /// All of the element's own text; entities are left out.
    pub text: String,
    children: Vec<usize>,
}

/// Converts ascending byte offsets to lines and columns; each byte is read once.
#[derive(Debug, Default)]
struct LineCounter {
    at: usize,
    n_lines: usize,
    /// Characters between the start of the line and `at`.
    n_characters: usize,
}

impl LineCounter {
    fn place(&mut self, text: &str, offset: usize) -> Place {
        let offset = offset.min(text.len());
        for byte in text.as_bytes().get(self.at..offset).unwrap_or_default() {
            if *byte == b'\n' {
                self.n_lines += 1;
                self.n_characters = 0;
            } else if *byte & 0xC0 != 0x80 {
                // Continuation bytes of UTF-8 do not begin a character.
                self.n_characters += 1;
            }
        }
        self.at = self.at.max(offset);
        Place { line: 1 + self.n_lines, column: 1 + self.n_characters }
    }
}

impl Element {
    /// Returns the value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// Names and values of all attributes without a namespace prefix.
    pub fn attributes(&self) -> impl Iterator<Item = (&str, &str)> {
        self.attributes.iter().map(|(key, value)| (key.as_str(), value.as_str()))
    }

    fn of(tag: &BytesStart<'_>, n_namespaces: &mut usize, limits: XmlLimits) -> Result<Self, String> {
        let name = checked_name(tag.local_name().as_ref())?.to_owned();
        let prefix = tag.name().prefix().map(|prefix| checked_name(prefix.as_ref()).map(str::to_owned));
        let mut element = Self { name, prefix: prefix.transpose()?.unwrap_or_default(), ..Self::default() };
        for (n, attribute) in tag.attributes().enumerate() {
            if n == MAX_ATTRIBUTES {
                return Err(format!("an element has more than {MAX_ATTRIBUTES} attributes"));
            }
            let attribute = attribute.map_err(|error| error.to_string())?;
            let name = checked_name(attribute.key.as_ref())?;
            *n_namespaces += usize::from(attribute.key.as_namespace_binding().is_some());
            if *n_namespaces > limits.namespaces {
                return Err(format!("more than {} namespaces are declared", limits.namespaces));
            }
            let value = unescape(text_of(&attribute.value)?).map_err(|error| format!("{name}: {error}"))?.into_owned();
            if attribute.key.prefix().is_none() && name != "xmlns" {
                element.attributes.push((name.to_owned(), value));
            }
        }
        Ok(element)
    }
}

/// Checks that other parsers accept the name too.
fn checked_name(bytes: &[u8]) -> Result<&str, String> {
    let name = text_of(bytes)?;
    let is_name = name.starts_with(|first: char| first.is_alphabetic() || first == '_')
        && name.chars().all(|c| c.is_alphanumeric() || "_-.:".contains(c));
    if is_name { Ok(name) } else { Err(format!("`{name}` is not a name")) }
}

fn offset(position: u64) -> usize {
    usize::try_from(position).unwrap_or(usize::MAX)
}

fn text_of(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|error| error.to_string())
}

/// Elements of a text in the order of their starts; the root is the first.
#[derive(Debug)]
pub(super) struct XmlTree {
    elements: Vec<Element>,
    n_namespaces: usize,
    limits: XmlLimits,
}

impl XmlTree {
    /// Reads a text up to the end of its root element.
    ///
    /// # Errors
    /// A sentence with line and column, if `text` is not well-formed or exceeds a limit.
    pub fn parse(text: &str, limits: XmlLimits) -> Result<Self, String> {
        // The reader does not count a byte order mark.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = Reader::from_str(text);
        let mut tree = Self { elements: Vec::new(), n_namespaces: 0, limits };
        let (mut open, mut counter) = (Vec::new(), LineCounter::default());
        loop {
            let start = offset(reader.buffer_position());
            let event = reader.read_event().map_err(|error| error.to_string());
            let place = counter.place(text, start);
            let step = event.and_then(|event| tree.step(&event, &mut open, place));
            if let Err(problem) = step {
                let at = offset(reader.error_position()).max(start);
                return Err(format!("{}: {problem}", counter.place(text, at)));
            }
            if open.is_empty() && !tree.elements.is_empty() {
                return Ok(tree);
            }
        }
    }

    fn step(&mut self, event: &Event<'_>, open: &mut Vec<usize>, place: Place) -> Result<(), String> {
        match event {
            Event::Start(tag) => self.open(tag, open, place),
            Event::Empty(tag) => {
                self.open(tag, open, place)?;
                open.pop();
                Ok(())
            }
            Event::End(_) => {
                open.pop();
                Ok(())
            }
            Event::Text(text) => self.add_text(text, open),
            Event::CData(text) => self.add_text(text, open),
            Event::DocType(declared) if declared.contains(&b'[') => {
                Err("a document type with declarations is not supported; delete the <!DOCTYPE ..>".to_owned())
            }
            Event::GeneralRef(entity) => {
                let entity = format!("&{};", text_of(entity)?);
                unescape(&entity).map(drop).map_err(|_| format!("the entity `{entity}` is not supported"))
            }
            Event::Eof if self.elements.is_empty() => Err("the file has no element".to_owned()),
            Event::Eof => Err("the file ends within an element".to_owned()),
            _ => Ok(()),
        }
    }

    fn open(&mut self, tag: &BytesStart<'_>, open: &mut Vec<usize>, place: Place) -> Result<(), String> {
        if open.len() == MAX_DEPTH {
            return Err(format!("elements are nested more than {MAX_DEPTH} deep"));
        }
        if self.elements.len() == self.limits.elements {
            return Err(format!("more than {} elements", self.limits.elements));
        }
        let number = self.elements.len();
        if let Some(&parent) = open.last() {
            self.elements[parent].children.push(number);
        }
        let element = Element::of(tag, &mut self.n_namespaces, self.limits)?;
        self.elements.push(Element { place, ..element });
        open.push(number);
        Ok(())
    }

    fn add_text(&mut self, text: &[u8], open: &[usize]) -> Result<(), String> {
        if let Some(&at) = open.last() {
            self.elements[at].text.push_str(text_of(text)?);
        }
        Ok(())
    }

    /// All elements.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// An element by its number.
    pub fn element(&self, at: usize) -> &Element {
        &self.elements[at]
    }

    /// The elements directly in another one.
    pub fn children(&self, at: usize) -> impl Iterator<Item = usize> + '_ {
        self.elements[at].children.iter().copied()
    }

    /// The first element of this name directly in another one.
    pub fn child(&self, at: usize, name: &str) -> Option<usize> {
        self.children(at).find(|&child| self.elements[child].name == name)
    }

    /// All elements of this name.
    pub fn named<'a>(&'a self, name: &'a str) -> impl Iterator<Item = usize> + 'a {
        (0..self.elements.len()).filter(move |&at| self.elements[at].name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: XmlLimits = XmlLimits { elements: 10_000, namespaces: 32 };

    fn parse(text: &str) -> Result<XmlTree, String> {
        XmlTree::parse(text, LIMITS)
    }

    /// Message about a refused text.
    fn told(text: &str) -> String {
        let problem = parse(text).expect_err("refused");
        assert!(problem.len() < 200, "{problem}");
        problem
    }

    fn nested(depth: usize) -> String {
        format!("<robot name=\"a\">{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth))
    }

    #[test]
    fn elements_have_their_prefix_attributes_and_place() {
        let text = "\u{feff}<?xml version=\"1.0\"?><!-- <a> -->\n<!-- é -->\
            <robot name='a&lt;\"&#65;' xmlns:x=\"u\" x:y=\"z\">\n\
            text &amp; more <![CDATA[<b>]]><x:sensor><link name=\"no\"/></x:sensor>\n  <link name=\"b\"/></robot><c>";
        let tree = parse(text).expect("it reads");
        let robot = tree.element(0);
        assert_eq!(robot.attributes().collect::<Vec<_>>(), [("name", "a<\"A")]);
        let children: Vec<&Element> = tree.children(0).map(|at| tree.element(at)).collect();
        let [sensor, link] = children[..] else { panic!("{children:?}") };
        assert_eq!((sensor.prefix.as_str(), sensor.name.as_str()), ("x", "sensor"));
        assert_eq!((link.prefix.as_str(), link.attribute("name")), ("", Some("b")));
        assert_eq!(robot.place, Place { line: 2, column: 11 });
        assert_eq!(link.place, Place { line: 4, column: 3 });
    }

    #[test]
    fn deep_elements_are_refused_before_they_are_parsed() {
        assert!(parse(&nested(MAX_DEPTH - 1)).is_ok());
        for deep in [nested(MAX_DEPTH), nested(15_000)] {
            insta::assert_snapshot!("deep", told(&deep));
        }
        insta::assert_snapshot!("deep_without_end", told(&"<a>".repeat(1_000_000)));
    }

    #[test]
    fn many_elements_are_refused() {
        let of = |n: usize| format!("<robot name=\"a\">{}</robot>", "<link name=\"b\"/>".repeat(n));
        assert!(parse(&of(LIMITS.elements - 1)).is_ok());
        insta::assert_snapshot!("many_elements", told(&of(LIMITS.elements)));
    }

    /// RUSTSEC-2026-0194: distinct names in one start tag took quadratic time.
    #[test]
    fn many_attributes_are_refused_at_once() {
        let of = |n: usize| format!("<robot {}/>", (0..n).map(|k| format!(" a{k}=\"\"")).collect::<String>());
        assert!(parse(&of(MAX_ATTRIBUTES)).is_ok());
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
        assert!(parse(&of(LIMITS.namespaces)).is_ok());
        insta::assert_snapshot!("many_namespaces", told(&of(LIMITS.namespaces + 1)));
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
