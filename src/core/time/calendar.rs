//! Conversion of stamps to dates, and of dates to stamps.

use toml::value::{Datetime, Offset};

use super::stamp::Stamp;

/// Returns the UTC date and time, such as `2026-01-01T00:00:00.000Z`.
#[must_use]
pub fn utc(nanos: u64) -> String {
    let (seconds, millis) = (nanos / 1_000_000_000, nanos / 1_000_000 % 1000);
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    // Years are counted from 1 March, so that the leap day is the last.
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{millis:03}Z")
}

/// Returns the stamp of a date and time of RFC 3339 (the extended form of ISO 8601), such as
/// `2026-03-01T12:00:00.250+01:00`.
///
/// The time is UTC if it states no offset. A space may replace the `T`, a comma the point; decimals beyond nanoseconds
/// are dropped. `None` for every other text, for a leap second, and before 1970 or after 2262.
#[must_use]
pub fn stamp_of_date(text: &str) -> Option<Stamp> {
    let read: Datetime = text.replace(',', ".").parse().ok()?;
    let (date, time) = (read.date?, read.time?);
    let second = i64::from(time.second.filter(|second| *second < 60)?);
    let offset_min = match read.offset {
        Some(Offset::Custom { minutes }) => i64::from(minutes),
        Some(Offset::Z) | None => 0,
    };
    // Years are counted from 1 March, so that the leap day is the last.
    let (year, month) = (i64::from(date.year), i64::from(date.month));
    let (year, shifted_month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let day_of_year = (153 * shifted_month + 2) / 5 + i64::from(date.day) - 1;
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    let days = 365 * year + leap_days + day_of_year - 719_468;
    let minutes = 60 * (24 * days + i64::from(time.hour)) + i64::from(time.minute) - offset_min;
    let nanos = (60 * minutes + second).checked_mul(1_000_000_000)?;
    let nanos = nanos.checked_add(i64::from(time.nanosecond.unwrap_or_default()))?;
    (nanos >= 0).then_some(Stamp { nanos })
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn dates_are_read_as_they_are_written() {
        // Samples from 1970 to 2262 in steps of about 11 hours, whole milliseconds.
        for millis in (0..9_223_372_036_854_u64).step_by(39_916_801) {
            let date = utc(millis * 1_000_000);
            assert_eq!(stamp_of_date(&date), Some(Stamp { nanos: millis as i64 * 1_000_000 }), "{date}");
        }
        let noon = 1_772_366_400_000_000_000;
        let cases = [
            ("2026-03-01T12:00:00Z", 0),
            ("2026-03-01 12:00:00", 0),
            ("2026-03-01t12:00:00z", 0),
            ("2026-03-01T13:00:00+01:00", 0),
            ("2026-02-28T21:30:00-14:30", 0),
            ("2026-03-02 00:30:00.5+12:30", 500_000_000),
            ("2026-03-01T12:00:00,25", 250_000_000),
            ("2026-03-01T12:00:00.000000001Z", 1),
            ("2026-03-01T13:00:00,123456789+01:00", 123_456_789),
            ("2026-03-01T12:00:00.1234567899999999999999999999Z", 123_456_789),
        ];
        for (text, after) in cases {
            assert_eq!(stamp_of_date(text), Some(Stamp { nanos: noon + after }), "{text}");
        }
        assert_eq!(
            stamp_of_date("2024-02-29T00:00:00Z").map(|stamp| utc(stamp.nanos as u64)[..10].to_owned()).as_deref(),
            Some("2024-02-29")
        );
        assert_eq!(stamp_of_date("1970-01-01T01:00:00+01:00"), Some(Stamp::default()));
        assert_eq!(stamp_of_date("2262-04-11T23:47:16.854775807Z"), Some(Stamp { nanos: i64::MAX }));
    }

    /// Refused texts, separated by bars.
    const REFUSED: &str = "| |T|Z|1772366400|12:00:00|2026-03-01|2026-03-01T|2026-03-01T12|2026-03-01T12:00Z|\
        2026-13-01T12:00:00Z|2026-00-01T12:00:00Z|2026-03-00T12:00:00Z|2026-04-31T12:00:00Z|\
        2026-02-29T12:00:00Z|2100-02-29T12:00:00Z|2026-03-01T24:00:00Z|2026-03-01T12:60:00Z|\
        2026-03-01T12:00:60Z|2026-03-01T12:00:00.Z|2026-03-01T12:00:00+24:00|2026-03-01T12:00:00+01:60|\
        2026-03-01T12:00:00+|2026-03-01T12:00:00 UTC|2026-03-01T12:00:00Zulu|2026-03-01T12:00:00Z\0|\
        1969-12-31T23:59:59.999Z|1970-01-01T00:00:00+00:01|0000-01-01T00:00:00Z|9999-12-31T23:59:59-23:59|\
        2262-04-11T23:47:16.854775808Z|2262-04-12T00:00:00Z|12026-03-01T12:00:00Z|-2026-03-01T12:00:00Z|\
        99999999999999999999-03-01T12:00:00Z|26-3-1T1:2:3Z|2026/03/01 12:00:00|01.03.2026 12:00:00|\
        2026-03-01T12:00:00\u{2212}01:00|\u{662}\u{660}26-03-01T12:00:00Z|2026-03-01T12:00:0\u{665}Z|\
        \u{feff}2026-03-01T12:00:00Z|2026-03-01\u{a0}12:00:00Z|\u{1f552}";

    #[test]
    fn what_is_no_date_and_time_is_no_stamp() {
        for text in REFUSED.split('|') {
            assert_eq!(stamp_of_date(text), None, "{text:?}");
        }
        // Every proper prefix of a date, and a date with any one byte replaced.
        let whole = "2026-03-01T12:00:00.250+01:00";
        assert!((0..19).all(|end| stamp_of_date(&whole[..end]).is_none()));
        for (at, c) in (0..whole.len()).flat_map(|at| ['9', ',', '-', 'T', '\u{e9}', '\u{10ffff}'].map(|c| (at, c))) {
            let _ = stamp_of_date(&format!("{}{c}{}", &whole[..at], &whole[at + 1..]));
        }
    }
}
