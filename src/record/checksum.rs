//! The SHA-256 of a file, as files of a run and events carry it.

use std::fmt;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use sha2::{Digest as _, Sha256};

/// A SHA-256. Its text has 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Checksum([u8; Self::BYTES]);

impl Checksum {
    /// Its length.
    pub(crate) const BYTES: usize = 32;

    /// The SHA-256 of these bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(Sha256::digest(bytes).into())
    }

    /// Its bytes.
    #[must_use]
    pub(crate) const fn bytes(&self) -> &[u8; Self::BYTES] {
        &self.0
    }
}

/// The SHA-256 of the bytes that were hashed piece by piece.
impl From<Sha256> for Checksum {
    fn from(sha: Sha256) -> Self {
        Self(sha.finalize().into())
    }
}

impl fmt::Display for Checksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&gusset_quantity::text::hex(&self.0))
    }
}

impl fmt::Debug for Checksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Serialize for Checksum {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Checksum {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let wrong = || D::Error::custom("a SHA-256 has 64 hexadecimal digits");
        if text.len() != 2 * Self::BYTES || !text.is_ascii() {
            return Err(wrong());
        }
        let mut bytes = [0; Self::BYTES];
        for (byte, digits) in bytes.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
            let digits = std::str::from_utf8(digits).map_err(|_| wrong())?;
            *byte = u8::from_str_radix(digits, 16).map_err(|_| wrong())?;
        }
        Ok(Self(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of one block in FIPS 180-4.
    #[test]
    fn checksum_of_abc_is_the_published_one() {
        assert_eq!(
            Checksum::of(b"abc").to_string(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!(
            Checksum::from(Sha256::new().chain_update("abc")),
            Checksum::of(b"abc")
        );
    }

    #[test]
    fn checksum_survives_text_form() {
        let checksum = Checksum::of(&[2]);
        let text = serde_json::to_string(&checksum).unwrap();
        assert_eq!(text.len(), 66);
        assert_eq!(serde_json::from_str::<Checksum>(&text).unwrap(), checksum);
        for wrong in ["\"00\"", "\"é\"", &text.replace(['0', '1', '2', '3'], "x")] {
            assert!(serde_json::from_str::<Checksum>(wrong).is_err(), "{wrong}");
        }
    }
}
