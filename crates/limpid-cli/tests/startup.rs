//! What a start costs: pipelines are compiled when a frame first needs them, once, and what the driver
//! makes of them is kept in the user's cache folder; whatever is found there, or cannot be put
//! there, the picture is the same and nobody hears of it.

#[expect(dead_code, reason = "what this file does not use of it")]
#[path = "../../../tests/support/mod.rs"]
mod support;

use std::fs;
use std::hash::Hasher as _;
use std::path::{Path, PathBuf};

use glam::{DVec3, UVec2, Vec3};
use image::RgbImage;
use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::{self, Splats};
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid::settings::Solver;
use limpid::wgpu;
use limpid_io::project::Project;
use siphasher::sip128::{Hasher128 as _, SipHasher24};
use support::gpu;

// ---- What is compiled.

/// Modules, render pipelines and compute pipelines that a device holds.
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

/// A small block, with a droplet or without.
fn splats(scene: &Scene, droplet: bool) -> Splats {
    let place = |i: usize| Vec3::from([i % 5, i / 5 % 5, i / 25].map(|i| 0.1 * i as f32));
    let mut positions: Vec<_> = (0..125).map(place).collect();
    positions.extend(droplet.then_some(Vec3::splat(-0.8)));
    classify::classify(&Particles::from_positions(positions), 0.05, &scene.settings.classify)
}

fn draw(studio: &mut Offscreen, scene: &Scene, droplet: bool) {
    let (eye, target) = (DVec3::new(0.0, 1.0, 4.0), DVec3::ZERO);
    let camera = Camera { eye, target, up: Vec3::Y, fov_y: 40.0, near: None };
    studio
        .draw(scene, &camera, &splats(scene, droplet), UVec2::new(48, 32))
        .expect("the frame is drawn");
}

/// Protects the start: what no frame has needed is not compiled, and nothing is compiled or parsed
/// twice, neither for the next frame, nor for the splashes' own layers, nor for another renderer.
#[test]
fn what_is_not_needed_is_not_compiled() {
    if gpu().is_none() {
        return;
    }
    // Its own: other tests compile on theirs.
    let gpu = Gpu::headless().expect("there was one before");
    let plain = scene(Solver::Guarded);
    let mut studio = Offscreen::new(&gpu);
    draw(&mut studio, &plain, false);
    let first = compiled(&gpu);
    assert!(first.iter().all(|&n| n > 0), "{first:?}: the device counts what is compiled");

    draw(&mut studio, &plain, false);
    assert_eq!(compiled(&gpu), first, "the same frame again");

    draw(&mut studio, &plain, true);
    let splashes = compiled(&gpu);
    assert_eq!(splashes[..2], first[..2], "splashes are splatted by the same pipelines");
    assert!(splashes[2] > first[2], "light through splashes is another variant");

    // This intersector alone reads mip levels: their two pipelines come with its own.
    let variant = splashes[2] - first[2];
    draw(&mut studio, &scene(Solver::Plane3), true);
    let mips = compiled(&gpu);
    assert!(mips[2] > splashes[2] + variant, "mip levels: {splashes:?}, then {mips:?}");

    draw(&mut Offscreen::new(&gpu), &plain, false);
    assert_eq!(compiled(&gpu)[0], mips[0], "another renderer parses nothing again");
}

// ---- What is kept.

const PARTICLES: &str = "0 0 0\n0.05 0 0\n0 0.05 0\n0 0 0.05\n0.05 0.05 0\n0.05 0 0.05\n";

/// Draws a little liquid with `cache` as the user's cache folder; returns the picture.
#[track_caller]
fn drawn(folder: &Path, cache: &Path) -> RgbImage {
    let particles = folder.join("water.xyz");
    fs::write(&particles, PARTICLES).expect("the folder is writable");
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    // Mesa's own cache stays where it is, or each run would wait for its compiler.
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

/// A folder, the picture that is drawn there without a cache, and the file that is kept of it; none
/// where the adapter has nothing to keep.
fn kept() -> Option<(tempfile::TempDir, RgbImage, PathBuf)> {
    let gpu = gpu()?;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let picture = drawn(folder.path(), folder.path());
    let cache = folder.path().join("limpid");
    if !gpu.device.features().contains(wgpu::Features::PIPELINE_CACHE) {
        assert!(!cache.exists(), "nothing is kept");
        eprintln!("skipped: this adapter gives nothing out");
        return None;
    }
    let files: Vec<_> = fs::read_dir(&cache).expect("the folder is made").flatten().collect();
    let [file] = files.as_slice() else { panic!("one file expected: {files:?}") };
    let name = file.file_name().into_string().expect("a plain name");
    assert!(name.starts_with("pipelines-") && name.ends_with(".bin"), "{name}");
    let path = file.path();
    Some((folder, picture, path))
}

/// Protects the second start: it finds what the first has left, and draws the same.
#[test]
fn pipelines_are_kept() {
    let Some((folder, picture, file)) = kept() else { return };
    let first = fs::read(&file).expect("it is there");
    assert!(drawn(folder.path(), folder.path()) == picture, "another picture");
    let second = fs::read(&file).expect("it is there still");
    assert!(first.len() > 16 && second.len() >= first.len(), "{} bytes", second.len());
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = file.parent().expect("it is in a folder").metadata().expect("it is there");
        assert_eq!(folder.permissions().mode() & 0o077, 0, "machine code is private");
    }
}

/// Protects against what may have become of the file: nothing but the very bytes reaches the driver,
/// which would believe them.
#[test]
fn damaged_and_foreign_pipelines_are_replaced() {
    let Some((folder, picture, file)) = kept() else { return };
    let whole = fs::read(&file).expect("it is there");
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        bytes
    };
    // The same bytes, of an adapter that is not this one, with a checksum that says so.
    let mut foreign = SipHasher24::new();
    foreign.write(b"limpid 0.0.0, Vulkan 10de 2330, another, its driver, 1\0");
    foreign.write(&whole[16..]);
    let foreign = [&foreign.finish128().as_u128().to_le_bytes()[..], &whole[16..]].concat();
    let cases = [
        ("empty", Vec::new()),
        ("half a checksum", whole[..8].to_vec()),
        ("nothing but a checksum", whole[..16].to_vec()),
        ("cut off", whole[..whole.len() - 1].to_vec()),
        ("longer", [&whole[..], b"\0"].concat()),
        ("another checksum", flipped(0)),
        ("a flipped bit at its begin", flipped(16)),
        ("a flipped bit at its end", flipped(whole.len() - 1)),
        ("noise", (0..1_u32 << 20).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()),
        ("foreign", foreign),
    ];
    for (what, bytes) in cases {
        fs::write(&file, &bytes).expect("the folder is writable");
        assert!(drawn(folder.path(), folder.path()) == picture, "{what}: another picture");
        let now = fs::read(&file).expect("it is there");
        assert!(now != bytes && now.len() > 16, "{what}: it is replaced");
    }
    // A folder of that name is nobody's file.
    fs::remove_file(&file).expect("it was there");
    fs::create_dir(&file).expect("the folder is writable");
    assert!(drawn(folder.path(), folder.path()) == picture, "a folder: another picture");
    // A pipe in its place is neither read nor written: both would wait for ever.
    #[cfg(unix)]
    {
        fs::remove_dir(&file).expect("it was there");
        let made = std::process::Command::new("mkfifo").arg(&file).status().expect("mkfifo runs");
        assert!(made.success());
        assert!(drawn(folder.path(), folder.path()) == picture, "a pipe: another picture");
    }
}

/// Protects machines on which there is no place for it: read-only homes, full disks, no home at all.
#[test]
fn nothing_is_kept_where_nothing_can_be() {
    let Some((folder, picture, _)) = kept() else { return };
    let file = folder.path().join("file");
    fs::write(&file, "").expect("the folder is writable");
    for cache in [file.as_path(), &file.join("below"), Path::new("/proc/self"), Path::new("")] {
        assert!(drawn(folder.path(), cache) == picture, "{}: another picture", cache.display());
    }
}
