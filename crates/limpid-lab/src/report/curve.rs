//! The measurements that `limpid render --max-error` and `--budget` choose from: settings with
//! their error and cost, `crates/limpid-io/src/quality.toml`.

use std::path::Path;

use glam::DVec3;
use image::RgbImage;

use super::intersect::{Bench, Method, Target, ViewLayers, hit_error, truths, world_from_view};
use super::output::write_text;
use super::rows::median;
use super::subjects::{self, Subject};
use crate::compare::{PIXELS_PER_DEGREE, flip};
use crate::reference::layers::ViewSpace;
use crate::reference::trace::{MAX_DEPTH, trace_lit};
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::classify::Splats;
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::settings::Settings;
use limpid_io::error::Result;
use limpid_io::output::FileKind;
use limpid_io::project::overrides::replaced;
use limpid_io::quality::{Choice, Curve};

/// Scenes with all kinds of rays that are quick to measure: a drop, a breaking wave, a dam break.
pub const SCENES: [&str; 3] = ["drop", "breaker", "demo"];

/// Width of their pictures, pixels, and of those whose ray hits are scored.
const WIDTH: u32 = 256;
const HITS_WIDTH: u32 = 640;

/// Rays per pixel of the path-traced pictures.
const TRUTH_SAMPLES: u32 = 4;

/// Number of timed frames; a cost is their median. More for intersectors, which differ little.
const REPEATS: [usize; 2] = [5, 3];

/// Settings of the intersectors, the defaults first.
fn intersectors() -> Vec<Vec<String>> {
    let guarded = [0.01, 0.08, 0.04, 0.02].map(|reach| ("guarded", "reach", reach));
    let march = [4.0, 2.0, 1.0].map(|stride| ("march", "stride", stride));
    let newton = [1.0, 2.0, 3.0, 4.0].map(|n| ("newton", "iterations", n));
    let secant = [1.0, 2.0, 4.0, 8.0].map(|n| ("secant", "iterations", n));
    let rest = ["single", "plane", "plane3"].map(|name| vec![format!("refract.solver={name}")]);
    let swept = guarded.into_iter().chain(march).chain(newton).chain(secant);
    let swept = swept.map(|(solver, key, value)| {
        let mut set = vec![format!("refract.solver={solver}"), format!("refract.{key}={value}")];
        if solver == "newton" {
            set.push("refract.filter=false".into());
        }
        set
    });
    swept.chain(rest).collect()
}

/// Settings of a picture other than its intersector, the defaults first.
fn knobs() -> Vec<Vec<String>> {
    let mut knobs = Vec::new();
    for intervals in [2, 1] {
        for iterations in [5, 2] {
            for (samples, bounces) in [(1, 4), (1, 0), (4, 4)] {
                knobs.push(vec![
                    format!("layers.intervals={intervals}"),
                    format!("smooth.iterations={iterations}"),
                    format!("refract.samples={samples}"),
                    format!("refract.internal_bounces={bounces}"),
                ]);
            }
        }
    }
    knobs
}

/// Intersectors that the pictures are rendered with.
const IN_PICTURES: [&str; 5] = ["reach=0.01", "reach=0.04", "stride=1", "iterations=2", "single"];

/// Measures the whole curve, reporting each step to `progress`.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure(gpu: &Gpu, progress: &mut dyn FnMut(&str)) -> Result<Curve> {
    let mut renderer = Renderer::new(gpu);
    let sets = intersectors();
    progress("curve: intersectors");
    let errors = hit_errors(gpu, &mut renderer, &sets)?;
    let in_pictures = |set: &[String]| {
        let is = |name: &&str| set.iter().any(|text| text.ends_with(name));
        !is(&"secant") && IN_PICTURES.iter().any(is)
    };
    // Pairs of error and settings; the first are the defaults in both lists.
    let mut alone = Vec::new();
    let mut mixed = Vec::new();
    for (set, error) in sets.into_iter().zip(errors) {
        if in_pictures(&set) {
            mixed.extend(knobs().into_iter().map(|knobs| (error, [&set[..], &knobs].concat())));
        }
        alone.push((error, set));
    }
    let [intersectors, pictures] = measured(gpu, &mut renderer, [alone, mixed], progress)?;
    let worse = |a: &Choice, b: &Choice| {
        b.error_px <= a.error_px && b.flip <= a.flip && b.cost < a.cost
            || b.error_px <= a.error_px && b.flip < a.flip && b.cost <= a.cost
    };
    let kept = |(i, a): &(usize, &Choice)| *i == 0 || !pictures.iter().any(|b| worse(a, b));
    let front = pictures.iter().enumerate().filter(kept).map(|(_, choice)| choice);
    Ok(Curve {
        adapter: gpu.adapter(),
        scenes: SCENES.map(str::to_owned).to_vec(),
        hits_width: HITS_WIDTH,
        width: WIDTH,
        pictures: front.cloned().collect(),
        intersectors,
    })
}

/// First lines of the file.
const HEADER: &str = "\
# Written by `limpid report --curve crates/limpid-io/src/quality.toml`: settings, the error of their intersector (pixels),
# mean FLIP against traced pictures, and the time of a frame over that with the defaults.
";

/// Writes the curve.
///
/// # Errors
/// [`Error::Io`](limpid_io::Error::Io) naming the file.
pub fn write(path: &Path, curve: &Curve) -> Result<()> {
    let text = toml::to_string(curve).expect("a curve has names and numbers");
    write_text(path, FileKind::CURVE, &format!("{HEADER}{text}"))
}

/// Renders with each of the settings and adds FLIP and cost. The first of each list are the
/// defaults.
fn measured(
    gpu: &Gpu,
    renderer: &mut Renderer,
    lists: [Vec<(f64, Vec<String>)>; 2],
    progress: &mut dyn FnMut(&str),
) -> Result<[Vec<Choice>; 2]> {
    let mut sums = lists.each_ref().map(|list| vec![(0.0, 0.0); list.len()]);
    for name in SCENES {
        let subject = Subject::new(name)?;
        let (size, camera) = (subjects::size(name, WIDTH), &subject.views[0].1);
        let (liquid, samples) = (&*subject.liquid, TRUTH_SAMPLES);
        let truth = trace_lit(liquid, &subject.scene, camera, size, samples, MAX_DEPTH, &[]);
        let truth = truth.to_srgb();
        for ((list, sums), repeats) in lists.iter().zip(&mut sums).zip(REPEATS) {
            progress(&format!("curve: {} pictures of {name}", list.len()));
            let (flips, costs) = pictures(gpu, renderer, &subject, &truth, list, repeats)?;
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum = (sum.0 + flips[i], sum.1 + (costs[i] / costs[0]).ln());
            }
        }
    }
    let rounded = |x: f64| format!("{x:.3e}").parse().unwrap_or(x);
    let scenes = SCENES.len() as f64;
    let mut lists = lists.into_iter().zip(sums).map(|(list, sums)| {
        let choice = |((error, set), (flip, cost)): ((f64, Vec<String>), (f64, f64))| Choice {
            set,
            error_px: rounded(error),
            flip: rounded(flip / scenes),
            cost: rounded((cost / scenes).exp()),
        };
        list.into_iter().zip(sums).map(choice).collect()
    });
    Ok([(); 2].map(|()| lists.next().expect("two lists")))
}

/// Measures the error of each intersector over the rays of all scenes, pixels:
/// [`Choice::error_px`].
///
/// # Errors
/// As [`Renderer::render`].
pub fn hit_errors(gpu: &Gpu, renderer: &mut Renderer, sets: &[Vec<String>]) -> Result<Vec<f64>> {
    let mut sums = vec![(0.0, 0); sets.len()];
    for name in SCENES {
        let (_, project, loaded) = subjects::load(name)?;
        let scene = Scene { settings: Settings::default(), ..project.scene.clone() };
        let methods: Vec<_> = sets
            .iter()
            .map(|set| {
                let settings = Some(replaced(&scene.settings, set)?.refract);
                Ok(Method { name: set.join(" "), words: String::new(), settings })
            })
            .collect::<Result<_>>()?;
        let (size, camera) =
            (subjects::size(name, HITS_WIDTH), project.camera_for(loaded.bulk.bounds));
        let uniform = camera.uniform(size, DVec3::ZERO);
        let view = ViewSpace::new(&uniform);
        let layers = ViewLayers::drawn(gpu, renderer, &scene, &camera, &loaded.splats, size)?;
        let target = Target::Liquid;
        let truths = truths(&world_from_view(&camera), &uniform, &scene, &layers, target);
        let measured = Bench::new(gpu, &uniform, &layers)?.measure(&methods, &scene, target, 0)?;
        for (sum, measurement) in sums.iter_mut().zip(&measured) {
            let (squares, rays) = hit_error(&view, &truths, &measurement.answers);
            *sum = (sum.0 + squares, sum.1 + rays);
        }
    }
    let mean = |&(squares, rays): &(f64, u64)| (squares / rays.max(1) as f64).sqrt();
    Ok(sums.iter().map(mean).collect())
}

/// Measures FLIP and time of a scene's pictures with each of the settings, interleaved.
fn pictures(
    gpu: &Gpu,
    renderer: &mut Renderer,
    subject: &Subject,
    truth: &RgbImage,
    list: &[(f64, Vec<String>)],
    repeats: usize,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let size = subjects::size(subject.name, WIDTH);
    let camera = subject.views[0].1;
    let frames: Vec<(Scene, Splats)> = list
        .iter()
        .map(|(_, set)| {
            let (scene, loaded) = subject.with(&replaced(&Settings::default(), set)?)?;
            Ok((scene, loaded.splats))
        })
        .collect::<Result<_>>()?;
    let target = Picture::new(gpu, size)?;
    let mut flips = Vec::new();
    let mut times = vec![Vec::new(); list.len()];
    // The first round may compile pipelines: its pictures are compared, its times are not used.
    for repeat in 0..=repeats {
        for ((scene, splats), times) in frames.iter().zip(&mut times) {
            let input = FrameInput::new(scene, &camera, splats, size);
            let passes = renderer.render(FrameInput { timing: true, ..input }, &target)?;
            if repeat == 0 {
                let picture = image::DynamicImage::ImageRgba8(target.read(gpu)?).into_rgb8();
                flips.push(flip(truth, &picture, PIXELS_PER_DEGREE)?.mean());
            } else {
                times.push(passes.iter().map(|pass| pass.ms).sum::<f64>());
            }
        }
    }
    let costs = times.iter().map(|times| median(times).unwrap_or(f64::NAN));
    Ok((flips, costs.collect()))
}
