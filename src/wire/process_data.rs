//! Process data of an EtherCAT device: the objects that it maps into the frames of each tick, as text and as bytes.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// Type of an entry, as in the file: `u8` … `f64`. Little-endian in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
}

impl Kind {
    /// All kinds with their words.
    const WORDS: [(&'static str, Kind); 8] = [
        ("u8", Kind::U8),
        ("i8", Kind::I8),
        ("u16", Kind::U16),
        ("i16", Kind::I16),
        ("u32", Kind::U32),
        ("i32", Kind::I32),
        ("f32", Kind::F32),
        ("f64", Kind::F64),
    ];

    /// Its word in the file.
    #[must_use]
    pub fn word(self) -> &'static str {
        let mut words = Self::WORDS.iter();
        words
            .find(|(_, kind)| *kind == self)
            .map_or("u8", |(word, _)| word)
    }

    /// Length in bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Kind::U8 | Kind::I8 => 1,
            Kind::U16 | Kind::I16 => 2,
            Kind::U32 | Kind::I32 | Kind::F32 => 4,
            Kind::F64 => 8,
        }
    }

    /// Smallest and largest value.
    #[must_use]
    pub fn range(self) -> (f64, f64) {
        match self {
            Kind::U8 => (0.0, f64::from(u8::MAX)),
            Kind::I8 => (f64::from(i8::MIN), f64::from(i8::MAX)),
            Kind::U16 => (0.0, f64::from(u16::MAX)),
            Kind::I16 => (f64::from(i16::MIN), f64::from(i16::MAX)),
            Kind::U32 => (0.0, f64::from(u32::MAX)),
            Kind::I32 => (f64::from(i32::MIN), f64::from(i32::MAX)),
            Kind::F32 => (f64::from(f32::MIN), f64::from(f32::MAX)),
            Kind::F64 => (f64::MIN, f64::MAX),
        }
    }

    /// Reads a value; 0 if `bytes` is too short. Real-time: yes.
    #[must_use]
    pub fn read(self, bytes: &[u8]) -> f64 {
        fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
            bytes.first_chunk().copied().unwrap_or([0; N])
        }
        match self {
            Kind::U8 => f64::from(u8::from_le_bytes(first(bytes))),
            Kind::I8 => f64::from(i8::from_le_bytes(first(bytes))),
            Kind::U16 => f64::from(u16::from_le_bytes(first(bytes))),
            Kind::I16 => f64::from(i16::from_le_bytes(first(bytes))),
            Kind::U32 => f64::from(u32::from_le_bytes(first(bytes))),
            Kind::I32 => f64::from(i32::from_le_bytes(first(bytes))),
            Kind::F32 => f64::from(f32::from_le_bytes(first(bytes))),
            Kind::F64 => f64::from_le_bytes(first(bytes)),
        }
    }

    /// Writes a value, rounded to the nearest count and limited to the range of the type; writes nothing if `bytes` is too short or
    /// `value` is not a number. Real-time: yes.
    pub fn write(self, value: f64, bytes: &mut [u8]) {
        fn put<const N: usize>(value: [u8; N], bytes: &mut [u8]) {
            if let Some(place) = bytes.first_chunk_mut() {
                *place = value;
            }
        }
        if value.is_nan() {
            return;
        }
        // A cast limits to the range.
        let count = value.round_ties_even();
        match self {
            Kind::U8 => put((count as u8).to_le_bytes(), bytes),
            Kind::I8 => put((count as i8).to_le_bytes(), bytes),
            Kind::U16 => put((count as u16).to_le_bytes(), bytes),
            Kind::I16 => put((count as i16).to_le_bytes(), bytes),
            Kind::U32 => put((count as u32).to_le_bytes(), bytes),
            Kind::I32 => put((count as i32).to_le_bytes(), bytes),
            Kind::F32 => put((value as f32).to_le_bytes(), bytes),
            Kind::F64 => put(value.to_le_bytes(), bytes),
        }
    }
}

/// One entry of the process data of a device: an object of its dictionary, its type and, if the test uses it, a name.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Entry {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
    /// Type and length.
    pub kind: Kind,
    /// Name in the test file.
    pub name: Option<String>,
}

/// Length in bytes of these entries in a frame.
#[must_use]
pub fn length(entries: &[Entry]) -> usize {
    entries.iter().map(|entry| entry.kind.bytes()).sum()
}

/// Why a text is no entry.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EntryError {
    /// The object is not "index:subindex" in hexadecimal digits.
    #[error("`{0}` is not an object such as `6000:11` (index and subindex in hexadecimal digits)")]
    Object(String),
    /// The type is not known.
    #[error("`{0}` is no type; allowed are u8, i8, u16, i16, u32, i32, f32 and f64")]
    Kind(String),
    /// The value of a write does not fit its type.
    #[error("`{0}` is no value of its type")]
    Value(String),
    /// Words are missing, or there are too many.
    #[error("`{0}` has {1} words; \"index:subindex type\" and a name or a value are allowed")]
    Words(String, usize),
}

fn object(word: &str) -> Result<(u16, u8), EntryError> {
    let parsed = word.split_once(':').and_then(|(index, sub)| {
        let index = u16::from_str_radix(index, 16).ok()?;
        Some((index, u8::from_str_radix(sub, 16).ok()?))
    });
    parsed.ok_or_else(|| EntryError::Object(word.to_owned()))
}

fn kind(word: &str) -> Result<Kind, EntryError> {
    let mut words = Kind::WORDS.iter();
    let found = words.find(|(known, _)| *known == word);
    found.map_or_else(|| Err(EntryError::Kind(word.to_owned())), |row| Ok(row.1))
}

impl FromStr for Entry {
    type Err = EntryError;

    /// Reads "6000:11 i16 force".
    fn from_str(text: &str) -> Result<Self, EntryError> {
        let words: Vec<&str> = text.splitn(3, ' ').collect();
        let (at, of, name) = match words.as_slice() {
            [at, of] => (at, of, None),
            [at, of, name] if !name.trim().is_empty() => (at, of, Some(name.trim().to_owned())),
            _ => return Err(EntryError::Words(text.to_owned(), words.len())),
        };
        let (index, sub) = object(at)?;
        Ok(Self {
            index,
            sub,
            kind: kind(of)?,
            name,
        })
    }
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            index, sub, kind, ..
        } = self;
        write!(f, "{index:04x}:{sub:02x} {}", kind.word())?;
        match &self.name {
            Some(name) => write!(f, " {name}"),
            None => Ok(()),
        }
    }
}

/// An object that is written once before the process data begin.
#[derive(Debug, Clone, PartialEq)]
pub struct SetupWrite {
    /// The object and its type; it has no name.
    pub entry: Entry,
    /// The value in counts.
    pub value: f64,
}

impl fmt::Display for SetupWrite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.entry, self.value)
    }
}

impl FromStr for SetupWrite {
    type Err = EntryError;

    /// Reads "8000:05 u8 2"; a value may be hexadecimal with `0x`.
    fn from_str(text: &str) -> Result<Self, EntryError> {
        let mut entry: Entry = text.parse()?;
        let Some(word) = entry.name.take() else {
            return Err(EntryError::Words(text.to_owned(), 2));
        };
        let value = match word.strip_prefix("0x") {
            Some(digits) => u32::from_str_radix(digits, 16).ok().map(f64::from),
            None => word.parse().ok(),
        };
        let (least, most) = entry.kind.range();
        let is_whole =
            |value: f64| matches!(entry.kind, Kind::F32 | Kind::F64) || value.fract() == 0.0;
        match value {
            Some(value) if (least..=most).contains(&value) && is_whole(value) => {
                Ok(Self { entry, value })
            }
            _ => Err(EntryError::Value(word)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_read_back_as_written() {
        for text in [
            "6000:11 i16 force",
            "1a00:01 u32",
            "7010:01 f64 north command",
        ] {
            let entry: Entry = text.parse().unwrap();
            assert_eq!(entry.to_string(), text);
        }
        let write: SetupWrite = "8000:05 u8 0x02".parse().unwrap();
        assert_eq!(
            (write.entry.index, write.entry.sub, write.value),
            (0x8000, 5, 2.0)
        );
        assert_eq!(write.to_string().parse(), Ok(write));
    }

    #[test]
    fn wrong_entries_are_named() {
        let entry = |text: &str| text.parse::<Entry>().unwrap_err();
        assert_eq!(entry("6000 i16"), EntryError::Object("6000".into()));
        assert_eq!(entry("6000:11 i24"), EntryError::Kind("i24".into()));
        assert_eq!(entry("6000:11"), EntryError::Words("6000:11".into(), 1));
        let value = |text: &str| text.parse::<SetupWrite>().unwrap_err();
        assert_eq!(value("8000:05 u8 256"), EntryError::Value("256".into()));
        assert_eq!(value("8000:05 u8 1.5"), EntryError::Value("1.5".into()));
        assert_eq!(
            value("8000:05 u8"),
            EntryError::Words("8000:05 u8".into(), 2)
        );
    }

    #[test]
    fn values_round_to_counts_and_keep_their_range() {
        for (kind, value, back) in [
            (Kind::I16, 1.6, 2.0),
            (Kind::I16, 1e9, 32767.0),
            (Kind::I16, -1e9, -32768.0),
            (Kind::U8, -3.0, 0.0),
            (Kind::I32, -2_147_483_648.0, -2_147_483_648.0),
            (Kind::F64, 0.1, 0.1),
        ] {
            let mut bytes = [0; 8];
            kind.write(value, &mut bytes);
            assert_eq!(kind.read(&bytes), back, "{kind:?}");
        }
        let mut bytes = 7i16.to_le_bytes();
        Kind::I16.write(f64::NAN, &mut bytes);
        assert_eq!(Kind::I16.read(&bytes), 7.0);
        Kind::I16.write(9.0, &mut bytes[..1]);
        assert_eq!(Kind::I16.read(&bytes), 7.0);
    }
}
