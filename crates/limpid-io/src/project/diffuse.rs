//! `[[diffuse]]` of a scene file: foam, spray, bubbles and dust beside the liquid.

use std::path::{Path, PathBuf};

use glam::Vec3;
use limpid::diffuse::DiffuseKind;
use limpid::liquid::particles::drawable;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Files of foam, spray, bubbles and dust. Their axes and their unit are those of the scene's first fluid.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiffuseSource {
    /// A pattern or a folder, whose numbers are those of the liquid's frames; or one file, which is shown with the scene's
    /// frame, or with all frames of a scene that selects none. Relative to the scene file.
    pub source: PathBuf,
    /// Albedo of its kinds, linear RGB from 0 to 1; if absent white, and brown for dust.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<Vec3>,
    /// The kinds that are shown; all if empty. In files that tell no kinds, all particles are of the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kinds: Vec<DiffuseKind>,
    /// Radius of particles without one, m; if absent a fifth of the liquid's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
}

/// Checks the tables of a file, whose paths are relative to `folder`.
pub(super) fn validated(
    mut all: Vec<DiffuseSource>,
    folder: &Path,
    fail: &dyn Fn(String) -> Error,
) -> Result<Vec<DiffuseSource>> {
    for (number, of) in (1..).zip(&mut all) {
        let fail = |problem: &str| fail(format!("[[diffuse]] {number}: {problem}"));
        let is_albedo = |c: Vec3| c.cmpge(Vec3::ZERO).all() && c.cmple(Vec3::ONE).all();
        if of.color.is_some_and(|color| !is_albedo(color)) {
            return Err(fail("color must be between 0 and 1"));
        }
        if of.radius.is_some_and(|radius| !drawable(radius)) {
            return Err(fail("radius must be 1e-12 to 1e12 m"));
        }
        of.source = folder.join(&of.source);
    }
    Ok(all)
}
