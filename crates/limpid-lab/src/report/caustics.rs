//! Measurement of caustic maps: time, error, and conservation of light.
//!
//! The light's layers of an analytic pool are exact, so its error is that of the method alone;
//! those of particles are the rendered ones, and the truth is the reconstructed surface.

use glam::{DAffine3, DVec2, DVec3, UVec2};
use rayon::prelude::*;

use super::intersect::{self, Target, ViewLayers, upload};
use super::rows::{ErrorKind, Row, RowKind};
use super::subjects::Subject;
use crate::reference::caustics as reference;
use crate::reference::layers as reference_layers;
use crate::reference::surroundings::Surroundings;
use crate::reference::trace::first_last_along;
use crate::reference::{Liquid, Ray};
use limpid::gpu::{Commands, Gpu, Timer};
use limpid::light_view::LightView;
use limpid::lights;
use limpid::passes::caustics::{
    CausticBuffers, CausticMap, Caustics, Inputs, MapConfig, Output, Params,
};
use limpid::passes::mesh_buffers::MeshBuffers;
use limpid::passes::scene_binding::SceneBinding;
use limpid::passes::smooth;
use limpid::passes::tiles::Sections;
use limpid::passes::view_passes::{self, FrameInputs, PassNames, ViewConfig, ViewPasses};
use limpid::passes::{CameraBinding, GBufferImages, Layers};
use limpid::scene::{Light, Scene};
use limpid::settings::{self, Method, Solver};
use limpid_io::error::Result;

impl ViewLayers {
    /// Computes the exact layers of a liquid and of the solids in a light's view.
    pub fn of_light(liquid: &(impl Liquid + ?Sized), scene: &Scene, view: &LightView) -> Self {
        let surroundings = Surroundings::new(scene);
        let size = view.size;
        let texels: Vec<_> = (0..size.element_product())
            .into_par_iter()
            .map(|i| {
                let center = DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5;
                let (origin, direction) = view.ray(center);
                let ray = Ray { origin, direction };
                let [front, back] = first_last_along(liquid, &ray, liquid.contains(origin))
                    .map(|c| c.map_or([0.0; 4], |c| view.texel(ray.at(c.t), c.normal)));
                let solid = surroundings.hit(&ray);
                let solid = solid.map_or([0.0; 4], |hit| view.texel(hit.point, hit.normal));
                (front, (back, solid))
            })
            .collect();
        let (front, (back, solids)): (Vec<_>, (Vec<_>, Vec<_>)) = texels.into_iter().unzip();
        Self { size, aggregate: [front, back], splash: None, solids }
    }
}

/// The caustics pass of one light over given layers, on the device.
pub struct Bench {
    gpu: Gpu,
    view: LightView,
    camera: CameraBinding,
    scene: SceneBinding,
    aggregate: Layers,
    splash: Option<Layers>,
    gbuffer: GBufferImages,
    outputs: [wgpu::Texture; 2],
    buffers: CausticBuffers,
}

/// The result of one run.
#[derive(Debug, Clone)]
pub struct Run {
    /// Irradiance on each texel's receiver by light through liquid, W/m², and 1 where liquid leaves
    /// direct light only; rows from the top.
    pub irradiance: Vec<[f32; 4]>,
    /// Depth of each texel's receiver in the light's view, m; 0 where there is none.
    pub depths: Vec<f32>,
    /// The result of `gather`: irradiance, and 1 where it converged, 2 where it did not, 0 where
    /// there was nothing to solve.
    pub gathered: Vec<[f32; 4]>,
    /// Milliseconds on the device, 0 where it has no timestamps.
    pub ms: f64,
}

impl Bench {
    /// Uploads a light's layers.
    ///
    /// # Errors
    /// [`limpid::Error::Limit`] if they are too large.
    pub fn new(gpu: &Gpu, scene: &Scene, view: &LightView, layers: &ViewLayers) -> Result<Self> {
        gpu.check_size(layers.size)?;
        let camera = CameraBinding::new(gpu, view.orthographic);
        camera.write(gpu, &view.uniform(view.origin));
        let mut bound = SceneBinding::new(gpu);
        let mut meshes = MeshBuffers::new(gpu);
        meshes.prepare(gpu, scene)?;
        bound.upload(gpu, (scene, &meshes, None), view.origin, &[], None);
        let pair = |texels: &[Vec<[f32; 4]>; 2]| {
            Layers::of(upload(gpu, layers.size, &[&texels[0], &texels[1]]))
        };
        let planes = upload(gpu, layers.size, &[&layers.solids]);
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let output = |label| {
            let usage = usage | wgpu::TextureUsages::TEXTURE_BINDING;
            gpu.texture(label, layers.size, 1, Layers::FORMAT, usage)
        };
        Ok(Self {
            gpu: gpu.clone(),
            view: *view,
            aggregate: pair(&layers.aggregate),
            splash: layers.splash.as_ref().map(pair),
            gbuffer: GBufferImages { surfaces: planes.clone(), planes },
            outputs: [output("map"), output("receivers")],
            buffers: CausticBuffers::default(),
            camera,
            scene: bound,
        })
    }

    /// Renders the map of one of the scene's lights with the scene's settings. Lengths in the
    /// settings are in units of `radius`, m.
    ///
    /// # Errors
    /// [`limpid::Error::DeviceLost`].
    ///
    /// # Panics
    /// If the scene has no such light.
    pub fn run(&mut self, scene: &Scene, light: usize, radius: f32) -> Result<Run> {
        let (gpu, camera, bound) = (&self.gpu, &self.camera, &self.scene);
        let size = self.view.size;
        let settings = &scene.settings.caustics;
        let config = MapConfig { settings, splash: self.splash.is_some(), gaps: 0, size };
        let caustics = Caustics::prepare(gpu, camera, bound, scene, config, &mut self.buffers)?;
        let params = Params::new(&scene.lights[light], &self.view, settings);
        let inputs = Inputs {
            camera,
            scene: bound,
            aggregate: &self.aggregate,
            splash: self.splash.as_ref(),
            gbuffer: &self.gbuffer,
            mixture: None,
            params: &params,
        };
        let [map, receivers] = &self.outputs;
        let output = Output { map, receivers, layer: 0 };
        let mut timer = Timer::new(gpu, true, 1);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut commands = Commands::new(gpu, &mut encoder);
        let span = timer.span("caustics");
        caustics.record(&mut commands, scene, radius, inputs, output, span);
        let resolved = timer.resolve(gpu, commands.encoder);
        commands.submit();
        gpu.check()?;
        let ms = timer.read(gpu, resolved.as_ref())?.first().map_or(0.0, |time| time.ms);

        let [map, receivers] = self.outputs.clone();
        let map = CausticMap { view: self.view, map, receivers, layer: 0 };
        let (irradiance, depths) = map.read(gpu)?;
        let gathered = gpu.read_texture(caustics.gathered(), 0)?;
        let gathered = bytemuck::pod_collect_to_vec(&gathered);
        Ok(Run { irradiance, depths, gathered, ms })
    }
}

/// Relative L1 difference of two maps of irradiance: Σ|a − b| / Σ b, over red, green and blue and
/// all texels for which `counts` holds.
pub fn relative_l1(map: &[[f32; 4]], truth: &[DVec3], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut difference, mut sum) = (0.0, 0.0);
    for (i, (a, b)) in map.iter().zip(truth).enumerate() {
        if counts(i) {
            let a = DVec3::new(a[0].into(), a[1].into(), a[2].into());
            difference += (a - b).abs().element_sum();
            sum += b.element_sum();
        }
    }
    difference / sum.max(f64::MIN_POSITIVE)
}

/// The power that a map holds, W per channel: irradiance times the receivers' areas.
pub fn received(view: &LightView, run: &Run, scene: &Scene) -> DVec3 {
    let surroundings = Surroundings::new(scene);
    let size: UVec2 = view.size;
    let texel = |(i, e): (usize, &[f32; 4])| {
        let i = i as u32;
        let center = DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5;
        let (origin, direction) = view.ray(center);
        let Some(hit) = surroundings.hit(&Ray { origin, direction }) else { return DVec3::ZERO };
        let distance2 = if view.orthographic { 1.0 } else { hit.t * hit.t };
        let cos_theta = hit.normal.dot(direction).abs();
        let area = view.pixel_extent(center) * distance2 / cos_theta;
        area * DVec3::new(e[0].into(), e[1].into(), e[2].into())
    };
    run.irradiance.par_iter().enumerate().map(texel).sum()
}

/// The light's own view of everything that may send light to its map, `resolution` texels wide.
fn source(subject: &Subject, light: &Light, resolution: u32) -> Option<LightView> {
    let bounds = lights::bounds(&subject.loaded.splats)?;
    LightView::new(light, bounds, &subject.scene.solids, 0.02, resolution, None)
}

/// Beams per texel and axis that give a map of this resolution an error below 1 %.
fn density(resolution: u32) -> u32 {
    2048u32.div_ceil(resolution).clamp(2, 6)
}

/// Computes the true caustics of each light of a scene on its solids, at the resolution of the
/// scene's settings but at most `resolution`; empty if nothing is lit. They do not depend on the
/// views that the renderer chooses for its lights.
pub fn truths(subject: &Subject, resolution: u32) -> Vec<Option<Vec<reference::CausticMap>>> {
    let scene = &subject.scene;
    if !scene.is_lit() {
        return Vec::new();
    }
    let texels = scene.settings.caustics.resolution.min(resolution);
    let (liquid, bounds) = (&*subject.liquid, subject.bounds);
    let maps =
        |light| reference::on_solids(liquid, bounds, scene, light, 2, texels, density(texels));
    scene.lights.iter().map(|light| Some(maps(light))).collect()
}

fn with(scene: &Scene, change: impl Fn(&mut settings::Caustics)) -> Scene {
    let mut scene = scene.clone();
    change(&mut scene.settings.caustics);
    scene
}

/// A change of the settings that selects a method.
type Change = Box<dyn Fn(&mut settings::Caustics)>;

fn methods(resolution: u32, quick: bool) -> Vec<(&'static str, String, Change)> {
    let mut methods: Vec<(&'static str, String, Change)> = Vec::new();
    methods.push(("straight", String::new(), Box::new(|c| c.method = Method::Straight)));
    // Cells along the map, and subdivisions of each cell. The smallest buffer limit allows about
    // 1536.
    let grids = [
        (200, 1),
        (resolution / 4, 2),
        (resolution / 2, 1),
        (resolution / 2, 2),
        (resolution / 2, 4),
        (resolution, 1),
        (resolution, 2),
        (resolution, 4),
    ];
    for (grid, subdivide) in if quick { &grids[3..7] } else { &grids[..] } {
        let (grid, subdivide) = (*grid, *subdivide);
        methods.push((
            "forward",
            format!("grid {grid}/{subdivide}"),
            Box::new(move |c| {
                c.method = Method::Forward;
                (c.grid, c.subdivide) = (grid, subdivide);
            }),
        ));
    }
    for steps in if quick { vec![32] } else { vec![4, 8, 16, 32, 64, 128] } {
        methods.push((
            "gather",
            format!("steps {steps}"),
            Box::new(move |c| {
                c.method = Method::Gather;
                c.grid = resolution;
                c.steps = steps;
            }),
        ));
    }
    methods
}

/// Measures the map of a scene's first light.
///
/// # Errors
/// [`limpid::Error::DeviceLost`], [`limpid::Error::Limit`].
pub fn measure(gpu: &Gpu, subject: &Subject, quick: bool) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    if !subject.scene.is_lit() {
        return Ok(rows);
    }
    let sizes: &[u32] = if quick { &[256] } else { &[256, 512, 1024] };
    let repeats = if quick { 3 } else { 7 };
    for &resolution in sizes {
        let scene = with(&subject.scene, |c| c.resolution = resolution);
        let views = lights::views(&scene, &subject.loaded.splats);
        let (light, Some(view)) = (&scene.lights[0], views[0]) else { continue };
        let Some(source) = source(subject, light, resolution) else { continue };
        let interfaces = scene.settings.caustics.interfaces;
        let between = reference::Views { light: &source, map: &view };
        let (truth, own) = reference::beams_with_error(
            &*subject.liquid,
            &scene,
            light,
            between,
            interfaces,
            density(resolution),
        );
        // At half the density the error is about four times as large.
        let truth_name = format!("{}, by beams within {:.2} %", subject.truth, 100.0 * own / 3.0);
        let sent = truth.flux.received.element_sum();
        let liquid = &*subject.liquid;
        let counts =
            reference::path_counts(liquid, &scene, between, interfaces, density(resolution));
        let reached = counts.iter().filter(|&&n| n > 0).count().max(1) as f64;
        let several = counts.iter().filter(|&&n| n > 1).count() as f64 / reached;
        let radius = subject.loaded.splats.radius;
        let layers = match subject.is_water {
            true => ViewLayers::of_light(&*subject.liquid, &scene, &view),
            false => drawn(gpu, subject, &scene, &view)?,
        };
        let mut bench = Bench::new(gpu, &scene, &view, &layers)?;
        let chosen = methods(resolution, quick);
        let scenes: Vec<_> = chosen.iter().map(|(_, _, change)| with(&scene, change)).collect();
        // The first run compiles pipelines and is the one that is scored; timed runs are
        // interleaved.
        let runs: Vec<_> = scenes.iter().map(|s| bench.run(s, 0, radius)).collect::<Result<_>>()?;
        let mut times = vec![Vec::new(); runs.len()];
        for _ in 0..repeats {
            for (scene, times) in scenes.iter().zip(&mut times) {
                times.push(bench.run(scene, 0, radius)?.ms);
            }
        }
        for (((method, words, _), run), times) in chosen.iter().zip(&runs).zip(&times) {
            let words = format!("map {resolution} {words}").trim_end().to_owned();
            let error = relative_l1(&run.irradiance, &truth.irradiance, |_| true);
            let mut row = Row::new(RowKind::Caustics, subject.name, method, &words)
                .timed(times)
                .with_error(error, ErrorKind::RelativeL1, &truth_name);
            row.light_kept = Some(received(&view, run, &scene).element_sum() / sent);
            row.several_paths = Some(several);
            let one_path = |i: usize| one_path(&counts, view.size, i);
            if *method == "gather" {
                let texels = run.gathered.iter().enumerate().filter(|(i, _)| one_path(*i));
                let (mut solved, mut solvable) = (0.0, 0.0);
                for (_, texel) in texels {
                    solved += f64::from(u8::from(texel[3] == 1.0));
                    solvable += f64::from(u8::from(texel[3] > 0.0));
                }
                row.solved_of_solvable = Some(solved / f64::max(solvable, 1.0));
            }
            let error = relative_l1(&run.irradiance, &truth.irradiance, one_path);
            let kind = ErrorKind::RelativeL1OnePath;
            let one_path_row = row.clone().with_error(error, kind, &truth_name);
            rows.extend([row, one_path_row]);
        }
    }
    if subject.is_water {
        rows.extend(rays(gpu, subject, quick)?);
    }
    Ok(rows)
}

/// Whether light reaches a texel by exactly one path: its centre and those of its neighbours, so
/// that no fold of the caustic crosses it.
fn one_path(counts: &[u32], size: UVec2, i: usize) -> bool {
    let at = UVec2::new(i as u32 % size.x, i as u32 / size.x);
    let inner = at.min(size - 1 - at).min_element() > 0;
    let around = |k: u32| at + UVec2::new(k % 3, k / 3) - 1;
    inner && (0..9).map(around).all(|p| counts[(p.y * size.x + p.x) as usize] == 1)
}

/// Renders the light's layers from the particles.
fn drawn(gpu: &Gpu, subject: &Subject, scene: &Scene, view: &LightView) -> Result<ViewLayers> {
    let splats = &subject.loaded.splats;
    let fits = smooth::Params::iterations(&scene.settings.smooth, splats.radius);
    let mut liquid = view_passes::SplatSet::new(gpu);
    liquid.upload(gpu, splats);
    let mut surfaces = ViewPasses::new(gpu, view.orthographic);
    let splash = !splats.splashes.is_empty();
    let backs = scene.settings.caustics.interfaces > 1;
    let wanted = ViewConfig {
        size: view.size,
        splash,
        mixture: false,
        scattering: false,
        attenuates: true,
        gbuffer: true,
        host: false,
        levels: 1,
        backs,
        smooth: !fits.is_empty(),
        bounds: false,
        tags: false,
        gaps: 0,
        sections: Sections::for_work(gpu, view.size, smooth::work(&scene.settings.smooth)),
    };
    surfaces.resize(gpu, wanted);
    let uniform = view.uniform(splats.origin);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let mut commands = Commands::new(gpu, &mut encoder);
    let mut meshes = MeshBuffers::new(gpu);
    meshes.prepare(gpu, scene)?;
    let (splat_set, meshes, shadows) = (&liquid, &meshes, None);
    let frame = FrameInputs { scene, splats, splat_set, meshes, fits: &fits, shadows };
    surfaces.upload(gpu, frame, &uniform, view.origin, &[], None);
    let passes = surfaces.prepare(gpu, frame, &uniform, view.origin);
    let timer = &mut Timer::new(gpu, false, 0);
    surfaces.record(&passes, &mut commands, timer, PassNames::LIGHT);
    commands.submit();
    gpu.check()?;
    let solids = Some(&surfaces.images.gbuffer.planes);
    ViewLayers::read(gpu, surfaces.aggregate_layers(), surfaces.splash_layers(), solids)
}

/// Measures how refracted light rays converge in the light's view of the solids, iteration by
/// iteration (Mayer et al. 2026, figure 5).
fn rays(gpu: &Gpu, subject: &Subject, quick: bool) -> Result<Vec<Row>> {
    let scene = &subject.scene;
    let resolution = if quick { 256 } else { 2048 };
    let Some(view) = source(subject, &scene.lights[0], resolution) else { return Ok(Vec::new()) };
    let layers = ViewLayers::of_light(&*subject.liquid, scene, &view);
    let uniform = view.uniform(view.origin);
    let world_from_view =
        DAffine3::from_mat3_translation(view.view_from_world.transpose(), view.origin).into();
    let truths = intersect::truths(&world_from_view, &uniform, scene, &layers, Target::Solids);
    let method = |name: &str, words: String, settings: Option<settings::Refract>| {
        intersect::Method { name: name.into(), words, settings }
    };
    let own = &scene.settings.refract;
    let mut methods = vec![method("nothing", String::new(), None)];
    for iterations in if quick { vec![2, 4] } else { (0..8).collect() } {
        let newton = settings::Refract { solver: Solver::Newton, iterations, ..own.clone() };
        methods.push(method("newton", format!("iterations={iterations}"), Some(newton)));
    }
    for (name, solver) in [("march", Solver::March), ("guarded", Solver::Guarded)] {
        let settings = settings::Refract { solver, ..own.clone() };
        methods.push(method(name, String::new(), Some(settings)));
    }
    let bench = intersect::Bench::new(gpu, &uniform, &layers)?;
    let measured = bench.measure(&methods, scene, Target::Solids, if quick { 3 } else { 7 })?;
    let name = format!("{}:light", subject.name);
    let truth = "the solids themselves";
    let layered = reference_layers::ViewSpace::of_light(&view);
    Ok(intersect::rows(&name, &methods, &measured, &layered, &truths, truth))
}
