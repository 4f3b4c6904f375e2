//! Measurement of skipped work: each frame is rendered twice, once with something added that does
//! not change the picture but forces the skipped work to run.

use glam::{DVec3, UVec2, Vec3};
use image::RgbaImage;
use serde::Serialize;

use super::rows::median;
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::{Gpu, PassTime};
use limpid::liquid::classify::{Splat, Splats};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Kind, Light, Liquid, Scene, Shape, Solid, Surface};
use limpid::settings::Solids;
use limpid_io::error::Result;

/// The inputs of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The scene.
    pub scene: Scene,
    /// The view.
    pub camera: Camera,
    /// The particles.
    pub splats: Splats,
}

/// A case in which work is skipped.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Why the work is not needed.
    pub name: &'static str,
    /// The change that forces it to run.
    pub forced_by: &'static str,
    /// A frame rendered just before, if the case depends on one.
    pub before: Option<Frame>,
    /// The frame with work skipped.
    pub elided: Frame,
    /// The frame with all work forced; its picture is the same.
    pub forced: Frame,
    /// Passes that only the forced frame runs; empty where passes only do less work.
    pub left_out: &'static [&'static str],
}

/// The time that skipping saves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Elision {
    /// Why the work is not needed.
    pub name: String,
    /// The change that forces it to run.
    pub forced_by: String,
    /// Whether the pictures are bit-identical.
    pub same: bool,
    /// Median time of all passes with the work skipped, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
    /// Median time of all passes with the work forced, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forced_ms: Option<f64>,
}

/// The passes of a light's view.
const OF_LIGHTS: &[&str] = &["light splat", "light tiles", "light gbuffer", "caustics"];

/// Builds all cases from a frame with aggregates over solids.
pub fn cases(frame: &Frame) -> Vec<Case> {
    [without_need(frame), kept(frame)].concat()
}

const SUN: Light = Light::Sun { direction: Vec3::new(0.3, -1.0, 0.2), irradiance: Vec3::ONE };

/// Work that a frame does not need.
fn without_need(frame: &Frame) -> Vec<Case> {
    let mut base = frame.clone();
    base.splats.splashes.clear();
    base.scene.lights.clear();
    let camera = frame.camera;
    let back = (camera.eye - camera.target).normalize();
    // A splat the size of a particle, `distance` behind the eye.
    let behind = |distance: f64| {
        let centre = camera.eye + distance * back - frame.splats.origin;
        let radius = frame.splats.radius.min(0.1 * camera.near());
        Splat {
            centre: centre.as_vec3().to_array(),
            radius,
            diagonal: [radius; 3],
            particle: 0,
            off_diagonal: [0.0; 3],
            tags: 0,
        }
    };
    // A solid too small and too far away to be hit by any ray.
    let speck = |lit: bool| Solid {
        shape: Shape::Sphere { center: camera.eye + 1e4 * DVec3::new(3.0, 4.0, 5.0), radius: 1e-2 },
        surface: Surface::Color(Vec3::ONE),
        lit,
    };
    let case = |name: &'static str,
                forced_by: &'static str,
                left_out: &'static [&'static str],
                elided: &Frame,
                force: &dyn Fn(&mut Frame)| {
        let mut forced = elided.clone();
        force(&mut forced);
        Case { name, forced_by, before: None, elided: elided.clone(), forced, left_out }
    };
    let mut cases = vec![case(
        "no splashes: no splash layers",
        "a splash behind the eye",
        &["splat splashes"],
        &base,
        &|frame| frame.splats.splashes.push(behind(1.0)),
    )];

    let mut shallow = base.clone();
    shallow.scene.settings.refract.interfaces = 1;
    cases.push(case(
        "one interface: no backs",
        "a particle just behind the eye",
        &[],
        &shallow,
        &|frame| frame.splats.aggregates.push(behind(f64::from(camera.near()))),
    ));

    let mut clear = base.clone();
    clear.scene.liquid.absorption = Vec3::ZERO;
    clear.scene.fluids.clear();
    cases.push(case(
        "no absorption: no lengths of paths",
        "an absorption of 1e-30/m",
        &[],
        &clear,
        &|frame| frame.scene.liquid.absorption = Vec3::splat(1e-30),
    ));

    let mut unlit = base.clone();
    unlit.scene.lights = vec![SUN];
    unlit.scene.solids.iter_mut().for_each(|solid| solid.lit = false);
    cases.push(case(
        "nothing to light: no caustics",
        "a lit speck that no ray meets",
        OF_LIGHTS,
        &unlit,
        &|frame| frame.scene.solids.push(speck(true)),
    ));

    let mut bare = base.clone();
    bare.scene.solids.clear();
    bare.scene.settings.refract.solids = Solids::Screen;
    cases.push(case(
        "no solids: no G-buffer",
        "a speck that no ray meets",
        &["gbuffer"],
        &bare,
        &|frame| frame.scene.solids.push(speck(false)),
    ));

    let mut opaque = base.clone();
    opaque.scene.liquid = Liquid { kind: Kind::Opaque, ior: 1.0, ..Liquid::default() };
    opaque.scene.fluids.clear();
    cases.push(case(
        "an opaque body: no backs",
        "a particle just behind the eye",
        &[],
        &opaque,
        &|frame| frame.splats.aggregates.push(behind(f64::from(camera.near()))),
    ));
    cases
}

/// Work whose results are kept from the frame before.
fn kept(frame: &Frame) -> Vec<Case> {
    let mut cases = Vec::new();
    let mut lit = frame.clone();
    lit.scene.lights = vec![SUN];
    lit.scene.solids.iter_mut().for_each(|solid| solid.lit = true);
    let mut case =
        |name: &'static str, left_out: &'static [&'static str], change: &dyn Fn(&mut Frame)| {
            let mut changed = lit.clone();
            change(&mut changed);
            let forced_by = "nothing kept of the frame before";
            let (before, forced) = (Some(lit.clone()), changed.clone());
            cases.push(Case { name, forced_by, before, elided: changed, forced, left_out });
        };
    case("the camera alone moves: no caustics", OF_LIGHTS, &|frame| {
        frame.camera = frame.camera.turned(0.05);
    });
    case("more rays alone: no layers", &["light splat", "caustics", "splat", "tiles"], &|frame| {
        let samples = &mut frame.scene.settings.refract.samples;
        *samples = if *samples == 4 { 2 } else { 4 };
    });
    case("another exposure alone: no light", &["caustics", "splat", "refract"], &|frame| {
        frame.scene.settings.tonemap.exposure += 0.5;
    });
    case("nothing changes: nothing drawn", &["caustics", "splat", "refract"], &|_| ());
    cases
}

/// Renders both frames of a case, the elided one first: their pictures, and their pass times if they are asked for.
///
/// # Errors
/// As [`Renderer::render`].
pub fn draw(
    gpu: &Gpu,
    renderer: &mut Renderer,
    case: &Case,
    size: UVec2,
    timing: bool,
) -> Result<[(RgbaImage, Vec<PassTime>); 2]> {
    let target = Picture::new(gpu, size)?;
    let mut render_sequence = |before: Option<&Frame>, frame: &Frame| -> Result<_> {
        renderer.forget();
        let mut passes = Vec::new();
        for Frame { scene, camera, splats } in before.into_iter().chain([frame]) {
            let input = FrameInput::new(scene, camera, splats, size);
            let input = FrameInput { timing, reuse: true, ..input };
            passes = renderer.render(input, &target)?;
        }
        Ok((target.read(gpu)?, passes))
    };
    Ok([render_sequence(case.before.as_ref(), &case.elided)?, render_sequence(None, &case.forced)?])
}

/// Measures every elision of a frame, interleaving both pictures.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure(
    gpu: &Gpu,
    renderer: &mut Renderer,
    frame: &Frame,
    size: UVec2,
    repeats: usize,
) -> Result<Vec<Elision>> {
    let mut rows = Vec::new();
    for case in cases(frame) {
        // The first frames may compile pipelines; they are not timed.
        let [(elided, _), (forced, _)] = draw(gpu, renderer, &case, size, true)?;
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..repeats {
            for (times, (_, passes)) in
                times.iter_mut().zip(draw(gpu, renderer, &case, size, true)?)
            {
                if !passes.is_empty() {
                    times.push(passes.iter().map(|pass| pass.ms).sum::<f64>());
                }
            }
        }
        rows.push(Elision {
            name: case.name.into(),
            forced_by: case.forced_by.into(),
            same: elided == forced,
            ms: median(&times[0]),
            forced_ms: median(&times[1]),
        });
    }
    Ok(rows)
}
