//! Shaders by naga: parsed, validated, specialised and translated.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use limpid::gpu::prune::prune;
use naga::back::pipeline_constants::process_overrides;
use naga::back::{glsl, hlsl, msl, spv};
use naga::proc::BoundsCheckPolicies;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

/// limpid requests no optional feature that affects WGSL.
const REQUESTED: Capabilities = Capabilities::empty();

/// Parses and validates a source text; a failure is naga's excerpt.
pub(crate) fn check(name: &str, text: &str) -> Result<(naga::Module, ModuleInfo), String> {
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
        // Alone no more than the solids, of which there are none by default.
        (Some("MESHES"), _) => &[0.0],
        (Some("LIGHTS"), _) => &[0.0, 1.0, 16.0],
        (Some("SIDE"), _) => &[0.0, 1.0],
        (Some("GAPS"), _) => &[0.0, 1.0, 2.0],
        (Some("GAP"), naga::TypeInner::Scalar(naga::Scalar::I32)) => &[-1.0, 0.0, 1.0],
        (Some("GAP" | "CLASS"), _) => &[0.0, 1.0],
        (Some("METHOD"), _) => &[0.0, 1.0, 2.0],
        (Some("STRIDE"), _) => &[1.0, 2.0, 4.0],
        (Some("TAPS"), _) => &[1.0, 2.0, 16.0],
        (Some("SAMPLES"), _) => &[1.0, 4.0, 64.0],
        (Some("EDGE_SAMPLES"), _) => &[1.0, 16.0, 64.0],
        (Some("ITERATIONS"), _) => &[0.0, 4.0, 64.0],
        (Some("LANES"), _) => &[1.0, 8.0, 64.0],
        (Some("GROUPS"), _) => &[1.0, 64.0, 2048.0],
        (name, ty) => panic!("the test knows no values for the constant {name:?} of {ty:?}"),
    }
}

/// Sets of constants to specialise by: each value of each constant alone, a mesh among solids, then all constants at their
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
    let has_meshes = constants.iter().any(|(name, _)| name == "MESHES");
    let mesh = |others: &[f64]| {
        let shapes =
            ["HAS_PLANES", "HAS_BOXES", "HAS_SPHERES"].into_iter().zip(others.iter().copied());
        let all = [("SOLIDS", 2.0), ("MESHES", 1.0)].into_iter().chain(shapes);
        all.map(|(name, value)| (name.to_owned(), value)).collect()
    };
    let meshes = has_meshes.then(|| [mesh(&[1.0; 3]), mesh(&[0.0; 3])]);
    alone.chain(meshes.into_iter().flatten()).chain([first, last]).collect()
}

/// Specialises every entry point with every set of constants, as devices do: without the branches that these rule out.
/// Returns the number of specialisations.
pub(crate) fn specialise(name: &str, text: &str) -> Result<usize, String> {
    let (module, _) = check(name, text)?;
    let sets = specialisations(&module);
    // Many constants decide no branch.
    let mut checked = HashMap::new();
    for set in &sets {
        let constants: Vec<_> = set.iter().map(|(name, value)| (&name[..], *value)).collect();
        let told = |e: String| format!("{name} with {set:?}: {e}");
        let (module, info) = match checked.entry(prune(text, &constants)) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => {
                let module = check(name, new.key()).map_err(told)?;
                new.insert(module)
            }
        };
        let chosen = set.iter().cloned().collect();
        for entry in &module.entry_points {
            process_overrides(module, info, Some((entry.stage, &entry.name)), &chosen)
                .map_err(|e| told(format!("{} {e:?}", entry.name)))?;
        }
    }
    Ok(sets.len() * module.entry_points.len())
}

/// Translates a fully specialised entry point for every platform: SPIR-V for Vulkan, MSL 2.0 for Metal,
/// HLSL 5.1 for DirectX 12, GLSL ES 3.1 for OpenGL. Returns the sizes in bytes.
pub(crate) fn translate(
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
pub(crate) fn translate_all(name: &str, text: &str) -> Result<usize, String> {
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
