//! Checks of output paths: no input and no file of another kind is ever overwritten.

use std::borrow::Cow;
use std::collections::HashSet;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::Temporary;
use crate::error::{Error, Result};
use crate::files;
use crate::identity::{Identity, folder_of};

/// The kind of an output file. An existing file is replaced only if its contents are of the same kind,
/// or if it is empty.
#[derive(Debug, Clone, Copy)]
pub struct FileKind {
    /// Its name in messages: `a picture`.
    name: &'static str,
    /// Whether a file is of this kind.
    recognise: fn(&Existing<'_>) -> bool,
    /// Number of leading bytes that `recognise` needs.
    head: u64,
    /// Whether it may be written to a pipe or a device.
    devices: bool,
}

/// An existing file that would be replaced.
#[derive(Debug)]
pub struct Existing<'a> {
    /// Its path.
    pub path: &'a Path,
    /// Its first bytes.
    pub head: Vec<u8>,
    /// Its length, bytes.
    pub length: u64,
}

impl Existing<'_> {
    fn text(&self) -> Cow<'_, str> {
        String::from_utf8_lossy(&self.head)
    }

    /// Whether any of these signatures is at its offset.
    fn has_any(&self, marks: &[(usize, &[u8])]) -> bool {
        marks.iter().any(|(at, mark)| self.head.get(*at..).is_some_and(|h| h.starts_with(mark)))
    }

    /// Whether it begins with `mark`, or is a part of it: a full disk may have truncated the file.
    fn begins(&self, mark: &str) -> bool {
        let text = self.text();
        text.starts_with(mark) || mark.starts_with(&*text)
    }

    /// Whether it is JSON whose first key is `key`.
    fn is_json(&self, key: &str) -> bool {
        let packed: String = self.text().chars().take(100).filter(|c| !c.is_whitespace()).collect();
        let mark = format!("{{\"{key}\":");
        packed.starts_with(&mark) || mark.starts_with(&packed)
    }
}

/// Signatures of pictures and films, with their offsets.
const PICTURES: [(usize, &[u8]); 4] =
    [(0, b"\x89PNG"), (0, b"\xff\xd8\xff"), (8, b"WEBP"), (0, b"\x76\x2f\x31\x01")];
const FILMS: [(usize, &[u8]); 4] =
    [(4, b"ftyp"), (0, b"\x1a\x45\xdf\xa3"), (0, b"GIF8"), (0, b"\x89PNG")];

impl FileKind {
    /// A PNG, JPEG, WebP or OpenEXR picture.
    pub const PICTURE: Self =
        Self { head: 16, ..Self::new("a picture", |file| file.has_any(&PICTURES)) };
    /// A video, an animated GIF or PNG.
    pub const FILM: Self = Self { head: 16, ..Self::new("a film", |file| file.has_any(&FILMS)) };
    /// A PLY mesh.
    pub const MESH: Self = Self::new("a mesh in PLY", |file| {
        file.begins("ply\n") && file.text().contains("element face")
    });
    /// JSON of `limpid render --stats` or `limpid report`.
    pub const MEASUREMENTS: Self =
        Self::new("statistics or a report of limpid", |file| file.is_json("adapter"));
    /// The outcome of each frame, a line of JSON for each.
    pub const MANIFEST: Self = Self::new("a manifest of limpid", |file| file.is_json("frame"));
    /// The viewer's events, a line of JSON for each.
    pub const LOG: Self = Self::new("a log of limpid", |file| {
        file.is_json("event") || file.begins("{") && file.text().contains("\"event\":")
    });
    /// The parameters of a bake's frames.
    pub const BAKE_RECORD: Self =
        Self::new("the record of a bake", |file| file.is_json("simulation"));
    /// The record of how frames of whitewater were made.
    pub const WHITEWATER_RECORD: Self =
        Self::new("the record of whitewater", |file| file.is_json("whitewater"));
    /// The conditions under which expectations were drawn.
    pub const BLESS_RECORD: Self = Self::new("the record of a suite", |file| {
        file.begins("# What `limpid check --bless` drew")
    });
    /// Results for a CI system.
    pub const JUNIT: Self = Self::new("a JUnit file", |file| {
        file.begins("<?xml") && file.text().contains("<testsuite") || file.begins("<testsuite")
    });
    /// A page of `limpid check` or `limpid report`.
    pub const PAGE: Self = Self::new("a page of limpid", |file| {
        file.begins("<!DOCTYPE html>") && file.text().contains("<title>limpid")
    });
    /// A page of the manual, in roff.
    pub const MANUAL: Self =
        Self::new("a manual page of limpid", |file| file.text().contains(".TH limpid"));
    /// The tables of `limpid report`.
    pub const TABLES: Self = Self::new("a report of limpid", |file| file.begins("Measured on "));
    /// The measurements of `limpid report --curve`.
    pub const CURVE: Self =
        Self::new("a curve of limpid", |file| file.begins("# Written by `limpid report --curve"));
    /// A file that only this program reads, under its own name. It replaces any regular file, but
    /// never a pipe or a device.
    pub const CACHE: Self =
        Self { devices: false, head: 16, ..Self::new("a cache of limpid", |_| true) };

    /// A kind of file, recognised by its first 64 KiB.
    pub const fn new(name: &'static str, recognise: fn(&Existing<'_>) -> bool) -> Self {
        Self { name, recognise, head: 64 << 10, devices: true }
    }

    /// Whether a regular file is empty or of this kind.
    fn is_of(self, path: &Path) -> Result<bool> {
        let (mut file, metadata) = files::open(path)?;
        let mut existing = Existing { path, head: Vec::new(), length: metadata.len() };
        if existing.length == 0 {
            return Ok(true);
        }
        let read = (&mut file).take(self.head).read_to_end(&mut existing.head);
        read.map_err(|e| Error::io(path, "read", e))?;
        Ok((self.recognise)(&existing))
    }

    /// As [`FileKind::check`], for a file whose folder is created if needed.
    pub fn check_if_there(self, path: &Path) -> Result<()> {
        if path.exists() { self.check(path) } else { check_folder(folder_of(path)) }
    }

    /// Fails unless a file of this kind may be written to `path`. Pipes and devices accept any kind.
    ///
    /// # Errors
    /// [`Error::Usage`] for a file of another kind; [`Error::Io`] if `path` is a folder, its folder does
    /// not exist, or the existing file cannot be read.
    pub fn check(self, path: &Path) -> Result<()> {
        let fail = |problem: String| Err(Error::io(path, "write", io::Error::other(problem)));
        match path.metadata() {
            Ok(metadata) if metadata.is_dir() => fail("this is a folder, expected a file".into()),
            Ok(metadata) if metadata.is_file() && !self.is_of(path)? => {
                let (path, name) = (path.display(), self.name);
                Err(Error::Usage(format!(
                    "{path}: this file is not {name} and is left as it is; choose another name"
                )))
            }
            Ok(metadata) if !self.devices && !metadata.is_file() => {
                fail("this is a pipe or device, expected a file".into())
            }
            Ok(_) => Ok(()),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let folder = folder_of(path);
                match folder.metadata() {
                    Ok(metadata) if metadata.is_dir() => Ok(()),
                    Ok(_) => fail(format!("{} is not a folder", folder.display())),
                    Err(_) => {
                        let problem = format!("there is no folder {}", folder.display());
                        Err(Error::io(path, "write", io::Error::new(e.kind(), problem)))
                    }
                }
            }
            Err(e) => Err(Error::io(path, "write", e)),
        }
    }
}

/// Fails unless a folder exists or can be created.
///
/// # Errors
/// [`Error::Io`] naming the file that is in the way.
pub fn check_folder(folder: &Path) -> Result<()> {
    // The last ancestor of a relative path is empty, for the working directory, and is never found.
    let existing = folder.ancestors().find(|ancestor| ancestor.exists());
    match existing.filter(|existing| !existing.is_dir()) {
        Some(file) => {
            let problem = format!("{} is not a folder", file.display());
            Err(Error::io(folder, "write", io::Error::other(problem)))
        }
        None => Ok(()),
    }
}

/// The inputs and outputs of one command. They are compared before anything is drawn, so that no output
/// overwrites an input or another output.
#[derive(Debug, Clone, Default)]
pub struct Files {
    read: HashSet<Identity>,
    written: HashSet<Identity>,
    folders: HashSet<PathBuf>,
}

impl Files {
    /// Adds an input.
    pub fn reads(&mut self, path: &Path) {
        self.read.extend(Identity::of(path));
    }

    /// Whether a file is one of the inputs.
    pub fn has_input(&self, path: &Path) -> bool {
        Identity::of(path).is_some_and(|identity| self.read.contains(&identity))
    }

    /// Adds an output, without writing it.
    ///
    /// # Errors
    /// [`Error::Usage`] for a file that is an input or another output, as [`FileKind::check`], and
    /// [`Error::Io`] if the folder cannot be written to.
    pub fn writes(&mut self, path: &Path, kind: FileKind) -> Result<()> {
        let refuse = |problem: &str| Err(Error::Usage(format!("{}: {problem}", path.display())));
        let identity = Identity::of(path);
        if identity.as_ref().is_some_and(|identity| self.read.contains(identity)) {
            return refuse("the same command reads this file; choose another name for its output");
        }
        kind.check(path)?;
        let Some(identity) = identity else { return Ok(()) };
        if !self.written.insert(identity) {
            return refuse("two outputs of the command would be this file; choose another name");
        }
        if self.folders.insert(folder_of(path).to_owned()) {
            drop(Temporary::beside(path)?);
        }
        Ok(())
    }
}
