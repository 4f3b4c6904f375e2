//! Houdini's geometry: JSON in text and in binary, plain, by gzip and in Blosc chunks.

use super::super::files::gzip;
use super::{Fields, Written, places};

/// A value of a document.
#[derive(Clone, PartialEq)]
enum Json {
    Text(String),
    Integer(u64),
    Flag(bool),
    Floats(Vec<f32>),
    List(Vec<Self>),
}

use Json::{Flag, Floats, Integer, List};

fn name(f: &mut Fields, name: &str) -> Json {
    Json::Text(f.text(name, name))
}

fn count(f: &mut Fields, what: &str, count: usize) -> Json {
    Integer(f.number(what, count as u64))
}

/// How the numbers of a document are stored.
#[derive(Clone, Copy)]
enum Storage {
    Tuples,
    Arrays,
    Pages,
}

/// Points of a page.
const PAGE: usize = 16;

fn attribute(f: &mut Fields, called: &str, numbers: &[[f32; 3]], storage: Storage) -> Json {
    let definition = [
        name(f, "scope"),
        name(f, "public"),
        name(f, "type"),
        name(f, "numeric"),
        name(f, "name"),
        name(f, called),
        name(f, "options"),
        List(Vec::new()),
    ];
    let definition = f.order("an attribute's definition", definition.into());
    let mut values =
        vec![name(f, "size"), count(f, "size", 3), name(f, "storage"), name(f, "fpreal32")];
    match storage {
        Storage::Tuples => {
            let tuples = numbers.iter().map(|tuple| Floats(tuple.to_vec())).collect();
            values.extend([name(f, "tuples"), List(f.order("tuples", tuples))]);
        }
        Storage::Arrays => {
            let array = |axis: usize| Floats(numbers.iter().map(|tuple| tuple[axis]).collect());
            let arrays: Vec<Json> = (0..3).map(array).collect();
            let other = f.order("arrays", arrays.clone());
            // Axes may well change places.
            f.excuse(other.len() == 3 && other != arrays);
            values.extend([name(f, "arrays"), List(other)]);
        }
        Storage::Pages => {
            let pages = numbers.len().div_ceil(PAGE);
            let flags = (0..pages).map(|_| Flag(f.choice("a flag", false, &[true]))).collect();
            let flags = List(vec![List(f.order("flags", flags))]);
            let numbers = numbers.as_flattened().to_vec();
            values.extend([
                name(f, "pagesize"),
                count(f, "pagesize", PAGE),
                name(f, "packing"),
                List(vec![count(f, "packing", 3)]),
                name(f, "constantpageflags"),
                flags,
                name(f, "rawpagedata"),
                Floats(numbers),
            ]);
        }
    }
    let values = [name(f, "size"), count(f, "size", 3), name(f, "storage"), name(f, "fpreal32")]
        .into_iter()
        .chain([name(f, "values"), List(values)]);
    List(vec![List(definition), List(values.collect())])
}

fn document(f: &mut Fields, points: &[[f32; 3]], storage: Storage) -> Json {
    let velocities = vec![[1.0, 2.0, 3.0]; points.len()];
    let attributes =
        vec![attribute(f, "P", points, storage), attribute(f, "v", &velocities, storage)];
    let attributes = List(f.order("attributes", attributes));
    List(vec![
        name(f, "fileversion"),
        name(f, "20.5.278"),
        name(f, "pointcount"),
        count(f, "pointcount", points.len()),
        name(f, "vertexcount"),
        count(f, "vertexcount", 0),
        name(f, "primitivecount"),
        count(f, "primitivecount", 0),
        name(f, "info"),
        List(Vec::new()),
        name(f, "attributes"),
        List(vec![name(f, "pointattributes"), attributes]),
    ])
}

/// Writes a value as text.
fn text(f: &mut Fields, value: &Json, out: &mut String) {
    match value {
        Json::Text(text) => *out += &format!("{text:?}"),
        Integer(number) => *out += &number.to_string(),
        Flag(flag) => *out += &flag.to_string(),
        Floats(numbers) => {
            let numbers = List(numbers.iter().map(|x| Json::Text(x.to_string())).collect());
            let mut list = String::new();
            text(&mut Fields::valid(), &numbers, &mut list);
            *out += &f.text("a list of numbers", &list.replace('"', ""));
        }
        List(values) => {
            *out += &f.text("a bracket", "[");
            for (i, value) in values.iter().enumerate() {
                if i > 0 {
                    *out += &f.text("a comma", ",");
                }
                text(f, value, out);
            }
            *out += &f.text("a bracket", "]");
        }
    }
}

/// Tokens that begin something else, or nothing.
const TOKENS: [u8; 12] = [0x00, 0x10, 0x11, 0x14, 0x18, 0x1a, 0x27, b'[', b']', b'@', b'&', 0x77];

/// Writes a value in binary.
fn binary(f: &mut Fields, value: &Json, out: &mut Vec<u8>) {
    let length = |f: &mut Fields, what: &str, length: usize| {
        let length = f.number(what, length as u64);
        match u8::try_from(length) {
            Ok(short) if short <= 0xf0 => vec![short],
            _ if length <= 0xffff => [&[0xf2][..], &(length as u16).to_le_bytes()].concat(),
            _ => [&[0xf8][..], &length.to_le_bytes()].concat(),
        }
    };
    match value {
        Json::Text(text) => {
            out.push(f.choice("the token of a text", 0x27, &TOKENS[..6]));
            out.extend(length(f, "the length of a text", text.len()));
            out.extend(text.as_bytes());
        }
        Integer(number) => {
            out.push(f.choice("the token of an integer", 0x13, &TOKENS));
            out.extend((*number as u32).to_le_bytes());
        }
        Flag(flag) => out.push(if *flag { b'1' } else { b'0' }),
        Floats(numbers) => {
            out.push(f.choice("the token of an array", b'@', &TOKENS[..8]));
            out.push(f.choice("the type of an array", 0x19, &TOKENS));
            out.extend(length(f, "the length of an array", numbers.len()));
            let numbers = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
            out.extend(f.part("an array", numbers));
        }
        List(values) => {
            out.push(f.choice("a bracket", b'[', &TOKENS[..7]));
            values.iter().for_each(|value| binary(f, value, out));
            out.push(f.choice("a bracket", b']', &TOKENS));
        }
    }
}

fn points(count: usize) -> Vec<[f32; 3]> {
    places(count).iter().map(|place| place.as_vec3().to_array()).collect()
}

/// Text, with the numbers of each point together.
pub(super) fn tuples(f: &mut Fields) -> Written {
    let mut out = String::new();
    let document = document(f, &points(40), Storage::Tuples);
    text(f, &document, &mut out);
    Written::one("tuples.geo", f.cut("the file", out.into_bytes()), places(40))
}

/// Text, with the numbers of each axis together.
pub(super) fn arrays(f: &mut Fields) -> Written {
    let mut out = String::new();
    let document = document(f, &points(40), Storage::Arrays);
    text(f, &document, &mut out);
    Written::one("arrays.geo", f.cut("the file", out.into_bytes()), places(40))
}

/// Binary, in pages.
fn pages(f: &mut Fields) -> Vec<u8> {
    let magic = f.number("the magic", 0x624a_534e) as u32;
    let mut out = [&[0x7f][..], &magic.to_le_bytes()].concat();
    let document = document(f, &points(40), Storage::Pages);
    binary(f, &document, &mut out);
    f.cut("the file", out)
}

/// Binary, by gzip.
pub(super) fn packed(f: &mut Fields) -> Written {
    Written::one("pages.bgeo", gzip(&pages(f)), places(40))
}

/// Binary, in Blosc chunks.
pub(super) fn blosc(f: &mut Fields) -> Written {
    let document = pages(f);
    let mut file = f.text("the magic", "scf1").into_bytes();
    file.extend([0; 8]);
    let mut chunks = Vec::new();
    for part in document.chunks(1500) {
        let body = lz4_literals(f, part);
        let packed = 16 + 8 + body.len();
        let mut chunk = vec![
            f.choice("the version of a chunk", 2, &[0, 1, 3, 255]),
            1,
            f.choice("the flags of a chunk", 1 << 5 | 16, &[0, 1, 2, 1 << 5, 4 << 5, 255]),
            f.choice("the width of a chunk", 4, &[0, 1, 8, 255]),
        ];
        for (what, size) in [
            ("the unpacked length of a chunk", part.len()),
            ("the block of a chunk", part.len()),
            ("the length of a chunk", packed),
            ("the start of a block", 20),
            ("the length of a stream", body.len()),
        ] {
            chunk.extend((f.number(what, size as u64) as u32).to_le_bytes());
        }
        chunk.extend(body);
        chunks.push(f.part("a chunk", chunk));
    }
    file.extend(f.order("chunks", chunks).concat());
    let index = f.part("the index", vec![0; 8]);
    file.extend(&index);
    file.extend(f.number("the length of the index", 8).to_be_bytes());
    file.extend(f.text("the end", "1fcs").into_bytes());
    Written::one("pages.bgeo.sc", f.cut("the packed file", file), places(40))
}

/// An LZ4 block of bytes as they are, whose lengths are fields.
fn lz4_literals(f: &mut Fields, bytes: &[u8]) -> Vec<u8> {
    let Some(more) = bytes.len().checked_sub(15) else {
        return [&[(bytes.len() as u8) << 4], bytes].concat();
    };
    let mut block = vec![f.choice("the token of LZ4", 0xf0, &[0x00, 0xff, 0x0f, 0x80])];
    block.extend(vec![255; more / 255]);
    block.push(f.number("the last length of LZ4", more as u64 % 255) as u8);
    block.extend(bytes);
    block
}
