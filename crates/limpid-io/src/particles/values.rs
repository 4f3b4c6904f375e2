//! Attributes for readers and writers of columns: their names, and their values number by number.

use std::io::{self, Write};

use glam::Vec3;
use limpid::liquid::{Ellipsoid, Particles};

use super::{Attribute, AttributeMap};

/// The present attributes with their written names, which are those of SPlisHSPlasH if it has them.
pub(super) fn attributes(particles: &Particles) -> Vec<(&'static str, Values<'_>)> {
    let Particles { velocities, densities, radii, ids, ellipsoids, .. } = particles;
    let attributes = [
        ("id", ids.as_deref().map(Values::Integers)),
        ("velocity", velocities.as_deref().map(Values::Vectors)),
        ("density", densities.as_deref().map(Values::Floats)),
        ("radius", radii.as_deref().map(Values::Floats)),
        ("ellipsoid", ellipsoids.as_deref().map(Values::Ellipsoids)),
    ];
    attributes.into_iter().filter_map(|(name, values)| Some((name, values?))).collect()
}

/// The values of an attribute, for writers.
#[derive(Clone, Copy)]
pub(super) enum Values<'a> {
    Integers(&'a [i64]),
    Floats(&'a [f32]),
    Vectors(&'a [Vec3]),
    Ellipsoids(&'a [Ellipsoid]),
}

impl<'a> Values<'a> {
    /// Number of values per particle.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Integers(_) | Self::Floats(_) => 1,
            Self::Vectors(_) => 3,
            Self::Ellipsoids(_) => 6,
        }
    }

    /// Column names of an attribute, for formats with one column per number.
    pub(super) fn column_names(self, name: &str) -> Vec<String> {
        match self {
            Self::Integers(_) | Self::Floats(_) => vec![name.into()],
            Self::Vectors(_) => ["x", "y", "z"].map(|axis| format!("{name}_{axis}")).into(),
            Self::Ellipsoids(_) => ELLIPSOID_COLUMNS.map(String::from).into(),
        }
    }

    /// All floats, particle by particle; empty for integers.
    pub(super) fn floats(self) -> &'a [f32] {
        match self {
            Self::Integers(_) => &[],
            Self::Floats(floats) => floats,
            Self::Vectors(vectors) => bytemuck::cast_slice(vectors),
            Self::Ellipsoids(ellipsoids) => bytemuck::cast_slice(ellipsoids),
        }
    }

    /// The floats of particle `i`.
    pub(super) fn floats_of(self, i: usize) -> &'a [f32] {
        &self.floats()[i * self.size()..][..self.size()]
    }
}

/// Column names of the numbers of an [`Ellipsoid`].
const ELLIPSOID_COLUMNS: [&str; 6] = [
    "ellipsoid_xx",
    "ellipsoid_yy",
    "ellipsoid_zz",
    "ellipsoid_xy",
    "ellipsoid_yz",
    "ellipsoid_xz",
];

/// Finds the columns of a vector whose names begin with one of `bases`, among names in lower case: `vx`,
/// `Points:0`, `Points_0`, `Pos.x` and so on.
pub(super) fn vector_among(names: &[String], bases: &[&str]) -> Option<Vec<usize>> {
    let find = |column: &str| names.iter().position(|name| name == column);
    let mut spellings = bases.iter().flat_map(|base| {
        ["", ":", "_", "."].into_iter().flat_map(move |separator| {
            [["x", "y", "z"], ["0", "1", "2"]]
                .map(|axes| axes.map(|axis| format!("{base}{separator}{axis}")))
        })
    });
    spellings.find_map(|names| names.iter().map(|name| find(name)).collect())
}

/// Finds the columns of the velocities.
pub(super) fn velocity_among(names: &[String], map: &AttributeMap) -> Option<Vec<usize>> {
    match map.array_of(Attribute::Velocity) {
        Some(name) => vector_among(names, &[&name]),
        None => vector_among(names, &["velocity", "velocities", "vel", "velo", "v"]),
    }
}

/// Finds the columns of the ellipsoids.
pub(super) fn ellipsoid_among(names: &[String], map: &AttributeMap) -> Option<Vec<usize>> {
    let base = map.array_of(Attribute::Ellipsoid).unwrap_or_else(|| "ellipsoid".into());
    let find = |column: &String| names.iter().position(|name| name == column);
    let numbered = |separator: &str| [0, 1, 2, 3, 4, 5].map(|k| format!("{base}{separator}{k}"));
    let lettered = ELLIPSOID_COLUMNS.map(|name| name.replacen("ellipsoid", &base, 1));
    let spellings = [lettered, numbered(":"), numbered("_")];
    spellings.iter().find_map(|names| names.iter().map(find).collect())
}

/// Writes numbers in blocks, since a call per number would dominate the time.
pub(super) fn write_numbers<T: Copy, const N: usize>(
    numbers: &[T],
    bytes: impl Fn(T) -> [u8; N],
    out: &mut impl Write,
) -> io::Result<()> {
    let mut block = Vec::new();
    for numbers in numbers.chunks(4096) {
        block.clear();
        block.extend(numbers.iter().flat_map(|&number| bytes(number)));
        out.write_all(&block)?;
    }
    Ok(())
}

/// Converts an id for a format with 32-bit ids.
pub(super) fn narrow_id(id: i64, format: &str) -> io::Result<i32> {
    i32::try_from(id).map_err(|_| too_large(&format!("{format} holds 32-bit ids, not {id}")))
}

pub(super) fn too_large(problem: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, problem)
}
