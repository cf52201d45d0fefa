//! Type of a file that is not an MCAP recording, with advice for the user.

use super::record::MAGIC;

/// Bytes of the file's beginning that are compared.
pub const START_BYTES: usize = 512;

/// First bytes of an SQLite file.
pub const SQLITE: &[u8] = b"SQLite format 3\0";

const UNPACK: &str = "unpack it first";
/// Command that makes a readable recording of a ROS 1 bag; tests/oracle/make_ros1_golden.py runs it.
pub const ROS1_ADVICE: &str = "rosbags 0.11.9 (`pip install rosbags==0.11.9`) converts it: \
    `rosbags-convert --src IN.bag --dst OUT --dst-storage mcap` writes OUT/OUT.mcap";
const NO_RECORDING: &str = "name the recording itself, an .mcap or .db3 file";
const TABLE: &str = "name the recording itself, an .mcap or .db3 file; a table of poses needs an input map with \
    [table], which `armcal inspect FILE --write-input MAP.toml` proposes";

const CSV: &str = "a table as text (CSV)";

/// First bytes, type and advice.
const KINDS: [(&[u8], &str, &str); 20] = [
    (b"#ROSBAG V", "a ROS 1 bag", ROS1_ADVICE),
    (SQLITE, "an SQLite database, as ROS 2 bags in .db3 files are", "only finished ones are read"),
    (b"RRF", "a file for the Rerun viewer (.rrd)", "name the recording that it was made from"),
    (b"RRIO", "a file for the Rerun viewer (.rrd)", "name the recording that it was made from"),
    (b"\x1f\x8b", "compressed with gzip", UNPACK),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd", UNPACK),
    (b"\x04\x22\x4d\x18", "compressed with lz4", UNPACK),
    (b"BZh", "compressed with bzip2", UNPACK),
    (b"\xfd7zXZ\0", "compressed with xz", UNPACK),
    (b"PK\x03\x04", "a zip archive", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (b"Rar!", "a rar archive", UNPACK),
    (b"\x89HDF", "an HDF5 file, as MATLAB writes", NO_RECORDING),
    (b"PAR1", "a Parquet table", NO_RECORDING),
    (b"ARROW1", "an Arrow table", NO_RECORDING),
    (b"\x89PNG", "a PNG image", NO_RECORDING),
    (b"\xff\xd8\xff", "a JPEG image", NO_RECORDING),
    (b"%PDF", "a PDF document", NO_RECORDING),
    (b"\x7fELF", "a program", NO_RECORDING),
    (b"version https://git-lfs", "a pointer of Git LFS, not the recording itself", "fetch it with `git lfs pull`"),
];

/// Type of a file that begins with `start`, which is not empty and not the beginning of a recording.
pub fn describe(start: &[u8]) -> String {
    if MAGIC.starts_with(start) {
        return format!("it holds only the first {} bytes of one", start.len());
    }
    if let Some((_, what, advice)) = KINDS.iter().find(|(magic, ..)| start.starts_with(magic)) {
        return format!("it is {what}; {advice}");
    }
    if start.iter().all(|byte| *byte == 0) {
        return "it holds zeros: it was never written, or was copied in part".to_owned();
    }
    if let Some(what) = text_kind(start) {
        return format!("it is {what}; {}", if what == CSV { TABLE } else { NO_RECORDING });
    }
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
    format!("it begins with the bytes {}, not with {}", hex(&start[..start.len().min(MAGIC.len())]), hex(MAGIC))
}

/// Type of a text file; `None` if it is not text.
fn text_kind(start: &[u8]) -> Option<&'static str> {
    let text = match std::str::from_utf8(start) {
        Ok(text) => text,
        // The beginning may end within a character.
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
            "a JSON text"
        }
        Some('<') => "an XML or HTML text",
        _ if first_line.matches([',', ';', '\t']).count() >= 2 => CSV,
        _ => "a text",
    })
}

/// `[table]`.
fn is_toml(line: &str) -> bool {
    line.starts_with('[') && line.trim_end().ends_with(']') && !line.contains('"')
}
