//! Messages in the wire format of protocol buffers
//! (<https://protobuf.dev/programming-guides/encoding/>). Field numbers are those of the ONNX specification (IR version 7,
//! opset 13); a field that is not written has its default value.

/// Element types of tensors.
pub(super) const FLOAT: i64 = 1;
pub(super) const INT64: i64 = 7;
pub(super) const DOUBLE: i64 = 11;
/// Kind of an attribute that is an integer.
pub(super) const INT_ATTRIBUTE: i64 = 2;

/// A message in progress: fields one after the other.
#[derive(Clone, Default)]
pub(super) struct Message(Vec<u8>);

impl Message {
    /// Adds a field with an integer.
    #[must_use]
    pub(super) fn int(mut self, field: u8, value: i64) -> Self {
        self.push_varint(u64::from(field) << 3);
        self.push_varint(value as u64);
        self
    }

    /// Adds a field with a text, bytes or a message.
    #[must_use]
    pub(super) fn bytes(mut self, field: u8, value: impl AsRef<[u8]>) -> Self {
        let value = value.as_ref();
        self.push_varint(u64::from(field) << 3 | 2);
        self.push_varint(value.len() as u64);
        self.0.extend(value);
        self
    }

    /// Adds a repeated field with these elements.
    #[must_use]
    pub(super) fn all(self, field: u8, values: impl IntoIterator<Item = impl AsRef<[u8]>>) -> Self {
        values
            .into_iter()
            .fold(self, |message, value| message.bytes(field, value))
    }

    /// Adds 7 bits per byte, the lowest first; the highest bit of a byte says that another one follows.
    fn push_varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }
}

impl AsRef<[u8]> for Message {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A field of a message that was read.
    #[derive(Clone, Debug, PartialEq)]
    pub(crate) enum Field<'a> {
        Int(u64),
        Bytes(&'a [u8]),
    }

    /// All fields with their numbers.
    pub(crate) fn fields(mut bytes: &[u8]) -> Vec<(u64, Field<'_>)> {
        fn varint(bytes: &mut &[u8]) -> u64 {
            let length = 1 + bytes.iter().position(|byte| byte & 0x80 == 0).unwrap();
            let (digits, rest) = bytes.split_at(length);
            *bytes = rest;
            digits
                .iter()
                .rev()
                .fold(0, |value, byte| value << 7 | u64::from(byte & 0x7f))
        }
        let mut fields = Vec::new();
        while !bytes.is_empty() {
            let tag = varint(&mut bytes);
            let value = varint(&mut bytes);
            fields.push(match tag & 7 {
                0 => (tag >> 3, Field::Int(value)),
                2 => {
                    let (field, rest) = bytes.split_at(value as usize);
                    bytes = rest;
                    (tag >> 3, Field::Bytes(field))
                }
                other => panic!("wire type {other}"),
            });
        }
        fields
    }

    /// The bytes are those of the examples in the documentation of the format: 150 is 96 01, "testing" has its length first.
    #[test]
    fn fields_are_written_as_in_the_examples_of_the_format() {
        assert_eq!(Message::default().int(1, 150).as_ref(), [0x08, 0x96, 0x01]);
        let text = Message::default().bytes(2, "testing");
        assert_eq!(text.as_ref(), [0x12, 0x07, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67]);
        let negative = Message::default().int(1, -2);
        assert_eq!(negative.as_ref().len(), 11);
        let nested = Message::default().int(1, 0).all(3, [&text, &negative]);
        let expected = [
            (1, Field::Int(0)),
            (3, Field::Bytes(text.as_ref())),
            (3, Field::Bytes(negative.as_ref())),
        ];
        assert_eq!(fields(nested.as_ref()), expected);
    }
}
