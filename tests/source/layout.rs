//! Structs and constants shared by Rust and WGSL have the same names, order, offsets, sizes and scalar
//! kinds.
//!
//! Nothing else detects two swapped fields of the same size. No adapter is needed.

use std::mem::offset_of;

use bytemuck::Zeroable;
use limpid::camera::CameraUniform;
use limpid::gpu::shader;
use limpid::liquid::classify::{self, device};
use limpid::passes::{
    Layers, bins, caustics, color, diffuse, gaps, host, opaque, refract, scene_binding, shade,
    smooth, sphere_shadows, surface, tiles, tonemap, turbid,
};
use limpid::{gpu, scene};
use naga::{Literal, Scalar, ScalarKind, TypeInner};

/// A struct field in either language.
#[derive(Debug, Clone, PartialEq)]
struct Field {
    name: String,
    offset: usize,
    size: usize,
    kind: ScalarKind,
}

/// Scalar kind of a Rust field type.
trait Kind {
    const KIND: ScalarKind;
}

impl Kind for f32 {
    const KIND: ScalarKind = ScalarKind::Float;
}

impl Kind for u32 {
    const KIND: ScalarKind = ScalarKind::Uint;
}

impl Kind for i32 {
    const KIND: ScalarKind = ScalarKind::Sint;
}

impl Kind for glam::Vec2 {
    const KIND: ScalarKind = ScalarKind::Float;
}

impl Kind for glam::Vec3 {
    const KIND: ScalarKind = ScalarKind::Float;
}

// Of their first fields.
impl Kind for sphere_shadows::LightGridData {
    const KIND: ScalarKind = ScalarKind::Float;
}

impl Kind for scene_binding::LightViewData {
    const KIND: ScalarKind = ScalarKind::Float;
}

impl<T: Kind, const N: usize> Kind for [T; N] {
    const KIND: ScalarKind = T::KIND;
}

/// Describes a field; `_get` only infers its type.
fn field<S, T: Kind>(name: &str, offset: usize, _get: fn(&S) -> &T) -> Field {
    Field { name: name.to_owned(), offset, size: size_of::<T>(), kind: T::KIND }
}

/// A struct's fields in the given order, and its size. Omitting a field is a compile error.
macro_rules! rust_struct {
    ($type:path { $($field:ident),* $(,)? }) => {{
        let $type { $($field: _),* } = Zeroable::zeroed();
        let fields = [$(field::<$type, _>(stringify!($field), offset_of!($type, $field), |s| &s.$field)),*];
        (fields.to_vec(), size_of::<$type>())
    }};
}

/// A WGSL struct's fields and its size, from naga.
fn wgsl_struct(text: &str, name: &str) -> (Vec<Field>, usize) {
    let module = naga::front::wgsl::parse_str(text).expect("valid WGSL");
    let find = |(_, ty): (_, &naga::Type)| match &ty.inner {
        TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => {
            Some((members.clone(), *span))
        }
        _ => None,
    };
    let (members, span) = module.types.iter().find_map(find).expect("the struct is in the shader");
    let fields = members.into_iter().map(|member| {
        let inner = &module.types[member.ty].inner;
        let mut element = match *inner {
            TypeInner::Array { base, .. } => &module.types[base].inner,
            _ => inner,
        };
        if let TypeInner::Struct { members, .. } = element {
            element = &module.types[members[0].ty].inner;
        }
        let scalar = match *element {
            TypeInner::Scalar(scalar)
            | TypeInner::Vector { scalar, .. }
            | TypeInner::Matrix { scalar, .. } => scalar,
            ref other => panic!("{name} has a field of type {other:?}"),
        };
        assert_eq!(scalar.width, Scalar::F32.width, "shared structs have 32-bit scalars");
        Field {
            name: member.name.expect("fields have names"),
            offset: member.offset as usize,
            size: inner.size(module.to_ctx()) as usize,
            kind: scalar.kind,
        }
    });
    (fields.collect(), span as usize)
}

/// Removes padding, which may be explicit in one language and implicit in the other.
fn without_padding((fields, size): (Vec<Field>, usize)) -> (Vec<Field>, usize) {
    (fields.into_iter().filter(|field| !field.name.starts_with("pad")).collect(), size)
}

fn same(rust: (Vec<Field>, usize), text: &str, name: &str) -> Result<(), String> {
    let (rust, wgsl) = (without_padding(rust), without_padding(wgsl_struct(text, name)));
    if rust == wgsl { Ok(()) } else { Err(format!("{name}\n Rust: {rust:?}\n WGSL: {wgsl:?}")) }
}

/// A struct in Rust, and the root and the name of its twin in WGSL.
type Shared = ((Vec<Field>, usize), &'static str, &'static str);

/// Structs of the camera and the scene.
fn camera_and_scene() -> Vec<Shared> {
    let camera = rust_struct!(CameraUniform {
        view_from_world,
        origin,
        near,
        size,
        tangent,
        far,
        pad,
        shift
    });
    let scene = rust_struct!(scene_binding::SceneUniform {
        zenith,
        pad_zenith,
        horizon,
        pad_horizon,
        nadir,
        pad_nadir,
        ambient,
        pad_ambient,
        glow_lobes,
        glow_radiances,
    });
    let solid = rust_struct!(scene_binding::SolidData {
        origin,
        shape,
        extent,
        half_extent,
        even,
        tile,
        odd,
        lit,
        phase,
        inv_fade2,
        middle,
        texture,
        rotation,
        mesh,
        number,
    });
    let light =
        rust_struct!(scene_binding::LightData { place, kind, power, straight, map, spheres, pad });
    let light_grid = rust_struct!(sphere_shadows::LightGridData {
        right,
        columns,
        up,
        first,
        away,
        near,
        origin,
        scale,
    });
    let light_view = rust_struct!(scene_binding::LightViewData {
        right,
        half_width,
        up,
        half_height,
        back,
        far,
        origin,
        width,
        corner,
        height,
        layer,
    });
    let light_views = rust_struct!(scene_binding::LightViewsData { views, grids });
    vec![
        (camera, "splat/layers.wgsl", "Camera"),
        (scene, "gbuffer.wgsl", "Scene"),
        (solid, "gbuffer.wgsl", "Solid"),
        (light, "gbuffer.wgsl", "Light"),
        (light_grid, "gbuffer.wgsl", "LightGrid"),
        (light_view, "gbuffer.wgsl", "LightView"),
        (light_views, "gbuffer.wgsl", "LightViews"),
    ]
}

/// Structs of passes.
fn passes() -> Vec<Shared> {
    let bins_params =
        rust_struct!(bins::Params { splats, lanes, tiles, entries, band, swell, rest, kinds, pad });
    let smooth = rust_struct!(smooth::Params { stride, radius, inv_sigma2, delta, mu, least });
    let gaps = rust_struct!(gaps::Params { least });
    let refract = rust_struct!(refract::Params {
        absorption,
        ior,
        contact,
        interfaces,
        internal_bounces,
        reach,
        ambient_shares,
        ambient_paths,
        eye_depth,
        pad_eye_depth,
        scattering,
        anisotropy,
        mean_transmittance,
        radius,
        diffuse_white,
        pad,
        cells_first,
        cells_side,
        cells_across,
        pad_cells,
    });
    let structure = rust_struct!(refract::StructureParams { structure });
    let tonemap = rust_struct!(tonemap::Params { gain, curve, encode, bounded, dither, first_row });
    let host = rust_struct!(host::Params { offset, slope, cleared });
    let opaque = rust_struct!(opaque::Params { depth });
    let surface = rust_struct!(surface::Before {
        view_from_world,
        offset,
        seconds,
        tangent,
        shift,
        reach,
        pad,
    });
    let caustics = rust_struct!(caustics::Params {
        power,
        steps,
        light,
        interfaces,
        cells,
        gain,
        blur,
        level,
        subdivide,
        wet,
        first,
        corner,
        number,
        pad,
    });
    let coloring = rust_struct!(color::Coloring { per_radius, low, per_range });
    let shade = rust_struct!(shade::Params {
        albedo,
        ior,
        roughness,
        mean_transmittance,
        radius,
        film_reflectance
    });
    let diffuse = rust_struct!(diffuse::Params {
        origin,
        radius,
        albedos,
        absorption,
        ior,
        count,
        mean_transmittance,
        white,
        pad,
        cells_first,
        cells_side,
        cells_across,
        pad_end,
    });
    let shadows = rust_struct!(sphere_shadows::ShadowParams { origin, count, lights, pad, grids });
    let turbid = rust_struct!(turbid::Params { absorption, radius, scattering, ior });
    let sections = rust_struct!(tiles::Sections { tiles, words, count });
    vec![
        (bins_params, "bins/project.wgsl", "Params"),
        (smooth, "smooth/plane_fit.wgsl", "Params"),
        (refract, "refract/guarded.wgsl", "Params"),
        (tonemap, "tonemap.wgsl", "Params"),
        (host, "host.wgsl", "Params"),
        (opaque, "opaque.wgsl", "Params"),
        (surface, "surface/images.wgsl", "Before"),
        (caustics, "caustics/deposit.wgsl", "CausticParams"),
        (sections, "tiles.wgsl", "Sections"),
        (gaps, "gaps/split.wgsl", "Params"),
        (structure, "refract/structure.wgsl", "Params"),
        (coloring, "color/means.wgsl", "Coloring"),
        (shade, "shade/around.wgsl", "Params"),
        (turbid, "turbid/around.wgsl", "Params"),
        (diffuse, "diffuse/around.wgsl", "Params"),
        (shadows, "sphere_shadows.wgsl", "ShadowParams"),
    ]
}

/// Structs of classification.
fn classification() -> Vec<Shared> {
    let splat =
        rust_struct!(classify::Splat { centre, radius, diagonal, particle, off_diagonal, tags });
    let classify_params = rust_struct!(device::Params {
        least,
        per_cell,
        greatest,
        members,
        counts,
        cells,
        shift,
        squares,
        support,
        least_weight,
        density_at_rest,
        max_ratio,
        volume_kernel,
        short_axis,
        long_axis,
        splash_radius,
        most_squares,
        smoothing,
        most_neighbours,
        largest_radius,
        full,
        full_cell,
        most_lines,
        tagged,
        wetting,
        most_copies,
        pad,
    });
    let wall = rust_struct!(device::Wall { middle, kind, extent, size, tags, behind, pad });
    let sum = rust_struct!(device::Sum { count, squares });
    vec![
        (splat, "splat/layers.wgsl", "Splat"),
        (classify_params, "classify/shape.wgsl", "Params"),
        (sum, "classify/scan.wgsl", "Sum"),
        (wall, "classify/walls.wgsl", "Wall"),
    ]
}

/// Structs in buffers that Rust writes and shaders read have the same layout.
#[test]
fn shared_structs_agree() {
    for (rust, root, name) in [camera_and_scene(), passes(), classification()].concat() {
        same(rust, &source(root), name).unwrap_or_else(|problem| panic!("{root}: {problem}"));
    }
}

fn source(root: &str) -> String {
    shader::RENDERER.source(root, shader::Words::of("refract/guarded.wgsl"))
}

/// Value of a 32-bit WGSL constant.
fn wgsl_constant(root: &str, name: &str) -> u32 {
    let module = naga::front::wgsl::parse_str(&source(root)).expect("valid WGSL");
    let (_, constant) = module
        .constants
        .iter()
        .find(|(_, constant)| constant.name.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("{root} has no constant {name}"));
    match module.global_expressions[constant.init] {
        naga::Expression::Literal(Literal::U32(value)) => value,
        naga::Expression::Literal(Literal::I32(value)) => value.cast_unsigned(),
        ref other => panic!("{name} is {other:?}"),
    }
}

/// Array lengths, tile sizes, layer indices and other constants have the same values in both languages.
#[test]
fn shared_constants_agree() {
    let table = [
        ("gbuffer.wgsl", "MAX_SOLIDS", scene::MAX_SOLIDS as u32),
        ("gbuffer.wgsl", "MAX_LIGHTS", scene::MAX_LIGHTS as u32),
        ("mixture/sums.wgsl", "MAX_FLUIDS", scene::MAX_FLUIDS as u32),
        ("color/means.wgsl", "COLORS", classify::colors::MAP_COLORS as u32),
        (
            "gbuffer.wgsl",
            "MAX_LIGHT_VIEWS",
            (scene::MAX_LIGHTS * scene_binding::LIGHT_VIEWS) as u32,
        ),
        ("tiles.wgsl", "TILE", gpu::TILE),
        ("sphere_shadows.wgsl", "LIGHT_SLICES", sphere_shadows::SLICES),
        ("splat/layers.wgsl", "FLUID", classify::Splat::BURIED - 1),
        ("bins/fill.wgsl", "THREADS", bins::THREADS),
        ("gaps/mark.wgsl", "CELL", gaps::CELL),
        ("gaps/mark.wgsl", "WORDS", gaps::WORDS),
        ("splat/layers.wgsl", "FRONT", Layers::FRONT),
        ("splat/layers.wgsl", "BACK", Layers::BACK),
        ("classify/scan.wgsl", "ROW", gpu::ROW),
        ("tiles.wgsl", "ROW", gpu::ROW),
        ("classify/scan.wgsl", "THREADS", device::SORTING),
        ("classify/scan.wgsl", "EACH", device::BLOCK / device::SORTING),
        ("classify/shape.wgsl", "BURIED", classify::Splat::BURIED),
        ("classify/shape.wgsl", "INTERIOR", classify::Splat::INTERIOR),
        ("classify/shape.wgsl", "SPLASH", classify::Splat::SPLASH),
        ("classify/shape.wgsl", "HIDDEN", classify::Splat::HIDDEN),
        ("classify/shape.wgsl", "GIVEN", device::GIVEN),
    ];
    for (root, name, value) in table {
        assert_eq!(wgsl_constant(root, name), value, "{name}");
    }
}

/// The bindings of refraction are those that Rust names, in their order.
#[test]
fn bindings_of_refraction_agree() {
    let module = naga::front::wgsl::parse_str(&source("refract/guarded.wgsl")).expect("valid WGSL");
    let mut bound: Vec<_> = (module.global_variables.iter())
        .filter_map(|(_, global)| Some((global.binding?, global.name.as_deref())))
        .filter_map(|(at, name)| (at.group == 1).then_some((at.binding, name.unwrap_or_default())))
        .collect();
    bound.sort_unstable();
    let named: Vec<_> = (0..).zip(refract::BINDINGS).collect();
    assert_eq!(bound, named);
}

/// Negative test: the comparison finds swapped fields, a different kind or size, a missing field and
/// missing padding at the end, and ignores other padding.
#[test]
fn comparison_finds_planted_differences() {
    #[repr(C)]
    #[derive(Clone, Copy, Zeroable)]
    struct Planted {
        a: [f32; 3],
        b: u32,
        c: f32,
        pad: [u32; 3],
    }
    let compare = |text: &str| same(rust_struct!(Planted { a, b, c, pad }), text, "Planted");
    let planted = |fields: &str| compare(&format!("struct Planted {{ {fields} }}"));

    assert_eq!(planted("a: vec3f, b: u32, c: f32"), Ok(()));
    assert_eq!(planted("a: vec3f, b: u32, c: f32, pad: u32"), Ok(()));
    assert!(planted("a: vec3f, c: f32, b: u32").is_err(), "swapped");
    assert!(planted("a: vec3f, b: i32, c: f32").is_err(), "another kind");
    assert!(planted("a: vec2f, pad: f32, b: u32, c: f32").is_err(), "another size");
    assert!(planted("a: vec3f, b: u32, c: f32, d: f32").is_err(), "one more in WGSL");
    assert!(planted("a: vec3f, b: u32").is_err(), "one less in WGSL");
    assert!(planted("a: vec3f, b: u32, c: f32, pad: mat2x4f").is_err(), "a longer struct");
}
