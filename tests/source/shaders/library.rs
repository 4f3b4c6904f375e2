//! Checks of a whole library of shaders: the renderer's here, another crate's in its own tests.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use limpid::gpu::shader::{self, Grain, Library, Words};

use super::text::{Loop, loops, mixes_shifts};
use super::wgsl::{check, specialise, translate_all};

/// The variant for tests of roots, with the default intersector.
pub(crate) const GUARDED: Words = Words {
    intersector: Some("refract/guarded.wgsl"),
    grain: Grain::Pixel,
    stored_uniforms: false,
    stored_layers: false,
    mips: false,
};

/// A loop of a library: file, function, header and the bound on its iterations.
pub(crate) type KnownLoop = (&'static str, &'static str, &'static str, &'static str);

fn files_below(folder: &Path, prefix: &str, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("the shader folder can be read") {
        let entry = entry.expect("the shader folder can be read");
        let name = format!("{prefix}{}", entry.file_name().to_str().expect("ASCII names"));
        if entry.path().is_dir() {
            files_below(&entry.path(), &format!("{name}/"), found);
        } else {
            found.insert(name);
        }
    }
}

/// The table lists every file of the folder exactly once.
pub(crate) fn assert_lists_folder(library: Library, folder: &Path) {
    let mut files = BTreeSet::new();
    files_below(folder, "", &mut files);
    let table: BTreeSet<_> = library.files.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(table, files);
    assert_eq!(table.len(), library.files.len(), "a file is in the table twice");
}

/// The files that a root imports, including itself.
fn pasted(library: Library, root: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for grain in [Grain::Pixel, Grain::Column] {
        shader::resolve(root, Words { grain, ..GUARDED }, &mut |path| {
            found.insert(path.to_owned());
            library.file(path)
        });
    }
    found
}

/// There are no dead files, which would never be compiled or checked.
pub(crate) fn assert_uses_every_file(library: Library) {
    let used: BTreeSet<_> = library.roots.iter().flat_map(|root| pasted(library, root)).collect();
    for (name, _) in library.files {
        assert!(used.contains(*name), "{name} is neither a root nor imported by one");
    }
    for root in library.roots {
        assert!(library.files.iter().any(|(name, _)| name == root), "no file for the root {root}");
    }
}

/// Every root validates in every specialisation with the features that limpid requests. Reports all
/// failures at once.
pub(crate) fn assert_roots_are_valid(library: Library) {
    let valid = |root: &str| {
        let text = library.source(root, GUARDED);
        let stored = Words { stored_uniforms: true, stored_layers: true, ..GUARDED };
        let stored = library.source(root, stored);
        // A new uniform must be added here or become `$branching`.
        let plain = [
            "camera",
            "scene",
            "solids",
            "light_views",
            "params",
            "before",
            "absorptions",
            "coloring",
            "color_map",
        ];
        for (_, uniform) in stored.match_indices("var<uniform>").map(|(at, _)| stored.split_at(at))
        {
            let name = uniform.trim_start_matches("var<uniform> ").split(':').next();
            assert!(name.is_some_and(|name| plain.contains(&name)), "{root}: uniform {name:?}");
        }
        check(root, &stored)?;
        specialise(root, &text)
    };
    let broken: Vec<_> = (library.roots.iter())
        .filter_map(|root| match valid(root) {
            Ok(specialisations) => {
                assert!(specialisations > 0, "{root} has no entry point");
                None
            }
            Err(problem) => Some(problem),
        })
        .collect();
    assert!(broken.is_empty(), "{} broken roots:\n{}", broken.len(), broken.join("\n"));
}

/// Roots that draw tiles are valid in the grain of software adapters too. Returns their number.
pub(crate) fn assert_columns_are_valid(library: Library) -> usize {
    let mut drawn = 0;
    for root in library.roots {
        let text = library.source(root, Words { grain: Grain::Column, ..GUARDED });
        if text == library.source(root, GUARDED) {
            continue;
        }
        drawn += 1;
        let done = specialise(root, &text);
        done.and_then(|_| translate_all(root, &text)).unwrap_or_else(|problem| panic!("{problem}"));
    }
    drawn
}

/// Every root translates to SPIR-V, MSL, HLSL and GLSL.
pub(crate) fn assert_roots_translate(library: Library) {
    let broken: Vec<_> = (library.roots.iter())
        .filter_map(|root| match translate_all(root, &library.source(root, GUARDED)) {
            Ok(translated) => {
                assert!(translated > 0, "{root} has no entry point");
                None
            }
            Err(problem) => Some(problem),
        })
        .collect();
    assert!(broken.is_empty(), "{} broken:\n{}", broken.len(), broken.join("\n"));
}

/// The loops of the files are those of `known`, each with a bound.
pub(crate) fn assert_loops_are_known(library: Library, known: &[KnownLoop]) {
    let mut found: Vec<Loop> = (library.files.iter())
        .flat_map(|(file, text)| loops(file, text).unwrap_or_else(|problem| panic!("{problem}")))
        .collect();
    let own = |&(file, function, header, bound): &KnownLoop| {
        assert!(!bound.is_empty(), "{file}, {function}: {header}");
        (file.to_owned(), function.to_owned(), header.to_owned())
    };
    let mut known: Vec<Loop> = known.iter().map(own).collect();
    found.sort();
    known.sort();
    let new: Vec<_> = found.iter().filter(|one| !known.contains(one)).collect();
    assert!(new.is_empty(), "not in the table: {new:#?}");
    assert_eq!(found, known, "loops are gone, or occur more often than in the table");
}

/// Shifts beside `|`, `&` or `^` stand in parentheses.
pub(crate) fn assert_shifts_stand_in_parentheses(library: Library) {
    for (name, text) in library.files {
        for (number, line) in (1..).zip(text.lines()) {
            assert!(!mixes_shifts(line), "{name}:{number}: {line}");
        }
    }
}
