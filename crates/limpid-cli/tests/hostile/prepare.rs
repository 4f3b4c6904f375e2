//! Preparation of the files for the cases.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;

use limpid::glam::Vec3;
use limpid::liquid::Particles;

use super::{damage, files};

const FOUR_GIB: u64 = 4 << 30;

pub(crate) fn nothing(_: &Path) {}

pub(crate) fn write(path: impl AsRef<Path>, bytes: impl AsRef<[u8]>) {
    fs::write(path, bytes).expect("a file for a case");
}

/// Writes a sparse file of 4 GiB of zeros.
pub(crate) fn sparse(path: impl AsRef<Path>) {
    File::create(path).and_then(|file| file.set_len(FOUR_GIB)).expect("a file for a case");
}

/// Writes `water.xyz`, a block of 12 × 5 × 8 particles.
pub(crate) fn block(folder: &Path) {
    let mut text = String::new();
    for i in 0..12 * 5 * 8 {
        let [x, y, z] = [i % 12, i / 12 % 5, i / 60].map(|i| i as f32 * 0.05);
        writeln!(text, "{x} {y} {z}").expect("in memory");
    }
    write(folder.join("water.xyz"), text);
}

/// Writes the block with an additional line.
pub(crate) fn block_and(folder: &Path, line: &str) {
    block(folder);
    let path = folder.join("water.xyz");
    let text = fs::read_to_string(&path).expect("the block");
    write(path, text + line);
}

pub(crate) fn two_pictures(folder: &Path) {
    for (name, seed) in [("a.png", 1), ("b.png", 2)] {
        let mut random = damage::Random(seed);
        let picture = image::RgbImage::from_fn(160, 120, |_, _| {
            image::Rgb([(); 3].map(|()| random.below(256) as u8))
        });
        picture.save(folder.join(name)).expect("a picture");
    }
}

/// A chain of 80 gzip members, each of 16 MiB of zeros: 1.25 GiB.
pub(crate) fn bomb() -> Vec<u8> {
    files::gzip(&vec![0; 16 << 20]).repeat(80)
}

/// A VTU file whose many pieces share one block of 4 MiB of zeros.
pub(crate) fn shared_pieces() -> Vec<u8> {
    let positions = vec![0; 12 * 350_000];
    let packed = files::zlib(&positions);
    let header = [1, positions.len() as u32, 0, packed.len() as u32].map(u32::to_le_bytes).concat();
    let piece = "<Piece NumberOfPoints=\"350000\"><Points><DataArray type=\"Float32\" \
                 NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points></Piece>";
    let start = "<VTKFile type=\"PolyData\" compressor=\"vtkZLibDataCompressor\"><PolyData>";
    let end = "</PolyData><AppendedData encoding=\"raw\">_";
    [start.as_bytes(), piece.repeat(1000).as_bytes(), end.as_bytes(), &header, &packed].concat()
}

/// An archive whose only member is longer than its directory states.
pub(crate) fn lying_archive() -> Vec<u8> {
    use std::io::Write as _;
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file("x.npy", zip::write::SimpleFileOptions::default()).expect("in memory");
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (200000, 3), }\n";
    zip.write_all(b"\x93NUMPY\x01\x00").expect("in memory");
    zip.write_all(&(header.len() as u16).to_le_bytes()).expect("in memory");
    zip.write_all(header.as_bytes()).expect("in memory");
    zip.write_all(&vec![0; 2_400_000]).expect("in memory");
    let mut bytes = zip.finish().expect("in memory").into_inner();
    let entry = bytes.windows(4).rposition(|four| four == b"PK\x01\x02").expect("a directory");
    bytes[entry + 24..entry + 28].copy_from_slice(&100_u32.to_le_bytes());
    bytes
}

/// Writes `count` equal particles, which compress extremely well; as `.npz` with velocities and
/// densities.
pub(crate) fn many(folder: &Path, count: usize, name: &str) {
    let particles = Particles {
        velocities: name.ends_with(".npz").then(|| vec![Vec3::ZERO; count]),
        densities: name.ends_with(".npz").then(|| vec![1000.0; count]),
        ..Particles::from_positions(vec![Vec3::ONE; count])
    };
    limpid_io::particles::write(&particles, &folder.join(name)).expect("it can be written");
}

/// Writes `blank.png`, a black square, which compresses extremely well.
pub(crate) fn blank(folder: &Path, side: u32) {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8], contents: &[u8]| {
        let named = [name, contents].concat();
        let mut checksum = flate2::Crc::new();
        checksum.update(&named);
        png.extend((contents.len() as u32).to_be_bytes());
        png.extend(named);
        png.extend(checksum.sum().to_be_bytes());
    };
    let header = [&side.to_be_bytes()[..], &side.to_be_bytes(), &[8, 0, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    chunk(b"IDAT", &files::zlib(&vec![0; (side as usize + 1) * side as usize]));
    chunk(b"IEND", &[]);
    write(folder.join("blank.png"), png);
}

/// Writes `a.toml`, the block of water with the environment map `blank.png`.
pub(crate) fn blank_surroundings(folder: &Path) {
    block(folder);
    blank(folder, 12_000);
    let scene = "[particles]\nsource = \"water.xyz\"\n[environment]\nmap = \"blank.png\"\n";
    write(folder.join("a.toml"), scene);
}

pub(crate) fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().expect("mkfifo runs").success());
}

pub(crate) fn forbid(path: &Path) {
    fs::set_permissions(path, fs::Permissions::from_mode(0o000)).expect("it is ours");
}

/// Copies a file found by fuzzing.
pub(crate) fn found(folder: &Path, name: &str) {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/data/hostile");
    fs::copy(data.join(name), folder.join(name)).expect("it is there");
}

/// Copies a small simulation to `dam.toml`.
pub(crate) fn dam(folder: &Path) {
    let sims = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims");
    fs::copy(sims.join("dam_break.toml"), folder.join("dam.toml")).expect("it is there");
}
