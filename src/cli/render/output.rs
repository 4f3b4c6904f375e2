//! Where the pictures go.

use std::path::{Path, PathBuf};

use glam::UVec2;
use image::RgbImage;
use limpid::Error;
use limpid::aov::{self, Aov, Part};
use limpid::film::{Film, Take};
use limpid::fingerprint::Fingerprint;
use limpid::output::{self, OutputNames};

use super::{Args, film_path};

pub(super) enum Output {
    Pictures(Pictures),
    Film(Box<Film>),
}

/// Files of their own.
#[derive(Clone)]
pub(super) struct Pictures {
    names: OutputNames,
    size: UVec2,
    aovs: Option<Vec<Aov>>,
}

impl Output {
    /// For `count` pictures of all machines.
    pub(super) fn open(args: &Args, count: usize, fps: f64) -> limpid::Result<Self> {
        let Some(path) = film_path(args) else {
            let default = if count == 1 { "limpid.png" } else { "limpid_####.png" };
            let names = OutputNames::parse(args.output.as_deref().unwrap_or(default), count)?;
            names.create_folder()?;
            output::sweep(folder_of(&names.path(0)));
            return Ok(Self::Pictures(Pictures { names, size: args.size, aovs: args.aov.clone() }));
        };
        let name = path.display();
        let refuse = |problem: &str| Err(Error::Usage(format!("{name}: {problem}")));
        // Only a name with a place for the number is good for two.
        if OutputNames::parse(&name.to_string(), 2).is_ok() {
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
        if args.keep_going {
            return refuse("--keep-going leaves frames out; a film is written whole");
        }
        if args.aov.is_some() {
            return refuse("--aov goes beside pictures; write .png");
        }
        if args.manifest.is_some() {
            return refuse("--manifest lists pictures, and a film is one file; write .png");
        }
        output::sweep(folder_of(path));
        Film::create(path, args.size, fps).map(|film| Self::Film(Box::new(film)))
    }

    pub(super) fn pictures(&self) -> Option<&Pictures> {
        match self {
            Self::Pictures(pictures) => Some(pictures),
            Self::Film(_) => None,
        }
    }

    pub(super) fn write(
        &mut self,
        take: &Take,
        picture: &RgbImage,
        fingerprint: Fingerprint,
    ) -> limpid::Result<()> {
        match self {
            Self::Pictures(pictures) => {
                output::write_frame(&pictures.path(take), picture, fingerprint)
            }
            Self::Film(film) => film.push(picture),
        }
    }

    pub(super) fn finish(self) -> limpid::Result<()> {
        match self {
            Self::Pictures(_) => Ok(()),
            Self::Film(film) => film.finish(),
        }
    }
}

impl Pictures {
    pub(super) fn path(&self, take: &Take) -> PathBuf {
        self.names.path(take.number)
    }

    /// Whether nothing is left to draw of it.
    pub(super) fn are_whole(&self, take: &Take, fingerprint: Fingerprint) -> bool {
        let path = self.path(take);
        let images = self
            .aovs
            .as_ref()
            .is_none_or(|aovs| aov::is_whole(&aov_path(&path), fingerprint.with(&listed(aovs))));
        images && fingerprint.is_of_png(&path, self.size)
    }

    pub(super) fn write_aovs(
        &self,
        take: &Take,
        parts: Vec<Part>,
        fingerprint: Fingerprint,
    ) -> limpid::Result<()> {
        let fingerprint = fingerprint.with(&listed(self.aovs.as_deref().unwrap_or_default()));
        aov::write_frame(&aov_path(&self.path(take)), parts, fingerprint)
    }
}

/// The folder that a file is in, or would be.
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

/// `frame_0020.aov.exr` for `frame_0020.png`; any other ending stays, it may be the number.
fn aov_path(picture: &Path) -> PathBuf {
    let name = picture.to_string_lossy();
    format!("{}.aov.exr", name.strip_suffix(".png").unwrap_or(&name)).into()
}
