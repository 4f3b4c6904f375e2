//! Valid files with changed bits, numbers and pieces, as from broken disks, incompatible writers and
//! attackers.
//!
//! The cases are the same on every machine. `LIMPID_HOSTILE_ROUNDS=1000000` tries more of them, from `LIMPID_SEED`
//! on, which takes longer; `LIMPID_HOSTILE_SEEDS=FOLDER` writes the valid files as seeds for `cargo fuzz`.

use std::alloc::System;
use std::panic;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

use cap::Cap;
use limpid::aov;
use limpid::camera::Camera;
use limpid::glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid::scene::Scene;
use limpid::settings::Settings;
use limpid_io::camera_path::CameraPath;
use limpid_io::exr;
use limpid_io::frames::{FrameSpec, Shard};
use limpid_io::input::Missing;
use limpid_io::output::OutputNames;
use limpid_io::project::Project;
use limpid_io::project::overrides::replaced;
use limpid_io::{Error, Result};
use limpid_lab::check::Suite;
use limpid_lab::compare;

use super::files;

/// Counts allocated memory.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Locks the allocation counter, which all tests of the process share.
pub(crate) fn counting() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    // With RUST_BACKTRACE set, a caught panic of a decoder would load all debug symbols, which would
    // count as memory of the reader.
    static NO_BACKTRACES: Once = Once::new();
    NO_BACKTRACES.call_once(|| panic::set_hook(Box::new(|panic| eprintln!("{panic}"))));
    LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Fails if reading `bytes` bytes needs more memory than deflate can pack into them.
#[track_caller]
pub(crate) fn within_memory<T>(what: &str, bytes: usize, read: impl FnOnce() -> T) -> T {
    /// Deflate expands a byte to at most 1032; each of these may pass through a few buffers.
    const PER_BYTE: usize = 4 * 1032;
    /// Memory of tests that run in parallel.
    const BASE: usize = 64 << 20;
    within(what, BASE + PER_BYTE * bytes, read)
}

/// Fails if `act` needs more than `limit` bytes of memory.
#[track_caller]
pub(crate) fn within<T>(what: &str, limit: usize, act: impl FnOnce() -> T) -> T {
    let limit = MEMORY.max_allocated().max(MEMORY.allocated() + limit);
    let result = act();
    let used = MEMORY.max_allocated();
    assert!(used <= limit, "{what}: used {} MiB, at most {} expected", used >> 20, limit >> 20);
    result
}

/// Reads these bytes by the extension of `name`, and checks the result.
fn read(name: &str, bytes: &[u8]) -> Result<()> {
    let path = Path::new(name);
    let text = || String::from_utf8_lossy(bytes);
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("png") => {
            compare::parse_picture(path, bytes).map(drop).and_then(|()| environment(path, bytes))
        }
        Some("hdr") => environment(path, bytes),
        Some("exr") => exr::parse(path, bytes).map(drop).and(environment(path, bytes)),
        Some("scene") => Project::parse(&text(), name, Path::new("/nowhere")).map(|scene| {
            let written = scene.to_toml(None).expect("it has no map");
            let again = Project::parse(&written, "written", Path::new(""));
            assert_eq!(again.expect("a written scene can be read"), scene, "{name}");
        }),
        Some("suite") => Suite::parse(&text(), path).map(drop),
        Some("path") => CameraPath::parse(&text(), name).map(|path| {
            let times = path.keys.iter().map(|key| key.time);
            let (first, last) = (path.keys[0].time, path.duration());
            let between = (0..=4).map(|i| first + f64::from(i) / 4.0 * (last - first));
            for time in times.chain(between) {
                path.at(time).check().expect("a camera that can be used");
            }
        }),
        _ => limpid_io::particles::parse(path, bytes).map(|particles| check(name, &particles)),
    }
}

fn environment(path: &Path, bytes: &[u8]) -> Result<()> {
    limpid_io::environment::parse(path, bytes)
        .map(|environment| assert!(environment.mean().is_finite()))
}

/// Checks the guarantees of the particle readers.
pub(crate) fn check(name: &str, particles: &Particles) {
    let n = particles.len();
    let finite = |of: &[Vec3]| of.len() == n && of.iter().all(|v| v.is_finite());
    assert!(particles.origin.is_finite() && finite(&particles.positions), "{name}");
    assert!(particles.velocities.as_deref().is_none_or(finite), "{name}");
    for floats in [&particles.densities, &particles.radii].into_iter().flatten() {
        assert!(floats.len() == n && floats.iter().all(|x| x.is_finite()), "{name}");
    }
    assert!(particles.radii.iter().flatten().all(|&radius| radius >= 0.0), "{name}");
    assert!(particles.ids.as_ref().is_none_or(|ids| ids.len() == n), "{name}");
    assert!(particles.ellipsoids.as_ref().is_none_or(|all| all.len() == n), "{name}");
}

/// Reads a file that may be damaged: it must be valid, or refused by one line that names it.
#[track_caller]
fn survive(name: &str, bytes: &[u8]) {
    let result = within_memory(name, bytes.len(), || read(name, bytes));
    let Err(error) = result else { return };
    let (code, message) = (error.category() as u8, error.to_string());
    let is_text = [".scene", ".path", ".suite"].iter().any(|kind| name.ends_with(kind));
    let codes: &[u8] = if is_text { &[2, 3, 4] } else { &[3, 4] };
    assert!(codes.contains(&code), "{name}: exit code {code}: {message}");
    assert!(message.starts_with(name) || is_text, "{name} is not named: {message}");
    assert!(!message.contains('\n') && message.len() < 3000, "{name}: {message}");
}

/// A linear congruential generator (Knuth's MMIX): the same cases on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number from 0 to `end` − 1; 0 if `end` is 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize).checked_rem(end).unwrap_or(0)
    }

    /// A range of at most 64 within `length`.
    fn part(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.below(length);
        start..start + self.below((length - start).min(64) + 1)
    }
}

/// Extreme values for counts and offsets in headers.
pub(crate) const EXTREMES: [u64; 12] = [
    0,
    1,
    0x7f,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];

/// Extreme values for numbers in texts.
const NUMBERS: [&str; 12] = [
    "0",
    "-1",
    "1e30",
    "nan",
    "inf",
    "-inf",
    "1e-45",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999999",
];

/// Applies one random change, which may insert a part of `other`.
fn damage(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let at = random.below(bytes.len());
    match random.below(9) {
        0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
        1 if !bytes.is_empty() => bytes[at] = random.below(256) as u8,
        2 => bytes.truncate(at),
        3 => {
            let number = EXTREMES[random.below(EXTREMES.len())];
            let (little, big) = (number.to_le_bytes(), number.to_be_bytes());
            let width = 1 << random.below(4);
            let number = if random.below(2) == 0 { &little[..width] } else { &big[8 - width..] };
            let end = (at + width).min(bytes.len());
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
        4 => {
            let part = random.part(bytes.len());
            bytes.drain(part);
        }
        5 => {
            let part = random.part(bytes.len());
            let part = bytes[part].to_vec();
            for _ in 0..=random.below(20) {
                bytes.splice(at..at, part.iter().copied());
            }
        }
        6 => {
            let part = random.part(other.len());
            bytes.splice(at..at, other[part].iter().copied());
        }
        7 => {
            // Replaces the next number of a text.
            let digits = |byte: &u8| byte.is_ascii_digit();
            let start = at + bytes[at..].iter().take_while(|byte| !digits(byte)).count();
            let end = start + bytes[start..].iter().take_while(|byte| digits(byte)).count();
            bytes.splice(start..end, NUMBERS[random.below(NUMBERS.len())].bytes());
        }
        _ => {
            let rest = other.get(random.below(other.len())..).unwrap_or_default();
            bytes.truncate(at);
            bytes.extend(rest);
        }
    }
}

fn all_files() -> Vec<files::Contents> {
    [files::particles(), files::pictures(), files::texts()].concat()
}

/// Every reader handles files truncated anywhere and files with a flipped bit.
#[test]
fn truncated_files_and_flipped_bits_are_refused_or_read() {
    let _lock = counting();
    write_seeds();
    for (name, bytes) in all_files() {
        read(&name, &bytes).expect("the file is valid");
        for end in (0..bytes.len()).step_by(1 + bytes.len() / 3000) {
            survive(&name, &bytes[..end]);
        }
        let mut bytes = bytes;
        for bit in (0..8 * bytes.len()).step_by(1 + bytes.len() / 500) {
            bytes[bit / 8] ^= 1 << (bit % 8);
            survive(&name, &bytes);
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

/// The seeds of the mutants: as many as usual, or `LIMPID_HOSTILE_ROUNDS`, from `LIMPID_SEED` on.
pub(crate) fn rounds(usual: usize) -> std::ops::Range<usize> {
    let number = |name| std::env::var(name).ok().and_then(|number| number.parse::<usize>().ok());
    let first = number("LIMPID_SEED").unwrap_or(0);
    first..first + number("LIMPID_HOSTILE_ROUNDS").unwrap_or(usual)
}

/// Every reader handles wrong counts, pieces that are missing, repeated or from another file, and
/// invalid numbers.
#[test]
fn mutated_files_are_refused_or_read() {
    let _lock = counting();
    let files = all_files();
    for round in rounds(1500) {
        for (k, (name, valid)) in files.iter().enumerate() {
            let mut random = Random((round as u64) << 16 | k as u64);
            let other = &files[random.below(files.len())].1;
            let mut bytes = valid.clone();
            for _ in 0..=random.below(4) {
                damage(&mut bytes, other, &mut random);
            }
            survive(name, &bytes);
        }
    }
}

/// The files found by fuzzing, in `tests/data/hostile`; the extension selects the reader.
#[test]
fn files_found_by_fuzzing_are_refused_or_read() {
    let _lock = counting();
    let folder =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/data/hostile");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be listed").path();
        let bytes = std::fs::read(&path).expect("it can be read");
        survive(&path.file_name().unwrap_or_default().to_string_lossy(), &bytes);
        count += 1;
    }
    assert!(count >= 5, "{count} files");
}

/// A file with many repeated sections is read in time proportional to its length, not to its square,
/// which would take minutes for half a megabyte.
#[test]
fn repeated_sections_are_read_in_linear_time() {
    let _lock = counting();
    let n = 40_000;
    let many = |start: &str, part: &dyn Fn(usize) -> String, end: &str| {
        let mut text = start.to_owned();
        (0..n).for_each(|i| text += &part(i));
        text + end
    };
    let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
    let vtu = "<VTKFile type=\"PolyData\"><PolyData>";
    let points =
        "<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\"></DataArray></Points>";
    let cases = [
        ("metadata.vtk", many(vtk, &|_| "METADATA\n\n".into(), "POINTS 0 float\n")),
        ("fields.vtk", many(vtk, &|_| "FIELD f 1\na 1 0 int\n".into(), "POINTS 0 float\n")),
        ("vertices.vtk", many(vtk, &|_| "VERTICES 0 0\n".into(), "POINTS 0 float\n")),
        (
            "pieces.vtu",
            many(
                vtu,
                &|_| format!("<Piece NumberOfPoints=\"0\">{points}</Piece>"),
                "</PolyData></VTKFile>",
            ),
        ),
        ("nested.vtu", many(vtu, &|_| "<a>".into(), "")),
        (
            "attributes.vtu",
            many(
                "<VTKFile type=\"PolyData\"><PolyData><Piece ",
                &|i| format!("a{i}=\"\" "),
                "></Piece></PolyData></VTKFile>",
            ),
        ),
        (
            "names.vtu",
            many(
                &format!("{vtu}<Piece NumberOfPoints=\"0\"><Points>"),
                &|i| {
                    format!(
                        "<DataArray Name=\"a{i}\" type=\"Float32\" NumberOfComponents=\"3\"></DataArray>"
                    )
                },
                "</Points></Piece></PolyData></VTKFile>",
            ),
        ),
        (
            "properties.ply",
            many(
                "ply\nformat ascii 1.0\nelement vertex 0\n",
                &|i| format!("property float x{i}\n"),
                "property float x\nproperty float y\nproperty float z\nend_header\n",
            ),
        ),
        (
            "elements.ply",
            many(
                "ply\nformat ascii 1.0\n",
                &|i| format!("element e{i} 0\n"),
                "element vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
            ),
        ),
        ("columns.csv", many("x,y,z", &|i| format!(",radius{i}"), "\n")),
        ("radii.csv", many("x,y,z", &|_| ",radius".into(), "\n")),
        ("blank.xyz", many("", &|_| "\n\n".into(), "0 0 0\n")),
        (
            "solids.scene",
            many("", &|_| "[[solid]]\nshape = \"plane\"\norigin = [0, 0, 0]\n".into(), ""),
        ),
        ("keys.scene", many("[liquid]\n", &|i| format!("a{i} = 1\n"), "")),
        ("dotted.scene", many("a", &|_| ".a".into(), " = 1\n")),
        ("nested.scene", many("a = ", &|_| "[".into(), "")),
        ("tables.scene", many("a = ", &|_| "{a=".into(), "")),
        (
            "keys.path",
            many(
                "",
                &|i| format!("[[key]]\ntime = {i}\neye = [0, 0, 1]\ntarget = [0, 0, 0]\n"),
                "",
            ),
        ),
    ];
    for (name, text) in cases {
        survive(name, text.as_bytes());
    }
    let mut attributes =
        [&b"BgeoV"[..], &5_i32.to_be_bytes(), &[0; 16], &n.to_be_bytes()[4..], &[0; 12]].concat();
    (0..n).for_each(|_| attributes.extend([0, 1, b'v', 0, 3, 0, 0, 0, 5].iter().chain(&[0; 12])));
    survive("attributes.bhclassic", &attributes);
}

/// Values of options are accepted or refused with code 2.
#[test]
fn any_value_of_an_option_is_accepted_or_refused() {
    let _lock = counting();
    let project = || Project::from(Scene::around(-DVec3::ONE, DVec3::ONE, 0.1));
    let parse = |kind: usize, text: &str| match kind {
        0 => text.parse::<FrameSpec>().map(drop),
        1 => text.parse::<Shard>().map(drop),
        2 => {
            let camera = text.parse::<Camera>().map_err(Error::from);
            camera.map(|camera| camera.check().expect("it can be used"))
        }
        3 => replaced(&Settings::default(), &[text.into()])
            .and_then(|settings| Ok(settings.check()?)),
        4 => project().set(&[text.into()]),
        5 => aov::parse_list(text).map(drop).map_err(Error::from),
        6 => OutputNames::parse(text, 2).map(|names| drop(names.path(i64::MIN))),
        _ => text.parse::<Missing>().map(drop),
    };
    let valid: [&[&str]; 8] = [
        &[
            "1-3,5",
            "7-20:2",
            "7-20x2",
            "1-10@b",
            "-5--1",
            "all",
            "9223372036854775807-9223372036854775807",
        ],
        &["2/4", "1/1", "18446744073709551615/18446744073709551615"],
        &["eye=1,2,3 target=0,0,0 fov_y=40 up=0,1,0 near=0.01"],
        &["refract.solver=march", "preset=imai2016", "classify.support=4", "caustics.samples=3"],
        &["liquid.ior=1.4", "liquid.absorption=[1, 0.3, 0.1]", "fluid.2.absorption=[0, 0, 5]"],
        &["all", "depth,normal"],
        &["out_####.png", "out_%04d.png", "$F4.png", "{}.png", "%99999999999999999999d", "$F0"],
        &["hold", "empty", "error"],
    ];
    let words: Vec<&str> = valid.concat();
    for round in 0..400 {
        for (kind, texts) in valid.iter().enumerate() {
            for (k, text) in texts.iter().enumerate() {
                let mut random = Random((round << 16) | (k << 8 | kind) as u64);
                let other = words[random.below(words.len())].as_bytes();
                let mut bytes = text.as_bytes().to_vec();
                for _ in 0..random.below(4) {
                    damage(&mut bytes, other, &mut random);
                }
                let text = String::from_utf8_lossy(&bytes);
                if let Err(error) = parse(kind, &text) {
                    assert_eq!(error.category() as u8, 2, "{text}: {error}");
                }
            }
        }
    }
}

/// Writes the valid files as seeds for `cargo fuzz`, if `LIMPID_HOSTILE_SEEDS` is set.
fn write_seeds() {
    let Some(corpus) = std::env::var_os("LIMPID_HOSTILE_SEEDS").map(PathBuf::from) else { return };
    for (name, bytes) in all_files() {
        let targets: &[&str] = match name.rsplit('.').next().unwrap_or_default() {
            "bhclassic" => &["bgeo"],
            "geo" => &["bgeo"],
            "sc" => &["scf"],
            "h5" => &["hdf5"],
            "lammpstrj" => &["lammps"],
            "positions" => &["foam"],
            "png" => &["picture", "environment"],
            "hdr" | "exr" => &["environment"],
            "path" => &["camera_path"],
            kind => &[kind],
        };
        for target in targets {
            let folder = corpus.join(target);
            std::fs::create_dir_all(&folder).expect("a folder for seeds");
            std::fs::write(folder.join(&name), &bytes).expect("a seed");
        }
    }
}
