//! Static checks of the shader files: all are embedded, and all roots are valid WGSL for the features
//! that limpid requests, in every specialisation. No adapter is needed.

mod bounds;
mod library;
mod text;
mod wgsl;

use std::panic::catch_unwind;
use std::path::Path;

use limpid::gpu::shader::{self, RENDERER};

use self::bounds::LOOPS;
use self::library::GUARDED;
use self::text::{loops, mixes_shifts};
use self::wgsl::{check, specialise, translate, translate_all};

/// The table lists every file of the shader folder exactly once.
#[test]
fn table_lists_every_shader_file_once() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    library::assert_lists_folder(RENDERER, &folder);
}

/// Every root validates in every specialisation with the features that limpid requests.
#[test]
fn every_root_is_valid() {
    library::assert_roots_are_valid(RENDERER);
}

/// Roots that draw tiles are valid in the grain of software adapters too.
#[test]
fn columns_are_valid() {
    let drawn = library::assert_columns_are_valid(RENDERER);
    assert_eq!(drawn, 5, "layers, mixture, marks, sides and colors");
}

/// Every shader translates to SPIR-V, MSL, HLSL and GLSL.
#[test]
fn every_shader_translates_for_every_platform() {
    library::assert_roots_translate(RENDERER);
}

/// There are no dead files, which would never be compiled or checked.
#[test]
fn every_file_is_a_root_or_imported_by_one() {
    library::assert_uses_every_file(RENDERER);
}

/// A file is pasted once even if imported repeatedly or in a cycle, and a missing file is named.
#[test]
fn imports_are_pasted_once_and_missing_ones_are_named() {
    let files = [
        ("root", "#import a\n#import b\nfn root() {}"),
        ("a", "#import b\nfn a() {}"),
        ("b", "#import a\n#import root\nfn b() {}"),
        ("lost", "#import nowhere.wgsl"),
    ];
    let resolve = |file: &str| {
        shader::resolve(file, GUARDED, &mut |path| files.iter().find(|f| f.0 == path).map(|f| f.1))
    };
    assert_eq!(resolve("root"), "fn b() {}\nfn a() {}\nfn root() {}\n");
    let panic = catch_unwind(|| resolve("lost")).expect_err("a missing import panics");
    let message = panic.downcast_ref::<String>().expect("a formatted message");
    assert!(message.contains("nowhere.wgsl"), "{message}");
}

/// Every loop is bounded by the picture, the map, the scene or a constant: the program cannot react to
/// signals while the device is stuck in a loop. New loops must be added to the table with their bound.
#[test]
fn every_loop_is_bounded() {
    library::assert_loops_are_known(RENDERER, &LOOPS);

    // Planted errors.
    for planted in ["loop {", "while x < 1.0 {", "for (var i = 0; ; i++) {", "for (; i < 9; i++) {"]
    {
        let problem = loops("planted.wgsl", &format!("fn endless() {{\n    {planted}\n}}"));
        assert!(problem.as_ref().is_err_and(|e| e.contains("endless")), "{planted}: {problem:?}");
    }
    let own = loops("planted.wgsl", "fn new() {\n    for (var i = 0; i < 9; i++) { // for\n}");
    let header = "for (var i = 0; i < 9; i++)";
    assert_eq!(own, Ok(vec![("planted.wgsl".into(), "new".into(), header.into())]));
}

/// Negative test: each check of this file finds planted errors.
#[test]
fn checks_find_planted_errors() {
    let entry = |body: &str| format!("@compute @workgroup_size(1) fn main() {{ {body} }}");
    let problem = |text: &str| check("planted.wgsl", text).err().unwrap_or_default();

    assert_eq!(problem(&entry("let x = 1.0;")), "", "the shell of the planted errors is valid");
    // A parser error, with an excerpt of the source.
    let unknown = problem(&entry("let x = nonsense;"));
    assert!(unknown.contains("planted.wgsl:1") && unknown.contains("nonsense"), "{unknown}");
    // A validation error: it parses, but is invalid.
    let text = format!("@group(0) @binding(0) var<uniform> x: bool;\n{}", entry("let y = x;"));
    assert!(problem(&text).contains("planted.wgsl"), "{}", problem(&text));
    // A feature that limpid does not request.
    assert_ne!(problem(&entry("let x = 1.0lf;")), "", "64-bit floats are not requested");

    // An error for a single value of a constant.
    let divide = entry("let bad = 1u / select(1u, 0u, SWITCH);");
    let text = format!("override SWITCH: bool = false;\n{divide}");
    let problem = specialise("planted.wgsl", &text);
    assert!(problem.as_ref().is_err_and(|e| e.contains("SWITCH\", 1.0")), "{problem:?}");
    // An error once a branch is removed: block comments are not understood.
    let text = format!("override SWITCH: bool = false;\n{}", entry("if SWITCH { /* } */ }"));
    let problem = specialise("planted.wgsl", &text);
    assert!(problem.as_ref().is_err_and(|e| e.contains("SWITCH\", 0.0")), "{problem:?}");

    // A constant without a value cannot be translated.
    let text = format!("override SWITCH: bool = false;\n{divide}");
    let (module, info) = check("planted.wgsl", &text).expect("valid as it stands");
    let problem = translate(&module, &info, naga::ShaderStage::Compute, "main");
    assert!(problem.as_ref().is_err_and(|e| e.contains("SPIR-V")), "{problem:?}");
    // An invalid specialisation.
    let problem = translate_all("planted.wgsl", &text);
    assert!(problem.as_ref().is_err_and(|e| e.contains("SWITCH\", 1.0")), "{problem:?}");
}

/// Browsers' compilers ask for parentheses around a shift beside `|`, `&` or `^`.
#[test]
fn shifts_stand_in_parentheses() {
    library::assert_shifts_stand_in_parentheses(RENDERER);
    assert!(mixes_shifts("a = b | c << 8u;") && mixes_shifts("f((x >> 3u) + (y & 1u << k));"));
    assert!(
        !mixes_shifts("a = b | (c << 8u);") && !mixes_shifts("f(x & 1u, x >> 1u); // a | b << c")
    );
}
