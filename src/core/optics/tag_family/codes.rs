//! The codes of each family.
//!
//! The codes of the older families come from OpenCV's dictionaries, turned upright: OpenCV holds them turned by half a
//! turn against the AprilTag project's images. The others are the AprilTag library's. Each code is the previous one
//! plus a multiple of a prime (Olson 2011); the multiples are stored. The script tests/oracle/make_tag_families.py
//! writes both.

use std::sync::LazyLock;

use super::TagFamily;

/// Step between codes, as in the AprilTag project's generator.
const PRIME: u64 = 982_451_653;

/// Codes by id, the highest bit first; 1 is white.
type Codes = LazyLock<Vec<u64>>;

fn listed(text: &str) -> Vec<u64> {
    text.split_whitespace().filter_map(|word| u64::from_str_radix(word, 16).ok()).collect()
}

/// Decodes codes stored as the first code, then each one's multiple of the prime.
fn stepped(text: &str, n_bits: u32) -> Vec<u64> {
    let mut code = 0_u64;
    let mut next = |(n, word): (usize, u64)| {
        let step = if n == 0 { word } else { word.wrapping_mul(PRIME) };
        code = code.wrapping_add(step) & ((1 << n_bits) - 1);
        code
    };
    listed(text).into_iter().enumerate().map(&mut next).collect()
}

static TAG_16H5: Codes = LazyLock::new(|| listed(include_str!("tag16h5.txt")));
static TAG_25H9: Codes = LazyLock::new(|| listed(include_str!("tag25h9.txt")));
static TAG_36H11: Codes = LazyLock::new(|| listed(include_str!("tag36h11.txt")));
static CIRCLE_21H7: Codes = LazyLock::new(|| stepped(include_str!("tagCircle21h7.txt"), 21));
static CIRCLE_49H12: Codes = LazyLock::new(|| stepped(include_str!("tagCircle49h12.txt"), 49));
static CUSTOM_48H12: Codes = LazyLock::new(|| stepped(include_str!("tagCustom48h12.txt"), 48));
static STANDARD_41H12: Codes = LazyLock::new(|| stepped(include_str!("tagStandard41h12.txt"), 41));
static STANDARD_52H13: Codes = LazyLock::new(|| stepped(include_str!("tagStandard52h13.txt"), 52));

pub(super) fn codes(family: TagFamily) -> &'static [u64] {
    match family {
        TagFamily::Tag16h5 => &TAG_16H5,
        TagFamily::Tag25h9 => &TAG_25H9,
        TagFamily::Tag36h11 => &TAG_36H11,
        TagFamily::Circle21h7 => &CIRCLE_21H7,
        TagFamily::Circle49h12 => &CIRCLE_49H12,
        TagFamily::Custom48h12 => &CUSTOM_48H12,
        TagFamily::Standard41h12 => &STANDARD_41H12,
        TagFamily::Standard52h13 => &STANDARD_52H13,
    }
}
