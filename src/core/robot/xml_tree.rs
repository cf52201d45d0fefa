//! Elements of a bounded XML text, for documents whose parts refer to each other.
//!
//! A pull parser reads the text within the limits below; nothing is read by recursion. Document types are refused.

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

/// Limit of elements within each other.
const MAX_DEPTH: usize = 64;
/// Limit of a file's elements: a mesh of many parts has some thousands.
const MAX_ELEMENTS: usize = 200_000;
/// Limit of an element's attributes.
const MAX_ATTRIBUTES: usize = 32;

/// An element. Names are without their prefixes.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub name: String,
    attributes: Vec<(String, String)>,
    /// All of its own text; entities are left out.
    pub text: String,
    children: Vec<usize>,
}

impl Element {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    fn of(tag: &BytesStart<'_>) -> Result<Self, String> {
        let mut element = Self { name: text_of(tag.local_name().as_ref())?.to_owned(), ..Self::default() };
        for (n, attribute) in tag.attributes().enumerate() {
            if n == MAX_ATTRIBUTES {
                return Err(format!("an element has more than {MAX_ATTRIBUTES} attributes"));
            }
            let attribute = attribute.map_err(|error| error.to_string())?;
            let name = text_of(attribute.key.local_name().as_ref())?.to_owned();
            let value = unescape(text_of(&attribute.value)?).map_err(|error| format!("{name}: {error}"))?.into_owned();
            element.attributes.push((name, value));
        }
        Ok(element)
    }
}

fn text_of(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|error| error.to_string())
}

/// The elements of a text in the order of their starts; the root is the first.
#[derive(Debug)]
pub(super) struct XmlTree {
    elements: Vec<Element>,
}

impl XmlTree {
    /// Reads a text up to the end of its root element.
    ///
    /// # Errors
    /// A sentence with the line, where `text` is not well-formed or beyond a limit.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut reader = Reader::from_str(text);
        let mut tree = Self { elements: Vec::new() };
        let mut open = Vec::new();
        loop {
            let event = reader.read_event().map_err(|error| error.to_string());
            let step = event.and_then(|event| tree.step(&event, &mut open));
            let at = usize::try_from(reader.buffer_position().max(reader.error_position())).unwrap_or(usize::MAX);
            let line = || 1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count();
            step.map_err(|problem| format!("line {}: {problem}", line()))?;
            if open.is_empty() && !tree.elements.is_empty() {
                return Ok(tree);
            }
        }
    }

    fn step(&mut self, event: &Event<'_>, open: &mut Vec<usize>) -> Result<(), String> {
        match event {
            Event::Start(tag) => self.open(tag, open),
            Event::Empty(tag) => {
                self.open(tag, open)?;
                open.pop();
                Ok(())
            }
            Event::End(_) => {
                open.pop();
                Ok(())
            }
            Event::Text(text) => self.add_text(text, open),
            Event::CData(text) => self.add_text(text, open),
            Event::DocType(_) => Err("a document type is not supported".to_owned()),
            Event::Eof if self.elements.is_empty() => Err("the file has no element".to_owned()),
            Event::Eof => Err("the file ends within an element".to_owned()),
            _ => Ok(()),
        }
    }

    fn open(&mut self, tag: &BytesStart<'_>, open: &mut Vec<usize>) -> Result<(), String> {
        if open.len() == MAX_DEPTH {
            return Err(format!("elements are nested more than {MAX_DEPTH} deep"));
        }
        if self.elements.len() == MAX_ELEMENTS {
            return Err(format!("more than {MAX_ELEMENTS} elements"));
        }
        let number = self.elements.len();
        if let Some(&parent) = open.last() {
            self.elements[parent].children.push(number);
        }
        self.elements.push(Element::of(tag)?);
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
