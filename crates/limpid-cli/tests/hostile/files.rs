//! Small valid files of every kind, from which damaged files are made.

use std::io::Write as _;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::write::{GzEncoder, ZlibEncoder};
use limpid::glam::{DVec3, Vec3};
use limpid::liquid::{Ellipsoid, Particles};

/// A file's name, whose extension selects the reader, and its contents.
pub(crate) type Contents = (String, Vec<u8>);

/// A few particles with every attribute.
pub(crate) fn water() -> Particles {
    let n = 3;
    let vectors = |x: f32| (0..n).map(|i| Vec3::new(x * i as f32, 0.5, -x)).collect::<Vec<_>>();
    Particles {
        velocities: Some(vectors(2.0)),
        densities: Some(vec![1000.0; n]),
        radii: Some(vec![0.05; n]),
        ids: Some((7..).take(n).collect()),
        ellipsoids: Some(vec![Ellipsoid::SPHERE; n]),
        ..Particles::from_positions(vectors(0.1))
    }
}

/// Particle files by limpid's writers, and with features that only other programs write.
pub(crate) fn particles() -> Vec<Contents> {
    let far: Vec<_> = (0..3).map(|i| DVec3::new(1e7 + 0.1 * f64::from(i), 0.2, 0.3)).collect();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut files = Vec::new();
    for (name, particles) in
        [("water", water()), ("far", Particles::from_places(&far)), ("none", Particles::default())]
    {
        for kind in ["bhclassic", "bgeo", "vtk", "vtu", "ply", "npy", "npz", "xyz", "pos", "csv"] {
            let name = format!("{name}.{kind}");
            let path = folder.path().join(&name);
            limpid_io::particles::write(&particles, &path).expect("it can be written");
            files.push((name, std::fs::read(path).expect("it can be read")));
        }
    }
    for (name, text) in [
        ("text.xyz", "0 0 0\n1.5 2 3e-1\n"),
        (
            "text.vtk",
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n0 0 0 1 1 1\n\
             VERTICES 2 4\n1 0 1 1\nMETADATA\nINFORMATION 0\n\nPOINT_DATA 2\nSCALARS id int 1\n\
             LOOKUP_TABLE default\n1 2\nVECTORS velocity double\n1 2 3 4 5 6\nFIELD f 1\n\
             rho 1 2 float\n1 2\n",
        ),
        (
            "split.vtk",
            "# vtk DataFile Version 5.1\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n\
             0 0 0\nCELLS 2 1\nOFFSETS vtktypeint64\n0 1\nCONNECTIVITY vtktypeint64\n0\n\
             CELL_TYPES 1\n1\n",
        ),
        (
            "text.ply",
            "ply\nformat ascii 1.0\ncomment c\nelement face 1\nproperty list uchar int i\n\
             element vertex 2\nproperty float x\nproperty float y\nproperty double z\n\
             property list uchar int l\nproperty float vx\nproperty float vy\nproperty float vz\n\
             end_header\n3 0 1 2\n0 0 0 1 5 1 2 3\n1 1 1 0 1 2 3\n",
        ),
    ] {
        files.push((name.into(), text.into()));
    }
    let lists = "ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list uchar int i\n\
                 element vertex 1\nproperty float x\nproperty float y\nproperty double z\n\
                 property list uchar short l\nend_header\n";
    files.push(("lists.ply".into(), [lists.as_bytes(), &[1], &[0; 20], &[2], &[0; 4]].concat()));
    let zipped = {
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        zip.start_file("x.npy", zip::write::SimpleFileOptions::default()).expect("in memory");
        let (_, array) = &files[5];
        zip.write_all(array).expect("in memory");
        zip.finish().expect("in memory").into_inner()
    };
    files.push(("deflated.npz".into(), zipped));
    files.extend(xml());
    files.extend(of_other_programs());
    for (name, text) in [
        ("text.extxyz", "2\nProperties=pos:R:3:velo:R:3:id:I:1\n0 0 0 1 2 3 4\n1 1 1 1 2 3 5\n"),
        (
            "text.lammpstrj",
            "ITEM: TIMESTEP\n5\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS pp pp pp\n0 1\n0 1\n0 1\n\
             ITEM: ATOMS id xs ys zs\n1 0.1 0.2 0.3\n2 0.4 0.5 0.6\n",
        ),
        (
            "parcels.positions",
            "FoamFile { version 2.0; format ascii; class Cloud<kinematicCloud>; object positions; }\n\
             2\n(\n(0 0 0) 1\n(1 1 1) 2\n)\n",
        ),
    ] {
        files.push((name.into(), text.into()));
    }
    let packed = include_bytes!("../../../../tests/data/formats/vtk_lzma_appended.vtu");
    files.push(("lzma.vtu".into(), packed.into()));
    files.push(("plain.h5".into(), PLAIN_HDF5.into()));
    files
}

/// Files that limpid does not write, of `tests/data/formats`.
fn of_other_programs() -> Vec<Contents> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/formats"));
    let names = [
        "houdini.bgeo",
        "houdini.bgeo.sc",
        "houdini.geo",
        "Part_0005.bi4",
        "krakatoa.prt",
        "mantaflow.uni",
        "h5py_soft_links.h5",
        "h5py_layout_5.h5",
    ];
    let read = |name| std::fs::read(folder.join(name)).expect("a file of the repository");
    names.map(|name| (name.to_owned(), read(name))).into()
}

/// HDF5 by h5py, with four arrays.
pub(crate) const PLAIN_HDF5: &[u8] = include_bytes!("../../../../tests/data/formats/plain.h5");

/// VTK XML files in encodings that limpid does not write.
fn xml() -> Vec<Contents> {
    let positions = [0.0_f32, 0.0, 0.0, 1.0, 1.0, 1.0].map(f32::to_le_bytes).concat();
    let words =
        |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    let packed = zlib(&positions);
    let header = words(&[1, 24, 0, packed.len() as u32]);
    let base64 = |bytes: &[u8]| BASE64_STANDARD.encode(bytes);
    let document = |attributes: &str, data: &str| {
        let text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\"{attributes}>\
             <UnstructuredGrid><Piece NumberOfPoints=\"2\" NumberOfCells=\"0\"><PointData>\
             <DataArray type=\"Int32\" Name=\"id\" format=\"ascii\">1 2</DataArray></PointData>\
             <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" {data}</DataArray></Points>\
             </Piece></UnstructuredGrid>"
        );
        text.into_bytes()
    };
    let inline = |attributes: &str, data: String| {
        let mut text = document(attributes, &format!("format=\"binary\">{data}"));
        text.extend(b"</VTKFile>");
        text
    };
    let mut raw = document("", "format=\"appended\" offset=\"0\">");
    raw.extend(b"<AppendedData encoding=\"raw\">_");
    raw.extend(words(&[24]));
    raw.extend(&positions);
    raw.extend(b"</AppendedData></VTKFile>");
    vec![
        ("plain.vtu".into(), inline("", base64(&[words(&[24]), positions.clone()].concat()))),
        (
            "packed.vtu".into(),
            inline(" compressor=\"vtkZLibDataCompressor\"", base64(&header) + &base64(&packed)),
        ),
        ("raw.vtu".into(), raw),
    ]
}

/// Pictures for environment maps and comparisons.
pub(crate) fn pictures() -> Vec<Contents> {
    use exr::prelude::*;
    use image::{DynamicImage, ImageFormat};
    let mut files = Vec::new();
    let small = DynamicImage::new_rgb8(5, 3);
    for (name, picture) in [
        ("rgb8", small.clone()),
        ("rgba8", small.to_rgba8().into()),
        ("grey16", small.to_luma16().into()),
        ("rgb16", small.to_rgb16().into()),
    ] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png).expect("in memory");
        files.push((format!("{name}.png"), bytes.into_inner()));
    }
    let head = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n-Y 2 +X 8\n";
    files.push(("flat.hdr".into(), [head.as_bytes(), &[7; 64]].concat()));
    let line = [&[2, 2, 0, 8][..], &[0x84, 16, 4, 1, 2, 3, 4].repeat(4)].concat();
    files.push(("packed.hdr".into(), [head.as_bytes(), &line, &line].concat()));
    for (name, compression) in [
        ("none", Compression::Uncompressed),
        ("rle", Compression::RLE),
        ("zip", Compression::ZIP16),
        ("piz", Compression::PIZ),
        ("pxr24", Compression::PXR24),
        ("b44", Compression::B44),
    ] {
        let pixels = SpecificChannels::rgb(|at: Vec2<usize>| {
            (f16::from_f32(at.0 as f32), f16::from_f32(at.1 as f32), f16::from_f32(0.5))
        });
        let encoding = Encoding { compression, ..Encoding::SMALL_LOSSLESS };
        let layer = Layer::new((9, 5), LayerAttributes::named("a"), encoding, pixels);
        let mut bytes = std::io::Cursor::new(Vec::new());
        let image = Image::from_layer(layer);
        image.write().non_parallel().to_buffered(&mut bytes).expect("in memory");
        files.push((format!("{name}.exr"), bytes.into_inner()));
    }
    files
}

/// A scene with nearly every key.
pub(crate) const SCENE: &str = r#"
[particles]
source = "water.xyz"
frame = 1
radius = 0.05
up = "z"
fps = 24
[liquid]
ior = 1.3
color = [0.5, 0.6, 0.7]
[camera]
eye = [1, 2, 3]
target = [0, 0, 0]
fov_y = 40
near = 0.1
[[view]]
name = "side"
camera = { eye = [1, 2, 3], target = [0, 0, 0], fov_y = 40 }
[environment]
gradient = { zenith = [1, 1, 1], horizon = [1, 1, 1], nadir = [0, 0, 0] }
scale = 2
[[solid]]
shape = "plane"
origin = [0, 0, 0]
checker = { tile = 0.1, even = [0, 0, 0], odd = [1, 1, 1] }
[[solid]]
shape = "box"
min = [0, 0, 0]
max = [1, 1, 1]
[[solid]]
shape = "sphere"
center = [0, 0, 0]
radius = 1
color = [1, 0, 0]
lit = true
[[light]]
sun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }
[[light]]
point = { position = [0, 1, 0], intensity = [1, 1, 1] }
[settings]
preset = "imai2016"
refract.samples = 2
"#;

/// A camera path.
pub(crate) const PATH: &str = "
[[key]]
time = 0.0
eye = [3.0, 2.0, 4.0]
target = [0, 1, 0]
[[key]]
time = 2.5
eye = [-3, 2, 4]
target = [0, 1, 0]
up = [0, 0, 1]
fov_y = 60
near = 0.1
[[key]]
time = 3
eye = [1, 1, 1]
target = [0, 0, 0]
";

/// Scenes of `sims/`, the golden suite, [`SCENE`] and [`PATH`].
pub(crate) fn texts() -> Vec<Contents> {
    let sims = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims");
    let names = ["demo.toml", "vase.toml", "cascade.toml"];
    let sims = names
        .iter()
        .filter_map(|name| Some((format!("{name}.scene"), std::fs::read(sims.join(name)).ok()?)));
    let golden =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("tests/golden/limpid.toml");
    let golden = std::fs::read(golden).map(|text| ("golden.suite".into(), text));
    let own = [("all.scene", SCENE), ("a.path", PATH)];
    sims.chain(golden.ok()).chain(own.map(|(name, text)| (name.into(), text.into()))).collect()
}

pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).expect("in memory");
    encoder.finish().expect("in memory")
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).expect("in memory");
    encoder.finish().expect("in memory")
}
