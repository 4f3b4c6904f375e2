//! Attributes for readers and writers of columns: their names, and their values number by number.

use std::io::{self, Write};

use glam::Vec3;
use limpid::liquid::{Ellipsoid, Particles};

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

/// Arrays that are written beside the attributes, with their names.
pub(super) type Others<'a> = [(&'static str, Values<'a>)];

/// The present attributes, and further arrays.
pub(super) fn with_others<'a>(
    particles: &'a Particles,
    others: &Others<'a>,
) -> Vec<(&'static str, Values<'a>)> {
    let mut all = attributes(particles);
    all.extend_from_slice(others);
    all
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

    /// Memory of the values.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Integers(values) => size_of_val(values),
            Self::Floats(values) => size_of_val(values),
            Self::Vectors(values) => size_of_val(values),
            Self::Ellipsoids(values) => size_of_val(values),
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
pub(super) const ELLIPSOID_COLUMNS: [&str; 6] = [
    "ellipsoid_xx",
    "ellipsoid_yy",
    "ellipsoid_zz",
    "ellipsoid_xy",
    "ellipsoid_yz",
    "ellipsoid_xz",
];

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
