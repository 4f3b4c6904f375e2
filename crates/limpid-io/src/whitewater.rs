//! Making of whitewater: the foam, spray and bubbles of a sequence, frame after frame, in files.

mod liquid;
mod record;

use std::path::{Path, PathBuf};

use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::memory;
use limpid::scene::Scene;
use limpid_sim::whitewater::{Passage, Whitewater};

pub use limpid_sim::whitewater::Choices;

use self::liquid::{Liquid, Reader};
use self::record::{Made, Record};
use crate::error::Result;
use crate::input::Loader;
use crate::particles::{read_diffuse, write_diffuse};
use crate::sequence::{FrameTime, name_of_frames};

/// The files of a sequence's whitewater.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// Their folder.
    pub folder: PathBuf,
    /// Their name before `_0001`.
    pub name: String,
    /// Their extension, with its point.
    pub extension: String,
}

impl Files {
    /// Files for the frames of a loader: `water_whitewater_0001.bgeo` for `water_{}.vtk`, which is found beside these.
    pub fn of(loader: &Loader, folder: &Path, extension: &str) -> Self {
        let first = loader.sequence.frames.first().map(|frame| &*frame.path);
        let liquid = first.map_or_else(String::new, name_of_frames);
        let separator = if liquid.is_empty() { "" } else { "_" };
        let name = format!("{liquid}{separator}whitewater");
        let extension = format!(".{}", extension.trim_start_matches('.'));
        Self { folder: folder.to_owned(), name, extension }
    }

    /// The file of a frame.
    pub fn path(&self, number: i64) -> PathBuf {
        self.folder.join(format!("{}_{number:04}{}", self.name, self.extension))
    }

    /// The pattern of all.
    pub fn pattern(&self) -> PathBuf {
        self.folder.join(format!("{}_{{}}{}", self.name, self.extension))
    }

    /// The file of what the frames were made from.
    pub fn record(&self) -> PathBuf {
        self.folder.join(format!("{}.json", self.name))
    }
}

/// A frame that is in its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Progress {
    /// Its number.
    pub number: i64,
    /// Its particles by kind, if it has been made now.
    pub counts: Option<[usize; DiffuseKind::ALL.len()]>,
    /// Why the liquid of the frame before stands for its own, if it does.
    pub problem: Option<String>,
}

/// The making of whitewater. Each frame is made from the file of the frame before, so that an interrupted run and the next
/// one give the same files as one that was not. Frames are made again if their file, that of their liquid, or a frame before
/// has changed.
pub struct Making<'a> {
    reader: Reader<'a>,
    scene: &'a Scene,
    files: Files,
    generator: Whitewater,
    record: Record,
    /// Whether frames whose liquid cannot be read keep that of the frame before.
    keep_going: bool,
    /// Index of the next frame.
    next: usize,
    /// Whether all frames before are as they were.
    intact: bool,
    /// The frame before, if it has been made now.
    before: Option<(Liquid, Diffuse)>,
}

impl<'a> Making<'a> {
    /// Begins or continues the making of files. Surveys the sequence at first.
    ///
    /// # Errors
    /// As [`Loader::contents`] if no frame can be read; [`Error::Io`](crate::Error::Io) if the folder cannot be written.
    pub fn new(
        loader: &'a Loader,
        scene: &'a Scene,
        files: Files,
        choices: Choices,
        keep_going: bool,
    ) -> Result<Self> {
        let fail = |e| crate::Error::io(&files.folder, "create", e);
        std::fs::create_dir_all(&files.folder).map_err(fail)?;
        let shapes: Vec<_> = scene.solids.iter().map(|solid| &solid.shape).collect();
        let shapes = serde_json::to_string(&shapes).unwrap_or_default();
        let mut crc = flate2::Crc::new();
        crc.update(shapes.as_bytes());
        let source = format!("{:?} {:08x}", loader.source(), crc.sum());
        let (reader, record) = match Record::read(&files.record(), &source, choices) {
            Some(record) => {
                (Reader::at(loader, record.whitewater.survey.radius, record.pace)?, record)
            }
            None => {
                let reader = Reader::new(loader)?;
                let whitewater = Whitewater { choices, survey: reader.survey()? };
                let record = Record::new(files.record(), source, whitewater, reader.pace());
                record.write()?;
                (reader, record)
            }
        };
        let generator = record.whitewater.clone();
        let most = generator.most().saturating_mul(Whitewater::BYTES_PER_PARTICLE);
        memory::probe(most, &loader.sequence.pattern)?;
        Ok(Self {
            reader,
            scene,
            files,
            generator,
            record,
            keep_going,
            next: 0,
            intact: true,
            before: None,
        })
    }

    /// The generator, and its survey of the sequence.
    pub fn generator(&self) -> &Whitewater {
        &self.generator
    }

    /// Works until one more frame is in its file, in the order of the numbers. `None` after the last.
    ///
    /// # Errors
    /// As [`Loader::contents`], unless frames are kept going, and [`write_diffuse`]; [`limpid::Error::Memory`].
    pub fn step(&mut self) -> Result<Option<Progress>> {
        let Some(&number) = self.reader.numbers().get(self.next) else { return Ok(None) };
        let path = self.files.path(number);
        let input = self.reader.stamp(number);
        self.intact &= self.record.is_whole(number, &path, &input);
        if self.intact {
            self.next += 1;
            return Ok(Some(Progress { number, counts: None, problem: None }));
        }
        let (before, state) = match (self.before.take(), self.next) {
            (Some((liquid, state)), _) => (Some(liquid), state),
            (None, 0) => (None, Diffuse::default()),
            (None, next) => {
                let liquid = self.held(next - 1)?;
                (Some(liquid), self.read(self.reader.numbers()[next - 1])?)
            }
        };
        let (after, problem) = match self.reader.liquid(self.next) {
            Err(error) if self.keep_going && error.is_of_reading() => {
                (None, Some(error.to_string()))
            }
            liquid => (Some(liquid?), None),
        };
        let made = self.made(number, before.as_ref(), after.as_ref(), &state)?;
        if self.record.has(number) {
            // Only files of its kind are replaced, and this one may be damaged. A failure is reported by writing.
            let _ = std::fs::remove_file(&path);
        }
        write_diffuse(&made, &path)?;
        // The next frame is made from the file, as after an interruption.
        let state = self.read(number)?;
        self.record.add(number, Made::of(&path, input)?)?;
        let counts = Some(state.counts());
        self.before = after.or(before).map(|liquid| (liquid, state));
        self.next += 1;
        Ok(Some(Progress { number, counts, problem }))
    }

    /// Makes a frame. Without a frame before, the liquid has stood where it is.
    fn made(
        &self,
        number: i64,
        before: Option<&Liquid>,
        after: Option<&Liquid>,
        state: &Diffuse,
    ) -> Result<Diffuse> {
        let moved = self.reader.loader().moved(FrameTime::at(number), self.scene)?;
        let solids = moved.solids(&self.scene.solids);
        let Some(end) = after.or(before) else { return Ok(Diffuse::default()) };
        let begin = before.unwrap_or(end);
        let seconds = self.reader.seconds(self.next);
        let passage =
            Passage { before: &begin.flow, after: &end.flow, seconds, solids: &solids, number };
        Ok(self.generator.step(&passage, state))
    }

    /// The liquid of a frame, or of the nearest one before that can be read.
    fn held(&self, mut index: usize) -> Result<Liquid> {
        loop {
            match self.reader.liquid(index) {
                Err(error) if self.keep_going && error.is_of_reading() && index > 0 => index -= 1,
                liquid => return liquid,
            }
        }
    }

    fn read(&self, number: i64) -> Result<Diffuse> {
        read_diffuse(&self.files.path(number), self.generator.survey.radius)
    }
}
