//! Failures of the device: a device lost before, between and during frames, exhausted memory, and
//! pictures beyond the adapter's limits end in an error that names the cause, never in a panic or a
//! wrong picture, and another device draws the same.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use glam::{UVec2, Vec3};
use image::RgbImage;
use limpid::Error;
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::gpu::{Gpu, MOST_WORK, pieces};
use limpid::liquid::classify::Splats;
use limpid::offscreen::Offscreen;
use limpid::offscreen::Picture;
use limpid::passes::caustics::Work;
use limpid::passes::tiles::Sections;
use limpid::passes::{refract, smooth};
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::settings::{Caustics, Refract, Smooth, Solver};
use limpid::wgpu;
use limpid_io::error::Category;
use limpid_io::input::{FrameTime, Input, Loaded};
use limpid_io::project::Project;
use limpid_io::project::overrides::replaced;

use crate::support::noop::noop;

const SIZE: UVec2 = UVec2::new(160, 120);

/// A scene with a solid, a light and its caustic map.
const SCENE: &str = r#"
[recipe]
kind = "slab"
min = [-0.6, 0.3, -0.45]
max = [0.6, 0.7, 0.45]
count = 500

[liquid]
absorption = [1.2, 0.35, 0.12]

[camera]
eye = [1.3, 1.65, 2.3]
target = [0.0, 0.40, 0.0]
fov_y = 34.0

[[solid]]
shape = "plane"
origin = [0.0, 0.0, 0.0]
half_extent = 20.0
color = [0.8, 0.8, 0.7]
lit = true

[[light]]
sun = { direction = [-0.6, -1.0, 0.25], irradiance = [3.0, 2.85, 2.6] }

[settings.caustics]
method = "forward"
resolution = 64
grid = 32
"#;

/// The scene, its camera, and its particles.
fn frame() -> (Scene, Camera, Loaded) {
    let project = Project::parse(SCENE, "slab", Path::new("")).expect("a scene");
    let input = Input::from_project(project, "slab").expect("particles");
    let (input, project) = input.resolve().expect("it resolves");
    let loaded = input.load(FrameTime::at(0), &project.scene).expect("it loads");
    (project.scene, project.camera.expect("it is resolved"), loaded)
}

fn draw(offscreen: &mut Offscreen, size: UVec2) -> limpid::Result<RgbImage> {
    let (scene, camera, loaded) = frame();
    let input = FrameInput::new(&scene, &camera, &loaded.splats, size);
    offscreen.draw(input).map(|drawn| drawn.picture)
}

/// The picture drawn by a new device.
fn expected() -> RgbImage {
    let gpu = Gpu::headless().expect("an adapter");
    draw(&mut Offscreen::new(&gpu), SIZE).expect("a picture")
}

#[track_caller]
fn is_lost<T: std::fmt::Debug>(outcome: limpid::Result<T>, reason: &str) {
    let error = outcome.expect_err("the device is lost");
    assert!(
        matches!(error, Error::DeviceLost(_)) && Category::from(&error) as u8 == 6,
        "{error:?}"
    );
    assert!(error.to_string().contains(reason), "{error}");
}

/// On a lost device every creation of pipelines, textures, buffers and commands and every readback
/// returns the error, repeatedly, and a new device draws.
#[test]
fn device_lost_before_the_first_frame() {
    let gpu = Gpu::headless().expect("an adapter");
    gpu.device.destroy();
    let mut offscreen = Offscreen::new(&gpu);
    let (scene, camera, loaded) = frame();
    for diagnose in [false, true] {
        let input = FrameInput::new(&scene, &camera, &loaded.splats, SIZE);
        let input = FrameInput { diagnose, timing: diagnose, ..input };
        is_lost(offscreen.draw(input).map(|drawn| drawn.picture), "destroyed");
        is_lost(offscreen.images(&[Aov::Depth, Aov::Radiance]), "destroyed");
    }
    is_lost(gpu.check(), "destroyed");
    assert_eq!(
        draw(&mut Offscreen::new(&Gpu::headless().expect("an adapter")), SIZE).unwrap(),
        expected()
    );
}

/// After a loss the previous picture is not returned again, at the same size or at another, and a new
/// device draws the same bits.
#[test]
fn device_lost_between_frames() {
    let gpu = Gpu::headless().expect("an adapter");
    let mut offscreen = Offscreen::new(&gpu);
    let before = draw(&mut offscreen, SIZE).expect("a picture");
    gpu.device.destroy();
    is_lost(draw(&mut offscreen, SIZE), "destroyed");
    is_lost(draw(&mut offscreen, 2 * SIZE), "destroyed");
    assert_eq!(before, expected());
}

/// A device lost between a frame's commands and the readback of its picture returns the error.
#[test]
fn device_lost_before_the_picture_is_read() {
    let gpu = Gpu::headless().expect("an adapter");
    let (scene, camera, loaded) = frame();
    let mut renderer = Renderer::new(&gpu);
    let picture = Picture::new(&gpu, SIZE).expect("the size is allowed");
    let input = FrameInput::new(&scene, &camera, &loaded.splats, SIZE);
    renderer.render(input, &picture).expect("it is drawn");
    gpu.device.destroy();
    is_lost(picture.read(&gpu), "destroyed");
}

/// A loss at any time during a frame gives the right picture or the error.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn device_lost_in_the_middle_of_a_frame() {
    let expected = expected();
    let mut lost = 0;
    for pause in 0..4 {
        let gpu = Gpu::headless().expect("an adapter");
        let mut offscreen = Offscreen::new(&gpu);
        assert_eq!(draw(&mut offscreen, SIZE).expect("a picture"), expected);
        let (started, device) = (Arc::new(AtomicBool::new(false)), gpu.device.clone());
        let may_start = started.clone();
        let destroyer = std::thread::spawn(move || {
            while !may_start.load(Ordering::Acquire) {
                std::hint::spin_loop();
            }
            std::thread::sleep(std::time::Duration::from_millis(3 * pause));
            device.destroy();
        });
        started.store(true, Ordering::Release);
        while lost <= pause {
            match draw(&mut offscreen, SIZE) {
                Ok(picture) => assert_eq!(picture, expected),
                Err(error) => {
                    is_lost(Err::<(), _>(error), "destroyed");
                    lost += 1;
                }
            }
        }
        destroyer.join().expect("no panic");
    }
}

/// After memory has run out, here by a texture of 4 TiB, every frame returns an error that names the
/// resource, with its exit code.
#[test]
fn exhausted_memory_is_an_error() {
    let gpu = Gpu::headless().expect("an adapter");
    let mut offscreen = Offscreen::new(&gpu);
    draw(&mut offscreen, SIZE).expect("a picture");
    let limits = gpu.device.limits();
    let edge = limits.max_texture_dimension_2d.min(16384);
    let _ = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("absurd"),
        size: wgpu::Extent3d {
            width: edge,
            height: edge,
            depth_or_array_layers: limits.max_texture_array_layers.min(1024),
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    is_lost(gpu.check(), "emory");
    is_lost(draw(&mut offscreen, SIZE), "absurd");
    assert_eq!(
        draw(&mut Offscreen::new(&Gpu::headless().expect("an adapter")), SIZE).unwrap(),
        expected()
    );
}

/// Commands that validation refuses, a defect of limpid, are an error too, neither a panic nor a loss
/// that may be retried.
#[test]
fn refused_commands_are_a_defect() {
    let gpu = Gpu::headless().expect("an adapter");
    let _ = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("planted"),
        size: 16,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    for outcome in [gpu.check(), draw(&mut Offscreen::new(&gpu), SIZE).map(|_| ())] {
        let error = outcome.expect_err("it is refused");
        assert!(matches!(&error, Error::Defect(text) if text.contains("planted")), "{error:?}");
        assert_eq!(Category::from(&error) as u8, 1);
    }
}

/// A no-op device with lower limits, and its list of validation errors.
fn limited(lower: impl Fn(&mut wgpu::Limits)) -> (Gpu, Arc<Mutex<Vec<String>>>) {
    let mut required_limits = wgpu::Limits::default();
    lower(&mut required_limits);
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = noop(&descriptor);
    let errors = Arc::<Mutex<Vec<String>>>::default();
    let seen = errors.clone();
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        seen.lock().expect("no panic holds this lock").push(error.to_string());
    }));
    (Gpu::from_device(device, queue), errors)
}

/// With each limit lowered, a picture of any size is drawn without a validation error, or refused with
/// the limit's name and a remedy.
#[test]
fn pictures_beyond_a_limit_are_refused() {
    type Lower = fn(&mut wgpu::Limits);
    let adapters: [(&str, Lower); 5] = [
        ("max_texture_dimension_2d", |limits| limits.max_texture_dimension_2d = 256),
        ("max_buffer_size", |limits| limits.max_buffer_size = 1 << 20),
        ("max_storage_buffer_binding_size", |limits| {
            limits.max_storage_buffer_binding_size = 8192;
        }),
        ("max_compute_workgroups_per_dimension", |limits| {
            limits.max_compute_workgroups_per_dimension = 1000;
        }),
        ("", |_| ()),
    ];
    let sizes = [(1, 1), (17, 250), (256, 256), (257, 1), (1, 300), (640, 480), (1000, 70)];
    let (mut scene, camera, loaded) = frame();
    scene.settings.caustics.resolution = 16;
    scene.settings.caustics.grid = 8;
    for (limit, lower) in adapters {
        let (gpu, errors) = limited(lower);
        let mut offscreen = Offscreen::new(&gpu);
        let mut refused = 0;
        for (width, height) in sizes {
            let size = UVec2::new(width, height);
            let input = FrameInput::new(&scene, &camera, &loaded.splats, size);
            let drawn = offscreen.draw(FrameInput { diagnose: true, ..input });
            let read = drawn.and_then(|_| offscreen.images(&Aov::ALL));
            if let Err(error) = read {
                let text = error.to_string();
                assert!(text.contains(limit) && text.contains("smaller picture"), "{text}");
                assert_eq!(Category::from(&error) as u8, 5, "{text}");
                refused += 1;
            }
            let errors = std::mem::take(&mut *errors.lock().expect("no panic holds this lock"));
            assert_eq!(errors, [""; 0], "{limit}: {size}");
        }
        let expected = if limit.is_empty() { 0..=0 } else { 1..=sizes.len() - 1 };
        assert!(expected.contains(&refused), "{limit}: {refused} refused");
    }
}

/// Caustic maps, their grids and environment maps beyond a limit are refused likewise.
#[test]
fn maps_beyond_a_limit_are_refused() {
    let (gpu, errors) = limited(|limits| {
        limits.max_texture_dimension_2d = 512;
        limits.max_storage_buffer_binding_size = 1 << 20;
    });
    let mut offscreen = Offscreen::new(&gpu);
    type Change = (&'static str, fn(&mut Scene));
    let changes: [Change; 5] = [
        ("caustics.resolution", |s| s.settings.caustics.resolution = 8192),
        ("caustics.resolution", |s| s.settings.caustics.resolution = 500),
        ("caustics.grid", |s| s.settings.caustics.grid = 4096),
        ("environment map", |s| {
            let size = UVec2::new(1024, 2);
            s.environment = Environment::Map { size, pixels: vec![[1.0; 4]; 2048].into() };
        }),
        ("", |_| ()),
    ];
    for (remedy, change) in changes {
        let (mut scene, camera, loaded) = frame();
        change(&mut scene);
        match offscreen.draw(FrameInput::new(&scene, &camera, &loaded.splats, SIZE)) {
            Ok(_) => assert_eq!(remedy, "", "it is not refused"),
            Err(error) => {
                assert!(!remedy.is_empty() && error.to_string().contains(remedy), "{error}");
                assert_eq!(Category::from(&error) as u8, 5);
            }
        }
        let errors = std::mem::take(&mut *errors.lock().expect("no panic holds this lock"));
        assert_eq!(errors, [""; 0], "{remedy}");
    }
}

/// More particles than fit one binding of the adapter are drawn in several parts.
#[test]
fn particles_are_drawn_in_parts_that_fit() {
    let (gpu, errors) = limited(|limits| limits.max_storage_buffer_binding_size = 65536);
    let mut offscreen = Offscreen::new(&gpu);
    let (mut scene, camera, loaded) = frame();
    scene.lights.clear();
    scene.liquid.absorption = Vec3::ZERO;
    let one = loaded.splats.aggregates[0];
    for count in [0, 1, 1365, 1366, 5000, 100, 20_000] {
        let splats = Splats {
            aggregates: vec![one; count],
            splashes: vec![one; count / 2],
            ..loaded.splats.clone()
        };
        let input = FrameInput::new(&scene, &camera, &splats, UVec2::new(32, 24));
        offscreen.draw(input).expect("it is drawn");
        let errors = std::mem::take(&mut *errors.lock().expect("no panic holds this lock"));
        assert_eq!(errors, [""; 0], "{count} particles");
    }
}

/// Device memory per pixel is as documented in `docs/devices.md`: for a plain picture, with splashes,
/// and with the intermediate images. Skipped if the device does not report its allocations.
#[test]
fn memory_per_pixel_is_as_documented() {
    let (mut scene, camera, loaded) = frame();
    (scene.lights, scene.solids) = (Vec::new(), Vec::new());
    for (splash, diagnose, documented) in
        [(false, false, 223.0), (true, false, 291.0), (false, true, 271.0)]
    {
        let mut splats = loaded.splats.clone();
        if splash {
            splats.splashes = splats.aggregates.split_off(splats.aggregates.len() / 2);
        }
        let allocated = |size: UVec2| {
            let gpu = Gpu::headless().expect("an adapter");
            let mut offscreen = Offscreen::new(&gpu);
            let input = FrameInput::new(&scene, &camera, &splats, size);
            offscreen.draw(FrameInput { diagnose, ..input }).expect("it is drawn");
            gpu.check().expect("the device is there");
            Some(gpu.device.generate_allocator_report()?.total_allocated_bytes as f64)
        };
        let (small, large) = (UVec2::splat(256), UVec2::splat(640));
        let (Some(less), Some(more)) = (allocated(small), allocated(large)) else { return };
        let pixels = f64::from(large.element_product() - small.element_product());
        let bytes = (more - less) / pixels;
        println!("{bytes:.1} bytes per pixel");
        assert!((bytes / documented - 1.0).abs() < 0.03, "{bytes}, not {documented}");
    }
}

/// Views of lights share the textures in which they are drawn: a further sun takes its maps alone. Skipped if the device
/// does not report its allocations.
#[test]
fn further_lights_share_their_textures() {
    let (mut scene, camera, loaded) = frame();
    scene.settings.caustics.resolution = 512;
    let light = scene.lights[0];
    let mut allocated = |suns: usize| {
        scene.lights = vec![light; suns];
        let gpu = Gpu::headless().expect("an adapter");
        let mut offscreen = Offscreen::new(&gpu);
        let input = FrameInput::new(&scene, &camera, &loaded.splats, SIZE);
        offscreen.draw(input).expect("it is drawn");
        gpu.check().expect("the device is there");
        Some(gpu.device.generate_allocator_report()?.total_allocated_bytes as f64)
    };
    let (Some(none), Some(one), Some(three)) = (allocated(0), allocated(1), allocated(3)) else {
        return;
    };
    let [first, further] = [one - none, (three - one) / 2.0].map(|bytes| bytes / 512f64.powi(2));
    println!("{first:.1} bytes per texel for the first light, {further:.1} for a further one");
    // Two views, each with 32 bytes of maps, but one's own textures are at least 200.
    assert!(first > 250.0 && further < 0.5 * first, "{first}, {further}");
}

/// Without enough memory, `render` ends with the exit code of a retryable error, without a panic and
/// without a picture.
#[test]
#[cfg(target_os = "linux")]
fn render_without_enough_memory_is_retryable() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = format!(
        "ulimit -v 3000000; exec {} render --size 4000x4000 -o a.png",
        env!("CARGO_BIN_EXE_limpid")
    );
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path())
        .output()
        .expect("there is a shell");
    let stderr = String::from_utf8_lossy(&output.stderr);
    let drawn = folder.path().join("a.png").exists();
    match output.status.code() {
        // A GPU's memory may not count towards the limit, or its driver may not start below it.
        Some(0) => assert!(drawn),
        Some(5 | 6) => assert!(!drawn && !stderr.contains("panicked"), "{stderr}"),
        code => panic!("{code:?}: {stderr}"),
    }
}

/// A frame divided into many submissions, so that none exceeds a driver's timeout, is bit-identical to
/// the undivided frame, for every expensive method.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn divided_frames_are_identical() {
    let gpu = Gpu::headless().expect("an adapter");
    let mut renderers =
        [gpu.clone(), gpu.clone().with_most_work(1 << 17)].map(|gpu| Renderer::new(&gpu));
    let (scene, camera, loaded) = frame();
    let size = UVec2::new(64, 48);
    for set in [
        &["refract.solver=march", "refract.samples=2", "caustics.blur=0.1"][..],
        &["caustics.method=gather", "caustics.steps=4096"],
    ] {
        let set: Vec<String> = set.iter().map(|text| (*text).to_owned()).collect();
        let settings = replaced(&scene.settings, &set).expect("valid settings");
        let scene = Scene { settings, ..scene.clone() };
        let [whole, divided] = renderers.each_mut().map(|renderer| {
            let picture = Picture::new(&gpu, size).expect("a picture");
            let input = FrameInput::new(&scene, &camera, &loaded.splats, size);
            renderer.render(input, &picture).expect("the frame is drawn");
            let map = renderer.images().caustics.remove(0).expect("a map");
            let (light, _) = map.read(&gpu).expect("the map is read");
            let bits: Vec<_> = light.iter().map(|texel| texel.map(f32::to_bits)).collect();
            (picture.read(&gpu).expect("the picture is read"), bits, renderer.submissions())
        });
        assert!(whole.2 <= 2 && divided.2 > 20, "{} and {} submissions", whole.2, divided.2);
        assert!(whole.0 == divided.0, "{set:?}: the pictures differ");
        assert!(whole.1 == divided.1, "{set:?}: the maps differ");
        assert!(whole.1.iter().any(|texel| texel[0] != 0), "{set:?}: no light");
    }
}

/// With every setting at its maximum, no submission of a picture or a map of 8192 × 8192 pixels exceeds
/// the allowed work unless it is a single tile, and ordinary frames are not divided.
#[test]
fn submissions_are_bounded() {
    let size = UVec2::splat(8192);
    let kernels = |settings: &Caustics, size: UVec2, blur: f32, solids: usize| {
        let Work { grid, trace, deposit, gather, resolve, blur } =
            Work::new(settings, size, blur, solids);
        [grid, trace, deposit, gather, resolve, blur]
    };
    let extreme = Caustics { steps: 4096, subdivide: 8, ..Caustics::default() };
    for each in kernels(&extreme, size, 1e9, 512) {
        for extent in [size, size + 1, UVec2::new(8192, 3), UVec2::new(3, 8192)] {
            let pieces = pieces(extent, each, MOST_WORK);
            let threads = |size: UVec2| u64::from(size.x) * u64::from(size.y);
            let all: u64 = pieces.iter().map(|piece| threads(piece.size)).sum();
            assert_eq!(all, threads(extent), "{extent} by {each}");
            for piece in &pieces {
                assert!(threads(piece.size) * each <= MOST_WORK, "{piece:?} by {each}");
                assert_eq!(piece.first % 8, UVec2::ZERO, "{piece:?}: workgroups are whole");
                assert!((piece.first + piece.size).cmple(extent).all(), "{piece:?} of {extent}");
            }
        }
    }
    assert!(kernels(&extreme, size, 1e9, 512).iter().all(|each| each * (1 << 26) > MOST_WORK / 4));
    let usual = UVec2::splat(512);
    for each in kernels(&Caustics::default(), usual, 5.0, 8) {
        assert_eq!(pieces(usual, each, MOST_WORK).len(), 1);
    }

    let samples = 64;
    let extreme = Refract {
        solver: Solver::March,
        interfaces: 8,
        internal_bounces: 8,
        samples,
        edge_samples: samples,
        ..Refract::default()
    };
    let filter = Smooth { taps: 33, ..Smooth::default() };
    let one = |solids, lights| refract::work(&extreme, size, solids, lights);
    for each in [one(512, 16), one(8, 1), smooth::work(&filter), smooth::work(&Smooth::default())] {
        for alignment in [4, 16, 256] {
            let sections = Sections::new(size, each, MOST_WORK, alignment, 1 << 31);
            let (tiles, count) = (u64::from(sections.tiles), u64::from(sections.count));
            assert!(tiles * count >= 1 << 20 && tiles * (count - 1) < 1 << 20, "{sections:?}");
            assert!(tiles * 64 * each <= MOST_WORK.max(64 * each), "{sections:?} by {each}");
            assert!(64 * each <= 2 * MOST_WORK, "{each} for a pixel");
            assert!(
                sections.words > sections.tiles && (4 * sections.words).is_multiple_of(alignment)
            );
        }
    }
    let usual = UVec2::new(1920, 1080);
    let each = refract::work(&Refract::default(), usual, 8, 1);
    assert_eq!(Sections::new(usual, each, MOST_WORK, 256, 1 << 27).count, 1);
}
