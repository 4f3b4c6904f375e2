//! Writer of VTU files.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use base64::prelude::BASE64_STANDARD;
use base64::write::EncoderWriter;

use crate::particles::{Others, Particles, Values, write_numbers};

/// Writes an unstructured grid of vertices in one piece, with arrays appended as base64, which is valid
/// XML for all readers, unlike raw data.
pub(in crate::particles) fn write(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    let n = particles.len();
    let mut appended = Appended { xml: String::new(), length: 0 };
    let wide = !particles.narrow();
    appended.element("PointData", |appended| {
        for (name, values) in super::super::with_others(particles, others) {
            let kind = if matches!(values, Values::Integers(_)) { "Int64" } else { "Float32" };
            appended.array(kind, name, values.size(), n);
        }
    });
    appended.element("Points", |appended| {
        appended.array(if wide { "Float64" } else { "Float32" }, "Points", 3, n);
    });
    appended.element("Cells", |appended| {
        appended.array("Int64", "connectivity", 1, n);
        appended.array("Int64", "offsets", 1, n);
        appended.array("UInt8", "types", 1, n);
    });
    let xml = appended.xml;
    write!(
        out,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{n}\" NumberOfCells=\"{n}\">\n{xml}</Piece>\n</UnstructuredGrid>\n\
         <AppendedData encoding=\"base64\">\n_"
    )?;
    for (_, values) in super::super::with_others(particles, others) {
        match values {
            Values::Integers(ids) => base64(ids, i64::to_le_bytes, out)?,
            _ => base64(values.floats(), f32::to_le_bytes, out)?,
        }
    }
    if wide {
        let positions: Vec<_> = (0..n).flat_map(|i| particles.place(i).to_array()).collect();
        base64(&positions, f64::to_le_bytes, out)?;
    } else {
        base64(bytemuck::cast_slice(&particles.positions), f32::to_le_bytes, out)?;
    }
    base64(&Vec::from_iter(0..n as u64), u64::to_le_bytes, out)?;
    base64(&Vec::from_iter(1..=n as u64), u64::to_le_bytes, out)?;
    base64(&vec![1; n], u8::to_le_bytes, out)?;
    write!(out, "\n</AppendedData>\n</VTKFile>\n")
}

/// The XML elements of appended arrays.
struct Appended {
    xml: String,
    /// Length of the appended base64 so far, characters.
    length: usize,
}

impl Appended {
    fn element(&mut self, name: &str, arrays: impl FnOnce(&mut Self)) {
        self.xml += &format!("<{name}>\n");
        arrays(self);
        self.xml += &format!("</{name}>\n");
    }

    fn array(&mut self, kind: &str, name: &str, size: usize, rows: usize) {
        let offset = self.length;
        self.xml += &format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{size}\" format=\"appended\" offset=\"{offset}\"/>\n"
        );
        let bytes = if kind.ends_with("64") {
            8
        } else if kind.ends_with('8') {
            1
        } else {
            4
        };
        self.length += (size_of::<u64>() + rows * size * bytes).div_ceil(3) * 4;
    }
}

/// Writes the base64 of an array: its length in bytes and its numbers, encoded together.
fn base64<T: Copy, const N: usize>(
    numbers: &[T],
    bytes: impl Fn(T) -> [u8; N],
    out: &mut impl Write,
) -> io::Result<()> {
    let mut encoder = EncoderWriter::new(out, &BASE64_STANDARD);
    encoder.write_all(&((numbers.len() * N) as u64).to_le_bytes())?;
    write_numbers(numbers, bytes, &mut encoder)?;
    encoder.finish().map(drop)
}
