//! What may be written where: nothing over an input, nothing over a file of another kind.

use std::collections::HashSet;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::{Temporary, folder_of};
use crate::camera_path::CameraPath;
use crate::error::{Error, Result};
use crate::particles;
use crate::{files, project};

/// What a file is written as. A file that is there already is replaced only if it is of the same
/// kind, by its contents, or empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FileKind {
    /// A PNG, JPEG, WebP or OpenEXR picture.
    Picture,
    /// A video, an animated GIF or PNG.
    Film,
    /// Particles, in the format that the file's name says.
    Particles,
    /// The ellipsoids beside a `.pos`.
    Ellipsoids,
    /// A scene.
    Scene,
    /// The keys of a camera path.
    CameraPath,
    /// JSON of `limpid render --stats` or `limpid report`.
    Measurements,
    /// What has become of frames, a line of JSON for each.
    Manifest,
    /// What happened in the viewer, a line of JSON for each event.
    Log,
    /// What a bake's frames were made from.
    BakeRecord,
    /// What expectations were drawn with.
    BlessRecord,
    /// Results for a CI system.
    Junit,
    /// A page of `limpid check` or `limpid report`.
    Page,
    /// The tables of `limpid report`.
    Tables,
    /// What `limpid report --curve` measures.
    Curve,
    /// What only this program reads, under a name of its own: no pipe and no device, but any file.
    Cache,
}

/// What pictures begin with, and films: an offset and the bytes there.
const PICTURES: [(usize, &[u8]); 4] =
    [(0, b"\x89PNG"), (0, b"\xff\xd8\xff"), (8, b"WEBP"), (0, b"\x76\x2f\x31\x01")];
const FILMS: [(usize, &[u8]); 4] =
    [(4, b"ftyp"), (0, b"\x1a\x45\xdf\xa3"), (0, b"GIF8"), (0, b"\x89PNG")];

/// As much of a file tells of what kind it is: of a picture or film, and of others.
const MARK: u64 = 16;
const HEAD: u64 = 64 << 10;

impl FileKind {
    /// As messages call it.
    fn name(self) -> &'static str {
        match self {
            Self::Picture => "a picture",
            Self::Film => "a film",
            Self::Particles => "a particle file of the format that its name says",
            Self::Ellipsoids => "the ellipsoids of a .pos file",
            Self::Scene => "a scene",
            Self::CameraPath => "a camera path",
            Self::Measurements => "statistics or a report of limpid",
            Self::Manifest => "a manifest of limpid",
            Self::Log => "a log of limpid",
            Self::BakeRecord => "the record of a bake",
            Self::BlessRecord => "the record of a suite",
            Self::Junit => "a JUnit file",
            Self::Page => "a page of limpid",
            Self::Tables => "a report of limpid",
            Self::Curve => "a curve of limpid",
            Self::Cache => "a cache of limpid",
        }
    }

    /// Whether a regular file is of this kind.
    fn is_of(self, path: &Path) -> Result<bool> {
        let (file, metadata) = files::open(path)?;
        let length = metadata.len();
        if length == 0 {
            return Ok(true);
        }
        let mut head = Vec::new();
        let enough = match self {
            Self::Picture | Self::Film | Self::Cache => MARK,
            _ => HEAD,
        };
        let read = (&file).take(enough).read_to_end(&mut head);
        read.map_err(|e| Error::io(path, "read", e))?;
        let any = |marks: &[(usize, &[u8])]| {
            marks.iter().any(|(at, mark)| head.get(*at..).is_some_and(|h| h.starts_with(mark)))
        };
        let text = String::from_utf8_lossy(&head);
        // Of one that a full disk has cut off there may be less than its mark.
        let begins = |mark: &str| text.starts_with(mark) || mark.starts_with(&*text);
        let packed: String = text.chars().take(100).filter(|c| !c.is_whitespace()).collect();
        let json = |key: &str| {
            let mark = format!("{{\"{key}\":");
            packed.starts_with(&mark) || mark.starts_with(&packed)
        };
        Ok(match self {
            Self::Picture => any(&PICTURES),
            Self::Film => any(&FILMS),
            Self::Particles => particles::is_of_its_format(path, &head, length),
            Self::Ellipsoids => particles::are_ellipsoids(path, &head, length),
            Self::Scene => files::read_text(path).is_ok_and(|text| project::is_scene(&text)),
            Self::CameraPath => CameraPath::load(path).is_ok(),
            Self::Measurements => json("adapter"),
            Self::Manifest => json("frame"),
            Self::Log => json("event") || begins("{") && text.contains("\"event\":"),
            Self::BakeRecord => json("simulation"),
            Self::BlessRecord => begins("# What `limpid check --bless` drew"),
            Self::Junit => begins("<?xml") && text.contains("<testsuite") || begins("<testsuite"),
            Self::Page => begins("<!DOCTYPE html>") && text.contains("<title>limpid"),
            Self::Tables => begins("Measured on "),
            Self::Curve => begins("# Written by `limpid report --curve"),
            Self::Cache => true,
        })
    }

    /// As [`FileKind::check`], also where the folder is created when the file is written.
    pub fn check_if_there(self, path: &Path) -> Result<()> {
        if path.exists() { self.check(path) } else { check_folder(folder_of(path)) }
    }

    /// Fails unless a file of this kind may be written to `path`. Pipes and devices take any.
    ///
    /// # Errors
    /// [`Error::Usage`] for a file of another kind, [`Error::Io`] for a folder, one that is not there,
    /// and a file that cannot be looked at.
    pub fn check(self, path: &Path) -> Result<()> {
        let fail = |problem: String| Err(Error::io(path, "write", io::Error::other(problem)));
        match path.metadata() {
            Ok(metadata) if metadata.is_dir() => fail("this is a folder, a file expected".into()),
            Ok(metadata) if metadata.is_file() && !self.is_of(path)? => {
                let (path, name) = (path.display(), self.name());
                Err(Error::Usage(format!(
                    "{path}: this file is not {name} and is left as it is; choose another name"
                )))
            }
            Ok(metadata) if self == Self::Cache && !metadata.is_file() => {
                fail("this is a pipe or device, a file expected".into())
            }
            Ok(_) => Ok(()),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let folder = folder_of(path);
                match folder.metadata() {
                    Ok(metadata) if metadata.is_dir() => Ok(()),
                    Ok(_) => fail(format!("{} is not a folder", folder.display())),
                    Err(_) => fail(format!("there is no folder {}", folder.display())),
                }
            }
            Err(e) => Err(Error::io(path, "write", e)),
        }
    }
}

/// Fails unless a folder is there or can be created.
///
/// # Errors
/// [`Error::Io`] naming what is there instead.
pub fn check_folder(folder: &Path) -> Result<()> {
    // Of the empty path the parent is the working directory.
    let there = folder.ancestors().find(|ancestor| ancestor.exists());
    match there.filter(|there| !there.is_dir()) {
        Some(file) => {
            let problem = format!("{} is not a folder", file.display());
            Err(Error::io(folder, "write", io::Error::other(problem)))
        }
        None => Ok(()),
    }
}

/// The files of one command: what it reads, and what it is going to write. All of them are compared
/// before anything is drawn, so that no output is an input, or two outputs one file.
#[derive(Debug, Clone, Default)]
pub struct Files {
    read: HashSet<Identity>,
    written: HashSet<Identity>,
    folders: HashSet<PathBuf>,
}

/// The same for all paths to a file: links of both kinds, and names that are not there yet.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Identity {
    #[cfg(unix)]
    Inode(u64, u64),
    Place(PathBuf),
}

impl Identity {
    /// `None` for what is no regular file: several may write to one device.
    fn of(path: &Path) -> Option<Self> {
        match path.metadata() {
            Ok(metadata) if !metadata.is_file() => None,
            #[cfg(unix)]
            Ok(metadata) => {
                use std::os::unix::fs::MetadataExt as _;
                Some(Self::Inode(metadata.dev(), metadata.ino()))
            }
            #[cfg(not(unix))]
            Ok(_) => Some(Self::Place(path.canonicalize().unwrap_or_else(|_| path.to_owned()))),
            Err(_) => {
                let folder = folder_of(path);
                let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
                Some(Self::Place(folder.join(path.file_name()?)))
            }
        }
    }
}

impl Files {
    /// Notes an input.
    pub fn reads(&mut self, path: &Path) {
        self.read.extend(Identity::of(path));
    }

    /// Whether a file is one of the inputs.
    pub fn has_input(&self, path: &Path) -> bool {
        Identity::of(path).is_some_and(|identity| self.read.contains(&identity))
    }

    /// Notes an output, of which nothing is written yet.
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
