//! Elements of VTK's XML, and their attributes.

use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::super::{FileBytes, Scalar};
use super::array::{Array, Data, Section};
use crate::error::{Error, Result};
use crate::vtk_lists;

/// An XML element and its offset.
#[derive(Clone, Copy)]
pub(super) struct Element<'a, 'b> {
    pub(super) source: FileBytes<'a>,
    pub(super) start: usize,
    pub(super) element: &'b BytesStart<'a>,
}

impl Element<'_, '_> {
    pub(super) fn error(&self, problem: &str) -> Error {
        let name = self.element.name();
        let name = String::from_utf8_lossy(name.as_ref());
        self.source.error(self.start, format!("<{name}>: {problem}"))
    }

    pub(super) fn attribute(&self, name: &str) -> Result<Option<String>> {
        vtk_lists::attribute(self.element, name).map_err(|problem| self.error(&problem))
    }

    pub(super) fn count(&self, name: &str) -> Result<Option<usize>> {
        let problem =
            |text: &str| self.error(&format!("{name}: expected a count, found `{text:.40}`"));
        self.attribute(name)?.map(|text| text.parse().map_err(|_| problem(&text))).transpose()
    }

    /// Reads the element of an array; `None` if it cannot be an attribute.
    pub(super) fn array(
        &self,
        name: String,
        section: Section,
        size: usize,
        rows: usize,
    ) -> Result<Option<Array>> {
        /// Largest number of values of an attribute.
        const MAX_SIZE: usize = 6;
        let points = section == Section::Points;
        if points && size != 3 {
            return Err(self.error(&format!("points of {size} numbers, expected 3")));
        }
        if !points && !(1..=MAX_SIZE).contains(&size) {
            return Ok(None);
        }
        let scalar = match self.attribute("type")?.unwrap_or_default().as_str() {
            "Int8" => Scalar::I8,
            "UInt8" => Scalar::U8,
            "Int16" => Scalar::I16,
            "UInt16" => Scalar::U16,
            "Int32" => Scalar::I32,
            "UInt32" => Scalar::U32,
            "Int64" => Scalar::I64,
            "UInt64" => Scalar::U64,
            "Float32" => Scalar::F32,
            "Float64" => Scalar::F64,
            other => {
                let problem =
                    format!("expected a number type (Float32, Int64, ...), found `{other:.40}`");
                return Err(self.error(&problem));
            }
        };
        let data = match self.attribute("format")?.as_deref() {
            None | Some("ascii") => Data::Ascii(0..0),
            Some("binary") => Data::Base64(0..0),
            Some("appended") => {
                let missing = || self.error("expected `offset`");
                Data::Appended(self.count("offset")?.ok_or_else(missing)?)
            }
            Some(other) => {
                let problem = format!("format `{other:.40}`: expected ascii, binary or appended");
                return Err(self.error(&problem));
            }
        };
        Ok(Some(Array { name, section, scalar, size, rows, start: self.start, data }))
    }
}

/// Reads to the end of an array's element, and returns its first text that is not blank. `ParaView` adds
/// nested elements with information, which are skipped.
pub(super) fn text_of(xml: &mut Reader<&[u8]>, source: FileBytes<'_>) -> Result<Range<usize>> {
    let (mut depth, mut text) = (0_usize, 0..0);
    loop {
        let start = xml.buffer_position() as usize;
        let event = xml.read_event().map_err(|error| {
            let offset = xml.error_position() as usize;
            source.error(offset, format!("not XML: {error}"))
        })?;
        match event {
            Event::Start(_) => depth += 1,
            Event::End(_) if depth == 0 => return Ok(text),
            Event::End(_) => depth -= 1,
            Event::Text(found)
                if depth == 0 && text.is_empty() && !found.trim_ascii().is_empty() =>
            {
                text = start..xml.buffer_position() as usize;
            }
            Event::Eof => return Err(source.error(start, "the file ends in an array")),
            _ => {}
        }
    }
}
