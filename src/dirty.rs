//! Which passes must rerun because an input changed.
//!
//! A moving camera does not affect the caustic maps, the number of rays per pixel does not affect the
//! layers, and the exposure does not affect the radiance.

use std::sync::Arc;

use crate::camera::View;
use crate::diffuse::Diffuse;
use crate::frame::FrameInput;
use crate::liquid::Colors;
use crate::liquid::classify::{Splat, Splats};
use crate::passes::view_passes::ViewConfig;
use crate::scene::Scene;
use crate::settings::Refract;

/// The inputs of the last frame.
#[derive(Debug)]
pub(crate) struct LastFrame {
    scene: Scene,
    view: View,
    splats: Splats,
    diffuse: Option<Arc<Diffuse>>,
    config: ViewConfig,
    diagnosed: bool,
    /// Whether its radiance was not [taken](crate::renderer::Renderer::take_radiance).
    has_radiance: bool,
}

/// The data that must be uploaded or drawn again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Dirty {
    /// The splats on the device.
    pub splats: bool,
    /// The lights' views and maps.
    pub lights: bool,
    /// The camera's layers and G-buffer.
    pub surfaces: bool,
    /// The radiance.
    pub radiance: bool,
}

impl Dirty {
    /// Everything is dirty.
    pub(crate) const ALL: Self =
        Self { splats: true, lights: true, surfaces: true, radiance: true };

    /// Compares a frame with the last one; everything is dirty if there is none. `splats`: its splats differ.
    pub(crate) fn since(
        last: Option<&LastFrame>,
        input: &FrameInput<'_>,
        config: ViewConfig,
        splats: bool,
    ) -> Self {
        let FrameInput { scene, view, diagnose, .. } = *input;
        let Some(last) = last else { return Self::ALL };
        let (old, new) = (&last.scene.settings, &scene.settings);
        let solids = last.scene.solids != scene.solids;
        let scene_lights = last.scene.lights != scene.lights;
        let media = last.scene.media() != scene.media();
        let optics = last.scene.liquid != scene.liquid || media;
        let smooth = old.smooth != new.smooth || old.layers != new.layers;
        let lights = splats
            || solids
            || scene_lights
            || optics
            || smooth
            || old.caustics != new.caustics
            || !same_spheres(last.diffuse.as_ref(), input.diffuse)
            || light_settings(&old.refract) != light_settings(&new.refract);
        let surfaces = splats
            || smooth
            || last.view != view
            || last.config != config
            || (config.mixture || config.scattering) && media
            || config.gbuffer && solids
            // Walls hide the liquid behind them.
            || solids && !same_shapes(&last.scene, scene)
            // Mip levels of the G-buffer are filled only where they are read.
            || config.levels > 1 && old.refract.solids != new.refract.solids;
        let radiance = surfaces
            || lights
            || old.refract != new.refract
            || last.scene.environment != scene.environment
            || last.scene.background != scene.background
            || last.diagnosed != diagnose
            || !last.has_radiance;
        Self { splats, lights, surfaces, radiance }
    }
}

/// Whether two frames have the same spheres. Those of one upload are not compared one by one.
fn same_spheres(old: Option<&Arc<Diffuse>>, new: Option<&Arc<Diffuse>>) -> bool {
    match (old, new) {
        (Some(old), Some(new)) => Arc::ptr_eq(old, new) || old == new,
        _ => old.is_none() && new.is_none(),
    }
}

impl LastFrame {
    /// Whether the frame had these splats, in these colours.
    pub(crate) fn has_splats(&self, splats: &Splats, colors: Option<&Colors>) -> bool {
        same_splats(&self.splats, splats) && self.splats.colors.as_ref() == colors
    }

    /// Stores the inputs of a frame, in the memory of the frame before.
    pub(crate) fn new(
        last: Option<Self>,
        dirty: Dirty,
        input: &FrameInput<'_>,
        config: ViewConfig,
    ) -> Self {
        let FrameInput { scene, view, splats, colors, diagnose, .. } = *input;
        let mut kept = last.map(|last| last.splats).unwrap_or_default();
        if dirty.splats {
            kept.aggregates.clone_from(&splats.aggregates);
            kept.splashes.clone_from(&splats.splashes);
            (kept.radius, kept.origin) = (splats.radius, splats.origin);
            kept.device.clone_from(&splats.device);
            kept.colors = colors.cloned();
            kept.opaque.clone_from(&splats.opaque);
        }
        Self {
            scene: scene.clone(),
            view,
            splats: kept,
            diffuse: input.diffuse.cloned(),
            config,
            diagnosed: diagnose,
            has_radiance: true,
        }
    }

    /// Its radiance is drawn anew for the next frame, even if that is the same.
    pub(crate) fn lose_radiance(&mut self) {
        self.has_radiance = false;
    }
}

/// The settings of [`crate::passes::refract`] that affect the caustic maps.
fn light_settings(refract: &Refract) -> Refract {
    let unread = Refract::default();
    Refract {
        samples: unread.samples,
        structure: unread.structure,
        edge_samples: unread.edge_samples,
        filter_patterns: unread.filter_patterns,
        transparent: unread.transparent,
        ..refract.clone()
    }
}

fn same_shapes(a: &Scene, b: &Scene) -> bool {
    a.solids.iter().map(|solid| &solid.shape).eq(b.solids.iter().map(|solid| &solid.shape))
}

/// Compares bits, which is faster than comparing numbers and correct for NaN.
fn same_splats(a: &Splats, b: &Splats) -> bool {
    fn bytes(splats: &[Splat]) -> &[u8] {
        bytemuck::cast_slice(splats)
    }
    a.radius.to_bits() == b.radius.to_bits()
        && a.is_hull == b.is_hull
        && a.bulk == b.bulk
        && a.origin == b.origin
        && a.device == b.device
        && a.opaque == b.opaque
        && a.aggregates.len() == b.aggregates.len()
        && a.splashes.len() == b.splashes.len()
        && bytes(&a.aggregates) == bytes(&b.aggregates)
        && bytes(&a.splashes) == bytes(&b.splashes)
}
