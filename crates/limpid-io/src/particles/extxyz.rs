//! Extended XYZ, as written by OVITO and ASE (J. R. Kermode and others, the `extxyz` specification): one or
//! more frames of text, each with the number of particles, a line of `key=value` pairs, and one particle per
//! line. `Properties=species:S:1:pos:R:3:velo:R:3` names the columns; without it they are an element and
//! three coordinates, as in the older format of this name.

use std::path::Path;

use super::labelled::Layout;
use super::{Contents, Cursor, Reading, foreign};
use crate::error::Result;

/// Whether a text begins like a file of this format: with a line that is a count.
pub(super) fn is_counted(bytes: &[u8]) -> bool {
    let mut lines = bytes.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let is_count = |line: &[u8]| !line.is_empty() && line.iter().all(u8::is_ascii_digit);
    lines.find(|line| !line.is_empty()).is_some_and(is_count)
}

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !is_counted(bytes) {
        return Err(foreign(
            path,
            bytes,
            "extended XYZ, which begins with the number of particles",
        ));
    }
    let mut file = Cursor::new(path, bytes, true);
    let first = file.filled_line().unwrap_or_default();
    let count = file.count(Some(first.trim()), "the number of particles")?;
    let comment = file.line().ok_or_else(|| file.error("the line after the count is missing"))?;
    let labels = match property(&comment, "Properties") {
        Some(properties) => labels(&properties).ok_or_else(|| {
            file.error(format!("expected Properties=name:type:size:..., found `{properties}`"))
        })?,
        None => ["species", "x", "y", "z"].map(String::from).to_vec(),
    };
    let layout = Layout::among(path, labels, *reading)?;
    layout.read_lines(&mut file, count, |_| ())
}

/// The value of a key in the comment line, which may be quoted.
fn property(line: &str, key: &str) -> Option<String> {
    let (_, rest) = line.split_once(&format!("{key}="))?;
    match rest.strip_prefix('"') {
        Some(quoted) => quoted.split('"').next().map(str::to_owned),
        None => rest.split_ascii_whitespace().next().map(str::to_owned),
    }
}

/// The name of each column: `pos:R:3` is `pos_x`, `pos_y` and `pos_z`.
fn labels(properties: &str) -> Option<Vec<String>> {
    /// Largest number of columns.
    const MOST: usize = 1024;
    let mut labels = Vec::new();
    let parts: Vec<&str> = properties.split(':').collect();
    if !parts.len().is_multiple_of(3) {
        return None;
    }
    for part in parts.chunks_exact(3) {
        let size: usize = part[2].parse().ok().filter(|size| (1..=MOST).contains(size))?;
        let name = match part[0] {
            "velo" => "velocity",
            name => name,
        };
        match size {
            1 => labels.push(name.to_owned()),
            3 => labels.extend(["x", "y", "z"].map(|axis| format!("{name}_{axis}"))),
            _ => labels.extend((0..size).map(|k| format!("{name}_{k}"))),
        }
        if labels.len() > MOST {
            return None;
        }
    }
    Some(labels)
}
