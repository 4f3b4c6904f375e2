//! `.npy`, one array of numpy (Robert Kern, "A simple file format for numpy arrays", 2007; and the
//! module documentation of `numpy.lib.format`): positions as one array of shape (n, 3) of 32- or
//! 64-bit floats, of either byte order, in C or Fortran order.
//!
//! ```text
//! "\x93NUMPY"  u8 major, minor  u16 (major 1) or u32 length, little-endian
//! "{'descr': '<f4', 'fortran_order': False, 'shape': (n, 3), }" padded with blanks
//! the numbers
//! ```
//!
//! The header is a Python literal. Only those three entries matter, and none can nest, so they
//! are looked up where they stand instead of parsing Python.

use std::path::Path;

use glam::DVec3;

use super::{Column, Cursor, Particles, Scalar, foreign};
use crate::error::{Error, Result};

pub(crate) fn read(path: &Path, bytes: &[u8]) -> Result<Particles> {
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err(foreign(path, bytes, "a NumPy array"));
    }
    let mut file = Cursor::new(path, bytes, false);
    file.take(6, "the magic")?;
    let [major, _minor] = file.array("the version")?;
    let length = match major {
        1 => file.array("the header's length").map(u16::from_le_bytes)?.into(),
        2 | 3 => file.array("the header's length").map(u32::from_le_bytes)? as usize,
        _ => {
            let problem = format!("version {major} of the .npy format; 1 to 3 can be read");
            return Err(Error::format(path, problem));
        }
    };
    let header = String::from_utf8_lossy(file.take(length, "the header")?).replace('"', "'");
    let entry = |key: &str| {
        let (_, rest) = header.split_once(&format!("'{key}'"))?;
        Some(rest.trim_start().strip_prefix(':')?.trim_start())
    };
    let missing = |key: &str| file.error(format!("the header has no valid `{key}`"));

    let kind = entry("descr").ok_or_else(|| missing("descr"))?;
    let kind = kind.strip_prefix('\'').and_then(|rest| rest.split('\'').next()).unwrap_or(kind);
    let (big_endian, scalar) = match kind {
        "<f4" => (false, Scalar::F32),
        "<f8" => (false, Scalar::F64),
        ">f4" => (true, Scalar::F32),
        ">f8" => (true, Scalar::F64),
        _ => {
            let problem = format!("numbers of type `{kind}`; 32- or 64-bit floats expected");
            return Err(Error::format(path, problem));
        }
    };
    let columns_first = match entry("fortran_order") {
        Some(value) if value.starts_with("True") => true,
        Some(value) if value.starts_with("False") => false,
        _ => return Err(missing("fortran_order")),
    };
    let shape = entry("shape").and_then(|rest| rest.strip_prefix('(')?.split_once(')'));
    let (shape, _) = shape.ok_or_else(|| missing("shape"))?;
    let sizes: Vec<&str> = shape.split(',').map(str::trim).filter(|s| !s.is_empty()).collect();
    let &[rows, "3"] = sizes.as_slice() else {
        return Err(Error::format(path, format!("shape ({shape}); (n, 3) expected")));
    };
    let rows = file.count(Some(rows), "the shape")?;

    if columns_first {
        let column = Column { offset: 0, scalar };
        let mut axis = || {
            let table = file.table(rows, scalar.size(), big_endian, "one axis of the positions")?;
            table.numbers([column], "position", |[number]| number)
        };
        let (x, y, z) = (axis()?, axis()?, axis()?);
        let places = x.into_iter().zip(y).zip(z).map(|((x, y), z)| DVec3::new(x, y, z));
        return Ok(match scalar {
            Scalar::F32 => Particles::from_positions(places.map(|place| place.as_vec3()).collect()),
            _ => Particles::from_places(&places.collect::<Vec<_>>()),
        });
    }
    let table = file.table(rows, 3 * scalar.size(), big_endian, "positions")?;
    table.particles(Column::triple(scalar))
}
