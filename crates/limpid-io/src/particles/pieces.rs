//! Data sets in several VTK files: `.pvtu`, `.pvtp` and `.vtm` name the pieces, which are read one after the
//! other.

use std::path::Path;

use super::{Contents, ReadOptions, Reading, foreign};
use crate::error::{Error, Result};
use crate::vtk_lists;
use limpid::liquid::Particles;
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    let start = bytes.get(..4096).unwrap_or(bytes);
    if !String::from_utf8_lossy(start).contains("<VTKFile") {
        return Err(foreign(path, bytes, "a list of VTK files"));
    }
    let (mut pieces, mut count) = (Vec::new(), 0_usize);
    let mut all = Contents::default();
    for piece in vtk_lists::parse_xml(path, bytes)? {
        let name = piece.path.to_string_lossy().to_ascii_lowercase();
        if ![".vtu", ".vtp", ".vtk"].iter().any(|extension| name.ends_with(extension)) {
            let problem = format!("{}: expected a .vtu, .vtp or .vtk file", piece.path.display());
            return Err(Error::format(path, problem));
        }
        let options = ReadOptions { max_unpacked: Some(reading.limit), map: reading.map.clone() };
        let contents = Contents::read(&piece.path, &options)?;
        count += contents.particles.len();
        memory::probe(count.saturating_mul(Particles::MATCHED), path.display())?;
        all.cells = all.cells.saturating_add(contents.cells);
        all.remarks.extend(contents.remarks);
        all.up = all.up.or(contents.up);
        if all.arrays.is_empty() {
            all.arrays = contents.arrays;
        }
        pieces.push(contents.particles);
    }
    for array in &mut all.arrays {
        if let Some(rows) = array.shape.first_mut() {
            *rows = count;
        }
    }
    Ok(Contents { particles: Particles::joined(&pieces), ..all })
}
