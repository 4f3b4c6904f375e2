//! Pictures in separate files, with their intermediate images.

use std::path::{Path, PathBuf};

use crate::fingerprint::{self, Fingerprint};
use glam::UVec2;
use image::DynamicImage;
use limpid::aov::{Aov, Part};
use limpid_io::exr;
use limpid_io::film::Shot;
use limpid_io::output::{self, OutputNames, PictureFormat};

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

/// Pictures in separate files.
#[derive(Clone)]
pub(super) struct Pictures {
    pub(super) names: OutputNames,
    pub(super) format: PictureFormat,
    pub(super) size: UVec2,
    /// Intermediate images beside each, in a file at [`aov_path`].
    pub(super) aovs: Option<Vec<Aov>>,
}

impl Pictures {
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

fn listed(aovs: &[Aov]) -> String {
    let names: Vec<String> = aovs.iter().map(Aov::to_string).collect();
    names.join(",")
}

/// Path of the intermediate images of a picture: `frame_0020.aov.exr` for `frame_0020.png`.
pub(super) fn aov_path(picture: &Path) -> PathBuf {
    picture.with_extension("aov.exr")
}
