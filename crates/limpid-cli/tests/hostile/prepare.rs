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
    let last = "</AppendedData></VTKFile>";
    let pieces = piece.repeat(1000);
    [start, &pieces, end]
        .map(str::as_bytes)
        .concat()
        .into_iter()
        .chain(header)
        .chain(packed)
        .chain(last.bytes())
        .collect()
}

/// Houdini's binary JSON: 200 million nulls in a list, packed in gzip members.
pub(crate) fn nulls() -> Vec<u8> {
    let start = b"\x7fNSJb[\x27\x0apointcount\x11\x01\x27\x04junk[";
    let members = files::gzip(&vec![0; 16 << 20]).repeat(12);
    [files::gzip(start), members, files::gzip(b"]]")].concat()
}

/// Writes `a.pvtu`, which lists `p.vtu`, a file of 5 million points in a few kilobytes, under forty names.
pub(crate) fn many_names(folder: &Path) {
    let positions = vec![0; 12 * 5_000_000];
    let packed = files::zlib(&positions);
    let header = [1, positions.len() as u32, 0, packed.len() as u32].map(u32::to_le_bytes).concat();
    let start = "<VTKFile type=\"UnstructuredGrid\" compressor=\"vtkZLibDataCompressor\"><UnstructuredGrid>\
                 <Piece NumberOfPoints=\"5000000\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" \
                 format=\"appended\" offset=\"0\"/></Points></Piece></UnstructuredGrid>\
                 <AppendedData encoding=\"raw\">_";
    let end = "</AppendedData></VTKFile>";
    write(folder.join("p.vtu"), [start.as_bytes(), &header, &packed, end.as_bytes()].concat());
    fs::create_dir(folder.join("d")).expect("a folder");
    let pieces = (0..40).map(|n| format!("<Piece Source=\"{}p.vtu\"/>", "d/../".repeat(n)));
    let pieces = pieces.collect::<String>();
    let list = format!("<VTKFile><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>");
    write(folder.join("a.pvtu"), list);
}

/// Writes `a.toml`, the block of water with the mesh `file`.
pub(crate) fn mesh(folder: &Path, file: &str) {
    block(folder);
    let scene = format!(
        "[particles]\nsource = \"water.xyz\"\n[[solid]]\nshape = \"mesh\"\nfile = \"{file}\"\n"
    );
    write(folder.join("a.toml"), scene);
}

/// Writes a mesh with five names of one picture of 81 million pixels.
pub(crate) fn textured(folder: &Path) {
    mesh(folder, "a.obj");
    blank(folder, 9_000);
    let (mut materials, mut faces) = (String::new(), String::new());
    for k in 0..5 {
        fs::hard_link(folder.join("blank.png"), folder.join(format!("b{k}.png"))).expect("a link");
        materials += &format!("newmtl m{k}\nmap_Kd b{k}.png\n");
        faces += &format!("usemtl m{k}\nf 1/1 2/1 3/1\n");
    }
    write(folder.join("a.mtl"), materials);
    write(
        folder.join("a.obj"),
        format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{faces}"),
    );
}

/// Writes a GLB with thirty images in one view, of 81 million pixels each.
pub(crate) fn images(folder: &Path) {
    mesh(folder, "a.glb");
    blank(folder, 9_000);
    let picture = fs::read(folder.join("blank.png")).expect("it is there");
    let corners: Vec<u8> = [0_f32, 0., 0., 1., 0., 0., 0., 1., 0.].map(f32::to_le_bytes).concat();
    let listed = |each: &dyn Fn(usize) -> String| (0..30).map(each).collect::<Vec<_>>().join(",");
    let json = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{{\"mesh\":0}}],\"buffers\":[{{\"byteLength\":{}}}],\
         \"bufferViews\":[{{\"buffer\":0,\"byteLength\":36}},{{\"buffer\":0,\"byteOffset\":36,\"byteLength\":{}}}],\
         \"accessors\":[{{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}}],\
         \"images\":[{}],\"textures\":[{}],\"materials\":[{}],\"meshes\":[{{\"primitives\":[{}]}}]}}",
        36 + picture.len(),
        picture.len(),
        listed(&|_| "{\"bufferView\":1,\"mimeType\":\"image/png\"}".into()),
        listed(&|k| format!("{{\"source\":{k}}}")),
        listed(&|k| format!(
            "{{\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{k}}}}}}}"
        )),
        listed(&|k| format!("{{\"attributes\":{{\"POSITION\":0}},\"material\":{k}}}")),
    );
    let padded = |mut bytes: Vec<u8>, with: u8| {
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, binary) = (padded(json.into_bytes(), b' '), padded([corners, picture].concat(), 0));
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let word = |number: usize| (number as u32).to_le_bytes();
    let mut glb =
        [&b"glTF"[..], &word(2), &word(length), &word(json.len()), b"JSON", &json].concat();
    glb.extend([&word(binary.len())[..], b"BIN\0", &binary].concat());
    write(folder.join("a.glb"), glb);
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
