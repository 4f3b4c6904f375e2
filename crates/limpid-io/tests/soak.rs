//! Soak test: many consecutive frames with changing particle counts, sizes and settings, as in a long
//! interactive session. A program of its own, since it measures the memory of the process.
//!
//! The default run is short. The full run:
//! `LIMPID_SOAK_FRAMES=2000 cargo test --release --test soak -- --nocapture`.

#[path = "../../../tests/support/mod.rs"]
mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::diffuse::Diffuse;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{self, Splats};
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid::wgpu;
use limpid_io::project::Project;
use support::{Random, gpu};

/// Number of kinds of frames. Sizes, counts, surroundings and settings have no common period, so that
/// each meets each.
const KINDS: usize = 60;

/// Numbers of kinds and cycles of a short run: a software adapter takes a second or two to compile each
/// pipeline.
const SHORT: (usize, usize) = (16, 6);

const SIZES: [[u32; 2]; 5] = [[96, 72], [64, 48], [33, 57], [128, 96], [80, 80]];

const COUNTS: [usize; 4] = [400, 0, 1500, 1];

/// Surroundings of the liquid.
const LOOKS: [&str; 3] = [
    "[environment]\nradiance = [0.5, 0.6, 0.8]\n",
    "[environment]\ngradient = { zenith = [0.2, 0.4, 0.9], horizon = [0.9, 0.9, 0.9], nadir = [0.3, 0.3, 0.3] }\n\
     [[solid]]\nshape = \"plane\"\norigin = [0.0, -0.6, 0.0]\nhalf_extent = 8.0\ncolor = [0.5, 0.5, 0.4]\n",
    "[environment]\nradiance = [0.3, 0.3, 0.3]\n\
     [[solid]]\nshape = \"plane\"\norigin = [0.0, -0.6, 0.0]\nhalf_extent = 8.0\ncolor = [0.5, 0.5, 0.4]\nlit = true\n\
     [[solid]]\nshape = \"sphere\"\ncenter = [0.5, -0.3, 0.2]\nradius = 0.2\ncolor = [0.8, 0.2, 0.1]\n\
     [[light]]\nsun = { direction = [0.2, -1.0, 0.1], irradiance = [2.0, 2.0, 2.0] }\n",
];

const SETTINGS: [&[&str]; 7] = [
    &["caustics.resolution=128", "caustics.grid=128"],
    &["smooth.iterations=0", "refract.interfaces=1", "caustics.resolution=64", "caustics.grid=64"],
    &["smooth.filter=narrow-range", "caustics.resolution=64", "caustics.grid=64"],
    &[
        "refract.solver=march",
        "caustics.method=gather",
        "caustics.resolution=96",
        "caustics.grid=32",
    ],
    &["refract.samples=4", "caustics.method=straight", "caustics.resolution=128"],
    &[
        "smooth.filter=bilateral",
        "refract.solver=plane3",
        "refract.solids=screen",
        "caustics.resolution=128",
        "caustics.grid=64",
    ],
    &[
        "caustics.blur=0.02",
        "caustics.resolution=128",
        "caustics.grid=48",
        "classify.kernel=volume",
    ],
];

struct Kind {
    scene: Scene,
    camera: Camera,
    particles: Particles,
    size: UVec2,
    diagnose: bool,
    foam: Option<Arc<Diffuse>>,
}

fn kind(i: usize) -> Kind {
    kind_of(i, "absorption = [0.8, 0.3, 0.1]\n")
}

/// A kind whose liquid has these keys.
fn kind_of(i: usize, liquid: &str) -> Kind {
    let overrides: Vec<_> =
        SETTINGS[i % SETTINGS.len()].iter().map(|text| (*text).to_owned()).collect();
    let text = format!("[liquid]\n{liquid}{}", LOOKS[i % LOOKS.len()]);
    let mut project = Project::parse(&text, "soak", Path::new("")).expect("a scene");
    project.set(&overrides).expect("settings");
    let scene = project.scene;
    let mut random = Random(i as u64);
    let places: Vec<_> = (0..COUNTS[i % COUNTS.len()])
        .map(|_| DVec3::new(random.range(-0.5, 0.5), random.range(-0.6, 0.0), random.unit()))
        .collect();
    let camera = Camera {
        eye: DVec3::new(0.3, 0.8, 3.0),
        target: DVec3::new(0.0, -0.3, 0.4),
        up: Vec3::Y,
        fov_y: 40.0,
        near: None,
        lens: None,
    };
    let size = SIZES[i % SIZES.len()].into();
    let particles = Particles::from_places(&places);
    Kind { scene, camera, particles, size, diagnose: i.is_multiple_of(11), foam: None }
}

/// The kind with a sphere of foam above each particle.
fn under_foam(mut kind: Kind) -> Kind {
    let above = kind.particles.positions.iter().map(|&p| p + 0.1 * Vec3::Y).collect();
    kind.foam = Some(Arc::new(Diffuse::from_positions(above, 0.004)));
    kind
}

impl Kind {
    fn draw(&self, offscreen: &mut Offscreen) -> image::RgbImage {
        let splats = classify::classify(&self.particles, 0.04, &self.scene.settings.classify);
        let input = FrameInput::new(&self.scene, &self.camera, &splats, self.size);
        let input = FrameInput { diagnose: self.diagnose, diffuse: self.foam.as_ref(), ..input };
        offscreen.draw(input).expect("a frame").picture
    }
}

/// Resources in use at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Usage {
    /// Resident memory of the process, bytes; it includes that of a software adapter.
    process: f64,
    /// Memory allocated by wgpu from the adapter, bytes.
    adapter: f64,
    /// Number of buffers, views, bind groups, pipelines and other objects that the device counts, except
    /// textures, whose destruction wgpu 30 counts twice.
    objects: f64,
}

impl Usage {
    fn now(gpu: &Gpu) -> Self {
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device is there");
        let hal = gpu.device.get_internal_counters().hal;
        let objects = [
            &hal.buffers,
            &hal.texture_views,
            &hal.bind_groups,
            &hal.bind_group_layouts,
            &hal.render_pipelines,
            &hal.compute_pipelines,
            &hal.shader_modules,
            &hal.query_sets,
            &hal.memory_allocations,
        ];
        let objects = objects.iter().map(|counter| counter.read() as f64).sum();
        let report = gpu.device.generate_allocator_report();
        let adapter = report.map_or(0.0, |report| report.total_allocated_bytes as f64);
        Self { process: resident().unwrap_or_default(), adapter, objects }
    }
}

/// Resident memory, bytes, where the system reports it.
fn resident() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(1024.0 * line.trim().strip_suffix(" kB")?.parse::<f64>().ok()?)
}

/// A lock for tests that draw, since the measured memory is that of the whole process.
fn exclusive() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Growth of `samples`: the median of the later half minus that of the earlier half, which ignores
/// temporary peaks.
fn growth(samples: &[f64]) -> f64 {
    let median = |half: &[f64]| {
        let mut sorted = half.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    let (early, late) = samples.split_at(samples.len() / 2);
    median(late) - median(early)
}

/// A hash of a picture (FNV-1a, Fowler, Noll and Vo).
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf29ce484222325, |hash: u64, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100000001b3)
    })
}

/// After every kind of frame has been drawn once, the memory of the process and of the adapter and the
/// number of objects stay constant, and each kind's picture stays bit-identical, whatever was drawn
/// before it. A validation error would panic.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn resources_and_pictures_are_stable() {
    let Some(gpu) = gpu() else { return };
    let _lock = exclusive();
    let wanted: Option<usize> =
        std::env::var("LIMPID_SOAK_FRAMES").ok().map(|n| n.parse().expect("a number of frames"));
    let (kinds, cycles) = wanted.map_or(SHORT, |frames| (KINDS, usize::max(frames / KINDS, 6)));
    // Consecutive kinds have little in common.
    let kinds: Vec<Kind> = (0..kinds).map(|i| kind(23 * i % KINDS)).collect();
    let mut offscreen = Offscreen::new(gpu);
    let mut seen = BTreeMap::new();
    let mut used = Vec::new();
    for cycle in 0..cycles {
        for step in 0..kinds.len() {
            // Another order in each cycle: the strides are coprime to the number of kinds.
            let i = step * [1, 7, 11, 13, 17, 19][cycle % 6] % kinds.len();
            let found = fingerprint(&kinds[i].draw(&mut offscreen));
            let first = *seen.entry(i).or_insert(found);
            assert_eq!(found, first, "cycle {cycle}: the picture of kind {i} has changed");
        }
        // Always the same last frame, so that the buffers kept for its size are the same.
        kinds[0].draw(&mut offscreen);
        used.push(Usage::now(gpu));
    }
    let pictures: std::collections::BTreeSet<_> = seen.values().collect();
    assert!(pictures.len() > kinds.len() / 2, "{} of {} kinds differ", pictures.len(), kinds.len());

    // The first cycle compiles pipelines and allocates buffers.
    let of = |part: fn(&Usage) -> f64| -> Vec<f64> { used[1..].iter().map(part).collect() };
    let (process, adapter, objects) = (of(|u| u.process), of(|u| u.adapter), of(|u| u.objects));
    const MIB: f64 = 1048576.0;
    println!("{cycles} cycles of {} frames: {:?} to {:?}", kinds.len(), used[0], used.last());
    println!("growth: {:.1} and {:.1} MiB", growth(&process) / MIB, growth(&adapter) / MIB);
    // A margin of 2 % for memory that drivers keep on their own.
    let noise = 0.02 * process[0];
    assert!(growth(&process) <= noise, "process memory grows: {process:?}");
    assert!(growth(&adapter) <= 0.0, "the adapter's memory grows: {adapter:?}");
    assert!(growth(&objects) <= 0.0, "objects on the device grow: {objects:?}");
}

/// Foam under a moving camera keeps the memory of the process: software adapters compile a shader anew, and keep it, for each
/// submission that binds a uniform buffer on which alone a branch depends.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn shaders_of_foam_are_compiled_once() {
    let Some(gpu) = gpu() else { return };
    let _lock = exclusive();
    let mut offscreen = Offscreen::new(gpu);
    let mut kind = under_foam(kind(2));
    kind.size = UVec2::new(64, 48);
    let mut used = Vec::new();
    for _ in 0..120 {
        kind.camera.eye.x += 0.001;
        kind.draw(&mut offscreen);
        used.push(Usage::now(gpu).process);
    }
    let growth = growth(&used[20..]);
    assert!(growth <= 0.01 * used[20], "process memory grows by {growth} bytes: {used:?}");
}

/// The renderer needs only the WebGPU core: on a device without optional features and with the default
/// limits, each setting gives the same picture as on a device with all the adapter's capabilities.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn the_webgpu_core_is_sufficient() {
    let Some(gpu) = gpu() else { return };
    let _lock = exclusive();
    let core = limited(gpu, wgpu::Limits::default());
    let (mut all, mut core) = (Offscreen::new(gpu), Offscreen::new(&core));
    // Each of the settings, with lights.
    for i in (0..).map(|i| 3 * i + 2).take(SETTINGS.len()) {
        let kind = kind(i);
        assert!(kind.scene.is_lit());
        assert!(kind.draw(&mut all) == kind.draw(&mut core), "{:?}", SETTINGS[i % SETTINGS.len()]);
    }
    // Each kind of liquid, with colours of its particles and under foam.
    for liquid in [
        "absorption = [0.8, 0.3, 0.1]\n",
        "scattering = [40.0, 40.0, 40.0]\n",
        "kind = \"opaque\"\n",
    ] {
        let mut kind = under_foam(kind_of(2, liquid));
        let colors = kind.particles.positions.iter().map(|p| p.abs().min(Vec3::ONE));
        kind.particles.colors = Some(colors.collect());
        assert!(kind.draw(&mut all) == kind.draw(&mut core), "under foam: {liquid:?}");
    }
}

/// A device of the same adapter with these limits and no features. Its errors panic, as wgpu does without an error callback.
fn limited(gpu: &Gpu, required_limits: wgpu::Limits) -> Gpu {
    let wanted = gpu.device.adapter_info();
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let adapters = wgpu::Instance::new(descriptor).enumerate_adapters(wanted.backend.into());
    let adapter = pollster::block_on(adapters).into_iter().find(|a| a.get_info() == wanted);
    let adapter = adapter.expect("the adapter of the other device");
    let descriptor = wgpu::DeviceDescriptor {
        required_features: wgpu::Features::empty(),
        required_limits,
        ..Default::default()
    };
    let device = pollster::block_on(adapter.request_device(&descriptor));
    let (device, queue) = device.expect("a device with these limits");
    Gpu::from_device(device, queue)
}

/// A picture whose sums of foam exceed what the device binds is refused with the remedies, and drawn without foam.
#[test]
fn foam_beyond_a_binding_is_refused() {
    let Some(gpu) = gpu() else { return };
    let _lock = exclusive();
    let limits = wgpu::Limits { max_storage_buffer_binding_size: 1 << 20, ..Default::default() };
    let gpu = limited(gpu, limits);
    let mut offscreen = Offscreen::new(&gpu);
    let mut kind = kind(0);
    kind.size = UVec2::new(320, 240);
    kind.draw(&mut offscreen);
    let kind = under_foam(kind);
    let splats = Splats { radius: 0.04, ..Splats::default() };
    let input = FrameInput::new(&kind.scene, &kind.camera, &splats, kind.size);
    let drawn = offscreen.draw(FrameInput { diffuse: kind.foam.as_ref(), ..input });
    let Err(refused) = drawn else { panic!("its sums have 1,228,800 bytes") };
    let refused = refused.to_string();
    assert!(refused.contains("320x240") && refused.contains("draw without foam"), "{refused}");
}

/// The measures of [`resources_and_pictures_are_stable`] detect growth, changes and leaks.
#[test]
fn measures_detect_growth_and_leaks() {
    assert_eq!(growth(&[5.0, 5.0, 5.0, 5.0]), 0.0);
    assert_eq!(growth(&[5.0, 9.0, 5.0, 5.0, 5.0, 9.0]), 0.0, "temporary peaks");
    assert_eq!(growth(&[5.0, 6.0, 7.0, 8.0, 9.0, 10.0]), 3.0);
    assert_ne!(fingerprint(&[0, 1]), fingerprint(&[1, 0]));

    let Some(gpu) = gpu() else { return };
    let _lock = exclusive();
    let before = Usage::now(gpu);
    let kept = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("a leak"),
        size: 1 << 20,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    assert!(Usage::now(gpu).objects > before.objects, "a buffer is counted");
    drop(kept);
}

/// The kinds include lit and empty frames in the expected numbers, and splashes.
#[test]
fn kinds_cover_lights_empty_frames_and_splashes() {
    let lit = (0..KINDS).filter(|&i| kind(i).scene.is_lit()).count();
    let empty = (0..KINDS).filter(|&i| kind(i).particles.is_empty()).count();
    assert_eq!((lit, empty), (KINDS / LOOKS.len(), KINDS / COUNTS.len()));
    let splashes = |i: usize| {
        let kind = kind(i);
        classify::classify(&kind.particles, 0.04, &kind.scene.settings.classify).splashes.len()
    };
    assert!((0..KINDS).any(|i| splashes(i) > 0), "some kind has splashes");
}
