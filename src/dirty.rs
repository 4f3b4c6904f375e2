//! Which passes must rerun because an input changed.
//!
//! A camera that moves leaves the caustic maps alone, more rays per pixel leave the layers alone, and
//! another exposure leaves the radiance alone.

use crate::camera::Camera;
use crate::liquid::classify::{Splat, Splats};
use crate::passes::view_passes::ViewConfig;
use crate::scene::Scene;
use crate::settings::Refract;

/// The inputs of the last frame.
#[derive(Debug)]
pub(crate) struct LastFrame {
    scene: Scene,
    camera: Camera,
    splats: Splats,
    config: ViewConfig,
    diagnosed: bool,
}

/// What must be uploaded or drawn again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Dirty {
    /// The particles, which are uploaded.
    pub splats: bool,
    /// The lights' views and maps.
    pub lights: bool,
    /// The camera's layers and G-buffer.
    pub surfaces: bool,
    /// The radiance.
    pub radiance: bool,
}

impl Dirty {
    /// Everything.
    const ALL: Self = Self { splats: true, lights: true, surfaces: true, radiance: true };

    /// The differences from the last frame; everything if there is none.
    pub(crate) fn since(
        last: Option<&LastFrame>,
        scene: &Scene,
        camera: &Camera,
        splats: &Splats,
        config: ViewConfig,
        diagnosed: bool,
    ) -> Self {
        let Some(last) = last else { return Self::ALL };
        let (old, new) = (&last.scene.settings, &scene.settings);
        let splats = !same_splats(&last.splats, splats);
        let solids = last.scene.solids != scene.solids;
        let lamps = last.scene.lights != scene.lights;
        let absorption = last.scene.absorptions() != scene.absorptions();
        let optics = last.scene.liquid != scene.liquid || absorption;
        let smooth = old.smooth != new.smooth;
        let lights = splats
            || solids
            || lamps
            || optics
            || smooth
            || old.caustics != new.caustics
            || of_light(&old.refract) != of_light(&new.refract);
        let surfaces = splats
            || smooth
            || last.camera != *camera
            || last.config != config
            || config.mixture && absorption
            || config.gbuffer && solids
            // Walls hide the liquid behind them.
            || solids && !same_shapes(&last.scene, scene)
            // Mip levels of the G-buffer are filled only where they are read.
            || config.levels > 1 && old.refract.solids != new.refract.solids;
        let radiance = surfaces
            || lights
            || old.refract != new.refract
            || last.scene.environment != scene.environment
            || last.diagnosed != diagnosed;
        Self { splats, lights, surfaces, radiance }
    }
}

impl LastFrame {
    /// What a frame was drawn from; memory of the frame before is used again.
    pub(crate) fn new(
        last: Option<Self>,
        dirty: Dirty,
        scene: &Scene,
        camera: &Camera,
        splats: &Splats,
        config: ViewConfig,
        diagnosed: bool,
    ) -> Self {
        let mut kept = last.map(|last| last.splats).unwrap_or_default();
        if dirty.splats {
            kept.aggregates.clone_from(&splats.aggregates);
            kept.splashes.clone_from(&splats.splashes);
            (kept.radius, kept.origin) = (splats.radius, splats.origin);
        }
        Self { scene: scene.clone(), camera: *camera, splats: kept, config, diagnosed }
    }
}

/// The settings of [`crate::passes::refract`] that light on its way to what it lights depends on.
fn of_light(refract: &Refract) -> Refract {
    let unread = Refract::default();
    Refract { samples: unread.samples, edge_samples: unread.edge_samples, ..refract.clone() }
}

fn same_shapes(a: &Scene, b: &Scene) -> bool {
    let shapes = |scene: &Scene| scene.solids.iter().map(|solid| solid.shape).collect::<Vec<_>>();
    shapes(a) == shapes(b)
}

/// Bit by bit, which is faster than number by number, and right for numbers that are none.
fn same_splats(a: &Splats, b: &Splats) -> bool {
    fn bytes(splats: &[Splat]) -> &[u8] {
        bytemuck::cast_slice(splats)
    }
    a.radius.to_bits() == b.radius.to_bits()
        && a.origin == b.origin
        && a.aggregates.len() == b.aggregates.len()
        && a.splashes.len() == b.splashes.len()
        && bytes(&a.aggregates) == bytes(&b.aggregates)
        && bytes(&a.splashes) == bytes(&b.splashes)
}
