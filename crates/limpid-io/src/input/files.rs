//! The files of an input.

use std::path::{Path, PathBuf};

use crate::bake;
use crate::files;
use crate::particles::trajectory;
use crate::sequence::Sequence;
use crate::vtk_lists;

/// Lists the files of an input as far as they can be found: a scene with its environment map, and all
/// particle files, meshes and rigid bodies. Errors are ignored here; opening reports them.
pub fn files_of(input: &str) -> Vec<PathBuf> {
    let path = Path::new(input);
    if !is_scene_file(path) {
        return sequence_files(input);
    }
    let mut all = vec![path.to_owned()];
    let text = files::read_text(path).unwrap_or_default();
    let table: toml::Table = text.parse().unwrap_or_default();
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = |table: Option<&toml::Value>, key: &str| -> Option<String> {
        Some(folder.join(table?.get(key)?.as_str()?).to_string_lossy().into_owned())
    };
    all.extend(named(table.get("environment"), "map").map(PathBuf::from));
    let fluids = table.get("fluid").and_then(toml::Value::as_array);
    let mixed = fluids.into_iter().flatten();
    let sources = mixed.chain(table.get("particles")).filter_map(|of| named(Some(of), "source"));
    all.extend(sources.flat_map(|source| sequence_files(&source)));
    let solids = table.get("solid").and_then(toml::Value::as_array);
    let meshes = solids.into_iter().flatten().filter_map(|solid| named(Some(solid), "file"));
    let bodies = named(table.get("rigid_bodies"), "source");
    all.extend(meshes.chain(bodies).flat_map(|source| sequence_files(&source)));
    if table.contains_key("simulation") {
        all.extend(sequence_files(&bake::folder(path).to_string_lossy()));
    }
    all
}

pub(super) fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// The particle files of a sequence, the ellipsoids beside them, and the pieces that they list.
fn sequence_files(input: &str) -> Vec<PathBuf> {
    // A file with several frames is not scanned for them again.
    if trajectory::may_have_several(Path::new(input)) && files::is_file(Path::new(input)) {
        return vec![input.into()];
    }
    let frames = Sequence::open(input).map(|sequence| sequence.frames).unwrap_or_default();
    // A list of the frames is a file too.
    let mut files: Vec<PathBuf> =
        files::is_file(Path::new(input)).then(|| input.into()).into_iter().collect();
    for path in frames.into_iter().flat_map(|frame| [vec![frame.path], frame.parts].concat()) {
        let is =
            |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
        if is("pos") {
            files.push(path.with_extension("ani"));
        }
        if is("pvtu") || is("pvtp") || is("vtm") {
            let mut bytes = Vec::new();
            let read = files::read(&path, files::unpacked_limit, &mut bytes).ok();
            let pieces = read.and_then(|()| vtk_lists::parse_xml(&path, &bytes).ok());
            files.extend(pieces.into_iter().flatten().map(|piece| piece.path));
        }
        files.push(path);
    }
    files.dedup();
    files
}
