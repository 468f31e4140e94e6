//! One variant of an enum as a field of the table around it.
//!
//! `[structure]` has a kind (`shear_building`, `matrices`, `chain`) beside keys that every kind shares. serde's
//! `flatten` would lose the places of mistakes, so each kind is an optional field that reads and writes the one variant
//! of its name; [`super::check`] ensures that exactly one is given.

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::value::StrDeserializer;
use serde::de::{self, DeserializeSeed, EnumAccess, IntoDeserializer, VariantAccess, Visitor};
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Reads the content of variant `name` of `T`.
pub(crate) fn read<'de, T, D>(name: &'static str, content: D) -> Result<Option<T>, D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    T::deserialize(Tagged { name, content }).map(Some)
}

/// Writes the content of a variant without its name.
pub(crate) fn write<T: Serialize, S: Serializer>(
    value: &Option<T>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let Some(value) = value else {
        return serializer.serialize_none();
    };
    match toml::Value::try_from(value) {
        Ok(toml::Value::Table(table)) if table.len() == 1 => match table.into_iter().next() {
            Some((_, content)) => content.serialize(serializer),
            None => Err(S::Error::custom("a variant without content")),
        },
        Ok(_) => Err(S::Error::custom("not a variant with content")),
        Err(error) => Err(S::Error::custom(error)),
    }
}

/// The schema of the content of variant `name` of `T`.
pub(crate) fn schema<T: JsonSchema>(name: &str, generator: &mut SchemaGenerator) -> Schema {
    let whole = T::json_schema(generator);
    let variants = ["oneOf", "anyOf"]
        .iter()
        .find_map(|key| whole.get(*key).and_then(serde_json::Value::as_array));
    let content = variants.into_iter().flatten().find_map(|variant| {
        let mut content = variant.get("properties")?.get(name)?.clone();
        let described = variant.get("description").cloned();
        if let (Some(content), Some(text)) = (content.as_object_mut(), described) {
            content.entry("description").or_insert(text);
        }
        Some(content)
    });
    content
        .and_then(|value| Schema::try_from(value).ok())
        .unwrap_or_default()
}

struct Tagged<D> {
    name: &'static str,
    content: D,
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Tagged<D> {
    type Error = D::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, D::Error> {
        visitor.visit_enum(self)
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option
        unit unit_struct newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

impl<'de, D: Deserializer<'de>> EnumAccess<'de> for Tagged<D> {
    type Error = D::Error;
    type Variant = Content<D>;

    fn variant_seed<S: DeserializeSeed<'de>>(
        self,
        seed: S,
    ) -> Result<(S::Value, Content<D>), D::Error> {
        let name: StrDeserializer<'_, D::Error> = self.name.into_deserializer();
        Ok((seed.deserialize(name)?, Content(self.content)))
    }
}

struct Content<D>(D);

impl<'de, D: Deserializer<'de>> VariantAccess<'de> for Content<D> {
    type Error = D::Error;

    fn unit_variant(self) -> Result<(), D::Error> {
        Err(de::Error::custom("this name takes no parameters"))
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, D::Error> {
        seed.deserialize(self.0)
    }

    fn tuple_variant<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_tuple(length, visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_struct("", fields, visitor)
    }
}
