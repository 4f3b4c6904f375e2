//! Startup cost: pipelines are compiled once, when a frame first needs them, and cached on disk. The
//! cache's state never changes a picture and gives no message.

use std::fs;
use std::hash::Hasher as _;
use std::path::{Path, PathBuf};

use glam::{DVec3, UVec2, Vec3};
use image::RgbImage;
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{self, Splats};
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid::settings::Solver;
use limpid::wgpu;
use limpid_io::project::Project;
use siphasher::sip128::{Hasher128 as _, SipHasher24};

use crate::support::gpu;

// ---- Compilation.

/// Number of shader modules, render pipelines and compute pipelines of a device.
fn compiled(gpu: &Gpu) -> [isize; 3] {
    let hal = gpu.device.get_internal_counters().hal;
    [&hal.shader_modules, &hal.render_pipelines, &hal.compute_pipelines].map(|n| n.read())
}

fn scene(solver: Solver) -> Scene {
    let text = "[environment]\nradiance = [0.5, 0.6, 0.8]\n\
                ";
    let mut scene = Project::parse(text, "plain", Path::new("")).expect("a scene").scene;
    scene.settings.refract.solver = solver;
    scene
}

/// A small block of liquid, with a droplet or without.
fn splats(scene: &Scene, droplet: bool) -> Splats {
    let place = |i: usize| Vec3::from([i % 5, i / 5 % 5, i / 25].map(|i| 0.1 * i as f32));
    let mut positions: Vec<_> = (0..125).map(place).collect();
    positions.extend(droplet.then_some(Vec3::splat(-0.8)));
    classify::classify(&Particles::from_positions(positions), 0.05, &scene.settings.classify)
}

fn draw(offscreen: &mut Offscreen, scene: &Scene, droplet: bool) {
    let (eye, target) = (DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO);
    let camera = Camera { eye, target, up: Vec3::Y, fov_y: 40.0, near: None, lens: None };
    let (splats, size) = (splats(scene, droplet), UVec2::new(48, 32));
    offscreen.draw(FrameInput::new(scene, &camera, &splats, size)).expect("the frame is drawn");
}

/// Only pipelines that a frame has needed are compiled, and none is compiled twice: not for the next frame, nor for the
/// layers of splashes, nor for another renderer. A module is parsed for several pipelines, if their constants rule out the
/// same branches.
#[test]
fn pipelines_are_compiled_once_when_needed() {
    if gpu().is_none() {
        return;
    }
    // A device of its own, since other tests compile on the shared one.
    let gpu = Gpu::headless().expect("there was one before");
    let plain = scene(Solver::Guarded);
    let mut offscreen = Offscreen::new(&gpu);
    draw(&mut offscreen, &plain, false);
    let first = compiled(&gpu);
    assert!(first[0] > 0 && first[2] > 0, "{first:?}: the device does not count");
    assert_eq!(first[1], 0, "a picture in memory needs no rasteriser");

    draw(&mut offscreen, &plain, false);
    assert_eq!(compiled(&gpu), first, "the same frame again");

    draw(&mut offscreen, &plain, true);
    let splashes = compiled(&gpu);
    assert!(splashes[2] > first[2], "refraction by splashes has no variant of its own");
    // Branches that a pipeline's constants rule out are not in its module.
    let [modules, rasterisers, pipelines] = [0, 1, 2].map(|i| splashes[i] - first[i]);
    assert!(rasterisers == 0 && modules <= pipelines, "{first:?}, then {splashes:?}");

    draw(&mut offscreen, &scene(Solver::March), true);
    let march = compiled(&gpu);
    let variant = march[2] - splashes[2];

    // Only this intersector reads mip levels, whose two pipelines are compiled with it.
    draw(&mut offscreen, &scene(Solver::Plane3), true);
    let mips = compiled(&gpu);
    assert!(mips[2] > march[2] + variant, "mip levels: {march:?}, then {mips:?}");

    draw(&mut Offscreen::new(&gpu), &plain, false);
    assert_eq!(compiled(&gpu), mips, "another renderer compiles again");
}

// ---- The cache.

const PARTICLES: &str = "0 0 0\n0.05 0 0\n0 0.05 0\n0 0 0.05\n0.05 0.05 0\n0.05 0 0.05\n";

/// Draws a little liquid with `cache` as the user's cache folder; returns the picture.
#[track_caller]
fn drawn(folder: &Path, cache: &Path) -> RgbImage {
    let particles = folder.join("water.xyz");
    fs::write(&particles, PARTICLES).expect("the folder is writable");
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    // Mesa's own cache stays in place, or each run would compile its shaders.
    let home = std::env::var_os("HOME").map(PathBuf::from).unwrap_or_default();
    let mesa = std::env::var_os("XDG_CACHE_HOME").map_or(home.join(".cache"), PathBuf::from);
    if std::env::var_os("MESA_SHADER_CACHE_DIR").is_none() {
        command.env("MESA_SHADER_CACHE_DIR", mesa);
    }
    command.env("NODEVICE_SELECT", "1").env("XDG_CACHE_HOME", cache).env("HOME", cache);
    command.env_remove("LOCALAPPDATA").current_dir(folder);
    let output = command
        .args(["render", "--quiet", "--size=48x32", "--radius=0.03", "-o", "water.png"])
        .arg("water.xyz")
        .timeout(std::time::Duration::from_secs(60))
        .output()
        .expect("the program starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), &*stderr), (Some(0), ""), "with {}", cache.display());
    image::open(folder.join("water.png")).expect("there is a picture").into_rgb8()
}

/// A folder, the picture drawn there without a cache, and the cache file of that run; `None` if the
/// adapter has no pipeline caches.
fn first_run() -> Option<(tempfile::TempDir, RgbImage, PathBuf)> {
    let gpu = gpu()?;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = drawn(folder.path(), folder.path());
    let cache = folder.path().join("limpid");
    if !gpu.device.features().contains(wgpu::Features::PIPELINE_CACHE) {
        assert!(!cache.exists(), "a cache without pipelines");
        eprintln!("skipped: this adapter has no pipeline caches");
        return None;
    }
    let files: Vec<_> = fs::read_dir(&cache).expect("the folder is made").flatten().collect();
    let [file] = files.as_slice() else { panic!("one file expected: {files:?}") };
    let name = file.file_name().into_string().expect("a plain name");
    assert!(name.starts_with("pipelines-") && name.ends_with(".bin"), "{name}");
    let path = file.path();
    Some((folder, picture, path))
}

/// The second run reads the cache of the first and draws the same picture.
#[test]
fn pipelines_are_cached() {
    let Some((folder, picture, file)) = first_run() else { return };
    let first = fs::read(&file).expect("it is there");
    assert!(drawn(folder.path(), folder.path()) == picture, "another picture");
    let second = fs::read(&file).expect("it is there still");
    assert!(first.len() > 16 && second.len() >= first.len(), "{} bytes", second.len());
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = file.parent().expect("it is in a folder").metadata().expect("it is there");
        assert_eq!(folder.permissions().mode() & 0o077, 0, "other users can access the folder");
    }
}

mod rare {
    use super::*;

    /// A damaged or foreign cache file is replaced, and its bytes never reach the driver, which would trust
    /// them.
    #[test]
    #[ignore = "rare: scripts/nightly.sh runs it"]
    fn damaged_and_foreign_caches_are_replaced() {
        let Some((folder, picture, file)) = first_run() else { return };
        let whole = fs::read(&file).expect("it is there");
        let flipped = |at: usize| {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            bytes
        };
        // The same bytes with the checksum of another adapter.
        let mut foreign = SipHasher24::new();
        foreign.write(b"limpid 0.0.0, Vulkan 10de 2330, another, its driver, 1\0");
        foreign.write(&whole[16..]);
        let foreign = [&foreign.finish128().as_u128().to_le_bytes()[..], &whole[16..]].concat();
        let cases = [
            ("empty", Vec::new()),
            ("half a checksum", whole[..8].to_vec()),
            ("only a checksum", whole[..16].to_vec()),
            ("cut off", whole[..whole.len() - 1].to_vec()),
            ("longer", [&whole[..], b"\0"].concat()),
            ("another checksum", flipped(0)),
            ("a flipped bit at its begin", flipped(16)),
            ("a flipped bit at its end", flipped(whole.len() - 1)),
            (
                "noise",
                (0..1_u32 << 20).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect(),
            ),
            ("foreign", foreign),
        ];
        for (what, bytes) in cases {
            fs::write(&file, &bytes).expect("the folder is writable");
            assert!(drawn(folder.path(), folder.path()) == picture, "{what}: another picture");
            let now = fs::read(&file).expect("it is there");
            assert!(now != bytes && now.len() > 16, "{what}: it is not replaced");
        }
        // A folder in place of the file.
        fs::remove_file(&file).expect("it was there");
        fs::create_dir(&file).expect("the folder is writable");
        assert!(drawn(folder.path(), folder.path()) == picture, "a folder: another picture");
        // A pipe in place of the file is neither read nor written: both would block for ever.
        #[cfg(unix)]
        {
            fs::remove_dir(&file).expect("it was there");
            let made =
                std::process::Command::new("mkfifo").arg(&file).status().expect("mkfifo runs");
            assert!(made.success());
            assert!(drawn(folder.path(), folder.path()) == picture, "a pipe: another picture");
        }
    }
}

/// A run succeeds where no cache can be written: read-only or missing home folders, full disks.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn unwritable_caches_are_ignored() {
    let Some((folder, picture, _)) = first_run() else { return };
    let file = folder.path().join("file");
    fs::write(&file, "").expect("the folder is writable");
    for cache in [file.as_path(), &file.join("below"), Path::new("/proc/self"), Path::new("")] {
        assert!(drawn(folder.path(), cache) == picture, "{}: another picture", cache.display());
    }
}
