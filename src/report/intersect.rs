//! Intersectors measured: one intersection per pixel, its time, its fetches, and how often it is
//! right.

use std::collections::HashMap;

use glam::{DMat4, DVec2, DVec3, IVec2, UVec2};
use image::{Rgb, RgbImage};
use rayon::prelude::*;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::rows::{ErrorKind, Figure, Kind, Orders, Report, Row};
use super::subjects::{Subject, size};
use crate::camera::{Camera, CameraUniform};
use crate::error::Result;
use crate::gpu::{self, Gpu, Timer};
use crate::passes::gbuffer::SceneBinding;
use crate::passes::mips::{self, Mips};
use crate::passes::refract::{Params, Variant};
use crate::passes::{CameraBinding, Layers};
use crate::reference::layers::{Layer, LayerHit, Pair, View, exit};
use crate::reference::surroundings::Surroundings;
use crate::reference::trace::first_last;
use crate::reference::{Ray, optics};
use crate::renderer::{Picture, Renderer};
use crate::scene::Scene;
use crate::settings::{Refract, Solver};

/// What the rays of a scene are intersected with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// The liquid's own layers, from inside.
    Liquid,
    /// The opaque scene.
    Solids,
}

/// Texels of the layers of one view, as the device has them.
#[derive(Debug, Clone)]
pub struct ViewLayers {
    /// Pixels.
    pub size: UVec2,
    /// Front and back of the aggregates.
    pub aggregate: [Vec<[f32; 4]>; 2],
    /// Front and back of the splashes, if there are any.
    pub splash: Option<[Vec<[f32; 4]>; 2]>,
    /// The opaque scene.
    pub solids: Vec<[f32; 4]>,
}

/// Where the ray of a pixel truly ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Truth {
    /// No liquid at this pixel.
    None,
    /// Nowhere that the layers show: hidden, or beyond the picture.
    Unsolvable,
    /// At a point that the layers show.
    Hit(LayerHit),
}

/// One method's result at a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// No liquid at this pixel.
    None,
    /// The method gave up.
    Missed,
    /// Pixel position and depth.
    Hit(DVec2, f64),
}

/// How right a method is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Score {
    /// Pixels with liquid.
    pub rays: u64,
    /// Of these, rays whose true hit the layers show.
    pub solvable: u64,
    /// Of these, hits within a pixel of the truth and consistent in depth.
    pub solved: u64,
    /// Hits that are not: of rays that cannot be solved, or more than two pixels off.
    pub wrong: u64,
    /// Root mean square distance of the solved from the truth, pixels.
    pub rms_px: f64,
}

impl Score {
    /// Share of the solvable rays that were solved.
    pub fn solved_of_solvable(&self) -> f64 {
        self.solved as f64 / self.solvable.max(1) as f64
    }

    /// Share of all rays that were solved.
    pub fn solved_of_all(&self) -> f64 {
        self.solved as f64 / self.rays.max(1) as f64
    }

    /// Share of all rays with a hit that is wrong.
    pub fn wrong_accepts(&self) -> f64 {
        self.wrong as f64 / self.rays.max(1) as f64
    }
}

/// By how much what is linear on the screen, disparity or height, may differ from the truth beside
/// what a pixel explains: as a share of disparity, or of an orthographic view's width.
const DEPTH_TOLERANCE: f64 = 2e-3;

fn tolerance(view: &View, depth: f64) -> f64 {
    DEPTH_TOLERANCE * if view.far.is_some() { 2.0 * view.tangent.x } else { 1.0 / depth }
}

/// Whether a hit agrees with another in depth, `pixels` apart on the screen.
fn consistent(view: &View, truth: &LayerHit, u: DVec2, depth: f64, pixels: f64) -> bool {
    // Disparity or height per pixel of the true surface.
    let per_pixel = truth.plane.truncate() * view.tangent * 2.0 / view.size;
    let slope = per_pixel.length() * (u.distance(truth.u).min(pixels) + 0.5);
    let difference = match view.far {
        Some(_) => (depth - truth.depth).abs(),
        None => (1.0 / depth - 1.0 / truth.depth).abs(),
    };
    difference <= tolerance(view, truth.depth) + slope
}

/// Judges a method's answers.
pub fn score(view: &View, truths: &[Truth], answers: &[Answer]) -> Score {
    let mut score = Score::default();
    let mut squares = 0.0;
    for (truth, answer) in truths.iter().zip(answers) {
        if *truth == Truth::None {
            continue;
        }
        score.rays += 1;
        let Truth::Hit(hit) = truth else {
            score.wrong += u64::from(matches!(answer, Answer::Hit(..)));
            continue;
        };
        score.solvable += 1;
        let Answer::Hit(u, depth) = *answer else { continue };
        let distance = u.distance(hit.u);
        if distance <= 1.0 && consistent(view, hit, u, depth, 1.0) {
            score.solved += 1;
            squares += distance * distance;
        } else if distance > 2.0 || !consistent(view, hit, u, depth, 2.0) {
            score.wrong += 1;
        }
    }
    score.rms_px = (squares / score.solved.max(1) as f64).sqrt();
    score
}

/// The refracted ray of each pixel with liquid, view space, and the pixel.
fn rays<'a>(
    view: &'a View,
    layers: &'a [Pair],
    ior: f64,
) -> impl IndexedParallelIterator<Item = Option<(DVec3, DVec3, IVec2)>> + 'a {
    let size = layers[0][0].size;
    (0..size.element_product()).into_par_iter().map(move |i| {
        let texel = UVec2::new(i % size.x, i / size.x).as_ivec2();
        let u = texel.as_dvec2() + 0.5;
        let omega = view.omega(u);
        let nearest = |a: DVec3, b: DVec3| if b.dot(omega) > a.dot(omega) { b } else { a };
        let front = layers.iter().map(|pair| pair[0].at(texel)).fold(DVec3::ZERO, nearest);
        let disparity = front.dot(omega);
        if disparity <= 0.0 {
            return None;
        }
        let d = optics::refract(view.ray(u).1, -view.normal(front), ior)?;
        Some((view.point(u, disparity), d, texel))
    })
}

/// The true end of every pixel's ray: on the layers, or for solids in the scene itself, where it is
/// solvable if the layer shows that point.
pub fn truths(
    world_from_view: &DMat4,
    uniform: &CameraUniform,
    scene: &Scene,
    layers: &ViewLayers,
    target: Target,
) -> Vec<Truth> {
    let view = View::new(uniform);
    let size = layers.size;
    let pair = |texels: &[Vec<[f32; 4]>; 2]| texels.each_ref().map(|t| Layer::new(size, t));
    let classes: Vec<Pair> =
        [Some(&layers.aggregate), layers.splash.as_ref()].into_iter().flatten().map(pair).collect();
    let solids = Layer::new(size, &layers.solids);
    let surroundings = Surroundings::new(scene);
    rays(&view, &classes, scene.liquid.ior.into())
        .map(|ray| {
            let Some((o, d, texel)) = ray else { return Truth::None };
            if target == Target::Liquid {
                let references: Vec<_> = classes.iter().collect();
                let hit = exit(&view, &references, o, d, texel);
                return hit.map_or(Truth::Unsolvable, Truth::Hit);
            }
            let world = Ray {
                origin: world_from_view.transform_point3(o),
                direction: world_from_view.transform_vector3(d),
            };
            let Some(hit) = surroundings.hit(&world) else { return Truth::Unsolvable };
            let x = o + hit.t * d;
            let u = view.pixel(x);
            let plane = solids.at(u.floor().as_ivec2());
            let hit = LayerHit { u, depth: -x.z, plane };
            let disparity = plane.dot(view.omega(u));
            let shown = -view.point(u, disparity).z;
            let visible = x.z < -view.near
                && view.holds(u)
                && disparity > 0.0
                && match view.far {
                    Some(_) => (shown - hit.depth).abs() <= tolerance(&view, hit.depth),
                    None => (hit.depth / shown - 1.0).abs() <= DEPTH_TOLERANCE,
                };
            if visible { Truth::Hit(hit) } else { Truth::Unsolvable }
        })
        .collect()
}

/// View to world space of a camera.
pub fn world_from_view(camera: &Camera) -> DMat4 {
    let (eye, target, up) = (camera.eye, camera.target, camera.up.as_dvec3());
    glam::dcamera::rh::view::look_at_mat4(eye, target, up).inverse()
}

/// A method: an intersector with its settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// Its name in the report.
    pub name: String,
    /// What distinguishes it from others of that name.
    pub words: String,
    /// Its settings; `None` measures everything but an intersection.
    pub settings: Option<Refract>,
}

/// What a method took and found.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// Milliseconds of each run, without what is not intersection.
    pub ms: Vec<f64>,
    /// Its answer at each pixel.
    pub answers: Vec<Answer>,
    /// Texels read per ray, mean.
    pub fetches: f64,
    /// Layer evaluations per ray, mean.
    pub iterations: f64,
    /// Of the rays that were answered, how many entered and left which class, indexed by
    /// entry + 2 exit, 0 for aggregates and 1 for splashes.
    pub orders: [u64; 4],
}

/// The layers of one view on the device, and what intersects them.
pub struct Bench {
    gpu: Gpu,
    size: UVec2,
    camera: CameraBinding,
    scene: SceneBinding,
    textures: [wgpu::Texture; 3],
    splash: bool,
    hits: wgpu::Texture,
    tallies: wgpu::Texture,
    inputs: wgpu::BindGroupLayout,
    outputs: wgpu::BindGroupLayout,
}

impl Bench {
    /// Uploads layers.
    ///
    /// # Errors
    /// [`crate::Error::Adapter`] if the picture is too large.
    pub fn new(gpu: &Gpu, uniform: &CameraUniform, layers: &ViewLayers) -> Result<Self> {
        gpu.check_size(layers.size)?;
        let camera = CameraBinding::new(gpu, uniform.far > 0.0);
        camera.write(gpu, uniform);
        let nothing = vec![[0f32; 4]; layers.size.element_product() as usize];
        let none = [nothing.clone(), nothing];
        let splash = layers.splash.as_ref().unwrap_or(&none);
        let textures = [
            upload(gpu, layers.size, &[&layers.aggregate[0], &layers.aggregate[1]]),
            upload(gpu, layers.size, &[&splash[0], &splash[1]]),
            upload(gpu, layers.size, &[&layers.solids]),
        ];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let all: Vec<_> = textures.iter().collect();
        Mips::new(gpu).record(gpu, &mut encoder, &all, Timer::new(gpu, false).span("mips"));
        gpu.queue.submit([encoder.finish()]);

        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::sampled(D2),
        ];
        let inputs = gpu.layout("report inputs", wgpu::ShaderStages::COMPUTE, &bindings);
        let bindings =
            [gpu::storage_texture(Layers::FORMAT, D2), gpu::storage_texture(Layers::FORMAT, D2)];
        let outputs = gpu.layout("report outputs", wgpu::ShaderStages::COMPUTE, &bindings);
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let output = |label| gpu::texture(gpu, label, layers.size, 1, Layers::FORMAT, usage);
        Ok(Self {
            gpu: gpu.clone(),
            size: layers.size,
            camera,
            scene: SceneBinding::new(gpu),
            textures,
            splash: layers.splash.is_some(),
            hits: output("hits"),
            tallies: output("tallies"),
            inputs,
            outputs,
        })
    }

    /// Runs every method `repeats` times, by turns, so that what disturbs one disturbs all.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub fn measure(
        &self,
        methods: &[Method],
        scene: &Scene,
        target: Target,
        repeats: usize,
    ) -> Result<Vec<Measurement>> {
        let mut pipelines = HashMap::new();
        let mut runs = Vec::new();
        let mut measurements: Vec<Measurement> = Vec::new();
        for method in methods {
            let run = self.prepare(method, scene, target, &mut pipelines);
            // The warm-up gives the answers.
            self.run(&run)?;
            measurements.push(self.read()?);
            runs.push(run);
        }
        for _ in 0..repeats {
            for (run, measurement) in runs.iter().zip(&mut measurements) {
                measurement.ms.push(self.run(run)?);
            }
        }
        Ok(measurements)
    }

    /// What the last run answered.
    fn read(&self) -> Result<Measurement> {
        let texels = |texture: &wgpu::Texture| -> Result<Vec<[f32; 4]>> {
            Ok(bytemuck::pod_collect_to_vec(&gpu::read_texture(&self.gpu, texture, 0)?))
        };
        let (hits, tallies) = (texels(&self.hits)?, texels(&self.tallies)?);
        let answers: Vec<_> = hits
            .iter()
            .map(|h| match h[3] {
                -1.0 => Answer::None,
                0.0 => Answer::Missed,
                _ => Answer::Hit(DVec2::new(h[0].into(), h[1].into()), h[2].into()),
            })
            .collect();
        let (mut rays, mut fetches, mut iterations, mut orders) = (0.0, 0.0, 0.0, [0; 4]);
        for (answer, tally) in answers.iter().zip(&tallies) {
            if *answer == Answer::None {
                continue;
            }
            rays += 1.0;
            fetches += f64::from(tally[0]);
            iterations += f64::from(tally[1]);
            if matches!(answer, Answer::Hit(..)) {
                orders[tally[2] as usize & 3] += 1;
            }
        }
        let rays = f64::max(rays, 1.0);
        let (fetches, iterations) = (fetches / rays, iterations / rays);
        Ok(Measurement { ms: Vec::new(), answers, fetches, iterations, orders })
    }

    fn prepare(
        &self,
        method: &Method,
        scene: &Scene,
        target: Target,
        pipelines: &mut HashMap<String, wgpu::ComputePipeline>,
    ) -> Run {
        let gpu = &self.gpu;
        let settings = method.settings.clone().unwrap_or_default();
        let mut scene = scene.clone();
        scene.settings.refract = settings.clone();
        let variant = Variant::new(&scene, self.splash, false);
        let (root, mut constants) = match method.settings {
            Some(_) => (variant.shader(), variant.constants()),
            None => ("report/nothing.wgsl", vec![("SPLASH", f64::from(u8::from(self.splash)))]),
        };
        constants.extend(self.camera.constants());
        constants.push(("TO_SOLIDS", f64::from(u8::from(target == Target::Solids))));
        let pipeline = pipelines.entry(format!("{root} {constants:?}")).or_insert_with(|| {
            let text =
                crate::shader::source(root) + &crate::shader::source("report/intersect.wgsl");
            let module = crate::shader::text_module(gpu, root, text);
            let layouts = [&self.camera.layout, &self.inputs, &self.scene.layout, &self.outputs];
            gpu::module_pipeline(gpu, root, &module, "intersect_pixels", &layouts, &constants)
        });
        let params = Params::new(&scene, &settings, 0.0);
        let params = gpu::buffer_with(gpu, "refract", wgpu::BufferUsages::UNIFORM, &[params]);
        let [aggregate, splash] = [0, 1].map(|i| gpu::array_view(&self.textures[i]));
        let solids = self.textures[2].create_view(&Default::default());
        let resources = [
            params.as_entire_binding(),
            wgpu::BindingResource::TextureView(&aggregate),
            wgpu::BindingResource::TextureView(&splash),
            wgpu::BindingResource::TextureView(&solids),
        ];
        let inputs = gpu::bind_group(gpu, "report inputs", &self.inputs, &resources);
        Run { pipeline: pipeline.clone(), inputs }
    }

    fn run(&self, run: &Run) -> Result<f64> {
        let gpu = &self.gpu;
        let views = [&self.hits, &self.tallies].map(|t| t.create_view(&Default::default()));
        let resources = views.each_ref().map(wgpu::BindingResource::TextureView);
        let outputs = gpu::bind_group(gpu, "report outputs", &self.outputs, &resources);
        let mut timer = Timer::new(gpu, true);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("intersect"),
                timestamp_writes: timer.span("intersect").compute(),
            });
            pass.set_pipeline(&run.pipeline);
            pass.set_bind_group(0, &self.camera.group, &[]);
            pass.set_bind_group(1, &run.inputs, &[]);
            pass.set_bind_group(2, &self.scene.group, &[]);
            pass.set_bind_group(3, &outputs, &[]);
            let (x, y) = gpu::workgroups(self.size);
            pass.dispatch_workgroups(x, y, 1);
        }
        let resolved = timer.resolve(gpu, &mut encoder);
        gpu.queue.submit([encoder.finish()]);
        gpu.check()?;
        Ok(timer.read(gpu, resolved.as_ref())?.first().map_or(0.0, |time| time.ms))
    }
}

struct Run {
    pipeline: wgpu::ComputePipeline,
    inputs: wgpu::BindGroup,
}

pub(super) fn upload(gpu: &Gpu, size: UVec2, layers: &[&[[f32; 4]]]) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::COPY_DST;
    let (count, levels) = (layers.len() as u32, mips::levels(size));
    let texture =
        gpu::mipped_texture(gpu, "report layers", size, count, levels, Layers::FORMAT, usage);
    for (z, texels) in (0..).zip(layers) {
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z },
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16 * size.x),
                rows_per_image: None,
            },
            wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        );
    }
    texture
}

/// The intersectors compared; the first is none at all.
fn methods(quick: bool, scene: &Refract) -> Vec<Method> {
    let mut methods = vec![Method { name: "nothing".into(), words: String::new(), settings: None }];
    let mut add = |name: &str, words: String, settings: Refract| {
        methods.push(Method { name: name.into(), words, settings: Some(settings) });
    };
    for solver in [Solver::Single, Solver::Plane, Solver::Plane3] {
        let name = serde_json::to_value(solver).expect("a solver has a name");
        let settings = Refract { solver, ..Refract::default() };
        add(name.as_str().unwrap_or_default(), String::new(), settings);
    }
    let counts = if quick { vec![2, 4] } else { vec![1, 2, 4, 8] };
    for iterations in counts {
        let settings = Refract { solver: Solver::Secant, iterations, ..Refract::default() };
        add("secant", format!("iterations={iterations}"), settings);
    }
    for iterations in 0..8 {
        let settings = Refract { solver: Solver::Newton, iterations, ..Refract::default() };
        add("newton", format!("iterations={iterations}"), settings);
    }
    let filtered = Refract { solver: Solver::Newton, filter: true, ..Refract::default() };
    add("newton", "iterations=4, filtered".into(), filtered);
    for stride in [4, 2] {
        let settings = Refract { solver: Solver::March, stride, ..Refract::default() };
        add("march", format!("stride={stride}"), settings);
    }
    // Its reach is the scene's: it depends on how narrow things are.
    if !quick {
        for reach in [0.08, 0.04, 0.02, 0.01, 0.005, 0.0025] {
            add("guarded", format!("reach={reach}"), Refract { reach, ..Refract::default() });
        }
    }
    let march = Refract { solver: Solver::March, ..Refract::default() };
    add("march", "stride=1".into(), march);
    add("guarded", String::new(), Refract { reach: scene.reach, ..Refract::default() });
    methods
}

/// Measures the intersectors on every view of a scene.
///
/// # Errors
/// As [`Bench::measure`].
pub fn report(
    gpu: &Gpu,
    renderer: &mut Renderer,
    subject: &Subject,
    quick: bool,
    report: &mut Report,
) -> Result<()> {
    let target = if subject.is_water() { Target::Solids } else { Target::Liquid };
    let width = match (quick, target) {
        (true, _) => 320,
        (false, Target::Solids) => 2000,
        (false, Target::Liquid) => 1024,
    };
    let (repeats, size) = (if quick { 3 } else { 7 }, size(subject.name, width));
    for (name, camera) in &subject.views {
        let uniform = camera.uniform(size, DVec3::ZERO);
        let view = View::new(&uniform);
        let layers = match target {
            Target::Solids => ViewLayers::exact(subject, camera, size),
            Target::Liquid => ViewLayers::drawn(gpu, renderer, subject, camera, size)?,
        };
        let world_from_view = world_from_view(camera);
        let truths = truths(&world_from_view, &uniform, &subject.scene, &layers, target);
        let bench = Bench::new(gpu, &uniform, &layers)?;
        let methods = methods(quick, &subject.scene.settings.refract);
        let measured = bench.measure(&methods, &subject.scene, target, repeats)?;
        let truth = match target {
            Target::Solids => "the solids themselves",
            Target::Liquid => "the same layers, intersected exactly",
        };
        report.rows.extend(rows(name, &methods, &measured, &view, &truths, truth));
        // The last two are the march that reads every texel, and `guarded`.
        if let [.., march, guarded] = &measured[..] {
            let mask = failures(&view, size, &truths, &guarded.answers, &march.answers);
            report.figures.push(Figure {
                title: format!("{name}: rays that `guarded` does not solve"),
                scene: name.clone(),
                panels: vec![("magenta: `march` does; green: nor does it".into(), mask)],
            });
            if target == Target::Liquid {
                report.orders.push(orders(name, &guarded.orders));
            }
        }
    }
    Ok(())
}

/// A row for each method but the first, which is none at all and whose time is subtracted.
pub(super) fn rows(
    name: &str,
    methods: &[Method],
    measured: &[Measurement],
    view: &View,
    truths: &[Truth],
    truth: &str,
) -> Vec<Row> {
    let of = |(method, measurement): (&Method, &Measurement)| {
        // Paired: each run less the run without an intersector beside it.
        let pairs = measurement.ms.iter().zip(&measured[0].ms);
        let net: Vec<f64> = pairs.map(|(ms, nothing)| (ms - nothing).max(0.0)).collect();
        let score = score(view, truths, &measurement.answers);
        let wrong = 1.0 - score.solved_of_solvable() + score.wrong_accepts();
        let mut row = Row::new(Kind::Intersect, name, &method.name, &method.words)
            .timed(&net)
            .with_error(wrong, ErrorKind::RaysWrong, truth);
        row.fetches = Some(measurement.fetches);
        row.iterations = Some(measurement.iterations);
        row.solved_of_solvable = Some(score.solved_of_solvable());
        row.solved_of_all = Some(score.solved_of_all());
        row.wrong_accepts = Some(score.wrong_accepts());
        row.rms_px = Some(score.rms_px);
        row
    };
    methods.iter().zip(measured).skip(1).map(of).collect()
}

fn orders(scene: &str, counts: &[u64; 4]) -> Orders {
    let all = counts.iter().sum::<u64>().max(1) as f64;
    let [aa, sa, as_, ss] = counts.map(|count| count as f64 / all);
    Orders { scene: scene.into(), ss, sa, as_, aa }
}

/// The failures of a method, after Mayer et al. (2026), table 2: green where the other fails too,
/// magenta where it alone does, grey where it is right, black without liquid.
fn failures(
    view: &View,
    size: UVec2,
    truths: &[Truth],
    method: &[Answer],
    other: &[Answer],
) -> RgbImage {
    let right = |truth: Truth, answer: Answer| match (truth, answer) {
        (Truth::Hit(hit), Answer::Hit(u, depth)) => {
            u.distance(hit.u) <= 1.0 && consistent(view, &hit, u, depth, 1.0)
        }
        _ => false,
    };
    RgbImage::from_fn(size.x, size.y, |x, y| {
        let i = (y * size.x + x) as usize;
        Rgb(match (truths[i], right(truths[i], method[i]), right(truths[i], other[i])) {
            (Truth::None, ..) => [0, 0, 0],
            (_, true, _) => [70, 70, 70],
            (_, false, true) => [255, 0, 255],
            (_, false, false) => [0, 200, 0],
        })
    })
}

impl ViewLayers {
    /// Analytic water over solids, exactly: its front where no solid hides it.
    fn exact(subject: &Subject, camera: &Camera, size: UVec2) -> Self {
        let view = View::new(&camera.uniform(size, DVec3::ZERO));
        let surroundings = Surroundings::new(&subject.scene);
        let [front, _] = first_last(&*subject.liquid, camera, size);
        let world_from_view = world_from_view(camera);
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        let texels: Vec<_> = (0..size.element_product())
            .into_par_iter()
            .map(|i| {
                let omega = view.omega(DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5);
                let direction = world_from_view.transform_vector3(omega.normalize());
                let solid =
                    surroundings.hit(&Ray { origin: eye, direction }).map_or([0.0; 4], |hit| {
                        let normal = world_from_view.inverse().transform_vector3(hit.normal);
                        texel(hit.t * omega.normalize(), normal)
                    });
                let depth = front.depths[i as usize];
                let hidden = solid[3] > 0.0 && f64::from(solid[3]) < depth;
                let water = match depth > 0.0 && !hidden {
                    true => texel(depth * omega, front.normals[i as usize]),
                    false => [0.0; 4],
                };
                (water, solid)
            })
            .collect();
        let (water, solids): (Vec<_>, _) = texels.into_iter().unzip();
        let none = vec![[0.0; 4]; water.len()];
        Self { size, aggregate: [water, none], splash: None, solids }
    }

    /// The layers that the renderer draws.
    fn drawn(
        gpu: &Gpu,
        renderer: &mut Renderer,
        subject: &Subject,
        camera: &Camera,
        size: UVec2,
    ) -> Result<Self> {
        let target = Picture::new(gpu, size)?;
        renderer.diagnose = true;
        let splats = &subject.loaded.splats;
        renderer.render(&subject.scene, camera, splats, &target.view(), Picture::FORMAT, size)?;
        renderer.diagnose = false;
        let images = renderer.images();
        let solids = images.gbuffer.as_ref().map(|gbuffer| &gbuffer.planes);
        Self::read(gpu, &images.smoothed, images.splash.as_ref(), solids)
    }

    /// Reads drawn layers back.
    pub(super) fn read(
        gpu: &Gpu,
        aggregate: &Layers,
        splash: Option<&Layers>,
        solids: Option<&wgpu::Texture>,
    ) -> Result<Self> {
        let read = |texture: &wgpu::Texture, layer: u32| -> Result<Vec<[f32; 4]>> {
            Ok(bytemuck::pod_collect_to_vec(&gpu::read_texture(gpu, texture, layer)?))
        };
        let pair = |layers: &Layers| -> Result<[Vec<[f32; 4]>; 2]> {
            Ok([read(&layers.texture, Layers::FRONT)?, read(&layers.texture, Layers::BACK)?])
        };
        let size = UVec2::new(aggregate.texture.width(), aggregate.texture.height());
        let solids = solids.map(|planes| read(planes, 0)).transpose()?;
        Ok(Self {
            size,
            aggregate: pair(aggregate)?,
            splash: splash.map(pair).transpose()?,
            solids: solids.unwrap_or_else(|| vec![[0.0; 4]; size.element_product() as usize]),
        })
    }
}

/// A texel of the plane through `x` with `normal`, view space.
fn texel(x: DVec3, normal: DVec3) -> [f32; 4] {
    let plane = normal / normal.dot(x);
    [plane.x as f32, plane.y as f32, plane.z as f32, -x.z as f32]
}
