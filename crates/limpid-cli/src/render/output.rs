//! Output of pictures and films.

use std::path::Path;

use glam::UVec2;
use image::RgbImage;
use limpid_io::Error;
use limpid_io::film::{Film, Shot};
use limpid_io::output;

use super::destination::Destination;
use super::pictures::{DrawnPicture, Pictures};
use crate::{fingerprint, standard};

/// The destination of the pictures.
pub(super) enum Output {
    Pictures(Pictures),
    Film(Box<FilmOutput>),
    /// One PNG on standard output.
    Standard,
}

/// A film in which failed pictures are replaced.
pub(super) struct FilmOutput {
    film: Film,
    /// The last picture that was drawn.
    last: Option<RgbImage>,
    /// Number of failed pictures before the first that is drawn.
    failed: usize,
}

impl FilmOutput {
    fn push(&mut self, picture: RgbImage) -> limpid_io::Result<()> {
        for _ in 0..std::mem::take(&mut self.failed) {
            self.film.push(&picture)?;
        }
        self.film.push(&picture)?;
        self.last = Some(picture);
        Ok(())
    }

    /// Repeats the picture before a failed one, or else the first, so that the others keep their times.
    fn repeat(&mut self) -> limpid_io::Result<()> {
        match &self.last {
            Some(picture) => self.film.push(picture),
            None => {
                self.failed += 1;
                Ok(())
            }
        }
    }
}

impl Output {
    /// Opens the output of a run, whose pictures have `size` pixels and follow at `fps` per second.
    pub(super) fn open(destination: Destination, size: UVec2, fps: f64) -> limpid_io::Result<Self> {
        match destination {
            Destination::Pictures(pictures) => {
                output::sweep(folder_of(&pictures.names.path(0)));
                Ok(Self::Pictures(pictures))
            }
            Destination::Film(path) => {
                output::sweep(folder_of(&path));
                let film = Film::create(&path, size, fps)?;
                Ok(Self::Film(Box::new(FilmOutput { film, last: None, failed: 0 })))
            }
            Destination::Standard => Ok(Self::Standard),
        }
    }

    pub(super) fn is_film(&self) -> bool {
        matches!(self, Self::Film(_))
    }

    pub(super) fn pictures(&self) -> Option<&Pictures> {
        match self {
            Self::Pictures(pictures) => Some(pictures),
            Self::Film(_) | Self::Standard => None,
        }
    }

    /// Writes a picture, and returns the checksum of its pixels.
    pub(super) fn write(&mut self, shot: &Shot, drawn: DrawnPicture) -> limpid_io::Result<u32> {
        let film = match self {
            Self::Pictures(pictures) => return pictures.write(shot, drawn),
            Self::Film(film) => Some(film),
            Self::Standard => None,
        };
        let DrawnPicture { picture, fingerprint, .. } = drawn;
        let pixels = fingerprint::checksum(picture.as_bytes());
        match film {
            Some(film) => film.push(picture.into_rgb8())?,
            None => {
                let notes = fingerprint.notes(picture.as_bytes());
                let mut bytes = Vec::new();
                output::encode_png(&mut bytes, &picture, &notes).map_err(|source| Error::Io {
                    path: "-".into(),
                    action: "write",
                    source,
                })?;
                standard::write(&bytes)?;
            }
        }
        Ok(pixels)
    }

    /// Replaces a picture that failed, where the others depend on it.
    pub(super) fn replace(&mut self) -> limpid_io::Result<()> {
        match self {
            Self::Film(film) => film.repeat(),
            Self::Pictures(_) | Self::Standard => Ok(()),
        }
    }

    /// Describes what was written, such as `wrote a.png`: the pictures with these `numbers`, and the
    /// number of others that existed already.
    pub(super) fn summary(&self, numbers: &[i64], others: usize) -> String {
        let count = numbers.len();
        let existing = match others {
            0 => String::new(),
            1 => "; 1 already existed".into(),
            _ => format!("; {others} already existed"),
        };
        let path = |number: Option<&i64>| match (self, number) {
            (Self::Pictures(pictures), Some(&number)) => {
                pictures.names.path(number).display().to_string()
            }
            (Self::Pictures(_), None) => String::new(),
            (Self::Film(output), _) => output.film.path().display().to_string(),
            (Self::Standard, _) => "standard output".into(),
        };
        let (first, last) = (path(numbers.iter().min()), path(numbers.iter().max()));
        match self {
            _ if count == 0 => format!("wrote nothing{existing}"),
            Self::Film(_) if count == 1 => format!("wrote {first}, one picture"),
            Self::Film(_) => format!("wrote {first}, {count} pictures"),
            _ if count == 1 => format!("wrote {first}{existing}"),
            _ => format!("wrote {count} pictures, {first} to {last}{existing}"),
        }
    }

    pub(super) fn finish(self) -> limpid_io::Result<()> {
        match self {
            Self::Pictures(_) | Self::Standard => Ok(()),
            Self::Film(output) if output.last.is_none() => Ok(()),
            Self::Film(output) => output.film.finish(),
        }
    }
}

/// The folder of a file, whether or not it exists.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}
