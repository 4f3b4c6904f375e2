//! Static checks of the shader files: all are embedded, and all roots are valid WGSL for the features
//! that limpid requests, in every specialisation. No adapter is needed.

use std::collections::BTreeSet;
use std::fs;
use std::panic::catch_unwind;
use std::path::Path;

use limpid::gpu::shader::{self, FILES, Grain, ROOTS, Variant};
use naga::back::pipeline_constants::process_overrides;
use naga::back::{glsl, hlsl, msl, spv};
use naga::proc::BoundsCheckPolicies;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

/// The benchmark root that imports an intersector.
const MEASURED: &str = "report/intersect.wgsl";

/// The variant for tests of roots, with the default intersector.
const GUARDED: Variant = Variant {
    intersector: Some("refract/guarded.wgsl"),
    grain: Grain::Pixel,
    stored_uniforms: false,
    stored_layers: false,
    mips: false,
};

fn source(root: &str) -> String {
    shader::source(root, GUARDED)
}

/// limpid requests no optional feature that affects WGSL.
const REQUESTED: Capabilities = Capabilities::empty();

/// Parses and validates a source text; a failure is naga's excerpt.
fn check(name: &str, text: &str) -> Result<(naga::Module, ModuleInfo), String> {
    let module =
        naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string_with_path(text, name))?;
    let info = Validator::new(ValidationFlags::all(), REQUESTED)
        .validate(&module)
        .map_err(|e| e.emit_to_string_with_path(text, name))?;
    Ok((module, info))
}

/// Values to test for a pipeline constant: both of a switch, and the ends of a range.
fn values(module: &naga::Module, constant: &naga::Override) -> &'static [f64] {
    match (constant.name.as_deref(), &module.types[constant.ty].inner) {
        (_, naga::TypeInner::Scalar(naga::Scalar::BOOL)) => &[0.0, 1.0],
        (Some("ENVIRONMENT"), _) => &[0.0, 1.0, 2.0, 3.0],
        (Some("SOLIDS"), _) => &[0.0, 1.0, 512.0],
        // No more than the solids, of which there are none by default.
        (Some("MESHES"), _) => &[0.0],
        (Some("LIGHTS"), _) => &[0.0, 1.0, 16.0],
        (Some("SIDE"), _) => &[0.0, 1.0],
        (Some("GAPS"), _) => &[0.0, 1.0, 2.0],
        (Some("GAP"), naga::TypeInner::Scalar(naga::Scalar::I32)) => &[-1.0, 0.0, 1.0],
        (Some("GAP" | "CLASS"), _) => &[0.0, 1.0],
        (Some("METHOD"), _) => &[0.0, 1.0, 2.0],
        (Some("STRIDE"), _) => &[1.0, 2.0, 4.0],
        (Some("SHAPES"), _) => &[0.0, 1.0, 2.0, 4.0, 7.0, 8.0, 15.0],
        (Some("TAPS"), _) => &[1.0, 2.0, 16.0],
        (Some("SAMPLES"), _) => &[1.0, 4.0, 64.0],
        (Some("EDGE_SAMPLES"), _) => &[1.0, 16.0, 64.0],
        (Some("ITERATIONS"), _) => &[0.0, 4.0, 64.0],
        (Some("LANES"), _) => &[1.0, 8.0, 64.0],
        (Some("GROUPS"), _) => &[1.0, 64.0, 2048.0],
        (name, ty) => panic!("the test knows no values for the constant {name:?} of {ty:?}"),
    }
}

/// Sets of constants to specialise by: each value of each constant alone, then all constants at their
/// first and at their last value.
fn specialisations(module: &naga::Module) -> Vec<Vec<(String, f64)>> {
    let constants: Vec<_> = module
        .overrides
        .iter()
        .map(|(_, constant)| {
            let name = constant.name.clone().expect("limpid's constants have names");
            (name, values(module, constant))
        })
        .collect();
    let alone = constants
        .iter()
        .flat_map(|(name, values)| values.iter().map(|&value| vec![(name.clone(), value)]));
    let first = constants.iter().map(|(name, values)| (name.clone(), values[0])).collect();
    let last = constants.iter().map(|(name, v)| (name.clone(), v[v.len() - 1])).collect();
    alone.chain([first, last]).collect()
}

/// Specialises every entry point with every set of constants. Returns the number of specialisations.
fn specialise(name: &str, module: &naga::Module, info: &ModuleInfo) -> Result<usize, String> {
    let sets = specialisations(module);
    for entry in &module.entry_points {
        for set in &sets {
            let chosen = set.iter().cloned().collect();
            process_overrides(module, info, Some((entry.stage, &entry.name)), &chosen)
                .map_err(|e| format!("{name} {} with {set:?}: {e:?}", entry.name))?;
        }
    }
    Ok(sets.len() * module.entry_points.len())
}

/// Translates a fully specialised entry point for every platform: SPIR-V for Vulkan, MSL 2.0 for Metal,
/// HLSL 5.1 for DirectX 12, GLSL ES 3.1 for OpenGL. Returns the sizes in bytes.
fn translate(
    module: &naga::Module,
    info: &ModuleInfo,
    stage: naga::ShaderStage,
    name: &str,
) -> Result<[usize; 4], String> {
    let entry = || Some((stage, name.to_owned()));
    let policies = BoundsCheckPolicies::default();

    let options = spv::PipelineOptions { shader_stage: stage, entry_point: name.to_owned() };
    let spirv = spv::write_vec(module, info, &spv::Options::default(), Some(&options))
        .map_err(|e| format!("SPIR-V: {e}"))?;

    let options = msl::Options { lang_version: (2, 0), ..Default::default() };
    let pipeline = msl::PipelineOptions { entry_point: entry(), ..Default::default() };
    let (metal, translation) =
        msl::write_string(module, info, &options, &pipeline).map_err(|e| format!("MSL: {e}"))?;
    // Binding errors are reported here, not by the writer.
    for translated in translation.entry_point_names {
        translated.map_err(|e| format!("MSL: {e}"))?;
    }

    let (mut direct_x, options) = (String::new(), hlsl::Options::default());
    let pipeline = hlsl::PipelineOptions { entry_point: entry() };
    let translation = hlsl::Writer::new(&mut direct_x, &options, &pipeline)
        .write(module, info, None)
        .map_err(|e| format!("HLSL: {e}"))?;
    for translated in translation.entry_point_names {
        translated.map_err(|e| format!("HLSL: {e}"))?;
    }

    let (mut open_gl, options) = (String::new(), glsl::Options::default());
    let pipeline = glsl::PipelineOptions {
        shader_stage: stage,
        entry_point: name.to_owned(),
        multiview: None,
    };
    glsl::Writer::new(&mut open_gl, module, info, &options, &pipeline, policies)
        .and_then(|mut writer| writer.write())
        .map_err(|e| format!("GLSL ES: {e}"))?;
    Ok([4 * spirv.len(), metal.len(), direct_x.len(), open_gl.len()])
}

/// Translates every entry point with all constants at their first and all at their last values, which
/// includes and excludes every conditional branch.
fn translate_all(name: &str, text: &str) -> Result<usize, String> {
    let (module, info) = check(name, text)?;
    let sets = specialisations(&module);
    let ends = &sets[sets.len() - 2..];
    for entry in &module.entry_points {
        for set in ends {
            let problem = |e: String| format!("{name} {} with {set:?}: {e}", entry.name);
            let chosen = set.iter().cloned().collect();
            let (module, info) =
                process_overrides(&module, &info, Some((entry.stage, &entry.name)), &chosen)
                    .map_err(|e| problem(e.to_string()))?;
            let sizes = translate(&module, &info, entry.stage, &entry.name).map_err(problem)?;
            assert!(sizes.iter().all(|&size| size > 0), "{name}: {sizes:?} bytes");
        }
    }
    Ok(ends.len() * module.entry_points.len())
}

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

/// The files that a root imports, including itself.
fn pasted(root: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for grain in [Grain::Pixel, Grain::Column] {
        shader::resolve(root, Variant { grain, ..GUARDED }, &mut |path| {
            found.insert(path.to_owned());
            FILES.iter().find(|(name, _)| *name == path).map(|(_, text)| *text)
        });
    }
    found
}

/// `FILES` lists every file of the shader folder exactly once.
#[test]
fn table_lists_every_shader_file_once() {
    let mut folder = BTreeSet::new();
    files_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders"), "", &mut folder);
    let table: BTreeSet<_> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(table, folder);
    assert_eq!(table.len(), FILES.len(), "a file is in the table twice");
}

/// Every root validates in every specialisation with the features that limpid requests. Reports all
/// failures at once.
#[test]
fn every_root_is_valid() {
    let broken: Vec<_> = ROOTS
        .iter()
        .filter_map(|root| {
            let text = source(root);
            let stored = shader::source(
                root,
                Variant { stored_uniforms: true, stored_layers: true, ..GUARDED },
            );
            // A new uniform must be added here or become `$branching`.
            let plain = ["camera", "scene", "solids", "params", "absorptions"];
            for (_, uniform) in
                stored.match_indices("var<uniform>").map(|(at, _)| stored.split_at(at))
            {
                let name = uniform.trim_start_matches("var<uniform> ").split(':').next();
                assert!(name.is_some_and(|name| plain.contains(&name)), "{root}: uniform {name:?}");
            }
            let checked = check(root, &stored).and_then(|_| check(root, &text));
            match checked.and_then(|(module, info)| specialise(root, &module, &info)) {
                Ok(specialisations) => {
                    assert!(specialisations > 0, "{root} has no entry point");
                    None
                }
                Err(problem) => Some(problem),
            }
        })
        .collect();
    assert!(broken.is_empty(), "{} broken roots:\n{}", broken.len(), broken.join("\n"));
}

/// Roots that draw tiles are valid in the grain of software adapters too.
#[test]
fn columns_are_valid() {
    let mut drawn = 0;
    for root in ROOTS {
        let text = shader::source(root, Variant { grain: Grain::Column, ..GUARDED });
        if text == source(root) {
            continue;
        }
        drawn += 1;
        let checked = check(root, &text);
        let done = checked.and_then(|(module, info)| specialise(root, &module, &info));
        done.and_then(|_| translate_all(root, &text)).unwrap_or_else(|problem| panic!("{problem}"));
    }
    assert_eq!(drawn, 4, "layers, mixture, marks and sides");
}

/// Every shader translates to SPIR-V, MSL, HLSL and GLSL.
#[test]
fn every_shader_translates_for_every_platform() {
    let roots = ROOTS.iter().map(|root| (*root, source(root)));
    let broken: Vec<_> = roots
        .filter_map(|(name, text)| match translate_all(name, &text) {
            Ok(translated) => {
                assert!(translated > 0, "{name} has no entry point");
                None
            }
            Err(problem) => Some(problem),
        })
        .collect();
    assert!(broken.is_empty(), "{} broken:\n{}", broken.len(), broken.join("\n"));
}

/// The benchmark root is valid with every intersector.
#[test]
fn benchmark_is_valid_with_every_intersector() {
    let is_intersector = |root: &&&str| {
        root.starts_with("refract/") && **root != "refract/structure.wgsl"
            || **root == "report/nothing.wgsl"
    };
    let roots: Vec<_> = ROOTS.iter().filter(is_intersector).collect();
    assert!(roots.len() >= 8, "{roots:?}");
    for root in roots {
        let text = shader::source(MEASURED, Variant::of(root));
        let (module, info) = check(root, &text).unwrap_or_else(|problem| panic!("{problem}"));
        specialise(root, &module, &info).unwrap_or_else(|problem| panic!("{problem}"));
    }
}

/// There are no dead files, which would never be compiled or checked.
#[test]
fn every_file_is_a_root_or_imported_by_one() {
    let used: BTreeSet<_> = ROOTS.iter().flat_map(|root| pasted(root)).collect();
    for (name, _) in FILES {
        assert!(used.contains(*name), "{name} is neither a root nor imported by one");
    }
    for root in ROOTS {
        assert!(FILES.iter().any(|(name, _)| name == root), "no file for the root {root}");
    }
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

/// Every loop of every shader: file, function, header and the bound on its iterations.
#[rustfmt::skip]
const LOOPS: [(&str, &str, &str, &str); 171] = [
    ("bounds.wgsl", "bound", "for (var row = 1u; row < 8u; row++)", "a constant"),
    ("bounds.wgsl", "bound", "for (var x = select(TILE, 0u, listed); x < TILE; x++)", "a constant"),
    ("refract/guarded.wgsl", "clear_until", "for (var i = select(MOST_TILES, 0u, BOUNDS); i < MOST_TILES && end < 1.0; i++)", "a constant"),
    ("refract/pixels.wgsl", "edge_pixels", "for (var i = id.x; i < listed_count(); i += LIST_GROUP * groups.x)", "the picture's pixels, over 64 times as many as the largest dispatch has groups"),
    ("refract/pixels.wgsl", "structured_pixels", "for (var i = 1u; i < SAMPLES; i++)", "refract.samples, 64 at most"),
    ("refract/pixels.wgsl", "structured_pixels", "for (var k = id.x; k < listed_count(); k += LIST_GROUP * groups.x)", "the picture's pixels, over 64 times as many as the largest dispatch has groups"),
    ("refract/structure.wgsl", "has_structure", "for (var axis = 0; axis < 2; axis++)", "a constant"),
    ("caustics/blur.wgsl", "blur", "for (var i = max(-reach, -along); i <= min(reach, last - along); i++)", "the map's side"),
    ("caustics/conic.wgsl", "conic_first_exit", "for (var edge = 0u; edge < 3u; edge++)", "a constant"),
    ("caustics/conic.wgsl", "conic_solve", "for (var i = 0u; i < CONIC_ROUNDS; i++)", "a constant"),
    ("caustics/conic.wgsl", "conic_walk", "for (var k = 0; k < 4 && beginning.found && conic_is_outside(beginning.x); k++)", "a constant"),
    ("caustics/conic.wgsl", "conic_walk", "for (var k = 0u; k < 6u && !beginning.sure; k++)", "a constant"),
    ("caustics/conic.wgsl", "conic_walk", "for (var turn = 0; turn < 2; turn++)", "a constant"),
    ("caustics/conic.wgsl", "conic_walk_near", "for (var k = 0u; k < CONIC_SEARCHED; k++)", "a constant"),
    ("caustics/conic.wgsl", "conic_walk_near", "for (var turn = 0; turn < 2; turn++)", "a constant"),
    ("caustics/conic.wgsl", "conic_follow", "for (var step = 0u; exit.found && step <= steps; step++)", "caustics.steps, 4096 at most"),
    ("caustics/deposit.wgsl", "deposit", "for (var half = 0u; half < 2u; half++)", "a constant"),
    ("caustics/deposit.wgsl", "deposit_large", "for (var i = caustics.first.x / 8u + group.x; i < count; i += GROUPS)", "the cells' halves, shared by GROUPS workgroups"),
    ("caustics/deposit.wgsl", "deposit_patch", "for (var half = 0; half < 2; half++)", "a constant"),
    ("caustics/deposit.wgsl", "patch_at", "for (var k = 0; k < SIDE * SIDE; k++)", "a constant"),
    ("caustics/deposit.wgsl", "patch_point", "for (var j = 0; j < SIDE; j++)", "a constant"),
    ("caustics/deposit.wgsl", "patch_point", "for (var i = 0; i < SIDE; i++)", "a constant"),
    ("caustics/deposit.wgsl", "deposit_patch", "for (var j = 0; j < parts; j++)", "caustics.subdivide, 8 at most"),
    ("caustics/deposit.wgsl", "deposit_patch", "for (var i = 0; i < parts; i++)", "caustics.subdivide, 8 at most"),
    ("caustics/deposit.wgsl", "deposit_in_parts", "for (var j = 0; j < PARTS; j++)", "a constant"),
    ("caustics/deposit.wgsl", "deposit_in_parts", "for (var i = 0; i < 2 * (PARTS - j) - 1; i++)", "a constant"),
    ("caustics/deposit.wgsl", "add_triangle", "for (var i = i32(lane); i < SPECKS * SPECKS; i += i32(LANES))", "a constant"),
    ("caustics/deposit.wgsl", "add_triangle", "for (var i = lane; i < texels; i += LANES)", "LARGEST_BOX texels of the map"),
    ("caustics/deposit.wgsl", "add_to_texel", "for (var i = 0u; i < 3u; i++)", "a constant"),
    ("caustics/gather.wgsl", "line_pixel", "for (var k = 0; k < 5; k++)", "a constant"),
    ("caustics/grid.wgsl", "grid_vertices", "for (var i = 0; i < 4; i++)", "a constant"),
    ("classify/eigen.wgsl", "eigen", "for (var i = 0u; i < ROTATIONS; i++)", "a constant"),
    ("classify/moments.wgsl", "moments", "for (var z = first.z; z <= last.z; z++)", "cells within the support, 10 radii at most, and the grid"),
    ("classify/moments.wgsl", "moments", "for (var y = first.y; y <= last.y; y++)", "cells within the support, 10 radii at most, and the grid"),
    ("classify/moments.wgsl", "moments", "for (var slot = begin; slot < end; slot++)", "the particles of a run of cells; crowds are left to the CPU, or spheres"),
    ("classify/interior.wgsl", "is_full", "for (var i = 0u; i < 8u; i++)", "a constant"),
    ("classify/interior.wgsl", "mark", "for (var i = 0u; i < select(0u, 8u, marked); i++)", "a constant"),
    ("classify/lines.wgsl", "count_lines", "for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++)", "the particles of a cell; crowds are left to the CPU, or spheres"),
    ("classify/lines.wgsl", "list_lines", "for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++)", "the particles of a cell; crowds are left to the CPU, or spheres"),
    ("classify/points.wgsl", "march", "for (var i = 0u; i <= STEPS; i++)", "a constant"),
    ("classify/points.wgsl", "march", "for (var z = cells.first.z; z <= cells.last.z; z++)", "cells within four radii of a line"),
    ("classify/points.wgsl", "march", "for (var y = cells.first.y; y <= cells.last.y; y++)", "cells within four radii of a line"),
    ("classify/points.wgsl", "march", "for (var slot = starts[cell_index(vec3u(cells.first.x, y, z))]; slot < end; slot++)", "the particles of a run of cells; crowds are left to the CPU, or spheres"),
    ("classify/points.wgsl", "march", "for (var i = 0u; i <= STEPS; i++)", "a constant"),
    ("classify/points.wgsl", "field_at", "for (var z = cells.first.z; z <= cells.last.z; z++)", "cells within four radii of a line"),
    ("classify/points.wgsl", "field_at", "for (var y = cells.first.y; y <= cells.last.y; y++)", "cells within four radii of a line"),
    ("classify/points.wgsl", "field_at", "for (var slot = starts[cell_index(vec3u(cells.first.x, y, z))]; slot < end; slot++)", "the particles of a run of cells; crowds are left to the CPU, or spheres"),
    ("classify/points.wgsl", "point_on", "for (var i = 1u; i <= STEPS && outer.y >= 0.0; i++)", "a constant"),
    ("classify/points.wgsl", "point_on", "for (var i = 0u; i < REFINEMENTS; i++)", "a constant"),
    ("classify/normals.wgsl", "mean_normals", "for (var z = cells.first.z; z <= cells.last.z; z++)", "cells within six radii of a point, fifteen where radii differ"),
    ("classify/normals.wgsl", "mean_normals", "for (var y = cells.first.y; y <= cells.last.y; y++)", "cells within six radii of a point, fifteen where radii differ"),
    ("classify/normals.wgsl", "mean_normals", "for (var k = line_starts[cell_index(vec3u(cells.first.x, y, z))]; k < end; k++)", "the lines of a run of cells, three for each particle"),
    ("classify/move.wgsl", "smoothing", "for (var z = cells.first.z; z <= cells.last.z; z++)", "cells within seven radii of a point, sixteen where radii differ"),
    ("classify/move.wgsl", "smoothing", "for (var y = cells.first.y; y <= cells.last.y; y++)", "cells within seven radii of a point, sixteen where radii differ"),
    ("classify/move.wgsl", "smoothing", "for (var k = line_starts[cell_index(vec3u(cells.first.x, y, z))]; k < end; k++)", "the lines of a run of cells, three for each particle"),
    ("classify/move.wgsl", "move_splats", "for (var i = first; i < first + count; i++)", "a member's lines, three at most"),
    ("classify/walls.wgsl", "count_copies", "for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++)", "the particles of a cell; crowds are left to the CPU, or spheres"),
    ("classify/walls.wgsl", "count_copies", "for (var i = 0u; i < arrayLength(&walls); i++)", "the scene's solids, 512 at most"),
    ("classify/walls.wgsl", "list_copies", "for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++)", "the particles of a cell; crowds are left to the CPU, or spheres"),
    ("classify/walls.wgsl", "list_copies", "for (var i = 0u; i < arrayLength(&walls); i++)", "the scene's solids, 512 at most"),
    ("classify/order.wgsl", "arrange", "for (var other = begin; other < end; other++)", "the particles of a cell; crowds are left to the CPU, or spheres"),
    ("classify/scan.wgsl", "sum_before", "for (var stride = 1u; stride < THREADS; stride *= 2u)", "log2 of the workgroup's threads"),
    ("classify/scan.wgsl", "sum_squares", "for (var stride = THREADS / 2u; stride > 0u; stride /= 2u)", "log2 of the workgroup's threads"),
    ("classify/scan.wgsl", "add_blocks", "for (var k = 0u; k < EACH; k++)", "a constant"),
    ("classify/scan.wgsl", "add_sums", "for (var block = first; block < end; block++)", "blocks of the particles or cells, over the workgroup's threads"),
    ("classify/scan.wgsl", "add_sums", "for (var block = first; block < end; block++)", "blocks of the particles or cells, over the workgroup's threads"),
    ("classify/scan.wgsl", "begin_cells", "for (var k = 0u; k < EACH; k++)", "a constant"),
    ("classify/scan.wgsl", "begin_cells", "for (var k = 0u; k < EACH && first + k <= params.cells; k++)", "a constant"),
    ("common/lights.wgsl", "dry_share", "for (var i = 0; i < select(0, AROUND, point.inside); i++)", "a constant"),
    ("common/lights.wgsl", "light_of_map", "for (var i = 0; i < select(0, AROUND, point.inside && faces); i++)", "a constant"),
    ("common/mesh.wgsl", "mesh_trace", "for (var leaves = 0u; leaves < most_nodes() && node < triangles; leaves++)", "the nodes of all meshes, with the next"),
    ("common/mesh.wgsl", "mesh_trace", "for (var visited = 0u; visited < most_nodes() && node < triangles && count == 0u; visited++)", "the nodes of all meshes"),
    ("common/mesh.wgsl", "mesh_trace", "for (var i = first; i < first + count; i++)", "the triangles of a leaf"),
    ("common/mesh.wgsl", "triangle_trace", "for (var i = 0u; i < select(0u, 3u, on_edge); i++)", "a constant"),
    ("common/mesh.wgsl", "mesh_is_near", "for (var visited = 0u; visited < most_nodes() && node < solid.mesh.y; visited++)", "the nodes of all meshes"),
    ("common/mesh.wgsl", "mesh_is_near", "for (var i = first; i < first + select(0u, count, near); i++)", "the triangles of a leaf"),
    ("common/mesh.wgsl", "mesh_shading_normal", "for (var i = 0u; i < 3u; i++)", "a constant"),
    ("common/mesh.wgsl", "mesh_color", "for (var i = 0u; i < 3u; i++)", "a constant"),
    ("common/mesh.wgsl", "texture_level", "for (var i = 0u; i < level; i++)", "the levels of a texture"),
    ("common/scene.wgsl", "scene_trace", "for (var i = 0u; i < SOLIDS - MESHES; i++)", "the scene's solids, 512 at most"),
    ("common/scene.wgsl", "scene_trace", "for (var i = SOLIDS - MESHES; i < SOLIDS; i++)", "the scene's solids, 512 at most"),
    ("common/scene.wgsl", "scene_blocks", "for (var i = 0u; i < SOLIDS - MESHES; i++)", "the scene's solids, 512 at most"),
    ("common/scene.wgsl", "scene_blocks", "for (var i = SOLIDS - MESHES; i < SOLIDS; i++)", "the scene's solids, 512 at most"),
    ("common/scene.wgsl", "solid_radiance", "for (var i = 0u; i < LIGHTS; i++)", "the scene's lights, 16 at most"),
    ("caustics/forward.wgsl", "light_path", "for (var body = 0u; body <= GAPS; body++)", "layers.intervals, 3 at most"),
    ("caustics/resolve.wgsl", "straight", "for (var gap = select(i32(GAPS), 0, slabs.aggregate_has_gap); gap < i32(GAPS); gap++)", "layers.intervals, 3 at most"),
    ("caustics/resolve.wgsl", "straight", "for (var gap = select(i32(GAPS), 0, slabs.splash_has_gap); gap < i32(GAPS); gap++)", "layers.intervals, 3 at most"),
    ("bins/project.wgsl", "project", "for (var i = lane; i < select(rect.size.x * rect.size.y, 0u, is_large(rect)); i += params.lanes)", "the picture's tiles"),
    ("bins/project.wgsl", "count_large", "for (var k = group.x; k < atomicLoad(&large.count); k += groups.x)", "large splats, over the workgroups"),
    ("bins/project.wgsl", "count_large", "for (var i = local; i < rect.size.x * rect.size.y; i += THREADS)", "the picture's tiles"),
    ("bins/scan.wgsl", "sum", "for (var i = 0u; i < EACH && first + i < arrayLength(&counts); i++)", "a constant"),
    ("bins/scan.wgsl", "sum", "for (var stride = THREADS / 2u; stride > 0u; stride /= 2u)", "log2 of the workgroup's threads"),
    ("bins/scan.wgsl", "scan", "for (var i = 0u; i < EACH && first + i < tiles; i++)", "a constant"),
    ("bins/scan.wgsl", "scan", "for (var other = local; other < min(block, arrayLength(&blocks)); other += THREADS)", "blocks of the tiles, over the workgroup's threads"),
    ("bins/scan.wgsl", "scan", "for (var stride = THREADS / 2u; stride > 0u; stride /= 2u)", "log2 of the workgroup's threads"),
    ("bins/scan.wgsl", "scan", "for (var stride = 1u; stride < THREADS; stride *= 2u)", "log2 of the workgroup's threads"),
    ("bins/scan.wgsl", "scan", "for (var i = 0u; i < EACH && first + i < tiles; i++)", "a constant"),
    ("bins/fill.wgsl", "fill", "for (var i = thread % params.lanes; i < select(outer.size.x * outer.size.y, 0u, is_large(outer)); i += params.lanes)", "the picture's tiles"),
    ("bins/fill.wgsl", "fill_large", "for (var k = group.x; k < large.count; k += groups.x)", "large splats, over the workgroups"),
    ("bins/fill.wgsl", "fill_large", "for (var i = local; i < outer.size.x * outer.size.y; i += THREADS)", "the picture's tiles"),
    ("splat/layers.wgsl", "initial", "for (var i = 0u; i < PART; i++)", "a constant"),
    ("splat/layers.wgsl", "store", "for (var i = 0u; i < PART; i++)", "a constant"),
    ("splat/layers.wgsl", "draw", "for (var base = entries.begin; base < entries.inner_end; base += THREADS)", "the splats of a tile's list"),
    ("splat/layers.wgsl", "draw", "for (var k = 0u; k < min(THREADS, entries.inner_end - base); k++)", "the splats of a tile's list"),
    ("splat/layers.wgsl", "draw", "for (var i = entries.begin; i < entries.inner_end; i++)", "the splats of a tile's list"),
    ("mixture/sums.wgsl", "store", "for (var i = 0u; i < PART; i++)", "a constant"),
    ("mixture/sums.wgsl", "store", "for (var k = 0u; k < 4u; k++)", "a constant"),
    ("mixture/sums.wgsl", "draw", "for (var base = entries.begin; base < entries.inner_end; base += THREADS)", "the splats of a tile's list"),
    ("mixture/sums.wgsl", "draw", "for (var k = 0u; k < min(THREADS, entries.inner_end - base); k++)", "the splats of a tile's list"),
    ("mixture/sums.wgsl", "draw", "for (var i = entries.begin; i < entries.inner_end; i++)", "the splats of a tile's list"),
    ("gaps/mark.wgsl", "bins_of", "for (var word = 0u; word < WORDS; word++)", "a constant"),
    ("gaps/mark.wgsl", "mark_tile", "for (var i = entries.begin + thread / CELLS; i < end; i += THREADS / CELLS)", "the splats of a tile's list"),
    ("gaps/mark.wgsl", "mark_tile", "for (var word = 0u; word < WORDS; word++)", "a constant"),
    ("gaps/mark.wgsl", "mark_tile", "for (var word = 0u; word < WORDS; word++)", "a constant"),
    ("gaps/mark.wgsl", "mark_tile", "for (var word = 0u; word < WORDS; word++)", "a constant"),
    ("gaps/sides.wgsl", "initial", "for (var i = 0u; i < PART; i++)", "a constant"),
    ("gaps/sides.wgsl", "store", "for (var i = 0u; i < PART; i++)", "a constant"),
    ("gaps/sides.wgsl", "draw", "for (var base = entries.begin; base < entries.end; base += THREADS)", "the splats of a tile's list"),
    ("gaps/sides.wgsl", "draw", "for (var k = 0u; k < min(THREADS, entries.end - base); k++)", "the splats of a tile's list"),
    ("gaps/sides.wgsl", "draw", "for (var i = entries.begin; i < entries.end; i++)", "the splats of a tile's list"),
    ("gaps/sides.wgsl", "sides", "for (var gap = 0u; gap < select(0u, GAPS, drawn); gap++)", "layers.intervals, 3 at most"),
    ("gaps/runs.wgsl", "runs_of", "for (var i = 0u; i < 6u; i++)", "a constant"),
    ("gaps/runs.wgsl", "splits_of", "for (var i = 0u; i < GAPS; i++)", "a constant"),
    ("gaps/split.wgsl", "fill_window", "for (var i = 0u; i < WINDOW * WINDOW; i++)", "a constant"),
    ("gaps/split.wgsl", "spread_splits", "for (var k = 0u; k < 9u && splits.x <= 0.0; k++)", "a constant"),
    ("gaps/split.wgsl", "split", "for (var of_class = 0u; of_class <= select(0u, 1u, SPLASH); of_class++)", "the classes"),
    ("gaps/split.wgsl", "split", "for (var k = 0u; k < CELLS_PER_TILE * CELLS_PER_TILE; k++)", "a constant"),
    ("refract/guarded.wgsl", "liquid_exit", "for (var i = 0u; i <= EXIT_STEPS; i++)", "a constant"),
    ("refract/guarded.wgsl", "liquid_exit", "for (var once = 0u; once < select(0u, 1u, crossed); once++)", "a constant"),
    ("refract/guarded.wgsl", "front_entry", "for (var i = 0u; i < ENTRY_STEPS * (ENTRY_BISECTIONS + 1u); i++)", "a constant"),
    ("refract/interfaces.wgsl", "class_interval", "for (var once = 0; once < select(0, 1, of_splashes); once++)", "a constant"),
    ("refract/interfaces.wgsl", "class_interval", "for (var gap = select(i32(GAPS), 0, has_gap); gap < i32(GAPS); gap++)", "layers.intervals, 3 at most"),
    ("refract/interfaces.wgsl", "interface_normal", "for (var i = 0u; i < select(0u, OUTLINE_TEXELS, hit.on_outline); i++)", "a constant"),
    ("refract/one_layer.wgsl", "nearest_plane", "for (var gap = select(i32(GAPS), 0, has_gap); gap < i32(GAPS); gap++)", "layers.intervals, 3 at most"),
    ("refract/slabs.wgsl", "slabs_at", "for (var gap = select(i32(GAPS), 0, slabs.aggregate_has_gap); gap < i32(GAPS); gap++)", "layers.intervals, 3 at most"),
    ("refract/slabs.wgsl", "slabs_at", "for (var gap = select(i32(GAPS), 0, slabs.splash_has_gap); gap < i32(GAPS); gap++)", "layers.intervals, 3 at most"),
    ("smooth/iterate.wgsl", "copy", "for (var gap = 0; gap < GAPS; gap++)", "layers.intervals, 3 at most"),
    ("smooth/iterate.wgsl", "has_gap", "for (var gap = select(GAPS, 0, layer == FRONT && splits.y > 0.0); gap < GAPS; gap++)", "layers.intervals, 3 at most"),
    ("smooth/iterate.wgsl", "has_gap", "for (var gap = select(GAPS, 0, layer == BACK && splits.w > 0.0); gap < GAPS; gap++)", "layers.intervals, 3 at most"),
    ("mips/coarsen.wgsl", "coarsen", "for (var i = 0; i < 4; i++)", "a constant"),
    ("mips/coarsen.wgsl", "coarsen", "for (var i = 0; i < 4; i++)", "a constant"),
    ("refract/guarded.wgsl", "opaque_entry", "for (var i = 0u; i < OPAQUE_STEPS; i++)", "a constant"),
    ("refract/host.wgsl", "background_radiance", "for (var k = 0u; k < 4u; k++)", "a constant"),
    ("refract/host.wgsl", "host_radiance", "for (var k = 0u; k < 4u; k++)", "a constant"),
    ("refract/interfaces.wgsl", "liquid_entry", "for (var i = 0; i < select(1, 2, SPLASH); i++)", "a constant"),
    ("refract/interfaces.wgsl", "trace", "for (var event = 0u; event < 18u; event++)", "a constant"),
    ("refract/pixels.wgsl", "background_mean", "for (var i = 0u; i < count; i++)", "refract.samples or refract.edge_samples, 64 at most"),
    ("refract/pixels.wgsl", "background_pixels", "for (var k = 0; k < select(2, 3, thread < 17); k++)", "3"),
    ("refract/pixels.wgsl", "background_pixels", "for (var k = 0; k < 4; k++)", "a constant"),
    ("refract/pixels.wgsl", "draw_background", "for (var probe = 0u; probe < 5u + EDGE_SAMPLES; probe++)", "the setting, 64 at most"),
    ("refract/pixels.wgsl", "is_hidden", "for (var probe = 0; probe < 5; probe++)", "a constant"),
    ("refract/pixels.wgsl", "refract_pixels", "for (var i = 0u; i < SAMPLES; i++)", "refract.samples, 64 at most"),
    ("refract/march.wgsl", "liquid_exit", "for (var i = 0u; i < most_texels() && walk.tau < 1.0; i++)", "the picture's sides"),
    ("refract/march.wgsl", "front_entry", "for (var i = 0u; i < most_texels() && walk.tau < 1.0; i++)", "the picture's sides"),
    ("refract/march.wgsl", "strided_exit", "for (var i = 0u; i < most_texels() && tau < 1.0; i++)", "the picture's sides"),
    ("refract/march.wgsl", "strided_entry", "for (var i = 0u; i < most_texels() && tau < 1.0; i++)", "the picture's sides"),
    ("refract/newton.wgsl", "intersect", "for (var i = 0u; i <= ITERATIONS; i++)", "refract.iterations, 64 at most"),
    ("refract/secant.wgsl", "intersect", "for (var i = 0u; i < ITERATIONS; i++)", "refract.iterations, 64 at most"),
    ("report/arithmetic.wgsl", "arithmetic", "for (var i = 0u; i < ROUNDS; i++)", "a constant"),
    ("surface/images.wgsl", "images", "for (var i = 0u; i < SAMPLES; i++)", "refract.samples, 64 at most"),
    ("surface/images.wgsl", "surface_velocity", "for (var k = 0; k < (2 * SIDE + 1) * (2 * SIDE + 1); k++)", "a constant"),
    ("smooth/blank.wgsl", "blank", "for (var x = select(0u, TILE, !emptied); x < TILE; x++)", "a constant"),
    ("smooth/blank.wgsl", "blank", "for (var layer = select(0, 1, covered); layer < select(0, 2, inside); layer++)", "a constant"),
    ("smooth/bilateral.wgsl", "smoothed", "for (var y = -TAPS; y <= TAPS; y++)", "smooth.taps, 33 at most"),
    ("smooth/bilateral.wgsl", "smoothed", "for (var x = -TAPS; x <= TAPS; x++)", "smooth.taps, 33 at most"),
    ("smooth/narrow_range.wgsl", "smoothed", "for (var ring = 1; ring <= TAPS; ring++)", "smooth.taps, 33 at most"),
    ("smooth/narrow_range.wgsl", "smoothed", "for (var i = 0; i < 4 * ring; i++)", "smooth.taps, 33 at most"),
    ("smooth/plane_fit.wgsl", "smoothed", "for (var y = -TAPS; y <= TAPS; y++)", "smooth.taps, 33 at most"),
    ("smooth/plane_fit.wgsl", "smoothed", "for (var x = -TAPS; x <= TAPS; x++)", "smooth.taps, 33 at most"),
    ("splat/ellipsoid.wgsl", "cut_slopes", "for (var i = 0; i < 2; i++)", "a constant"),
    ("tiles.wgsl", "sort", "for (var i = 0u; i < TILE * TILE && !covered; i++)", "a constant"),
];

/// File, function and header of a loop.
type Loop = (String, String, String);

/// Lists the loops of a shader. Fails for a loop whose header is not a counted loop with a condition.
fn loops(file: &str, text: &str) -> Result<Vec<Loop>, String> {
    let mut function = "";
    let mut found = Vec::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap_or_default().trim();
        let words: Vec<_> = code.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
        if let Some(at) = words.iter().position(|&word| word == "fn") {
            function = words.get(at + 1).copied().unwrap_or_default();
        }
        if !["for", "while", "loop"].iter().any(|keyword| words.contains(keyword)) {
            continue;
        }
        let header = code.trim_end_matches('{').trim();
        let parts: Vec<_> = header.split(';').map(str::trim).collect();
        let counted = header.starts_with("for (var ")
            && parts.len() == 3
            && ["<", "<=", ">"].iter().any(|compare| parts[1].contains(&format!(" {compare} ")))
            && parts[2] != ")";
        if !counted {
            return Err(format!("{file}, {function}: {header} has no bound"));
        }
        found.push((file.to_owned(), function.to_owned(), header.to_owned()));
    }
    Ok(found)
}

/// Every loop is bounded by the picture, the map, the scene or a constant: the program cannot react to
/// signals while the device is stuck in a loop. New loops must be added to the table with their bound.
#[test]
fn every_loop_is_bounded() {
    let mut found: Vec<Loop> = FILES
        .iter()
        .flat_map(|(file, text)| loops(file, text).unwrap_or_else(|problem| panic!("{problem}")))
        .collect();
    let own = |&(file, function, header, bound): &(&str, &str, &str, &str)| {
        assert!(!bound.is_empty(), "{file}, {function}: {header}");
        (file.to_owned(), function.to_owned(), header.to_owned())
    };
    let mut known: Vec<Loop> = LOOPS.iter().map(own).collect();
    found.sort();
    known.sort();
    let new: Vec<_> = found.iter().filter(|one| !known.contains(one)).collect();
    assert!(new.is_empty(), "not in the table: {new:#?}");
    assert_eq!(found, known, "loops are gone, or occur more often than in the table");

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
    let (module, info) = check("planted.wgsl", &text).expect("valid as it stands");
    let problem = specialise("planted.wgsl", &module, &info);
    assert!(problem.as_ref().is_err_and(|e| e.contains("SWITCH\", 1.0")), "{problem:?}");

    // A constant without a value cannot be translated.
    let (module, info) = check("planted.wgsl", &text).expect("valid as it stands");
    let problem = translate(&module, &info, naga::ShaderStage::Compute, "main");
    assert!(problem.as_ref().is_err_and(|e| e.contains("SPIR-V")), "{problem:?}");
    // An invalid specialisation.
    let problem = translate_all("planted.wgsl", &text);
    assert!(problem.as_ref().is_err_and(|e| e.contains("SWITCH\", 1.0")), "{problem:?}");
}

/// Whether a line has a shift beside a bitwise operation without parentheses between them, which browsers refuse.
fn mixes_shifts(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    let code = code.replace("&&", " ").replace("||", " ");
    // For each open parenthesis, whether there was a shift and a bitwise operation.
    let mut levels = vec![(false, false)];
    let mut last = ' ';
    for c in code.chars() {
        let top = levels.len() - 1;
        match c {
            '(' | '[' => levels.push((false, false)),
            ')' | ']' if top > 0 => drop(levels.pop()),
            ',' | ';' | '=' => levels[top] = (false, false),
            '<' | '>' if last == c => levels[top].0 = true,
            '|' | '&' | '^' => levels[top].1 = true,
            _ => {}
        }
        if levels.contains(&(true, true)) {
            return true;
        }
        last = c;
    }
    false
}

/// Browsers' compilers ask for parentheses around a shift beside `|`, `&` or `^`.
#[test]
fn shifts_stand_in_parentheses() {
    for (name, text) in FILES {
        for (number, line) in (1..).zip(text.lines()) {
            assert!(!mixes_shifts(line), "{name}:{number}: {line}");
        }
    }
    assert!(mixes_shifts("a = b | c << 8u;") && mixes_shifts("f((x >> 3u) + (y & 1u << k));"));
    assert!(
        !mixes_shifts("a = b | (c << 8u);") && !mixes_shifts("f(x & 1u, x >> 1u); // a | b << c")
    );
}
