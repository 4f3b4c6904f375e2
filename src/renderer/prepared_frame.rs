//! A frame between its preparation and its recording.

use crate::camera::CameraUniform;
use crate::dirty::{Dirty, LastFrame};
use crate::frame::FrameInput;
use crate::gpu::Gpu;
use crate::lights::PreparedLight;
use crate::liquid::blocks::Blocks;
use crate::opaque_fluids::{self, PreparedOpaque};
use crate::passes::color::Color;
use crate::passes::diffuse::{self, DiffuseImages, DiffusePass};
use crate::passes::gaps;
use crate::passes::host::HostPass;
use crate::passes::mesh_buffers::MeshBuffers;
use crate::passes::mips::{self, Mips};
use crate::passes::refract::{self, Refract, Variant};
use crate::passes::shade::Shade;
use crate::passes::smooth;
use crate::passes::sphere_shadows::Shadows;
use crate::passes::surface::SurfacePass;
use crate::passes::tiles::Sections;
use crate::passes::turbid::Turbid;
use crate::passes::view_passes::{FrameInputs, PreparedView, SplatSet, ViewConfig};
use crate::scene::Scene;
use crate::settings::Solids;
use crate::view_range;

/// A frame that is prepared: its inputs, and the configuration of its passes.
#[derive(Debug)]
pub struct PreparedFrame<'a> {
    pub(super) input: FrameInput<'a>,
    pub(super) uniform: CameraUniform,
    pub(super) config: ViewConfig,
    pub(super) variant: Variant,
    /// Parameters of each smoothing iteration.
    pub(super) fits: Vec<smooth::Params>,
    /// Work per pixel of the slowest pass, in layer evaluations.
    pub(super) work: u64,
    /// A pixel's ray may start inside the liquid.
    pub(super) starts_inside: bool,
    /// Rays intersect solids in the G-buffer.
    pub(super) screen_solids: bool,
    /// The scene that light meets, if it is another than the eye's.
    pub(super) light_scene: Option<Scene>,
    /// Passes of the lights' views, if those are drawn.
    pub(super) lights: Vec<PreparedLight>,
    /// Passes of the camera's view, if that is drawn.
    pub(super) view: Option<PreparedView>,
    /// The G-buffer of a host's scene.
    pub(super) host: Option<HostPass>,
    /// The opaque fluids, if there are any.
    pub(super) opaque: Option<PreparedOpaque>,
    /// Mip levels of the layers, if the intersector reads them.
    pub(super) mips: Option<Mips>,
    /// Colours of an opaque body's surface, if they are drawn.
    pub(super) color: Option<Color>,
    /// Radiance of an opaque body, if it is drawn.
    pub(super) shade: Option<Shade>,
    /// Light around a turbid liquid, if it is drawn.
    pub(super) turbid: Option<Turbid>,
    /// Foam, spray, bubbles and dust, if they are drawn.
    pub(super) diffuse: Option<DiffusePass>,
    /// The picture, if it is drawn.
    pub(super) refract: Option<Refract>,
    /// Images of the first interface, if they are drawn.
    pub(super) surface: Option<SurfacePass>,
    /// The frame before.
    pub(super) last: Option<LastFrame>,
    /// Passes whose inputs differ from it.
    pub(super) dirty: Dirty,
}

impl<'a> PreparedFrame<'a> {
    pub(super) fn new(
        gpu: &Gpu,
        input: FrameInput<'a>,
        blocks: &Blocks,
        last: Option<LastFrame>,
        has_other_splats: bool,
    ) -> Self {
        let FrameInput { scene, view, splats, size, host, diagnose, .. } = input;
        let settings = &scene.settings;
        let screen_solids = settings.refract.solids == Solids::Screen
            && !scene.solids.is_empty()
            && host.is_none()
            && splats.opaque.is_none();
        let splash = splats.has_splashes();
        let interfaces = if scene.is_opaque() { 1 } else { settings.refract.interfaces };
        let gaps = gaps::count(&settings.layers, interfaces, splats);
        let has_opaque = splats.opaque.is_some();
        let variant = Variant::new(scene, splash, gaps, host.is_some(), diagnose);
        let variant = if has_opaque { variant.with_opaque_fluids() } else { variant };
        let has_spheres = input.diffuse.is_some_and(|diffuse| !diffuse.is_empty());
        let variant = Variant { diffuse: has_spheres, ..variant };
        let starts_inside = view_range::may_start_inside(splats, blocks, &view, size);
        let lit = if scene.is_lit() || has_spheres { scene.lights.len() } else { 0 };
        let work = refract::work(&settings.refract, size, refract::solid_work(scene), lit);
        let work = work.max(smooth::work(&settings.smooth));
        let fits = smooth::Params::iterations(&settings.smooth, splats.radius);
        let config = ViewConfig {
            size,
            splash,
            mixture: variant.mixture,
            scattering: variant.scattering_mixture,
            attenuates: false,
            gbuffer: screen_solids || diagnose,
            host: host.is_some() || has_opaque,
            levels: if variant.mips() { mips::levels(size) } else { 1 },
            backs: interfaces > 1 || diagnose || starts_inside,
            gaps,
            smooth: !fits.is_empty() || gaps > 0,
            bounds: variant.bounds,
            tags: input.surface.is_some(),
            sections: Sections::for_work(gpu, size, work),
        };
        let mut dirty = Dirty::since(last.as_ref(), &input, config, has_other_splats);
        // The host may have drawn anything into its textures.
        dirty.surfaces |= host.is_some();
        dirty.radiance |= host.is_some();
        let far = view_range::farthest_depth(splats, &view)
            .max(host.map_or(0.0, |host| host.depth_code().far()));
        Self {
            input,
            uniform: view.uniform(size, splats.origin, far),
            config,
            variant,
            fits,
            work,
            starts_inside,
            screen_solids,
            light_scene: splats
                .opaque
                .as_ref()
                .map(|opaque| opaque_fluids::light_scene(scene, opaque)),
            lights: Vec::new(),
            view: None,
            host: None,
            opaque: None,
            mips: None,
            color: None,
            shade: None,
            turbid: None,
            diffuse: None,
            refract: None,
            surface: None,
            last,
            dirty,
        }
    }

    pub(super) fn inputs<'b>(
        &'b self,
        splat_set: &'b SplatSet,
        meshes: &'b MeshBuffers,
        shadows: Option<&'b Shadows>,
    ) -> FrameInputs<'b> {
        let FrameInput { scene, splats, .. } = self.input;
        FrameInputs { scene, splats, splat_set, meshes, fits: &self.fits, shadows }
    }

    /// The inputs of the lights.
    pub(super) fn light_inputs<'b>(
        &'b self,
        splat_set: &'b SplatSet,
        meshes: &'b MeshBuffers,
        shadows: Option<&'b Shadows>,
    ) -> FrameInputs<'b> {
        let inputs = self.inputs(splat_set, meshes, shadows);
        FrameInputs { scene: self.light_scene.as_ref().unwrap_or(inputs.scene), ..inputs }
    }

    pub(super) fn diffuse_params(&self, spheres: &DiffuseImages) -> diffuse::Params {
        let FrameInput { scene, splats, view, .. } = self.input;
        diffuse::Params::new(scene, spheres, view.eye, splats.radius)
    }

    pub(super) fn refract_params(&self, spheres: Option<&DiffuseImages>) -> refract::Params {
        let FrameInput { scene, splats, view, .. } = self.input;
        let mut params = refract::Params::new(scene, &scene.settings.refract, splats.radius);
        if let Some(spheres) = spheres {
            params.diffuse_white = diffuse::white(scene);
            (params.cells_first, params.cells_side, params.cells_across) =
                spheres.placed_cells(self.input.view.eye);
        }
        let lit = scene.solids.iter().any(|solid| solid.lit);
        if self.starts_inside && !view.is_orthographic() && self.variant.absorption && lit {
            params.eye_depth = view_range::depth_below_surface(splats, self.uniform.origin);
        }
        params
    }
}
