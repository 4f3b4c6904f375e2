//! Files of which one field is changed: a length, count, tag, offset or type, in any of the formats.
//!
//! A mutant is refused by one line, or read as the particles of the valid file, or something is said: never does a
//! changed file stand for a part of the liquid in silence. Only changes that make another valid file, which the
//! writers mark as free, may give other particles.
//!
//! The mutants are the same on every machine. `LIMPID_HOSTILE_ROUNDS=20000` makes more of them for each format, from
//! the seed `LIMPID_SEED` on, which a failure names. `LIMPID_HOSTILE_HDF5=FOLDER` keeps those of HDF5, with what was read
//! of each, for `hdf5.py`, which compares that with h5py.

mod fields;
mod gltf;
mod hdf5;
mod houdini;
mod lists;
mod simulators;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use limpid::glam::DVec3;
use limpid_io::input::Input;
use limpid_io::particles::{Contents, ReadOptions};
use limpid_io::{Result, meshes};

use super::damage::{self, Random};
use fields::Fields;

/// Files of a folder, the first of which is opened, and the contents that were written.
struct Written {
    files: Vec<(String, Vec<u8>)>,
    /// The places of the particles of each frame, or the corners of a mesh.
    frames: Vec<Vec<DVec3>>,
    reader: Reader,
}

/// How a file is read.
#[derive(Clone, Copy, PartialEq)]
enum Reader {
    /// One frame of particles, in memory.
    Particles,
    /// The frames of a file that is there.
    Frames,
    /// A mesh that is there.
    Mesh,
}

/// Contents that were read.
struct Read {
    frames: Vec<Vec<DVec3>>,
    /// Whether anything was said about the file.
    said: bool,
}

impl Written {
    /// A file of one frame of particles.
    fn one(name: &str, bytes: Vec<u8>, places: Vec<DVec3>) -> Self {
        Self { files: vec![(name.into(), bytes)], frames: vec![places], reader: Reader::Particles }
    }
}

/// Reads one frame from memory.
fn parse(path: &Path, bytes: &[u8]) -> Result<Read> {
    let contents = Contents::parse(path, bytes, &ReadOptions::default())?;
    damage::check(&path.to_string_lossy(), &contents.particles);
    Ok(Read { frames: vec![places_of(&contents)], said: !contents.remarks.is_empty() })
}

/// Reads all frames of a file that is there.
fn open(path: &Path) -> Result<Read> {
    let input = Input::open(path)?.loader;
    // Files that are listed and not there are told before anything is drawn.
    let said = !input.sequence.absent.is_empty();
    let mut read = Read { frames: Vec::new(), said };
    for frame in &input.sequence.frames {
        let contents = frame.read(&ReadOptions::default())?;
        damage::check(&path.to_string_lossy(), &contents.particles);
        read.said |= !contents.remarks.is_empty();
        read.frames.push(places_of(&contents));
    }
    Ok(read)
}

/// Reads a mesh: the corners of its triangles.
fn load(path: &Path) -> Result<Read> {
    let mesh = meshes::load(path)?;
    let corners = mesh.data.triangles.as_flattened().iter();
    let corners = corners.map(|&corner| mesh.data.positions[corner as usize]).collect();
    Ok(Read { frames: vec![corners], said: !mesh.remarks.is_empty() })
}

fn places_of(contents: &Contents) -> Vec<DVec3> {
    (0..contents.particles.len()).map(|i| contents.particles.place(i)).collect()
}

/// Places of this many particles, no two of them alike.
fn places(count: usize) -> Vec<DVec3> {
    let place = |i: usize| {
        DVec3::new((i % 5) as f64, (i / 5 % 4) as f64, (i / 20) as f64) * 0.05
            + DVec3::splat(1e-3 * i as f64)
    };
    (0..count).map(place).collect()
}

/// Whether these are the same places, in any order, to the digits of 32-bit numbers.
fn alike(found: &[DVec3], expected: &[DVec3]) -> bool {
    let sorted = |places: &[DVec3]| {
        let mut places = places.to_vec();
        places.sort_by(|a, b| {
            a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
        });
        places
    };
    found.len() == expected.len()
        && sorted(found).iter().zip(sorted(expected)).all(|(a, b)| a.distance(b) < 1e-5)
}

/// A writer of files of one kind.
type Writer = fn(&mut Fields) -> Written;

const WRITERS: [(&str, Writer); 15] = [
    ("Houdini's text, tuples", houdini::tuples),
    ("Houdini's text, arrays", houdini::arrays),
    ("Houdini's binary, pages", houdini::packed),
    ("Houdini's binary, Blosc", houdini::blosc),
    ("DualSPHysics", simulators::bi4),
    ("Krakatoa", simulators::prt),
    ("mantaflow", simulators::uni),
    ("LAMMPS", simulators::dump),
    ("pieces of VTK", lists::pvtu),
    ("blocks of VTK", lists::vtm),
    ("time series of ParaView", lists::pvd),
    ("time series in JSON", lists::series),
    ("GLB", gltf::glb),
    ("HDF5, contiguous", hdf5::contiguous),
    ("HDF5, chunks", hdf5::chunked),
];

/// Reads a file, in this folder if it must be there, and describes what is wrong with the outcome.
fn outcome(
    written: &Written,
    free: bool,
    valid: &Written,
    folder: &Path,
) -> std::result::Result<(), String> {
    let (name, bytes) = &written.files[0];
    let path = folder.join(name);
    if written.reader != Reader::Particles {
        for (name, bytes) in &written.files {
            fs::write(folder.join(name), bytes).expect("a file in a folder of our own");
        }
    }
    let read = || match written.reader {
        Reader::Particles => parse(Path::new(name), bytes),
        Reader::Frames => open(&path),
        Reader::Mesh => load(&path),
    };
    let length = written.files.iter().map(|(_, bytes)| bytes.len()).sum();
    let read = damage::within_memory(name, length, || catch_unwind(AssertUnwindSafe(read)));
    match read {
        Err(_) => Err("it panics".into()),
        Ok(Err(error)) => {
            let (code, message) = (error.category() as u8, error.to_string());
            let fine = [3, 4].contains(&code) && !message.contains('\n') && message.len() < 3000;
            if fine { Ok(()) } else { Err(format!("exit code {code}: {message}")) }
        }
        Ok(Ok(read)) => {
            let frames = valid.frames.len();
            let same = read.frames.len() == frames
                && read.frames.iter().zip(&valid.frames).all(|(found, all)| alike(found, all));
            if free || same || read.said {
                return Ok(());
            }
            let counts: Vec<usize> = read.frames.iter().map(Vec::len).collect();
            Err(format!("other particles, and nothing is said: {counts:?} in {frames} frames"))
        }
    }
}

/// Writes a mutant of HDF5 and what is read of it, if `LIMPID_HOSTILE_HDF5` is set.
fn keep_hdf5(written: &Written, valid: &Written, seed: usize) {
    let Some(folder) = std::env::var_os("LIMPID_HOSTILE_HDF5").map(PathBuf::from) else { return };
    let (name, bytes) = &written.files[0];
    let Some(kind) = name.strip_suffix(".h5") else { return };
    let text = |places: &[DVec3]| -> String {
        places.iter().map(|place| format!("{} {} {}\n", place.x, place.y, place.z)).collect()
    };
    let read = parse(Path::new(name), bytes);
    let read = match read.map(|read| (read.said, read.frames.concat())) {
        Ok((false, places)) => format!("read\n{}", text(&places)),
        _ => "refused, or something is said\n".into(),
    };
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join(format!("{kind}.valid")), text(&valid.frames.concat())).expect("a file");
    fs::write(folder.join(format!("{kind}-{seed}.h5")), bytes).expect("a file");
    fs::write(folder.join(format!("{kind}-{seed}.txt")), read).expect("a file");
}

/// Fields changed one at a time are noticed, whatever the format.
#[test]
fn changed_fields_are_refused_or_said() {
    let _lock = damage::counting();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut wrong = Vec::new();
    for (kind, write) in WRITERS {
        let mut fields = Fields::valid();
        let valid = write(&mut fields);
        let read = outcome(&valid, false, &valid, folder.path());
        assert_eq!(read, Ok(()), "{kind}: the valid file");
        let count = fields.seen();
        for seed in damage::rounds(500) {
            // Each field in turn, in another way each time.
            let mut fields = Fields::changing(seed % count, Random(seed as u64 * 0x9e37 + 1));
            let written = write(&mut fields);
            keep_hdf5(&written, &valid, seed);
            if let Err(problem) = outcome(&written, fields.is_free(), &valid, folder.path()) {
                let change = fields.change();
                wrong.push(format!("{kind}, LIMPID_SEED={seed}: {change}: {problem}"));
            }
        }
    }
    let count = wrong.len();
    wrong.truncate(200);
    assert_eq!(count, 0, "{count} mutants:\n{}", wrong.join("\n"));
}
