//! Foam, spray, bubbles and dust in particle files.
//!
//! Beside positions, velocities and radii they have, by their names in any case:
//!
//! - `kind`, `type`, `ptype`: 0 foam, 1 spray, 2 bubble, 3 dust; or `flags` and numbers above 3: the bits of mantaflow,
//!   2 spray, 4 bubble, 8 foam; or `ParticleType` of `VisualSPHysics`: 0 spray, 1 foam, 2 bubble;
//! - `age`: seconds since each appeared;
//! - `lifetime`: seconds left, as in `SPlisHSPlasH` and mantaflow; or `life`: the whole life, as in Houdini. In tables
//!   without names, as the buffers (x, y, z, lifetime) of demos on the GPU, the fourth column.

use std::ops::Range;
use std::path::Path;

use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::liquid::Particles;

use super::remark::Remark;
use super::{ALL, Contents, FILE_KIND, ReadOptions, Selection, Values, writable};
use crate::error::{Error, Result};
use crate::output;

/// Names of the arrays, those with the same meaning together.
const COLUMNS: [&str; 15] = [
    "kind",
    "kinds",
    "type",
    "types",
    "ptype",
    "ptypes",
    FLAGS,
    VISUAL_SPHYSICS,
    "age",
    "ages",
    "lifetime",
    "lifetimes",
    "ttl",
    "column 4",
    "life",
];
const KINDS: Range<usize> = 0..8;
const AGES: Range<usize> = 8..10;
const LIFETIMES: Range<usize> = 10..14;
const LIVES: Range<usize> = 14..15;

/// The arrays of mantaflow, and of `VisualSPHysics`.
const FLAGS: &str = "flags";
const VISUAL_SPHYSICS: &str = "particletype";

/// Options that read also the arrays of diffuse particles. Their `type` tells no walls.
pub(crate) fn reading_diffuse(options: &ReadOptions) -> ReadOptions {
    let select = match &options.select {
        Selection::Automatic => Selection::All,
        select => select.clone(),
    };
    ReadOptions { select, shown: None, values: false, columns: &COLUMNS, ..options.clone() }
}

/// Reads the foam, spray, bubbles and dust of a file, in its own units and axes. Particles without a kind are foam, those
/// without a radius have `radius`, m, and those whose lifetime is over are left out.
///
/// # Errors
/// As [`read`](super::read()).
pub fn read_diffuse(path: &Path, radius: f32) -> Result<Diffuse> {
    let options = reading_diffuse(&ReadOptions::default());
    let contents = Contents::read(path, &options)?;
    Ok(into_diffuse(contents, DiffuseKind::Foam, radius).0)
}

/// The diffuse particles of contents that were read with [`reading_diffuse`], and remarks. Those without a kind are of
/// `kind`.
pub(crate) fn into_diffuse(
    contents: Contents,
    kind: DiffuseKind,
    radius: f32,
) -> (Diffuse, Vec<Remark>) {
    let Contents { particles, columns, mut remarks, .. } = contents;
    let Particles { origin, positions, velocities, radii, .. } = particles;
    let column = |names: Range<usize>| {
        let found =
            COLUMNS[names].iter().find_map(|name| columns.iter().find(|(own, _)| own == name));
        found.map(|(name, numbers)| (name.as_str(), numbers.as_slice()))
    };
    let mut unusable = |array: &str, problem: &str| {
        let (array, problem) = (array.to_owned(), problem.to_owned());
        remarks.push(Remark::Unusable { array, problem });
    };
    let mut seconds = |names: Range<usize>| {
        let (name, numbers) = column(names)?;
        let finite = numbers.iter().all(|number| (*number as f32).is_finite());
        if !finite {
            unusable(name, "some are not finite");
        }
        finite.then(|| numbers.iter().map(|&number| number as f32).collect::<Vec<f32>>())
    };
    let ages = seconds(AGES).map(|all| all.into_iter().map(|age| age.max(0.0)).collect::<Vec<_>>());
    let left = seconds(LIFETIMES).or_else(|| {
        let lives = seconds(LIVES)?;
        let age = |i: usize| ages.as_ref().map_or(0.0, |ages| ages[i]);
        Some((0..lives.len()).map(|i| lives[i] - age(i)).collect())
    });
    let kinds = column(KINDS).and_then(|(name, numbers)| {
        let kinds = kinds_of(name, numbers);
        if kinds.is_none() {
            unusable(name, "expected 0 foam, 1 spray, 2 bubble or 3 dust");
        }
        kinds
    });
    let count = positions.len();
    let usable = |own: f32| if own > 0.0 { own } else { radius };
    let radii =
        radii.map_or_else(|| vec![radius; count], |radii| radii.into_iter().map(usable).collect());
    let kinds = kinds.unwrap_or_else(|| vec![kind; count]);
    let dead: Option<Vec<bool>> =
        left.as_ref().map(|left| left.iter().map(|&left| left <= 0.0).collect());
    let mut diffuse = Diffuse {
        origin,
        positions,
        velocities,
        radii,
        kinds,
        ages,
        lifetimes: left,
        ..Diffuse::default()
    };
    if let Some(dead) = dead.filter(|dead| dead.contains(&true)) {
        diffuse.retain(|i| !dead[i]);
    }
    (diffuse, remarks)
}

/// The kinds that numbers stand for; `None` if some stand for none.
fn kinds_of(name: &str, numbers: &[f64]) -> Option<Vec<DiffuseKind>> {
    // `ParticleStatus` of mantaflow's `particle.h`.
    const BITS: [(u32, DiffuseKind); 3] =
        [(1 << 1, DiffuseKind::Spray), (1 << 2, DiffuseKind::Bubble), (1 << 3, DiffuseKind::Foam)];
    let whole =
        |&number: &f64| number >= 0.0 && number.fract() == 0.0 && number < f64::from(u32::MAX);
    if !numbers.iter().all(whole) {
        return None;
    }
    if name == VISUAL_SPHYSICS {
        const KINDS: [DiffuseKind; 3] =
            [DiffuseKind::Spray, DiffuseKind::Foam, DiffuseKind::Bubble];
        return numbers.iter().map(|&number| KINDS.get(number as usize).copied()).collect();
    }
    let most = DiffuseKind::ALL.len() as f64;
    let flagged = name == FLAGS || numbers.iter().any(|&number| number >= most);
    let kind = |&number: &f64| match flagged {
        false => Some(DiffuseKind::ALL[number as usize]),
        true => BITS.iter().find(|(bit, _)| number as u32 & bit != 0).map(|(_, kind)| *kind),
    };
    match numbers.iter().map(kind).collect::<Option<Vec<_>>>() {
        // Particles of mantaflow without a kind, as of its liquid.
        None if name == FLAGS => Some(vec![DiffuseKind::Foam; numbers.len()]),
        kinds => kinds,
    }
}

/// Writes diffuse particles atomically in the format of the extension: positions, `velocity`, `radius`, `kind`, `age` and
/// `lifetime`, which [`read_diffuse`] reads back bit-exactly.
///
/// # Errors
/// As [`write`](super::write()); [`Error::Format`] for a format without attributes, or without 64-bit places where they need
/// these.
pub fn write_diffuse(diffuse: &Diffuse, path: &Path) -> Result<()> {
    let (format, write) = writable(path)?;
    FILE_KIND.check(path)?;
    if format.holds.len() < ALL.len() {
        let problem = "holds no kinds and ages: foam, spray and bubbles can be written as .bgeo, .vtk, .vtu, .ply, .npz \
                       and .csv";
        return Err(Error::format(path, problem));
    }
    let Diffuse { origin, positions, velocities, radii, kinds, ages, lifetimes, .. } =
        diffuse.clone();
    let radii = Some(radii);
    let particles = Particles { origin, positions, velocities, radii, ..Particles::default() };
    if !format.wide && !particles.narrow() {
        let problem = "holds 32-bit places, which lose precision so far from 0: write .vtu, .ply, .npz or .csv";
        return Err(Error::format(path, problem));
    }
    let kinds: Vec<i64> = kinds.into_iter().map(|kind| kind as i64).collect();
    let others = [
        Some(("kind", Values::Integers(&kinds))),
        ages.as_deref().map(|ages| ("age", Values::Floats(ages))),
        lifetimes.as_deref().map(|left| ("lifetime", Values::Floats(left))),
    ];
    let others: Vec<_> = others.into_iter().flatten().collect();
    output::write_atomically(path, FILE_KIND, |file| write(&particles, &others, file))
}
