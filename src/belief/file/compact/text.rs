//! Text of the compact line: fields between single spaces, a checksum at the end.

use crate::file::constants::compact_text::{MAX_CODE, MAX_NAME_BYTES, SUM_DIGITS};
use std::fmt::Write as _;

use crate::file::calibration::Status;
use crate::file::compact::content::{CompactCalibration, CompactJoint, PredictedToolError};
use crate::file::compact::error::CompactError;
use crate::file::compact::fields::{bad, printable, whole};
use crate::file::compact::precision::{HASH_DIGITS, STEPS, STEPS_WITH_TERMS, UM_PER_M};
use crate::file::compact::terms::{CompactReference, CompactTerms};
use armcal_core::routine::Method;
use armcal_core::streams::MAX_JOINTS;

pub(crate) const FORMAT: &str = "armcal1";
pub(crate) const FORMAT_WITH_TERMS: &str = "armcal2";

pub(crate) fn write(c: &CompactCalibration) -> String {
    let verdict = match (c.status, &c.refusal_code) {
        (Status::Accepted, _) => "ok".to_owned(),
        (Status::Refused, code) => format!("no:{}", code.as_deref().unwrap_or("other")),
    };
    let error = c.predicted_tool_error_m.map_or_else(
        || "e-".to_owned(),
        |error| format!("e{}/{}", (error.median * UM_PER_M).round(), (error.p95 * UM_PER_M).round()),
    );
    let mut body = format!("{} {} {} {verdict} t{} {error}", c.format, c.robot, c.method, c.time_s);
    let _ = write!(body, " h{} r{}", c.messages_hash_start, c.joints_hash);
    if let Some(reference) = &c.reference {
        let _ = write!(body, " {}", reference.to_text());
    }
    let per_unit = if c.reference.is_some() { STEPS_WITH_TERMS } else { STEPS };
    for joint in &c.joint {
        let gain = &estimated_or_datasheet(joint.gain_correction, per_unit)[usize::from(!joint.gain_estimated)];
        let offset = &estimated_or_datasheet(joint.offset_rad, per_unit)[usize::from(!joint.offset_estimated)];
        let gain = with_std(gain, joint.gain_std, per_unit);
        let offset = with_std(offset, joint.offset_std_rad, per_unit);
        let _ = write!(body, " {gain},{offset}");
        if let (Some(terms), Some(reference)) = (&joint.terms, &c.reference) {
            let _ = write!(body, ",{}", terms.to_text(reference.shape_step_rad));
        }
    }
    let sum = checksum(&body);
    format!("{body} #{sum}")
}

/// Returns text such as `+242479~12078` if estimated, `=0~300000` if the datasheet's.
fn estimated_or_datasheet(value: f64, per_unit: f64) -> [String; 2] {
    let steps = (value * per_unit).round() as i64;
    [format!("{steps:+}"), format!("={steps}")]
}

fn with_std(value: &str, std: Option<f64>, per_unit: f64) -> String {
    match std {
        Some(std) => format!("{value}~{}", (std * per_unit).round()),
        None => format!("{value}~x"),
    }
}

fn checksum(body: &str) -> String {
    blake3::hash(body.as_bytes()).to_hex()[..SUM_DIGITS].to_owned()
}

/// Returns a robot's name as it is sent: letters, digits, `-`, `_` and `.`; other bytes as `%xx`; the end of a long one
/// hashed.
pub(crate) fn short_name(name: &str) -> String {
    let mut short = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.".contains(&byte) {
            short.push(char::from(byte));
        } else {
            let _ = write!(short, "%{byte:02x}");
        }
    }
    if short.len() > MAX_NAME_BYTES {
        let sum = checksum(name);
        short.truncate(MAX_NAME_BYTES - SUM_DIGITS - 1);
        short = format!("{short}~{sum}");
    }
    short
}

pub(crate) fn read(text: &str) -> Result<CompactCalibration, CompactError> {
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    match words.first() {
        Some(&(FORMAT | FORMAT_WITH_TERMS)) => {}
        Some(word) if word.starts_with("armcal") && word.len() < 12 => {
            return Err(CompactError::Version { found: printable(word) });
        }
        _ => return Err(CompactError::NotCompact),
    }
    let (sum, words) = words.split_last().expect("there is a first word");
    let expected = checksum(&words.join(" "));
    if sum.strip_prefix('#') != Some(&expected) {
        return Err(CompactError::Checksum { expected, found: printable(sum) });
    }
    fields(words)
}

/// Parses the words between format and checksum. The checksum is right, so that an error here is the writer's.
fn fields(words: &[&str]) -> Result<CompactCalibration, CompactError> {
    let word = |n: usize, field: &'static str| words.get(n).copied().ok_or_else(|| bad(field, "", "there"));
    let tagged = |n: usize, field: &'static str, tag: char| {
        let found = word(n, field)?;
        found.strip_prefix(tag).ok_or_else(|| bad(field, found, "the field that belongs here"))
    };
    let robot = word(1, "robot")?;
    if robot.len() > MAX_NAME_BYTES || !robot.bytes().all(|byte| byte.is_ascii_graphic()) {
        return Err(bad("robot", robot, "a robot's name"));
    }
    let method = word(2, "method")?;
    let method: Method = method.parse().map_err(|_| bad("method", method, "a method of this program"))?;
    let (status, refusal_code) = verdict(word(3, "verdict")?)?;
    let time = tagged(4, "time", 't')?;
    let time_s = time.parse().map_err(|_| bad("time", time, "a whole number of seconds"))?;
    let predicted_tool_error_m = predicted(tagged(5, "predicted tool error", 'e')?)?;
    let messages_hash_start = hex(tagged(6, "messages hash", 'h')?, "messages hash", HASH_DIGITS)?;
    let joints_hash = hex(tagged(7, "joints hash", 'r')?, "joints hash", 8)?;
    let has_terms = words[0] == FORMAT_WITH_TERMS;
    let reference = has_terms.then(|| word(8, "reference").and_then(CompactReference::from_text)).transpose()?;
    let joints = words.get(if has_terms { 9.. } else { 8.. }).unwrap_or_default();
    if !(1..=MAX_JOINTS).contains(&joints.len()) {
        return Err(CompactError::Joints { joints: joints.len() });
    }
    let joint =
        joints.iter().enumerate().map(|(n, word)| joint(n, word, reference.as_ref())).collect::<Result<_, _>>()?;
    Ok(CompactCalibration {
        format: if has_terms { FORMAT_WITH_TERMS } else { FORMAT },
        robot: robot.to_owned(),
        method,
        status,
        refusal_code,
        time_s,
        predicted_tool_error_m,
        messages_hash_start,
        joints_hash,
        reference,
        joint,
    })
}

fn verdict(word: &str) -> Result<(Status, Option<String>), CompactError> {
    if word == "ok" {
        return Ok((Status::Accepted, None));
    }
    let code = word.strip_prefix("no:").filter(|code| {
        (1..=MAX_CODE).contains(&code.len()) && code.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_')
    });
    let code = code.ok_or_else(|| bad("verdict", word, "`ok` or `no:` and a code"))?;
    Ok((Status::Refused, Some(code.to_owned())))
}

fn predicted(word: &str) -> Result<Option<PredictedToolError>, CompactError> {
    if word == "-" {
        return Ok(None);
    }
    let number = |word: &str| whole(word).map(|um| um as f64 / UM_PER_M);
    let both = word.split_once('/').and_then(|(median, p95)| Some((number(median)?, number(p95)?)));
    let (median, p95) = both.ok_or_else(|| bad("predicted tool error", word, "two numbers of micrometres"))?;
    Ok(Some(PredictedToolError { median, p95 }))
}

fn hex(word: &str, field: &str, digits: usize) -> Result<String, CompactError> {
    let is_hex = word.len() <= digits && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    if is_hex { Ok(word.to_owned()) } else { Err(bad(field, word, "hexadecimal digits")) }
}

fn joint(n: usize, word: &str, reference: Option<&CompactReference>) -> Result<CompactJoint, CompactError> {
    let wrong = || bad(format!("joint {n}"), word, "gain~std,offset~std");
    let (gain, rest) = word.split_once(',').ok_or_else(wrong)?;
    // The terms may contain commas: everything after the second comma belongs to them.
    let (offset, terms) = match (rest.split_once(','), reference) {
        (Some((offset, terms)), Some(reference)) => {
            let wrong = || bad(format!("joint {n}: terms"), terms, "numbers in base 45");
            (offset, Some(CompactTerms::from_text(terms, reference.shape_step_rad).ok_or_else(wrong)?))
        }
        _ => (rest, None),
    };
    let per_unit = if reference.is_some() { STEPS_WITH_TERMS } else { STEPS };
    let (gain_correction, gain_std, gain_estimated) = read_parameter(gain, per_unit).ok_or_else(wrong)?;
    let (offset_rad, offset_std_rad, offset_estimated) = read_parameter(offset, per_unit).ok_or_else(wrong)?;
    Ok(CompactJoint { gain_correction, gain_std, gain_estimated, offset_rad, offset_std_rad, offset_estimated, terms })
}

/// Parses a word that [`parameter`] wrote.
fn read_parameter(word: &str, per_unit: f64) -> Option<(f64, Option<f64>, bool)> {
    let (value, std) = word.split_once('~')?;
    let (is_estimated, value) = match value.strip_prefix('=') {
        Some(value) => (false, value),
        None => (true, value.strip_prefix('+').unwrap_or(value)),
    };
    let steps = match value.strip_prefix('-') {
        Some(size) => -whole(size)?,
        None => whole(value)?,
    };
    let std = if std == "x" { None } else { Some(whole(std)? as f64 / per_unit) };
    Some((steps as f64 / per_unit, std, is_estimated))
}
