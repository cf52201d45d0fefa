//! Type of a file that is not an MCAP recording, with advice for the user.

use super::record::MAGIC;

/// Number of the file's first bytes that are compared.
pub const START_BYTES: usize = 512;

/// First bytes of an SQLite file.
pub const SQLITE: &[u8] = b"SQLite format 3\0";

const UNPACK: &str = "unpack it first";
/// Advice: the command that converts a ROS 1 bag to a readable recording; tests/oracle/make_ros1_golden.py runs it.
pub const ROS1_ADVICE: &str = "rosbags 0.11.9 (`pip install rosbags==0.11.9`) converts it: \
    `rosbags-convert --src IN.bag --dst OUT --dst-storage mcap` writes OUT/OUT.mcap";
const NO_RECORDING: &str = "name the recording itself, an .mcap or .db3 file";
const TABLE: &str = "name the recording itself, an .mcap or .db3 file; a table of poses needs an input map with \
    [table], which `armcal inspect FILE --write-input MAP.toml` proposes";

const CSV: &str = "a table as text (CSV)";

const YAML: &str = "a YAML text";
const JSON: &str = "a JSON text";
const SPREADSHEET: &str = "export it as CSV with one row per pose; `armcal inspect FILE.csv --write-input MAP.toml` \
    then proposes an input map";

/// First bytes, type and advice.
const KINDS: [(&[u8], &str, &str); 25] = [
    (b"#ROSBAG V", "a ROS 1 bag", ROS1_ADVICE),
    (SQLITE, "an SQLite database, as ROS 2 bags in .db3 files are", "only finished ones are read"),
    (b"RRF", "a file for the Rerun viewer (.rrd)", "name the recording that it was made from"),
    (b"RRIO", "a file for the Rerun viewer (.rrd)", "name the recording that it was made from"),
    (b"\x1f\x8b", "compressed with gzip", UNPACK),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd", UNPACK),
    (b"\x04\x22\x4d\x18", "compressed with lz4", UNPACK),
    (b"BZh", "compressed with bzip2", UNPACK),
    (b"\xfd7zXZ\0", "compressed with xz", UNPACK),
    (b"\x93NUMPY", "a NumPy array", SPREADSHEET),
    (b"MATLAB 5.0", "a MATLAB file", SPREADSHEET),
    (b"\x80\x04\x95", "a Python pickle", SPREADSHEET),
    (b"\x80\x05\x95", "a Python pickle", SPREADSHEET),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook or another Office file", SPREADSHEET),
    (b"PK\x03\x04", "a zip archive", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (b"Rar!", "a rar archive", UNPACK),
    (b"\x89HDF", "an HDF5 file, as MATLAB writes", SPREADSHEET),
    (b"PAR1", "a Parquet table", SPREADSHEET),
    (b"ARROW1", "an Arrow table", SPREADSHEET),
    (b"\x89PNG", "a PNG image", NO_RECORDING),
    (b"\xff\xd8\xff", "a JPEG image", NO_RECORDING),
    (b"%PDF", "a PDF document", NO_RECORDING),
    (b"\x7fELF", "a program", NO_RECORDING),
    (b"version https://git-lfs", "a pointer of Git LFS, not the recording itself", "fetch it with `git lfs pull`"),
];

/// Describes the type of a file that begins with `start`, which is not empty and not the beginning of a recording.
pub fn describe(start: &[u8]) -> String {
    if MAGIC.starts_with(start) {
        return format!("it holds only the first {} bytes of one", start.len());
    }
    if let Some(what) = zipped_table(start) {
        return format!("it is {what}; {SPREADSHEET}");
    }
    if let Some((_, what, advice)) = KINDS.iter().find(|(magic, ..)| start.starts_with(magic)) {
        return format!("it is {what}; {advice}");
    }
    if start.iter().all(|byte| *byte == 0) {
        return "it holds zeros: it was never written, or was copied in part".to_owned();
    }
    if let Some(what) = text_kind(start) {
        return format!("it is {what}; {}", if [CSV, YAML, JSON].contains(&what) { TABLE } else { NO_RECORDING });
    }
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
    format!("it begins with the bytes {}, not with {}", hex(&start[..start.len().min(MAGIC.len())]), hex(MAGIC))
}

/// Type of a text file; `None` if it is not text.
fn text_kind(start: &[u8]) -> Option<&'static str> {
    let text = match std::str::from_utf8(start) {
        Ok(text) => text,
        // The compared bytes may end within a character.
        Err(error) if error.error_len().is_none() => std::str::from_utf8(&start[..error.valid_up_to()]).ok()?,
        Err(_) => return None,
    };
    let text = text.trim_start_matches('\u{feff}');
    if text.is_empty() || text.chars().any(|c| c.is_control() && !c.is_whitespace()) {
        return None;
    }
    let first_line = text.trim_start().lines().next().unwrap_or_default();
    Some(match first_line.chars().next() {
        Some('{' | '[')
            if !first_line.starts_with("[[") && first_line.contains(['"', '{', '[']) && !is_toml(first_line) =>
        {
            JSON
        }
        Some('<') => "an XML or HTML text",
        _ if first_line.matches([',', ';', '\t']).count() >= 2 => CSV,
        _ if is_yaml(text) => YAML,
        _ => "a text",
    })
}

/// Returns the type of a table in a zip archive, by the name of its first member.
fn zipped_table(start: &[u8]) -> Option<&'static str> {
    let has = |name: &[u8]| start.windows(name.len()).any(|part| part == name);
    let is_zip = start.starts_with(b"PK\x03\x04");
    let kinds: [(&[u8], &str); 3] = [
        (b"[Content_Types].xml", "an Excel workbook"),
        (b"opendocument.spreadsheet", "an OpenDocument spreadsheet"),
        (b".npy", "an archive of NumPy arrays"),
    ];
    kinds.into_iter().find(|(name, _)| is_zip && has(name)).map(|(_, what)| what)
}

/// Returns true for a list, or a map whose first line is `key:` or `key: value`.
fn is_yaml(text: &str) -> bool {
    let lines = text.lines().map(str::trim_end).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let Some(first) = lines.clone().find(|line| *line != "---") else { return false };
    let is_key = |key: &str| !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || "_-.".contains(c));
    let has_key = first.strip_suffix(':').or_else(|| Some(first.split_once(": ")?.0)).is_some_and(is_key);
    has_key || (first.starts_with("- ") && lines.clone().all(|line| line.starts_with(['-', ' '])))
}

/// Returns true for a line such as `[table]`.
fn is_toml(line: &str) -> bool {
    line.starts_with('[') && line.trim_end().ends_with(']') && !line.contains('"')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_other_programs_are_named_with_the_way_to_a_readable_one() {
        let cases: [&[u8]; 11] = [
            b"PK\x03\x04\x14\0\x06\0\x08\0[Content_Types].xml",
            b"PK\x03\x04mimetypeapplication/vnd.oasis.opendocument.spreadsheet",
            b"PK\x03\x04\x14\0angles.npy",
            b"PK\x03\x04\x14\0arm.mcap",
            b"PAR1\x15\x04",
            b"\x93NUMPY\x01\0v\0",
            b"\x80\x04\x95\x1a\0",
            b"samples:\n  - x: 1.0\n",
            b"---\n# poses\njoint_names: [j1, j2]\n",
            b"- x: 1\n- x: 2\n",
            b"Note: this was measured - on Monday\nby us\n",
        ];
        insta::assert_snapshot!("tables", cases.map(describe).join("\n"));
    }
}
