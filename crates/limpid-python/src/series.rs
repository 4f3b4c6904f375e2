//! Properties of a picture that later ones keep, in its scene.

use limpid::liquid::{Particles, Up, likely_up};
use limpid::look::{Body, Look};
use limpid_io::color_by::{ColorBy, ColorScale};
use limpid_io::input::{FrameTime, Loader, UpFrom};
use limpid_io::project::{Automatic, Project};

use crate::colors;

/// The length of liquid behind which tints are seen, m: that of the scene, or else that which light typically crosses,
/// which becomes the scene's.
pub(crate) fn tint_thickness(
    project: &mut Project,
    loader: &Loader,
    particles: &Particles,
) -> limpid_io::Result<f64> {
    let thickness = match project.tint_thickness {
        Some(thickness) => thickness,
        None => {
            let radius = loader.radius(FrameTime::at(0), particles)?;
            Body::new(particles, radius).map_or(1.0, |body| body.thickness())
        }
    };
    project.tint_thickness = Some(thickness);
    Ok(thickness)
}

/// Keeps the colours of values. Equal values have no range.
pub(crate) fn keep_scale(project: &mut Project, scale: &ColorScale) {
    let [low, high] = scale.range;
    let by = project.color_by.get_or_insert_with(|| ColorBy::new(colors::of_values()));
    if by.attribute.is_mapped() {
        (by.map, by.range) = (scale.map, (low < high).then_some(scale.range));
    }
}

/// The scene of a picture without particles: as it was `given`, since nothing was measured that could fit later ones.
pub(crate) fn unmeasured(given: Option<Project>) -> Project {
    let all = Automatic::all(Look::default());
    given.unwrap_or_else(|| Project { automatic: Some(all), ..Project::default() })
}

/// The notice of liquid in a scene that was given, whose surface tells that z points up.
pub(crate) fn lying(loader: &Loader, particles: &Particles, radius: f32) -> Option<&'static str> {
    let is_assumed = matches!(loader.up(), (Up::Y, UpFrom::Scene | UpFrom::Default));
    (is_assumed && likely_up(particles, radius) == Some(Up::Z)).then_some(
        "the liquid looks as if z pointed up, but the scene is drawn with y up; give up=\"z\" if it should lie (a place \
         (x, y, z) is then (x, z, -y) in the scene), or up=\"y\" if it stands",
    )
}

/// The notice of liquid for which y is assumed to point up, and which is thinner along z than along both other axes: a
/// settled tank of a world of z up would be.
pub(crate) fn standing(loader: &Loader) -> Option<&'static str> {
    const THIN: f64 = 0.75;
    let body = loader.body().filter(|_| loader.up().1 == UpFrom::Default)?;
    let extent = body.bounds.1 - body.bounds.0;
    (extent.z < THIN * extent.x.min(extent.y)).then_some(
        "nothing tells which axis points up: y is assumed, and the liquid stands like a wall; give up=\"z\" if it \
         should lie, or up=\"y\" if it stands",
    )
}
