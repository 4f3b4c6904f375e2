//! `limpid render --whitewater`: foam, spray and bubbles that are made before the pictures.

use std::path::{Path, PathBuf};

use limpid::scene::Scene;
use limpid_io::Error;
use limpid_io::input::{FrameTime, Loader};
use limpid_io::sequence::Sequence;
use limpid_io::whitewater::{Choices, Files};

use super::destination::Destination;
use crate::signals;
use crate::whitewater::{choices_for, make};

/// The folder of the whitewater beside what is drawn.
fn folder(destination: &Destination) -> limpid_io::Result<PathBuf> {
    match destination {
        Destination::Pictures(pictures) => {
            let folder = pictures.names.path(0);
            Ok(folder.parent().unwrap_or(Path::new("")).join("whitewater"))
        }
        Destination::Film(path) => {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            Ok(path.with_file_name(name + "_whitewater"))
        }
        Destination::Standard => {
            let problem = "--whitewater writes files beside the picture, and standard output has no place for them";
            Err(Error::Usage(problem.into()))
        }
    }
}

/// Makes the whitewater of a loader up to the last of some times, and returns the loader that draws it.
pub(super) fn beside(
    loader: Loader,
    scene: &Scene,
    destination: &Destination,
    times: &[FrameTime],
    keep_going: bool,
) -> limpid_io::Result<Loader> {
    let files = Files::of(&loader, &folder(destination)?, "bgeo");
    let last = times.iter().map(|at| at.frame.max(at.next)).max().unwrap_or(i64::MIN);
    // After a signal no picture is drawn either.
    signals::finish_first();
    make(&loader, scene, files.clone(), choices_for(scene, Choices::default()), keep_going, last)?;
    Ok(loader.with_diffuse_files(Sequence::open(files.pattern())?))
}
