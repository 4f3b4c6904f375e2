//! `.npz`, a zip archive of numpy arrays (`numpy.savez`, `numpy.savez_compressed`): each attribute is a
//! member `NAME.npy`, stored or deflated.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::axes::{Axes, Grid, Places};
use super::labelled::{position_among, velocity_among};
use super::npy::{self, Header};
use super::{
    Attribute, AttributeMap, Column, Contents, Cursor, FileBytes, Others, Particles, ReadOptions,
    Reading, Table, Values, foreign, write_numbers,
};
use crate::budget::Budget;
use crate::error::{Error, Location, Result, printable};
use crate::files::{self, DEFLATE_RATIO};
use limpid::memory;

/// Names of positions, the most likely first; numpy calls the first array without a name `arr_0`.
pub(super) const POSITIONS: [&str; 7] =
    ["positions", "position", "pos", "x", "points", "coordinates", "arr_0"];

/// Whether an array has the times of several steps: by its name and shape.
pub(super) fn is_time(name: &str, shape: &[usize], steps: usize) -> bool {
    const NAMES: [&str; 4] = ["time", "times", "t", "timestamps"];
    let named = NAMES.iter().any(|known| name.eq_ignore_ascii_case(known));
    named && steps > 1 && shape == [steps]
}

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(b"PK\x03\x04") && !bytes.starts_with(b"PK\x05\x06") {
        return Err(foreign(path, bytes, "an archive of NumPy arrays"));
    }
    let packed = bytes.len() as u64;
    let mut archive = Members::open(path, io::Cursor::new(bytes), packed, reading.budget)?;
    let headers = archive.headers()?;
    let (positions, places) = find_positions(path, reading.map, &archive.arrays, &headers)?;
    match places.steps {
        0 => return Ok(Contents::default()),
        1 => {}
        _ => return Err(super::several(path)),
    }
    archive.contents(reading, &headers, &positions, &places, 0)
}

/// Number of time steps of the positions, 1 if the archive cannot be read, and the times of the steps, if it has them.
pub(super) fn steps(path: &Path) -> Result<(usize, Vec<f64>)> {
    let (file, metadata) = files::open(path)?;
    let length = metadata.len();
    let budget = Budget::of_length(None, length);
    let find = || {
        let mut archive = Members::open(path, BufReader::new(file), length, &budget).ok()?;
        let headers = archive.headers().ok()?;
        let found = find_positions(path, &AttributeMap::default(), &archive.arrays, &headers);
        let steps = found.ok()?.1.steps;
        let times = if steps > 1 { archive.times(&headers, steps) } else { Vec::new() };
        Some((steps, times))
    };
    Ok(find().unwrap_or((1, Vec::new())))
}

/// Reads one step of several.
pub(super) fn read_step(path: &Path, step: usize, options: &ReadOptions) -> Result<Contents> {
    let (file, metadata) = files::open(path)?;
    let length = metadata.len();
    let budget = Budget::of_length(options.max_unpacked, length);
    let mut archive = Members::open(path, BufReader::new(file), length, &budget)?;
    let headers = archive.headers()?;
    let (positions, places) = find_positions(path, &options.map, &archive.arrays, &headers)?;
    if step >= places.steps {
        let problem = format!("step {step}: the file has {} now", places.steps);
        return Err(damaged(path, &problem));
    }
    archive.contents(&Reading::new(options, &budget), &headers, &positions, &places, step)
}

/// The header of a member, and the offset of its numbers.
struct Member {
    header: Header,
    offset: usize,
}

/// Finds the array of the positions, or those of their coordinates, and how they lie.
fn find_positions(
    path: &Path,
    map: &AttributeMap,
    arrays: &[(usize, String)],
    headers: &[Option<Member>],
) -> Result<(Vec<usize>, Places)> {
    let grids = headers.iter().map(|member| {
        let header = member.as_ref().map(|member| &member.header);
        header.filter(|header| header.plain).map(|header| &header.grid)
    });
    let named = arrays.iter().map(|(_, name)| name.as_str()).zip(grids);
    let array = positions_among(&named.collect::<Vec<_>>(), map);
    let array = array.map(|(at, places)| (vec![at], places));
    let columns = || {
        let columns = columns_among(arrays, headers, |labels| position_among(labels, map))?;
        let rows = columns.first().and_then(|&at| headers[at].as_ref());
        let rows = rows.map_or(0, |member| member.header.grid.rows());
        Some((columns, Places::of_columns(&[rows])))
    };
    array.or_else(columns).ok_or_else(|| {
        let names: Vec<&str> = arrays.iter().map(|(_, name)| name.as_str()).collect();
        let pickled = |member: &Member| member.header.kind.ends_with('O');
        let pickled = headers.iter().flatten().any(pickled);
        if pickled && !names.contains(&"particles") {
            let problem = format!(
                "no array of positions, but some pickled by Python, which may run any program ({}): save plain ones \
                 with `numpy.savez('a.npz', positions=..., velocity=...)`",
                names[..names.len().min(8)].join(", ")
            );
            return Error::format(path, problem);
        }
        if pickled {
            let problem = "arrays pickled by Python, as PySPH writes them, which may run any program; `python -c \
                           \"import numpy as N; p = N.load('a.npz', allow_pickle=True)['particles'].item(); f = \
                           p.get('fluid', p[sorted(p)[0]])['arrays']; N.savez('b.npz', positions=N.c_[f['x'], \
                           f['y'], f['z']], velocity=N.c_[f['u'], f['v'], f['w']], density=f['rho'])\"` writes \
                           plain ones, and PySPH itself HDF5 where h5py is installed";
            return Error::format(path, problem);
        }
        let usual = format!(
            "`{}` of shape (n, 3) of floats, nor a single other one, nor x, y and z",
            POSITIONS.join("`, `")
        );
        Error::format(path, map.no_positions("array", &usual, &names))
    })
}

/// Finds the columns of the velocities, if they are no array of their own.
fn find_velocities(
    map: &AttributeMap,
    arrays: &[(usize, String)],
    headers: &[Option<Member>],
    places: &Places,
) -> Option<Vec<usize>> {
    let is_whole = |((_, name), member): (&(usize, String), &Option<Member>)| {
        map.attribute_of(name) == Some(Attribute::Velocity)
            && member.as_ref().is_some_and(|member| {
                member.header.grid.attribute(Attribute::Velocity, places).is_some()
            })
    };
    match places.steps > 1 || arrays.iter().zip(headers).any(is_whole) {
        true => None,
        false => columns_among(arrays, headers, |labels| velocity_among(labels, map)),
    }
}

/// The arrays of one number a particle that `among` chooses by their names.
fn columns_among(
    arrays: &[(usize, String)],
    headers: &[Option<Member>],
    among: impl Fn(&[&str]) -> Option<Vec<usize>>,
) -> Option<Vec<usize>> {
    let is_column = |at: &usize| {
        let header = headers[*at].as_ref().map(|member| &member.header);
        header.is_some_and(|header| header.plain && header.grid.is_column())
    };
    let columns: Vec<_> = (0..arrays.len()).filter(is_column).collect();
    let names: Vec<_> = columns.iter().map(|&at| arrays[at].1.as_str()).collect();
    Some(among(&names)?.into_iter().map(|k| columns[k]).collect())
}

/// Chooses the positions among named arrays, and tells how they lie: by their name, or the only array of floats and of
/// shape (n, 3) that is no attribute, or the only one of another shape of three coordinates.
pub(super) fn positions_among(
    arrays: &[(&str, Option<&Grid>)],
    map: &AttributeMap,
) -> Option<(usize, Places)> {
    let candidates = arrays.iter().enumerate().filter_map(|(at, &(name, grid))| {
        let grid = grid.filter(|grid| grid.may_be_places())?;
        // One of the coordinates, with the others beside it.
        let beside = |other: &str| {
            let is = |&(known, with): &(&str, Option<&Grid>)| {
                known.eq_ignore_ascii_case(other) && with.is_some_and(|w| w.sizes == grid.sizes)
            };
            arrays.iter().any(is)
        };
        if name.eq_ignore_ascii_case("x") && beside("y") {
            return None;
        }
        let columns = |places: &Places| places.width <= 3;
        Some((at, name, grid, Places::of(grid).filter(columns)?))
    });
    let candidates: Vec<_> = candidates.collect();
    if map.has(Attribute::Position) {
        let mut named = candidates.iter();
        let is = |name: &str| map.attribute_of(name) == Some(Attribute::Position);
        return named.find(|(_, name, ..)| is(name)).map(|&(at, _, _, places)| (at, places));
    }
    let named = POSITIONS
        .iter()
        .find_map(|known| candidates.iter().find(|(_, name, ..)| name.eq_ignore_ascii_case(known)));
    let others: Vec<_> = candidates
        .iter()
        .filter(|(_, name, grid, places)| {
            map.attribute_of(name).is_none() && grid.is_float() && places.width == 3
        })
        .collect();
    let rows: Vec<_> = others
        .iter()
        .filter(|(_, _, grid, _)| grid.sizes.len() == 2 && grid.sizes[1] == 3)
        .collect();
    let other = || match (rows.as_slice(), others.as_slice()) {
        ([one], _) => Some(**one),
        ([], [one]) => Some(*one),
        _ => None,
    };
    named.or_else(other).map(|&(at, _, _, places)| (at, places))
}

/// Repeats a single radius or density for all particles.
fn broadcast<'a>(
    table: Table<'a>,
    columns: &[Column],
    attribute: Attribute,
    shape: &[usize],
    rows: usize,
) -> Table<'a> {
    let single = matches!(attribute, Attribute::Radius | Attribute::Density);
    match columns {
        [column] if single && matches!(shape, [] | [1]) && rows != 1 => {
            Table { rows, stride: 0, bytes: table.bytes, ..table }
        }
        _ => table,
    }
}

/// An archive.
struct Members<'a, R> {
    path: &'a Path,
    archive: ZipArchive<R>,
    /// Number in the archive and name of each array.
    arrays: Vec<(usize, String)>,
    /// Size of the file, bytes.
    packed: u64,
    /// For the unpacked members and the attributes read from them.
    budget: &'a Budget,
}

impl<'a, R: Read + Seek> Members<'a, R> {
    fn open(path: &'a Path, file: R, packed: u64, budget: &'a Budget) -> Result<Self> {
        let mut archive = ZipArchive::new(file)
            .map_err(|error| damaged(path, &format!("the zip archive is damaged: {error}")))?;
        let mut arrays = Vec::new();
        for index in 0..archive.len() {
            let name = match archive.by_index(index) {
                Ok(member) => String::from_utf8_lossy(member.name_raw()).into_owned(),
                Err(error) => return Err(damaged(path, &format!("member {index}: {error}"))),
            };
            if let Some(name) = name.strip_suffix(".npy") {
                arrays.push((index, name.to_owned()));
            }
        }
        Ok(Self { path, archive, arrays, packed, budget })
    }

    /// Reads the headers of all arrays; `None` for members without a valid one.
    fn headers(&mut self) -> Result<Vec<Option<Member>>> {
        /// Size that suffices for the header of any array of plain numbers, bytes.
        const MAX_HEADER: usize = 1 << 12;
        let count = self.arrays.len();
        let header = |at| {
            let path = self.display_path(at);
            let start = self.unpack(at, 0, MAX_HEADER)?;
            let mut file = Cursor::new(&path, &start, false);
            let header = Header::read(&mut file).ok();
            Ok(header.map(|header| Member { header, offset: file.offset }))
        };
        (0..count).map(header).collect()
    }

    /// The positions and attributes of a step.
    fn contents(
        &mut self,
        reading: &Reading<'_>,
        headers: &[Option<Member>],
        positions: &[usize],
        places: &Places,
        step: usize,
    ) -> Result<Contents> {
        let map = reading.map;
        let mut contents = match positions {
            &[at] => self.positions(headers, at, places, step)?,
            columns => {
                let (path, columns) = self.columns(headers, columns)?;
                let (table, columns) = Table::of_columns(&path, &columns)?;
                table.particles([columns[0], columns[1], columns[2]])?
            }
        };
        if map.has(Attribute::Position) {
            let shape = [contents.particles.len(), 3];
            contents.list(&self.names_of(positions), &shape, Some(Attribute::Position));
        }
        let velocities = find_velocities(map, &self.arrays, headers, places).unwrap_or_default();
        if !velocities.is_empty() {
            let (path, columns) = self.columns(headers, &velocities)?;
            let (table, columns) = Table::of_columns(&path, &columns)?;
            let (name, shape) = (self.names_of(&velocities), [table.rows, columns.len()]);
            for (&at, column) in velocities.iter().zip(&columns) {
                contents.keep(reading, &self.arrays[at].1, &table, &[*column])?;
            }
            contents.take_as(Some(Attribute::Velocity), &name, &shape, &table, &columns)?;
        }
        let used = |at: &usize| positions.contains(at) || velocities.contains(at);
        for at in (0..headers.len()).filter(|at| !used(at)) {
            let name = self.arrays[at].1.clone();
            let Some(Member { header, offset }) = &headers[at] else {
                contents.list(&name, &[], None);
                continue;
            };
            let (path, shape) = (self.display_path(at), header.grid.sizes.as_slice());
            // A single number is one row.
            let single = shape.is_empty().then(|| Grid { sizes: vec![1], ..header.grid.clone() });
            let grid = single.as_ref().unwrap_or(&header.grid);
            // The first array of an attribute is used, and no other is unpacked.
            let has = |attribute: Attribute| {
                super::attribute_names(&contents.particles).any(|has| has == attribute.name())
            };
            let attribute = map.attribute_of(&name).filter(|&attribute| !has(attribute));
            let axes = match attribute {
                Some(attribute) if header.plain => grid.attribute(attribute, places),
                None if header.plain && reading.keeps(&name) => grid.axes_of(1, places),
                None if header.plain && reading.shows_or_describes(&name) => grid.shown(places),
                _ => None,
            };
            let Some(axes) = axes else {
                if !is_time(&name, shape, places.steps) {
                    contents.pass_over(attribute, &name, shape);
                }
                continue;
            };
            let bytes = self.part(headers, at, grid, axes, step)?;
            let source = FileBytes { path: &path, bytes: &[], text: false };
            let start = offset.saturating_add(grid.part(axes, step).map_or(0, |part| part.start));
            let table = grid.table(axes, step, source, start, Cow::Borrowed(&bytes));
            let Some((table, columns)) = table else { continue };
            let vector = attribute.is_some_and(|attribute| attribute.width() == 3);
            let columns = if vector { places.vector(columns) } else { columns };
            let rows = contents.particles.len();
            let table = match attribute {
                Some(attribute) => broadcast(table, &columns, attribute, shape, rows),
                // Not a number for each particle.
                None if table.rows != rows => {
                    contents.list(&name, shape, None);
                    continue;
                }
                None => table,
            };
            self.count(reading.bytes_of(&name).saturating_mul(table.rows as u64), at)?;
            contents.keep(reading, &name, &table, &columns)?;
            contents.take_as(attribute, &name, shape, &table, &columns)?;
            contents.find_values(reading, &name, &table, &columns);
        }
        Ok(contents)
    }

    /// The positions of a step in an array.
    fn positions(
        &mut self,
        headers: &[Option<Member>],
        at: usize,
        places: &Places,
        step: usize,
    ) -> Result<Contents> {
        let Some(Member { header, offset }) = &headers[at] else { return Ok(Contents::default()) };
        let (path, grid) = (self.display_path(at), &header.grid);
        let bytes = self.part(headers, at, grid, places.axes, step)?;
        // The positions take no more memory than their array.
        self.count(bytes.len() as u64, at)?;
        let source = FileBytes { path: &path, bytes: &[], text: false };
        let start = offset.saturating_add(grid.part(places.axes, step).map_or(0, |p| p.start));
        let table = grid.table(places.axes, step, source, start, Cow::Borrowed(&bytes));
        let Some((table, columns)) = table else { return Ok(Contents::default()) };
        let Some(xyz) = places.coordinates(&columns) else { return Ok(Contents::default()) };
        let mut contents = table.particles(xyz)?;
        contents.remarks = places.remarks(&self.arrays[at].1, grid);
        Ok(contents)
    }

    /// The bytes of an array that a step needs.
    fn part(
        &mut self,
        headers: &[Option<Member>],
        at: usize,
        grid: &Grid,
        axes: Axes,
        step: usize,
    ) -> Result<Vec<u8>> {
        let offset = headers[at].as_ref().map_or(0, |member| member.offset);
        let part = grid.part(axes, step).unwrap_or(usize::MAX..usize::MAX);
        let from = offset.saturating_add(part.start);
        // To the end of the member, where its checksum is compared.
        let whole = Some(part.len()) == grid.bytes();
        let to = if whole { usize::MAX } else { offset.saturating_add(part.end) };
        let bytes = self.unpack(at, from, to)?;
        if whole && bytes.len() > part.len() {
            let left = bytes.len() - part.len();
            let problem = format!("{left} bytes follow the array");
            let end = offset.saturating_add(part.end) as u64;
            return Err(Error::malformed(&self.display_path(at), Location::Byte(end), problem));
        }
        if grid.bytes().is_none() || bytes.len() < part.len() {
            let (name, rows, size) = (&self.arrays[at].1, grid.rows(), grid.row_bytes());
            let left = bytes.len();
            let problem = format!("{name}: expected {rows} × {size} bytes, {left} are left");
            let location = Location::Byte(from as u64);
            return Err(Error::malformed(&self.display_path(at), location, problem));
        }
        Ok(bytes)
    }

    /// The numbers of some arrays of one number a particle, and their path for messages.
    fn columns(
        &mut self,
        headers: &[Option<Member>],
        which: &[usize],
    ) -> Result<(PathBuf, Vec<Vec<f64>>)> {
        let mut columns = Vec::new();
        for &at in which {
            let Some(Member { header, .. }) = &headers[at] else { continue };
            let (grid, all) = (&header.grid, Axes { steps: None, particles: 0, numbers: None });
            let bytes = self.part(headers, at, grid, all, 0)?;
            // Twice: as a column and in a table of all.
            let size = 2 * size_of::<f64>() as u64;
            self.count(size.saturating_mul(grid.rows() as u64), at)?;
            let numbers = bytes.chunks_exact(grid.scalar.size()).take(grid.rows());
            let numbers = numbers.map(|number| grid.scalar.number(number, grid.big_endian));
            columns.push(memory::collect(numbers, self.path.display())?);
        }
        let name = printable(self.names_of(which));
        Ok((format!("{} ({name})", self.path.display()).into(), columns))
    }

    /// The names of some arrays.
    fn names_of(&self, which: &[usize]) -> String {
        which.iter().map(|&at| self.arrays[at].1.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// The times of the steps, if there are as many in an array of such a name.
    fn times(&mut self, headers: &[Option<Member>], steps: usize) -> Vec<f64> {
        let is_time = |at: &usize| {
            let header = headers[*at].as_ref().map(|member| &member.header);
            let header = header.filter(|header| header.plain);
            header.is_some_and(|header| is_time(&self.arrays[*at].1, &header.grid.sizes, steps))
        };
        let found = (0..self.arrays.len()).find(is_time);
        let Some((at, member)) = found.and_then(|at| Some((at, headers[at].as_ref()?))) else {
            return Vec::new();
        };
        let (grid, offset) = (&member.header.grid, member.offset);
        let end = offset.saturating_add(grid.bytes().unwrap_or(usize::MAX));
        let bytes = self.unpack(at, offset, end).unwrap_or_default();
        let numbers = bytes.chunks_exact(grid.scalar.size());
        numbers.map(|bytes| grid.scalar.number(bytes, grid.big_endian)).collect()
    }

    /// Path of an array for messages.
    fn display_path(&self, at: usize) -> PathBuf {
        let name = printable(self.arrays[at].1.clone());
        format!("{} ({name}.npy)", self.path.display()).into()
    }

    /// Counts the bytes read from an array; fails beyond the limit.
    fn count(&mut self, bytes: u64, at: usize) -> Result<()> {
        self.budget.take(bytes, &self.display_path(at), Location::Byte(0))
    }

    /// Unpacks the bytes of an array from one offset to another, or as many as there are. The header, which
    /// begins at byte 0, is not counted, since it is not kept.
    fn unpack(&mut self, at: usize, from: usize, to: usize) -> Result<Vec<u8>> {
        let path = self.display_path(at);
        let fail = |unpacked: usize, problem: String| {
            let byte = (from as u64).saturating_add(unpacked as u64);
            Error::malformed(&path, Location::Byte(byte), problem)
        };
        let index = self.arrays[at].0;
        let left = self.budget.left();
        let limit = (to.saturating_sub(from) as u64).min(left.saturating_add(1));
        let mut unpacked;
        let result = {
            let mut member = self.archive.by_index(index);
            let size = member.as_ref().map_or(0, |member| member.size());
            // The stated size may be wrong, but is bounded by the ratio of deflate.
            let claim = size.min(self.packed.saturating_mul(DEFLATE_RATIO)).min(limit);
            unpacked = memory::reserve(usize::try_from(claim).unwrap_or(0), path.display())?;
            // A part of what is stored is read alone; otherwise what is before it is unpacked, and all is checked.
            let stored =
                member.as_ref().is_ok_and(|m| m.compression() == CompressionMethod::Stored);
            if stored && from > 0 && to != usize::MAX {
                drop(member);
                let member = self.archive.by_index_seek(index);
                member.map_err(io::Error::other).and_then(|mut member| {
                    member.seek(SeekFrom::Start(from as u64))?;
                    member.take(limit).read_to_end(&mut unpacked)
                })
            } else {
                let member = member.as_mut();
                let member =
                    member.map_err(|error| fail(0, format!("cannot be unpacked: {error}")))?;
                let mut before = member.by_ref().take(from as u64);
                let skipped = io::copy(&mut before, &mut io::sink());
                skipped.and_then(|_| member.take(limit).read_to_end(&mut unpacked))
            }
        };
        if let Err(error) = result {
            if error.kind() == io::ErrorKind::OutOfMemory {
                return Err(Error::io(&path, "unpack", error));
            }
            return Err(fail(
                unpacked.len(),
                format!("the archive is damaged or cut off: {error}"),
            ));
        }
        let found = unpacked.len() as u64;
        if found > left {
            return Err(self.budget.exceeded(&path, Location::Byte(found - 1)));
        }
        if from > 0 {
            self.budget.take(found, &path, Location::Byte(0))?;
        }
        Ok(unpacked)
    }
}

fn damaged(path: &Path, problem: &str) -> Error {
    Error::malformed(path, Location::Byte(0), problem)
}

/// Writes the positions and all attributes without compression, since deflate saves little on floats.
pub(super) fn write(
    particles: &Particles,
    others: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    let n = particles.len();
    // Members of more than 4 GiB need a zip64 header, which is written first.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(n >= u32::MAX as usize / size_of::<[f64; 3]>());
    let mut archive = ZipWriter::new_stream(out);
    archive.start_file("positions.npy", options)?;
    npy::write_positions(particles, &mut archive)?;
    for (name, values) in super::with_others(particles, others) {
        archive.start_file(format!("{name}.npy"), options)?;
        match values {
            Values::Integers(ids) => {
                npy::write_header("<i8", n, 1, &mut archive)?;
                write_numbers(ids, i64::to_le_bytes, &mut archive)?;
            }
            _ => {
                npy::write_header("<f4", n, values.size(), &mut archive)?;
                write_numbers(values.floats(), f32::to_le_bytes, &mut archive)?;
            }
        }
    }
    archive.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// A small archive that unpacks to a huge one is refused at the limit.
    #[test]
    fn unpacking_stops_at_the_limit() {
        let mut zip = ZipWriter::new(io::Cursor::new(Vec::new()));
        zip.start_file("a.npy", SimpleFileOptions::default()).unwrap();
        zip.write_all(&[0; 1000]).unwrap();
        let bytes = zip.finish().unwrap().into_inner();
        let unpack = |limit| {
            let (path, file) = (Path::new("bomb.npz"), io::Cursor::new(&bytes[..]));
            let (length, budget) = (bytes.len() as u64, Budget::new(Some(limit)));
            Members::open(path, file, length, &budget).unwrap().unpack(0, 0, usize::MAX)
        };
        assert_eq!(unpack(1000).unwrap().len(), 1000);
        let error = unpack(999).unwrap_err().to_string();
        assert!(error.contains("bomb.npz") && error.contains("more than 999 bytes"), "{error}");
    }
}
