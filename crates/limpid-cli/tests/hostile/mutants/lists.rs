//! Lists of VTK files, and the pieces that they name.

use limpid::glam::DVec3;

use super::{Fields, Reader, Written, places};

/// An attribute: its name, its value, and whether a valid file may lack it.
type Attribute<'a> = (&'a str, &'a str, bool);

fn element(f: &mut Fields, name: &str, attributes: &[Attribute<'_>], inside: &str) -> String {
    let mut open = format!("<{}", f.text("a tag", name));
    for &(key, value, free) in attributes {
        let (old, value) = (value, f.text(&format!("the value of {key}"), value));
        f.excuse(free && value != old);
        let other = f.text("an attribute's name", key);
        f.excuse(free && other != key);
        open += &format!(" {other}=\"{value}\"");
    }
    if inside.is_empty() {
        return open + &f.text("the end of a tag", "/>") + "\n";
    }
    format!("{open}>\n{inside}{}\n", f.text("a closing tag", &format!("</{name}>")))
}

/// A file of VTK with these particles.
fn vtu(f: &mut Fields, places: &[DVec3]) -> String {
    let numbers: String = places.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect();
    let count = f.number("NumberOfPoints", places.len() as u64).to_string();
    let width = f.number("NumberOfComponents", 3).to_string();
    let array = [
        ("type", "Float64", false),
        ("NumberOfComponents", &width, false),
        ("format", "ascii", false),
    ];
    let array = element(f, "DataArray", &array, &numbers);
    let points = element(f, "Points", &[], &array);
    let piece = [("NumberOfPoints", &count[..], false), ("NumberOfCells", "0", false)];
    let piece = element(f, "Piece", &piece, &points);
    let grid = element(f, "UnstructuredGrid", &[], &piece);
    element(f, "VTKFile", &[("type", "UnstructuredGrid", false)], &grid)
}

const PIECES: [&str; 3] = ["a.vtu", "b.vtu", "c.vtu"];

/// A list of this name and text, beside its pieces of ten particles each.
fn beside(f: &mut Fields, name: &str, list: String) -> Written {
    let places = places(30);
    let mut files = vec![(name.to_owned(), f.cut("the list", list.into_bytes()))];
    for (name, places) in PIECES.iter().zip(places.chunks(10)) {
        let piece = vtu(f, places).into_bytes();
        files.push(((*name).into(), f.cut("a piece", piece)));
    }
    Written { files, frames: vec![places], reader: Reader::Frames }
}

/// Pieces of one data set.
pub(super) fn pvtu(f: &mut Fields) -> Written {
    let pieces: String =
        PIECES.iter().map(|name| element(f, "Piece", &[("Source", name, false)], "")).collect();
    let grid = element(f, "PUnstructuredGrid", &[("GhostLevel", "0", false)], &pieces);
    let list = element(f, "VTKFile", &[("type", "PUnstructuredGrid", false)], &grid);
    beside(f, "a.pvtu", list)
}

/// Blocks, of which some may be empty and name no file.
pub(super) fn vtm(f: &mut Fields) -> Written {
    let block = |f: &mut Fields, (i, name): (usize, &&str)| {
        let index = i.to_string();
        let data = [("index", &index[..], false), ("file", name, true)];
        let data = element(f, "DataSet", &data, "");
        element(f, "Block", &[("index", &index, false)], &data)
    };
    let blocks: String = PIECES.iter().enumerate().map(|each| block(f, each)).collect();
    let set = element(f, "vtkMultiBlockDataSet", &[("version", "1.0", false)], &blocks);
    let list = element(f, "VTKFile", &[("type", "vtkMultiBlockDataSet", false)], &set);
    beside(f, "a.vtm", list)
}

/// The list's files as frames of their own.
fn frames(written: Written) -> Written {
    let frames = written.frames[0].chunks(10).map(<[DVec3]>::to_vec).collect();
    Written { frames, ..written }
}

/// A time series of `ParaView`.
pub(super) fn pvd(f: &mut Fields) -> Written {
    let step = |f: &mut Fields, (i, name): (usize, &&str)| {
        let time = (0.1 * i as f64).to_string();
        let data = [("timestep", &time[..], false), ("part", "0", false), ("file", name, false)];
        element(f, "DataSet", &data, "")
    };
    let steps: String = PIECES.iter().enumerate().map(|each| step(f, each)).collect();
    let steps = element(f, "Collection", &[], &steps);
    let list = element(f, "VTKFile", &[("type", "Collection", false)], &steps);
    frames(beside(f, "a.pvd", list))
}

/// A time series in JSON.
pub(super) fn series(f: &mut Fields) -> Written {
    let step = |f: &mut Fields, (i, name): (usize, &&str)| {
        let [key, name, time] = ["name", name, "time"].map(|text| f.text("a text", text));
        format!("{{\"{key}\": \"{name}\", \"{time}\": {}}}", f.number("a time", i as u64))
    };
    let steps: Vec<String> = PIECES.iter().enumerate().map(|each| step(f, each)).collect();
    let comma = f.text("a comma", ",");
    let (files, end) = (f.text("files", "files"), f.text("the end", "]}"));
    let head = f.text("the head", "{\"file-series-version\": \"1.0\"");
    let list = format!("{head}, \"{files}\": [{}{end}", steps.join(&comma));
    frames(beside(f, "a.vtu.series", list))
}
