//! Bake records: the parameters of the frames in a folder, so that no bake continues those of another.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use limpid::scene::Solid;
use limpid_sim::sim::Simulation;

use super::frames_in;
use crate::error::{Error, Result};
use crate::output::FileKind;
use crate::{files, output};

/// Version of the solver, to be incremented when the same parameters give other frames.
const SOLVER: u32 = 2;

/// Path of the record.
pub(super) fn path(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.bake.json"))
}

/// Writes the record of a simulation beside its frames, or checks an existing one.
///
/// # Errors
/// [`Error::OtherBake`] if frames with other parameters exist, [`Error::UnknownBake`] if frames without
/// a record do; [`Error::Format`] for an invalid record, [`Error::Io`] if it cannot be read or written.
pub(super) fn keep(
    simulation: &Simulation,
    solids: &[Solid],
    name: &str,
    folder: &Path,
) -> Result<()> {
    let path = path(folder, name);
    let record = of(simulation, solids);
    let frames = !frames_in(folder, name)?.is_empty();
    if path.exists() || frames {
        let known = match files::read_text(&path) {
            Ok(text) => serde_json::from_str(&text).map_err(|e| {
                let problem = format!(
                    "not the record of a bake: {e}; remove it and the frames {name}_*.bgeo beside it, or \
                     bake into another folder"
                );
                Error::format(&path, problem)
            })?,
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                Value::Null
            }
            Err(e) => return Err(e),
        };
        if known == record {
            return Ok(());
        }
        if frames && known == Value::Null {
            return Err(Error::UnknownBake { folder: folder.to_owned(), name: name.to_owned() });
        }
        if frames {
            let difference = difference(&known, &record).unwrap_or_default();
            let (folder, name) = (folder.to_owned(), name.to_owned());
            return Err(Error::OtherBake { folder, name, difference });
        }
    }
    let text = serde_json::to_string_pretty(&record).expect("numbers and names are JSON");
    output::write_atomically(&path, FileKind::BAKE_RECORD, |file| writeln!(file, "{text}"))
}

/// The record of a simulation: everything that its frames depend on, which excludes their number.
fn of(simulation: &Simulation, solids: &[Solid]) -> Value {
    let mut record = json!({
        "solver": SOLVER,
        "simulation": simulation,
        "solids": solids.iter().map(|solid| &solid.shape).collect::<Vec<_>>(),
    });
    if let Some(simulation) = record["simulation"].as_object_mut() {
        simulation.remove("frames");
    }
    // Parsed again, so that values that JSON cannot represent are lost on both sides of a comparison.
    serde_json::from_str(&record.to_string()).unwrap_or(record)
}

/// Describes the first key whose values differ, in parentheses.
fn difference(known: &Value, record: &Value) -> Option<String> {
    let (known, record) = (known.get("simulation")?, record.get("simulation")?);
    let (key, value) =
        record.as_object()?.iter().find(|(key, value)| known.get(key) != Some(value))?;
    let before = known.get(key).unwrap_or(&Value::Null);
    let short = |value: &Value| {
        let text = value.to_string();
        if text.len() > 40 { "other".to_owned() } else { text }
    };
    Some(format!(" ({key} was {}, is {})", short(before), short(value)))
}
