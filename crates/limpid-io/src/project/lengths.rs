//! Lengths of the arrays in a scene file, by the types that its tables declare.
//!
//! TOML's deserializer reads the first numbers of an array that is too long, as one with decimal commas is. This one
//! visits the same types and counts.

use serde::de::value::{Error, MapAccessDeserializer, MapDeserializer, SeqDeserializer};
use serde::de::{Deserialize, Deserializer, Error as _, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;
use toml::Value;

/// Fails if an array of `table` has more numbers than `T`, as which the table is known to be valid, declares.
///
/// # Errors
/// The problem, naming the key.
pub(super) fn check<'de, T: Deserialize<'de>>(table: &'de toml::Table) -> Result<(), String> {
    T::deserialize(MapAccessDeserializer::new(entries(table, "")))
        .map(drop)
        .map_err(|error: Error| error.to_string())
}

/// The values of a table with this key.
fn entries<'de>(
    table: &'de toml::Table,
    key: &str,
) -> MapDeserializer<'de, impl Iterator<Item = (&'de str, Item<'de>)>, Error> {
    let prefix = if key.is_empty() { String::new() } else { format!("{key}.") };
    let item = move |(name, value): (&'de String, &'de Value)| {
        (name.as_str(), Item { key: format!("{prefix}{name}"), value })
    };
    MapDeserializer::new(table.iter().map(item))
}

/// A value of a table, and its key: the names of the tables around it and its own, with points between them.
struct Item<'de> {
    key: String,
    value: &'de Value,
}

impl Item<'_> {
    /// Fails if it is an array of more than `length` numbers.
    fn check(&self, length: usize) -> Result<(), Error> {
        let Some(values) = self.value.as_array().filter(|values| values.len() > length) else {
            return Ok(());
        };
        if !values.iter().all(|value| value.is_integer() || value.is_float()) {
            return Ok(());
        }
        let (key, count) = (&self.key, values.len());
        Err(Error::custom(format!(
            "{key} has {count} numbers, expected {length}; decimals have points, not commas"
        )))
    }
}

impl<'de> IntoDeserializer<'de> for Item<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Item<'de> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        let key = self.key;
        match self.value {
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Integer(number) => visitor.visit_i64(*number),
            Value::Float(number) => visitor.visit_f64(*number),
            Value::Boolean(is) => visitor.visit_bool(*is),
            Value::Datetime(time) => visitor.visit_string(time.to_string()),
            Value::Array(values) => {
                let items = values.iter().map(|value| Item { key: key.clone(), value });
                visitor.visit_seq(SeqDeserializer::new(items))
            }
            Value::Table(table) => visitor.visit_map(entries(table, &key)),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.check(length)?;
        self.deserialize_any(visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.deserialize_tuple(length, visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self.value {
            Value::Table(table) => {
                visitor.visit_enum(MapAccessDeserializer::new(entries(table, &self.key)))
            }
            word => visitor.visit_enum(word.as_str().unwrap_or_default().into_deserializer()),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct seq map
        struct identifier ignored_any
    }
}
