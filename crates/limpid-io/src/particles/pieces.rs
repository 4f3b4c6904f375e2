//! Frames in several files. `.pvtu`, `.pvtp` and `.vtm` name the pieces, which are read one after the other; those of
//! several ranks are found by their names ([`crate::sequence`]).

use std::path::Path;

use super::{Array, Attribute, Contents, MOST_LISTED, Reading, Remark, attribute_names, foreign};
use crate::error::{Error, Result, printable};
use crate::vtk_lists;
use limpid::liquid::Particles;
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    let start = bytes.get(..4096).unwrap_or(bytes);
    if !String::from_utf8_lossy(start).contains("<VTKFile") {
        return Err(foreign(path, bytes, "a list of VTK files"));
    }
    let mut pieces = Vec::new();
    for piece in vtk_lists::parse_xml(path, bytes)? {
        let name = piece.path.to_string_lossy().to_ascii_lowercase();
        if ![".vtu", ".vtp", ".vtk"].iter().any(|extension| name.ends_with(extension)) {
            let problem = format!("{}: expected a .vtu, .vtp or .vtk file", piece.path.display());
            return Err(Error::format(path, problem));
        }
        let contents = Contents::read_within(&piece.path, reading.options, reading.budget)?;
        pieces.push((piece.path.display().to_string(), contents));
    }
    joined(path, pieces)
}

/// The contents of several files, or parts of a file, as one. The particles keep the attributes that all parts have;
/// a remark names each of the others and a part that lacks it. `parts` are their names and what they hold.
///
/// # Errors
/// [`limpid::Error::Memory`].
pub(crate) fn joined(path: &Path, mut parts: Vec<(String, Contents)>) -> Result<Contents> {
    if parts.len() == 1 {
        return Ok(parts.remove(0).1);
    }
    let bytes = parts.iter().map(|(_, part)| part.bytes()).fold(0, u64::saturating_add);
    memory::probe(usize::try_from(bytes).unwrap_or(usize::MAX), path.display())?;
    let mut all = Contents::default();
    let mut particles = Vec::new();
    for (_, part) in &mut parts {
        particles.push(std::mem::take(&mut part.particles));
        all.cells = all.cells.saturating_add(part.cells);
        all.up = all.up.or(part.up);
        for array in std::mem::take(&mut part.arrays) {
            let is_full = all.arrays.len() >= MOST_LISTED;
            match all.arrays.iter_mut().find(|known| known.name == array.name) {
                Some(known) => {
                    known.is_shown |= array.is_shown;
                    known.spread = known.spread.zip(array.spread).map(|(a, b)| a.joined(b));
                    known.used_as = known.used_as.or(array.used_as);
                    if let (Some(rows), Some(more)) = (known.shape.first_mut(), array.shape.first())
                    {
                        *rows = rows.saturating_add(*more);
                    }
                }
                None if !is_full => {
                    all.arrays.push(Array { values: Vec::new(), ..array });
                }
                None => {}
            }
        }
        for remark in std::mem::take(&mut part.remarks) {
            all.remark(remark);
        }
    }
    // Together they may be whole.
    let is_partial =
        |r: &Remark| matches!(r, Remark::Partial { found, total, .. } if found < total);
    all.remarks.retain(|remark| !matches!(remark, Remark::Partial { .. }) || is_partial(remark));
    all.particles = Particles::joined(&particles);
    let filled = || parts.iter().zip(&particles).filter(|(_, own)| !own.is_empty());
    if let Some(((_, first), _)) = filled().next() {
        // Attributes of all parts.
        let of = |name: &String| {
            let column = |part: &Contents| {
                part.columns.iter().find(|(own, _)| own == name).map(|(_, numbers)| numbers.clone())
            };
            let all: Option<Vec<_>> = filled().map(|((_, part), _)| column(part)).collect();
            Some((name.clone(), all?.concat()))
        };
        all.columns = first.columns.iter().filter_map(|(name, _)| of(name)).collect();
    }
    if !all.particles.is_empty() {
        // Others may have some.
        all.remarks.retain(|remark| !matches!(remark, Remark::NoneSelected { .. }));
    }
    // Each part has selected its usable contents itself.
    all.settled = true;
    for attribute in Attribute::ALL {
        let has = |part: &Particles| attribute_names(part).any(|name| name == attribute.name());
        let lacks = |part: &Particles| !part.is_empty() && !has(part);
        let Some(lacking) = particles.iter().position(lacks) else { continue };
        if !particles.iter().any(has) {
            continue;
        }
        let mut array = attribute.name().to_owned();
        for used in all.arrays.iter_mut().filter(|array| array.used_as == Some(attribute)) {
            used.used_as = None;
            array.clone_from(&used.name);
        }
        let problem = format!("{} lacks it", printable(parts[lacking].0.clone()));
        all.remark(Remark::Unusable { array, problem });
    }
    Ok(all)
}

impl Contents {
    /// Adds a remark on a part.
    fn remark(&mut self, new: Remark) {
        for known in &mut self.remarks {
            match (known, &new) {
                (
                    Remark::Partial { found, total, unit },
                    Remark::Partial { found: more, total: all, unit: same },
                ) if (*total, *unit) == (*all, *same) => {
                    *found = found.saturating_add(*more);
                    return;
                }
                _ => {}
            }
        }
        Remark::join(&mut self.remarks, vec![new]);
    }
}
