//! The walk along the conic, on the device.
//!
//! In 32 bits the shader's crossings, paths and irradiance match those of the reference computed
//! from the same numbers.

use glam::{DVec2, DVec3, UVec2};
use limpid::gpu::Gpu;
use limpid::gpu::shader::{RENDERER, Words};
use limpid::wgpu;
use limpid_lab::reference::conic::{Conic, Grid, LightSource, Path, Vertex, paths, walk};

use super::{Pool, WATER, assert_near, one_conic, overhead, waves, wavy};
use crate::support::{self, Kernel, Random, gpu};

/// The vertices in the shader's layout.
fn texels(grid: &Grid) -> Vec<[f32; 8]> {
    let texel = |vertex: &Option<Vertex>| {
        let Some(Vertex { position: x, normal: n }) = vertex else { return [0.0; 8] };
        let [x, n] = [x, n].map(|v| v.as_vec3());
        [x.x, x.y, x.z, f32::from_bits(1), n.x, n.y, n.z, 0.0]
    };
    grid.vertices.iter().map(texel).collect()
}

/// The grid rounded to the device's precision.
fn rounded(grid: &Grid) -> Grid {
    let vertices = grid
        .vertices
        .iter()
        .map(|v| {
            v.map(|v| Vertex {
                position: v.position.as_vec3().as_dvec3(),
                normal: v.normal.as_vec3().as_dvec3(),
            })
        })
        .collect();
    Grid { cells: grid.cells, vertices }
}

/// The start of a walk: the receiver, its position in the light's view in cells, and the light.
#[derive(Clone, Copy)]
struct Start {
    receiver: DVec3,
    at: DVec2,
    source: LightSource,
}

/// The device's result: whether it found a path, where, D, and the number of triangles visited.
struct Found {
    found: bool,
    position: DVec3,
    spread: f64,
    steps: u32,
}

fn walk_on_device(gpu: &Gpu, grid: &Grid, starts: &[Start], steps: u32) -> Vec<Found> {
    use limpid::wgpu::util::DeviceExt;
    let buffer = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("grid"),
        contents: bytemuck::cast_slice(&texels(grid)),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let body = format!(
        "@group(0) @binding(0) var<storage, read> grid: array<GridVertex>;
        const CELLS = vec2i({}, {});
        fn grid_vertex(at: vec2i) -> GridVertex {{
            if any(at < vec2i(0)) || any(at > CELLS) {{
                return GridVertex(vec3f(0.0), NONE, vec3f(0.0));
            }}
            return grid[at.y * (CELLS.x + 1) + at.x];
        }}
        fn test(x: array<f32, 9>) -> array<f32, 6> {{
            var sight = Sight(vec3f(x[0], x[1], x[2]), vec3f(x[5], x[6], x[7]), 0.0, 1.33);
            if x[8] == 0.0 {{
                let to = sight.towards - sight.receiver;
                sight.distance = length(to);
                sight.towards = to / sight.distance;
            }}
            let path = conic_walk(sight, vec2f(x[3], x[4]), CELLS, {steps}u);
            let at = path.position + sight.receiver;
            return array(f32(path.found), at.x, at.y, at.z, path.spread, f32(path.steps));
        }}",
        grid.cells.x, grid.cells.y
    );
    let kernel = Kernel {
        imports: &["caustics/conic.wgsl"],
        body: &body,
        constants: &[],
        resources: &[(0, 0, buffer.as_entire_binding())],
    };
    let cases: Vec<[f32; 9]> = starts
        .iter()
        .map(|start| {
            let (light, sun) = match start.source {
                LightSource::Sun(to) => (to, 1.0),
                LightSource::Point(at) => (at, 0.0),
            };
            let [r, l] = [start.receiver, light].map(|v| v.as_vec3());
            let at = start.at.as_vec2();
            [r.x, r.y, r.z, at.x, at.y, l.x, l.y, l.z, sun]
        })
        .collect();
    let results: Vec<[f32; 6]> = kernel.run(gpu, &cases);
    let number = |x: f32| f64::from(x);
    results
        .into_iter()
        .map(|[found, x, y, z, spread, steps]| Found {
            found: found == 1.0,
            position: DVec3::new(number(x), number(y), number(z)),
            spread: number(spread),
            steps: steps as u32,
        })
        .collect()
}

/// The device's quadratics: the same crossings as in f64, from the same numbers, where naive
/// formulas lose all digits.
#[test]
fn device_edge_crossings_match_the_reference() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["caustics/conic.wgsl"],
        body: "fn grid_vertex(at: vec2i) -> GridVertex {
            return GridVertex(vec3f(0.0), NONE, vec3f(0.0));
        }
        fn test(x: array<f32, 3>) -> array<f32, 2> {
            return array(
                edge_crossing(x[0], x[1], x[2], true),
                edge_crossing(x[0], x[1], x[2], false),
            );
        }",
        constants: &[],
        resources: &[],
    };
    let mut random = Random(12);
    let mut cases = vec![
        [-0.5, 0.0, 0.5],
        [0.5, 0.0, -0.5],
        [0.0, 0.0, 0.0],
        [0.0, 0.1, -0.2],
        [0.1, -0.1, 0.1],
        [-1e-7, 0.5, 1.0],
        [1.0, -0.6, 0.3],
    ];
    let mut drawn = || random.magnitude(1e-6, 1.0) * if random.unit() < 0.5 { -1.0 } else { 1.0 };
    cases.extend((0..3000).map(|_| [drawn(), drawn(), drawn()].map(|x| x as f32)));
    let results: Vec<[f32; 2]> = kernel.run(gpu, &cases);
    for (case, got) in cases.iter().zip(results) {
        let [a, h, b] = case.map(f64::from);
        let conic = Conic { vertices: [a, b, 1.0], edges: [h, 1.0, 1.0] };
        let expected = conic.edge_roots(0);
        let mut got: Vec<f64> = got.iter().filter(|s| **s >= 0.0).map(|s| (*s).into()).collect();
        got.sort_by(f64::total_cmp);
        // Nearly coincident roots may or may not exist due to rounding.
        if (h * h - a * b).abs() < 1e-6 * h * h {
            continue;
        }
        let expected: Vec<f64> = expected.into_iter().flatten().collect();
        assert_eq!(got.len(), expected.len(), "{case:?}");
        for (got, expected) in got.iter().zip(&expected) {
            assert_near(*got, *expected, 2e-4 * expected.min(1.0 - expected) + 1e-6, "a crossing");
        }
    }
}

/// Flat water on the device: the textbook's point and its D, from straight overhead to a walk that
/// starts in total reflection.
#[test]
fn device_matches_flat_water() {
    let Some(gpu) = gpu() else { return };
    let pool = Pool::flat(16.0, 64);
    let receiver = DVec3::new(0.0, 0.0, -2.0);
    let start = |source| Start { receiver, at: pool.cell(pool.straight(source, receiver)), source };
    let lamp = LightSource::Point(DVec3::new(4.0, 0.0, 3.0));
    let far = LightSource::Point(DVec3::new(30.0, 3.0, 3.0));
    let starts = [lamp, overhead(3.0), far].map(start);
    let [lamp, overhead, far] = walk_on_device(gpu, &pool.grid, &starts, 200)
        .try_into()
        .unwrap_or_else(|_| unreachable!("as many results as cases"));
    assert_near(lamp.position.x, 1.196_433_73, 1e-5, "x");
    assert_near(lamp.spread, 65.439_104, 1e-3, "D");
    assert_near(overhead.spread, 35.8801, 1e-4, "D from overhead");
    let expected = pool.walk(starts[2].source, receiver).expect("a path");
    assert!(far.position.distance(expected.position) < 1e-3, "{}", far.position);
    assert_near(far.spread / expected.spread, 1.0, 1e-3, "D from afar");

    // Too few steps, a lamp under water, a receiver outside the grid.
    let short = walk_on_device(gpu, &pool.grid, &starts[2..], 10);
    assert!(!short[0].found && short[0].steps <= 20);
    let below = Start { source: LightSource::Point(DVec3::new(1.0, 0.2, -0.5)), ..starts[0] };
    let beside = Start { at: DVec2::new(-0.1, 3.0), ..starts[0] };
    assert!(walk_on_device(gpu, &pool.grid, &[below, beside], 200).iter().all(|path| !path.found));
}

/// The device's walk on closed curves: circles, some inside one triangle, some that cross triangles
/// four times.
#[test]
fn device_walks_around_circles() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(13);
    for (x, y, delta) in [(0.35, 0.3, 0.1), (0.55, 0.25, 0.6), (0.62, 0.25, 0.74)]
        .into_iter()
        .chain((0..5).map(|_| (random.unit(), random.unit(), random.range(0.05, 0.8))))
        .collect::<Vec<_>>()
    {
        let p = DVec2::new(x, y);
        let grid = one_conic(|x| DVec3::new(-(x.y - p.y), x.x - p.x + delta, 1.0));
        let receiver = p.extend(-1.0);
        let source = LightSource::Point(receiver + 3.0 * DVec3::Z);
        let start = Start { receiver, at: p + 2.0, source };
        let found = &walk_on_device(gpu, &grid, &[start], 100)[0];
        assert!(found.found, "{p} {delta}");
        let radius = found.position.truncate().distance(p - 0.5 * delta * DVec2::X);
        assert_near(radius, 0.5 * delta, 1e-4, "the radius");
    }
}

/// The device's walk under waves, with receivers at texel centres, where walks start on the
/// triangles' edges: nearly all are solved, and the paths found exist.
#[test]
fn device_finds_existing_paths() {
    let Some(gpu) = gpu() else { return };
    let cells = 60;
    let pool = wavy(1.5, cells);
    let grid = rounded(&pool.grid);
    for source in [LightSource::Sun(DVec3::Z), LightSource::Point(DVec3::new(0.0, 0.0, 4.0))] {
        let mut starts = Vec::new();
        for j in 15..45 {
            for i in 15..45 {
                let at = DVec2::new(f64::from(i), f64::from(j)) + 0.5;
                let x = 3.0 * at / f64::from(cells) - 1.5;
                let above = DVec3::new(x.x, -x.y, 0.0);
                let receiver = match source {
                    LightSource::Sun(to) => above - 1.5 * to,
                    LightSource::Point(lamp) => lamp + (5.5 / 4.0) * (above - lamp),
                };
                let receiver = receiver.as_vec3().as_dvec3();
                let at = match source {
                    LightSource::Sun(_) => at,
                    // A grid over a height field is not regular in a lamp's view.
                    LightSource::Point(_) => pool.cell(pool.straight(source, receiver)),
                };
                starts.push(Start { receiver, at, source });
            }
        }
        let found = walk_on_device(gpu, &grid, &starts, 200);
        let (mut solved, mut solvable, mut same, mut steps) = (0, 0, 0, 0);
        for (start, got) in starts.iter().zip(&found) {
            let Start { receiver, at, source } = *start;
            let reference = walk(&grid, &source, WATER, receiver, at, 200);
            solvable += usize::from(reference.is_some());
            if !got.found {
                continue;
            }
            solved += 1;
            steps += got.steps;
            let near = |p: &Path| p.position.distance(got.position) < 2e-3;
            let exact = reference
                .filter(near)
                .or_else(|| paths(&grid, &source, WATER, receiver).into_iter().find(near));
            let exact = exact.unwrap_or_else(|| panic!("no path at {}", got.position));
            same += usize::from(reference.is_some_and(|p| near(&p)));
            // At an edge, D may be that of the neighbouring triangle.
            let error = (got.spread - exact.spread).abs();
            if error < 1e-3 * (1.0 + exact.spread) {
                continue;
            }
            let at = pool.cell(exact.position.truncate());
            let f = at - at.floor();
            let edge =
                f.x.min(f.y).min(1.0 - f.x).min(1.0 - f.y).min((f.element_sum() - 1.0).abs());
            assert!(edge < 1e-2, "D is {}, expected {}", got.spread, exact.spread);
        }
        assert!(solved * 100 >= starts.len() * 97 && solved * 100 >= solvable * 99);
        assert!(same * 100 >= solved * 97, "{same} of {solved}");
        // Paths are near the straight line: a few triangles from it.
        assert!(steps < 5 * solved as u32, "{steps} steps for {solved} paths");
    }
}

/// `caustics/gather.wgsl`, in a sun's view, with the map that it draws.
struct GatherKernel<'a> {
    gpu: &'a Gpu,
    pipeline: wgpu::ComputePipeline,
    map: wgpu::Texture,
}

impl<'a> GatherKernel<'a> {
    fn new(gpu: &'a Gpu, size: u32) -> Self {
        // As for devices that store neither uniforms nor layers, on any.
        let text = RENDERER.source("caustics/gather.wgsl", Words::of("refract/guarded.wgsl"));
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("gather"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("gather"),
            layout: None,
            module: &module,
            entry_point: Some("gather"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[("ORTHOGRAPHIC", 1.0)],
                ..Default::default()
            },
            cache: None,
        });
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let format = wgpu::TextureFormat::Rgba32Float;
        let map = gpu.texture("map", UVec2::splat(size), 1, format, usage);
        Self { gpu, pipeline, map }
    }

    /// Draws the map from these groups, to the last of which it is added, and reads it.
    fn run(&self, groups: [Vec<(u32, wgpu::BindingResource<'_>)>; 4]) -> Vec<[f32; 4]> {
        let Self { gpu, pipeline, map } = self;
        let view = map.create_view(&Default::default());
        let mut groups = groups;
        groups[3].push((2, wgpu::BindingResource::TextureView(&view)));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            for (index, group) in (0..).zip(&groups) {
                let entries: Vec<_> = (group.iter().cloned())
                    .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
                    .collect();
                let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("test"),
                    layout: &pipeline.get_bind_group_layout(index),
                    entries: &entries,
                });
                pass.set_bind_group(index, &group, &[]);
            }
            pass.dispatch_workgroups(map.width() / 8, map.height() / 8, 1);
        }
        gpu.queue.submit([encoder.finish()]);
        bytemuck::pod_collect_to_vec(&gpu.read_texture(map, 0).expect("the map is read"))
    }
}

/// Compares a map of `size` texels a side with walks in 64 bits: the number of texels that are alike, that a walk finds in
/// shadow, and that are compared.
fn against_walks(
    grid: &Grid,
    size: u32,
    map: &[[f32; 4]],
    power: DVec3,
    absorption: DVec3,
) -> [usize; 3] {
    let exact = rounded(grid);
    let source = LightSource::Sun(DVec3::Z);
    let (mut alike, mut shadowed, mut lit) = (0, 0, 0);
    for (i, &[r, g, b, state]) in (0..).zip(map) {
        let at = DVec2::new(f64::from(i % size), f64::from(i / size)) + 0.5;
        let got = DVec3::new(r.into(), g.into(), b.into());
        assert!(got.is_finite());
        if i % size < 8 || i % size >= 24 {
            assert_eq!((state, got), (0.0, DVec3::ZERO), "{at}");
            continue;
        }
        let x = (2.0 * at / f64::from(size) - 1.0) * DVec2::new(1.0, -1.0);
        let receiver = x.extend(-3.0);
        let Some(path) = walk(&exact, &source, WATER, receiver, at, 200) else { continue };
        if (path.position.x - -0.28).abs() < 0.035 || state != 1.0 {
            continue;
        }
        let dark = path.position.x < -0.28;
        shadowed += usize::from(dark);
        let most = f64::from(size).sqrt();
        let light = path.irradiance(power, absorption, DVec3::Z, most);
        let expected = if dark { DVec3::ZERO } else { light };
        alike += usize::from((got - expected).length() < 1e-3 * light.length());
        lit += 1;
    }
    [alike, shadowed, lit]
}

/// The map as the renderer computes it: in a sun's view, over wet floor, every texel's irradiance
/// matches the walk in f64; texels without liquid are marked; and occluders cast shadows.
#[test]
fn gathered_map_matches_the_reference() {
    use bytemuck::Zeroable;
    use limpid::camera::CameraUniform;
    use limpid::passes::scene_binding::{LightData, LightViewsData};
    use limpid::scene::MAX_LIGHTS;
    use limpid::wgpu::util::DeviceExt;
    const SIZE: u32 = 32;
    let Some(gpu) = gpu() else { return };
    let size = UVec2::splat(SIZE);
    let view = CameraUniform {
        view_from_world: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        origin: glam::Vec3::ZERO,
        near: 0.0,
        size: size.as_vec2(),
        tangent: glam::Vec2::ONE,
        far: 4.0,
        pad: 0.0,
        shift: glam::Vec2::ZERO,
    };
    // The sun is 1 m above the liquid, 3 m above the floor; a board stands on the left, and there
    // is no liquid on the right.
    let layer = |height: &dyn Fn(u32) -> f32| -> Vec<[f32; 4]> {
        (0..SIZE * SIZE).map(|i| [0.0, 0.0, -height(i % SIZE), 0.0]).collect()
    };
    let wet = |x: u32, height: f32| if x < 24 { height } else { 0.0 };
    let front = layer(&|x| wet(x, 3.0));
    let back = layer(&|x| wet(x, 1.05));
    let solids = layer(&|x| if x < 8 { 3.5 } else { 1.0 });
    let waves = waves();
    let grid = Grid::new(UVec2::splat(SIZE), |at| {
        let x = (2.0 * at.as_dvec2() / f64::from(SIZE) - 1.0) * DVec2::new(1.0, -1.0);
        let position = x.extend(waves.height(x) - 1.0);
        Some(Vertex { position, normal: (-waves.slope(x)).extend(1.0).normalize() })
    });

    let camera = support::uniform(gpu, &view);
    let absorption = DVec3::new(0.1, 0.2, 0.4);
    let mut params = [0.0; 32];
    params[..5].copy_from_slice(&[0.1, 0.2, 0.4, WATER as f32, 0.1]);
    let params_buffer = support::uniform(gpu, &params);
    params[4] = 0.01;
    let dry_buffer = support::uniform(gpu, &params);
    let power = DVec3::new(3.0, 2.0, 1.0);
    let int = f32::from_bits;
    // Power, steps, light, interfaces, cells, gain; the rest is 0.
    let mut values = [0.0; 24];
    values[..11].copy_from_slice(&[
        3.0,
        2.0,
        1.0,
        int(200),
        0.0,
        0.0,
        1.0,
        int(2),
        int(SIZE),
        int(SIZE),
        1.0,
    ]);
    let caustics = support::uniform(gpu, &values);
    let layers = support::texture(gpu, size, &[&front, &back]);
    let planes = support::texture(gpu, size, &[&solids]);
    // Liquid left of x = -0.25 is shadowed; the boundary runs between two vertices.
    let mut shaded = texels(&grid);
    for vertex in &mut shaded {
        vertex[3] = int(if vertex[0] < -0.26 { 2 } else { 1 });
    }
    let vertices = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("grid"),
        contents: bytemuck::cast_slice(&shaded),
        usage: wgpu::BufferUsages::STORAGE,
    });
    // No foam, whose shadows the lights' part of the scene has.
    let lights = support::uniform(gpu, &[LightData::zeroed(); MAX_LIGHTS]);
    let views = support::uniform(gpu, &LightViewsData::zeroed());
    let sphere_depths = gpu.buffer_with("no spheres", wgpu::BufferUsages::STORAGE, &[0u32]);
    let kernel = GatherKernel::new(gpu, SIZE);
    let gathered = |params: &wgpu::Buffer| {
        let view = wgpu::BindingResource::TextureView;
        kernel.run([
            vec![(0, camera.as_entire_binding())],
            vec![
                (0, params.as_entire_binding()),
                (1, view(&layers)),
                (2, view(&layers)),
                (3, view(&planes)),
                // The mixture is not read with one fluid.
                (5, view(&planes)),
            ],
            vec![
                (2, lights.as_entire_binding()),
                (6, views.as_entire_binding()),
                (9, sphere_depths.as_entire_binding()),
            ],
            vec![(0, caustics.as_entire_binding()), (1, vertices.as_entire_binding())],
        ])
    };

    let map = gathered(&params_buffer);
    let [alike, shadowed, lit] = against_walks(&grid, SIZE, &map, power, absorption);
    assert!(lit > 15 * 31 && alike * 100 > lit * 97, "{alike} of {lit} alike");
    assert!(shadowed > 5, "{shadowed} shadowed");
    // Behind a film of air the floor is not in the liquid.
    assert!(gathered(&dry_buffer).iter().all(|texel| texel == &[0.0; 4]));
}
