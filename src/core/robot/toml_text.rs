//! Limits on the size of a TOML text: each key and value costs a hundred times its bytes once it is parsed.

/// Limit of keys, including those of tables.
const MAX_KEYS: usize = 100_000;
/// Limit of values in lists, and of lists and tables.
const MAX_VALUES: usize = 1_000_000;

/// Counts keys and values; the count is an upper bound, because it includes comments and strings.
///
/// # Errors
/// A sentence, if there are more than the limits.
pub(super) fn check_entries(text: &str) -> Result<(), String> {
    let (mut n_keys, mut n_values) = (0, 0);
    // Dots of the key or number that is being read.
    let mut n_dots = 0;
    let (mut at_line_start, mut in_header) = (true, false);
    for byte in text.bytes() {
        match byte {
            b'.' => n_dots += 1,
            b'=' => n_keys += 1 + std::mem::take(&mut n_dots),
            b'[' | b'{' => {
                n_values += 1;
                n_dots = 0;
                in_header |= at_line_start;
            }
            // `[a.b]` has two keys, `[1.0, 2.0]` has none.
            b']' if std::mem::take(&mut in_header) => n_keys += 1 + std::mem::take(&mut n_dots),
            b',' => {
                n_values += 1;
                (n_dots, in_header) = (0, false);
            }
            b'\n' => (n_dots, in_header) = (0, false),
            _ => {}
        }
        at_line_start = byte == b'\n' || (at_line_start && byte.is_ascii_whitespace());
    }
    for (n, max, what) in [(n_keys, MAX_KEYS, "keys"), (n_values, MAX_VALUES, "values")] {
        if n > max {
            return Err(format!("it has more than {max} {what}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_numbers_hold_no_keys() {
        let points = "[1.5, 2.5, 3.5],\n".repeat(MAX_VALUES / 4 - 1);
        assert_eq!(check_entries(&format!("points_m = [\n{points}]")), Ok(()));
        insta::assert_snapshot!("many_values", check_entries(&format!("points_m = [\n{points}{points}]")).unwrap_err());
    }

    #[test]
    fn every_way_to_write_a_key_counts() {
        for (unit, n) in
            [("a = 1\n", 1), ("a.b.c=1\n", 3), ("[a.b.c]\n", 3), ("[[a.b.c]]\n", 3), ("[a]\n", 1), ("{a.b=1},", 2)]
        {
            assert_eq!(check_entries(&unit.repeat(MAX_KEYS / n)), Ok(()), "{unit}");
            insta::assert_snapshot!("many_keys", check_entries(&unit.repeat(MAX_KEYS / n + 1)).expect_err(unit));
        }
    }
}
