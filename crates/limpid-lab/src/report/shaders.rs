//! The shaders of `crates/limpid-lab/shaders/`, which measure instead of drawing.

use limpid::gpu::shader::Library;

/// The files of `shaders/` in this crate. A test compares the table with the folder.
pub const SHADERS: Library = Library {
    files: &[
        ("report/intersect.wgsl", include_str!("../../shaders/report/intersect.wgsl")),
        ("report/nothing.wgsl", include_str!("../../shaders/report/nothing.wgsl")),
        ("report/stream.wgsl", include_str!("../../shaders/report/stream.wgsl")),
        ("report/arithmetic.wgsl", include_str!("../../shaders/report/arithmetic.wgsl")),
    ],
    roots: &[
        "report/intersect.wgsl",
        "report/nothing.wgsl",
        "report/stream.wgsl",
        "report/arithmetic.wgsl",
    ],
};
