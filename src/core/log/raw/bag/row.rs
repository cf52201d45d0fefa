//! Columns of a row.

use super::numbers::varint;

/// Value of one column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Value<'a> {
    /// No value, or a column that was added after the row. In the column of the row's own number, it means that number.
    #[default]
    Null,
    Integer(i64),
    Real,
    Text(&'a [u8]),
    Blob(&'a [u8]),
}

impl Value<'_> {
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(bytes) => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }

    pub fn integer(&self) -> Option<i64> {
        match self {
            Self::Integer(value) => Some(*value),
            _ => None,
        }
    }
}

/// Returns the columns at the indices `wanted`; columns that no table declares are [`Value::Null`]. `None` for a row
/// that contradicts itself.
pub fn columns<'a, const N: usize>(payload: &'a [u8], wanted: &[Option<usize>; N]) -> Option<[Value<'a>; N]> {
    let mut values = [Value::Null; N];
    let (head_bytes, _) = varint(payload)?;
    let (head, mut body) = payload.split_at_checked(usize::try_from(head_bytes).ok()?)?;
    let (_, mut head) = varint(head)?;
    let last = wanted.iter().flatten().max()?;
    for column in 0..=*last {
        if head.is_empty() {
            break;
        }
        let (kind, rest) = varint(head)?;
        head = rest;
        let (bytes, rest) = body.split_at_checked(length(kind)?)?;
        body = rest;
        for (value, wanted) in values.iter_mut().zip(wanted) {
            if *wanted == Some(column) {
                *value = read(kind, bytes);
            }
        }
    }
    Some(values)
}

/// Returns the length in bytes of a column of this kind.
fn length(kind: u64) -> Option<usize> {
    Some(match kind {
        0 | 8 | 9 => 0,
        1..=4 => kind as usize,
        5 => 6,
        6 | 7 => 8,
        10 | 11 => return None,
        _ => usize::try_from((kind - 12) / 2).ok()?,
    })
}

fn read(kind: u64, bytes: &[u8]) -> Value<'_> {
    match kind {
        0 => Value::Null,
        7 => Value::Real,
        8 | 9 => Value::Integer(kind as i64 - 8),
        1..=6 => {
            // Big-endian, two's complement.
            let sign = if bytes.first().is_some_and(|byte| byte & 0x80 != 0) { -1 } else { 0 };
            Value::Integer(bytes.iter().fold(sign, |value, byte| value << 8 | i64::from(*byte)))
        }
        _ if kind.is_multiple_of(2) => Value::Blob(bytes),
        _ => Value::Text(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_length_are_read() {
        assert_eq!(varint(&[0x7f, 5]), Some((127, &[5_u8][..])));
        assert_eq!(varint(&[0x81, 0x00]), Some((128, &[][..])));
        assert_eq!(varint(&[0xff; 9]), Some((u64::MAX, &[][..])));
        assert_eq!((varint(&[0x81]), varint(&[])), (None, None));
        for (kind, bytes, value) in
            [(1, &[0xff][..], -1), (2, &[1, 0], 256), (5, &[0x80, 0, 0, 0, 0, 0], -(1 << 47)), (9, &[], 1)]
        {
            assert_eq!(read(kind, bytes), Value::Integer(value));
        }
        assert_eq!(read(6, &i64::MIN.to_be_bytes()), Value::Integer(i64::MIN));
    }

    #[test]
    fn columns_are_found_by_place_and_lengths_are_not_believed() {
        // The row's own number, 300, "ab", two bytes.
        let row = [5, 0, 2, 17, 16, 1, 44, b'a', b'b', 7, 8];
        let found = columns(&row, &[Some(3), None, Some(1), Some(2), Some(0), Some(9)]).expect("a row");
        let text = Value::Text(b"ab");
        assert_eq!(found, [Value::Blob(&[7, 8]), Value::Null, Value::Integer(300), text, Value::Null, Value::Null]);
        assert_eq!(columns(&row[..10], &[Some(3)]), None);
        assert_eq!(columns(&[200, 0, 2], &[Some(0)]), None);
        assert_eq!(columns(&[2, 10], &[Some(0)]), None);
    }
}
