//! Particle files of DualSPHysics, Krakatoa, mantaflow and LAMMPS.

use std::fmt::Write as _;

use limpid::glam::DVec3;

use super::super::files::{gzip, zlib};
use super::{Fields, Reader, Written, places};

/// A text of `.bi4`: its length and its bytes.
fn text(f: &mut Fields, what: &str, value: &str) -> Vec<u8> {
    let value = f.text(what, value);
    let length = f.number(&format!("length of {what}"), value.len() as u64) as u32;
    [&length.to_le_bytes()[..], value.as_bytes()].concat()
}

fn int(number: u64) -> [u8; 4] {
    (number as u32).to_le_bytes()
}

/// The others of the types of `.bi4`, of other sizes.
const TYPES: [u32; 9] = [0, 1, 3, 5, 12, 20, 23, 24, 99];

/// The values of an item.
fn values(f: &mut Fields, values: &[(&str, u64, bool)]) -> Vec<u8> {
    let count = f.number("number of values", values.len() as u64);
    let mut bytes = [text(f, "VALUES", "\nVALUES"), int(count).into()].concat();
    for &(name, value, free) in values {
        bytes.extend(text(f, name, name));
        let kind = if free { f.free_choice(name, 10, &TYPES) } else { f.choice(name, 10, &TYPES) };
        bytes.extend(kind.to_le_bytes());
        let value = if free { f.free_number(name, value) } else { f.number(name, value) };
        bytes.extend(value.to_le_bytes());
    }
    bytes
}

fn item(
    f: &mut Fields,
    name: &str,
    values: &[u8],
    arrays: &[Vec<u8>],
    items: &[Vec<u8>],
) -> Vec<u8> {
    let mut head = [text(f, "ITEM", "\nITEM\n"), text(f, "an item's name", name)].concat();
    head.extend([0; 8]);
    head.extend(text(f, "a format", "%g"));
    head.extend(text(f, "a format", "%g"));
    head.extend(int(f.number("number of arrays", arrays.len() as u64)));
    head.extend(int(f.number("number of items", items.len() as u64)));
    head.extend(int(f.number("length of values", values.len() as u64)));
    let length = f.number("length of an item's head", head.len() as u64);
    [&int(length)[..], &head, values, &arrays.concat(), &items.concat()].concat()
}

fn array(f: &mut Fields, name: &str, kind: u32, count: usize, numbers: Vec<u8>) -> Vec<u8> {
    let mut head = [text(f, "ARRAY", "\nARRAY"), text(f, name, name)].concat();
    head.extend([0; 4]);
    head.extend(f.choice(name, kind, &TYPES).to_le_bytes());
    head.extend(f.number("count of an array", count as u64).to_le_bytes());
    head.extend(f.number("length of an array", numbers.len() as u64).to_le_bytes());
    let length = f.number("length of an array's head", head.len() as u64);
    let numbers = f.part("an array", numbers);
    [&int(length)[..], &head, &numbers].concat()
}

/// A frame of DualSPHysics: ten fixed particles before the fluid.
pub(super) fn bi4(f: &mut Fields) -> Written {
    const FIXED: u64 = 10;
    let (fluid, wall) = (places(50), places(FIXED as usize));
    let all: Vec<DVec3> =
        wall.iter().map(|&place| place - DVec3::Y).chain(fluid.iter().copied()).collect();
    let count = all.len();
    let numbers = |of: &dyn Fn(usize) -> Vec<u8>| (0..count).flat_map(of).collect::<Vec<u8>>();
    let zeros = [0_f32; 3].map(f32::to_le_bytes).concat();
    let arrays = [
        array(f, "Idp", 8, count, numbers(&|i| (i as u32).to_le_bytes().to_vec())),
        array(f, "Posd", 23, count, numbers(&|i| all[i].to_array().map(f64::to_le_bytes).concat())),
        array(f, "Vel", 22, count, numbers(&|_| zeros.clone())),
        array(f, "Rhop", 11, count, numbers(&|_| 1000_f32.to_le_bytes().to_vec())),
    ];
    let step = values(f, &[("Cpart", 5, false), ("Npok", count as u64, false)]);
    let step = item(f, "Part_0005", &step, &arrays, &[]);
    let case = [
        ("CaseNp", count as u64, false),
        ("CaseNfixed", FIXED, true),
        ("CaseNmoving", 0, true),
        ("CaseNfluid", fluid.len() as u64, false),
    ];
    let case = values(f, &case);
    let root = item(f, "JPartDataBi4", &case, &[], &[step]);
    let title = f.text("the title", "#FileJBD JPartDataBi4");
    let mut head = title.into_bytes();
    head.resize(60, 0);
    let order = f.choice("the byte order", 10_u8, &[0, 1, 2, 11, 255]);
    head.extend([order, f.choice("the width", 1, &[0_u8, 2]), 0, 0]);
    let bytes = f.cut("the file", [head, root].concat());
    Written::one("Part_0005.bi4", bytes, fluid)
}

/// A file of Krakatoa.
pub(super) fn prt(f: &mut Fields) -> Written {
    let places = places(50);
    let mut head = f.part("the magic", b"\xc0PRT\r\n\x1a\n".to_vec());
    head.extend(int(f.number("length of the header", 56)));
    let mut title = f.text("the title", "Extensible Particle Format").into_bytes();
    title.resize(32, 0);
    head.extend(title);
    head.extend(int(f.number("the version", 1)));
    head.extend(f.number("number of particles", places.len() as u64).to_le_bytes());
    head.extend(int(f.number("four", 4)));
    let channels = [("Position", 4_u32, 3, 0), ("Velocity", 4, 3, 12), ("ID", 1, 1, 24)];
    head.extend(int(f.number("number of channels", channels.len() as u64)));
    head.extend(int(f.number("length of a channel", 44)));
    for (name, kind, size, offset) in channels {
        let mut channel = f.text("a channel's name", name).into_bytes();
        channel.resize(32, 0);
        channel.extend(f.choice(name, kind, &[2, 5, 8, 11, 77]).to_le_bytes());
        channel.extend(int(f.number(&format!("size of {name}"), size)));
        channel.extend(int(f.number(&format!("offset of {name}"), offset)));
        head.extend(f.part("a channel", channel));
    }
    let mut rows = Vec::new();
    for (i, place) in places.iter().enumerate() {
        rows.extend(place.as_vec3().to_array().map(f32::to_le_bytes).concat());
        rows.extend([0; 12]);
        rows.extend((i as u32).to_le_bytes());
    }
    let rows = zlib(&f.part("the particles", rows));
    let bytes = [head, f.part("the zlib stream", rows)].concat();
    Written::one("a.prt", f.cut("the file", bytes), places)
}

/// A file of mantaflow.
pub(super) fn uni(f: &mut Fields) -> Written {
    let places = places(50);
    let mut bytes = f.text("the magic", "PB02").into_bytes();
    bytes.extend(int(f.number("number of particles", places.len() as u64)));
    for axis in ["x", "y", "z"] {
        bytes.extend(int(f.number(&format!("cells along {axis}"), 64)));
    }
    bytes.extend(int(f.number("the type", 0)));
    bytes.extend(int(f.number("bytes of a particle", 16)));
    bytes.extend(f.part("the text", vec![b' '; 256]));
    bytes.extend(f.number("the time", 1).to_le_bytes());
    for place in &places {
        let row = place.as_vec3().to_array().map(f32::to_le_bytes).concat();
        bytes.extend(f.part("a particle", [&row[..], &[2, 0, 0, 0]].concat()));
    }
    let bytes = gzip(&f.cut("the unpacked file", bytes));
    Written::one("a.uni", f.cut("the file", bytes), places)
}

/// A dump of LAMMPS with two frames.
pub(super) fn dump(f: &mut Fields) -> Written {
    let frames = [places(20), places(20).iter().map(|&place| place + DVec3::X).collect()];
    let (mut text, mut ends) = (String::new(), Vec::new());
    let line = |text: &mut String, f: &mut Fields, what: &str, value: &str| {
        let value = f.text(what, value);
        writeln!(text, "{value}").expect("in memory");
    };
    for (step, places) in frames.iter().enumerate() {
        line(&mut text, f, "TIMESTEP", "ITEM: TIMESTEP");
        let number = f.number("the step", 100 * step as u64);
        line(&mut text, f, "the step", &number.to_string());
        line(&mut text, f, "NUMBER OF ATOMS", "ITEM: NUMBER OF ATOMS");
        let number = f.number("number of atoms", places.len() as u64);
        line(&mut text, f, "number of atoms", &number.to_string());
        line(&mut text, f, "BOX BOUNDS", "ITEM: BOX BOUNDS pp pp pp");
        for _ in 0..3 {
            line(&mut text, f, "a side of the box", "0 4");
        }
        let columns = ["id x y vx z", "id x y z", "id vx x y z", "id xs ys zs vx", "x y z id vx"];
        let columns = f.free_choice("the columns", "id x y z vx", &columns);
        line(&mut text, f, "ATOMS", &format!("ITEM: ATOMS {columns}"));
        let rows = (0..places.len()).map(|i| {
            let DVec3 { x, y, z } = places[i];
            format!("{} {x} {y} {z} 0.5", i + 1)
        });
        let rows = f.order("the rows", rows.collect());
        for row in rows {
            let row =
                f.choice("a row", row.as_str(), &["", "1 2 3", "ITEM: TIMESTEP", "1 a b c 0"]);
            writeln!(text, "{row}").expect("in memory");
        }
        ends.push(text.len());
    }
    let bytes = f.cut("the file", text.into_bytes());
    // The first frame alone, whose last number, a velocity, may have fewer digits.
    f.excuse((ends[0] - 3..=ends[0]).contains(&bytes.len()));
    Written {
        reader: Reader::Frames,
        frames: frames.into(),
        ..Written::one("a.lammpstrj", bytes, Vec::new())
    }
}
