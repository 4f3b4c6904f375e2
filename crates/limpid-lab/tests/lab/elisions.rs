//! Elisions: work that a frame does not need is skipped without changing a bit of the picture.

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::{Gpu, PassTime};
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splats, classify};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Light, Scene};
use limpid_lab::report::elisions::{Case, Frame, cases, draw};

use crate::support::frames::{gpu, noise_vector, on_axis, sphere};

const SIZE: UVec2 = UVec2::new(160, 120);

/// A drop of 200 particles with some spray over a lit floor under a sun.
fn tank() -> Frame {
    let mut seed = 9;
    let reach = |i| if i < 170 { Vec3::new(0.3, 0.2, 0.3) } else { Vec3::splat(0.8) };
    let positions = (0..200).map(|i| reach(i) * noise_vector(&mut seed)).collect();
    let particles = Particles { positions, ..Default::default() };
    let mut scene = Scene::around(DVec3::splat(-0.8), DVec3::splat(0.8), 0.06);
    let direction = Vec3::new(0.3, -1.0, 0.2);
    scene.lights = vec![Light::Sun { direction, irradiance: Vec3::ONE }];
    scene.solids.iter_mut().for_each(|solid| solid.lit = true);
    scene.settings.caustics.resolution = 64;
    scene.settings.caustics.grid = 64;
    let camera = Camera { eye: DVec3::new(0.7, 1.2, 2.4), ..on_axis(0.0, 40.0) };
    let splats = classify(&particles, 0.06, &scene.settings.classify);
    assert!(splats.splashes.len() > 10 && splats.aggregates.len() > 100);
    Frame { scene, camera, splats }
}

fn has(times: &[PassTime], name: &str) -> bool {
    times.iter().any(|time| time.name == name)
}

/// Each elision in its own case: the skipped passes do not run, they do run if something needs
/// them, and both pictures are bit-identical.
#[test]
fn elisions_do_not_change_pictures() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = Renderer::new(&gpu);
    let cases = cases(&tank());
    assert_eq!(cases.len(), 10);
    let mut differing = Vec::new();
    for case in &cases {
        let Case { name, left_out, .. } = case;
        let [(elided, short), (forced, long)] =
            draw(&gpu, &mut renderer, case, SIZE, true).expect(name);
        let off = elided.pixels().zip(forced.pixels()).filter(|(a, b)| a != b).count();
        println!("{name}: {off} pixels differ, {} and {} passes", short.len(), long.len());
        if off > 0 {
            differing.push((name, off));
        }
        // The picture is not uniform.
        assert!(elided.pixels().filter(|&pixel| pixel != elided.get_pixel(0, 0)).count() > 1000);
        // Without timestamps there are no pass names.
        for pass in left_out.iter().filter(|_| !long.is_empty()) {
            assert!(has(&long, pass) && !has(&short, pass), "{name}: {pass}");
        }
    }
    assert!(differing.is_empty(), "{differing:?}");
}

/// The comparison of the cases detects pictures that do differ.
#[test]
fn differing_pictures_are_detected() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = Renderer::new(&gpu);
    let mut case = cases(&tank()).remove(2);
    case.forced.scene.liquid.absorption = Vec3::ONE;
    let [(elided, _), (forced, _)] = draw(&gpu, &mut renderer, &case, SIZE, false).expect("drawn");
    assert_ne!(elided, forced);
}

/// Rays that start in liquid leave it by a back layer, which must exist even if only one interface
/// is traced. A diagnosed frame always has its back layers.
#[test]
fn backs_exist_for_an_eye_in_liquid() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = Renderer::new(&gpu);
    let Frame { mut scene, camera, .. } = tank();
    scene.lights.clear();
    scene.settings.refract.interfaces = 1;
    let target = Picture::new(&gpu, SIZE).expect("a picture");
    for distance in [0.0, 0.15, 0.19, 0.21, 0.25, 0.4] {
        let ahead = distance * (camera.target - camera.eye).normalize();
        let eye = sphere((camera.eye + ahead).as_vec3(), 0.2);
        let splats = Splats { aggregates: vec![eye], radius: 0.1, ..Default::default() };
        let mut picture = |diagnose: bool| {
            let input = FrameInput::new(&scene, &camera, &splats, SIZE);
            let input = FrameInput { diagnose, reuse: true, ..input };
            renderer.render(input, &target).expect("drawn");
            target.read(&gpu).expect("read")
        };
        assert!(picture(true) == picture(false), "eye {distance} m from the centre of a drop");
    }
}

/// Reuse between frames: after a change of any input a frame is bit-identical to that of a renderer
/// without history, and passes that do not depend on the change do not run.
#[test]
fn changed_inputs_rerun_their_passes() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = Renderer::new(&gpu);
    type Change = (&'static str, fn(&mut Frame), &'static [&'static str]);
    const ALL: &[&str] = &["light splat", "caustics", "splat", "smooth", "refract", "tonemap"];
    const EYE: &[&str] = &["splat", "smooth", "refract", "tonemap"];
    const LIGHT: &[&str] = &["light splat", "caustics", "refract", "tonemap"];
    const RAYS: &[&str] = &["refract", "tonemap"];
    let changes: [Change; 19] = [
        ("nothing", |_| (), &["tonemap"]),
        ("exposure", |f| f.scene.settings.tonemap.exposure = -0.5, &["tonemap"]),
        ("samples", |f| f.scene.settings.refract.samples = 2, RAYS),
        ("environment", |f| f.scene.environment = Default::default(), RAYS),
        ("eye", |f| f.camera.eye.x += 0.1, EYE),
        ("field of view", |f| f.camera.fov_y = 42.0, EYE),
        ("a light", |f| f.scene.lights[0] = sun(Vec3::new(0.1, -1.0, 0.3)), LIGHT),
        ("a solid's colour", |f| f.scene.solids[0].surface = red(), LIGHT),
        ("index", |f| f.scene.liquid.ior = 1.2, LIGHT),
        ("absorption", |f| f.scene.liquid.absorption = Vec3::new(0.0, 3.0, 1.0), LIGHT),
        ("reach", |f| f.scene.settings.refract.reach = 0.3, LIGHT),
        ("caustics", |f| f.scene.settings.caustics.margin = 0.3, LIGHT),
        ("smoothing", |f| f.scene.settings.smooth.iterations = 2, ALL),
        ("one particle", |f| f.splats.aggregates[7].centre[1] += 0.05, ALL),
        ("one splash", |f| f.splats.splashes[3].centre[0] += 0.05, ALL),
        ("one fewer", |f| f.splats.aggregates.truncate(100), ALL),
        ("no splashes", |f| f.splats.splashes.clear(), ALL),
        ("no smoothing", |f| f.scene.settings.smooth.iterations = 0, ALL),
        ("no light", |f| f.scene.lights.clear(), RAYS),
    ];
    let target = Picture::new(&gpu, SIZE).expect("a picture");
    let render = |renderer: &mut Renderer, Frame { scene, camera, splats }: &Frame| {
        let input = FrameInput::new(scene, camera, splats, SIZE);
        let times = renderer.render(FrameInput { timing: true, reuse: true, ..input }, &target);
        (times.expect("drawn"), target.read(&gpu).expect("read"))
    };
    let mut frame = tank();
    render(&mut renderer, &frame);
    let mut last = None;
    for (what, change, drawn) in changes {
        change(&mut frame);
        let (times, picture) = render(&mut renderer, &frame);
        renderer.forget();
        assert!(render(&mut renderer, &frame).1 == picture, "{what}");
        assert!(what == "nothing" || last.as_ref() != Some(&picture), "{what}: no change");
        last = Some(picture);
        for name in ALL.iter().filter(|_| !times.is_empty()) {
            let expected = drawn.contains(name);
            assert_eq!(has(&times, name), expected, "{what}: {name}");
        }
    }
}

/// A caller who takes the radiance of each picture keeps the caustic maps and the layers.
#[test]
fn a_radiance_that_was_taken_is_drawn_anew_from_the_same_layers() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = Renderer::new(&gpu);
    let target = Picture::new(&gpu, SIZE).expect("a picture");
    let mut frame = tank();
    let mut draw = |Frame { scene, camera, splats }: &Frame| {
        let input = FrameInput::new(scene, camera, splats, SIZE);
        let times = renderer.render(FrameInput { timing: true, reuse: true, ..input }, &target);
        let spare = renderer.take_radiance(None);
        drop(spare);
        (times.expect("drawn"), target.read(&gpu).expect("read"))
    };
    let (_, first) = draw(&frame);
    let (times, again) = draw(&frame);
    assert!(first == again);
    for name in ["caustics", "splat", "refract"].iter().filter(|_| !times.is_empty()) {
        assert_eq!(has(&times, name), *name == "refract", "{name}");
    }
    frame.camera.eye.x += 0.1;
    let (times, moved) = draw(&frame);
    assert!(moved != again);
    for name in ["caustics", "splat", "refract"].iter().filter(|_| !times.is_empty()) {
        assert_eq!(has(&times, name), *name != "caustics", "{name}");
    }
}

/// A frame that fails leaves nothing behind that the next frame would reuse.
#[test]
fn failed_frames_are_not_reused() {
    let Some(gpu) = limited() else { return };
    let mut renderer = Renderer::new(&gpu);
    let frame = tank();
    let mut broken = frame.clone();
    broken.splats.aggregates.truncate(50);
    broken.scene.settings.caustics.resolution = 8192;
    broken.scene.settings.caustics.grid = 8192;
    let target = Picture::new(&gpu, SIZE).expect("a picture");
    let mut render = |Frame { scene, camera, splats }: &Frame| {
        let input = FrameInput::new(scene, camera, splats, SIZE);
        renderer.render(FrameInput { reuse: true, ..input }, &target)?;
        target.read(&gpu)
    };
    let expected = render(&frame).expect("drawn");
    let mut fewer = frame.clone();
    fewer.splats.aggregates.truncate(60);
    assert!(render(&broken).is_err(), "no buffer of the device holds the grid");
    let after = render(&frame).expect("drawn");
    assert!(after == expected);
    assert!(render(&fewer).expect("drawn") != expected);
}

/// A device of the adapter with buffers of 16 MiB at most.
fn limited() -> Option<Gpu> {
    let adapter_info = gpu()?.device.adapter_info();
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let adapters = wgpu::Instance::new(descriptor).enumerate_adapters(adapter_info.backend.into());
    let adapter = pollster::block_on(adapters).into_iter().find(|a| a.get_info() == adapter_info);
    let adapter = adapter.expect("the adapter of the other device");
    let required_limits = wgpu::Limits {
        max_buffer_size: 16 << 20,
        max_storage_buffer_binding_size: 16 << 20,
        max_uniform_buffer_binding_size: 64 << 10,
        ..wgpu::Limits::default()
    };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let opened = pollster::block_on(adapter.request_device(&descriptor));
    let (device, queue) = opened.expect("less than the adapter has");
    Some(Gpu::from_device(device, queue))
}

fn sun(direction: Vec3) -> Light {
    Light::Sun { direction, irradiance: Vec3::splat(2.0) }
}

fn red() -> limpid::scene::Surface {
    limpid::scene::Surface::Color(Vec3::X)
}
