//! Robustness of all formats.

use std::fs;
use std::path::Path;

use limpid::mesh::Mesh;
use limpid_io::meshes::load;
use limpid_io::meshes::rigid_bodies::{read_bodies, read_poses};

use super::{gltf, obj, path, ply, stl};

/// One valid file of each kind.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("ascii.ply", ply::ply_ascii()),
        ("little.ply", ply::ply_binary("little")),
        ("big.ply", ply::ply_binary("big")),
        ("a.obj", obj::obj()),
        ("ascii.stl", stl::stl_ascii()),
        ("binary.stl", stl::stl_binary("solid")),
        ("a.gltf", gltf::embedded().to_string().into()),
        ("a.glb", gltf::box_glb()),
    ]
}

/// Loads a file that may be anything, and uses what was loaded.
fn survive(path: &Path, bytes: &[u8]) {
    fs::write(path, bytes).expect("a file");
    if let Ok(loaded) = load(path) {
        let data = loaded.data;
        assert!(!data.triangles.is_empty());
        for i in data.triangles.as_flattened() {
            assert!((*i as usize) < data.positions.len());
        }
        // Only triangles without area are left to find.
        if let Err(error) = Mesh::new(data) {
            assert!(error.to_string().contains("no triangle with an area"), "{error}");
        }
    }
}

/// A generator of numbers that is the same everywhere (Marsaglia, "Xorshift RNGs", 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % limit as u64) as usize
    }
}

#[test]
fn all_formats_are_the_same_box() {
    for (name, bytes) in samples() {
        super::check_box(name, super::read(name, &bytes).unwrap());
    }
}

#[test]
fn truncated_files_do_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in samples() {
        for length in 0..bytes.len() {
            survive(&path(&folder, name), &bytes[..length]);
        }
    }
}

#[test]
fn damaged_files_do_no_harm() {
    const ROUNDS: usize = 1500;
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    for (name, bytes) in samples() {
        for _ in 0..ROUNDS {
            let mut damaged = bytes.clone();
            for _ in 0..1 + random.below(4) {
                let at = random.below(damaged.len());
                match random.below(4) {
                    0 => damaged[at] ^= 1 << random.below(8),
                    1 => damaged[at] = random.below(256) as u8,
                    // Digits stay numbers in text.
                    2 => damaged[at] = b'0' + random.below(10) as u8,
                    _ => {
                        let end = (at + 4).min(damaged.len());
                        damaged[at..end].fill([0, 0xff, 0x7f, 0x80][random.below(4)]);
                    }
                }
            }
            survive(&path(&folder, name), &damaged);
        }
    }
}

#[test]
fn junk_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(1);
    for name in limpid_io::meshes::EXTENSIONS.map(|extension| format!("a.{extension}")) {
        for round in 0..200 {
            let junk: Vec<u8> = (0..random.below(2000)).map(|_| random.below(256) as u8).collect();
            survive(&path(&folder, &name), &junk);
            let text: Vec<u8> = junk
                .iter()
                .map(|&byte| b"0123456789 -./e\nvftn{}[]:,\""[byte as usize % 27])
                .collect();
            survive(&path(&folder, &name), &text);
            for start in
                [&b"ply\nformat ascii 1.0\n"[..], b"solid\n", b"glTF\x02\0\0\0", b"{\"asset\":"]
            {
                survive(&path(&folder, &name), &[start, &junk].concat());
            }
            let file = path(&folder, "rb_data_1.bin");
            fs::write(&file, &junk).unwrap();
            assert!(read_bodies(&file).is_err() && read_poses(&file, round + 1).is_err());
        }
    }
}

/// The memory that the process has reserved at most stays far below what the damaged counts declare.
#[test]
#[cfg(target_os = "linux")]
fn counts_of_billions_take_no_memory() {
    let peak = || {
        let status = fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find(|line| line.starts_with("VmPeak:")).unwrap();
        line.split_ascii_whitespace().nth(1).unwrap().parse::<u64>().unwrap() >> 10
    };
    let folder = tempfile::tempdir().unwrap();
    let before = peak();
    for (name, bytes) in samples() {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        for (from, to) in [
            ("vertex 8", "vertex 4000000000"),
            ("face 6", "face 4000000000"),
            ("\"count\":8", "\"count\":4000000000"),
            ("\"count\":36", "\"count\":4000000000"),
            ("\"byteLength\":96", "\"byteLength\":4000000000"),
            ("\n4 0", "\n4000000000 0"),
        ] {
            survive(&path(&folder, name), text.replace(from, to).as_bytes());
        }
        for at in 0..bytes.len().saturating_sub(4) {
            let mut large = bytes.clone();
            large[at..at + 4].copy_from_slice(&4_000_000_000_u32.to_le_bytes());
            survive(&path(&folder, name), &large);
        }
    }
    let taken = peak() - before;
    assert!(taken < 2048, "{taken} MiB");
}
