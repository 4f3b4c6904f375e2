//! `.pos` and `.ani`, the formats of the frames published with N. Truong and C. Yuksel, "A Narrow-Range
//! Filter for Screen-Space Fluid Rendering", Proceedings of the ACM on Computer Graphics and Interactive
//! Techniques 1(1), 2018: positions with one radius, and anisotropic kernels in the `.ani` of the same
//! stem.
//!
//! ```text
//! .pos   u32 n  f32 radius  n × (f32 x, y, z)      all little-endian
//! .ani   u32 n  n × (f32 G_xx, G_yx, G_zx, G_xy, G_yy, G_zy, G_xz, G_yz, G_zz)
//! ```
//!
//! The meaning of the nine numbers follows from the authors' renderer (N. Truong,
//! `RealTimeFluidRendering`, 2018: `DataReader.cpp`, `depth-pass.vs.glsl`): they are the columns of a
//! matrix G that maps the unit sphere, scaled by the particle's radius, to the ellipsoid
//! { c + r G·s : |s| ≤ 1 }, with c the unchanged position. The generator's G is symmetric with
//! determinant 1, or a multiple of the identity for particles with few neighbours
//! (`AniKernelGenerator`). Their shader draws such multiples as the identity; limpid uses the values in
//! the file.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::Path;

use glam::{DMat3, Mat3};
use rayon::prelude::*;

use super::ELLIPSOIDS_KIND;
use super::{
    Attribute, Column, Contents, Cursor, Ellipsoid, Others, Particles, Reading, Scalar, foreign,
    known_magic, too_large,
};
use crate::error::{Error, Result};
use crate::{files, output};
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], _: &Reading<'_>) -> Result<Contents> {
    if known_magic(bytes).is_some() {
        return Err(foreign(path, bytes, "a frame of particles"));
    }
    let mut file = Cursor::new(path, bytes, false);
    let rows = count(&mut file)?;
    let radius = file.array("the radius").map(f32::from_le_bytes)?;
    if !(radius.is_finite() && radius >= 0.0) {
        return Err(file.error(format!("radius {radius}, expected a finite number of 0 or more")));
    }
    let table = file.table(rows, 12, false, "positions")?;
    end(&mut file, "positions (solids have another kind of .pos, with several meshes)")?;
    let mut contents = table.particles(Column::triple(Scalar::F32))?;
    // 0 means that the radius is unknown.
    if radius > 0.0 {
        let radii = std::iter::repeat_n(radius, rows);
        contents.particles.radii = Some(memory::collect(radii, path.display())?);
        contents.list("radius", &[], Some(Attribute::Radius));
    }
    Ok(contents)
}

/// Fails if a file of this length cannot contain the number of particles in its header.
pub(crate) fn check_length(path: &Path, start: &[u8], length: u64) -> Result<()> {
    check_size(path, start, length, [8, 12], "particles")
}

/// Fails if a file of this length cannot contain the number of ellipsoids in its header.
pub(crate) fn check_ellipsoids_length(path: &Path, start: &[u8], length: u64) -> Result<()> {
    check_size(path, start, length, [4, 36], "ellipsoids")
}

/// Checks the length of a file; `sizes` are those of its header and of a row, bytes.
fn check_size(path: &Path, start: &[u8], length: u64, sizes: [u64; 2], what: &str) -> Result<()> {
    let [header, row] = sizes;
    let mut file = Cursor::new(path, start, false);
    let rows = count(&mut file)? as u64;
    let expected = header + row * rows;
    if length == expected {
        return Ok(());
    }
    let problem = format!("{rows} {what} need {expected} bytes, the file has {length}");
    Err(file.error(problem))
}

/// Reads the ellipsoids of the `.ani` beside a file, if there is one.
pub(super) fn read_ellipsoids(path: &Path, contents: &mut Contents, limit: u64) -> Result<()> {
    let path = path.with_extension("ani");
    let mut bytes = Vec::new();
    match files::read(&path, |_| limit, &mut bytes) {
        Ok(()) => {
            let rows = contents.particles.len();
            contents.particles.ellipsoids = Some(ellipsoids(&path, &bytes, rows)?);
            contents.list("ellipsoid", &[rows, 9], Some(Attribute::Ellipsoid));
        }
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    Ok(())
}

fn ellipsoids(path: &Path, bytes: &[u8], particles: usize) -> Result<Vec<Ellipsoid>> {
    let mut file = Cursor::new(path, bytes, false);
    let rows = count(&mut file)?;
    if rows != particles {
        let problem = format!("{rows} ellipsoids, but the .pos file has {particles} particles");
        return Err(file.error(problem));
    }
    let columns: Vec<_> = Column::adjacent(0, 9, Scalar::F32);
    let table = file.table(rows, 36, false, "ellipsoids")?;
    end(&mut file, "ellipsoids")?;
    let columns: [Column; 9] = std::array::from_fn(|k| columns[k]);
    let maps = table.floats(columns)?;
    memory::probe(rows * size_of::<Ellipsoid>(), path.display())?;
    let ellipsoid = |map| {
        let map = Mat3::from_cols_array(map);
        match map.is_finite() {
            true => Ellipsoid::of_map(map.as_dmat3()),
            false => Ellipsoid { xx: f32::NAN, ..Ellipsoid::SPHERE },
        }
    };
    Ok(maps.par_iter().with_min_len(1024).map(ellipsoid).collect())
}

fn count(file: &mut Cursor<'_>) -> Result<usize> {
    file.array("the number of particles").map(|count| u32::from_le_bytes(count) as usize)
}

/// Fails if bytes are left, as in other formats named `.pos`, whose counts have another meaning.
fn end(file: &mut Cursor<'_>, what: &str) -> Result<()> {
    let left = file.rest().len();
    file.start = file.offset;
    match left {
        0 => Ok(()),
        _ => Err(file.error(format!("{left} bytes are left after the {what}"))),
    }
}

pub(super) fn write(
    particles: &Particles,
    _: &Others<'_>,
    out: &mut BufWriter<&File>,
) -> io::Result<()> {
    out.write_all(&rows(particles)?.to_le_bytes())?;
    out.write_all(&written_radius(particles).to_le_bytes())?;
    (0..particles.len()).try_for_each(|i| {
        let position = particles.single_place(i).to_array();
        out.write_all(position.map(f32::to_le_bytes).as_flattened())
    })
}

/// Writes the ellipsoids beside `path`; without ellipsoids, removes those of the file to be replaced.
pub(crate) fn write_ellipsoids(particles: &Particles, path: &Path) -> Result<()> {
    let path = path.with_extension("ani");
    // Checked for replacement and for removal.
    ELLIPSOIDS_KIND.check(&path)?;
    let Some(ellipsoids) = &particles.ellipsoids else {
        return match std::fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(Error::io(&path, "remove", error))
            }
            _ => Ok(()),
        };
    };
    let radius = written_radius(particles);
    let differ = common_radius(particles).is_none();
    output::write_atomically(&path, ELLIPSOIDS_KIND, |out| {
        out.write_all(&rows(particles)?.to_le_bytes())?;
        ellipsoids.iter().enumerate().try_for_each(|(i, &ellipsoid)| {
            let own = particles.radii.as_ref().filter(|_| differ).map(|radii| radii[i] / radius);
            let a: DMat3 = own.map_or(ellipsoid, |factor| ellipsoid.scaled(factor)).matrix();
            out.write_all(a.as_mat3().to_cols_array().map(f32::to_le_bytes).as_flattened())
        })
    })
}

fn rows(particles: &Particles) -> io::Result<u32> {
    let rows = u32::try_from(particles.len());
    rows.map_err(|_| too_large(".pos holds at most 4294967295 particles"))
}

/// The common radius of all particles, 0 without radii; `None` if they differ.
pub(crate) fn common_radius(particles: &Particles) -> Option<f32> {
    let radii = particles.radii.as_deref().unwrap_or_default();
    let first = radii.first().copied().unwrap_or(0.0);
    radii.iter().all(|&radius| radius == first).then_some(first)
}

/// The radius to write: the common one, or the mean of radii that differ.
fn written_radius(particles: &Particles) -> f32 {
    common_radius(particles).unwrap_or_else(|| {
        let radii = particles.radii.as_deref().unwrap_or_default();
        let sum: f64 = radii.iter().map(|&radius| f64::from(radius)).sum();
        (sum / radii.len() as f64) as f32
    })
}
