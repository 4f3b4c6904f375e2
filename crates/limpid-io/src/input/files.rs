//! The files of an input.

use std::path::{Path, PathBuf};

use crate::bake;
use crate::files;
use crate::particles::trajectory;
use crate::sequence::Sequence;
use crate::vtk_lists;

/// Lists the files of an input as far as they can be found: a scene with its environment map, and all
/// particle files, meshes and rigid bodies. Errors are ignored here; opening reports them.
pub fn files_of(input: impl AsRef<Path>) -> Vec<PathBuf> {
    let path = input.as_ref();
    if !is_scene_file(path) {
        return sequence_files(path);
    }
    let mut all = vec![path.to_owned()];
    let text = files::read_text(path).unwrap_or_default();
    let table: toml::Table = text.parse().unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = |table: Option<&toml::Value>, key: &str| -> Option<PathBuf> {
        Some(folder.join(table?.get(key)?.as_str()?))
    };
    all.extend(named(table.get("environment"), "map"));
    let fluids = table.get("fluid").and_then(toml::Value::as_array);
    let mixed = fluids.into_iter().flatten();
    let sources = mixed.chain(table.get("particles")).filter_map(|of| named(Some(of), "source"));
    all.extend(sources.flat_map(|source| sequence_files(&source)));
    let diffuse = table.get("diffuse").and_then(toml::Value::as_array);
    let diffuse = diffuse.into_iter().flatten().filter_map(|of| named(Some(of), "source"));
    all.extend(diffuse.flat_map(|source| sequence_files(&source)));
    let solids = table.get("solid").and_then(toml::Value::as_array);
    let meshes = solids.into_iter().flatten().filter_map(|solid| named(Some(solid), "file"));
    let bodies = named(table.get("rigid_bodies"), "source");
    all.extend(meshes.chain(bodies).flat_map(|source| sequence_files(&source)));
    if table.contains_key("simulation") {
        all.extend(sequence_files(&bake::folder(path)));
    }
    all
}

pub(super) fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// The particle files of a sequence, the ellipsoids beside them, and the pieces that they list.
fn sequence_files(input: &Path) -> Vec<PathBuf> {
    // A file with several frames is not scanned for them again.
    if trajectory::may_have_several(input) && files::is_file(input) {
        return vec![input.into()];
    }
    let frames = Sequence::open(input).map(|sequence| sequence.frames).unwrap_or_default();
    // A list of the frames is a file too.
    let mut files: Vec<PathBuf> = files::is_file(input).then(|| input.into()).into_iter().collect();
    for path in frames.into_iter().flat_map(|frame| [vec![frame.path], frame.parts].concat()) {
        let is =
            |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
        if is("pos") {
            files.push(path.with_extension("ani"));
        }
        files.extend(with_pieces(&path));
    }
    files.dedup();
    files
}

/// A file, and the pieces that it lists, as far as they can be found.
pub(super) fn with_pieces(path: &Path) -> Vec<PathBuf> {
    let mut all = vec![path.to_owned()];
    let is = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    if is("pvtu") || is("pvtp") || is("vtm") {
        let mut bytes = Vec::new();
        let read = files::read(path, files::unpacked_limit, &mut bytes).ok();
        let pieces = read.and_then(|()| vtk_lists::parse_xml(path, &bytes).ok());
        all.extend(pieces.into_iter().flatten().map(|piece| piece.path));
    }
    all
}
