//! WGSL files, and the one thing WGSL lacks: `#import path`, pasted once.
//!
//! A root file is a pipeline's shader; it imports what it needs at its top, one file per line.
//! Order does not matter to WGSL, so a root may supply a function that an imported body calls:
//! that is how the intersectors of `refract` and the filters of `smooth` are chosen.

use std::collections::HashSet;

use crate::gpu::Gpu;

/// Every WGSL file by its path in `shaders/`. A test compares the table with the folder.
pub const FILES: &[(&str, &str)] = &[
    ("common/camera.wgsl", include_str!("../shaders/common/camera.wgsl")),
    ("common/layers.wgsl", include_str!("../shaders/common/layers.wgsl")),
    ("common/optics.wgsl", include_str!("../shaders/common/optics.wgsl")),
    ("common/screen_ray.wgsl", include_str!("../shaders/common/screen_ray.wgsl")),
    ("common/lights.wgsl", include_str!("../shaders/common/lights.wgsl")),
    ("common/scene.wgsl", include_str!("../shaders/common/scene.wgsl")),
    ("common/groups.wgsl", include_str!("../shaders/common/groups.wgsl")),
    ("common/tiles.wgsl", include_str!("../shaders/common/tiles.wgsl")),
    ("classify/params.wgsl", include_str!("../shaders/classify/params.wgsl")),
    ("classify/sums.wgsl", include_str!("../shaders/classify/sums.wgsl")),
    ("classify/count.wgsl", include_str!("../shaders/classify/count.wgsl")),
    ("classify/scan.wgsl", include_str!("../shaders/classify/scan.wgsl")),
    ("classify/order.wgsl", include_str!("../shaders/classify/order.wgsl")),
    ("classify/moments.wgsl", include_str!("../shaders/classify/moments.wgsl")),
    ("classify/eigen.wgsl", include_str!("../shaders/classify/eigen.wgsl")),
    ("classify/shape.wgsl", include_str!("../shaders/classify/shape.wgsl")),
    ("splat.wgsl", include_str!("../shaders/splat.wgsl")),
    ("cull/select.wgsl", include_str!("../shaders/cull/select.wgsl")),
    ("cull/depths.wgsl", include_str!("../shaders/cull/depths.wgsl")),
    ("cull/draw.wgsl", include_str!("../shaders/cull/draw.wgsl")),
    ("mixture.wgsl", include_str!("../shaders/mixture.wgsl")),
    ("tiles.wgsl", include_str!("../shaders/tiles.wgsl")),
    ("smooth/iterate.wgsl", include_str!("../shaders/smooth/iterate.wgsl")),
    ("smooth/plane_fit.wgsl", include_str!("../shaders/smooth/plane_fit.wgsl")),
    ("smooth/bilateral.wgsl", include_str!("../shaders/smooth/bilateral.wgsl")),
    ("smooth/narrow_range.wgsl", include_str!("../shaders/smooth/narrow_range.wgsl")),
    ("gbuffer.wgsl", include_str!("../shaders/gbuffer.wgsl")),
    ("mips/coarsen.wgsl", include_str!("../shaders/mips/coarsen.wgsl")),
    ("mips/layers.wgsl", include_str!("../shaders/mips/layers.wgsl")),
    ("mips/planes.wgsl", include_str!("../shaders/mips/planes.wgsl")),
    ("refract/interfaces.wgsl", include_str!("../shaders/refract/interfaces.wgsl")),
    ("refract/one_layer.wgsl", include_str!("../shaders/refract/one_layer.wgsl")),
    ("refract/single.wgsl", include_str!("../shaders/refract/single.wgsl")),
    ("refract/plane.wgsl", include_str!("../shaders/refract/plane.wgsl")),
    ("refract/plane3.wgsl", include_str!("../shaders/refract/plane3.wgsl")),
    ("refract/secant.wgsl", include_str!("../shaders/refract/secant.wgsl")),
    ("refract/guarded.wgsl", include_str!("../shaders/refract/guarded.wgsl")),
    ("refract/march.wgsl", include_str!("../shaders/refract/march.wgsl")),
    ("refract/newton.wgsl", include_str!("../shaders/refract/newton.wgsl")),
    ("caustics/params.wgsl", include_str!("../shaders/caustics/params.wgsl")),
    ("caustics/light.wgsl", include_str!("../shaders/caustics/light.wgsl")),
    ("caustics/grid.wgsl", include_str!("../shaders/caustics/grid.wgsl")),
    ("caustics/landing.wgsl", include_str!("../shaders/caustics/landing.wgsl")),
    ("caustics/light_sums.wgsl", include_str!("../shaders/caustics/light_sums.wgsl")),
    ("caustics/forward.wgsl", include_str!("../shaders/caustics/forward.wgsl")),
    ("caustics/deposit.wgsl", include_str!("../shaders/caustics/deposit.wgsl")),
    ("caustics/resolve.wgsl", include_str!("../shaders/caustics/resolve.wgsl")),
    ("caustics/blur.wgsl", include_str!("../shaders/caustics/blur.wgsl")),
    ("caustics/conic.wgsl", include_str!("../shaders/caustics/conic.wgsl")),
    ("caustics/gather.wgsl", include_str!("../shaders/caustics/gather.wgsl")),
    ("tonemap.wgsl", include_str!("../shaders/tonemap.wgsl")),
    ("report/intersect.wgsl", include_str!("../shaders/report/intersect.wgsl")),
    ("report/nothing.wgsl", include_str!("../shaders/report/nothing.wgsl")),
    ("report/stream.wgsl", include_str!("../shaders/report/stream.wgsl")),
    ("report/arithmetic.wgsl", include_str!("../shaders/report/arithmetic.wgsl")),
];

/// The files that are compiled as they are; the others are imported by them.
pub const ROOTS: &[&str] = &[
    "classify/count.wgsl",
    "classify/scan.wgsl",
    "classify/order.wgsl",
    "classify/shape.wgsl",
    "splat.wgsl",
    "cull/select.wgsl",
    "cull/depths.wgsl",
    "cull/draw.wgsl",
    "mixture.wgsl",
    "tiles.wgsl",
    "smooth/plane_fit.wgsl",
    "smooth/bilateral.wgsl",
    "smooth/narrow_range.wgsl",
    "gbuffer.wgsl",
    "mips/layers.wgsl",
    "mips/planes.wgsl",
    "refract/single.wgsl",
    "refract/plane.wgsl",
    "refract/plane3.wgsl",
    "refract/secant.wgsl",
    "refract/guarded.wgsl",
    "refract/march.wgsl",
    "refract/newton.wgsl",
    "caustics/deposit.wgsl",
    "caustics/blur.wgsl",
    "tonemap.wgsl",
    "report/nothing.wgsl",
    "report/stream.wgsl",
    "report/arithmetic.wgsl",
];

/// The text of a file with its imports pasted, each once.
///
/// # Panics
/// If a file is not in [`FILES`]: a defect that the shader tests find.
pub fn source(file: &str) -> String {
    resolve(file, &mut |path| FILES.iter().find(|(name, _)| *name == path).map(|(_, text)| *text))
}

/// As [`source`], with the files that `find` supplies.
pub fn resolve<'a>(file: &str, find: &mut dyn FnMut(&str) -> Option<&'a str>) -> String {
    fn paste<'a>(
        file: &str,
        find: &mut dyn FnMut(&str) -> Option<&'a str>,
        pasted: &mut HashSet<String>,
        out: &mut String,
    ) {
        if !pasted.insert(file.to_owned()) {
            return;
        }
        let text = find(file).unwrap_or_else(|| panic!("no shader file {file}"));
        for line in text.lines() {
            match line.strip_prefix("#import ") {
                Some(import) => paste(import.trim(), find, pasted, out),
                None => {
                    out.push_str(line);
                    out.push('\n');
                }
            }
        }
    }
    let mut out = String::new();
    paste(file, find, &mut HashSet::new(), &mut out);
    out
}

pub fn module(gpu: &Gpu, file: &str) -> wgpu::ShaderModule {
    text_module(gpu, file, source(file))
}

/// A module of text that is not in [`FILES`] as it is.
pub fn text_module(gpu: &Gpu, label: &str, text: String) -> wgpu::ShaderModule {
    let text = if gpu.uniforms_are_stored() { with_stored_uniforms(&text) } else { text };
    gpu.module(label, text)
}

/// The text of `splat.wgsl`, or of one that imports it, whose fragments promise to write no depth beyond
/// that of `depth_bound`: smaller ones for fronts, greater ones for backs.
pub fn with_early_depth(text: &str, back: bool) -> String {
    let promise = if back { "greater_equal" } else { "less_equal" };
    let fragment = "@fragment\nfn fragment(";
    text.replace(fragment, &format!("@early_depth_test({promise})\n{fragment}"))
}

/// Uniforms whose values alone decide branches: `Gpu::branching` in layouts.
const BRANCHING: [&str; 4] = ["lights", "light_views", "caustics", "tonemap"];

/// The text with the uniforms that decide branches as read-only storage, as software Vulkan gets it:
/// there each of them costs a compilation per frame. Storage in turn is read lane by lane, so all
/// others stay uniforms.
pub fn with_stored_uniforms(text: &str) -> String {
    BRANCHING.iter().fold(text.to_owned(), |text, name| {
        text.replace(&format!("var<uniform> {name}:"), &format!("var<storage, read> {name}:"))
    })
}

/// The value of a constant that a shader has, by its text: for tests of what Rust has too.
#[cfg(test)]
pub fn constant(root: &str, name: &str) -> f64 {
    let source = source(root);
    let declared = source.lines().find_map(|line| line.strip_prefix("const ")?.strip_prefix(name));
    let declared = declared.unwrap_or_else(|| panic!("{root} has no constant {name}"));
    let (_, value) = declared.split_once('=').expect("a value");
    let value = value.split(';').next().expect("an end").trim();
    value.trim_end_matches(['u', 'i', 'f']).parse().expect("a number")
}
