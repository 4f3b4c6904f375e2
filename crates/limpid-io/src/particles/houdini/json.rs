//! JSON as Houdini writes it: text, or SideFX's binary tokens (`UT_JSONDefines.h` of the Houdini Development
//! Kit). A binary file begins with 0x7f and a magic number whose order tells the byte order of all numbers:
//!
//! ```text
//! value: one byte, then what belongs to it
//!   '[' values ']'    '{' names and values '}'    0x00 null    '0' false    '1' true
//!   0x10 bool    0x11 to 0x14 i8 to i64    0x18 to 0x1a f16 to f64    0x21, 0x22 u8, u16
//!   0x27 string: length, bytes              '@' uniform array: type, length, numbers
//!   '+' define a string: number, length, bytes    '-' forget it    '&' the string of that number
//! length, number: a byte below 0xf1, or 0xf2, 0xf4 or 0xf8 and 2, 4 or 8 bytes
//! ```
//!
//! Uniform arrays of booleans are bits, the lowest first, in words of 32.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};

use super::super::cursor::{Cursor, FileBytes};
use super::super::table::Scalar;
use crate::budget::Budget;
use crate::error::{Error, Location, Result};

/// A value of a document.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Null,
    Bool(bool),
    Number(f64),
    Text(Cow<'a, [u8]>),
    Numbers(Numbers<'a>),
    Flags(Vec<bool>),
    List(Vec<Self>),
    /// Names and values in turn.
    Map(Vec<Self>),
}

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers<'a> {
    pub(super) bytes: Cow<'a, [u8]>,
    pub(super) scalar: Scalar,
    pub(super) big_endian: bool,
    /// Where they begin in a binary file.
    pub(super) start: usize,
}

impl Numbers<'_> {
    pub(super) fn len(&self) -> usize {
        self.bytes.len() / self.scalar.size()
    }

    /// A number; 0 beyond the last.
    pub(super) fn number(&self, i: usize) -> f64 {
        let bytes = self.bytes.get(i * self.scalar.size()..).unwrap_or_default();
        self.scalar.number(bytes, self.big_endian)
    }

    pub(super) fn of_floats(numbers: impl Iterator<Item = f64>) -> Self {
        let bytes = numbers.flat_map(f64::to_le_bytes).collect();
        Self { bytes: Cow::Owned(bytes), scalar: Scalar::F64, big_endian: false, start: 0 }
    }
}

impl Value<'_> {
    /// The value of a name. Houdini writes objects as lists of names and values in turn, to keep their order.
    pub(super) fn get(&self, name: &str) -> Option<&Self> {
        let (Self::List(items) | Self::Map(items)) = self else { return None };
        let mut pairs = items.as_chunks::<2>().0.iter();
        pairs.find(|[key, _]| key.is_text(name)).map(|[_, value]| value)
    }

    pub(super) fn is_text(&self, text: &str) -> bool {
        matches!(self, Self::Text(found) if **found == *text.as_bytes())
    }

    pub(super) fn text(&self) -> Option<Cow<'_, str>> {
        let Self::Text(text) = self else { return None };
        Some(String::from_utf8_lossy(text))
    }

    /// A count.
    pub(super) fn count(&self) -> Option<usize> {
        let Self::Number(number) = self else { return None };
        (number.fract() == 0.0 && (0.0..=4e15).contains(number)).then_some(*number as usize)
    }

    /// The values of a list; of all else none.
    pub(super) fn list(&self) -> &[Self] {
        if let Self::List(items) = self { items } else { &[] }
    }

    /// The numbers of an array, which may be a list of them; of all else none.
    pub(super) fn numbers(&self) -> Cow<'_, Numbers<'_>> {
        let number = |value: &Self| if let Self::Number(number) = value { *number } else { 0.0 };
        match self {
            Self::Numbers(numbers) => Cow::Borrowed(numbers),
            Self::List(items) if items.iter().all(|item| matches!(item, Self::Number(_))) => {
                Cow::Owned(Numbers::of_floats(items.iter().map(number)))
            }
            _ => Cow::Owned(Numbers::of_floats(std::iter::empty())),
        }
    }

    /// The booleans of an array, which may be a list of them; of all else none.
    pub(super) fn flags(&self) -> Vec<bool> {
        match self {
            Self::Flags(flags) => flags.clone(),
            Self::List(items) => items.iter().map(|item| *item == Self::Bool(true)).collect(),
            _ => Vec::new(),
        }
    }
}

/// Whether a file begins as one of these documents.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x7fNSJb") || bytes.starts_with(b"\x7fbJSN")
}

/// Parses a document; its values, many times larger than their tokens, take their memory of the budget.
pub(super) fn parse<'a>(source: FileBytes<'a>, budget: &Budget) -> Result<Value<'a>> {
    if !is_binary(source.bytes) {
        return parse_text(source, budget);
    }
    let mut file = Cursor::new(source.path, source.bytes, false);
    let big_endian = file.take(5, "the magic")? == b"\x7fbJSN";
    let mut parser = Parser { file, big_endian, strings: HashMap::new(), budget };
    let token = parser.token()?;
    parser.value(token, 0)
}

fn parse_text(source: FileBytes<'_>, budget: &Budget) -> Result<Value<'static>> {
    let exceeded = Cell::new(false);
    let mut text = serde_json::Deserializer::from_slice(source.bytes);
    let value = Text { budget, exceeded: &exceeded }.deserialize(&mut text);
    value.and_then(|value| text.end().map(|()| value)).map_err(|error| {
        let line = Location::Line(error.line() as u64);
        match exceeded.get() {
            true => budget.exceeded(source.path, line),
            false => Error::malformed(source.path, line, format!("not JSON: {error}")),
        }
    })
}

/// Memory of a value, bytes.
const VALUE: u64 = size_of::<Value<'_>>() as u64;

struct Parser<'a, 'b> {
    file: Cursor<'a>,
    big_endian: bool,
    strings: HashMap<u64, &'a [u8]>,
    budget: &'b Budget,
}

impl<'a> Parser<'a, '_> {
    /// The next token that belongs to a value.
    fn token(&mut self) -> Result<u8> {
        loop {
            let [token] = self.file.array("a token")?;
            match token {
                b'+' => {
                    self.count(VALUE)?;
                    let number = self.length()?;
                    let string = self.string()?;
                    self.strings.insert(number, string);
                }
                b'-' => {
                    let number = self.length()?;
                    self.strings.remove(&number);
                }
                _ => return Ok(token),
            }
        }
    }

    fn value(&mut self, token: u8, depth: usize) -> Result<Value<'a>> {
        const DEEPEST: usize = 128;
        if depth > DEEPEST {
            return Err(self.file.error(format!("more than {DEEPEST} arrays inside one another")));
        }
        Ok(match token {
            0x00 => Value::Null,
            b'0' => Value::Bool(false),
            b'1' => Value::Bool(true),
            0x10 => Value::Bool(self.file.array("a boolean")? != [0]),
            0x27 => Value::Text(Cow::Borrowed(self.string()?)),
            b'&' => Value::Text(Cow::Borrowed(self.reference()?)),
            b'@' => self.uniform()?,
            b'[' => Value::List(self.values(b']', depth)?),
            b'{' => Value::Map(self.values(b'}', depth)?),
            _ => {
                let Some(scalar) = scalar(token) else {
                    return Err(self.file.error(format!("unknown token 0x{token:02x}")));
                };
                let number = self.file.take(scalar.size(), "a number")?;
                Value::Number(scalar.number(number, self.big_endian))
            }
        })
    }

    fn values(&mut self, end: u8, depth: usize) -> Result<Vec<Value<'a>>> {
        let mut values = Vec::new();
        loop {
            let token = self.token()?;
            if token == end {
                return Ok(values);
            }
            self.count(VALUE)?;
            limpid::memory::grow(&mut values, 1, self.file.source.path.display())?;
            values.push(self.value(token, depth + 1)?);
        }
    }

    fn uniform(&mut self) -> Result<Value<'a>> {
        let [kind] = self.file.array("the type of an array")?;
        let count = self.length()?;
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        if let Some(scalar) = scalar(kind) {
            let bytes = self.file.take_records(count, scalar.size(), "an array")?;
            let (bytes, start) = (Cow::Borrowed(bytes), self.file.start);
            return Ok(Value::Numbers(Numbers {
                bytes,
                scalar,
                big_endian: self.big_endian,
                start,
            }));
        }
        match kind {
            0x10 => {
                let words =
                    self.file.take_records(count.div_ceil(32), 4, "an array of booleans")?;
                self.count(count as u64)?;
                let bit = |i: usize| {
                    // The byte of the bit in its word.
                    let byte = if self.big_endian { (i / 8) ^ 3 } else { i / 8 };
                    words.get(byte).is_some_and(|byte| byte >> (i % 8) & 1 == 1)
                };
                return Ok(Value::Flags((0..count).map(bit).collect()));
            }
            0x27 | b'&' => {}
            _ => return Err(self.file.error(format!("unknown type 0x{kind:02x} of an array"))),
        }
        let mut texts = Vec::new();
        // Each takes a byte at least, so that the loop ends with the file.
        for _ in 0..count {
            let text = if kind == 0x27 { self.string()? } else { self.reference()? };
            self.count(VALUE)?;
            texts.push(Value::Text(Cow::Borrowed(text)));
        }
        Ok(Value::List(texts))
    }

    /// Takes memory of the budget.
    fn count(&self, bytes: u64) -> Result<()> {
        self.file.source.take(self.budget, bytes, self.file.start)
    }

    fn string(&mut self) -> Result<&'a [u8]> {
        let length = self.length()?;
        self.file.take(usize::try_from(length).unwrap_or(usize::MAX), "a string")
    }

    fn reference(&mut self) -> Result<&'a [u8]> {
        let number = self.length()?;
        let string = self.strings.get(&number).copied();
        string.ok_or_else(|| self.file.error(format!("string {number} is not defined")))
    }

    /// A length, or the number of a string.
    fn length(&mut self) -> Result<u64> {
        let [first] = self.file.array("a length")?;
        let scalar = match first {
            0..=0xf0 => return Ok(first.into()),
            0xf2 => Scalar::U16,
            0xf4 => Scalar::U32,
            0xf8 => Scalar::U64,
            _ => return Err(self.file.error(format!("a length begins with 0x{first:02x}"))),
        };
        let number = self.file.take(scalar.size(), "a length")?;
        Ok(scalar.number(number, self.big_endian) as u64)
    }
}

fn scalar(token: u8) -> Option<Scalar> {
    Some(match token {
        0x11 => Scalar::I8,
        0x12 => Scalar::I16,
        0x13 => Scalar::I32,
        0x14 => Scalar::I64,
        0x18 => Scalar::F16,
        0x19 => Scalar::F32,
        0x1a => Scalar::F64,
        0x21 => Scalar::U8,
        0x22 => Scalar::U16,
        _ => return None,
    })
}

/// Makes values of JSON in text.
#[derive(Clone, Copy)]
struct Text<'b> {
    budget: &'b Budget,
    /// Whether the budget is used up.
    exceeded: &'b Cell<bool>,
}

impl Text<'_> {
    fn count<E: serde::de::Error>(self, bytes: usize) -> std::result::Result<(), E> {
        let taken = self.budget.take(bytes as u64, Path::new(""), Location::Byte(0));
        taken.map_err(|error| {
            self.exceeded.set(true);
            E::custom(error)
        })
    }
}

impl<'de> DeserializeSeed<'de> for Text<'_> {
    type Value = Value<'static>;

    fn deserialize<D: Deserializer<'de>>(
        self,
        deserializer: D,
    ) -> std::result::Result<Self::Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Text<'_> {
    type Value = Value<'static>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> std::result::Result<Self::Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> std::result::Result<Self::Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> std::result::Result<Self::Value, E> {
        Ok(Value::Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> std::result::Result<Self::Value, E> {
        Ok(Value::Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> std::result::Result<Self::Value, E> {
        Ok(Value::Number(value))
    }

    fn visit_str<E: serde::de::Error>(self, value: &str) -> std::result::Result<Self::Value, E> {
        self.count(value.len())?;
        Ok(Value::Text(Cow::Owned(value.as_bytes().to_vec())))
    }

    /// Lists of numbers alone are kept as such, which takes a fifth of the memory.
    fn visit_seq<A: SeqAccess<'de>>(
        self,
        mut items: A,
    ) -> std::result::Result<Self::Value, A::Error> {
        let (mut numbers, mut list) = (Vec::new(), Vec::new());
        while let Some(item) = items.next_element_seed(self)? {
            match item {
                Value::Number(number) if list.is_empty() => {
                    self.count(size_of::<f64>())?;
                    numbers.push(number);
                }
                item => {
                    self.count(VALUE as usize * (numbers.len() + 1))?;
                    list.try_reserve(numbers.len() + 1).map_err(A::Error::custom)?;
                    list.extend(numbers.drain(..).map(Value::Number));
                    list.push(item);
                }
            }
        }
        Ok(if numbers.is_empty() {
            Value::List(list)
        } else {
            Value::Numbers(Numbers::of_floats(numbers.into_iter()))
        })
    }

    fn visit_map<A: MapAccess<'de>>(
        self,
        mut items: A,
    ) -> std::result::Result<Self::Value, A::Error> {
        let mut list = Vec::new();
        while let Some(name) = items.next_key::<String>()? {
            self.count(2 * VALUE as usize + name.len())?;
            list.push(Value::Text(Cow::Owned(name.into_bytes())));
            list.push(items.next_value_seed(self)?);
        }
        Ok(Value::Map(list))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Value<'_>> {
        read_within(bytes, 1 << 20)
    }

    fn read_within(bytes: &[u8], limit: u64) -> Result<Value<'_>> {
        let source = FileBytes { path: Path::new("a.bgeo"), bytes, text: false };
        parse(source, &Budget::new(Some(limit)))
    }

    fn binary(tokens: &[u8]) -> Vec<u8> {
        [b"\x7fNSJb", tokens].concat()
    }

    fn text(text: &str) -> Value<'_> {
        Value::Text(Cow::Borrowed(text.as_bytes()))
    }

    /// Every token gives the value of its documentation, in both byte orders.
    #[test]
    fn tokens_have_their_documented_values() {
        let cases: [(&[u8], Value<'_>); 12] = [
            (b"\x00", Value::Null),
            (b"0", Value::Bool(false)),
            (b"1", Value::Bool(true)),
            (b"\x10\x01", Value::Bool(true)),
            (b"\x11\xfe", Value::Number(-2.0)),
            (b"\x12\x00\x01", Value::Number(256.0)),
            (b"\x18\x00\x3e", Value::Number(1.5)),
            (b"\x19\x00\x00\x20\x40", Value::Number(2.5)),
            (b"\x22\xff\xff", Value::Number(65535.0)),
            (b"\x27\x0cHello world!", text("Hello world!")),
            (b"+\x05\x01P[&\x05\x27\xf2\x01\x00Q]", Value::List(vec![text("P"), text("Q")])),
            (b"{\x27\x01a\x11\x07}", Value::Map(vec![text("a"), Value::Number(7.0)])),
        ];
        for (tokens, expected) in cases {
            assert_eq!(read(&binary(tokens)).unwrap(), expected, "{tokens:?}");
        }
        assert_eq!(read(b"\x7fbJSN\x12\x01\x00").unwrap(), Value::Number(256.0));
        let Value::Numbers(array) = read(b"\x7fNSJb@\x13\x02\x01\0\0\0\x02\0\0\0").unwrap() else {
            panic!("numbers expected")
        };
        assert_eq!((array.len(), array.start, array.scalar), (2, 8, Scalar::I32));
        // Bit 33 is the second of the second word.
        let bits = binary(b"@\x10\x22\x01\0\0\x80\x02\0\0\0");
        let Value::Flags(flags) = read(&bits).unwrap() else { panic!("flags expected") };
        let set: Vec<usize> = (0..flags.len()).filter(|&i| flags[i]).collect();
        assert_eq!((flags.len(), set), (34, vec![0, 31, 33]));
        let swapped = read(b"\x7fbJSN@\x10\x22\x80\0\0\x01\0\0\0\x02").unwrap();
        assert_eq!(swapped, Value::Flags(flags));
    }

    /// Values take the memory that they have in a document, whatever the size of their tokens.
    #[test]
    fn values_take_of_the_budget() {
        let nulls = |n: usize| [b"[", vec![0; n].as_slice(), b"]"].concat();
        let cases: [(Vec<u8>, u64); 6] = [
            (binary(&nulls(1000)), 1000 * VALUE),
            (binary(b"@\x10\x40\0\0\0\0\0\0\0\0"), 64),
            (binary(b"@\x27\x03\0\0\0"), 3 * VALUE),
            (format!("[{}null]", "null,".repeat(999)).into_bytes(), 1000 * VALUE),
            (format!("[[{}1],{{}}]", "1,".repeat(999)).into_bytes(), 8000 + 2 * VALUE),
            (br#"["abc",{"a":null}]"#.to_vec(), 3 + 1 + 4 * VALUE),
        ];
        for (bytes, least) in cases {
            assert!(read_within(&bytes, least).is_ok(), "{least}");
            let error = read_within(&bytes, least - 1).unwrap_err();
            assert!(matches!(error, Error::TooLarge { .. }), "{error}");
        }
    }

    /// Strings that are not defined, lengths beyond the file, and arrays inside one another without end.
    #[test]
    fn damaged_tokens_are_errors() {
        for (tokens, part) in [
            (&b"&\x05"[..], "string 5 is not defined"),
            (b"+\x05\x01P-\x05&\x05", "string 5 is not defined"),
            (b"@\x19\xf8\xff\xff\xff\xff\xff\xff\xff\xff", "0 are left"),
            (b"@\x10\xf4\xff\xff\xff\xff", "0 are left"),
            (b"\x27\xf3", "a length begins with 0xf3"),
            (b"\x77", "unknown token 0x77"),
            (b"@\x77\x00", "unknown type 0x77"),
            (b"[", "a token"),
            (&[b'['; 1000], "more than 128"),
        ] {
            let error = read(&binary(tokens)).unwrap_err().to_string();
            assert!(error.contains("a.bgeo: byte") && error.contains(part), "{error}");
        }
        let error = read(b"[1,\n2,\nx]").unwrap_err().to_string();
        assert!(error.contains("a.bgeo: line 3"), "{error}");
    }
}
