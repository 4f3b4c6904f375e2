//! VTK XML files, `.vtu` and `.vtp`: every encoding of arrays, in any number of pieces.

use std::io::Write;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::Vec3;
use limpid::liquid::Particles;

use super::{
    DENSITIES, IDS, POSITIONS, RADII, Reversed, VELOCITIES, all_attributes, check_message, patched,
    read,
};

/// Storage of a file's arrays.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Stored {
    Ascii,
    Inline,
    AppendedBase64,
    AppendedRaw,
}

/// Format of the arrays' headers.
#[derive(Clone, Copy)]
pub(crate) struct Headers {
    /// Big-endian.
    pub(crate) big: bool,
    /// 64-bit header words.
    pub(crate) long: bool,
    /// Size of the blocks that zlib compresses, bytes.
    pub(crate) zlib: Option<usize>,
    /// The length is base64-encoded separately from the data.
    pub(crate) apart: bool,
}

pub(crate) const PLAIN: Headers = Headers { big: false, long: false, zlib: None, apart: false };

impl Headers {
    fn words(&self, words: &[usize]) -> Vec<u8> {
        let word = |&word: &usize| match (self.long, self.big) {
            (true, true) => (word as u64).to_be_bytes().to_vec(),
            (true, false) => (word as u64).to_le_bytes().to_vec(),
            (false, true) => (word as u32).to_be_bytes().to_vec(),
            (false, false) => (word as u32).to_le_bytes().to_vec(),
        };
        words.iter().flat_map(word).collect()
    }

    /// The header and the data of an array.
    fn split(&self, bytes: &[u8]) -> (Vec<u8>, Vec<u8>) {
        let Some(size) = self.zlib else { return (self.words(&[bytes.len()]), bytes.to_vec()) };
        let blocks: Vec<_> = bytes.chunks(size).map(zlib).collect();
        let mut words = vec![blocks.len(), size, bytes.len() % size];
        words.extend(blocks.iter().map(Vec::len));
        (self.words(&words), blocks.concat())
    }

    fn raw(&self, bytes: &[u8]) -> Vec<u8> {
        let (header, data) = self.split(bytes);
        [header, data].concat()
    }

    fn base64(&self, bytes: &[u8]) -> String {
        let (header, data) = self.split(bytes);
        if self.apart || self.zlib.is_some() {
            return BASE64_STANDARD.encode(header) + &BASE64_STANDARD.encode(data);
        }
        BASE64_STANDARD.encode([header, data].concat())
    }
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A file whose pieces have these numbers of particles.
pub(crate) fn vtu(kind: &str, pieces: &[usize], stored: Stored, headers: Headers) -> Vec<u8> {
    let order = if headers.big { "BigEndian" } else { "LittleEndian" };
    let header_type = if headers.long { "UInt64" } else { "UInt32" };
    let compressor =
        if headers.zlib.is_some() { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    let mut xml = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" \
         byte_order=\"{order}\" header_type=\"{header_type}\"{compressor}>\n<{kind}>\n"
    );
    let mut appended = Vec::new();
    let mut array = |name: &str, size: usize, numbers: &[f32], integers: bool| {
        let kind = if integers { "Int32" } else { "Float32" };
        let word = |&number: &f32| {
            let word = if integers { (number as i32).to_be_bytes() } else { number.to_be_bytes() };
            if headers.big { word } else { word.map_reverse() }
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(word).collect();
        let tag = format!("<DataArray type='{kind}' Name='{name}' NumberOfComponents='{size}'");
        let information =
            "<InformationKey name='RANGE'><Value index='0'> 7 </Value></InformationKey>";
        match stored {
            Stored::Ascii => {
                let text: Vec<String> = numbers.iter().map(f32::to_string).collect();
                format!("{tag} format='ascii'>\n{}\n{information}</DataArray>\n", text.join(" "))
            }
            Stored::Inline => {
                let text = headers.base64(&bytes);
                format!("{tag} format='binary'>{information}\n  {text}\n</DataArray>\n")
            }
            Stored::AppendedBase64 | Stored::AppendedRaw => {
                let offset = appended.len();
                if stored == Stored::AppendedRaw {
                    appended.extend(headers.raw(&bytes));
                } else {
                    appended.extend(headers.base64(&bytes).into_bytes());
                }
                format!("{tag} format='appended' offset='{offset}'/>\n")
            }
        }
    };
    let mut first = 0;
    for &n in pieces {
        let range = || first..first + n;
        xml += &format!("<Piece NumberOfPoints='{n}' NumberOfCells='{n}'>\n<PointData>\n");
        xml += &array("velocity", 3, VELOCITIES[range()].as_flattened(), false);
        xml += &array("pressure", 1, &RADII[range()], false);
        xml += &array("density", 1, &DENSITIES[range()], false);
        xml += &array("radius", 1, &RADII[range()], false);
        let ids: Vec<f32> =
            IDS[range()].iter().map(|&id| if id > 99 { 99.0 } else { id as f32 }).collect();
        xml += &array("id", 1, &ids, true);
        xml += "</PointData>\n<CellData/>\n<Points>\n";
        xml += &array("Points", 3, POSITIONS[range()].as_flattened(), false);
        xml += "</Points>\n<Cells>\n";
        xml += &array("density", 1, &[0.5], false); // not an array of the points
        xml += "</Cells>\n</Piece>\n";
        first += n;
    }
    xml += &format!("</{kind}>\n");
    let mut bytes = xml.into_bytes();
    if matches!(stored, Stored::AppendedBase64 | Stored::AppendedRaw) {
        let encoding = if stored == Stored::AppendedRaw { "raw" } else { "base64" };
        bytes.extend(format!("<AppendedData encoding=\"{encoding}\">\n  _").bytes());
        bytes.extend(appended);
        bytes.extend(b"\n</AppendedData>\n");
    }
    bytes.extend(b"</VTKFile>\n");
    bytes
}

/// The attributes in [`vtu`], whose ids must be exact in 32-bit floats.
fn vtu_attributes() -> Particles {
    Particles { ids: Some(vec![7, -1, 99]), ..all_attributes() }
}

#[test]
fn vtu_variants() {
    let whole = [3];
    let long = Headers { long: true, ..PLAIN };
    let big = Headers { big: true, ..PLAIN };
    let zlib = |size| Headers { zlib: Some(size), ..PLAIN };
    let variants = [
        (Stored::Ascii, PLAIN),
        (Stored::Inline, PLAIN),
        (Stored::Inline, Headers { apart: true, ..PLAIN }),
        (Stored::Inline, Headers { apart: true, ..long }),
        (Stored::Inline, Headers { zlib: Some(8), ..long }),
        (Stored::Inline, zlib(12)),
        (Stored::AppendedBase64, PLAIN),
        (Stored::AppendedBase64, long),
        (Stored::AppendedBase64, Headers { big: true, ..long }),
        (Stored::AppendedBase64, zlib(1 << 15)),
        (Stored::AppendedRaw, big),
        (Stored::AppendedRaw, long),
        (Stored::AppendedRaw, Headers { big: true, ..zlib(4) }),
        (Stored::AppendedRaw, Headers { zlib: Some(36), ..long }),
    ];
    for (i, (stored, headers)) in variants.into_iter().enumerate() {
        let read = |kind: &str, pieces: &[_]| {
            let name = if kind == "PolyData" { "a.vtp" } else { "a.vtu" };
            let particles = read(name, &vtu(kind, pieces, stored, headers));
            particles.unwrap_or_else(|error| panic!("variant {i}: {error}"))
        };
        assert_eq!(read("UnstructuredGrid", &whole), vtu_attributes(), "variant {i}");
        assert_eq!(read("PolyData", &whole), vtu_attributes(), "variant {i}");
        let marked = [b"\xef\xbb\xbf", &*vtu("PolyData", &whole, stored, headers)].concat();
        assert_eq!(
            super::read("a.vtp", &marked).unwrap(),
            vtu_attributes(),
            "variant {i}, byte order mark"
        );
        let pieces = [1, 0, 2];
        assert_eq!(read("UnstructuredGrid", &pieces), vtu_attributes(), "variant {i} in pieces");
        assert_eq!(read("UnstructuredGrid", &[0]).len(), 0, "variant {i} of nothing");
        assert_eq!(read("UnstructuredGrid", &[]), Particles::default(), "variant {i} of no piece");
    }
}

/// A base64 array of two positions, encoded by hand.
#[test]
fn vtu_encoded_by_hand() {
    let file = |array: &str| {
        format!(
            "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\"><PolyData>\
             <Piece NumberOfPoints=\"2\"><Points>{array}</Points></Piece></PolyData></VTKFile>"
        )
    };
    let array = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"binary\">\
        GAAAAAAAgD8AAABAAABAQAAAgEAAAKBAAADAQA==</DataArray>";
    let places = vec![Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
    let expected = Particles::from_positions(places);
    assert_eq!(read("a.vtp", file(array).as_bytes()).unwrap(), expected);
    let doubles =
        "<DataArray type=\"Float64\" NumberOfComponents=\"3\">1 2 3\n4 5. 6e0</DataArray>";
    assert_eq!(read("a.vtp", file(doubles).as_bytes()).unwrap(), expected);
}

#[test]
fn vtu_malformed() {
    let text = String::from_utf8(vtu("PolyData", &[3], Stored::Ascii, PLAIN)).unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1).into_bytes()
    };
    let check = |from: &str, to: &str, fragments: &[&str]| {
        check_message("a.vtp", &with(from, to), fragments);
    };
    check("Points='3'", "Points='4'", &["byte", "velocity", "4 × 3 numbers", "found 9"]);
    check("Points='3'", "Points='-3'", &["byte", "NumberOfPoints", "count", "-3"]);
    check("Points='3'", "Points='18446744073709551615'", &["byte", "velocity"]);
    check("0.5 -1.25", "x -1.25", &["byte", "Points", "number", "`x`"]);
    check("type='Float32'", "type='String'", &["byte", "number type", "`String`"]);
    check("format='ascii'", "format='hex'", &["byte", "`hex`"]);
    check("format='ascii'", "format='appended' offset='9'", &["byte", "no appended data"]);
    check(
        "type=\"PolyData\"",
        "type=\"ImageData\"",
        &["`ImageData`", "expected UnstructuredGrid or PolyData"],
    );
    check("UInt32", "UInt16", &["byte", "header type `UInt16`"]);
    check("LittleEndian", "Middle", &["byte", "byte order `Middle`"]);
    check("</VTKFile>", "", &["byte", "ends before </VTKFile>"]);
    check("</Points>", "</Point>", &["byte", "not XML"]);
    check("<VTKFile", "<Html", &["not VTK's"]);
    let future = with("header_type", "compressor='vtkFutureDataCompressor' header_type");
    check_message("a.vtp", &future, &["vtkFutureDataCompressor", "zlib, LZ4, LZMA or none"]);

    let raw = |headers: Headers| vtu("UnstructuredGrid", &[3], Stored::AppendedRaw, headers);
    let length = patched(&raw(PLAIN), &[b'_', 36, 0, 0, 0], &[b'_', 37, 0, 0, 0]);
    check_message("a.vtu", &length, &["byte", "expected 36 bytes, 37 announced"]);
    let beyond = patched(&raw(PLAIN), b"offset='0'", b"offset='18446744073709551615'");
    check_message("a.vtu", &beyond, &["byte", "beyond the file"]);
    let zlib = raw(Headers { zlib: Some(36), ..PLAIN });
    let start = [&b"_"[..], [1_u32, 36, 0].map(u32::to_le_bytes).as_flattened()].concat();
    let header = |words: [u32; 3]| {
        patched(&zlib, &start, &[&b"_"[..], words.map(u32::to_le_bytes).as_flattened()].concat())
    };
    check_message("a.vtu", &header([2, 36, 0]), &["byte", "velocity", "2 blocks of 36"]);
    check_message("a.vtu", &header([u32::MAX, 36, 0]), &["byte", "velocity", "announced"]);
    check_message("a.vtu", &header([36, 1, 0]), &["byte", "velocity"]);
    let block = patched(&zlib, &[0x78, 0x01], &[0x78, 0x02]);
    check_message("a.vtu", &block, &["byte", "velocity", "block 0"]);

    // Declared sizes must agree with each other and be possible.
    let claims = Headers { long: true, zlib: Some(36), ..PLAIN };
    let claims = patched(&raw(claims), b"Points='3'", b"Points='300000000000'");
    check_message("a.vtu", &claims, &["byte", "velocity", "expected 3600000000000 bytes"]);
    let words = |words: [u64; 3]| [&b"_"[..], words.map(u64::to_le_bytes).as_flattened()].concat();
    let claims = patched(&claims, &words([1, 36, 0]), &words([1, 3_600_000_000_000, 0]));
    check_message("a.vtu", &claims, &["byte", "velocity", "cannot be in"]);
}

/// Data of cells are those of points where each point has a vertex cell of its own, in `.vtu` and `.vtp`, over pieces;
/// data of other cells are listed as ignored.
#[test]
fn data_of_vertex_cells() {
    let array = |kind: &str, name: &str, numbers: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">{numbers}</DataArray>")
    };
    let piece = |kind: &str, order: &str, types: &str, density: &str| {
        let places = "<DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0</DataArray>";
        let connectivity =
            array("Int64", "connectivity", order) + &array("Int64", "offsets", "1 2");
        let (counts, cells) = match kind {
            "PolyData" => ("NumberOfVerts=\"2\"", format!("<Verts>{connectivity}</Verts>")),
            _ => {
                let types = array("UInt8", "types", types);
                ("NumberOfCells=\"2\"", format!("<Cells>{connectivity}{types}</Cells>"))
            }
        };
        let data = array("Float32", "density", density) + &array("Float32", "p", density);
        format!(
            "<Piece NumberOfPoints=\"2\" {counts}><CellData>{data}</CellData><Points>{places}</Points>{cells}</Piece>"
        )
    };
    let file = |kind: &str, pieces: &[String]| {
        let pieces = pieces.concat();
        format!("<VTKFile type=\"{kind}\"><{kind}>{pieces}</{kind}></VTKFile>")
    };
    let read = |text: &str| {
        let options = limpid_io::particles::ReadOptions::default();
        let path = std::path::Path::new("a.vtu");
        limpid_io::particles::Contents::parse(path, text.as_bytes(), &options).expect("valid")
    };
    for kind in ["UnstructuredGrid", "PolyData"] {
        let pieces = [piece(kind, "1 0", "1 1", "7 8"), piece(kind, "0 1", "1 1", "9 10")];
        let own = read(&file(kind, &pieces));
        assert_eq!(own.particles.densities, Some(vec![8.0, 7.0, 9.0, 10.0]), "{kind}");
        assert!(own.arrays.iter().any(|array| array.to_string() == "p (4)"));
        let twice = read(&file(kind, &[piece(kind, "1 1", "1 1", "7 8")]));
        assert_eq!(twice.particles.densities, None, "{kind}");
        assert!(twice.arrays.iter().any(|array| array.to_string() == "density (2)"));
    }
    let lines = read(&file("UnstructuredGrid", &[piece("UnstructuredGrid", "1 0", "3 3", "7 8")]));
    assert_eq!((lines.particles.densities, lines.cells), (None, 2));
}

/// Entities in attributes stand for their characters, in names of arrays and of listed files; an ampersand alone
/// stands for itself.
#[test]
fn entities_are_characters() {
    let folder = tempfile::tempdir().unwrap();
    let piece = "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"1\"><PointData><DataArray \
                 type=\"Float32\" Name=\"&#114;h&#x6f;\" format=\"ascii\">7</DataArray></PointData><Points><DataArray \
                 type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">1 2 3</DataArray></Points></Piece></PolyData>\
                 </VTKFile>";
    for (name, written) in [
        ("a&b.vtp", "a&amp;b.vtp"),
        ("a<b.vtp", "a&lt;b.vtp"),
        ("a'b.vtp", "a&apos;b.vtp"),
        ("c&d.vtp", "c&#38;d.vtp"),
        ("R&D.vtp", "R&D.vtp"),
    ] {
        std::fs::write(folder.path().join(name), piece).unwrap();
        let list = folder.path().join("all.pvtp");
        let text = format!(
            "<VTKFile type=\"PPolyData\"><PPolyData><Piece Source=\"{written}\"/></PPolyData></VTKFile>"
        );
        std::fs::write(&list, text).unwrap();
        let particles = limpid_io::particles::read(&list).expect(written);
        assert_eq!(particles.densities, Some(vec![7.0]), "{written}");
        let series = folder.path().join("all.pvd");
        let text = format!(
            "<VTKFile type=\"Collection\"><Collection><DataSet timestep=\"0\" file=\"{written}\"/></Collection></VTKFile>"
        );
        std::fs::write(&series, text).unwrap();
        let sequence = limpid_io::sequence::Sequence::open(series.to_str().unwrap()).unwrap();
        assert_eq!(sequence.frames[0].path, folder.path().join(name));
    }
}
