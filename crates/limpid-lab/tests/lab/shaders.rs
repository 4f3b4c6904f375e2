//! Static checks of the laboratory's shaders: those of the renderer's.

#[path = "../../../../tests/source/shaders/library.rs"]
mod library;
#[path = "../../../../tests/source/shaders/text.rs"]
mod text;
#[path = "../../../../tests/source/shaders/wgsl.rs"]
mod wgsl;

use std::path::Path;

use limpid::gpu::shader::{RENDERER, Words};
use limpid_lab::report::shaders::SHADERS;

use self::wgsl::specialise;

/// Every loop: file, function, header and the bound on its iterations.
const LOOPS: [library::KnownLoop; 1] =
    [("report/arithmetic.wgsl", "arithmetic", "for (var i = 0u; i < ROUNDS; i++)", "a constant")];

/// The table lists every file of the shader folder, and none has the path of a file of the renderer.
#[test]
fn table_lists_every_shader_file_once() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    library::assert_lists_folder(SHADERS, &folder);
    for (path, _) in SHADERS.files {
        assert!(RENDERER.file(path).is_none(), "{path}");
    }
}

/// Every file is compiled; every root is valid in every specialisation, also as software adapters draw, and translates
/// for every platform; loops are bounded, and shifts stand in parentheses.
#[test]
fn every_shader_is_valid_on_every_platform() {
    library::assert_uses_every_file(SHADERS);
    library::assert_roots_are_valid(SHADERS);
    library::assert_roots_translate(SHADERS);
    library::assert_columns_are_valid(SHADERS);
    library::assert_loops_are_known(SHADERS, &LOOPS);
    library::assert_shifts_stand_in_parentheses(SHADERS);
}

/// The benchmark root is valid with every intersector.
#[test]
fn benchmark_is_valid_with_every_intersector() {
    let is_intersector =
        |root: &&&str| root.starts_with("refract/") && **root != "refract/structure.wgsl";
    let roots: Vec<_> = RENDERER.roots.iter().filter(is_intersector).collect();
    assert!(roots.len() >= 7, "{roots:?}");
    for root in roots.into_iter().chain(&["report/nothing.wgsl"]) {
        let text = SHADERS.source("report/intersect.wgsl", Words::of(root));
        specialise(root, &text).unwrap_or_else(|problem| panic!("{problem}"));
    }
}
