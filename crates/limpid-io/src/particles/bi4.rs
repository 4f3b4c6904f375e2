//! `.bi4`, the frames of DualSPHysics (`Part_0000.bi4`), by the source of its class `JBinaryData`:
//!
//! ```text
//! "#FileJBD JPartDataBi4", to 60 bytes; u8 byte order (1: big-endian) + 10 × wide, u8 wide, 2 bytes; an item
//! item: u32 length of its head; "\nITEM\n", name, i32 hidden, i32 hidden values, two texts,
//!     u32 arrays, u32 items, u32 length of its values; values, arrays, items
//! values, if their length is not 0: "\nVALUES", u32 number, each: name, i32 type, value
//! array: u32 length of its head; "\nARRAY", name, i32 hidden, i32 type, count, length; numbers
//! ```
//!
//! Texts are a u32 length and bytes. `count` and `length` are u64 in *wide* files and u32 in others.
//!
//! Only the fluid is read: the ids of fixed, moving and floating bodies come first, and the values
//! `CaseNfixed`, `CaseNmoving` and `CaseNfloat` tell how many they are. The radius is half of the distance
//! `Dp` between the particles. The classes `JPartDataBi4` and `JPartsLoad4` give the layout: the root has the values of
//! the case, and its item `PART_0000` the arrays, each of its value `Npok` entries. A run on several devices writes
//! `Npiece` files a frame, `Part_p00_0000.bi4` and so on.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::arrays::DUALSPHYSICS;
use super::remark::{Remark, Unit};
use super::{Column, Contents, Cursor, Reading, Scalar, Table, foreign};
use crate::error::{Error, Location, Result};

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(b"#FileJBD ") {
        return Err(foreign(path, bytes, "a file of DualSPHysics"));
    }
    let mut file = Cursor::new(path, bytes, false);
    file.take(60, "the title")?;
    let [order, wide, _, _] = file.array("the byte order")?;
    let big_endian = match order % 10 {
        0 => false,
        1 => true,
        _ => return Err(file.error(format!("expected a byte order of 0 or 1, found {order}"))),
    };
    let (values, arrays) = (HashMap::new(), Vec::new());
    let mut file = Items { file, big_endian, wide: wide != 0, values, arrays, items: 0 };
    file.item(0)?;
    let left = file.file.rest().len();
    if left > 0 {
        file.file.start = file.file.offset;
        return Err(file.file.error(format!("{left} bytes follow the last item")));
    }

    let Items { values, arrays, .. } = file;
    let find = |name: &str| arrays.iter().find(|array| array.name == name);
    let Some(positions) = find("Posd").or_else(|| find("Pos")) else {
        let problem = "no array `Pos` or `Posd`; the particles are in Part_0000.bi4 and so on";
        return Err(Error::format(path, problem));
    };
    let places = |array: &&Array<'_>| matches!(&*array.name, "Pos" | "Posd");
    if arrays.iter().filter(places).any(|array| array.item != positions.item) {
        return Err(Error::format(path, "positions in several items; save each as one file"));
    }
    let fail = |at: usize, problem: String| {
        Err(Error::malformed(path, Location::Byte(at as u64), problem))
    };
    let count = positions.count;
    let of_particles = || arrays.iter().filter(|array| array.item == positions.item);
    if let Some(array) = of_particles().find(|array| array.count != count) {
        let (name, entries) = (&array.name, array.count);
        return fail(
            array.start,
            format!("array {name} has {entries} entries for {count} particles"),
        );
    }
    if let Some((npok, at)) = positions.particles.filter(|(npok, _)| *npok != count as f64) {
        return fail(at, format!("Npok is {npok}, but there are {count} particles"));
    }
    let bodies = bodies(path, &values)?;
    let ids = find("Idpd").or_else(|| find("Idp"));
    let ids = ids.filter(|ids| ids.item == positions.item && ids.columns.len() == 1);
    let fluid = ids.and_then(|ids| fluid(ids, bodies, big_endian));
    let fluid = fluid.filter(|_| reading.select.is_automatic());
    let rows = fluid.as_deref();
    let [x, y, z] = *positions.columns.as_slice() else {
        let problem = "expected positions of three numbers";
        return Err(Error::malformed(path, Location::Byte(positions.start as u64), problem));
    };
    let table = positions.table(path, bytes, big_endian, rows);
    let mut contents = table.particles([x, y, z])?;
    if ids.is_none() && bodies > 0.0 {
        let problem = "without ids (Idp), fixed and moving particles cannot be told from the fluid";
        let array = "CaseNfixed".into();
        contents.remarks.push(Remark::Unusable { array, problem: problem.into() });
    }
    if let Some(rows) = rows {
        let (count, why) = (positions.count.saturating_sub(rows.len()), "Idp of bodies".into());
        contents.remarks.push(Remark::LeftOut { count, why });
    }
    for array in arrays.iter().filter(|array| !std::ptr::eq(*array, positions)) {
        if array.item == positions.item && !array.columns.is_empty() {
            let table = array.table(path, bytes, big_endian, rows);
            contents.take(reading, &array.name, &table, &array.columns)?;
        } else {
            contents.list(&array.name, &[array.count], None);
        }
    }
    contents.up = Some(DUALSPHYSICS);
    let (spacing, at) = values.get("Dp").copied().unwrap_or_default();
    if !(spacing as f32).is_finite() || spacing < 0.0 {
        return fail(at, format!("Dp is {spacing}, expected the distance between the particles"));
    }
    if contents.particles.radii.is_none() && spacing > 0.0 {
        contents.particles.radii = Some(vec![spacing as f32 / 2.0; contents.particles.len()]);
    }
    let pieces = values.get("Npiece").map_or(1.0, |(pieces, _)| *pieces);
    if pieces > 1.0 {
        let total = pieces as u64;
        contents.remarks.push(Remark::Partial { found: 1, total, unit: Unit::Files });
    }
    Ok(contents)
}

/// Number of the particles of bodies, whose ids come before those of the fluid.
fn bodies(path: &Path, values: &Values) -> Result<f64> {
    /// Largest number that a double-precision float holds with all below.
    const MOST: f64 = 9_007_199_254_740_992.0;
    let mut sum = 0.0;
    for name in ["CaseNfixed", "CaseNmoving", "CaseNfloat", "CaseNfluid"] {
        let Some(&(count, at)) = values.get(name) else { continue };
        if count.fract() != 0.0 || !(0.0..=MOST).contains(&count) {
            let problem = format!("{name} is {count}, expected a count");
            return Err(Error::malformed(path, Location::Byte(at as u64), problem));
        }
        sum += count;
    }
    let fluid = values.get("CaseNfluid").map(|(count, _)| *count);
    let all = values.get("CaseNp").filter(|(all, _)| fluid.is_some() && *all != sum);
    if let Some(&(all, at)) = all {
        let problem = format!("CaseNp is {all}, but its parts sum up to {sum}");
        return Err(Error::malformed(path, Location::Byte(at as u64), problem));
    }
    Ok(sum - fluid.unwrap_or(0.0))
}

/// The rows of the fluid, whose ids begin at `first`; `None` if that is all.
fn fluid(ids: &Array<'_>, first: f64, big_endian: bool) -> Option<Vec<usize>> {
    let numbers = ids.bytes.chunks_exact(ids.columns[0].scalar.size());
    let numbers = numbers.map(|id| ids.columns[0].number(id, big_endian));
    let rows: Vec<usize> =
        numbers.enumerate().filter(|(_, id)| *id >= first).map(|(row, _)| row).collect();
    (rows.len() < ids.count).then_some(rows)
}

/// Numbers by their names, and where they are in the file.
type Values = HashMap<String, (f64, usize)>;

/// An array, with its numbers row by row.
struct Array<'a> {
    name: String,
    /// The columns of a row; none of texts.
    columns: Vec<Column>,
    count: usize,
    bytes: &'a [u8],
    start: usize,
    /// The number of its item.
    item: usize,
    /// The number of particles that its item tells, `Npok`, and where.
    particles: Option<(f64, usize)>,
}

impl<'a> Array<'a> {
    /// The given rows, or all.
    fn table(
        &self,
        path: &'a Path,
        file: &'a [u8],
        big_endian: bool,
        rows: Option<&[usize]>,
    ) -> Table<'a> {
        let stride: usize = self.columns.iter().map(|column| column.scalar.size()).sum();
        let row =
            |row: &usize| self.bytes.get(row * stride..(row + 1) * stride).unwrap_or_default();
        let start_of = |row: &usize| self.start + row * stride;
        Table {
            source: Cursor::new(path, file, false).source,
            start: self.start,
            bytes: match rows {
                Some(rows) => Cow::Owned(rows.iter().map(row).collect::<Vec<_>>().concat()),
                None => Cow::Borrowed(self.bytes),
            },
            rows: rows.map_or(self.count, <[_]>::len),
            stride,
            big_endian,
            starts: rows.map(|rows| rows.iter().map(start_of).collect()),
        }
    }
}

/// Reads items.
struct Items<'a> {
    file: Cursor<'a>,
    big_endian: bool,
    wide: bool,
    /// The values that are single numbers, of all items; the first of each name.
    values: Values,
    arrays: Vec<Array<'a>>,
    /// Number of items so far.
    items: usize,
}

impl<'a> Items<'a> {
    fn item(&mut self, depth: usize) -> Result<()> {
        const DEEPEST: usize = 32;
        if depth > DEEPEST {
            return Err(self.file.error(format!("more than {DEEPEST} items inside one another")));
        }
        self.items += 1;
        let number = self.items;
        self.number(Scalar::U32, "an item")?;
        self.mark("\nITEM\n")?;
        self.text("an item's name")?;
        self.file.take(8, "an item's flags")?;
        self.text("a format")?;
        self.text("a format")?;
        let arrays = self.number(Scalar::U32, "the number of arrays")? as usize;
        let items = self.number(Scalar::U32, "the number of items")? as usize;
        let mut particles = None;
        if self.number(Scalar::U32, "the length of values")? > 0.0 {
            self.mark("\nVALUES")?;
            let values = self.number(Scalar::U32, "the number of values")? as usize;
            for _ in 0..values {
                let value = self.value()?;
                particles = value.filter(|(name, _)| name == "Npok").map(|(_, n)| n).or(particles);
            }
        }
        // Each takes bytes of the file, so that the loops end with it.
        (0..arrays).try_for_each(|_| self.array(number, particles))?;
        (0..items).try_for_each(|_| self.item(depth + 1))
    }

    /// Reads a value, and returns it if it is a number.
    fn value(&mut self) -> Result<Option<(String, (f64, usize))>> {
        let name = self.text("a value's name")?;
        match self.kind()? {
            None => drop(self.text("a text")?),
            Some((scalar, 1)) => {
                let number = (self.number(scalar, "a value")?, self.file.start);
                self.values.entry(name.clone()).or_insert(number);
                return Ok(Some((name, number)));
            }
            Some((scalar, size)) => drop(self.file.take(size * scalar.size(), "a value")?),
        }
        Ok(None)
    }

    fn array(&mut self, item: usize, particles: Option<(f64, usize)>) -> Result<()> {
        self.number(Scalar::U32, "an array")?;
        self.mark("\nARRAY")?;
        let name = self.text("an array's name")?;
        self.file.take(4, "an array's flags")?;
        let kind = self.kind()?;
        let size = if self.wide { Scalar::U64 } else { Scalar::U32 };
        let count = self.number(size, "the length of an array")? as usize;
        let length = self.number(size, "the length of an array")? as usize;
        let bytes = self.file.take(length, &name)?;
        let columns = kind.map_or(Vec::new(), |(scalar, size)| Column::adjacent(0, size, scalar));
        let stride: usize = columns.iter().map(|column| column.scalar.size()).sum();
        if !columns.is_empty() && count.checked_mul(stride) != Some(length) {
            let problem = format!("array {name}: {length} bytes, expected {count} × {stride}");
            return Err(self.file.error(problem));
        }
        let start = self.file.start;
        self.arrays.push(Array { name, columns, count, bytes, start, item, particles });
        Ok(())
    }

    /// The type of a value or of the elements of an array, and its numbers; `None` for text.
    fn kind(&mut self) -> Result<Option<(Scalar, usize)>> {
        let kind = self.number(Scalar::I32, "a type")?;
        Ok(match kind as i32 {
            1 => None,
            3 => Some((Scalar::I8, 1)),
            4 => Some((Scalar::U8, 1)),
            5 => Some((Scalar::I16, 1)),
            6 => Some((Scalar::U16, 1)),
            // A boolean is an integer.
            2 | 7 => Some((Scalar::I32, 1)),
            8 => Some((Scalar::U32, 1)),
            9 => Some((Scalar::I64, 1)),
            10 => Some((Scalar::U64, 1)),
            11 => Some((Scalar::F32, 1)),
            12 => Some((Scalar::F64, 1)),
            20 => Some((Scalar::I32, 3)),
            21 => Some((Scalar::U32, 3)),
            22 => Some((Scalar::F32, 3)),
            23 => Some((Scalar::F64, 3)),
            _ => return Err(self.file.error(format!("unknown type {kind}"))),
        })
    }

    fn number(&mut self, scalar: Scalar, what: &str) -> Result<f64> {
        let bytes = self.file.take(scalar.size(), what)?;
        Ok(scalar.number(bytes, self.big_endian))
    }

    fn text(&mut self, what: &str) -> Result<String> {
        let length = self.number(Scalar::U32, what)? as usize;
        Ok(String::from_utf8_lossy(self.file.take(length, what)?).into_owned())
    }

    fn mark(&mut self, expected: &str) -> Result<()> {
        let start = self.file.offset;
        let found = self.text(expected.trim())?;
        if found == expected {
            return Ok(());
        }
        self.file.start = start;
        Err(self.file.error(format!("expected {}, found `{found}`", expected.trim())))
    }
}
