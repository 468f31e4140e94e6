//! The compact form of Thrift, as far as Parquet's descriptions need it.

/// Type of a field.
const I32: u8 = 5;
const I64: u8 = 6;
const TEXT: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A struct being written. Fields in the order of their numbers.
#[derive(Default)]
pub(super) struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

impl Struct {
    fn field(&mut self, number: u8, kind: u8) {
        // Numbers grow and are small, so the step fits the upper four bits.
        self.bytes.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    pub fn i32(mut self, number: u8, value: i32) -> Self {
        self.field(number, I32);
        integer(&mut self.bytes, i64::from(value));
        self
    }

    pub fn i64(mut self, number: u8, value: u64) -> Self {
        self.field(number, I64);
        // Counts and offsets in a file stay below 2^63.
        integer(&mut self.bytes, value as i64);
        self
    }

    pub fn text(mut self, number: u8, value: &str) -> Self {
        self.field(number, TEXT);
        text(&mut self.bytes, value);
        self
    }

    pub fn inner(mut self, number: u8, value: Struct) -> Self {
        self.field(number, STRUCT);
        self.bytes.append(&mut value.finish());
        self
    }

    pub fn structs(mut self, number: u8, values: impl IntoIterator<Item = Struct>) -> Self {
        self.field(number, LIST);
        let values: Vec<Struct> = values.into_iter().collect();
        list(&mut self.bytes, values.len(), STRUCT);
        for value in values {
            self.bytes.append(&mut value.finish());
        }
        self
    }

    pub fn texts(mut self, number: u8, values: &[&str]) -> Self {
        self.field(number, LIST);
        list(&mut self.bytes, values.len(), TEXT);
        for value in values {
            text(&mut self.bytes, value);
        }
        self
    }

    pub fn i32s(mut self, number: u8, values: &[i32]) -> Self {
        self.field(number, LIST);
        list(&mut self.bytes, values.len(), I32);
        for value in values {
            integer(&mut self.bytes, i64::from(*value));
        }
        self
    }

    pub fn finish(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

fn list(out: &mut Vec<u8>, length: usize, kind: u8) {
    if length < 15 {
        out.push((length as u8) << 4 | kind);
    } else {
        out.push(0xF0 | kind);
        varint(out, length as u64);
    }
}

fn text(out: &mut Vec<u8>, value: &str) {
    varint(out, value.len() as u64);
    out.extend_from_slice(value.as_bytes());
}

/// Zigzag: small numbers of both signs are short.
fn integer(out: &mut Vec<u8>, value: i64) {
    varint(out, (value << 1 ^ value >> 63) as u64);
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
