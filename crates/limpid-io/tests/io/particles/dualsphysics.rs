//! `.bi4` as DualSPHysics writes it, by the source of its classes `JBinaryData` and `JPartDataBi4`: the values of the
//! case in the root, and one item with the particles, of 32-bit or 64-bit places and ids, in one file or several; and
//! files of which a part is not what the others say.

use std::path::Path;

use glam::Vec3;
use limpid_io::particles::{Contents, ReadOptions, Remark, Unit};

use super::check_message;

/// A value of an item: its type and bytes.
type Value<'a> = (&'a str, i32, Vec<u8>);

/// An array: its name, type, number of entries, and bytes.
#[derive(Clone)]
struct Array(&'static str, i32, usize, Vec<u8>);

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn count(name: &str, number: u64) -> Value<'_> {
    (name, 10, number.to_le_bytes().to_vec())
}

fn number(name: &str, number: f64) -> Value<'_> {
    (name, 12, number.to_le_bytes().to_vec())
}

fn uint(name: &str, number: u32) -> Value<'_> {
    (name, 8, number.to_le_bytes().to_vec())
}

fn floats<T: Copy, const N: usize>(numbers: &[T], bytes: fn(T) -> [u8; N]) -> Vec<u8> {
    numbers.iter().flat_map(|&number| bytes(number)).collect()
}

/// An item. In wide files, `SI64`, counts and lengths of arrays have 64 bits.
fn item(name: &str, values: &[Value<'_>], arrays: &[Array], items: &[u8], wide: bool) -> Vec<u8> {
    let mut body = Vec::new();
    if !values.is_empty() {
        body.extend(text("\nVALUES"));
        body.extend((values.len() as u32).to_le_bytes());
        for (name, kind, bytes) in values {
            body.extend(text(name));
            body.extend(kind.to_le_bytes());
            body.extend(bytes);
        }
    }
    let mut head = [text("\nITEM\n"), text(name), vec![0; 8], text("%f"), text("%f")].concat();
    for length in [arrays.len(), usize::from(!items.is_empty()), body.len()] {
        head.extend((length as u32).to_le_bytes());
    }
    let mut bytes = [&(head.len() as u32).to_le_bytes()[..], &head, &body].concat();
    for Array(name, kind, count, data) in arrays {
        let mut head = [text("\nARRAY"), text(name), vec![0; 4]].concat();
        head.extend(kind.to_le_bytes());
        for length in [*count, data.len()] {
            match wide {
                true => head.extend((length as u64).to_le_bytes()),
                false => head.extend((length as u32).to_le_bytes()),
            }
        }
        bytes.extend((head.len() as u32).to_le_bytes());
        bytes.extend(head);
        bytes.extend(data);
    }
    bytes.extend(items);
    bytes
}

fn file(root: &[Value<'_>], part: &[Value<'_>], arrays: &[Array], wide: bool) -> Vec<u8> {
    let part = item("PART_0003", part, arrays, &[], wide);
    let mut bytes = format!("{:<58}\n\0", "#FileJBD JPartDataBi4").into_bytes();
    bytes.extend(if wide { [10, 1, 0, 0] } else { [0; 4] });
    bytes.extend(item("JPartDataBi4", root, &[], &part, wide));
    bytes
}

/// The values of a case of two fixed particles and four of fluid.
fn case() -> Vec<Value<'static>> {
    let title = ("CaseName", 1, text("CaseDambreak"));
    let plane = ("Data2d", 2, 0_i32.to_le_bytes().to_vec());
    let corner = ("CasePosMin", 23, vec![0; 24]);
    let mut values = vec![uint("Piece", 0), uint("Npiece", 1), title, plane, corner];
    values.extend([count("CaseNp", 6), count("CaseNfixed", 2), count("CaseNmoving", 0)]);
    values.extend([count("CaseNfloat", 0), count("CaseNfluid", 4), number("Dp", 0.5)]);
    values
}

/// Six particles in the order of cells, as the program sorts them; ids tell the fixed ones.
const IDS: [u32; 6] = [4, 0, 2, 1, 5, 3];

fn arrays() -> Vec<Array> {
    let places: Vec<f64> = IDS.iter().flat_map(|&id| [f64::from(id), 0.25, 1.0]).collect();
    let velocities: Vec<f32> = IDS.iter().flat_map(|&id| [0.0, 0.0, -(id as f32)]).collect();
    vec![
        Array("Idp", 8, 6, floats(&IDS, u32::to_le_bytes)),
        Array("Posd", 23, 6, floats(&places, f64::to_le_bytes)),
        Array("Vel", 22, 6, floats(&velocities, f32::to_le_bytes)),
        Array("Rhop", 11, 6, floats(&[1000.0; 6], f32::to_le_bytes)),
    ]
}

fn parse(bytes: &[u8]) -> Contents {
    Contents::parse(Path::new("Part_0003.bi4"), bytes, &ReadOptions::default()).expect("valid")
}

fn part() -> [Value<'static>; 2] {
    [number("TimeStep", 0.25), uint("Npok", 6)]
}

/// Single or double precision, ids of 32 or 64 bits, wide files, and further arrays that the user has asked for: the
/// fluid alone, in the file's order.
#[test]
fn layouts_of_the_program() {
    let mut single = arrays();
    let places: Vec<f32> = IDS.iter().flat_map(|&id| [id as f32, 0.25, 1.0]).collect();
    single[1] = Array("Pos", 22, 6, floats(&places, f32::to_le_bytes));
    let mut double = arrays();
    double[0] = Array("Idpd", 10, 6, floats(&IDS.map(u64::from), u64::to_le_bytes));
    let mut further = arrays();
    further.push(Array("Mk", 6, 6, vec![0; 12]));
    further.push(Array("Flag", 2, 6, vec![0; 24]));
    further.push(Array("Note", 1, 6, vec![0; 24]));
    for (arrays, wide) in [(single, false), (double, true), (further, false), (arrays(), true)] {
        let contents = parse(&file(&case(), &part(), &arrays, wide));
        let particles = &contents.particles;
        let xs: Vec<f32> = particles.positions.iter().map(|x| x.x).collect();
        assert_eq!(xs, [4.0, 2.0, 5.0, 3.0]);
        assert_eq!(particles.ids.as_deref(), Some(&[4, 2, 5, 3][..]));
        assert_eq!(particles.velocities.as_ref().unwrap()[2], Vec3::new(0.0, 0.0, -5.0));
        assert_eq!(particles.radii, Some(vec![0.25; 4]));
    }
}

/// One file of several devices says that it is a part; without ids no particle can be told to be fixed.
#[test]
fn parts_and_missing_ids_are_told() {
    let mut pieces = case();
    pieces[1] = uint("Npiece", 4);
    let partial =
        |remark: &Remark| *remark == Remark::Partial { found: 1, total: 4, unit: Unit::Files };
    assert!(parse(&file(&pieces, &part(), &arrays(), false)).remarks.iter().any(partial));
    assert!(!parse(&file(&case(), &part(), &arrays(), false)).remarks.iter().any(partial));
    let idless = parse(&file(&case(), &part(), &arrays()[1..], false));
    assert_eq!(idless.particles.len(), 6);
    let told = idless.remarks.iter().any(|remark| remark.to_string().contains("cannot be told"));
    assert!(told, "{:?}", idless.remarks);
}

/// Arrays of other lengths, counts that are none, and what follows the last item are errors with the place.
#[test]
fn contradictions_are_errors() {
    let check = |root: &[Value<'_>], values: &[Value<'_>], arrays: &[Array], part: &str| {
        check_message("a.bi4", &file(root, values, arrays, false), &["a.bi4: byte", part]);
    };
    let with = |name: &str, value: Value<'static>| {
        let replace = |old: Value<'static>| if old.0 == name { value.clone() } else { old };
        case().into_iter().map(replace).collect::<Vec<_>>()
    };
    for (at, name) in [(0, "Idp"), (2, "Vel"), (3, "Rhop")] {
        for length in [3, 5, 7] {
            let mut arrays = arrays();
            let Array(_, _, count, bytes) = &mut arrays[at];
            let each = bytes.len() / *count;
            bytes.resize(length * each, 0);
            *count = length;
            check(
                &case(),
                &part(),
                &arrays,
                &format!("{name} has {length} entries for 6 particles"),
            );
        }
    }
    check(&case(), &[uint("Npok", 7)], &arrays(), "Npok is 7, but there are 6 particles");
    for wrong in [f64::NAN, f64::INFINITY, -2.0, 1.5] {
        for name in ["CaseNfixed", "CaseNfloat", "CaseNfluid"] {
            let root = with(name, number(name, wrong));
            check(&root, &part(), &arrays(), &format!("{name} is {wrong}"));
        }
    }
    check(&with("CaseNp", count("CaseNp", 9)), &part(), &arrays(), "its parts sum up to 6");
    for wrong in [f64::NAN, f64::INFINITY, -0.5] {
        check(&with("Dp", number("Dp", wrong)), &part(), &arrays(), &format!("Dp is {wrong}"));
    }
    let good = file(&case(), &part(), &arrays(), false);
    for extra in [1, 4, 800] {
        let bytes = [&good[..], &vec![0; extra]].concat();
        check_message("a.bi4", &bytes, &[&format!("{extra} bytes follow the last item")]);
    }
    // Every cut is an error.
    for length in (70..good.len()).step_by(7) {
        check_message("a.bi4", &good[..length], &["a.bi4: byte"]);
    }
    let [one, two] =
        ["PART_0000", "PART_0001"].map(|name| item(name, &part(), &arrays(), &[], false));
    let mut root = item("JPartDataBi4", &case(), &[], &[one, two].concat(), false);
    // Two items instead of one, in the head's second count.
    let head = 4 + u32::from_le_bytes(root[..4].try_into().unwrap()) as usize;
    root[head - 8] = 2;
    let bytes = [&good[..64], &root].concat();
    check_message("a.bi4", &bytes, &["positions in several items"]);
}
