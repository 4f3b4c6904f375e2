//! Readers of mesh files. Each format and layout yields the triangles encoded in it, and all agree on which
//! way faces and textures are turned; errors of damaged and foreign files name the file, the place and the
//! remedy; and no file makes a reader panic, loop, or allocate memory by its declared counts alone. A program
//! of its own, since it measures the memory of the process.

mod all_formats;
mod gltf;
mod obj;
mod ply;
mod rigid_bodies;
mod stl;
mod textures;

use std::fs;
use std::path::{Path, PathBuf};

use limpid::glam::DVec3;
use limpid::mesh::{Mesh, MeshData};
use limpid_io::meshes::{LoadedMesh, load};
use limpid_io::{Error, Result};
use tempfile::TempDir;

/// Corners of a box whose sides differ: bits 0, 1 and 2 of the index are along x, y and z.
fn box_positions() -> [[f64; 3]; 8] {
    let bit = |i: usize, k: usize| ((i >> k) & 1) as f64;
    std::array::from_fn(|i| [bit(i, 0) - 0.5, 2.0 * bit(i, 1), 3.0 * bit(i, 2) + 1.0])
}

/// Its faces, counterclockwise as seen from outside.
const BOX_FACES: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

fn box_triangles() -> Vec<[u32; 3]> {
    BOX_FACES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

/// Corners of all triangles, in order.
fn corners(data: &MeshData) -> Vec<[DVec3; 3]> {
    data.triangles.iter().map(|t| t.map(|i| data.positions[i as usize])).collect()
}

fn box_corners() -> Vec<[DVec3; 3]> {
    let positions = box_positions().map(DVec3::from);
    box_triangles().iter().map(|t| t.map(|i| positions[i as usize])).collect()
}

/// Whether a mesh is the box, closed and outwards.
fn check_box(name: &str, loaded: LoadedMesh) {
    assert_eq!(corners(&loaded.data), box_corners(), "{name}");
    let mesh = Mesh::new(loaded.data).expect("a mesh");
    assert!(mesh.is_closed(), "{name}");
    let middle = DVec3::new(0.0, 1.0, 2.5);
    assert_eq!(mesh.origin(), middle, "{name}");
}

/// A folder with some files.
fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("a file");
    }
    folder
}

/// Loads the first of some files.
fn load_files(files: &[(&str, &[u8])]) -> Result<LoadedMesh> {
    let folder = folder(files);
    load(&folder.path().join(files[0].0))
}

fn read(name: &str, bytes: &[u8]) -> Result<LoadedMesh> {
    load_files(&[(name, bytes)])
}

/// Checks the error of a file, which must name it.
fn check_message(name: &str, bytes: &[u8], fragments: &[&str]) {
    let text = match read(name, bytes) {
        Ok(mesh) => panic!("{name}: an error expected, got {mesh:?}"),
        Err(error) => error.to_string(),
    };
    for fragment in fragments.iter().chain([&name]) {
        assert!(text.contains(fragment), "{fragment:?} not in: {text}");
    }
}

fn le<const N: usize>(numbers: [f32; N]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

fn path(folder: &TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

#[test]
fn unknown_and_missing_files_are_errors() {
    check_message("a.fbx", b"Kaydara", &["not a kind of mesh", ".glb, .gltf, .obj, .ply, .stl"]);
    check_message("mesh", b"", &["not a kind of mesh"]);
    let error = load(Path::new("no-such.obj")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().contains("no-such.obj"));
    let folder = tempfile::tempdir().unwrap();
    for extension in limpid_io::meshes::EXTENSIONS {
        let path = folder.path().join(format!("folder.{extension}"));
        fs::create_dir(&path).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(error.contains("this is a folder"), "{error}");
    }
}
