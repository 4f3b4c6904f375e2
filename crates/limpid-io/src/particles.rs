//! Readers and writers of particle files, each with one frame of particles.
//!
//! Each format has its own module. They share a `Cursor`, which never reads beyond the file, and a
//! `Table`, which decodes records of any layout to attributes. Counts in headers are checked against the
//! remaining bytes before anything is allocated.

mod arrays;
mod attribute_map;
mod axes;
pub mod bgeo;
mod bi4;
mod by_content;
mod csv;
pub(crate) mod cursor;
mod diffuse;
mod extxyz;
mod foam;
mod hdf5;
mod houdini;
mod kinds;
mod labelled;
mod lammps;
mod npy;
mod npz;
pub(crate) mod pieces;
pub(crate) mod ply;
mod pos;
mod prt;
mod reading;
mod remark;
mod scf;
mod selection;
pub(crate) mod shown;
pub(crate) mod table;
pub(crate) mod trajectory;
mod uni;
mod usable;
mod values;
mod vtk;
mod vtu;
mod xyz;

use std::cell::Cell;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::liquid::{Ellipsoid, Particles};
use serde::{Deserialize, Serialize};

use self::arrays::MOST_LISTED;
use self::cursor::{Cursor, FileBytes};
use self::table::{Column, Scalar, Table};
use self::values::{Others, Values, attributes, narrow_id, too_large, with_others, write_numbers};
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::files::File as InputFile;
use crate::output::FileKind;
use crate::{files, output};

use self::by_content::Found;
pub(crate) use self::by_content::{is_particles, particles_in};
use self::kinds::{known_magic, stl_length};

use self::reading::Reading;
pub use arrays::{Array, Contents};
pub use attribute_map::AttributeMap;
pub(crate) use diffuse::{into_diffuse, reading_diffuse};
pub use diffuse::{read_diffuse, write_diffuse};
pub use remark::{Remark, Unit};
pub use selection::{Condition, Selection};
pub use trajectory::Section;

/// An attribute of particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Attribute {
    /// [`Particles::positions`].
    Position,
    /// [`Particles::velocities`].
    Velocity,
    /// [`Particles::densities`].
    Density,
    /// [`Particles::radii`].
    Radius,
    /// [`Particles::ids`].
    Id,
    /// [`Particles::ellipsoids`].
    Ellipsoid,
}

impl Attribute {
    const ALL: [Self; 6] =
        [Self::Position, Self::Velocity, Self::Density, Self::Radius, Self::Id, Self::Ellipsoid];

    /// The name that limpid writes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Density => "density",
            Self::Radius => "radius",
            Self::Id => "id",
            Self::Ellipsoid => "ellipsoid",
        }
    }

    /// The attribute, other than positions, for which simulators use this name, in any case.
    fn from_alias(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "velocity" | "velocities" | "vel" | "v" => Self::Velocity,
            "density" | "densities" | "rho" | "rhop" => Self::Density,
            "radius" | "radii" | "pscale" => Self::Radius,
            "id" | "ids" | "idp" | "idpd" | "particleids" => Self::Id,
            "ellipsoid" => Self::Ellipsoid,
            _ => return None,
        })
    }

    /// Whether it can be read from an array with this number of numbers per particle. Velocities of two are those
    /// of simulations in two dimensions.
    fn takes(self, width: usize) -> bool {
        width == self.width() || (self, width) == (Self::Velocity, 2)
    }

    /// Number of numbers per particle.
    fn width(self) -> usize {
        match self {
            Self::Position | Self::Velocity => 3,
            Self::Density | Self::Radius | Self::Id => 1,
            Self::Ellipsoid => 6,
        }
    }

    /// Memory of the attribute per particle, bytes.
    fn bytes(self) -> u64 {
        let bytes = match self {
            Self::Position | Self::Velocity => size_of::<Vec3>(),
            Self::Density | Self::Radius => size_of::<f32>(),
            Self::Id => size_of::<i64>(),
            Self::Ellipsoid => size_of::<Ellipsoid>(),
        };
        bytes as u64
    }

    /// Lists all names for messages.
    fn list() -> String {
        Self::ALL.map(Self::name).join(", ")
    }
}

impl fmt::Display for Attribute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Options for reading particle files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Limit of a frame's unpacked size, bytes, since a small compressed file can claim any amount of memory: of a
    /// file, or of all files that it lists or that hold the ranks of a frame, together. By default 100 times
    /// their length, but at least 1 GiB and at most 16 GiB.
    pub max_unpacked: Option<u64>,
    /// The arrays of attributes with other than the usual names.
    pub map: AttributeMap,
    /// Leave out particles without a finite position however many they are. By default a file of which
    /// they are more than half is taken to be damaged.
    pub skip_invalid: bool,
    /// Which particles are read.
    pub select: Selection,
    /// Describe the arrays: [`Array::spread`], and [`Array::values`] of those of integers that have few.
    pub values: bool,
    /// An attribute to be shown in colours, whatever its name; case does not matter. It is read to
    /// [`Particles::values`], and `color` to [`Particles::colors`]: bytes as sRGB, floats as linear. A file without it is
    /// an error.
    pub shown: Option<String>,
    /// Arrays of one number a particle, in lower case, whose numbers are kept beside the attributes, as those of
    /// [`read_diffuse`].
    pub columns: &'static [&'static str],
}

/// Reads one frame. The extension selects the format, which the contents must match; files with another one, as
/// `dump.melt.1500` or `.txt`, have the format that their beginning shows. Each may be compressed by gzip, with a
/// `.gz` after the extension.
///
/// | extension | format | [written](write()) with |
/// |---|---|---|
/// | `.bgeo`, `.bgeo.gz`, `.bhclassic` | Houdini's classic geometry, version 5, plain or gzip | all, 32-bit positions and ids |
/// | `.bgeo`, `.bgeo.gz`, `.bgeo.sc`, `.geo` | Houdini's geometry since version 12, JSON in binary or text, plain, gzip or Blosc | not written |
/// | `.vtk` | legacy VTK up to 5.1, binary or ASCII: unstructured grids and polygonal data | all |
/// | `.vtu` | VTK's XML, unstructured grids: ASCII, base64 or raw, zlib, LZ4, LZMA or none, in pieces | all |
/// | `.vtp` | the same, polygonal data | not written |
/// | `.pvtu`, `.pvtp`, `.vtm` | the `.vtu`, `.vtp` and `.vtk` files that they list, as one | not written |
/// | `.ply` | the `vertex` element, ASCII or binary of either byte order | all, 32-bit ids |
/// | `.npy` | one array of numpy, shape (n, 3), 32- or 64-bit floats: positions | positions |
/// | `.npz` | an archive of such arrays, stored or deflated | all |
/// | `.xyz` | positions: raw little-endian 32-bit floats, or text with one particle a line | positions, 32-bit |
/// | `.xyz`, `.extxyz` | extended XYZ of OVITO and ASE, and element and position per line, with the count first | not written |
/// | `.lammpstrj`, `.dump` | LAMMPS dumps, text | not written |
/// | `.h5`, `.hdf5`, `.vtkhdf`, `.vtkhdf5` | HDF5 of SWIFT and Gadget (`PartType0`), `PySPH` and VTK, or with arrays as in `.npz` | not written |
/// | `.pos` | Truong and Yuksel's frames: positions and one radius; ellipsoids from the `.ani` beside it | positions, 32-bit; one radius; ellipsoids |
/// | `.csv` | text with one particle per line, columns named or x, y, z | all |
/// | `.bi4` | DualSPHysics' frames: the fluid; half of the spacing as the radius | not written |
/// | `.prt` | Krakatoa's particles | not written |
/// | `.uni` | mantaflow's particles: positions, in cells | not written |
/// | none: `positions` | OpenFOAM's parcels in text, with `U`, `d`, `rho` and `origId` beside them | not written |
///
/// Of files with several frames [`Frame::read`](crate::sequence::Frame::read) reads one at a time.
///
/// Attributes have the usual names of simulators, in any case: `velocity`, `velocities`, `vel`, `v`;
/// `density`, `densities`, `rho`, `rhop`; `radius`, `radii`, `pscale`; `id`, `ids`, `idp`, `ParticleIDs`; and
/// `ellipsoid`, with the
/// six numbers of [`Ellipsoid`]. The first of several is used, and all other arrays are ignored
/// ([`Contents::arrays`] lists them). The format determines the positions; in `.npz` they are called
/// `positions`, `position`, `pos`, `x`, `points`, `coordinates` or `arr_0`, or are the only array of shape (n, 3); in
/// `.csv` the columns are `x`, `px`, `Points:0`, `Points_0`, `Pos.x` and so on.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read, [`Error::Format`] if it has another format,
/// [`Error::Malformed`] if it violates its format, and [`Error::Unplaced`] if more than half of its
/// particles have no finite position; fewer are left out.
pub fn read(path: &Path) -> Result<Particles> {
    Contents::read(path, &ReadOptions::default()).map(|contents| contents.particles)
}

/// Like [`read()`], for contents in memory; `path` selects the format and appears in messages. No
/// accompanying file is read.
///
/// # Errors
///
/// As [`read()`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Particles> {
    Contents::parse(path, bytes, &ReadOptions::default()).map(|contents| contents.particles)
}

/// Writes one frame atomically in the format of the extension; see [`read()`]. Attributes that the
/// format can store are read back bit-exactly; [`unsupported_attributes`] lists the others. `.bgeo` and `.bgeo.gz` are
/// compressed by gzip, as simulators write them, `.bhclassic` is not. Positions with an
/// [origin](Particles::origin) are written as 64-bit floats if the format has them.
///
/// The ellipsoids of a `.pos` are written to the `.ani` beside it; without ellipsoids an existing
/// `.ani` is removed.
///
/// # Errors
/// [`Error::Format`] for a format that limpid does not write, [`Error::Io`] if the file cannot be
/// written, or if the format cannot store the number of particles or an id.
pub fn write(particles: &Particles, path: &Path) -> Result<()> {
    let (format, write) = writable(path)?;
    FILE_KIND.check(path)?;
    if format.extension == ".pos" {
        pos::write_ellipsoids(particles, path)?;
    }
    output::write_atomically(path, FILE_KIND, |file| write(particles, &[], file))
}

/// Lists properties of these particles that the format of this name cannot store: names of attributes, and
/// `64-bit places`.
///
/// # Errors
/// [`Error::Format`] for a format that limpid does not write.
pub fn unsupported_attributes(particles: &Particles, path: &Path) -> Result<Vec<&'static str>> {
    let (format, _) = writable(path)?;
    let names = attributes(particles).into_iter().map(|(name, _)| name);
    let mut lost: Vec<_> = names.filter(|name| !format.holds.contains(name)).collect();
    if format.extension == ".pos" && pos::common_radius(particles).is_none() {
        lost.push("radii that differ");
    }
    if !format.wide && particles.origin != DVec3::ZERO {
        lost.push("64-bit places");
    }
    Ok(lost)
}

/// Names of the present attributes, in the order in which they are written.
pub fn attribute_names(particles: &Particles) -> impl Iterator<Item = &'static str> {
    attributes(particles).into_iter().map(|(name, _)| name)
}

impl Contents {
    /// As [`read()`], with the list of all arrays, and remarks on contents that could not be used.
    ///
    /// # Errors
    ///
    /// As [`read()`]; [`Error::TooLarge`] for a file beyond the limit of its unpacked size, and
    /// [`Error::Format`] if an array of the attribute map is missing.
    pub fn read(path: &Path, options: &ReadOptions) -> Result<Self> {
        Self::read_within(path, options, &Budget::new(options.max_unpacked))
    }

    /// As [`Contents::read`], for a file of the document with this budget.
    pub(crate) fn read_within(path: &Path, options: &ReadOptions, budget: &Budget) -> Result<Self> {
        let Found { format, gzip } = by_content::of_file(path)?;
        let (file, metadata) = files::open(path)?;
        budget.add_file(path, metadata.len());
        let used = budget.used();
        if used > 0 && metadata.len() > budget.left() {
            return Err(budget.exceeded(path, Location::Byte(0)));
        }
        let raw = match format.extension {
            ".xyz" if !gzip && options.map.is_empty() && options.select.is_automatic() => {
                xyz::read_raw(path, budget.left())
            }
            _ => None,
        };
        let reading = Reading::new(options, budget);
        let mut contents = if let Some(particles) = raw {
            particles.into()
        } else {
            if !gzip {
                format.probe(path, &file, metadata.len())?;
            }
            let mut bytes = BUFFER.take();
            let read = files::contents(path, &file, &metadata, budget.left(), &mut bytes);
            let parsed = read.and_then(|()| format.read_packed(path, &bytes, &reading, gzip));
            if bytes.capacity() <= MAX_BUFFER {
                BUFFER.set(bytes);
            }
            parsed?
        };
        if format.extension == foam::EXTENSION {
            foam::read_beside(path, &mut contents, &reading)?;
        }
        if format.extension == ".pos" {
            pos::read_ellipsoids(path, &mut contents, budget.left())?;
        }
        // Formats that are not packed have taken nothing yet.
        let missing = contents.bytes().saturating_sub(budget.used() - used);
        budget.take(missing, path, Location::Byte(0))?;
        contents.finished(path, &reading)
    }

    /// Memory of the particles, bytes.
    fn bytes(&self) -> u64 {
        let attributes = attributes(&self.particles);
        let numbers = attributes.iter().map(|(_, values)| values.bytes() as u64);
        let Particles { values, colors, .. } = &self.particles;
        let values = values.iter().map(|values| size_of_val(&values[..]));
        let shown = values.chain(colors.iter().map(|colors| size_of_val(&colors[..])));
        numbers
            .chain(shown.map(|bytes| bytes as u64))
            .fold(POSITION_BYTES * self.particles.len() as u64, u64::saturating_add)
    }

    /// As [`Contents::read`], for contents in memory; see [`parse`].
    ///
    /// # Errors
    ///
    /// As [`Contents::read`].
    pub fn parse(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Self> {
        let budget = Budget::of_length(options.max_unpacked, bytes.len() as u64);
        let Found { format, gzip } = by_content::of_bytes(path, bytes)?;
        let reading = Reading::new(options, &budget);
        format.read_packed(path, bytes, &reading, gzip)?.finished(path, &reading)
    }
}

thread_local! {
    /// A thread's buffer for the bytes of a file, reused since the page faults of new memory take longer
    /// than the rest of reading.
    static BUFFER: Cell<Vec<u8>> = const { Cell::new(Vec::new()) };
}

/// Capacity of the largest buffer that is kept, bytes: enough for about a million particles.
const MAX_BUFFER: usize = 64 << 20;

/// Memory of a particle's position, bytes.
const POSITION_BYTES: u64 = size_of::<Vec3>() as u64;

/// The kind of particle files, each in the format of its extension.
pub const FILE_KIND: FileKind =
    FileKind::new("a particle file of the format that its name says", |file| {
        is_of_its_format(file.path, &file.head, file.length)
    });

/// The kind of the `.ani` file beside a `.pos`, with its ellipsoids.
pub const ELLIPSOIDS_KIND: FileKind = FileKind::new("the ellipsoids of a .pos file", |file| {
    pos::check_ellipsoids_length(file.path, &file.head, file.length).is_ok()
});

type Reader = fn(&Path, &[u8], &Reading<'_>) -> Result<Contents>;
type Writer = fn(&Particles, &Others<'_>, &mut BufWriter<&File>) -> io::Result<()>;

/// A particle format.
struct Format {
    extension: &'static str,
    read: Reader,
    write: Option<Writer>,
    /// The attributes that it can store.
    holds: &'static [&'static str],
    /// Whether it can store 64-bit positions.
    wide: bool,
}

const ALL: &[&str] = &["id", "velocity", "density", "radius", "ellipsoid"];

const FORMATS: [Format; 28] = {
    const fn format(
        extension: &'static str,
        read: Reader,
        write: Writer,
        holds: &'static [&'static str],
        wide: bool,
    ) -> Format {
        Format { extension, read, write: Some(write), holds, wide }
    }
    [
        format(".bgeo", bgeo::read, bgeo::write_gzip, ALL, false),
        format(".bgeo.gz", bgeo::read, bgeo::write_gzip, ALL, false),
        format(".bhclassic", bgeo::read, bgeo::write, ALL, false),
        Format { extension: ".bgeo.sc", read: bgeo::read, write: None, holds: ALL, wide: true },
        Format { extension: ".geo", read: bgeo::read, write: None, holds: ALL, wide: true },
        format(".vtk", vtk::read, vtk::write, ALL, true),
        format(".vtu", vtu::read, vtu::write, ALL, true),
        Format { extension: ".vtp", read: vtu::read, write: None, holds: ALL, wide: true },
        Format { extension: ".pvtu", read: pieces::read, write: None, holds: ALL, wide: true },
        Format { extension: ".pvtp", read: pieces::read, write: None, holds: ALL, wide: true },
        Format { extension: ".vtm", read: pieces::read, write: None, holds: ALL, wide: true },
        format(".ply", ply::read, ply::write, ALL, true),
        format(".npy", npy::read, npy::write, &[], true),
        format(".npz", npz::read, npz::write, ALL, true),
        format(".xyz", xyz::read, xyz::write, &[], false),
        Format { extension: ".extxyz", read: extxyz::read, write: None, holds: ALL, wide: true },
        Format { extension: ".lammpstrj", read: lammps::read, write: None, holds: ALL, wide: true },
        Format { extension: ".dump", read: lammps::read, write: None, holds: ALL, wide: true },
        Format { extension: ".h5", read: hdf5::read, write: None, holds: ALL, wide: true },
        Format { extension: ".hdf5", read: hdf5::read, write: None, holds: ALL, wide: true },
        Format { extension: ".vtkhdf", read: hdf5::read, write: None, holds: ALL, wide: true },
        Format { extension: ".vtkhdf5", read: hdf5::read, write: None, holds: ALL, wide: true },
        format(".pos", pos::read, pos::write, &["radius", "ellipsoid"], false),
        format(".csv", csv::read, csv::write, ALL, true),
        Format { extension: ".bi4", read: bi4::read, write: None, holds: ALL, wide: true },
        Format { extension: ".prt", read: prt::read, write: None, holds: ALL, wide: true },
        Format {
            extension: foam::EXTENSION,
            read: foam::read,
            write: None,
            holds: ALL,
            wide: true,
        },
        Format { extension: ".uni", read: uni::read, write: None, holds: &[], wide: false },
    ]
};

impl Format {
    /// Reads all contents of a file, also those that cannot be used. It may be compressed by gzip.
    fn read_packed(
        &self,
        path: &Path,
        bytes: &[u8],
        reading: &Reading<'_>,
        gzip: bool,
    ) -> Result<Contents> {
        if !gzip {
            return (self.read)(path, bytes, reading);
        }
        (self.read)(path, &bgeo::unpack(path, bytes, reading.budget)?, reading)
    }

    fn parse(&self, path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
        (self.read)(path, bytes, reading)?.finished(path, reading)
    }

    /// Fails if the start or the length of a large file shows that it has another format, without
    /// reading all of it.
    fn probe(&self, path: &Path, file: &InputFile, length: u64) -> Result<()> {
        const LARGE: u64 = 64 << 20;
        const START: u64 = 64 << 10;
        if !files::READS_PARTS || length < LARGE {
            return Ok(());
        }
        let mut start = vec![0; START as usize];
        files::read_at(file, &mut start, 0).map_err(|source| Error::io(path, "read", source))?;
        let (options, budget) = (ReadOptions::default(), Budget::new(Some(LARGE)));
        let reading = Reading::new(&options, &budget);
        match ((self.read)(path, &start, &reading), self.extension) {
            // All other errors may be due to the truncation.
            (Err(error @ Error::Format { .. }), _) => Err(error),
            (_, ".xyz") => xyz::check_length(path, &start, length),
            (_, ".pos") => pos::check_length(path, &start, length),
            _ => Ok(()),
        }
    }
}

/// Whether a file with this start and length has the format of its extension.
fn is_of_its_format(path: &Path, head: &[u8], length: u64) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let Some((_, format)) = format_of(&name) else { return false };
    let complete = head.len() as u64 == length;
    let (options, budget) = (ReadOptions::default(), Budget::of_length(None, length));
    let reading = Reading::new(&options, &budget);
    match format.extension {
        // Formats without a magic: the particles must be valid.
        ".xyz" => xyz::is_sound(path, head, length, &reading),
        ".pos" => pos::check_length(path, head, length).is_ok(),
        _ => match (format.read)(path, head, &reading) {
            Err(Error::Format { .. }) => false,
            // A truncated file still has its format.
            Err(_) => !complete || known_magic(head).is_some(),
            Ok(_) => true,
        },
    }
}

/// Lists the readable extensions for messages.
pub(crate) fn extensions() -> String {
    let extensions = FORMATS.map(|format| format.extension);
    extensions.into_iter().filter(|name| name.starts_with('.')).collect::<Vec<_>>().join(", ")
}

/// A file name without its extension, if that is of a readable format, plain or compressed by gzip.
pub fn readable_stem(name: &str) -> Option<&str> {
    let packed = || {
        let inner = name.get(..name.len().checked_sub(".gz".len())?)?;
        format_of(inner).filter(|_| by_content::is_gzip(name))
    };
    format_of(name).or_else(packed).map(|(stem, _)| stem)
}

/// Finds the format of a file name; returns its stem too.
fn format_of(name: &str) -> Option<(&str, Format)> {
    FORMATS.into_iter().find_map(|format| {
        let extension = format.extension;
        let (stem, end) = name.split_at_checked(name.len().checked_sub(extension.len())?)?;
        end.eq_ignore_ascii_case(extension).then_some((stem, format))
    })
}

fn writable(path: &Path) -> Result<(Format, Writer)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let format = format_of(&name).map(|(_, format)| format);
    format.and_then(|format| format.write.map(|write| (format, write))).ok_or_else(|| {
        let written = FORMATS.into_iter().filter(|format| format.write.is_some());
        let written: Vec<_> = written.map(|format| format.extension).collect();
        Error::format(path, format!("can be written: {}", written.join(", ")))
    })
}

fn unknown_kind(path: &Path, name: &str) -> Error {
    let unknown =
        || format!("a kind of file that limpid does not know; can be read: {}", extensions());
    Error::format(path, kinds::remedy(name).map_or_else(unknown, str::to_owned))
}

/// The error of a file with several frames that is read as one.
fn several(path: &Path) -> Error {
    let packed = by_content::is_gzip(&path.to_string_lossy());
    let remedy = if packed { "unpack it, and name it alone" } else { "name it alone" };
    Error::format(
        path,
        format!("several frames in one file, which is a sequence of its own: {remedy}"),
    )
}

/// The error of a file without the magic of its format, with the format that it seems to have.
pub(crate) fn foreign(path: &Path, bytes: &[u8], expected: &str) -> Error {
    let found = match known_magic(bytes) {
        Some(kind) => kind,
        None if bytes.is_empty() => "an empty file",
        None => "an unknown kind of file",
    };
    Error::format(path, format!("this is {found}, not {expected}"))
}
