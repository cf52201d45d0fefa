//! Bytes of ROS 2 messages: CDR, little endian when written, either order when read.

use re_cdr::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize};

/// Encapsulation header of plain CDR, little endian.
const LITTLE_ENDIAN_HEADER: [u8; 4] = [0, 1, 0, 0];
/// Maximum number of padding bytes at a message's end, by the largest alignment of CDR.
const MAX_PADDING_BYTES: usize = 7;

/// Reason why bytes are not a message of the expected type. It has no values, so that equal causes count as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum CdrError {
    #[error("the bytes do not begin with a header of plain CDR")]
    Header,
    #[error("the bytes end before the message does")]
    TooShort,
    #[error("bytes are left over: the message is of another type")]
    LeftOver,
    #[error("a text is not valid UTF-8")]
    Utf8,
    #[error("a length, flag or tag is impossible")]
    Value,
    #[error("the type has a field that CDR cannot express")]
    Type,
}

impl From<re_cdr::Error> for CdrError {
    fn from(error: re_cdr::Error) -> Self {
        use re_cdr::Error as E;
        match error {
            E::UnexpectedEof => Self::TooShort,
            E::Utf8(_) => Self::Utf8,
            E::UnsupportedAny | E::UnknownLength => Self::Type,
            E::InvalidBool(_) | E::InvalidChar(_) | E::InvalidOptionTag(_) | E::Custom(_) => Self::Value,
        }
    }
}

/// Decodes one message, with its four bytes of header.
///
/// # Errors
/// [`CdrError`] if the bytes are not a `T`. Numbers are not checked: they may be NaN.
pub fn decode<'de, T: Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, CdrError> {
    let (header, body) = bytes.split_first_chunk::<4>().ok_or(CdrError::Header)?;
    let (value, used) = match header[..2] {
        [0, 0] => re_cdr::from_bytes::<T, BigEndian>(body)?,
        [0, 1] => re_cdr::from_bytes::<T, LittleEndian>(body)?,
        _ => return Err(CdrError::Header),
    };
    if body.len() - used > MAX_PADDING_BYTES {
        return Err(CdrError::LeftOver);
    }
    Ok(value)
}

/// Encodes one message, header first, into `out`, and replaces its content.
///
/// # Errors
/// [`CdrError::Type`] if `T` has a field that CDR cannot express.
pub fn encode<T: Serialize + ?Sized>(value: &T, out: &mut Vec<u8>) -> Result<(), CdrError> {
    out.clear();
    out.extend_from_slice(&LITTLE_ENDIAN_HEADER);
    // The serializer aligns relative to its start, the end of the header, as CDR requires.
    let mut serializer = re_cdr::CdrSerializer::<LittleEndian>::new(out);
    value.serialize(&mut serializer)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::messages::{Header, JointState, StringMessage, Time};
    use super::*;

    fn joint_state() -> JointState {
        JointState {
            header: Header { stamp: Time { sec: 7, nanosec: 8 }, frame_id: "base".into() },
            name: vec!["a".into(), "bc".into()],
            position: vec![1.5, -2.5],
            velocity: vec![],
            effort: vec![0.25],
        }
    }

    #[test]
    fn known_bytes_of_a_string_message() {
        let mut bytes = Vec::new();
        encode(&StringMessage { data: "hi".into() }, &mut bytes).unwrap();
        assert_eq!(bytes, [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0]);
    }

    #[test]
    fn every_shortened_message_is_an_error() {
        let mut bytes = Vec::new();
        encode(&joint_state(), &mut bytes).unwrap();
        assert_eq!(decode::<JointState>(&bytes), Ok(joint_state()));
        for end in 0..bytes.len() {
            assert!(decode::<JointState>(&bytes[..end]).is_err(), "{end} of {} bytes", bytes.len());
        }
    }

    #[test]
    fn padding_is_accepted_and_further_fields_are_not() {
        let mut bytes = Vec::new();
        encode(&joint_state(), &mut bytes).unwrap();
        bytes.extend_from_slice(&[0; MAX_PADDING_BYTES]);
        assert!(decode::<JointState>(&bytes).is_ok());
        bytes.push(0);
        assert_eq!(decode::<JointState>(&bytes), Err(CdrError::LeftOver));
    }

    #[test]
    fn big_endian_is_read() {
        let bytes = [0, 0, 0, 0, 0, 0, 0, 3, b'h', b'i', 0];
        assert_eq!(decode::<StringMessage>(&bytes), Ok(StringMessage { data: "hi".into() }));
    }

    #[test]
    fn huge_lengths_are_errors_without_huge_allocations() {
        let bytes = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0x7f, 1, 2, 3];
        assert!(decode::<StringMessage>(&bytes).is_err());
        assert!(decode::<Vec<f64>>(&bytes).is_err());
        let just_allowed = [0, 1, 0, 0, 0, 0xe1, 0xf5, 0x05, 1, 2, 3, 4];
        assert_eq!(decode::<Vec<f64>>(&just_allowed), Err(CdrError::TooShort));
    }
}
