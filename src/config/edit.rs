//! Puts one value at a dotted path of a TOML document, keeping its comments and order.
//!
//! Missing parts of the path are created: tables, and array elements just behind the end. A path that leads through
//! something else is refused with the number of remaining segments.

use std::ops::Range;

use toml_edit::{Array, ArrayOfTables, Item, Table, TableLike, Value};

use super::document::Segment;

/// Number of remaining segments when the path could not be followed, and why not.
pub(crate) type Refusal = (usize, String);
/// Remaining segments of a path.
pub(crate) type Rest<'a> = &'a [(Segment, Range<usize>)];

/// Puts `value` at `key` and then `rest` of `table`.
pub(crate) fn put_in_table(
    table: &mut dyn TableLike,
    key: &str,
    rest: Rest<'_>,
    value: &Value,
) -> Result<(), Refusal> {
    if let Some(item) = table.get_mut(key) {
        return put_in_item(item, key, rest, value);
    }
    let item = nest(rest, value)?;
    table.insert(key, item);
    Ok(())
}

fn put_in_item(item: &mut Item, name: &str, rest: Rest<'_>, value: &Value) -> Result<(), Refusal> {
    let Some(((segment, _), deeper)) = rest.split_first() else {
        match item {
            Item::Value(old) => replace(old, value),
            other => *other = Item::Value(value.clone()),
        }
        return Ok(());
    };
    let found = with_article(item.type_name());
    match (segment, item) {
        (Segment::Key(key), item) if item.is_table_like() => match item.as_table_like_mut() {
            Some(table) => put_in_table(table, key, deeper, value),
            None => Ok(()),
        },
        (Segment::Index(index), Item::ArrayOfTables(tables)) => {
            put_in_tables(tables, name, *index, deeper, value)
        }
        (Segment::Index(index), Item::Value(Value::Array(array))) => {
            put_in_array(array, name, *index, deeper, value)
        }
        (Segment::Key(key), _) => Err((
            rest.len(),
            format!("`{name}` is {found}; it has no key `{key}`"),
        )),
        (Segment::Index(index), _) => Err((
            rest.len(),
            format!("`{name}` is {found}; it has no element {index}"),
        )),
    }
}

fn put_in_tables(
    tables: &mut ArrayOfTables,
    name: &str,
    index: usize,
    rest: Rest<'_>,
    value: &Value,
) -> Result<(), Refusal> {
    let length = tables.len();
    match rest.split_first() {
        Some(((Segment::Key(key), _), deeper)) => {
            if index == length {
                tables.push(Table::new());
            }
            match tables.get_mut(index) {
                Some(table) => put_in_table(table, key, deeper, value),
                None => Err(beyond(name, index, length, rest)),
            }
        }
        Some(((Segment::Index(inner), _), _)) => Err((
            rest.len(),
            format!("`{name}[{index}]` is a table; it has no element {inner}"),
        )),
        None => {
            let Value::InlineTable(table) = value else {
                return Err((
                    1,
                    format!("`{name}[{index}]` is a table, which a single value cannot replace"),
                ));
            };
            let table = table.clone().into_table();
            if index == length {
                tables.push(table);
            } else if index < length {
                tables.replace(index, table);
            } else {
                return Err(beyond(name, index, length, rest));
            }
            Ok(())
        }
    }
}

fn put_in_array(
    array: &mut Array,
    name: &str,
    index: usize,
    rest: Rest<'_>,
    value: &Value,
) -> Result<(), Refusal> {
    let length = array.len();
    if index == length {
        let item = nest(rest, value)?;
        if let Ok(new) = item.into_value() {
            array.push(new);
        }
        return Ok(());
    }
    let name = format!("{name}[{index}]");
    match array.get_mut(index) {
        None => Err(beyond(&name, index, length, rest)),
        Some(old) => match (rest.split_first(), old) {
            (None, old) => {
                replace(old, value);
                Ok(())
            }
            (Some(((Segment::Key(key), _), deeper)), Value::InlineTable(table)) => {
                put_in_table(table, key, deeper, value)
            }
            (Some(((Segment::Index(inner), _), deeper)), Value::Array(inside)) => {
                put_in_array(inside, &name, *inner, deeper, value)
            }
            (Some(_), other) => Err((
                rest.len(),
                format!(
                    "`{name}` is {}; the key cannot go deeper",
                    with_article(other.type_name())
                ),
            )),
        },
    }
}

/// Replaces a value, keeping the comment behind it.
fn replace(old: &mut Value, value: &Value) {
    let decor = old.decor().clone();
    *old = value.clone();
    *old.decor_mut() = decor;
}

fn with_article(kind: &str) -> String {
    let article = if kind.starts_with(['a', 'e', 'i', 'o', 'u']) {
        "an"
    } else {
        "a"
    };
    format!("{article} {kind}")
}

fn beyond(name: &str, index: usize, length: usize, rest: Rest<'_>) -> Refusal {
    let name = name.split('[').next().unwrap_or(name);
    (
        rest.len() + 1,
        format!("`{name}` has {length} elements; {index} is beyond the end (indices count from 0)"),
    )
}

/// The tables that a path through nothing has to create.
fn nest(rest: Rest<'_>, value: &Value) -> Result<Item, Refusal> {
    let Some(((segment, _), deeper)) = rest.split_first() else {
        return Ok(Item::Value(value.clone()));
    };
    match segment {
        Segment::Key(key) => {
            let mut table = Table::new();
            // A table that only holds tables needs no header.
            table.set_implicit(!deeper.is_empty());
            table.insert(key, nest(deeper, value)?);
            Ok(Item::Table(table))
        }
        Segment::Index(0) => match nest(deeper, value)? {
            Item::Table(mut table) => {
                table.set_implicit(false);
                let mut tables = ArrayOfTables::new();
                tables.push(table);
                Ok(Item::ArrayOfTables(tables))
            }
            Item::Value(value) => Ok(Item::Value(Value::Array(Array::from_iter([value])))),
            other => Ok(other),
        },
        Segment::Index(index) => Err((
            rest.len(),
            format!("there is no array here yet; its first element is 0, not {index}"),
        )),
    }
}
