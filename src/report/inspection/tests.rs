//! Times as text; the rest is tested on real files from outside.

use crate::report::inspection::text::utc;

#[test]
fn times_are_those_of_the_calendar() {
    let cases = [
        (0, "1970-01-01T00:00:00.000Z"),
        (951_782_400, "2000-02-29T00:00:00.000Z"),
        (951_868_799, "2000-02-29T23:59:59.000Z"),
        (1_767_225_600, "2026-01-01T00:00:00.000Z"),
        (4_107_542_400, "2100-03-01T00:00:00.000Z"),
    ];
    for (seconds, expected) in cases {
        assert_eq!(utc(seconds * 1_000_000_000), expected);
    }
    assert_eq!(utc(1_500_000_000), "1970-01-01T00:00:01.500Z");
    assert_eq!(utc(u64::MAX), "2554-07-21T23:34:33.709Z");
}
