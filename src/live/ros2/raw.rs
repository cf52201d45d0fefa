//! Messages as bytes of CDR with their header, as recordings keep them.

use std::convert::Infallible;

use rustdds::RepresentationIdentifier;
use rustdds::bytes::Bytes;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};

/// Length of the encapsulation header.
pub(super) const HEADER_BYTES: usize = 4;
const ENCODINGS: [RepresentationIdentifier; 2] = [RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE];

/// Serializer that passes bytes on.
pub(crate) struct Raw;

/// Decoder that restores the header before the body.
#[derive(Clone)]
pub(crate) struct WithHeader;

impl<'de> Decode<'de, Vec<u8>> for WithHeader {
    type Error = Infallible;

    fn decode_bytes(self, body: &'de [u8], encoding: RepresentationIdentifier) -> Result<Vec<u8>, Infallible> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + body.len());
        bytes.extend_from_slice(&encoding.to_bytes());
        bytes.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(body);
        Ok(bytes)
    }
}

impl DeserializerAdapter<Vec<u8>> for Raw {
    type Error = Infallible;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &ENCODINGS
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl DefaultDecoder<Vec<u8>> for Raw {
    type Decoder = WithHeader;
    const DECODER: WithHeader = WithHeader;
}

impl SerializerAdapter<Vec<u8>> for Raw {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    /// Removes the header (little endian), which the serializer writes itself.
    fn to_bytes(value: &Vec<u8>) -> Result<Bytes, Infallible> {
        Ok(Bytes::copy_from_slice(value.get(HEADER_BYTES..).unwrap_or_default()))
    }
}
