//! WGSL preprocessor: `#import path` pastes a file once, `$word` is replaced by the value in [`Words`].
//!
//! A root file is a pipeline's shader; its imports are at its top, one file per line. Since WGSL does not
//! depend on declaration order, a root may define a function that an imported file calls: this selects
//! the intersector of `refract` and the filter of `smooth`.

use std::borrow::Cow;
use std::collections::HashSet;

/// WGSL files, found by path, and those of them that are compiled.
#[derive(Debug, Clone, Copy)]
pub struct Library {
    /// Every file with its path. Files may import those of the [`RENDERER`]. A path is that of one library: devices keep
    /// pipelines by it.
    pub files: &'static [(&'static str, &'static str)],
    /// The files that are compiled as shaders; they import the others.
    pub roots: &'static [&'static str],
}

/// The files of `shaders/`. A test compares the table with the folder.
pub const RENDERER: Library = Library {
    files: &[
        ("common/camera.wgsl", include_str!("../../shaders/common/camera.wgsl")),
        ("common/layers.wgsl", include_str!("../../shaders/common/layers.wgsl")),
        ("common/optics.wgsl", include_str!("../../shaders/common/optics.wgsl")),
        ("common/samples.wgsl", include_str!("../../shaders/common/samples.wgsl")),
        ("common/sizes.wgsl", include_str!("../../shaders/common/sizes.wgsl")),
        ("common/screen_ray.wgsl", include_str!("../../shaders/common/screen_ray.wgsl")),
        ("common/light_grid.wgsl", include_str!("../../shaders/common/light_grid.wgsl")),
        ("common/lights.wgsl", include_str!("../../shaders/common/lights.wgsl")),
        ("common/mesh.wgsl", include_str!("../../shaders/common/mesh.wgsl")),
        ("common/scene.wgsl", include_str!("../../shaders/common/scene.wgsl")),
        ("common/groups.wgsl", include_str!("../../shaders/common/groups.wgsl")),
        ("common/tiles.wgsl", include_str!("../../shaders/common/tiles.wgsl")),
        ("common/splat.wgsl", include_str!("../../shaders/common/splat.wgsl")),
        ("classify/params.wgsl", include_str!("../../shaders/classify/params.wgsl")),
        ("classify/sums.wgsl", include_str!("../../shaders/classify/sums.wgsl")),
        ("classify/members.wgsl", include_str!("../../shaders/classify/members.wgsl")),
        ("classify/count.wgsl", include_str!("../../shaders/classify/count.wgsl")),
        ("classify/scan.wgsl", include_str!("../../shaders/classify/scan.wgsl")),
        ("classify/order.wgsl", include_str!("../../shaders/classify/order.wgsl")),
        ("classify/moments.wgsl", include_str!("../../shaders/classify/moments.wgsl")),
        ("classify/eigen.wgsl", include_str!("../../shaders/classify/eigen.wgsl")),
        ("classify/spline.wgsl", include_str!("../../shaders/classify/spline.wgsl")),
        ("classify/line.wgsl", include_str!("../../shaders/classify/line.wgsl")),
        ("classify/sheets.wgsl", include_str!("../../shaders/classify/sheets.wgsl")),
        ("classify/interior.wgsl", include_str!("../../shaders/classify/interior.wgsl")),
        ("classify/shape.wgsl", include_str!("../../shaders/classify/shape.wgsl")),
        ("classify/lines.wgsl", include_str!("../../shaders/classify/lines.wgsl")),
        ("classify/around.wgsl", include_str!("../../shaders/classify/around.wgsl")),
        ("classify/points.wgsl", include_str!("../../shaders/classify/points.wgsl")),
        ("classify/normals.wgsl", include_str!("../../shaders/classify/normals.wgsl")),
        ("classify/walls.wgsl", include_str!("../../shaders/classify/walls.wgsl")),
        ("classify/move.wgsl", include_str!("../../shaders/classify/move.wgsl")),
        ("bins/params.wgsl", include_str!("../../shaders/bins/params.wgsl")),
        ("bins/tiles.wgsl", include_str!("../../shaders/bins/tiles.wgsl")),
        ("bins/project.wgsl", include_str!("../../shaders/bins/project.wgsl")),
        ("bins/scan.wgsl", include_str!("../../shaders/bins/scan.wgsl")),
        ("bins/fill.wgsl", include_str!("../../shaders/bins/fill.wgsl")),
        ("splat/ellipsoid.wgsl", include_str!("../../shaders/splat/ellipsoid.wgsl")),
        ("splat/pixel.wgsl", include_str!("../../shaders/splat/pixel.wgsl")),
        ("splat/column.wgsl", include_str!("../../shaders/splat/column.wgsl")),
        ("splat/lists.wgsl", include_str!("../../shaders/splat/lists.wgsl")),
        ("splat/layers.wgsl", include_str!("../../shaders/splat/layers.wgsl")),
        ("splat/empty.wgsl", include_str!("../../shaders/splat/empty.wgsl")),
        ("mixture/sums.wgsl", include_str!("../../shaders/mixture/sums.wgsl")),
        ("mixture/empty.wgsl", include_str!("../../shaders/mixture/empty.wgsl")),
        ("gaps/cells.wgsl", include_str!("../../shaders/gaps/cells.wgsl")),
        ("gaps/runs.wgsl", include_str!("../../shaders/gaps/runs.wgsl")),
        ("gaps/mark.wgsl", include_str!("../../shaders/gaps/mark.wgsl")),
        ("gaps/sides.wgsl", include_str!("../../shaders/gaps/sides.wgsl")),
        ("gaps/split.wgsl", include_str!("../../shaders/gaps/split.wgsl")),
        ("tiles.wgsl", include_str!("../../shaders/tiles.wgsl")),
        ("smooth/blank.wgsl", include_str!("../../shaders/smooth/blank.wgsl")),
        ("smooth/iterate.wgsl", include_str!("../../shaders/smooth/iterate.wgsl")),
        ("smooth/plane_fit.wgsl", include_str!("../../shaders/smooth/plane_fit.wgsl")),
        ("smooth/bilateral.wgsl", include_str!("../../shaders/smooth/bilateral.wgsl")),
        ("smooth/narrow_range.wgsl", include_str!("../../shaders/smooth/narrow_range.wgsl")),
        ("gbuffer.wgsl", include_str!("../../shaders/gbuffer.wgsl")),
        ("host.wgsl", include_str!("../../shaders/host.wgsl")),
        ("opaque.wgsl", include_str!("../../shaders/opaque.wgsl")),
        ("mips/coarsen.wgsl", include_str!("../../shaders/mips/coarsen.wgsl")),
        ("mips/layers.wgsl", include_str!("../../shaders/mips/layers.wgsl")),
        ("mips/planes.wgsl", include_str!("../../shaders/mips/planes.wgsl")),
        ("color/means.wgsl", include_str!("../../shaders/color/means.wgsl")),
        ("sphere_shadows.wgsl", include_str!("../../shaders/sphere_shadows.wgsl")),
        ("diffuse/particles.wgsl", include_str!("../../shaders/diffuse/particles.wgsl")),
        ("diffuse/light.wgsl", include_str!("../../shaders/diffuse/light.wgsl")),
        ("diffuse/cells.wgsl", include_str!("../../shaders/diffuse/cells.wgsl")),
        ("diffuse/fill_cells.wgsl", include_str!("../../shaders/diffuse/fill_cells.wgsl")),
        ("diffuse/place.wgsl", include_str!("../../shaders/diffuse/place.wgsl")),
        ("diffuse/around.wgsl", include_str!("../../shaders/diffuse/around.wgsl")),
        ("diffuse/pixels.wgsl", include_str!("../../shaders/diffuse/pixels.wgsl")),
        ("diffuse/discs.wgsl", include_str!("../../shaders/diffuse/discs.wgsl")),
        ("diffuse/cover.wgsl", include_str!("../../shaders/diffuse/cover.wgsl")),
        ("diffuse/sums.wgsl", include_str!("../../shaders/diffuse/sums.wgsl")),
        ("refract/diffuse.wgsl", include_str!("../../shaders/refract/diffuse.wgsl")),
        ("shade/surface.wgsl", include_str!("../../shaders/shade/surface.wgsl")),
        ("shade/texels.wgsl", include_str!("../../shaders/shade/texels.wgsl")),
        ("turbid/params.wgsl", include_str!("../../shaders/turbid/params.wgsl")),
        ("turbid/slab.wgsl", include_str!("../../shaders/turbid/slab.wgsl")),
        ("turbid/around.wgsl", include_str!("../../shaders/turbid/around.wgsl")),
        ("turbid/means.wgsl", include_str!("../../shaders/turbid/means.wgsl")),
        ("shade/looks.wgsl", include_str!("../../shaders/shade/looks.wgsl")),
        ("shade/material.wgsl", include_str!("../../shaders/shade/material.wgsl")),
        ("shade/packed.wgsl", include_str!("../../shaders/shade/packed.wgsl")),
        ("refract/turbid_lights.wgsl", include_str!("../../shaders/refract/turbid_lights.wgsl")),
        ("refract/turbid.wgsl", include_str!("../../shaders/refract/turbid.wgsl")),
        ("shade/neighbours.wgsl", include_str!("../../shaders/shade/neighbours.wgsl")),
        ("shade/averages.wgsl", include_str!("../../shaders/shade/averages.wgsl")),
        ("shade/means.wgsl", include_str!("../../shaders/shade/means.wgsl")),
        ("shade/around.wgsl", include_str!("../../shaders/shade/around.wgsl")),
        ("shade/body.wgsl", include_str!("../../shaders/shade/body.wgsl")),
        ("refract/looks.wgsl", include_str!("../../shaders/refract/looks.wgsl")),
        ("shade/opaque.wgsl", include_str!("../../shaders/shade/opaque.wgsl")),
        ("refract/opaque_fluids.wgsl", include_str!("../../shaders/refract/opaque_fluids.wgsl")),
        ("refract/bindings.wgsl", include_str!("../../shaders/refract/bindings.wgsl")),
        ("refract/interfaces.wgsl", include_str!("../../shaders/refract/interfaces.wgsl")),
        ("refract/slabs.wgsl", include_str!("../../shaders/refract/slabs.wgsl")),
        ("refract/structure.wgsl", include_str!("../../shaders/refract/structure.wgsl")),
        ("refract/pixels.wgsl", include_str!("../../shaders/refract/pixels.wgsl")),
        ("refract/host.wgsl", include_str!("../../shaders/refract/host.wgsl")),
        ("refract/one_layer.wgsl", include_str!("../../shaders/refract/one_layer.wgsl")),
        ("refract/single.wgsl", include_str!("../../shaders/refract/single.wgsl")),
        ("refract/plane.wgsl", include_str!("../../shaders/refract/plane.wgsl")),
        ("refract/plane3.wgsl", include_str!("../../shaders/refract/plane3.wgsl")),
        ("refract/secant.wgsl", include_str!("../../shaders/refract/secant.wgsl")),
        ("refract/guarded.wgsl", include_str!("../../shaders/refract/guarded.wgsl")),
        ("refract/lists.wgsl", include_str!("../../shaders/refract/lists.wgsl")),
        ("refract/march.wgsl", include_str!("../../shaders/refract/march.wgsl")),
        ("refract/newton.wgsl", include_str!("../../shaders/refract/newton.wgsl")),
        ("caustics/params.wgsl", include_str!("../../shaders/caustics/params.wgsl")),
        ("caustics/light.wgsl", include_str!("../../shaders/caustics/light.wgsl")),
        ("caustics/grid.wgsl", include_str!("../../shaders/caustics/grid.wgsl")),
        ("caustics/landing.wgsl", include_str!("../../shaders/caustics/landing.wgsl")),
        ("caustics/light_sums.wgsl", include_str!("../../shaders/caustics/light_sums.wgsl")),
        ("caustics/forward.wgsl", include_str!("../../shaders/caustics/forward.wgsl")),
        ("caustics/deposit.wgsl", include_str!("../../shaders/caustics/deposit.wgsl")),
        ("caustics/resolve.wgsl", include_str!("../../shaders/caustics/resolve.wgsl")),
        ("bounds.wgsl", include_str!("../../shaders/bounds.wgsl")),
        ("caustics/blur.wgsl", include_str!("../../shaders/caustics/blur.wgsl")),
        ("caustics/conic/form.wgsl", include_str!("../../shaders/caustics/conic/form.wgsl")),
        ("caustics/conic/path.wgsl", include_str!("../../shaders/caustics/conic/path.wgsl")),
        ("caustics/conic.wgsl", include_str!("../../shaders/caustics/conic.wgsl")),
        ("caustics/gather.wgsl", include_str!("../../shaders/caustics/gather.wgsl")),
        ("surface/before.wgsl", include_str!("../../shaders/surface/before.wgsl")),
        ("surface/images.wgsl", include_str!("../../shaders/surface/images.wgsl")),
        ("surface/spheres.wgsl", include_str!("../../shaders/surface/spheres.wgsl")),
        ("tonemap.wgsl", include_str!("../../shaders/tonemap.wgsl")),
    ],
    roots: &[
        "classify/members.wgsl",
        "classify/count.wgsl",
        "classify/scan.wgsl",
        "classify/order.wgsl",
        "classify/interior.wgsl",
        "classify/shape.wgsl",
        "classify/lines.wgsl",
        "classify/points.wgsl",
        "classify/normals.wgsl",
        "classify/move.wgsl",
        "classify/walls.wgsl",
        "bins/project.wgsl",
        "bins/scan.wgsl",
        "bins/fill.wgsl",
        "splat/layers.wgsl",
        "splat/empty.wgsl",
        "mixture/sums.wgsl",
        "mixture/empty.wgsl",
        "gaps/mark.wgsl",
        "gaps/split.wgsl",
        "gaps/sides.wgsl",
        "tiles.wgsl",
        "smooth/blank.wgsl",
        "smooth/plane_fit.wgsl",
        "smooth/bilateral.wgsl",
        "smooth/narrow_range.wgsl",
        "gbuffer.wgsl",
        "host.wgsl",
        "opaque.wgsl",
        "mips/layers.wgsl",
        "mips/planes.wgsl",
        "bounds.wgsl",
        "color/means.wgsl",
        "turbid/around.wgsl",
        "turbid/means.wgsl",
        "diffuse/cells.wgsl",
        "diffuse/fill_cells.wgsl",
        "sphere_shadows.wgsl",
        "diffuse/place.wgsl",
        "diffuse/around.wgsl",
        "diffuse/cover.wgsl",
        "diffuse/sums.wgsl",
        "shade/around.wgsl",
        "shade/means.wgsl",
        "shade/body.wgsl",
        "shade/opaque.wgsl",
        "refract/single.wgsl",
        "refract/plane.wgsl",
        "refract/plane3.wgsl",
        "refract/secant.wgsl",
        "refract/guarded.wgsl",
        "refract/march.wgsl",
        "refract/newton.wgsl",
        "refract/structure.wgsl",
        "caustics/grid.wgsl",
        "caustics/forward.wgsl",
        "caustics/deposit.wgsl",
        "caustics/gather.wgsl",
        "caustics/resolve.wgsl",
        "caustics/blur.wgsl",
        "surface/images.wgsl",
        "surface/spheres.wgsl",
        "tonemap.wgsl",
    ],
};

impl Library {
    /// The text of a file, of the library or the renderer.
    pub fn file(self, path: &str) -> Option<&'static str> {
        let mut files = self.files.iter().chain(RENDERER.files);
        files.find(|(name, _)| *name == path).map(|(_, text)| *text)
    }

    /// Source of a root with its imports pasted, each once, with words.
    ///
    /// # Panics
    /// If there is no such file or a word lacks its value: bugs that the shader tests find.
    pub fn source(self, root: &str, words: Words) -> String {
        resolve(root, words, &mut |path| self.file(path))
    }
}

/// Values of the placeholders in a root and its imports, words that begin with `$`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Words {
    /// `$intersector`: the file of `refract/` to import.
    pub intersector: Option<&'static str>,
    /// `$grain`: how a tile's pixels are divided among threads.
    pub grain: Grain,
    /// `$branching`: uniforms that decide branches are bound as read-only storage. Otherwise software
    /// Vulkan recompiles the shader in every frame. It reads storage lane by lane, so all other
    /// uniforms stay uniforms.
    pub stored_uniforms: bool,
    /// `$layers`: layers are bound as storage textures, see [`layers_are_stored`](super::Gpu::layers_are_stored); then `$level` and
    /// `$at_level`, which follow a texel's layer, are nothing instead of mip level 0 and `level`.
    pub stored_layers: bool,
    /// Layers are sampled textures on any device, because their mip levels are read.
    pub mips: bool,
}

/// How the pixels of a tile are divided among threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Grain {
    /// A thread draws a pixel, and a workgroup reads its tile's list together: for graphics cards.
    #[default]
    Pixel,
    /// A thread draws a column of pixels, and a workgroup several tiles: for software adapters. Eight pixels a thread
    /// take a quarter of the time there of one pixel (lavapipe, `front` at 1024×768).
    Column,
}

impl Grain {
    fn file(self) -> &'static str {
        match self {
            Self::Pixel => "splat/pixel.wgsl",
            Self::Column => "splat/column.wgsl",
        }
    }
}

impl Words {
    /// Selects an intersector.
    pub fn of(intersector: &'static str) -> Self {
        Self { intersector: Some(intersector), ..Self::default() }
    }

    /// Replacement of a word, given without its `$`.
    fn value(self, word: &str) -> Option<&'static str> {
        match word {
            "intersector" => self.intersector,
            "grain" => Some(self.grain.file()),
            "branching" => Some(if self.stored_uniforms { "storage, read" } else { "uniform" }),
            "layers" => Some(match self.stored_layers {
                true => "texture_storage_2d_array<rgba32float, read>",
                false => "texture_2d_array<f32>",
            }),
            "level" => Some(if self.stored_layers { "" } else { ", 0" }),
            "at_level" => Some(if self.stored_layers { "" } else { ", level" }),
            _ => None,
        }
    }

    /// Replaces the words of a line.
    ///
    /// # Panics
    /// If a word has no value.
    fn fill<'a>(self, line: &'a str) -> Cow<'a, str> {
        if !line.contains('$') || line.trim_start().starts_with("//") {
            return line.into();
        }
        let mut parts = line.split('$');
        let mut filled = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let end = part.find(|c: char| c != '_' && !c.is_ascii_alphanumeric());
            let (word, rest) = part.split_at(end.unwrap_or(part.len()));
            filled += self.value(word).unwrap_or_else(|| panic!("${word} has no value"));
            filled += rest;
        }
        filled.into()
    }
}

/// As [`Library::source`], with files supplied by `find`.
///
/// # Panics
/// As [`Library::source`].
pub fn resolve<'a>(
    root: &str,
    words: Words,
    find: &mut dyn FnMut(&str) -> Option<&'a str>,
) -> String {
    fn paste<'a>(
        file: &str,
        words: Words,
        find: &mut dyn FnMut(&str) -> Option<&'a str>,
        pasted: &mut HashSet<String>,
        out: &mut String,
    ) {
        if !pasted.insert(file.to_owned()) {
            return;
        }
        let text = find(file).unwrap_or_else(|| panic!("no shader file {file}"));
        for line in text.lines() {
            let line = words.fill(line);
            match line.strip_prefix("#import ") {
                Some(import) => paste(import.trim(), words, find, pasted, out),
                None => {
                    out.push_str(&line);
                    out.push('\n');
                }
            }
        }
    }
    let mut out = String::new();
    paste(root, words, find, &mut HashSet::new(), &mut out);
    out
}

/// Parses the value of a constant in a shader, for tests that compare it with Rust.
#[cfg(test)]
pub fn constant(root: &str, name: &str) -> f64 {
    let source = RENDERER.source(root, Words::of("refract/guarded.wgsl"));
    let declared = source.lines().find_map(|line| line.strip_prefix("const ")?.strip_prefix(name));
    let declared = declared.unwrap_or_else(|| panic!("{root} has no constant {name}"));
    let (_, value) = declared.split_once('=').expect("a value");
    let value = value.split(';').next().expect("an end").trim();
    value.trim_end_matches(['u', 'i', 'f']).parse().expect("a number")
}
