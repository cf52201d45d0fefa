//! Changes of the kinds that disks, copies, people and attackers cause.

use rand::RngExt;

/// Largest length of a changed file, bytes.
const MAX_BYTES: usize = 4 << 20;

/// Words that parsers accept as numbers, structure or ends of lines, or should reject.
const WORDS: [&[u8]; 40] = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e400",
    b"-0",
    b"0",
    b"-1",
    b"1e308",
    b"5e-324",
    b"9223372036854775807",
    b"18446744073709551616",
    b"4294967296",
    b"0x7fffffff",
    b"\"\"",
    b"[",
    b"]",
    b"[[",
    b"{",
    b"}",
    b"<a>",
    b"</a>",
    b"<!--",
    b"<![CDATA[",
    b"<!DOCTYPE a>",
    b"&a;",
    b"&#0;",
    b"&x ",
    b"*x ",
    b"<<: ",
    b"!!binary ",
    b"\"\"\"",
    b"'",
    b"\0",
    b"\x1b[2J",
    b"\xff\xfe",
    b"\xe2\x80\xae",
    b"\r",
    b"\n",
    b"=",
    b",",
];

/// Returns `seed` with one to four changes.
pub fn mutated(seed: &[u8], rng: &mut impl RngExt) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..rng.random_range(1..=4) {
        change(&mut bytes, rng);
        bytes.truncate(MAX_BYTES);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, rng: &mut impl RngExt) {
    if bytes.is_empty() {
        bytes.push(rng.random());
    }
    let n = bytes.len();
    let at = rng.random_range(0..n);
    let end = at + rng.random_range(1..=(n - at).min(2000));
    match rng.random_range(0..12) {
        0 => bytes[at] ^= 1 << rng.random_range(0..8),
        1 => bytes[at..end.min(at + 16)].iter_mut().for_each(|byte| *byte = rng.random()),
        2 => bytes.truncate(at),
        3 => bytes[at..end].fill(0),
        4 => drop(bytes.drain(at..end)),
        // The part is doubled, or repeated so often that costs in its number are visible.
        5 => repeat(bytes, at..end, 1),
        6 => repeat(bytes, line_about(bytes, at), 1 << rng.random_range(0..14)),
        7 => repeat(bytes, at..end.min(at + 8), 1 << rng.random_range(4..18)),
        8 => {
            let word = WORDS[rng.random_range(0..WORDS.len())];
            bytes.splice(at..at, word.iter().copied());
        }
        9 | 10 => {
            let word = WORDS[rng.random_range(0..WORDS.len())];
            bytes.splice(number_after(bytes, at), word.iter().copied());
        }
        _ => drop(bytes.drain(line_about(bytes, at))),
    }
}

type Range = std::ops::Range<usize>;

fn repeat(bytes: &mut Vec<u8>, part: Range, times: usize) {
    let times = times.min(MAX_BYTES / part.len().max(1));
    let copies = bytes[part.clone()].repeat(times);
    bytes.splice(part.end..part.end, copies);
}

fn line_about(bytes: &[u8], at: usize) -> Range {
    let start = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
    let end = bytes[at..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |end| at + end + 1);
    start..end
}

/// The next text that looks like a number; in a binary file, eight bytes.
fn number_after(bytes: &[u8], at: usize) -> Range {
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || b".-+e".contains(byte);
    let Some(start) = bytes[at..].iter().take(400).position(u8::is_ascii_digit) else {
        return at..(at + 8).min(bytes.len());
    };
    let start = at + start;
    start..start + bytes[start..].iter().take_while(|byte| is_of_number(byte)).count()
}
