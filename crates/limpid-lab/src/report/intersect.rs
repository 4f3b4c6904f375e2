//! Measurement of intersectors: one intersection per pixel, its time, texel fetches and accuracy.

mod truth;

use std::collections::HashMap;

use glam::{DVec2, DVec3, UVec2};
use image::{Rgb, RgbImage};
use wgpu::TextureViewDimension::{D2, D2Array};

use super::Report;
use super::rows::{ErrorKind, Figure, Orders, Row, RowKind};
use super::shaders::SHADERS;
use super::subjects::{Subject, size};
use crate::reference::layers::ViewSpace;
use limpid::camera::{Camera, CameraUniform};
use limpid::frame::FrameInput;
use limpid::gpu::{self, Gpu, Timer};
use limpid::liquid::classify::Splats;
use limpid::offscreen::Picture;
use limpid::passes::mips::{self, Mips};
use limpid::passes::refract::{Params, Variant};
use limpid::passes::scene_binding::SceneBinding;
use limpid::passes::{CameraBinding, Layers};
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::settings::{Refract, Solver};
use limpid_io::error::Result;
use truth::solves;

pub use truth::{
    Answer, OFF, Score, Target, Truth, ViewLayers, hit_error, score, truths, world_from_view,
};

/// An intersector with its settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// Its name in the report.
    pub name: String,
    /// Description of its settings, if several methods share the name.
    pub words: String,
    /// Its settings; `None` runs everything but an intersection.
    pub settings: Option<Refract>,
}

/// Times and answers of a method.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// Device time of each run, ms.
    pub ms: Vec<f64>,
    /// Its answer at each pixel.
    pub answers: Vec<Answer>,
    /// Texels read per ray, mean.
    pub fetches: f64,
    /// Layer evaluations per ray, mean.
    pub iterations: f64,
    /// Number of hits by the classes in which the ray entered and left, indexed by entry + 2 exit,
    /// 0 for aggregates and 1 for splashes.
    pub orders: [u64; 4],
}

/// The layers of one view on the device, and the resources to intersect them.
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
    /// [`limpid::Error::Limit`] if the picture is too large.
    pub fn new(gpu: &Gpu, uniform: &CameraUniform, layers: &ViewLayers) -> Result<Self> {
        gpu.check_size(layers.size)?;
        let camera = CameraBinding::new(gpu, uniform.far > 0.0);
        camera.write(gpu, uniform);
        let empty = vec![[0f32; 4]; layers.size.element_product() as usize];
        let none = [empty.clone(), empty];
        let splash = layers.splash.as_ref().unwrap_or(&none);
        let textures = [
            upload(gpu, layers.size, &[&layers.aggregate[0], &layers.aggregate[1]]),
            upload(gpu, layers.size, &[&splash[0], &splash[1]]),
            upload(gpu, layers.size, &[&layers.solids]),
        ];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let all: Vec<_> = textures.iter().collect();
        Mips::prepare(gpu, &all).record(&mut encoder, Timer::new(gpu, false, 0).span("mips"));
        gpu.queue.submit([encoder.finish()]);

        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::sampled(D2),
            gpu::sampled(D2),
        ];
        let inputs = gpu.layout("report inputs", wgpu::ShaderStages::COMPUTE, &bindings);
        let bindings =
            [gpu::storage_texture(Layers::FORMAT, D2), gpu::storage_texture(Layers::FORMAT, D2)];
        let outputs = gpu.layout("report outputs", wgpu::ShaderStages::COMPUTE, &bindings);
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let output = |label| gpu.texture(label, layers.size, 1, Layers::FORMAT, usage);
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

    /// Runs every method `repeats` times, interleaved, so that a disturbance affects all of them.
    ///
    /// # Errors
    /// [`limpid::Error::DeviceLost`].
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
            // The warm-up run provides the answers.
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

    /// Reads back the answers of the last run.
    fn read(&self) -> Result<Measurement> {
        let texels = |texture: &wgpu::Texture| -> Result<Vec<[f32; 4]>> {
            Ok(bytemuck::pod_collect_to_vec(&self.gpu.read_texture(texture, 0)?))
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
        // The truth is that of these layers, which have no gaps.
        let variant = Variant::new(&scene, self.splash, 0, false, false);
        let variant = Variant { bounds: false, ..variant };
        let (root, mut constants) = match method.settings {
            Some(_) => (variant.shader(), variant.constants()),
            None => ("report/nothing.wgsl", vec![("SPLASH", f64::from(u8::from(self.splash)))]),
        };
        constants.extend(self.camera.constants());
        constants.push(("TO_SOLIDS", f64::from(u8::from(target == Target::Solids))));
        let pipeline = pipelines.entry(format!("{root} {constants:?}")).or_insert_with(|| {
            let words = gpu::shader::Words { mips: true, ..gpu::shader::Words::of(root) };
            let layouts = [&self.camera.layout, &self.inputs, &self.scene.layout, &self.outputs];
            let file = "report/intersect.wgsl";
            gpu.pipeline_of(SHADERS, file, words, "intersect_pixels", &layouts, &constants)
        });
        let params = Params::new(&scene, &settings, 0.0);
        let params = gpu.buffer_with("refract", gpu::UNIFORM, &[params]);
        let [aggregate, splash] = [0, 1].map(|i| gpu::array_view(&self.textures[i]));
        let solids = self.textures[2].create_view(&Default::default());
        let resources = [
            params.as_entire_binding(),
            wgpu::BindingResource::TextureView(&aggregate),
            wgpu::BindingResource::TextureView(&splash),
            wgpu::BindingResource::TextureView(&solids),
            // Bounds: only entries of liquid read them.
            wgpu::BindingResource::TextureView(&solids),
        ];
        let inputs = gpu.bind_group("report inputs", &self.inputs, &resources);
        Run { pipeline: pipeline.clone(), inputs }
    }

    fn run(&self, run: &Run) -> Result<f64> {
        let gpu = &self.gpu;
        let views = [&self.hits, &self.tallies].map(|t| t.create_view(&Default::default()));
        let resources = views.each_ref().map(wgpu::BindingResource::TextureView);
        let outputs = gpu.bind_group("report outputs", &self.outputs, &resources);
        let mut timer = Timer::new(gpu, true, 1);
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
    let texture = gpu.mipped_texture("report layers", size, count, levels, Layers::FORMAT, usage);
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

/// The compared intersectors; the first does not intersect.
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
    // Otherwise `guarded` uses the scene's reach, which depends on how narrow its features are.
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

/// Measures the intersectors on every view of a scene and adds the rows, figures and orders to the
/// report.
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
    let target = if subject.is_water { Target::Solids } else { Target::Liquid };
    let width = match (quick, target) {
        (true, _) => 320,
        (false, Target::Solids) => 2000,
        (false, Target::Liquid) => 1024,
    };
    let (repeats, size) = (if quick { 3 } else { 7 }, size(subject.name, width));
    for (name, camera) in &subject.views {
        let uniform = camera.uniform(size, DVec3::ZERO);
        let view = ViewSpace::new(&uniform);
        let layers = match target {
            Target::Solids => ViewLayers::exact(subject, camera, size),
            Target::Liquid => {
                let splats = &subject.loaded.splats;
                ViewLayers::drawn(gpu, renderer, &subject.scene, camera, splats, size)?
            }
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
        // The last two methods are the march that reads every texel, and `guarded`.
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

/// Makes a row for each method but the first, which does not intersect and whose time is
/// subtracted.
pub(super) fn rows(
    name: &str,
    methods: &[Method],
    measured: &[Measurement],
    view: &ViewSpace,
    truths: &[Truth],
    truth: &str,
) -> Vec<Row> {
    let of = |(method, measurement): (&Method, &Measurement)| {
        // Paired: subtracts from each run the baseline run of the same round.
        let pairs = measurement.ms.iter().zip(&measured[0].ms);
        let net: Vec<f64> = pairs.map(|(ms, baseline)| (ms - baseline).max(0.0)).collect();
        let score = score(view, truths, &measurement.answers);
        let mut row = Row::new(RowKind::Intersect, name, &method.name, &method.words)
            .timed(&net)
            .with_error(score.rays_wrong(), ErrorKind::RaysWrong, truth);
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

/// Draws the failures of a method, after Mayer et al. (2026), table 2: green where `other` fails
/// too, magenta where only the method does, grey where it is right, black without liquid.
fn failures(
    view: &ViewSpace,
    size: UVec2,
    truths: &[Truth],
    method: &[Answer],
    other: &[Answer],
) -> RgbImage {
    let right = |truth: Truth, answer: Answer| match (truth, answer) {
        (Truth::Hit(hit), Answer::Hit(u, depth)) => solves(view, &hit, u, depth),
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
    /// Renders the layers with the renderer.
    pub(super) fn drawn(
        gpu: &Gpu,
        renderer: &mut Renderer,
        scene: &Scene,
        camera: &Camera,
        splats: &Splats,
        size: UVec2,
    ) -> Result<Self> {
        let target = Picture::new(gpu, size)?;
        let input = FrameInput::new(scene, camera, splats, size);
        renderer.render(FrameInput { diagnose: true, ..input }, &target)?;
        let images = renderer.images();
        let solids = images.gbuffer.as_ref().map(|gbuffer| &gbuffer.planes);
        Self::read(gpu, &images.smoothed, images.splash.as_ref(), solids)
    }

    /// Reads rendered layers back.
    pub(super) fn read(
        gpu: &Gpu,
        aggregate: &Layers,
        splash: Option<&Layers>,
        solids: Option<&wgpu::Texture>,
    ) -> Result<Self> {
        let read = |texture: &wgpu::Texture, layer: u32| -> Result<Vec<[f32; 4]>> {
            Ok(bytemuck::pod_collect_to_vec(&gpu.read_texture(texture, layer)?))
        };
        // Without the flags of texels with gaps, which are not read.
        let layer = |layers: &Layers, layer: u32| -> Result<Vec<[f32; 4]>> {
            let texels = read(&layers.texture, layer)?;
            Ok(texels.into_iter().map(|[x, y, z, depth]| [x, y, z, depth.abs()]).collect())
        };
        let pair = |layers: &Layers| -> Result<[Vec<[f32; 4]>; 2]> {
            Ok([layer(layers, Layers::FRONT)?, layer(layers, Layers::BACK)?])
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::layers::LayerHit;

    /// Each wrong ray counts once, however it fails, and the share is of all rays.
    #[test]
    fn wrong_rays_count_once() {
        let view = ViewSpace {
            size: DVec2::new(160.0, 120.0),
            tangent: DVec2::new(0.4, 0.3),
            near: 1e-3,
            far: None,
        };
        let hit = LayerHit { u: DVec2::splat(60.5), depth: 5.0, plane: DVec3::new(0.0, 0.0, -0.2) };
        let (right, aside) = (Answer::Hit(hit.u, 5.0), Answer::Hit(hit.u + 20.0, 5.0));
        let (solvable, hidden) = (Truth::Hit(hit), Truth::Unsolvable);
        let rays = [
            (Truth::None, Answer::None),
            (solvable, right),
            // Unsolved and a wrong accept at once: one wrong ray.
            (solvable, aside),
            (solvable, Answer::Missed),
            (hidden, right),
            (hidden, Answer::Missed),
        ];
        let (truths, answers): (Vec<_>, Vec<_>) = rays.into_iter().unzip();
        let method = Method { name: "known".into(), words: String::new(), settings: None };
        let measurement =
            Measurement { ms: vec![1.0], answers, fetches: 0.0, iterations: 0.0, orders: [0; 4] };
        let (methods, measured) = ([method.clone(), method], [measurement.clone(), measurement]);
        let rows = rows("known", &methods, &measured, &view, &truths, "known");
        assert_eq!(rows[0].error, Some(3.0 / 5.0));
        assert_eq!(rows[0].wrong_accepts, Some(2.0 / 5.0));
    }
}
