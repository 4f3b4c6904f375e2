//! Values that neither files nor scene have, from the particles.

use glam::DVec3;
use limpid::look::{Body, Look};
use limpid::scene::{Scene, Solid};

use super::fluid::Fluid;
use super::loader::Loader;
use super::{Input, diffuse_files};
use crate::error::Result;
use crate::project::{Automatic, Project};

impl Input {
    /// Gives the loader of its frames and its project, with the values that neither files nor scene have: the radius
    /// of each fluid from its first frame with particles; the axis that points up, by format, by the particles' plane or, for files without a scene, by the
    /// surface of the liquid; the parts of the scene that a look provides; and the camera, which sees the
    /// [bulk](limpid::liquid::Bulk) of the particles in the first frame, the last one and the one between.
    /// So a sequence has one radius and one view, however it is shared among machines.
    ///
    /// A single file that belongs to a sequence gets the sequence's radius: the guess from its first
    /// frame with particles. If the two guesses differ by more than 10 %, the files are taken to be of
    /// different simulations despite their names, and the file keeps its own guess.
    ///
    /// # Errors
    /// As [`crate::particles::read`].
    pub fn resolve(self) -> Result<(Loader, Project)> {
        let Self { project, mut loader, framing, measured, together } = self;
        let bare =
            || Project { automatic: Some(Automatic::all(Look::default())), ..Project::default() };
        let mut project = project.unwrap_or_else(bare);
        if let Some(tables) = &project.diffuse {
            loader.diffuse = diffuse_files::of_scene(tables)?;
        }
        let complete = project.camera.is_some() && project.automatic.is_none() && !measured;
        if complete && loader.fluids.iter().all(|fluid| fluid.radius.is_some()) {
            loader.fluids.iter_mut().for_each(Fluid::resolve_up);
            project.turn_cameras(loader.up().0);
            return Ok((loader.with_motion(&project.motion), project));
        }
        let mut body: Option<Body> = None;
        for fluid in &mut loader.fluids {
            let found = fluid.resolve(!complete)?;
            body = match (body, found) {
                (Some(a), Some(b)) => Some(a.with(b)),
                (a, b) => a.or(b),
            };
        }
        let body = body.unwrap_or_else(|| Body::filling(-DVec3::ONE, DVec3::ONE, 0.0));
        loader = loader.with_motion(&project.motion);
        let shown = solids_shown(&loader, &project.scene);
        let body = shown.iter().fold(body, |body, solids| body.among(solids));
        let body = together.unwrap_or(body);
        project.complete(&body);
        project.turn_cameras(loader.up().0);
        project.camera.get_or_insert_with(|| body.camera(framing));
        loader.body = Some(body);
        Ok((loader.with_motion(&project.motion), project))
    }
}

/// The solids of `scene` in the first frame, the last one and the one between.
fn solids_shown(loader: &Loader, scene: &Scene) -> Vec<Vec<Solid>> {
    let frames = &loader.sequence.frames;
    let last = frames.len().saturating_sub(1);
    let mut shown = vec![0, last / 2, last];
    shown.dedup();
    let still = loader.motion().is_none();
    shown.truncate(if still { 1 } else { shown.len() });
    let at = |i: usize| {
        // Damaged files are an error once the frame is drawn.
        let moved = frames.get(i).and_then(|frame| loader.moved(frame, scene).ok());
        moved.unwrap_or_default().solids(&scene.solids).into_owned()
    };
    shown.into_iter().map(at).collect()
}
