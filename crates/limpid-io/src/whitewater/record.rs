//! Record of whitewater: what its frames were made from, so that those that are as they were are not made again.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use limpid_sim::whitewater::{Choices, Whitewater};
use serde::{Deserialize, Serialize};

use crate::bake::checksum;
use crate::error::Result;
use crate::output::FileKind;
use crate::{files, output};

/// Version of the generator, to be incremented when the same liquid gives other particles.
const VERSION: u32 = 1;

/// The record of the frames in a folder.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Record {
    #[serde(skip)]
    path: PathBuf,
    /// The first, by which the file is known.
    pub(super) whitewater: Whitewater,
    version: u32,
    /// The files of the liquid, how they are read, and the solids.
    source: String,
    /// Length of a frame, s.
    pub(super) pace: f64,
    frames: BTreeMap<i64, Made>,
}

/// A frame that has been made.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Made {
    /// Checksum of its file.
    sum: u32,
    /// The files of its liquid.
    input: String,
}

impl Made {
    /// Of a frame's file and of its liquid.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) if the file cannot be read.
    pub(super) fn of(path: &Path, input: String) -> Result<Self> {
        Ok(Self { sum: checksum(path)?, input })
    }
}

/// A mark of a file, without reading it.
pub(super) fn stamp(path: &Path) -> String {
    let Ok(metadata) = path.metadata() else { return String::new() };
    let time =
        metadata.modified().ok().and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
    format!("{}@{}", metadata.len(), time.unwrap_or_default().as_nanos())
}

impl Record {
    /// Of no frame yet.
    pub(super) fn new(path: PathBuf, source: String, whitewater: Whitewater, pace: f64) -> Self {
        Self { path, version: VERSION, source, whitewater, pace, frames: BTreeMap::new() }
    }

    /// The record of frames that were made from the same source with the same choices; `None` without one, whose frames are
    /// made again.
    pub(super) fn read(path: &Path, source: &str, choices: Choices) -> Option<Self> {
        let text = files::read_text(path).ok()?;
        let known: Self = serde_json::from_str(&text).ok()?;
        let same = known.version == VERSION
            && known.source == source
            && known.whitewater.choices == choices;
        same.then(|| Self { path: path.to_owned(), ..known })
    }

    /// Whether a frame has been made.
    pub(super) fn has(&self, number: i64) -> bool {
        self.frames.contains_key(&number)
    }

    /// Whether a frame's file is as it was made, from the same liquid.
    pub(super) fn is_whole(&self, number: i64, path: &Path, input: &str) -> bool {
        let made = self.frames.get(&number).filter(|made| made.input == input);
        made.is_some_and(|made| checksum(path).is_ok_and(|sum| sum == made.sum))
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) if the record cannot be written.
    pub(super) fn add(&mut self, number: i64, made: Made) -> Result<()> {
        self.frames.insert(number, made);
        self.write()
    }

    /// Writes the record.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) if it cannot be written.
    pub(super) fn write(&self) -> Result<()> {
        let text = serde_json::to_string_pretty(self).expect("numbers and names are JSON");
        output::write_atomically(&self.path, FileKind::WHITEWATER_RECORD, |file| {
            writeln!(file, "{text}")
        })
    }
}
