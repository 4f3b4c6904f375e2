//! LAMMPS dumps: text with sections that begin with `ITEM:`, one of which names the columns of the particles
//! (documentation of the command `dump`, style `custom`). Positions are `x y z`, unwrapped `xu yu zu`, or
//! shares of the box, `xs ys zs`.

use std::path::Path;

use super::labelled::Layout;
use super::{Contents, Cursor, Reading, foreign};
use crate::error::{Error, Result};

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !bytes.starts_with(b"ITEM:") {
        return Err(foreign(path, bytes, "a LAMMPS dump, which begins with `ITEM:`"));
    }
    let mut file = Cursor::new(path, bytes, true);
    let mut count = None;
    let mut sides = Vec::new();
    loop {
        let Some(line) = file.filled_line() else {
            return Err(file.error("no section `ITEM: ATOMS`"));
        };
        let Some(item) = line.strip_prefix("ITEM:").map(str::trim) else {
            return Err(file.error(format!("expected `ITEM:`, found `{line:.40}`")));
        };
        if let Some(columns) = item.strip_prefix("ATOMS") {
            let count = count.ok_or_else(|| file.error("no section `ITEM: NUMBER OF ATOMS`"))?;
            let labels = columns.split_ascii_whitespace().map(str::to_owned).collect();
            return particles(&mut file, count, labels, &sides, reading);
        }
        if item.starts_with("NUMBER OF ATOMS") {
            let line = file.line().unwrap_or_default();
            count = Some(file.count(Some(line.trim()), "the number of particles")?);
        } else if item.starts_with("BOX BOUNDS") {
            for _ in 0..3 {
                let line = file.line().unwrap_or_default();
                let numbers = line.split_ascii_whitespace().map(|word| file.number(word));
                sides.push(numbers.collect::<Result<Vec<f64>>>()?);
            }
        } else {
            // The time step, its units and the like: one line each.
            file.line();
        }
    }
}

fn particles(
    file: &mut Cursor<'_>,
    count: usize,
    mut labels: Vec<String>,
    sides: &[Vec<f64>],
    reading: &Reading<'_>,
) -> Result<Contents> {
    let path = file.source.path;
    let has = |labels: &[String], name: &str| labels.iter().any(|label| label == name);
    let mut scaled = false;
    if !has(&labels, "x") {
        for (suffix, shares) in [("u", false), ("s", true), ("su", true)] {
            if has(&labels, &format!("x{suffix}")) {
                scaled = shares;
                for axis in ["x", "y", "z"] {
                    let own = format!("{axis}{suffix}");
                    labels.iter_mut().filter(|label| **label == own).for_each(|l| *l = axis.into());
                }
                break;
            }
        }
    }
    let layout = Layout::among(path, labels, *reading)?;
    let sides: Vec<[f64; 2]> =
        sides.iter().filter_map(|side| side.as_slice().try_into().ok()).collect();
    if scaled && sides.len() != 3 {
        let problem = "positions are shares of a tilted or unknown box; dump x y z or xu yu zu";
        return Err(Error::format(path, problem));
    }
    layout.read_lines(file, count, |numbers| {
        for (share, [low, high]) in numbers.iter_mut().zip(&sides).filter(|_| scaled) {
            *share = (low + f64::from_le_bytes(*share) * (high - low)).to_le_bytes();
        }
    })
}
