//! Fuzz targets: how each interprets its bytes, and the properties that must hold for any input.

use std::alloc::System;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use cap::Cap;
use limpid::aov;
use limpid::camera::Camera;
use limpid::glam::{DVec3, Vec3};
use limpid::liquid::classify as pass;
use limpid::liquid::{Particles, Up};
use limpid::scene::Scene;
use limpid::settings::{Classify, Settings};
use limpid_io::camera_path::CameraPath;
use limpid_io::frames::{FrameSpec, Shard};
use limpid_io::input::Missing;
use limpid_io::output::OutputNames;
use limpid_io::project::Project;
use limpid_io::project::overrides::replaced;
use limpid_io::{Error, environment as maps, exr, particles as files};
use limpid_lab::check::Suite;
use limpid_lab::compare;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Runs `read` with memory limited to what decompressing `bytes` bytes can need. An allocation beyond the
/// limit aborts the process, which the fuzzer reports.
fn within_memory<T>(bytes: usize, read: impl FnOnce() -> T) -> T {
    /// Deflate expands a byte to at most 1032; each may pass through a few buffers.
    const PER_BYTE: usize = 8 * 1032;
    /// Allowance that does not depend on the input.
    const BASE: usize = 48 << 20;
    let limit = MEMORY.allocated() + BASE + bytes * PER_BYTE;
    MEMORY.set_limit(limit).expect("the limit exceeds the allocated memory");
    let result = read();
    MEMORY.set_limit(usize::MAX).expect("there is no limit");
    result
}

fn check_error(error: &Error, name: &str, codes: &[u8]) {
    let message = error.to_string();
    assert!(
        codes.contains(&(error.category() as u8)),
        "exit code {}: {message}",
        error.category() as u8
    );
    assert!(message.contains(name) && message.len() < 2500 && !message.contains('\n'), "{message}");
}

fn check_particles(particles: &Particles) {
    let n = particles.len();
    let finite = |of: &[Vec3]| of.len() == n && of.iter().all(|v| v.is_finite());
    assert!(particles.origin.is_finite() && finite(&particles.positions));
    assert!(particles.velocities.as_deref().is_none_or(finite));
    for floats in [&particles.densities, &particles.radii].into_iter().flatten() {
        assert!(floats.len() == n && floats.iter().all(|x| x.is_finite()));
    }
    assert!(particles.radii.iter().flatten().all(|&radius| radius >= 0.0));
    assert!(particles.ids.as_ref().is_none_or(|ids| ids.len() == n));
    assert!(particles.ellipsoids.as_ref().is_none_or(|ellipsoids| ellipsoids.len() == n));
}

/// Parses a particle file.
pub fn particles(extension: &str, bytes: &[u8]) {
    let path = PathBuf::from(format!("fuzzed{extension}"));
    match within_memory(bytes.len(), || files::parse(&path, bytes)) {
        Ok(particles) => check_particles(&particles),
        Err(error) => check_error(&error, "fuzzed", &[3, 4]),
    }
}

/// Reads an `.ani` file next to a `.pos` file of two particles.
pub fn ellipsoids(bytes: &[u8]) {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = Path::new("/dev/shm").join(format!("limpid-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder in memory");
        let two = [&2_u32.to_le_bytes()[..], &[0; 28]].concat();
        std::fs::write(folder.join("fuzzed.pos"), two).expect("a file in memory");
        folder
    });
    std::fs::write(folder.join("fuzzed.ani"), bytes).expect("a file in memory");
    let read = || files::read(&folder.join("fuzzed.pos"));
    match within_memory(bytes.len(), read) {
        Ok(particles) => check_particles(&particles),
        Err(error) => check_error(&error, "fuzzed.ani", &[3, 4]),
    }
}

/// Parses a scene file; valid scenes survive a round trip.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let parse = || Project::parse(text, "fuzzed", Path::new("/nowhere"));
    match within_memory(bytes.len(), parse) {
        Ok(scene) => {
            let written = scene.to_toml(None).expect("a scene without a map can be written");
            let again = Project::parse(&written, "written", Path::new(""));
            assert_eq!(again.expect("a written scene can be read"), scene);
        }
        Err(error) => check_error(&error, "", &[2, 3, 4]),
    }
}

/// Parses a suite of `limpid check`.
pub fn suite(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Err(error) = within_memory(bytes.len(), || Suite::parse(text, Path::new("fuzzed"))) {
        check_error(&error, "fuzzed", &[2]);
    }
}

/// Parses a camera path; valid paths yield valid cameras.
pub fn camera_path(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    match within_memory(bytes.len(), || CameraPath::parse(text, "fuzzed")) {
        Ok(path) => {
            let times = path.keys.iter().map(|key| key.time);
            let (first, last) = (path.keys[0].time, path.duration());
            let between = (0..=16).map(|i| first + f64::from(i) / 16.0 * (last - first));
            for time in times.chain(between) {
                path.at(time).check().expect("a valid camera");
            }
        }
        Err(error) => check_error(&error, "fuzzed", &[2]),
    }
}

/// Parses a value of an option, which the first byte chooses.
pub fn arguments(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Some((kind, text)) = text.split_at_checked(1) else { return };
    // Excludes millions of frames, which are valid but take a second.
    let long =
        text.split(|c: char| !c.is_ascii_digit()).any(|digits| (5..16).contains(&digits.len()));
    let error = match kind {
        "f" if !long => text.parse::<FrameSpec>().err(),
        "s" => text.parse::<Shard>().err(),
        "c" => {
            let camera = text.parse::<Camera>();
            camera.inspect(|c| c.check().expect("a valid camera")).err().map(Error::from)
        }
        "S" => replaced(&Settings::default(), &[text.into()])
            .inspect(|settings| settings.check().expect("valid settings"))
            .err(),
        "l" => Project::from(Scene::around(-DVec3::ONE, DVec3::ONE, 0.1)).set(&[text.into()]).err(),
        "a" => aov::parse_list(text).err().map(Error::from),
        "o" => OutputNames::parse(text, 2).map(|names| names.path(i64::MIN)).err(),
        "m" => text.parse::<Missing>().err(),
        _ => None,
    };
    if let Some(error) = error {
        assert_eq!(error.category() as u8, 2, "{error}");
    }
}

/// Parses an environment map.
pub fn environment(bytes: &[u8]) {
    match within_memory(bytes.len(), || maps::parse(Path::new("fuzzed.exr"), bytes)) {
        Ok(environment) => assert!(environment.mean().is_finite()),
        Err(error) => check_error(&error, "fuzzed", &[3, 4]),
    }
}

/// Parses a picture for comparison.
pub fn picture(bytes: &[u8]) {
    let parse = || compare::parse_picture(Path::new("fuzzed.png"), bytes);
    if let Err(error) = within_memory(bytes.len(), parse) {
        check_error(&error, "fuzzed", &[3, 4]);
    }
}

/// Interpolates and classifies particles with arbitrary finite floats, as readers may return them.
pub fn classify(bytes: &[u8]) {
    let records = bytes.as_chunks::<20>().0;
    let number = |record: &[u8; 20], at: usize| {
        let number = record[at..].first_chunk().map_or(0.0, |&bytes| f32::from_le_bytes(bytes));
        if number.is_finite() { number } else { 0.0 }
    };
    let of = |at: usize| records.iter().map(|record| number(record, at)).collect::<Vec<_>>();
    let vector = |record| Vec3::new(number(record, 0), number(record, 4), number(record, 8));
    let positions: Vec<_> = records.iter().map(vector).collect();
    let particles = Particles {
        velocities: Some(positions.iter().rev().copied().collect()),
        positions,
        radii: Some(of(12).iter().map(|radius| radius.abs()).collect()),
        densities: Some(of(16)),
        ..Particles::default()
    };
    let moved = Particles {
        positions: of(4).iter().map(|&x| Vec3::splat(x)).collect(),
        ..particles.clone()
    };
    let mut between = Particles::between(&particles, &moved, 0.3);
    between.to_y_up(Up::Z);
    for mut particles in [particles, between] {
        particles.radii = particles.radii.filter(|_| bytes.len() % 2 == 0);
        let radius = pass::estimate_radius(&particles);
        let splats = pass::classify(&particles, radius, &Classify::default());
        assert!(splats.origin.is_finite() && splats.radius.is_finite());
        for splat in splats.aggregates.iter().chain(&splats.splashes) {
            let numbers = [splat.centre, splat.diagonal, splat.off_diagonal];
            assert!(numbers.as_flattened().iter().all(|x| x.is_finite()), "{splat:?}");
        }
    }
}
