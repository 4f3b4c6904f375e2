//! Measurement of whole frames: presets and single changes to the defaults, against path-traced
//! pictures.

use image::RgbImage;

use super::caustics;
use super::rows::{ErrorKind, Figure, Row, RowKind};
use super::subjects::{Subject, size};
use crate::compare::{PIXELS_PER_DEGREE, flip};
use crate::reference::trace::{MAX_DEPTH, intervals, trace_lit};
use limpid::frame::FrameInput;
use limpid::gpu::{Gpu, PassTime};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::settings::{Filter, Layers, Method, Preset, Refract, Settings, Solver};
use limpid_io::error::Result;

/// Resolution and repetitions of the measurement.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Width, pixels.
    pub width: u32,
    /// Samples per pixel of the path-traced truth.
    pub truth_samples: u32,
    /// Timed runs.
    pub repeats: usize,
    /// Whether to measure single changes to the defaults besides the presets.
    pub variants: bool,
}

/// The compared pictures: method, description of its settings, settings.
fn methods(variants: bool, lit: bool) -> Vec<(String, String, Settings)> {
    let mut methods: Vec<_> =
        [Preset::Imai2014, Preset::Imai2016, Preset::Mayer2026, Preset::Limpid]
            .into_iter()
            .map(|preset| (preset.to_string(), String::new(), preset.settings()))
            .collect();
    let limpid = |refract: Refract| Settings { refract, ..Settings::default() };
    let four = Refract { samples: 4, ..Refract::default() };
    methods.push(("limpid".into(), "4 samples".into(), limpid(four.clone())));
    for (intervals, text) in [(1, "4 samples, 1 interval"), (3, "4 samples, 3 intervals")] {
        let settings = Settings { layers: Layers { intervals }, ..limpid(four.clone()) };
        methods.push(("limpid".into(), text.into(), settings));
    }
    if lit {
        for (name, method) in [("straight", Method::Straight), ("gather", Method::Gather)] {
            let mut settings = limpid(Refract { samples: 4, ..Refract::default() });
            settings.caustics.method = method;
            methods.push(("limpid".into(), format!("4 samples, caustics {name}"), settings));
        }
    }
    if variants {
        for solver in Solver::ALL.into_iter().filter(|&s| s != Solver::Guarded) {
            let name = serde_json::to_value(solver).expect("a solver has a name");
            let name = name.as_str().unwrap_or_default().to_owned();
            let refract = Refract { solver, ..Refract::default() };
            methods.push(("limpid".into(), format!("solver {name}"), limpid(refract)));
        }
        for (name, filter) in
            [("bilateral", Filter::Bilateral), ("narrow-range", Filter::NarrowRange)]
        {
            let mut settings = Settings::default();
            settings.smooth.filter = filter;
            methods.push(("limpid".into(), format!("filter {name}"), settings));
        }
        let bounces = Refract { internal_bounces: 0, ..Refract::default() };
        methods.push(("limpid".into(), "no internal bounces".into(), limpid(bounces)));
    }
    methods
}

/// Renders one frame several times and returns the picture with the pass times of each run.
///
/// # Errors
/// As [`Renderer::render`].
pub fn draw(
    gpu: &Gpu,
    renderer: &mut Renderer,
    input: FrameInput<'_>,
    repeats: usize,
) -> Result<(RgbImage, Vec<Vec<PassTime>>)> {
    let picture = Picture::new(gpu, input.size)?;
    let input = FrameInput { timing: true, reuse: false, ..input };
    // The first run compiles pipelines; it is not timed.
    renderer.render(input, &picture)?;
    let times = (0..repeats).map(|_| renderer.render(input, &picture));
    let times = times.collect::<limpid::Result<_>>()?;
    let rgb = image::DynamicImage::ImageRgba8(picture.read(gpu)?).into_rgb8();
    Ok((rgb, times))
}

/// Measures the pictures of one scene.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure(
    gpu: &Gpu,
    renderer: &mut Renderer,
    subject: &Subject,
    effort: &Effort,
) -> Result<(Vec<Row>, Figure)> {
    let size = size(subject.name, effort.width);
    let camera = subject.views[0].1;
    let samples = effort.truth_samples;
    let maps = caustics::truths(subject, effort.width);
    let liquid = &*subject.liquid;
    let truth = trace_lit(liquid, &subject.scene, &camera, size, samples, MAX_DEPTH, &maps);
    let truth = truth.to_srgb();
    let counts: Vec<_> = intervals(liquid, &camera, size).iter().map(Vec::len).collect();
    let [wet, several] = [1, 2].map(|least| counts.iter().filter(|n| **n >= least).count());
    let mut rows = Vec::new();
    let mut panels = vec![("truth".to_owned(), truth.clone())];
    for (method, settings_text, settings) in methods(effort.variants, subject.scene.is_lit()) {
        let (scene, loaded) = subject.with(&settings)?;
        let (picture, times) =
            draw(gpu, renderer, loaded.picture(&scene, &camera, size), effort.repeats)?;
        let map = flip(&truth, &picture, PIXELS_PER_DEGREE)?;
        let totals: Vec<f64> =
            times.iter().map(|passes| passes.iter().map(|pass| pass.ms).sum()).collect();
        let row = Row::new(RowKind::Picture, subject.name, &method, &settings_text)
            .timed(&totals)
            .with_error(map.mean(), ErrorKind::MeanFlip, subject.truth);
        let row = Row { several_intervals: (wet > 0).then(|| several as f64 / wet as f64), ..row };
        // Rows that differ only in the measure of the error become columns.
        for (kind, least, most) in [
            (ErrorKind::FlipOfLiquid, 1, usize::MAX),
            (ErrorKind::FlipOneInterval, 1, 1),
            (ErrorKind::FlipSeveralIntervals, 2, usize::MAX),
        ] {
            let at = |x, y| counts[(y * size.x + x) as usize];
            let error = map.mean_where(|x, y| (least..=most).contains(&at(x, y)));
            rows.extend(error.map(|e| row.clone().with_error(e, kind, subject.truth)));
        }
        if settings_text.is_empty() || settings_text.starts_with("4 samples") {
            let caption = format!("{method} {settings_text}").trim_end().to_owned();
            panels.push((format!("{caption}: FLIP {:.3}", map.mean()), picture));
            if settings_text == "4 samples" {
                panels.push((format!("{caption}, difference"), map.picture()));
            }
        }
        if method == "limpid" && settings_text.is_empty() {
            rows.extend(passes(subject.name, &times));
        }
        rows.push(row);
    }
    let title =
        format!("{}: the truth ({}) and what each method draws", subject.name, subject.truth);
    Ok((rows, Figure { title, scene: subject.name.into(), panels }))
}

/// Makes a row for each pass.
fn passes(scene: &str, times: &[Vec<PassTime>]) -> Vec<Row> {
    let Some(first) = times.first() else { return Vec::new() };
    (0..first.len())
        .map(|i| {
            let of_pass: Vec<f64> = times.iter().map(|passes| passes[i].ms).collect();
            Row::new(RowKind::Pass, scene, first[i].name, "").timed(&of_pass)
        })
        .collect()
}
