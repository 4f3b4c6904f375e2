//! What fails on the way to a picture ends in an error that says what: a device that is lost before,
//! between and during frames, memory that runs out, pictures that the adapter cannot hold. Never in
//! a panic, never in a picture that is none; and another device goes on.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use glam::{UVec2, Vec3};
use image::RgbImage;
use limpid::Error;
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid::environment::Environment;
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

const SIZE: UVec2 = UVec2::new(160, 120);

/// A frame with all that a frame may have: solids, a light and its caustic map.
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

/// A scene, the camera that it names, and its particles.
fn frame() -> (Scene, Camera, Loaded) {
    let project = Project::parse(SCENE, "slab", Path::new("")).expect("a scene");
    let input = Input::from_project(project, "slab").expect("particles");
    let (input, project) = input.resolve().expect("it settles");
    let loaded = input.load(FrameTime::at(0), &project.scene).expect("it loads");
    (project.scene, project.camera.expect("it is settled"), loaded)
}

fn draw(studio: &mut Offscreen, size: UVec2) -> limpid::Result<RgbImage> {
    let (scene, camera, loaded) = frame();
    studio.draw(&scene, &camera, &loaded.splats, size).map(|shot| shot.picture)
}

/// What a new device draws.
fn right() -> RgbImage {
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

/// Protects every beginning on a device that is gone: pipelines, textures, buffers, commands and
/// reading back end in the error, again and again, and a new device draws.
#[test]
fn device_lost_before_the_first_frame() {
    let gpu = Gpu::headless().expect("an adapter");
    gpu.device.destroy();
    let mut studio = Offscreen::new(&gpu);
    for diagnose in [false, true] {
        studio.renderer.diagnose = diagnose;
        studio.renderer.timing = diagnose;
        is_lost(draw(&mut studio, SIZE), "destroyed");
        is_lost(studio.images(&[Aov::Depth, Aov::Radiance]), "destroyed");
    }
    is_lost(gpu.check(), "destroyed");
    assert_eq!(
        draw(&mut Offscreen::new(&Gpu::headless().expect("an adapter")), SIZE).unwrap(),
        right()
    );
}

/// Protects the frame after a loss: what was drawn before is not shown again as if it were new, at
/// the same size and at another; and a new device draws the same bits as the old one did.
#[test]
fn device_lost_between_frames() {
    let gpu = Gpu::headless().expect("an adapter");
    let mut studio = Offscreen::new(&gpu);
    let before = draw(&mut studio, SIZE).expect("a picture");
    gpu.device.destroy();
    is_lost(draw(&mut studio, SIZE), "destroyed");
    is_lost(draw(&mut studio, 2 * SIZE), "destroyed");
    assert_eq!(before, right());
}

/// Protects a frame whose device is lost between its commands and its picture.
#[test]
fn device_lost_before_the_picture_is_read() {
    let gpu = Gpu::headless().expect("an adapter");
    let (scene, camera, loaded) = frame();
    let mut renderer = Renderer::new(&gpu);
    let picture = Picture::new(&gpu, SIZE).expect("the size is allowed");
    let drawn =
        renderer.render(&scene, &camera, &loaded.splats, &picture.view(), Picture::FORMAT, SIZE);
    drawn.expect("it is drawn");
    gpu.device.destroy();
    is_lost(picture.read(&gpu), "destroyed");
}

/// Protects frames from a loss at whatever moment: each ends in the right picture or in the error.
#[test]
fn device_lost_in_the_middle_of_a_frame() {
    let right = right();
    let mut lost = 0;
    for pause in 0..4 {
        let gpu = Gpu::headless().expect("an adapter");
        let mut studio = Offscreen::new(&gpu);
        assert_eq!(draw(&mut studio, SIZE).expect("a picture"), right);
        let (started, device) = (Arc::new(AtomicBool::new(false)), gpu.device.clone());
        let begun = started.clone();
        let other = std::thread::spawn(move || {
            while !begun.load(Ordering::Acquire) {
                std::hint::spin_loop();
            }
            std::thread::sleep(std::time::Duration::from_millis(3 * pause));
            device.destroy();
        });
        started.store(true, Ordering::Release);
        while lost <= pause {
            match draw(&mut studio, SIZE) {
                Ok(picture) => assert_eq!(picture, right),
                Err(error) => {
                    is_lost(Err::<(), _>(error), "destroyed");
                    lost += 1;
                }
            }
        }
        other.join().expect("no panic");
    }
}

/// Protects frames after memory ran out: an error with its exit code and what it was for, and no
/// picture from what is left. A texture of 4 TiB fits nowhere.
#[test]
fn memory_that_runs_out_is_an_error() {
    let gpu = Gpu::headless().expect("an adapter");
    let mut studio = Offscreen::new(&gpu);
    draw(&mut studio, SIZE).expect("a picture");
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
    is_lost(draw(&mut studio, SIZE), "absurd");
    assert_eq!(
        draw(&mut Offscreen::new(&Gpu::headless().expect("an adapter")), SIZE).unwrap(),
        right()
    );
}

/// Protects callers from a defect of ours: commands that validation refuses are an error too, not a
/// panic, and not a loss that one might try again.
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

/// A no-op device with lower limits, and what its validation says.
fn limited(lower: impl Fn(&mut wgpu::Limits)) -> (Gpu, Arc<Mutex<Vec<String>>>) {
    let mut required_limits = wgpu::Limits::default();
    lower(&mut required_limits);
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = wgpu::Device::noop(&descriptor);
    let errors = Arc::<Mutex<Vec<String>>>::default();
    let seen = errors.clone();
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        seen.lock().expect("no panic holds this lock").push(error.to_string());
    }));
    (Gpu::from_device(device, queue), errors)
}

/// Protects pictures of every size on adapters of every limit: each is drawn without a word of
/// validation, or refused with the limit's name and a remedy.
#[test]
fn what_does_not_fit_is_refused_by_its_limit() {
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
        let mut studio = Offscreen::new(&gpu);
        studio.renderer.diagnose = true;
        let mut refused = 0;
        for (width, height) in sizes {
            let size = UVec2::new(width, height);
            let drawn = studio.draw(&scene, &camera, &loaded.splats, size);
            let read = drawn.and_then(|_| studio.images(&Aov::ALL));
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

/// Protects the same for what is not the picture: caustic maps, their grids, environment maps.
#[test]
fn maps_that_do_not_fit_are_refused() {
    let (gpu, errors) = limited(|limits| {
        limits.max_texture_dimension_2d = 512;
        limits.max_storage_buffer_binding_size = 1 << 20;
    });
    let mut studio = Offscreen::new(&gpu);
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
        match studio.draw(&scene, &camera, &loaded.splats, SIZE) {
            Ok(_) => assert_eq!(remedy, "", "it should be refused"),
            Err(error) => {
                assert!(!remedy.is_empty() && error.to_string().contains(remedy), "{error}");
                assert_eq!(Category::from(&error) as u8, 5);
            }
        }
        let errors = std::mem::take(&mut *errors.lock().expect("no panic holds this lock"));
        assert_eq!(errors, [""; 0], "{remedy}");
    }
}

/// Protects frames of more particles than one binding of the adapter holds: they are drawn in
/// parts, whatever the number.
#[test]
fn particles_are_drawn_in_parts_that_fit() {
    let (gpu, errors) = limited(|limits| limits.max_storage_buffer_binding_size = 65536);
    let mut studio = Offscreen::new(&gpu);
    let (mut scene, camera, loaded) = frame();
    scene.lights.clear();
    scene.liquid.absorption = Vec3::ZERO;
    let one = loaded.splats.aggregates[0];
    for count in [0, 1, 1365, 1366, 5000, 100, 20_000] {
        let splats = Splats {
            aggregates: vec![one; count],
            splashes: vec![one; count / 2],
            ..loaded.splats
        };
        studio.draw(&scene, &camera, &splats, UVec2::new(32, 24)).expect("it is drawn");
        let errors = std::mem::take(&mut *errors.lock().expect("no panic holds this lock"));
        assert_eq!(errors, [""; 0], "{count} particles");
    }
}

/// Protects the formula of `docs/devices.md`: bytes of device memory for each pixel of a picture,
/// bare, with splashes, and with the intermediate images. Where the device tells what it has given.
#[test]
fn picture_takes_the_memory_that_is_documented() {
    let (mut scene, camera, loaded) = frame();
    (scene.lights, scene.solids) = (Vec::new(), Vec::new());
    for (splash, diagnose, documented) in
        [(false, false, 156.0), (true, false, 192.0), (false, true, 204.0)]
    {
        let mut splats = loaded.splats.clone();
        if splash {
            splats.splashes = splats.aggregates.split_off(splats.aggregates.len() / 2);
        }
        let allocated = |size: UVec2| {
            let gpu = Gpu::headless().expect("an adapter");
            let mut studio = Offscreen::new(&gpu);
            studio.renderer.diagnose = diagnose;
            studio.draw(&scene, &camera, &splats, size).expect("it is drawn");
            gpu.check().expect("the device is there");
            Some(gpu.device.generate_allocator_report()?.total_allocated_bytes as f64)
        };
        let (small, large) = (UVec2::splat(256), UVec2::splat(640));
        let (Some(less), Some(more)) = (allocated(small), allocated(large)) else { return };
        let pixels = f64::from(large.element_product() - small.element_product());
        let bytes = (more - less) / pixels;
        println!("{bytes:.1} bytes per pixel");
        assert!((bytes / documented - 1.0).abs() < 0.03, "{bytes}, documented are {documented}");
    }
}

/// Protects farms from a machine with too little memory: `render` ends with an error that may be
/// tried again elsewhere, in one line, without a panic and without a picture.
#[test]
#[cfg(target_os = "linux")]
fn render_without_enough_memory_ends_in_its_exit_code() {
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
    let said = String::from_utf8_lossy(&output.stderr);
    let drawn = folder.path().join("a.png").exists();
    match output.status.code() {
        // A GPU may have memory that the limit does not count, or may not start below it.
        Some(0) => assert!(drawn),
        Some(5 | 6) => assert!(!drawn && !said.contains("panicked"), "{said}"),
        code => panic!("{code:?}: {said}"),
    }
}

/// Protects graphics cards that are reset when one piece of work takes too long: a frame in many
/// submissions is the frame in one, to the bit, by every method that walks far.
#[test]
fn divided_frames_are_the_same() {
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
            let (target, format) = (picture.view(), Picture::FORMAT);
            let drawn = renderer.render(&scene, &camera, &loaded.splats, &target, format, size);
            drawn.expect("the frame is drawn");
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

/// Protects the same cards: with every setting at its end, no submission of a picture or a map of 8192 pixels a
/// side has more work than is allowed, or it is a single tile; and ordinary frames are not divided.
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
