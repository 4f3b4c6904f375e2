//! The kernels of caustic maps, compiled for one scene, and the layouts of their bindings.

use wgpu::TextureViewDimension::D2;

use super::{LANDING, LIGHT_SUMS, Params, VERTEX};
use crate::gpu::shader::{RENDERER, Words};
use crate::gpu::{self, Gpu, Grain};
use crate::passes::refract::{self, Variant};
use crate::passes::scene_binding::{SceneBinding, SceneVariant};
use crate::passes::{CameraBinding, Layers};
use crate::scene::Scene;
use crate::settings::{Method, Solids, Solver};

/// Specialisation of the pipelines.
#[derive(Debug, Clone, Copy)]
pub(super) struct Key {
    variant: Variant,
    scene: SceneVariant,
    method: Method,
}

#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) tracing: MethodPipelines,
    pub(super) resolve: wgpu::ComputePipeline,
    /// Horizontal, then vertical.
    pub(super) blur: [wgpu::ComputePipeline; 2],
}

/// Kernels that a method runs before its map is resolved, in order.
#[derive(Debug)]
pub(super) enum MethodPipelines {
    Straight,
    Forward {
        grid: wgpu::ComputePipeline,
        trace: wgpu::ComputePipeline,
        deposit: wgpu::ComputePipeline,
        deposit_large: wgpu::ComputePipeline,
    },
    Gather {
        grid: wgpu::ComputePipeline,
        walk: wgpu::ComputePipeline,
    },
}

#[derive(Debug)]
pub(super) struct Layouts {
    /// The first six of [`refract::BINDINGS`].
    pub(super) inputs: wgpu::BindGroupLayout,
    pub(super) grid: wgpu::BindGroupLayout,
    pub(super) forward: wgpu::BindGroupLayout,
    pub(super) deposit: wgpu::BindGroupLayout,
    pub(super) gather: wgpu::BindGroupLayout,
    pub(super) resolve: wgpu::BindGroupLayout,
    pub(super) blur: wgpu::BindGroupLayout,
}

impl Key {
    /// `splash`: the view has layers of splashes; `gaps`: the number of gaps in its layers.
    pub(super) fn new(
        scene: &Scene,
        bound: &SceneBinding,
        method: Method,
        (splash, gaps): (bool, u32),
    ) -> Self {
        let exact = Variant::new(scene, splash, gaps, false, false);
        // No light passes through an opaque body, but its map shows where it is.
        let exact = Variant { opaque: false, ..exact };
        let variant = Variant { solver: Solver::Guarded, filter: false, stride: 1, ..exact };
        // Settings that the kernels do not read must not create variants.
        let variant = Variant { solids: Solids::Exact, iterations: 0, bounds: false, ..variant };
        let variant =
            Variant { samples: 1, adaptive: false, edge_samples: 1, transparent: false, ..variant };
        let scene_variant = SceneVariant {
            lights: 0,
            environment: 0,
            lit: false,
            textures: false,
            ..bound.variant
        };
        Self { variant, scene: scene_variant, method }
    }
}

impl Layouts {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let compute = wgpu::ShaderStages::COMPUTE;
        let params = || gpu.branching::<Params>();
        let (planes, write) = (gpu::sampled(D2), gpu::storage_texture(Layers::FORMAT, D2));
        Self {
            inputs: gpu.layout(
                "light view",
                compute,
                &[
                    gpu::uniform::<refract::Params>(),
                    gpu.layers(),
                    gpu.layers(),
                    planes,
                    planes,
                    planes,
                ],
            ),
            grid: gpu.layout("caustic grid", compute, &[params(), gpu::storage_read_write(VERTEX)]),
            forward: gpu.layout(
                "forward caustics",
                compute,
                &[params(), gpu::storage_of(VERTEX), gpu::storage_read_write(LANDING)],
            ),
            deposit: gpu.layout(
                "caustic deposit",
                compute,
                &[
                    params(),
                    gpu::storage_of(VERTEX),
                    gpu::storage_of(LANDING),
                    planes,
                    gpu::storage_read_write(LIGHT_SUMS),
                    gpu::storage_read_write(8),
                ],
            ),
            gather: gpu.layout(
                "gathered caustics",
                compute,
                &[params(), gpu::storage_of(VERTEX), write],
            ),
            resolve: gpu.layout(
                "caustic map",
                compute,
                &[params(), gpu::storage_of(LIGHT_SUMS), planes, write, write],
            ),
            blur: gpu.layout("caustic blur", compute, &[params(), planes, planes, write]),
        }
    }
}

impl Pipelines {
    pub(super) fn new(
        gpu: &Gpu,
        layouts: &Layouts,
        camera: &CameraBinding,
        bound: &SceneBinding,
        key: Key,
    ) -> Self {
        let pipeline = |file: &str, entry: &str, layout, constants: &[(&'static str, f64)]| {
            let words = Words::of(key.variant.shader());
            let all = [
                &key.variant.constants()[..],
                &key.scene.constants(),
                &camera.constants(),
                constants,
            ];
            let groups = [&camera.layout, &layouts.inputs, &bound.layout, layout];
            gpu.pipeline_of(RENDERER, file, words, entry, &groups, &all.concat())
        };
        let method = [("METHOD", f64::from(key.method as u32))];
        let grid = || pipeline("caustics/grid.wgsl", "grid_vertices", &layouts.grid, &[]);
        let tracing = || match key.method {
            Method::Straight => MethodPipelines::Straight,
            Method::Forward => {
                let trace =
                    || pipeline("caustics/forward.wgsl", "trace_light", &layouts.forward, &[]);
                let deposit = |entry: &str, sharing: &[(&'static str, f64)]| {
                    let groups = [&camera.layout, &layouts.deposit, &bound.layout];
                    let constants =
                        [&key.scene.constants()[..], &camera.constants(), sharing].concat();
                    let file = "caustics/deposit.wgsl";
                    gpu.compute_pipeline(file, entry, &groups, &constants)
                };
                let (groups, lanes) = large_groups(gpu);
                let sharing = [("GROUPS", f64::from(groups)), ("LANES", f64::from(lanes))];
                let (trace, (grid, (deposit, deposit_large))) = rayon::join(trace, || {
                    rayon::join(grid, || {
                        rayon::join(
                            || deposit("deposit", &[]),
                            || deposit("deposit_large", &sharing),
                        )
                    })
                });
                MethodPipelines::Forward { grid, trace, deposit, deposit_large }
            }
            Method::Gather => {
                let walk = || pipeline("caustics/gather.wgsl", "gather", &layouts.gather, &[]);
                let (walk, grid) = rayon::join(walk, grid);
                MethodPipelines::Gather { grid, walk }
            }
        };
        let resolve = || pipeline("caustics/resolve.wgsl", "resolve", &layouts.resolve, &method);
        let blur = |down: f64| {
            let groups = [&camera.layout, &layouts.blur];
            let constants = [&camera.constants()[..], &[("DOWN", down)]].concat();
            gpu.compute_pipeline("caustics/blur.wgsl", "blur", &groups, &constants)
        };
        let (tracing, resolve) = rayon::join(tracing, resolve);
        Self { tracing, resolve, blur: [0.0, 1.0].map(blur) }
    }
}

/// Workgroups that share the large cells, and the threads of each.
pub(super) fn large_groups(gpu: &Gpu) -> (u32, u32) {
    match gpu.grain() {
        Grain::Pixel => (2048, 64),
        Grain::Column => (64, 8),
    }
}
