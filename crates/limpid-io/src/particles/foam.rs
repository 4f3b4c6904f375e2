//! OpenFOAM's parcels (`TIME/lagrangian/CLOUD/positions`) in text: the places, and the velocities `U`, diameters `d`,
//! densities `rho` and numbers `origId` in the files beside them.
//!
//! ```text
//! FoamFile { version 2.0; format ascii; class Cloud<basicKinematicCloud>; object positions; }
//! N ( (x y z) cell  (x y z) cell  ... )        N ( a b ... ) or N{a} in the files beside it
//! ```

use std::borrow::Cow;
use std::path::Path;

use super::{Attribute, Column, Contents, FileBytes, Reading, Scalar, Table, foreign};
use crate::error::{Error, Result};
use crate::files;
use limpid::memory;

/// The name of the format among the others. No file name contains it: the beginning of a file decides.
pub(super) const EXTENSION: &str = "/positions";

/// Whether a file begins as one of OpenFOAM's.
pub(super) fn is_foam(start: &[u8]) -> bool {
    Tokens::new(start).next().is_some_and(|(_, word)| word == b"FoamFile")
}

pub(super) fn read(path: &Path, bytes: &[u8], _: &Reading<'_>) -> Result<Contents> {
    if !is_foam(bytes) {
        return Err(foreign(path, bytes, "a file of OpenFOAM"));
    }
    let list = List::read(path, bytes)?;
    if !list.class.contains("Cloud") {
        let problem = format!(
            "OpenFOAM's `{:.40}`: name the `positions` of a cloud, in TIME/lagrangian/CLOUD",
            list.class
        );
        return Err(Error::format(path, problem));
    }
    if list.width == 4 {
        let problem = "places within cells, as OpenFOAM has written them since 2017: write the case as VTK with \
                       `foamToVTK`, and name the .vtk files of its clouds";
        return Err(Error::format(path, problem));
    }
    if list.count > 0 && list.width != 3 {
        let problem = format!("places of {} numbers, expected 3", list.width);
        return Err(list.source.error(list.start, problem));
    }
    let table = list.table();
    table.particles(Column::triple(Scalar::F64))
}

/// Reads the attributes in the files beside the positions.
pub(super) fn read_beside(
    path: &Path,
    contents: &mut Contents,
    reading: &Reading<'_>,
) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = [
        ("U", Attribute::Velocity, 1.0),
        ("d", Attribute::Radius, 0.5),
        ("rho", Attribute::Density, 1.0),
        ("origId", Attribute::Id, 1.0),
    ];
    for (name, attribute, factor) in beside {
        let (attribute, factor) = match reading.map.attribute_of(name) {
            Some(attribute) => (attribute, 1.0),
            None => (attribute, factor),
        };
        let path = folder.join(name);
        if !files::is_file(&path) {
            continue;
        }
        let mut bytes = Vec::new();
        files::read(&path, |_| reading.budget.left(), &mut bytes)?;
        let mut list = List::read_for(contents.particles.len(), &path, &bytes)?;
        list.numbers.iter_mut().for_each(|number| *number *= factor);
        let (width, table) = (list.width, list.table());
        let shape = [table.rows, width];
        let shape = if width == 1 { &shape[..1] } else { &shape[..] };
        let columns = Column::adjacent(0, width, Scalar::F64);
        contents.keep(reading, name, &table, &columns)?;
        contents.take_as(Some(attribute), name, shape, &table, &columns)?;
    }
    if reading.values || reading.shown.is_some() {
        let known = beside.map(|(name, ..)| name);
        return read_others(folder, &known, contents, reading);
    }
    Ok(())
}

/// Lists the files beside the positions that are no attributes, and reads those that are shown or described.
fn read_others(
    folder: &Path,
    known: &[&str],
    contents: &mut Contents,
    reading: &Reading<'_>,
) -> Result<()> {
    let places = ["positions", "coordinates"];
    let mut names = files::names_in(folder).unwrap_or_default();
    names.retain(|name| !known.contains(&name.as_str()) && !places.contains(&name.as_str()));
    names.sort_unstable();
    let rows = contents.particles.len();
    for name in names.iter().filter(|name| files::is_file(&folder.join(name))) {
        let path = folder.join(name);
        let mut bytes = Vec::new();
        let mut shape = vec![rows];
        if reading.shows_or_describes(name) {
            files::read(&path, |_| reading.budget.left(), &mut bytes)?;
            let list = match List::read_for(rows, &path, &bytes) {
                Err(_) if !reading.shows(name) => continue,
                list => list?,
            };
            let (width, table) = (list.width, list.table());
            contents.keep(reading, name, &table, &Column::adjacent(0, width, Scalar::F64))?;
            shape.extend(Some(width).filter(|&width| width > 1));
        }
        contents.list(name, &shape, None);
    }
    Ok(())
}

/// The list of numbers of a file, which has as many for each particle.
struct List<'a> {
    source: FileBytes<'a>,
    /// Offset of the list.
    start: usize,
    class: String,
    /// Number of particles.
    count: usize,
    /// Number of numbers of each.
    width: usize,
    numbers: Vec<f64>,
    /// Whether the numbers are those of every particle.
    uniform: bool,
}

impl<'a> List<'a> {
    /// Reads the list of a file beside `rows` positions.
    fn read_for(rows: usize, path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let mut list = Self::read(path, bytes)?;
        if list.uniform {
            memory::probe(rows.saturating_mul(8 * list.width), path.display())?;
            list.numbers = list.numbers.repeat(rows);
            list.count = rows;
        }
        Ok(list)
    }

    fn read(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let source = FileBytes { path, bytes, text: true };
        let mut tokens = Tokens::new(bytes);
        let mut entry: Vec<String> = Vec::new();
        let (mut class, mut format) = (String::new(), String::new());
        for (_, token) in tokens.by_ref() {
            match (token, entry.as_slice()) {
                (b"}", _) => break,
                (b"{", _) => entry.clear(),
                (b";", [key, value @ ..]) => {
                    let value = value.join(" ");
                    match key.as_str() {
                        "class" => class = value,
                        "format" => format = value,
                        _ => {}
                    }
                    entry.clear();
                }
                _ => entry.push(String::from_utf8_lossy(token).into_owned()),
            }
        }
        if format == "binary" {
            let problem = "OpenFOAM's binary format: convert the case with `foamFormatConvert` after `writeFormat \
                           ascii;` in its controlDict";
            return Err(Error::format(path, problem));
        }
        let end = |at: usize| source.error(at, "the file ends before its list does");
        let (start, count) = tokens.next().ok_or_else(|| end(bytes.len()))?;
        let found = String::from_utf8_lossy(count);
        let count: usize = found.parse().map_err(|_| {
            source.error(start, format!("expected the number of particles, found `{found:.40}`"))
        })?;
        let (at, open) = match tokens.next() {
            Some(token) => token,
            None if count == 0 => (start, &b"("[..]),
            None => return Err(end(bytes.len())),
        };
        let uniform = match open {
            b"(" => false,
            b"{" => true,
            other => {
                let found = String::from_utf8_lossy(other);
                return Err(source.error(at, format!("expected `(`, found `{found:.40}`")));
            }
        };
        let mut list = Self { source, start, class, count, width: 1, numbers: Vec::new(), uniform };
        let items = if uniform { 1 } else { count };
        for item in 0..items {
            list.item(item, &mut tokens)?;
        }
        let close: &[u8] = if uniform { b"}" } else { b")" };
        match tokens.next() {
            Some((_, token)) if token == close => Ok(list),
            None if items == 0 => Ok(list),
            None => Err(end(bytes.len())),
            Some((at, _)) => {
                Err(source.error(at, format!("more than the {items} items that are announced")))
            }
        }
    }

    /// Reads one item: a number, or some in parentheses. Numbers of cells that follow these are skipped.
    fn item(&mut self, item: usize, tokens: &mut Tokens<'a>) -> Result<()> {
        let source = self.source;
        let mut token = || {
            tokens.next().ok_or_else(|| {
                source
                    .error(source.bytes.len(), format!("particle {item}: the file ends before it"))
            })
        };
        let number = |at: usize, word: &[u8]| {
            let text = String::from_utf8_lossy(word);
            text.parse::<f64>().map_err(|_| {
                source.error(at, format!("particle {item}: expected a number, found `{text:.40}`"))
            })
        };
        let (at, first) = token()?;
        let before = self.numbers.len();
        memory::grow(&mut self.numbers, 4, source.path.display())?;
        if first == b"(" {
            loop {
                let (at, word) = token()?;
                if word == b")" {
                    break;
                }
                if self.numbers.len() - before == 9 {
                    return Err(source.error(at, format!("particle {item}: more than 9 numbers")));
                }
                self.numbers.push(number(at, word)?);
            }
            if self.class.contains("Cloud") {
                tokens.skip_labels();
            }
        } else {
            self.numbers.push(number(at, first)?);
        }
        let width = self.numbers.len() - before;
        if item > 0 && width != self.width {
            let problem = format!("particle {item}: {width} numbers, expected {}", self.width);
            return Err(source.error(at, problem));
        }
        self.width = width;
        Ok(())
    }

    fn table(&self) -> Table<'a> {
        let bytes: Vec<u8> = self.numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        Table {
            source: self.source,
            start: self.start,
            bytes: Cow::Owned(bytes),
            rows: self.count,
            stride: self.width * Scalar::F64.size(),
            big_endian: false,
            starts: Some(Vec::new()),
        }
    }
}

/// The words and brackets of a file without its comments, each with its offset.
struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Tokens<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Skips the numbers of cells after a place.
    fn skip_labels(&mut self) {
        loop {
            let before = self.at;
            match self.next() {
                Some((_, word))
                    if word.iter().all(|byte| byte.is_ascii_digit() || *byte == b'-') => {}
                _ => {
                    self.at = before;
                    return;
                }
            }
        }
    }
}

impl<'a> Iterator for Tokens<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        const BRACKETS: &[u8] = b"(){};";
        loop {
            let rest = self.bytes.get(self.at..)?;
            self.at += rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
            let rest = self.bytes.get(self.at..)?;
            let comment = |end: &[u8]| rest.windows(end.len()).position(|window| window == end);
            if rest.starts_with(b"/*") {
                self.at += comment(b"*/")? + 2;
            } else if rest.starts_with(b"//") {
                self.at += comment(b"\n")?;
            } else {
                let ends = |byte: &u8| byte.is_ascii_whitespace() || BRACKETS.contains(byte);
                let length = rest.iter().position(ends).unwrap_or(rest.len()).max(1);
                let start = self.at;
                self.at += length;
                return Some((start, &rest[..length]));
            }
        }
    }
}
