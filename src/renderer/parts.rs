//! The parts that few scenes have: opaque bodies and fluids, turbid liquids, foam.

use super::{PreparedFrame, Renderer};
use crate::dirty::Dirty;
use crate::error::Result;
use crate::frame::FrameInput;
use crate::opaque_fluids::OpaqueFluids;
use crate::passes::color::{Color, ColorImages};
use crate::passes::diffuse::{DiffuseImages, DiffusePass};
use crate::passes::refract;
use crate::passes::shade::{Shade, ShadeImages};
use crate::passes::sphere_shadows::Shadows;
use crate::passes::turbid::{Turbid, TurbidImages};

impl Renderer {
    /// Uploads foam, spray, bubbles and dust, and prepares their shadows.
    pub(super) fn prepare_spheres(&mut self, frame: &PreparedFrame<'_>) -> Result<()> {
        let FrameInput { scene, diffuse, size, .. } = frame.input;
        if frame.dirty.radiance {
            let kept = self.diffuse.take();
            let spheres = diffuse.filter(|diffuse| !diffuse.is_empty());
            let images = |spheres| DiffuseImages::new(&self.gpu, spheres, size, kept);
            self.diffuse = spheres.map(images).transpose()?;
        }
        if frame.dirty.lights {
            let kept = self.shadows.take();
            let spheres = self.diffuse.as_ref().filter(|_| !scene.lights.is_empty());
            let shadows = |spheres: &DiffuseImages| {
                Shadows::prepare(&self.gpu, &scene.lights, spheres.spheres(), kept)
            };
            self.shadows = spheres.map(shadows);
        }
        Ok(())
    }

    /// Prepares the opaque fluids among others.
    pub(super) fn prepare_opaque(&mut self, frame: &mut PreparedFrame<'_>) -> Result<()> {
        let FrameInput { scene, splats, size, view, .. } = frame.input;
        let Some(splats) = &splats.opaque else {
            self.opaque = None;
            return Ok(());
        };
        let (gpu, orthographic) = (&self.gpu, view.is_orthographic());
        let mut dirty = frame.dirty;
        self.opaque.take_if(|opaque| !opaque.fits(size, orthographic));
        let opaque = self.opaque.get_or_insert_with(|| {
            dirty = Dirty::ALL;
            OpaqueFluids::new(gpu, size, orthographic)
        });
        let (gbuffer, eye) = (&self.camera_view.images.gbuffer, (&view, frame.uniform.far.into()));
        let inputs = (scene, &**splats, self.shadows.as_ref());
        frame.opaque = Some(opaque.prepare(gpu, inputs, &self.meshes, eye, dirty, gbuffer)?);
        Ok(())
    }

    /// Prepares the radiance of an opaque body.
    pub(super) fn prepare_body(&mut self, frame: &mut PreparedFrame<'_>) {
        let FrameInput { scene, splats, colors, size, .. } = frame.input;
        if !scene.is_opaque() {
            (self.shaded, self.colored) = (None, None);
            return;
        }
        let (gpu, eye) = (&self.gpu, &self.camera_view);
        frame.color = colors.map(|colors| {
            let kept = self.colored.get_or_insert_with(|| ColorImages::new(gpu, size));
            Color::prepare(gpu, eye, &frame.uniform, colors, kept)
        });
        let colored = self.colored.as_ref().filter(|_| colors.is_some());
        let colored = colored.map(|colored| &colored.texture);
        let images = self.shaded.get_or_insert_with(|| ShadeImages::new(gpu, size));
        frame.shade = Some(Shade::prepare(gpu, eye, scene, (splats.radius, 1.0), colored, images));
    }

    /// Prepares the light around a turbid liquid.
    pub(super) fn prepare_turbid(&mut self, frame: &mut PreparedFrame<'_>) {
        let FrameInput { scene, splats, size, .. } = frame.input;
        if !scene.is_turbid() {
            self.clouded = None;
            return;
        }
        let gpu = &self.gpu;
        let images = self.clouded.get_or_insert_with(|| TurbidImages::new(gpu, size, scene));
        images.update(gpu, scene);
        frame.turbid = Some(Turbid::prepare(gpu, &self.camera_view, scene, splats.radius, images));
    }

    /// Prepares foam, spray, bubbles and dust.
    pub(super) fn prepare_diffuse(&mut self, frame: &mut PreparedFrame<'_>) {
        let scene = frame.input.scene;
        let Some(images) = self.diffuse.as_ref() else { return };
        let params = frame.diffuse_params(images);
        let (eye, work) = (&self.camera_view, refract::solid_work(scene));
        let pass = DiffusePass::prepare(&self.gpu, eye, scene, params, images, work);
        frame.diffuse = Some(pass);
    }
}
