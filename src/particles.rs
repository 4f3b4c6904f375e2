//! One frame of particles, and the readers of the file formats that hold them.
//!
//! Each format has a file of its own. What they share is at the end of this one: a `Cursor`
//! that never leaves the file, and a `Table` that turns records of any layout into attributes.
//! A count in a header is a claim, not a length: it is held against the bytes that are left
//! before anything is allocated.

mod between;
mod bgeo;
mod npy;
mod ply;
mod vtk;
mod xyz;

use std::borrow::Cow;
use std::path::Path;

use flate2::{Compression, write::GzEncoder};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Place, Result};
use crate::output;

/// One frame of particles, structure of arrays: every attribute that is present has one entry
/// per particle. Whatever [`Particles::read`] returns is finite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Particles {
    /// The point that positions are counted from, in metres. 0 for files of 32-bit floats; for
    /// those of more digits see [`Particles::from_places`].
    pub origin: DVec3,
    /// Centres, in metres, from the origin.
    pub positions: Vec<Vec3>,
    /// Velocities, in metres per second.
    pub velocities: Option<Vec<Vec3>>,
    /// Mass densities, in kg/m³.
    pub densities: Option<Vec<f32>>,
    /// Particle radii, in metres (`pscale`, `radius`), none negative.
    pub radii: Option<Vec<f32>>,
    /// Identities that persist between frames.
    pub ids: Option<Vec<i64>>,
    /// Which of a scene's fluids each belongs to, from 0; of one fluid, none.
    pub fluids: Option<Vec<u8>>,
}

/// The axis that points up in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// As in limpid, Houdini and most simulators.
    #[default]
    Y,
    /// As in Blender and CAD.
    Z,
}

impl Particles {
    /// Reads one frame. The extension names the format, and the contents must confirm it:
    ///
    /// | extension | format |
    /// |---|---|
    /// | `.bgeo`, `.bgeo.gz`, `.bhclassic` | Houdini's classic geometry, version 5, plain or gzip |
    /// | `.vtk` | legacy VTK up to 5.1, binary or ASCII: unstructured grids and polygonal data |
    /// | `.ply` | the `vertex` element, ASCII or binary of either byte order |
    /// | `.npy` | one array of numpy, shape (n, 3), 32- or 64-bit floats: positions |
    /// | `.xyz` | positions: raw little-endian 32-bit floats, or text with one particle a line |
    ///
    /// Attributes go by the names that simulators write, in any case: `velocity`, `velocities`,
    /// `vel`, `v`; `density`, `rho`, `rhop`; `radius`, `radii`, `pscale`; `id`, `ids`, `idp`. The
    /// first of several wins; all others are skipped.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it is of another kind, and
    /// [`Error::Malformed`] if it contradicts itself or holds a value that is not finite.
    pub fn read(path: &Path) -> Result<Self> {
        let reader = reader_for(path)?;
        let bytes = std::fs::read(path).map_err(|source| Error::io(path, "read", source))?;
        reader(path, &bytes)
    }

    /// Like [`Particles::read`], with the contents at hand; `path` gives the format and stands in
    /// messages.
    ///
    /// # Errors
    ///
    /// As [`Particles::read`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        reader_for(path)?(path, bytes)
    }

    /// Writes one frame, whole or not at all, in the format that the extension names: `.bgeo` and
    /// `.bgeo.gz` are gzip, as simulators write them, `.bhclassic` is not.
    ///
    /// # Errors
    /// [`Error::Format`] for a format that limpid does not write, [`Error::Io`] if the file cannot
    /// be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let plain = name.ends_with(".bhclassic");
        if !(plain || name.ends_with(".bgeo") || name.ends_with(".bgeo.gz")) {
            let written = ".bgeo, .bgeo.gz, .bhclassic";
            return Err(Error::format(path, format!("can be written: {written}")));
        }
        output::write_atomically(path, |file| {
            if plain {
                return bgeo::write(self, file);
            }
            let mut gzip = GzEncoder::new(file, Compression::fast());
            bgeo::write(self, &mut gzip)?;
            gzip.finish().map(drop)
        })
    }

    /// Particles without other attributes, counted from 0.
    pub fn from_positions(positions: Vec<Vec3>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Particles without other attributes. They are counted from 0, or where 32-bit floats would
    /// lose digits by that from the middle of the box around them: where it is farther from 0 than
    /// 16 times its longest side.
    pub fn from_places(places: &[DVec3]) -> Self {
        let origin = origin_for(places.iter().copied());
        let positions = places.iter().map(|&place| (place - origin).as_vec3()).collect();
        Self { origin, positions, ..Self::default() }
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none, as in the first frames of many emitters.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The least and the greatest corner of the box around all centres, if there are any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let places = self.positions.iter().map(|&position| self.origin + position.as_dvec3());
        bounds(places)
    }

    /// Turns positions and velocities of a file with this `up` axis to limpid's, which is y:
    /// a quarter turn about x, so handedness is kept.
    pub fn to_y_up(&mut self, up: Up) {
        if up == Up::Z {
            self.origin = DVec3::new(self.origin.x, self.origin.z, -self.origin.y);
            for v in self.positions.iter_mut().chain(self.velocities.iter_mut().flatten()) {
                *v = Vec3::new(v.x, v.z, -v.y);
            }
        }
    }

    /// Keeps the attribute `name` if limpid knows it and does not have it yet.
    fn attach(&mut self, name: &str, table: &Table<'_>, columns: &[Column]) -> Result<()> {
        match (name.to_ascii_lowercase().as_str(), columns) {
            ("velocity" | "velocities" | "vel" | "v", &[x, y, z]) if self.velocities.is_none() => {
                self.check_rows(name, table)?;
                self.velocities = Some(table.floats([x, y, z], "velocity", Vec3::from_array)?);
            }
            ("density" | "rho" | "rhop", &[column]) if self.densities.is_none() => {
                self.check_rows(name, table)?;
                self.densities = Some(table.floats([column], "density", |[rho]| rho)?);
            }
            ("radius" | "radii" | "pscale", &[column]) if self.radii.is_none() => {
                self.check_rows(name, table)?;
                let radii = table.floats([column], "radius", |[r]| r)?;
                if let Some(i) = radii.iter().position(|&r| r < 0.0) {
                    let problem = format!("particle {i}: radius {}, 0 or more expected", radii[i]);
                    return Err(table.error(i, column, problem));
                }
                self.radii = Some(radii);
            }
            ("id" | "ids" | "idp", &[column]) if self.ids.is_none() => {
                self.check_rows(name, table)?;
                self.ids = Some(table.integers(column, "id")?);
            }
            _ => {}
        }
        Ok(())
    }

    fn check_rows(&self, name: &str, table: &Table<'_>) -> Result<()> {
        let (rows, particles) = (table.rows().len(), self.len());
        if rows == particles {
            return Ok(());
        }
        let problem = format!("attribute {name} has {rows} entries for {particles} particles");
        Err(table.source.error(table.start, problem))
    }
}

/// The corners of the box around all places, if there are any.
pub(crate) fn bounds(mut places: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    let first = places.next()?;
    Some(places.fold((first, first), |(min, max), p| (min.min(p), max.max(p))))
}

/// The point from which 32-bit floats keep enough digits of all places: 0 if it does, so that
/// ordinary files stay as they are.
pub(crate) fn origin_for(places: impl Iterator<Item = DVec3>) -> DVec3 {
    /// So many sizes from 0, floats resolve 1e-6 of the size.
    const FAR: f64 = 16.0;
    let Some((min, max)) = bounds(places) else { return DVec3::ZERO };
    let middle = 0.5 * (min + max);
    let far = middle.abs().max_element() > FAR * (max - min).max_element();
    if far { middle } else { DVec3::ZERO }
}

type Reader = fn(&Path, &[u8]) -> Result<Particles>;

const FORMATS: [(&str, Reader); 7] = [
    (".bgeo", bgeo::read),
    (".bgeo.gz", bgeo::read),
    (".bhclassic", bgeo::read),
    (".vtk", vtk::read),
    (".ply", ply::read),
    (".npy", npy::read),
    (".xyz", xyz::read),
];

/// The extensions that can be read, as a list for messages.
pub(crate) fn extensions() -> String {
    FORMATS.map(|(extension, _)| extension).join(", ")
}

/// A file name without its extension, if that is one of a format that can be read.
pub(crate) fn readable_stem(name: &str) -> Option<&str> {
    format_of(name).map(|(stem, _)| stem)
}

fn format_of(name: &str) -> Option<(&str, Reader)> {
    FORMATS.iter().find_map(|&(extension, reader)| {
        let (stem, end) = name.split_at_checked(name.len().checked_sub(extension.len())?)?;
        end.eq_ignore_ascii_case(extension).then_some((stem, reader))
    })
}

fn reader_for(path: &Path) -> Result<Reader> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    format_of(&name).map(|(_, reader)| reader).ok_or_else(|| unknown_kind(path, &name))
}

fn unknown_kind(path: &Path, name: &str) -> Error {
    let remedies = [
        (".sc", "a Blosc-compressed file of Houdini: unpack it with `hsc -d`, save as .bhclassic"),
        (".vtu", "VTK's XML format, not a legacy VTK file: save it as .vtk"),
        (".vtp", "VTK's XML format, not a legacy VTK file: save it as .vtk"),
        (".npz", "an archive of NumPy arrays: save the positions alone with `numpy.save`"),
        (".abc", "Alembic: export the points as .bgeo or .ply"),
        (".vdb", "OpenVDB: export the points as .bgeo or .ply"),
    ];
    let name = name.to_ascii_lowercase();
    let remedy = remedies.iter().find(|(extension, _)| name.ends_with(extension));
    let kind = remedy.map_or("a kind of file that limpid does not know", |(_, remedy)| remedy);
    Error::format(path, format!("{kind}; can be read: {}", extensions()))
}

/// Says what a file that lacks the magic of its format looks like instead.
fn foreign(path: &Path, bytes: &[u8], expected: &str) -> Error {
    let found = match known_magic(bytes) {
        Some(kind) => kind,
        None if bytes.is_empty() => "an empty file",
        None => "an unknown kind of file",
    };
    Error::format(path, format!("this is {found}, not {expected}"))
}

fn known_magic(bytes: &[u8]) -> Option<&'static str> {
    // At least four bytes each: two could well begin a float of an .xyz file.
    const MAGIC: [(&[u8], &str); 16] = [
        (b"\x7fNSJ", "Houdini's new geometry format (save as .bhclassic)"),
        (b"BgeoV", "a BGEO file"),
        (b"\x1f\x8b\x08\x00", "gzip data (unpack it first)"),
        (b"\x1f\x8b\x08\x08", "gzip data (unpack it first)"),
        (b"# vtk DataFile", "a legacy VTK file"),
        (b"<?xml", "XML, perhaps VTK's (save as legacy .vtk)"),
        (b"<VTKFile", "VTK's XML format (save as legacy .vtk)"),
        (b"ply\n", "a PLY file"),
        (b"ply\r\n", "a PLY file"),
        (b"\x93NUMPY", "a NumPy array"),
        (b"PK\x03\x04", "a zip or npz archive (unpack it first)"),
        (b"solid ", "an STL mesh, which holds triangles"),
        (b"\x89HDF", "an HDF5 file"),
        (b"Ogawa", "an Alembic file"),
        (b"\x89PNG", "a PNG picture"),
        (b"\x76\x2f\x31\x01", "an OpenEXR picture"),
    ];
    // Binary STL has no magic, but its length follows from its count of triangles.
    let triangles = bytes.get(80..).and_then(|rest| rest.first_chunk());
    let stl = triangles.map(|&count| 84 + 50 * u64::from(u32::from_le_bytes(count)));
    if stl == Some(bytes.len() as u64) {
        return Some("a binary STL mesh, which holds triangles");
    }
    MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|&(_, kind)| kind)
}

/// The bytes of a file, and how its places are told in messages.
#[derive(Clone, Copy)]
struct Source<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    /// Name lines rather than bytes.
    text: bool,
}

impl Source<'_> {
    fn error(&self, offset: usize, problem: impl Into<String>) -> Error {
        let place = if self.text {
            let before = self.bytes.get(..offset).unwrap_or(self.bytes);
            Place::Line(1 + before.iter().filter(|&&byte| byte == b'\n').count() as u64)
        } else {
            Place::Byte(offset as u64)
        };
        Error::malformed(self.path, place, problem)
    }
}

/// Reads a file from front to end and never beyond.
struct Cursor<'a> {
    source: Source<'a>,
    offset: usize,
    /// Where the latest read began: the place that `Cursor::error` names.
    start: usize,
}

impl<'a> Cursor<'a> {
    fn new(path: &'a Path, bytes: &'a [u8], text: bool) -> Self {
        Self { source: Source { path, bytes, text }, offset: 0, start: 0 }
    }

    fn error(&self, problem: impl Into<String>) -> Error {
        self.source.error(self.start, problem)
    }

    fn rest(&self) -> &'a [u8] {
        self.source.bytes.get(self.offset..).unwrap_or_default()
    }

    fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8]> {
        self.take_records(1, length, what)
    }

    /// `rows` records of `stride` bytes.
    fn take_records(&mut self, rows: usize, stride: usize, what: &str) -> Result<&'a [u8]> {
        self.start = self.offset;
        let rest = self.rest();
        match rows.checked_mul(stride).and_then(|length| rest.get(..length)) {
            Some(taken) => {
                self.offset += taken.len();
                Ok(taken)
            }
            None => Err(self.error(format!(
                "{what}: {rows} × {stride} bytes expected, {} are left",
                rest.len()
            ))),
        }
    }

    /// `rows` records of `stride` bytes as a table.
    fn table(
        &mut self,
        rows: usize,
        stride: usize,
        big_endian: bool,
        what: &str,
    ) -> Result<Table<'a>> {
        let bytes = Cow::Borrowed(self.take_records(rows, stride, what)?);
        Ok(Table {
            source: self.source,
            start: self.start,
            bytes,
            stride,
            big_endian,
            starts: None,
        })
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let bytes = self.take(N, what)?;
        bytes.try_into().map_err(|_| self.error(what))
    }

    /// The next line without its end, or `None` at the end of the file.
    fn line(&mut self) -> Option<Cow<'a, str>> {
        self.start = self.offset;
        let rest = self.rest();
        let line = rest.split(|&byte| byte == b'\n').next().filter(|_| !rest.is_empty())?;
        self.offset += (line.len() + 1).min(rest.len());
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// The next line that is not blank.
    fn filled_line(&mut self) -> Option<Cow<'a, str>> {
        loop {
            let line = self.line()?;
            if !line.trim_ascii().is_empty() {
                return Some(line);
            }
        }
    }

    /// The next word between white space.
    fn word(&mut self) -> Option<Cow<'a, str>> {
        let rest = self.rest();
        self.start = self.offset + rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let word = self.source.bytes.get(self.start..)?;
        let word = word.split(u8::is_ascii_whitespace).next()?;
        self.offset = self.start + word.len();
        Some(String::from_utf8_lossy(word))
    }

    /// A number of a header that counts something.
    fn count(&self, word: Option<&str>, what: &str) -> Result<usize> {
        let word = word.unwrap_or("nothing");
        word.parse().map_err(|_| self.error(format!("{what}: a count expected, found `{word}`")))
    }

    fn number(&self, word: &str) -> Result<f64> {
        word.parse().map_err(|_| self.error(format!("a number expected, found `{word}`")))
    }
}

/// The types of number that files hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// One number of each record: where it is, counted from the record's start, and its type.
#[derive(Clone, Copy, Debug)]
struct Column {
    offset: usize,
    scalar: Scalar,
}

impl Column {
    /// `count` numbers one after another.
    fn adjacent(offset: usize, count: usize, scalar: Scalar) -> Vec<Self> {
        (0..count).map(|k| Self { offset: offset + k * scalar.size(), scalar }).collect()
    }

    /// Three of them at the start of the record.
    fn triple(scalar: Scalar) -> [Self; 3] {
        [0, 1, 2].map(|k| Self { offset: k * scalar.size(), scalar })
    }

    /// The number's bytes. Readers derive a table's stride from its columns, so they are there;
    /// if not, the number is 0.
    fn bytes<const N: usize>(self, record: &[u8]) -> [u8; N] {
        record.get(self.offset..).and_then(|rest| rest.first_chunk()).map_or([0; N], |b| *b)
    }

    /// The number as the nearest f64.
    fn number(self, record: &[u8], big_endian: bool) -> f64 {
        macro_rules! number {
            ($type:ty) => {
                if big_endian {
                    <$type>::from_be_bytes(self.bytes(record)) as f64
                } else {
                    <$type>::from_le_bytes(self.bytes(record)) as f64
                }
            };
        }
        match self.scalar {
            Scalar::I8 => number!(i8),
            Scalar::U8 => number!(u8),
            Scalar::I16 => number!(i16),
            Scalar::U16 => number!(u16),
            Scalar::I32 => number!(i32),
            Scalar::U32 => number!(u32),
            Scalar::I64 => number!(i64),
            Scalar::U64 => number!(u64),
            Scalar::F32 => number!(f32),
            Scalar::F64 => number!(f64),
        }
    }

    /// The number if it is an integer, and exact.
    fn integer(self, record: &[u8], big_endian: bool) -> Option<i64> {
        const EXACT: f64 = 9_007_199_254_740_992.0; // 2⁵³
        match (self.scalar, big_endian) {
            (Scalar::I64, true) => Some(i64::from_be_bytes(self.bytes(record))),
            (Scalar::I64, false) => Some(i64::from_le_bytes(self.bytes(record))),
            (Scalar::U64, true) => u64::from_be_bytes(self.bytes(record)).try_into().ok(),
            (Scalar::U64, false) => u64::from_le_bytes(self.bytes(record)).try_into().ok(),
            _ => {
                let number = self.number(record, big_endian);
                (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
            }
        }
    }
}

/// Records of one size, one a particle. Text is first rewritten as binary f64, so that one
/// decoder serves all formats.
struct Table<'a> {
    source: Source<'a>,
    /// Where the table begins in the file.
    start: usize,
    bytes: Cow<'a, [u8]>,
    stride: usize,
    big_endian: bool,
    /// Where each record begins in the file, if not every `stride` bytes.
    starts: Option<Vec<usize>>,
}

impl Table<'_> {
    fn rows(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        self.bytes.chunks_exact(self.stride.max(1))
    }

    fn error(&self, row: usize, column: Column, problem: String) -> Error {
        let offset = match &self.starts {
            Some(starts) => starts.get(row).copied().unwrap_or(self.start),
            None => self.start + row * self.stride + column.offset,
        };
        self.source.error(offset, problem)
    }

    /// Particles at the positions that `columns` hold.
    fn particles(&self, columns: [Column; 3]) -> Result<Particles> {
        if columns.iter().all(|column| column.scalar == Scalar::F32) {
            return Ok(Particles::from_positions(self.floats(
                columns,
                "position",
                Vec3::from_array,
            )?));
        }
        Ok(Particles::from_places(&self.numbers(columns, "position", DVec3::from_array)?))
    }

    /// The numbers of `columns` as 32-bit floats, all of them finite, record by record.
    fn floats<const N: usize, T>(
        &self,
        columns: [Column; N],
        name: &str,
        build: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>> {
        self.numbers(columns, name, |numbers| build(numbers.map(|number| number as f32)))
    }

    /// The numbers of `columns`, all of them finite as 32-bit floats, record by record.
    fn numbers<const N: usize, T>(
        &self,
        columns: [Column; N],
        name: &str,
        build: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>> {
        let single = columns.iter().all(|column| column.scalar == Scalar::F32);
        let (values, bad) =
            match (single, self.big_endian) {
                (true, true) => self
                    .decode(build, |row| columns.map(|c| f32::from_be_bytes(c.bytes(row)).into())),
                (true, false) => self
                    .decode(build, |row| columns.map(|c| f32::from_le_bytes(c.bytes(row)).into())),
                (false, big) => self.decode(build, |row| columns.map(|c| c.number(row, big))),
            };
        let Some((row, numbers)) = bad else { return Ok(values) };
        let numbers = numbers.map(|number| number as f32);
        let worst = columns.into_iter().zip(numbers).find(|(_, number)| !number.is_finite());
        let column = worst.map_or(Column { offset: 0, scalar: Scalar::F32 }, |(column, _)| column);
        let problem = format!("particle {row}: {name} {numbers:?}, finite numbers expected");
        Err(self.error(row, column, problem))
    }

    /// All records, and the first that is not finite.
    fn decode<const N: usize, T>(
        &self,
        build: impl Fn([f64; N]) -> T,
        numbers: impl Fn(&[u8]) -> [f64; N],
    ) -> (Vec<T>, Option<(usize, [f64; N])>) {
        let mut bad = None;
        let values = self.rows().enumerate().map(|(row, record)| {
            let numbers = numbers(record);
            if bad.is_none() && !numbers.iter().all(|&number| (number as f32).is_finite()) {
                bad = Some((row, numbers));
            }
            build(numbers)
        });
        (values.collect(), bad)
    }

    fn integers(&self, column: Column, name: &str) -> Result<Vec<i64>> {
        let rows = self.rows().enumerate().map(|(row, record)| {
            column.integer(record, self.big_endian).ok_or_else(|| {
                let number = column.number(record, self.big_endian);
                let problem = format!("particle {row}: {name} {number}, a 64-bit integer expected");
                self.error(row, column, problem)
            })
        });
        rows.collect()
    }
}
