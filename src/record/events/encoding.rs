//! How the fields of an event are written: indices count from 1, and a number that is not finite is null.

/// A number; one that is not finite is null in the file, and NaN when it is read.
pub(super) mod real {
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub(crate) fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_f64(*value)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Option::<f64>::deserialize(from).map(|value| value.unwrap_or(f64::NAN))
    }
}

/// An index from 0 that counts from 1 in the file.
pub(super) mod from_one {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub(crate) fn serialize<S: Serializer>(index: &u32, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_u64(u64::from(*index) + 1)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
        let number = u32::deserialize(from)?;
        number
            .checked_sub(1)
            .ok_or_else(|| D::Error::custom("counts from 1"))
    }
}

/// The number of an optional index, from 1.
pub(super) mod from_one_if_any {
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref, clippy::ref_option)]
    pub(crate) fn serialize<S: Serializer>(index: &Option<u32>, to: S) -> Result<S::Ok, S::Error> {
        match index {
            Some(index) => super::from_one::serialize(index, to),
            None => to.serialize_none(),
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
        let number = Option::<u32>::deserialize(from)?;
        Ok(number.and_then(|number| number.checked_sub(1)))
    }
}

/// 64 bits as 16 hexadecimal digits.
pub(super) mod hexadecimal {
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)]
    pub(crate) fn serialize<S: Serializer>(bits: &u64, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&format_args!("{bits:016x}"))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        let digits = String::deserialize(from)?;
        u64::from_str_radix(&digits, 16).map_err(D::Error::custom)
    }
}
