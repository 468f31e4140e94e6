//! Values that TOML alone cannot type: exact rates, λ, an estimate that is a number or a matrix, a choice of DOFs.
//!
//! Each defines its accepted values in words, and writes itself back so that it reads again as the same value.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, IgnoredAny, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use gusset_quantity::time::{RateError, Ratio};

/// Reads a number, a text or a list: `judge` takes the first two, `list` the third. The error for any other value names
/// `expecting`, or the words of `judge`.
pub(super) struct Judged<T, E> {
    pub expecting: &'static str,
    pub judge: fn(Unexpected<'_>) -> Result<T, Option<String>>,
    /// Largest number of elements that are read.
    pub most: usize,
    pub list: fn(Vec<E>) -> Option<T>,
}

impl<T, E> Judged<T, E> {
    fn take<Error: de::Error>(self, found: Unexpected<'_>) -> Result<T, Error> {
        (self.judge)(found).map_err(|words| match words {
            Some(words) => Error::invalid_value(found, &words.as_str()),
            None => Error::invalid_value(found, &self.expecting),
        })
    }
}

impl<'de, T, E: Deserialize<'de>> Visitor<'de> for Judged<T, E> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expecting)
    }

    fn visit_i64<Error: de::Error>(self, value: i64) -> Result<T, Error> {
        self.take(Unexpected::Signed(value))
    }

    fn visit_u64<Error: de::Error>(self, value: u64) -> Result<T, Error> {
        self.take(Unexpected::Unsigned(value))
    }

    fn visit_f64<Error: de::Error>(self, value: f64) -> Result<T, Error> {
        self.take(Unexpected::Float(value))
    }

    fn visit_str<Error: de::Error>(self, text: &str) -> Result<T, Error> {
        self.take(Unexpected::Str(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<T, A::Error> {
        let Judged {
            expecting,
            most,
            list,
            ..
        } = self;
        let mut read = Vec::new();
        while read.len() < most
            && let Some(element) = from.next_element()?
        {
            read.push(element);
        }
        let count = read.len();
        list(read).ok_or_else(|| match most {
            0 => de::Error::invalid_type(Unexpected::Seq, &expecting),
            _ => de::Error::invalid_length(count, &expecting),
        })
    }
}

/// A number of TOML as a double.
pub(super) const fn as_number(found: Unexpected<'_>) -> Option<f64> {
    match found {
        Unexpected::Signed(value) => Some(value as f64),
        Unexpected::Unsigned(value) => Some(value as f64),
        Unexpected::Float(value) => Some(value),
        _ => None,
    }
}

/// The allowed numbers, for a number with too many digits.
fn exact(found: Unexpected<'_>) -> String {
    /// A fraction is proposed where the number is as near to it as its own digits can tell.
    const NEAR: f64 = 1e-6;
    let example = match found {
        Unexpected::Float(value) if (1e-12..1.0).contains(&value) => {
            let below = value.recip().round();
            (((value * below) - 1.0).abs() < NEAR).then(|| format!("1/{below}"))
        }
        _ => None,
    };
    let example = example.unwrap_or_else(|| "1/1024".to_owned());
    format!("a number with at most 12 digits, or a fraction in quotes, such as \"{example}\"")
}

/// A positive number kept exactly: an integer, a decimal or a fraction "a/b".
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RateValue(pub Ratio);

impl<'de> Deserialize<'de> for RateValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let judge = |found: Unexpected<'_>| {
            let read = match found {
                Unexpected::Signed(value) => u64::try_from(value)
                    .map_err(|_| RateError::NotPositive)
                    .and_then(|value| Ratio::new(value, 1)),
                Unexpected::Unsigned(value) => Ratio::new(value, 1),
                Unexpected::Float(value) => Ratio::from_decimal(value),
                Unexpected::Str(text) => Ratio::parse(text),
                _ => Err(RateError::NotANumber),
            };
            read.map(Self).map_err(|error| match error {
                RateError::TooFine => Some(exact(found)),
                RateError::NotPositive | RateError::NotANumber => None,
            })
        };
        deserializer.deserialize_any(Judged::<Self, IgnoredAny> {
            expecting: "a finite number greater than zero, or a fraction \"a/b\"",
            judge,
            most: 0,
            list: |_| None,
        })
    }
}

impl Serialize for RateValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (numerator, denominator) = self.0.terms();
        let value = self.0.value();
        if denominator == 1 {
            serializer.serialize_u64(numerator)
        } else if Ratio::from_decimal(value) == Ok(self.0) {
            serializer.serialize_f64(value)
        } else {
            serializer.collect_str(&self.0)
        }
    }
}

impl JsonSchema for RateValue {
    fn schema_name() -> Cow<'static, str> {
        "RateValue".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Exact number greater than zero, or a fraction \"a/b\".",
            "oneOf": [
                { "type": "number", "exclusiveMinimum": 0 },
                { "type": "string", "pattern": "^\\s*[0-9]+\\s*/\\s*[0-9]+\\s*$" },
            ],
        })
    }
}

/// λ of the Gui family, as asked for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LambdaValue {
    /// The largest λ that is proven stable with the gain bound, at most 11.5.
    #[default]
    Auto,
    /// This number, finite and greater than zero.
    Number(f64),
    /// λ = ∞: the displacements of explicit Newmark.
    Infinite,
}

impl<'de> Deserialize<'de> for LambdaValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Judged::<Self, IgnoredAny> {
            expecting: "a number greater than zero, `inf` or \"auto\"",
            judge: |found| match (found, as_number(found)) {
                (Unexpected::Str("auto"), _) => Ok(Self::Auto),
                (Unexpected::Str("inf"), _) | (_, Some(f64::INFINITY)) => Ok(Self::Infinite),
                (_, Some(value)) if value > 0.0 => Ok(Self::Number(value)),
                _ => Err(None),
            },
            most: 0,
            list: |_| None,
        })
    }
}

impl Serialize for LambdaValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Number(value) => serializer.serialize_f64(value),
            // Only TOML is written, and TOML has this number.
            Self::Infinite => serializer.serialize_f64(f64::INFINITY),
        }
    }
}

impl JsonSchema for LambdaValue {
    fn schema_name() -> Cow<'static, str> {
        "LambdaValue".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Number greater than zero, `inf` (with or without quotes) or \"auto\".",
            "oneOf": [
                { "type": "number", "exclusiveMinimum": 0 },
                { "enum": ["auto", "inf"] },
            ],
        })
    }
}

/// A square matrix given by rows; a single axis may write its one number bare.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum MatrixValue {
    /// One axis.
    Number(f64),
    /// One row per axis.
    Rows(Vec<Vec<f64>>),
}

impl MatrixValue {
    /// The matrix by rows.
    #[must_use]
    pub fn rows(&self) -> Vec<Vec<f64>> {
        match self {
            Self::Number(value) => vec![vec![*value]],
            Self::Rows(rows) => rows.clone(),
        }
    }
}

impl<'de> Deserialize<'de> for MatrixValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Judged {
            expecting: "a number, or a matrix by rows `[[..], [..]]`",
            judge: |found| as_number(found).map(Self::Number).ok_or(None),
            most: usize::MAX,
            list: |rows| Some(Self::Rows(rows)),
        })
    }
}

impl JsonSchema for MatrixValue {
    fn schema_name() -> Cow<'static, str> {
        "MatrixValue".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "Number for one axis, or square matrix by rows.",
            "oneOf": [
                { "type": "number" },
                { "type": "array", "items": { "type": "array", "items": { "type": "number" } } },
            ],
        })
    }
}

/// Which degrees of freedom, counted from 1 as in the exports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DofChoice {
    /// All of them.
    All,
    /// These.
    Listed(Vec<usize>),
}

impl<'de> Deserialize<'de> for DofChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Judged {
            expecting: "\"all\" or an array of DOF numbers from 1",
            judge: |found| match found {
                Unexpected::Str("all") => Ok(Self::All),
                _ => Err(None),
            },
            most: usize::MAX,
            list: |dofs| Some(Self::Listed(dofs)),
        })
    }
}

impl Serialize for DofChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::All => serializer.serialize_str("all"),
            Self::Listed(numbers) => numbers.serialize(serializer),
        }
    }
}

impl JsonSchema for DofChoice {
    fn schema_name() -> Cow<'static, str> {
        "DofChoice".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "\"all\", or a list of DOF numbers from 1.",
            "oneOf": [
                { "const": "all" },
                { "type": "array", "items": { "type": "integer", "minimum": 1 } },
            ],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct One<T> {
        v: T,
    }

    fn read<T: de::DeserializeOwned>(text: &str) -> Result<T, String> {
        toml::from_str::<One<T>>(&format!("v = {text}"))
            .map(|o| o.v)
            .map_err(|e| e.message().to_owned())
    }

    fn written<T: Serialize>(v: T) -> String {
        toml::to_string(&One { v }).unwrap()
    }

    #[test]
    fn rate_is_exact_in_every_spelling() {
        let terms = |text| read::<RateValue>(text).unwrap().0.terms();
        assert_eq!(terms("1024"), (1024, 1));
        assert_eq!(terms("0.01"), (1, 100));
        assert_eq!(terms("\"4096/3\""), (4096, 3));
        for text in [
            "0", "-1", "0.0", "-0.01", "nan", "inf", "\"fast\"", "\"1/0\"", "true",
        ] {
            let message = read::<RateValue>(text).unwrap_err();
            assert!(message.contains("greater than"), "{text}: {message}");
        }
        assert!(
            read::<RateValue>("1e-300")
                .unwrap_err()
                .contains("12 digits")
        );
    }

    #[test]
    fn lambda_is_a_number_or_auto_or_infinity() {
        assert_eq!(read("4"), Ok(LambdaValue::Number(4.0)));
        assert_eq!(read("inf"), Ok(LambdaValue::Infinite));
        assert_eq!(read("\"inf\""), Ok(LambdaValue::Infinite));
        assert_eq!(read("\"auto\""), Ok(LambdaValue::Auto));
        for text in ["0", "-4", "nan", "-inf", "-0.5", "\"automatic\""] {
            let message = read::<LambdaValue>(text).unwrap_err();
            assert!(message.contains("`inf`"), "{text}: {message}");
        }
        assert_eq!(written(LambdaValue::Infinite), "v = inf\n");
    }

    #[test]
    fn matrix_accepts_a_number_choice_all() {
        assert_eq!(read("3"), Ok(MatrixValue::Number(3.0)));
        assert_eq!(
            read("[[1, 2.5]]"),
            Ok(MatrixValue::Rows(vec![vec![1.0, 2.5]]))
        );
        assert_eq!(read("\"all\""), Ok(DofChoice::All));
        assert_eq!(read("[1, 3]"), Ok(DofChoice::Listed(vec![1, 3])));
        assert!(
            read::<DofChoice>("\"some\"")
                .unwrap_err()
                .contains("\"all\"")
        );
    }

    proptest! {
        #[test]
        fn a_rate_written_reads_back_as_itself(n in 1u64..1_000_000, d in 1u64..1_000_000) {
            let rate = RateValue(Ratio::new(n, d).unwrap());
            let text = written(rate);
            prop_assert_eq!(toml::from_str::<One<RateValue>>(&text).unwrap().v, rate);
        }

        #[test]
        fn written_lambda_reads_back_exactly(value in 1e-300f64..1e300) {
            let text = written(LambdaValue::Number(value));
            prop_assert_eq!(toml::from_str::<One<LambdaValue>>(&text).unwrap().v, LambdaValue::Number(value));
        }
    }
}
