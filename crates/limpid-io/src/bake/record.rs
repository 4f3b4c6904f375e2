//! Bake records: the parameters of the frames in a folder, so that no bake continues those of another, and the
//! checksums of their files, so that none is kept that was cut or changed.

use std::collections::BTreeMap;
use std::io::{self, BufRead as _, BufReader, Write as _};
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

/// The key of the checksums.
const SUMS: &str = "sums";

/// The record of the frames in a folder.
#[derive(Debug)]
pub(super) struct Record {
    path: PathBuf,
    parameters: Value,
    /// Checksums of the frames' files, by their numbers.
    sums: BTreeMap<u32, u32>,
}

/// CRC-32 of a file.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub(crate) fn checksum(path: &Path) -> Result<u32> {
    let mut file = BufReader::new(files::open(path)?.0);
    let mut crc = flate2::Crc::new();
    loop {
        let bytes = file.fill_buf().map_err(|source| Error::io(path, "read", source))?;
        let read = bytes.len();
        if read == 0 {
            return Ok(crc.sum());
        }
        crc.update(bytes);
        file.consume(read);
    }
}

impl Record {
    /// Writes the record of a simulation beside its frames, or reads and checks an existing one.
    ///
    /// # Errors
    /// [`Error::OtherBake`] if frames with other parameters exist, [`Error::UnknownBake`] if frames without
    /// a record do; [`Error::Format`] for an invalid record, [`Error::Io`] if it cannot be read or written.
    pub(super) fn keep(
        simulation: &Simulation,
        solids: &[Solid],
        name: &str,
        folder: &Path,
    ) -> Result<Self> {
        let path = path(folder, name);
        let (parameters, sums) = (of(simulation, solids), BTreeMap::new());
        let mut record = Self { path, parameters, sums };
        let path = &record.path;
        let frames = !frames_in(folder, name)?.is_empty();
        if path.exists() || frames {
            let mut known: Value = match files::read_text(path) {
                Ok(text) => serde_json::from_str(&text).map_err(|e| {
                    let problem = format!(
                        "not the record of a bake: {e}; remove it and the frames {name}_*.bgeo beside it, or \
                         bake into another folder"
                    );
                    Error::format(path, problem)
                })?,
                Err(Error::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
                    Value::Null
                }
                Err(e) => return Err(e),
            };
            let sums = known.as_object_mut().and_then(|known| known.remove(SUMS));
            if known == record.parameters {
                // Those that cannot be read are made anew.
                let sums = sums.and_then(|sums| serde_json::from_value(sums).ok());
                record.sums = sums.unwrap_or_default();
                return Ok(record);
            }
            if frames && known == Value::Null {
                return Err(Error::UnknownBake {
                    folder: folder.to_owned(),
                    name: name.to_owned(),
                });
            }
            if frames {
                let difference = difference(&known, &record.parameters).unwrap_or_default();
                let (folder, name) = (folder.to_owned(), name.to_owned());
                return Err(Error::OtherBake { folder, name, difference });
            }
        }
        record.write()?;
        Ok(record)
    }

    /// The checksum of a frame's file, if it is known.
    pub(super) fn sum(&self, number: u32) -> Option<u32> {
        self.sums.get(&number).copied()
    }

    /// Records the checksum of a frame's file.
    ///
    /// # Errors
    /// [`Error::Io`] if the record cannot be written.
    pub(super) fn add(&mut self, number: u32, sum: u32) -> Result<()> {
        match self.sums.insert(number, sum) {
            Some(known) if known == sum => Ok(()),
            _ => self.write(),
        }
    }

    fn write(&self) -> Result<()> {
        let mut record = self.parameters.clone();
        if let Some(record) = record.as_object_mut() {
            record.insert(SUMS.into(), json!(self.sums));
        }
        let text = serde_json::to_string_pretty(&record).expect("numbers and names are JSON");
        output::write_atomically(&self.path, FileKind::BAKE_RECORD, |file| writeln!(file, "{text}"))
    }
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
