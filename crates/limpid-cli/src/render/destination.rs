//! The destination of a run's pictures, from the arguments.

use std::path::{Path, PathBuf};

use limpid_io::Error;
use limpid_io::film::{FilmFormat, Shot};
use limpid_io::input;
use limpid_io::output::{FileKind, Files, OutputNames, PictureFormat};

use super::Args;
use super::pictures::{Pictures, aov_path};
use crate::standard;

/// The destination of the pictures.
pub(super) enum Destination {
    Pictures(Pictures),
    Film(PathBuf),
    /// One PNG on standard output.
    Standard,
}

/// The output file, if it is a film.
pub(super) fn film_path(args: &Args) -> Option<&Path> {
    let path = args.output.as_deref()?;
    FilmFormat::of(path).filter(|_| !path.is_dir()).map(|_| path)
}

impl Destination {
    /// Destination of a run that draws `shots`, on all machines together, from `inputs`.
    ///
    /// # Errors
    /// [`Error::Usage`] and those of [`Files`], before anything is drawn, if an output is an input, another output or a
    /// file of another kind, if it cannot be written, or if its format cannot hold the pictures.
    pub(super) fn new(args: &Args, inputs: &[PathBuf], shots: &[Shot]) -> limpid_io::Result<Self> {
        let mut files = Files::default();
        for input in inputs.iter().chain(&args.scene) {
            input::files_of(input).iter().for_each(|path| files.reads(path));
        }
        args.camera_path.iter().chain(&args.views).for_each(|path| files.reads(path));
        let destination = match film_path(args) {
            _ if is_standard(args) => {
                check_standard(args, shots.len())?;
                Self::Standard
            }
            Some(path) => {
                files.writes(path, FileKind::FILM)?;
                check_film(args, path)?;
                Self::Film(path.to_owned())
            }
            None => {
                let pictures = pictures(args, shots.len())?;
                pictures.names.create_folder()?;
                for shot in args.shard.unwrap_or_default().of(shots) {
                    let path = pictures.path(shot);
                    files.writes(&path, FileKind::PICTURE)?;
                    if pictures.aovs.is_some() {
                        files.writes(&aov_path(&path), FileKind::PICTURE)?;
                    }
                }
                Self::Pictures(pictures)
            }
        };
        args.stats.iter().try_for_each(|path| files.writes(path, FileKind::MEASUREMENTS))?;
        args.manifest.iter().try_for_each(|path| files.writes(path, FileKind::MANIFEST))?;
        Ok(destination)
    }

    pub(super) fn pictures(&self) -> Option<&Pictures> {
        match self {
            Self::Pictures(pictures) => Some(pictures),
            Self::Film(_) | Self::Standard => None,
        }
    }

    /// Whether the pictures are linear radiance.
    pub(super) fn is_linear(&self) -> bool {
        self.pictures().is_some_and(|pictures| pictures.format == PictureFormat::Exr)
    }
}

/// The files of `count` pictures.
fn pictures(args: &Args, count: usize) -> limpid_io::Result<Pictures> {
    let default = if count == 1 { "limpid.png" } else { "limpid_####.png" };
    let names = OutputNames::parse(args.output.as_deref().unwrap_or(Path::new(default)), count)?;
    let path = names.path(0);
    let format = PictureFormat::of(&path)
        .map_err(|error| Error::Usage(format!("{error}, a film in .mp4, .webm, .gif or .apng")))?;
    if (args.skip_existing || args.claim) && !format.holds_notes() {
        let problem = "--skip-existing and --claim need .png or .exr, which hold what a picture \
                       was drawn from";
        return Err(Error::Usage(format!("{}: {problem}", path.display())));
    }
    if args.alpha && format == PictureFormat::Jpeg {
        let problem = "--alpha: a .jpg holds no coverage; write .png, .webp or .exr";
        return Err(Error::Usage(problem.into()));
    }
    Ok(Pictures { names, format, size: args.size, aovs: args.aov.clone() })
}

/// Fails for options that a film cannot hold.
fn check_film(args: &Args, path: &Path) -> limpid_io::Result<()> {
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
    Ok(())
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
