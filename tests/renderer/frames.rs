//! Whole frames: pictures do not depend on earlier frames, on the target, or on which of several
//! equivalent pipelines draws them.

mod extremes;
mod targets;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::{Camera, Lens, View};
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splats, classify};
use limpid::offscreen::{Offscreen, PendingFrame};
use limpid::renderer::Renderer;
use limpid::scene::{Scene, Shape};
use limpid::settings::{Solids, Solver};
use limpid::wgpu;

use crate::support::frames::{
    FrameImages, diagnosed, glowing, gpu, harness, limited, mean_difference, noise_vector, on_axis,
    render, sphere,
};

const SIZE: UVec2 = UVec2::new(120, 90);

/// A drop of 200 particles with some spray and default settings: floor, sky, absorption.
fn tank() -> (Scene, Camera, Splats) {
    tank_of(200)
}

fn tank_of(count: usize) -> (Scene, Camera, Splats) {
    let mut seed = 9;
    let positions = (0..count)
        .map(|i| {
            let reach = if i < count - 30 { Vec3::new(0.3, 0.2, 0.3) } else { Vec3::splat(0.8) };
            reach * noise_vector(&mut seed)
        })
        .collect();
    let particles = Particles { positions, ..Default::default() };
    let scene = Scene::around(DVec3::splat(-0.8), DVec3::splat(0.8), 0.06);
    let camera = Camera { eye: DVec3::new(0.7, 1.2, 2.4), ..on_axis(0.0, 40.0) };
    let drawn = classify(&particles, 0.06, &scene.settings.classify);
    assert!(drawn.splashes.len() > 10 && drawn.aggregates.len() > 100);
    (scene, camera, drawn)
}

/// All images of both frames are bitwise equal.
#[track_caller]
fn assert_same(a: &FrameImages, b: &FrameImages, why: &str) {
    let names = |shot: &FrameImages| {
        let mut names: Vec<_> = shot.channels.keys().cloned().collect();
        names.sort();
        names
    };
    assert_eq!(names(a), names(b), "{why}");
    for (name, values) in &a.channels {
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(values) == bits(b.channel(name)), "{why}: {name} differs");
    }
    assert!(a.picture == b.picture, "{why}: the pictures differ");
}

/// Pictures of one frame from several views, perspective and parallel, equal single pictures from them.
#[test]
fn views_of_one_frame_equal_single_pictures() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, drawn) = tank();
    let parallel = Camera { lens: Some(Lens::Orthographic { height: 2.0 }), ..camera.turned(0.4) };
    let cameras = [camera, camera.turned(0.3), parallel, camera.turned(2.0), camera];
    let views = cameras.map(|camera| View::from(&camera));
    let input = FrameInput::new(&scene, &camera, &drawn, SIZE);
    let pictures = Offscreen::new(&gpu).draw_views(input, &views).expect("pictures");
    assert_eq!(pictures.len(), views.len());
    for (view, picture) in views.into_iter().zip(&pictures) {
        let alone = Offscreen::new(&gpu).draw(FrameInput { view, ..input }).expect("a picture");
        assert!(alone.into_image().into_rgba8() == *picture, "{view:?}");
    }
    assert!(pictures[0] != pictures[1], "the views are the same");
}

/// Pictures begun while the device still draws earlier ones are unaffected by the particles uploaded
/// meanwhile, in smaller and larger buffers, and by other sizes.
#[test]
fn pipelined_pictures_equal_single_pictures() {
    let Some(gpu) = gpu() else { return };
    let frames: Vec<_> = [(300, SIZE), (200, SIZE), (400, SIZE), (200, SIZE / 2), (300, 2 * SIZE)]
        .into_iter()
        .map(|(count, size)| (tank_of(count), size))
        .collect();
    let alone = frames.iter().map(|((scene, camera, drawn), size)| {
        let input = FrameInput::new(scene, camera, drawn, *size);
        Offscreen::new(&gpu).draw(input).expect("a picture").picture
    });
    let alone: Vec<_> = alone.collect();
    let mut offscreen = Offscreen::new(&gpu);
    let begun: Vec<_> = frames
        .iter()
        .map(|((scene, camera, drawn), size)| {
            offscreen.begin(FrameInput::new(scene, camera, drawn, *size))
        })
        .collect();
    // In reverse order, which must not matter.
    for (begun, alone) in begun.into_iter().zip(alone).rev() {
        let picture = begun.and_then(PendingFrame::wait).expect("a picture").picture;
        assert!(picture == alone, "{:?} differs", picture.dimensions());
    }
}

/// Largest difference of radiance between two frames.
fn largest_difference(a: &FrameImages, b: &FrameImages) -> f64 {
    let off = |p| (a.radiance(p) - b.radiance(p)).abs().max_element();
    a.pixels().map(off).fold(0.0, f64::max)
}

/// A frame depends only on its inputs: a renderer that has drawn other frames, with other sizes, layers
/// and solids, draws it like a new renderer. Frames may thus be rendered in any order. Detects passes
/// that keep images of the last frame or size.
#[test]
fn frames_do_not_depend_on_each_other() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, drawn) = tank();
    let mut screen = scene.clone();
    screen.settings.refract.solids = Solids::Screen;
    let bodies = Splats { splashes: Vec::new(), ..drawn.clone() };
    let spray = Splats { aggregates: Vec::new(), ..drawn.clone() };
    let fewer = Splats { aggregates: drawn.aggregates[..40].to_vec(), ..drawn.clone() };
    let nothing = Splats { radius: 0.06, ..Default::default() };
    let large = UVec2::new(150, 101);
    let frames = [
        ("all", &scene, &drawn, SIZE),
        ("larger", &scene, &drawn, large),
        ("tiny", &scene, &drawn, UVec2::new(7, 5)),
        ("no spray", &scene, &bodies, SIZE),
        ("nothing", &scene, &nothing, SIZE),
        ("only spray", &scene, &spray, SIZE),
        ("fewer", &scene, &fewer, large),
        ("solids on the screen", &screen, &drawn, SIZE),
    ];
    let draw = |renderer: &mut Renderer,
                (_, scene, drawn, size): (&str, &Scene, &Splats, UVec2)| {
        let shot = render(&gpu, renderer, diagnosed(scene, &camera, drawn, size));
        shot.assert_finite();
        shot
    };
    // New renderers for the two frames that could inherit most; for the others, the first round.
    let mut kept = Renderer::new(&gpu);
    let first: Vec<_> = frames.iter().map(|&frame| draw(&mut kept, frame)).collect();
    for i in [0, 2] {
        assert_same(&draw(&mut Renderer::new(&gpu), frames[i]), &first[i], frames[i].0);
    }
    for i in [3, 0, 6, 1, 5, 2, 7, 4, 1, 3] {
        assert_same(&draw(&mut kept, frames[i]), &first[i], frames[i].0);
    }
    // Without diagnostics, which draw a G-buffer and count, the picture is the same.
    let plain = render(&gpu, &mut kept, FrameInput::new(&scene, &camera, &drawn, SIZE));
    assert!(!plain.has("interfaces") && !plain.has("solid_depth"));
    let difference = largest_difference(&plain, &first[0]);
    println!("without counting: {difference:e}");
    assert!(plain.picture == first[0].picture && difference < 1e-6, "{difference}");
}

/// An intersector that reads the bounds of the layers finds those of this frame, whichever one drew its layers.
/// Without them it skipped all liquid that rays enter again.
#[test]
fn bounds_are_found_where_another_intersector_drew_the_layers() {
    let Some(gpu) = gpu() else { return };
    let (guarded, camera, drawn) = tank();
    let mut march = guarded.clone();
    march.settings.refract.solver = Solver::March;
    let nothing = Splats { radius: drawn.radius, ..Default::default() };
    let mut kept = Renderer::new(&gpu);
    let mut draw = |scene: &Scene, splats: &Splats| {
        render(&gpu, &mut kept, FrameInput::new(scene, &camera, splats, SIZE))
    };
    let expected = draw(&guarded, &drawn);
    draw(&guarded, &nothing);
    draw(&march, &drawn);
    assert_same(&draw(&guarded, &drawn), &expected, "after another intersector");
}

/// Features that a scene lacks are compiled out, with the same picture as if they were present without
/// effect. Since different code computes it, the tolerance is a mean of 1e-4, for the few pixels in
/// which rounding decides the path of a ray.
#[test]
fn unused_features_do_not_change_the_picture() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, camera, mut drawn) = tank();
    drawn.splashes.clear();
    scene.solids.clear();
    scene.liquid.absorption = Vec3::ZERO;
    let plain = harness.render(&scene, &camera, &drawn, SIZE);
    plain.assert_finite();
    let mut check = |name: &str, scene: &Scene, drawn: &Splats| {
        let shot = harness.render(scene, &camera, drawn, SIZE);
        shot.assert_finite();
        let (mean, most) = (mean_difference(&plain, &shot), largest_difference(&plain, &shot));
        println!("{name}: mean {mean:.2e}, most {most:.2e}");
        assert!(mean < 1e-4, "{name}: {mean}");
    };
    // A splash behind the eye.
    let behind =
        Splats { splashes: vec![sphere((2.0 * camera.eye).as_vec3(), 0.1)], ..drawn.clone() };
    check("splash layers", &scene, &behind);
    let mut absorbing = scene.clone();
    absorbing.liquid.absorption = Vec3::splat(1e-20);
    check("absorption", &absorbing, &drawn);
    // A distant speck that no ray hits.
    let mut beside = scene.clone();
    let speck = Shape::Sphere { center: DVec3::new(3e4, 4e4, 5e4), radius: 1e-2 };
    beside.solids = vec![glowing(speck, Vec3::ONE)];
    check("solid and contact", &beside, &drawn);
    beside.settings.refract.contact = 0.0;
    check("solid", &beside, &drawn);
    beside.settings.refract.solids = Solids::Screen;
    check("solid on the screen", &beside, &drawn);
    // An environment of another kind.
    let mut constant = scene.clone();
    constant.environment = Environment::Constant(Vec3::splat(0.4));
    let constant = harness.render(&constant, &camera, &drawn, SIZE);
    let mut map = scene.clone();
    let pixels = vec![[0.4, 0.4, 0.4, 1.0]; 8];
    map.environment = Environment::Map { size: UVec2::new(4, 2), pixels: pixels.into() };
    let map = harness.render(&map, &camera, &drawn, SIZE);
    let mean = mean_difference(&constant, &map);
    println!("map: {mean:.2e}");
    assert!(mean < 1e-4, "{mean}");
}

/// A class of splats that exceeds one binding is drawn in parts, with the same picture.
#[test]
fn splats_beyond_one_binding_are_drawn_in_parts() {
    let Some(whole) = gpu() else { return };
    // Room for 1,000 splats in a binding.
    let parts = limited(&whole, |limits| limits.max_storage_buffer_binding_size = 48_000);
    let (scene, camera, drawn) = tank_of(2500);
    assert!(drawn.aggregates.len() > 2000, "{} aggregates", drawn.aggregates.len());
    let [whole, parts] = [whole, parts].map(|gpu| {
        let input = FrameInput::new(&scene, &camera, &drawn, SIZE);
        render(&gpu, &mut Renderer::new(&gpu), input)
    });
    assert!(whole.picture == parts.picture);
}

/// A taken radiance is that of its frame, whatever is drawn afterwards, and the next frame goes into the spare.
#[test]
fn a_taken_radiance_stays() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, splats) = tank();
    let other = Camera { eye: DVec3::new(-0.7, 0.8, 2.0), ..camera };
    let mut offscreen = Offscreen::new(&gpu);
    let mut draw = |camera: &Camera, spare: Option<wgpu::Texture>| {
        let frame = offscreen.draw(FrameInput::new(&scene, camera, &splats, SIZE)).unwrap();
        let read = offscreen.radiance().unwrap();
        (frame.picture, read, offscreen.take_radiance(spare))
    };
    let (first_picture, first, taken) = draw(&camera, None);
    let (second_picture, second, again) = draw(&other, None);
    assert_ne!(first, second);
    assert_eq!(taken.read().unwrap(), first, "after another frame");
    assert_eq!(again.read().unwrap(), second);
    // Two frames later the spare is drawn into.
    let spare = taken.into_spare();
    let (third_picture, third, _) = draw(&camera, Some(spare.clone()));
    assert_eq!((&third_picture, &third), (&first_picture, &first));
    let (fourth_picture, _, taken) = draw(&other, None);
    assert_eq!(fourth_picture, second_picture);
    assert_eq!(taken.into_spare(), spare);
}

/// An interrupted frame ends with an error; the handle draws the same picture afterwards, and others are not
/// affected.
#[test]
fn an_interrupt_ends_a_frame() {
    let Some(gpu) = gpu() else { return };
    let (scene, camera, splats) = tank();
    let interrupt = Arc::new(AtomicBool::new(false));
    let mut offscreen = Offscreen::new(&gpu.clone().with_interrupt(interrupt.clone()));
    let input = FrameInput::new(&scene, &camera, &splats, SIZE);
    let expected = offscreen.draw(input).unwrap().picture;
    interrupt.store(true, Ordering::Relaxed);
    let ended = offscreen.draw(input);
    assert!(matches!(ended, Err(limpid::Error::Interrupted)), "{:?}", ended.err());
    let other = Offscreen::new(&gpu).draw(input).unwrap().picture;
    assert_eq!(other, expected);
    interrupt.store(false, Ordering::Relaxed);
    // Interrupted after it was submitted.
    let pending = offscreen.begin(input).unwrap();
    interrupt.store(true, Ordering::Relaxed);
    assert!(matches!(pending.wait(), Err(limpid::Error::Interrupted)));
    interrupt.store(false, Ordering::Relaxed);
    assert_eq!(offscreen.draw(input).unwrap().picture, expected);
}

/// An adapter is chosen by a part of its name, whatever the environment says.
#[test]
fn adapters_are_chosen_by_name() {
    let Some(gpu) = gpu() else { return };
    let adapter = gpu.adapter();
    let part = adapter.split(' ').next().unwrap_or_default().to_uppercase();
    // Another backend may have the same adapter by a longer name.
    let found = Gpu::named(&part).unwrap().adapter();
    assert!(found.to_uppercase().contains(&part), "{found} is not {part}");
    let error = Gpu::named("Voodoo 2").unwrap_err().to_string();
    assert!(
        error.contains("`Voodoo 2`; there are: ") && error.to_uppercase().contains(&part),
        "{error}"
    );
}
