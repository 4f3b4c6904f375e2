//! Opaque fluids among others, which are seen through these: [`Splats::opaque`].
//!
//! They are drawn like an opaque body alone: layers, shadows, colours, radiance. Rays through the other fluids find their
//! first surface where the picture shows it, as they find a host's scene.

use crate::camera::{CameraUniform, View};
use crate::dirty::Dirty;
use crate::error::Result;
use crate::gpu::{Commands, Gpu, Timer};
use crate::lights::{Lights, PreparedLight};
use crate::liquid::classify::Splats;
use crate::passes::GBufferImages;
use crate::passes::color::{Color, ColorImages};
use crate::passes::mesh_buffers::MeshBuffers;
use crate::passes::opaque::OpaquePlanes;
use crate::passes::shade::{Shade, ShadeImages};
use crate::passes::smooth;
use crate::passes::sphere_shadows::Shadows;
use crate::passes::tiles::Sections;
use crate::passes::view_passes::{
    FrameInputs, PassNames, PreparedView, SplatSet, ViewConfig, ViewPasses,
};
use crate::scene::{Kind, Liquid, Scene};
use glam::{UVec2, Vec3};

/// Draws the opaque fluids of a picture.
#[derive(Debug)]
pub(crate) struct OpaqueFluids {
    splat_set: SplatSet,
    lights: Lights,
    view: ViewPasses,
    shaded: ShadeImages,
    colored: Option<ColorImages>,
    size: UVec2,
}

/// The passes of a frame.
#[derive(Debug)]
pub(crate) struct PreparedOpaque {
    /// The frame's, with an opaque liquid.
    scene: Scene,
    fits: Vec<smooth::Params>,
    lights: Vec<PreparedLight>,
    view: Option<PreparedView>,
    color: Option<Color>,
    shade: Option<Shade>,
    planes: Option<OpaquePlanes>,
}

/// The scene as light on its way to solids meets it: opaque fluids absorb it all.
pub(crate) fn light_scene(scene: &Scene, opaque: &Splats) -> Scene {
    /// Absorption of a particle's radius.
    const ABSORBED: f32 = 3.0;
    let mut scene = scene.clone();
    let mut numbers: Vec<_> = opaque.outline().map(|splat| splat.fluid()).collect();
    numbers.sort_unstable();
    numbers.dedup();
    for number in numbers {
        if let Some(fluid) = scene.fluids.get_mut(number as usize) {
            fluid.absorption = Vec3::splat(ABSORBED / opaque.radius.max(f32::MIN_POSITIVE));
        }
    }
    scene
}

impl OpaqueFluids {
    /// The largest number of timed passes beside those of the lights' views.
    pub(crate) const PASSES: usize = PassNames::COUNT + 3;

    /// Creates the images of a picture of `size` pixels.
    pub(crate) fn new(gpu: &Gpu, size: UVec2, orthographic: bool) -> Self {
        Self {
            splat_set: SplatSet::new(gpu),
            lights: Lights::default(),
            view: ViewPasses::new(gpu, orthographic),
            shaded: ShadeImages::new(gpu, size),
            colored: None,
            size,
        }
    }

    /// Whether the images are those of a picture of `size` pixels.
    pub(crate) fn fits(&self, size: UVec2, orthographic: bool) -> bool {
        self.size == size && self.view.camera.is_orthographic() == orthographic
    }

    /// Prepares the passes whose inputs have changed. `gbuffer` gets the planes; `far` is the depth of an orthographic view's
    /// far plane, m.
    ///
    /// # Errors
    /// As [`Lights::prepare`].
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        (scene, splats, shadows): (&Scene, &Splats, Option<&Shadows>),
        meshes: &MeshBuffers,
        (view, far): (&View, f64),
        dirty: Dirty,
        gbuffer: &GBufferImages,
    ) -> Result<PreparedOpaque> {
        let Self { splat_set, lights, view: passes, shaded, colored, size } = self;
        let size = *size;
        let film = scene.liquid.ior;
        let liquid = Liquid { kind: Kind::Opaque, ior: 1.0, ..Liquid::default() };
        let scene = Scene { liquid, fluids: Vec::new(), ..scene.clone() };
        if dirty.splats {
            splat_set.upload(gpu, splats);
        }
        let fits = smooth::Params::iterations(&scene.settings.smooth, splats.radius);
        let config = ViewConfig {
            size,
            splash: splats.has_splashes(),
            mixture: false,
            scattering: false,
            attenuates: false,
            gbuffer: false,
            host: false,
            levels: 1,
            backs: true,
            gaps: 0,
            smooth: !fits.is_empty(),
            bounds: false,
            tags: false,
            sections: Sections::for_work(gpu, size, smooth::work(&scene.settings.smooth)),
        };
        passes.resize(gpu, config);
        let inputs = FrameInputs { scene: &scene, splats, splat_set, meshes, fits: &fits, shadows };
        let of_lights = if dirty.lights { lights.prepare(gpu, inputs)? } else { Vec::new() };
        let uniform: CameraUniform = view.uniform(size, splats.origin, far);
        passes.upload(gpu, inputs, &uniform, view.eye, lights.views(), lights.maps());
        let of_view = dirty.surfaces.then(|| passes.prepare(gpu, inputs, &uniform, view.eye));
        let (mut color, mut shade, mut planes) = (None, None, None);
        if dirty.radiance {
            color = splats.colors.as_ref().map(|colors| {
                let kept = colored.get_or_insert_with(|| ColorImages::new(gpu, size));
                Color::prepare(gpu, passes, &uniform, colors, kept)
            });
            let albedo = colored.as_ref().filter(|_| color.is_some());
            let albedo = albedo.map(|images| &images.texture);
            shade =
                Some(Shade::prepare(gpu, passes, &scene, (splats.radius, film), albedo, shaded));
            planes = Some(OpaquePlanes::prepare(gpu, passes, splats.radius, gbuffer));
        }
        Ok(PreparedOpaque { scene, fits, lights: of_lights, view: of_view, color, shade, planes })
    }

    /// Records the passes of a frame.
    pub(crate) fn record(
        &self,
        prepared: &PreparedOpaque,
        splats: &Splats,
        meshes: &MeshBuffers,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
    ) {
        let PreparedOpaque { scene, fits, lights, view, color, shade, planes } = prepared;
        let (splat_set, shadows) = (&self.splat_set, None);
        let inputs = FrameInputs { scene, splats, splat_set, meshes, fits, shadows };
        self.lights.record(lights, commands, inputs, timer);
        if let Some(view) = view {
            self.view.record(view, commands, timer, PassNames::OPAQUE);
        }
        if let Some(color) = color {
            color.record(commands.encoder, timer.span("opaque color"));
        }
        if let Some(shade) = shade {
            shade.record(commands, &self.view, timer.span("opaque shade"));
        }
        if let Some(planes) = planes {
            planes.record(commands.encoder, &self.view, timer.span("opaque planes"));
        }
    }

    /// Radiance of the first surface at each pixel that shows it.
    pub(crate) fn radiance(&self) -> &wgpu::Texture {
        &self.shaded.radiance
    }

    /// Number of views of the lights.
    pub(crate) fn light_views(&self) -> usize {
        self.lights.views().len()
    }
}
