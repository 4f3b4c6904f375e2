//! `cargo bench --bench readers`: time to read a million particles from each format, ms.
//!
//! The files are written to a temporary folder and are in the operating system's cache. Each figure
//! is the best of five in one run. The other columns are reading the file's bytes alone
//! (`fs::read`), a plain loop over them without any checks, and, where available, a target that
//! limpid must stay within a factor of two of: hand-written readers over memory maps, also without
//! checks, measured on another day on a machine of this kind.

use std::hint::black_box;
use std::io::Read;
use std::path::Path;
use std::time::Instant;

use flate2::read::MultiGzDecoder;
use glam::Vec3;
use limpid::liquid::{Ellipsoid, Particles};

const PARTICLES: usize = 1_000_000;
const RUNS: usize = 5;

/// Location of each attribute: its first byte and the stride between particles, bytes.
type Layout = Vec<(usize, usize)>;

fn main() -> limpid_io::Result<()> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let bare = Particles::from_positions(vectors(1.0));
    let moving = Particles { velocities: Some(vectors(9.81)), ..bare.clone() };
    let full = Particles {
        densities: Some(vec![998.5; PARTICLES]),
        radii: Some(vec![0.005; PARTICLES]),
        ids: Some((0..PARTICLES as i64).collect()),
        ..moving.clone()
    };
    let shaped = Particles {
        radii: Some(vec![0.005; PARTICLES]),
        ellipsoids: Some(vec![Ellipsoid { xx: 1.5, ..Ellipsoid::SPHERE }; PARTICLES]),
        ..bare.clone()
    };
    println!("{PARTICLES} particles, {} threads, ms\n", rayon::current_num_threads());
    println!(
        "{:26} {:>8} {:>8} {:>8} {:>8} {:>6}",
        "", "limpid", "fs::read", "loop", "figure", "ratio"
    );
    let cases = [
        ("bare.xyz", &bare, Some(0.9)),
        ("bare.npy", &bare, Some(5.4)),
        ("moving.bhclassic", &moving, Some(6.9)),
        ("moving.bgeo.gz", &moving, Some(122.4)),
        ("moving.vtk", &moving, Some(6.2)),
        ("moving.ply", &moving, Some(11.4)),
        ("moving.vtu", &moving, None),
        ("moving.npz", &moving, None),
        ("moving.csv", &moving, None),
        ("bare.pos", &bare, None),
        ("shaped.pos", &shaped, None),
        ("full.bhclassic", &full, None),
        ("full.vtk", &full, None),
        ("full.npz", &full, None),
    ];
    // `cargo bench --bench readers -- xyz vtk` measures these alone.
    let chosen: Vec<_> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    for (name, particles, figure) in cases {
        if !chosen.is_empty() && !chosen.iter().any(|part| name.contains(part)) {
            continue;
        }
        let path = folder.path().join(name);
        limpid_io::particles::write(particles, &path)?;
        assert_eq!(&limpid_io::particles::read(&path)?, particles, "{name}");
        let limpid = best(|| limpid_io::particles::read(&path).expect("it was read before"));
        let read = best(|| bytes(&path));
        let plain = layout(name, &bytes(&path)).map(|(layout, big_endian)| {
            best(|| {
                let bytes = unpacked(&path);
                layout.iter().map(|&at| plain_loop(&bytes, at, big_endian)).collect::<Vec<_>>()
            })
        });
        let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.1}"));
        let (plain, ratio) = (number(plain), figure.map(|figure| limpid / figure));
        let (figure, ratio) = (number(figure), number(ratio));
        println!("{name:26} {limpid:8.1} {read:8.1} {plain:>8} {figure:>8} {ratio:>6}");
    }
    Ok(())
}

/// Time of the fastest of several runs, ms.
fn best<T>(mut run: impl FnMut() -> T) -> f64 {
    let times = (0..RUNS).map(|_| {
        let start = Instant::now();
        black_box(run());
        start.elapsed().as_secs_f64() * 1e3
    });
    times.fold(f64::INFINITY, f64::min)
}

/// Random numbers that gzip cannot compress.
fn vectors(scale: f32) -> Vec<Vec3> {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        scale * (state as f32 / u32::MAX as f32 - 0.5)
    };
    (0..PARTICLES).map(|_| Vec3::new(random(), random(), random())).collect()
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("it was read before")
}

fn unpacked(path: &Path) -> Vec<u8> {
    let bytes = bytes(path);
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return bytes;
    }
    let mut unpacked = Vec::new();
    MultiGzDecoder::new(&bytes[..]).read_to_end(&mut unpacked).expect("it was read before");
    unpacked
}

/// Locates positions and velocities, and returns whether they are big-endian; only for formats that
/// a loop can read.
fn layout(name: &str, bytes: &[u8]) -> Option<(Layout, bool)> {
    const ROW: usize = size_of::<Vec3>();
    let from_end = |length: usize| bytes.len() - length;
    Some(match name {
        "bare.xyz" => (vec![(0, ROW)], false),
        "bare.npy" => (vec![(from_end(PARTICLES * ROW), ROW)], false),
        "bare.pos" => (vec![(8, ROW)], false),
        "moving.bhclassic" | "moving.bgeo.gz" => {
            let stride = ROW + 4 + ROW;
            let header = 41 + 2 + "velocity".len() + 2 + 4 + ROW;
            (vec![(header, stride), (header + ROW + 4, stride)], true)
        }
        "moving.ply" => {
            let header = from_end(PARTICLES * 2 * ROW);
            (vec![(header, 2 * ROW), (header + ROW, 2 * ROW)], false)
        }
        "moving.vtk" => {
            let points = format!("POINTS {PARTICLES} float\n");
            let found = bytes.windows(points.len()).position(|window| window == points.as_bytes());
            (vec![(found? + points.len(), ROW), (from_end(PARTICLES * ROW + 1), ROW)], true)
        }
        _ => return None,
    })
}

fn plain_loop(bytes: &[u8], (start, stride): (usize, usize), big_endian: bool) -> Vec<Vec3> {
    let number = |record: &[u8], k: usize| {
        let word = [record[4 * k], record[4 * k + 1], record[4 * k + 2], record[4 * k + 3]];
        if big_endian { f32::from_be_bytes(word) } else { f32::from_le_bytes(word) }
    };
    let records = bytes[start..].chunks(stride).take(PARTICLES);
    records
        .map(|record| Vec3::new(number(record, 0), number(record, 1), number(record, 2)))
        .collect()
}
