//! Output of pictures and films.

use std::path::{Path, PathBuf};

use crate::fingerprint::{self, Fingerprint};
use glam::UVec2;
use image::{DynamicImage, RgbImage};
use limpid::aov::{Aov, Part};
use limpid_io::Error;
use limpid_io::exr;
use limpid_io::film::{Film, Shot};
use limpid_io::input;
use limpid_io::output::{self, FileKind, Files, OutputNames, PictureFormat};

use super::Args;
use crate::standard;

/// A drawn picture with the images that are written beside it.
pub(super) struct DrawnPicture {
    pub(super) picture: DynamicImage,
    /// The linear picture, if it is written.
    pub(super) radiance: Option<Part>,
    /// Intermediate images, beside the picture.
    pub(super) images: Vec<Part>,
    pub(super) fingerprint: Fingerprint,
}

impl DrawnPicture {
    /// Memory that it takes.
    pub(super) fn bytes(&self) -> usize {
        let parts = self.radiance.iter().chain(&self.images);
        let channels = parts.flat_map(|part| &part.channels);
        self.picture.as_bytes().len() + channels.map(|c| size_of_val(&c.values[..])).sum::<usize>()
    }
}

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

/// Pictures in separate files.
#[derive(Clone)]
pub(super) struct Pictures {
    names: OutputNames,
    format: PictureFormat,
    size: UVec2,
    aovs: Option<Vec<Aov>>,
}

/// Fails, before anything is drawn, if an output is an input, another output or a file of another kind,
/// or cannot be written.
pub(super) fn check(args: &Args, shots: &[Shot]) -> limpid_io::Result<()> {
    let mut files = Files::default();
    for input in args.input.iter().chain(&args.others).chain(&args.scene) {
        input::files_of(input).iter().for_each(|path| files.reads(path));
    }
    args.camera_path.iter().chain(&args.views).for_each(|path| files.reads(path));
    match args.film_path() {
        _ if is_standard(args) => check_standard(args, shots.len())?,
        Some(path) => files.writes(path, FileKind::FILM)?,
        None => {
            let pictures = Pictures::new(args, shots.len())?;
            pictures.names.create_folder()?;
            for shot in args.shard.unwrap_or_default().of(shots) {
                let path = pictures.path(shot);
                files.writes(&path, FileKind::PICTURE)?;
                if pictures.aovs.is_some() {
                    files.writes(&aov_path(&path), FileKind::PICTURE)?;
                }
            }
        }
    }
    args.stats.iter().try_for_each(|path| files.writes(path, FileKind::MEASUREMENTS))?;
    args.manifest.iter().try_for_each(|path| files.writes(path, FileKind::MANIFEST))
}

impl Output {
    /// Opens the output of a run of `count` pictures, on all machines together.
    pub(super) fn open(args: &Args, count: usize, fps: f64) -> limpid_io::Result<Self> {
        if is_standard(args) {
            return Ok(Self::Standard);
        }
        let Some(path) = args.film_path() else {
            let pictures = Pictures::new(args, count)?;
            if args.alpha && pictures.format == PictureFormat::Jpeg {
                let problem = "--alpha: a .jpg holds no coverage; write .png, .webp or .exr";
                return Err(Error::Usage(problem.into()));
            }
            output::sweep(folder_of(&pictures.names.path(0)));
            return Ok(Self::Pictures(pictures));
        };
        let name = path.display();
        let refuse = |problem: &str| Err(Error::Usage(format!("{name}: {problem}")));
        // Only a name with a placeholder can name two files.
        if OutputNames::parse(path, 2).is_ok() {
            return refuse("a film is one file; leave the place for the number out");
        }
        if args.shard.is_some() {
            return refuse("--shard shares pictures out, and a film needs them all; write .png");
        }
        if args.claim {
            return refuse("--claim shares pictures out, and a film needs them all; write .png");
        }
        if args.skip_existing {
            return refuse("--skip-existing completes pictures; a film is written whole");
        }
        if args.aov.is_some() {
            return refuse("--aov goes beside pictures; write .png");
        }
        if args.alpha {
            return refuse("--alpha: films hold no coverage; write .png, .webp or .exr");
        }
        if args.manifest.is_some() {
            return refuse("--manifest lists pictures, and a film is one file; write .png");
        }
        output::sweep(folder_of(path));
        let film = Film::create(path, args.size, fps)?;
        Ok(Self::Film(Box::new(FilmOutput { film, last: None, failed: 0 })))
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

    /// Whether the pictures are linear radiance.
    pub(super) fn is_linear(&self) -> bool {
        self.pictures().is_some_and(|pictures| pictures.format == PictureFormat::Exr)
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

/// Whether the picture goes to standard output.
fn is_standard(args: &Args) -> bool {
    args.output.as_deref().is_some_and(standard::is_dash)
}

/// Fails unless standard output gets one picture, and nothing that goes beside it or depends on its file.
fn check_standard(args: &Args, count: usize) -> limpid_io::Result<()> {
    let refused = [
        (args.shard.is_some(), "--shard"),
        (args.claim, "--claim"),
        (args.skip_existing, "--skip-existing"),
        (args.aov.is_some(), "--aov"),
        (args.manifest.is_some(), "--manifest"),
    ];
    if let Some((_, option)) = refused.into_iter().find(|(given, _)| *given) {
        return Err(Error::Usage(format!("-o -: {option} needs a file; write .png")));
    }
    if count != 1 {
        let problem =
            format!("-o -: one picture, not {count}; choose one with --frames, or a folder");
        return Err(Error::Usage(problem));
    }
    standard::check_output()
}

impl Pictures {
    /// Parses the output name for `count` pictures.
    fn new(args: &Args, count: usize) -> limpid_io::Result<Self> {
        let default = if count == 1 { "limpid.png" } else { "limpid_####.png" };
        let names =
            OutputNames::parse(args.output.as_deref().unwrap_or(Path::new(default)), count)?;
        let path = names.path(0);
        let format = PictureFormat::of(&path).map_err(|error| {
            Error::Usage(format!("{error}, a film in .mp4, .webm, .gif or .apng"))
        })?;
        if (args.skip_existing || args.claim) && !format.holds_notes() {
            let problem = "--skip-existing and --claim need .png or .exr, which hold what a picture \
                           was drawn from";
            return Err(Error::Usage(format!("{}: {problem}", path.display())));
        }
        Ok(Self { names, format, size: args.size, aovs: args.aov.clone() })
    }

    pub(super) fn path(&self, shot: &Shot) -> PathBuf {
        self.names.path(shot.number)
    }

    /// Whether a picture and its intermediate images are complete.
    pub(super) fn are_whole(&self, shot: &Shot, fingerprint: Fingerprint) -> bool {
        let path = self.path(shot);
        let images = self
            .aovs
            .as_ref()
            .is_none_or(|aovs| fingerprint.with(&listed(aovs)).is_of_exr(&aov_path(&path)));
        images
            && match self.format {
                PictureFormat::Exr => fingerprint.is_of_exr(&path),
                _ => fingerprint.is_of_png(&path, self.size),
            }
    }

    /// Writes a picture, and returns the checksum of its pixels. Intermediate images come first: if the picture exists,
    /// so do they.
    pub(super) fn write(&self, shot: &Shot, drawn: DrawnPicture) -> limpid_io::Result<u32> {
        let DrawnPicture { picture, radiance, images, fingerprint } = drawn;
        let path = self.path(shot);
        if let Some(aovs) = self.aovs.as_deref().filter(|_| !images.is_empty()) {
            let note = fingerprint.with(&listed(aovs)).exr_note();
            exr::write_noted(&aov_path(&path), images, note)?;
        }
        let pixels = picture.as_bytes();
        match radiance {
            Some(radiance) => exr::write_noted(&path, vec![radiance], fingerprint.exr_note())?,
            None => output::write_picture(&path, &picture, &fingerprint.notes(pixels))?,
        }
        Ok(fingerprint::checksum(pixels))
    }
}

/// The folder of a file, whether or not it exists.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

fn listed(aovs: &[Aov]) -> String {
    let names: Vec<String> = aovs.iter().map(Aov::to_string).collect();
    names.join(",")
}

/// Path of the intermediate images of a picture: `frame_0020.aov.exr` for `frame_0020.png`.
fn aov_path(picture: &Path) -> PathBuf {
    picture.with_extension("aov.exr")
}
