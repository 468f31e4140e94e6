//! Fields of a file of any version: a value that does not fit its type counts as absent.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};
use serde_json::Value;

/// The field, or its default where it cannot be read.
///
/// # Errors
/// The file itself is broken.
pub(super) fn field<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: DeserializeOwned + Default,
{
    let value = Value::deserialize(deserializer)?;
    Ok(T::deserialize(value).unwrap_or_default())
}

/// The entries of a collection that can be read.
///
/// # Errors
/// The file itself is broken.
pub(super) fn entries<'de, D, C, K, T>(deserializer: D) -> Result<C, D::Error>
where
    D: Deserializer<'de>,
    C: FromIterator<(K, T)>,
    K: From<String>,
    T: DeserializeOwned,
{
    let value = Value::deserialize(deserializer)?;
    let entries = match value {
        Value::Object(map) => map.into_iter().collect(),
        _ => Vec::new(),
    };
    let read = |(key, value): (String, Value)| Some((K::from(key), T::deserialize(value).ok()?));
    Ok(entries.into_iter().filter_map(read).collect())
}

/// The items of a list that can be read.
///
/// # Errors
/// The file itself is broken.
pub(super) fn items<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: DeserializeOwned,
{
    let value = Value::deserialize(deserializer)?;
    let list = match value {
        Value::Array(list) => list,
        _ => Vec::new(),
    };
    let read = list
        .into_iter()
        .filter_map(|item| T::deserialize(item).ok());
    Ok(read.collect())
}
