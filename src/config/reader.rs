//! The tree of a test file as a serde deserializer that knows its path.
//!
//! It visits entries in the order of the file, omits those that it must skip, and never reads a table from an array,
//! which serde would allow. An error carries its kind as data and the innermost path that it concerns.

use serde::de::value::StrDeserializer;
use serde::de::{
    self, DeserializeSeed, Deserializer, EnumAccess, Expected, IntoDeserializer, MapAccess,
    SeqAccess, Unexpected, VariantAccess, Visitor,
};

use super::document::{Datum, KeyPath, Node};
use super::mistake::Kind;
use super::suggest::listed;
use super::words::{SPLIT_NUMBERS, found_in_words, number_in_quotes, wanted_in_words};

/// An error of the reading.
#[derive(Debug)]
pub(crate) struct Fault {
    /// Kind of the error.
    pub kind: Kind,
    /// Where.
    pub path: Option<KeyPath>,
    /// The path is the name of a variant, which its table cannot do without.
    pub at_variant: bool,
}

/// Boxed: it travels through every level of the tree.
#[derive(Debug)]
pub(crate) struct ReadError(pub Box<Fault>);

impl ReadError {
    fn new(kind: Kind) -> Self {
        Self(Box::new(Fault {
            kind,
            path: None,
            at_variant: false,
        }))
    }

    /// The innermost level that can name a place does so.
    fn at(mut self, path: &KeyPath) -> Self {
        self.0.path.get_or_insert_with(|| path.clone());
        self
    }

    fn at_variant(mut self) -> Self {
        self.0.at_variant = true;
        self
    }
}

impl std::fmt::Display for ReadError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.0.kind)
    }
}

impl std::error::Error for ReadError {}

impl de::Error for ReadError {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Self::new(Kind::Other(message.to_string()))
    }

    fn invalid_type(found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::new(Kind::WrongType {
            found: found_in_words(found),
            wanted: wanted_in_words(Some(found), wanted),
            hint: number_in_quotes(found, wanted),
        })
    }

    fn invalid_value(found: Unexpected<'_>, wanted: &dyn Expected) -> Self {
        Self::new(Kind::WrongValue {
            found: found_in_words(found),
            wanted: wanted_in_words(Some(found), wanted),
            hint: number_in_quotes(found, wanted),
        })
    }

    fn invalid_length(length: usize, wanted: &dyn Expected) -> Self {
        Self::new(Kind::WrongValue {
            found: format!("an array of {length}"),
            wanted: wanted_in_words(None, wanted),
            hint: None,
        })
    }

    fn unknown_variant(found: &str, allowed: &'static [&'static str]) -> Self {
        Self::new(Kind::UnknownName {
            found: found.to_owned(),
            allowed: allowed.to_vec(),
        })
    }

    fn unknown_field(_: &str, allowed: &'static [&'static str]) -> Self {
        Self::new(Kind::UnknownKey {
            allowed: allowed.to_vec(),
        })
    }

    fn missing_field(key: &'static str) -> Self {
        Self::new(Kind::MissingKey { key })
    }
}

/// Reads one node.
pub(crate) struct Reader<'a> {
    /// The node.
    pub node: &'a Node,
    /// Its path.
    pub path: KeyPath,
    /// Paths to leave out.
    pub skip: &'a [KeyPath],
}

impl<'de> Reader<'de> {
    fn visit<V: Visitor<'de>>(&self, visitor: V) -> Result<V::Value, ReadError> {
        match &self.node.datum {
            Datum::Text(text) => visitor.visit_str(text),
            Datum::Integer(value) => visitor.visit_i64(*value),
            Datum::Float(value) => visitor.visit_f64(*value),
            Datum::Boolean(value) => visitor.visit_bool(*value),
            Datum::TooLarge(text) => {
                Err(de::Error::invalid_value(Unexpected::Other(text), &visitor))
            }
            Datum::Date(text) => {
                let words = format!("the date {text}");
                Err(de::Error::invalid_type(Unexpected::Other(&words), &visitor))
            }
            Datum::Array(elements) => {
                let mut left = Elements {
                    elements,
                    next: 0,
                    parent: self,
                };
                let value = visitor.visit_seq(&mut left)?;
                if left.next < elements.len() {
                    let (found, wanted) = (elements.len(), left.next);
                    return Err(ReadError::new(Kind::WrongValue {
                        found: format!("an array of {found}"),
                        wanted: format!("an array of {wanted}"),
                        hint: (found == 2 * wanted).then(|| SPLIT_NUMBERS.to_owned()),
                    }));
                }
                Ok(value)
            }
            Datum::Table(entries) => visitor.visit_map(Entries {
                entries: entries.iter(),
                value: None,
                parent: self,
            }),
        }
    }

    fn visit_variant<V: Visitor<'de>>(
        &self,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        match &self.node.datum {
            Datum::Text(name) => visitor.visit_enum(Variant {
                name,
                name_path: None,
                content: None,
            }),
            Datum::Table(entries) => {
                let [(name, node)] = entries.as_slice() else {
                    return Err(ReadError::new(Kind::NotExactlyOne {
                        found: entries.iter().map(|(k, _)| k.clone()).collect(),
                        allowed: names.to_vec(),
                    }));
                };
                let path = self.path.key(name);
                if self.skip.contains(&path) {
                    return Err(ReadError::new(Kind::Consequence));
                }
                visitor.visit_enum(Variant {
                    name,
                    name_path: Some(path.clone()),
                    content: Some(Reader {
                        node,
                        path,
                        skip: self.skip,
                    }),
                })
            }
            // It is refused; serde does not list the names.
            _ => self.visit(visitor).map_err(|mut error| {
                if let Kind::WrongType { wanted, .. } = &mut error.0.kind {
                    let one = names.first().copied().unwrap_or("name");
                    let names = listed(names, "or");
                    *wanted = format!("{names}; where it has parameters, `{{ {one} = ... }}`");
                }
                error
            }),
        }
    }
}

impl<'de> Deserializer<'de> for Reader<'de> {
    type Error = ReadError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        self.visit(visitor).map_err(|e| e.at(&self.path))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        if matches!(self.node.datum, Datum::Array(_)) {
            let error: ReadError = de::Error::invalid_type(Unexpected::Seq, &visitor);
            return Err(error.at(&self.path));
        }
        self.deserialize_any(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        self.visit_variant(names, visitor)
            .map_err(|e| e.at(&self.path))
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        visitor.visit_unit()
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf
        unit unit_struct seq tuple tuple_struct map identifier
    }
}

struct Elements<'r, 'de> {
    elements: &'de [Node],
    next: usize,
    parent: &'r Reader<'de>,
}

impl<'de> SeqAccess<'de> for &mut Elements<'_, 'de> {
    type Error = ReadError;

    fn next_element_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, ReadError> {
        while let Some(node) = self.elements.get(self.next) {
            let path = self.parent.path.index(self.next);
            self.next += 1;
            if self.parent.skip.contains(&path) {
                continue;
            }
            return seed
                .deserialize(Reader {
                    node,
                    path,
                    skip: self.parent.skip,
                })
                .map(Some);
        }
        Ok(None)
    }
}

struct Entries<'r, 'de> {
    entries: std::slice::Iter<'de, (String, Node)>,
    value: Option<Reader<'de>>,
    parent: &'r Reader<'de>,
}

impl<'de> MapAccess<'de> for Entries<'_, 'de> {
    type Error = ReadError;

    fn next_key_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, ReadError> {
        for (key, node) in self.entries.by_ref() {
            let path = self.parent.path.key(key);
            if self.parent.skip.contains(&path) {
                continue;
            }
            let name: StrDeserializer<'_, ReadError> = key.as_str().into_deserializer();
            let found = seed.deserialize(name).map_err(|e| e.at(&path))?;
            self.value = Some(Reader {
                node,
                path,
                skip: self.parent.skip,
            });
            return Ok(Some(found));
        }
        Ok(None)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, ReadError> {
        match self.value.take() {
            Some(reader) => seed.deserialize(reader),
            None => Err(de::Error::custom("a value was asked for before its key")),
        }
    }
}

struct Variant<'de> {
    name: &'de str,
    name_path: Option<KeyPath>,
    content: Option<Reader<'de>>,
}

impl<'de> Variant<'de> {
    fn content(self) -> Result<Reader<'de>, ReadError> {
        let name = self.name;
        self.content.ok_or_else(|| {
            ReadError::new(Kind::WrongType {
                found: format!("only the name {name:?}"),
                wanted: format!("a table with its parameters, `{{ {name} = ... }}`"),
                hint: None,
            })
        })
    }
}

impl<'de> EnumAccess<'de> for Variant<'de> {
    type Error = ReadError;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self), ReadError> {
        let name: StrDeserializer<'_, ReadError> = self.name.into_deserializer();
        let found = seed.deserialize(name).map_err(|e| match &self.name_path {
            Some(path) => e.at(path).at_variant(),
            None => e,
        })?;
        Ok((found, self))
    }
}

impl<'de> VariantAccess<'de> for Variant<'de> {
    type Error = ReadError;

    fn unit_variant(self) -> Result<(), ReadError> {
        match self.content {
            Some(reader) if !matches!(&reader.node.datum, Datum::Table(entries) if entries.is_empty()) => {
                Err(ReadError::new(Kind::WrongType {
                    found: "parameters".to_owned(),
                    wanted: format!("the name alone, {:?}", self.name),
                    hint: None,
                })
                .at(&reader.path))
            }
            _ => Ok(()),
        }
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, ReadError> {
        seed.deserialize(self.content()?)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, ReadError> {
        self.content()?.deserialize_any(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        self.content()?.deserialize_struct("", fields, visitor)
    }
}
