//! Foam, spray, bubbles and dust of a frame.

use std::sync::Arc;

use limpid::diffuse::{Diffuse, DiffuseKind};

use super::diffuse_files::{DiffuseFiles, Source};
use super::fluid::Origin;
use super::loader::Loader;
use crate::error::Result;
use crate::particles::{ReadOptions, Remark};
use crate::project::DiffuseSource;
use crate::sequence::{FrameTime, Sequence};

/// Radius of particles without one, in radii of the liquid's.
const RADIUS: f32 = 0.2;

impl Loader {
    /// Draws these particles with every frame, in place of those that files have.
    #[must_use]
    pub fn with_diffuse(mut self, diffuse: Arc<Diffuse>) -> Self {
        self.diffuse = vec![Source::Given(diffuse)];
        self
    }

    /// Draws the foam, spray, bubbles and dust of these files, in metres and with y up, whatever the axes and the unit of
    /// the liquid's files, in place of others.
    #[must_use]
    pub fn with_diffuse_files(mut self, sequence: Sequence) -> Self {
        let files = DiffuseFiles::new(sequence, None, DiffuseKind::Foam);
        self.diffuse = vec![Source::Files(Box::new(files))];
        self
    }

    /// The patterns of the files with foam, spray, bubbles and dust.
    pub fn diffuse_patterns(&self) -> impl Iterator<Item = &str> {
        self.diffuse_files().map(|files| files.files.sequence.pattern.as_str())
    }

    /// The files of foam, spray, bubbles and dust that some of these frames have, for a scene file in the working directory.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for files whose axes or unit are not the first fluid's.
    pub fn diffuse_sources(&self, frames: &[i64]) -> Result<Vec<DiffuseSource>> {
        let has = |files: &DiffuseFiles, frame| files.number(frame, self.frame).is_some();
        let of_frames = |files: &&DiffuseFiles| frames.iter().any(|&frame| has(files, frame));
        self.diffuse_files().filter(of_frames).map(|files| files.table(&self.fluids)).collect()
    }

    fn diffuse_files(&self) -> impl Iterator<Item = &DiffuseFiles> {
        self.diffuse.iter().filter_map(|source| match source {
            Source::Files(files) => Some(&**files),
            Source::Given(_) => None,
        })
    }

    /// Passes on the options for reading files that do not depend on their arrays.
    pub(super) fn limit_diffuse(&mut self, options: &ReadOptions) {
        for source in &mut self.diffuse {
            if let Source::Files(files) = source {
                files.files.options.max_unpacked = options.max_unpacked;
                files.files.options.skip_invalid = options.skip_invalid;
            }
        }
    }

    /// Origins of the diffuse particles at a frame, and a description of how they are drawn.
    pub fn diffuse_origins(&self, at: FrameTime) -> Vec<(Origin<'_>, String)> {
        let origins = self.diffuse_files().filter_map(|files| {
            let number = files.number(at.frame, self.frame)?;
            let drawn = format!("{} {:?}", files.described(), self.fps());
            Some((files.files.origin(number, self.missing), drawn))
        });
        origins.collect()
    }

    /// Reads the foam, spray, bubbles and dust at a frame time, y up, and remarks on their files; `None` without any.
    /// `radius` is that of the liquid's particles, m. A frame without a file has none, and is remarked on if a scene's one file
    /// belongs to another frame. Between frames they move on in their directions, if the loader knows the
    /// [rate](Loader::fps) of the frames.
    ///
    /// # Errors
    /// As [`Loader::particles`](Loader::particles).
    pub fn diffuse(
        &self,
        at: impl Into<FrameTime>,
        radius: f32,
    ) -> Result<(Option<Diffuse>, Vec<Remark>)> {
        let at = at.into();
        let (mut all, mut remarks) = (None::<Diffuse>, Vec::new());
        for source in &self.diffuse {
            let found = match source {
                Source::Given(diffuse) => Diffuse::clone(diffuse),
                Source::Files(files) => {
                    let number = files.number(at.frame, self.frame);
                    let Some(number) = number else {
                        remarks.extend(files.passed_over(at.frame, self.frame));
                        continue;
                    };
                    let (radius, fluids) = (RADIUS * radius, &self.fluids);
                    files.read(number, self.missing, fluids, radius, &mut remarks)?
                }
            };
            match &mut all {
                None => all = Some(found),
                Some(all) => {
                    all.append(&found);
                    for kind in found.kinds.iter().map(|&kind| kind as usize) {
                        all.colors[kind] = found.colors[kind];
                    }
                }
            }
        }
        let frames = at.next.abs_diff(at.frame) as f64 / self.sequence.stride() as f64;
        let seconds = self.fps().map_or(0.0, |fps| at.fraction * frames / fps);
        let all = all.map(|all| if seconds > 0.0 { all.after(seconds as f32) } else { all });
        Ok((all.filter(|all| !all.is_empty()), remarks))
    }
}
