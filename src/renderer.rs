//! The renderer: [`Renderer::render`] draws a frame.

mod parts;
mod prepared_frame;

use glam::UVec2;

use crate::background::Background;
use crate::camera::View;
use crate::dirty::LastFrame;
use crate::environment::Environment;
use crate::error::{Error, Limited, Result};
use crate::frame::{FrameInput, Target};
use crate::gpu::{Commands, Gpu, PassTime, Pending, PendingTimes, Span, SubmittedTimes, Timer};
use crate::host::HostRays;
use crate::lights::Lights;
use crate::liquid::blocks::Blocks;
use crate::liquid::classify::colors::ColorMap;
use crate::memory;
use crate::opaque_fluids::OpaqueFluids;
use crate::passes::caustics::CausticMap;
use crate::passes::color::ColorImages;
use crate::passes::diffuse::DiffuseImages;
use crate::passes::host::HostPass;
use crate::passes::mesh_buffers::MeshBuffers;
use crate::passes::mips::Mips;
use crate::passes::refract::{self, Refract, RefractImages, Variant};
use crate::passes::scene_binding::SceneVariant;
use crate::passes::shade::ShadeImages;
use crate::passes::sphere_shadows::Shadows;
use crate::passes::surface::{self, SurfaceBuffers, SurfaceImages, SurfacePass};
use crate::passes::tonemap::Tonemap;
use crate::passes::turbid::TurbidImages;
use crate::passes::view_passes::{PassNames, SplatSet, ViewPasses};
use crate::passes::{GBufferImages, Layers, Radiance};
use crate::settings;
use crate::view_range;
pub use prepared_frame::PreparedFrame;

/// Memory that a frame's shaders may take, bytes. Without it Mesa's compiler crashes.
const COMPILING_MEMORY: usize = 384 << 20;

/// Draws particle liquids with one device.
///
/// Frames are independent of each other. The renderer keeps only memory, pipelines, and images of the
/// last frame that the next frame would redraw bit for bit.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    splat_set: SplatSet,
    meshes: MeshBuffers,
    lights: Lights,
    camera_view: ViewPasses,
    background: Background,
    picture: RefractImages,
    /// Of opaque bodies.
    shaded: Option<ShadeImages>,
    /// Of turbid liquids.
    clouded: Option<TurbidImages>,
    /// Of foam, spray, bubbles and dust.
    diffuse: Option<DiffuseImages>,
    shadows: Option<Shadows>,
    /// Of opaque fluids among others.
    opaque: Option<OpaqueFluids>,
    /// Of opaque bodies whose particles have colours.
    colored: Option<ColorImages>,
    surface: SurfaceBuffers,
    tonemap: Tonemap,
    composite: Tonemap,
    sized_for: (UVec2, bool),
    /// Refraction of the last picture.
    compiled: Option<(Variant, SceneVariant)>,
    /// Inputs of the last frame; `None` after an error, or without [`FrameInput::reuse`].
    last: Option<LastFrame>,
    /// Times of the last frame that the caller submits.
    pending_times: Option<PendingTimes>,
    /// Counts of rays of the last frame with a host.
    pending_rays: Option<Pending>,
    submissions: u32,
    /// Whether the last frame's coverage varies.
    transparent: bool,
    /// Whether the last frame has images of the first interface.
    shows_surface: bool,
    /// Number of fluids of the last frame.
    fluids: usize,
}

/// The intermediate images of the last frame.
#[derive(Debug, Clone)]
pub struct Images {
    /// Aggregate layers before smoothing.
    pub aggregate: Layers,
    /// Aggregate layers after smoothing.
    pub smoothed: Layers,
    /// Splash layers, if the frame had splashes.
    pub splash: Option<Layers>,
    /// The G-buffer, if it was drawn.
    pub gbuffer: Option<GBufferImages>,
    /// The caustic map of each light, if it has one.
    pub caustics: Vec<Option<CausticMap>>,
    /// The images of the first interface, if [`FrameInput::surface`] was set.
    pub surface: Option<SurfaceImages>,
    /// Sums of foam, spray, bubbles and dust, in the air and in the liquid, if the frame had any.
    pub diffuse: Option<[wgpu::Buffer; 2]>,
    /// Linear albedo of an opaque body's surface and the value's place in the map's range, with the map, if it is coloured by
    /// values.
    pub colors: Option<(wgpu::Texture, ColorMap)>,
    /// Number of fluids.
    pub fluids: usize,
    /// The linear picture.
    pub radiance: Radiance,
    /// Whether coverage varies: [`settings::Refract::transparent`].
    pub transparent: bool,
    /// Whether the layers are those of an orthographic view.
    pub orthographic: bool,
    /// Interfaces, length inside the liquid (m), solver iterations and solver failures of each pixel's
    /// rays; `None` unless [`FrameInput::diagnose`] was set.
    pub diagnostics: Option<wgpu::Texture>,
}

impl Renderer {
    /// Compiles the pipelines that every frame needs; all others are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            splat_set: SplatSet::new(gpu),
            meshes: MeshBuffers::new(gpu),
            lights: Lights::default(),
            camera_view: ViewPasses::new(gpu, false),
            background: Background::default(),
            picture: RefractImages::new(gpu, UVec2::ONE, false),
            shaded: None,
            clouded: None,
            diffuse: None,
            shadows: None,
            opaque: None,
            colored: None,
            surface: SurfaceBuffers::new(gpu),
            tonemap: Tonemap::new(gpu, false),
            composite: Tonemap::new(gpu, true),
            sized_for: (UVec2::ONE, false),
            compiled: None,
            last: None,
            pending_times: None,
            pending_rays: None,
            submissions: 0,
            transparent: false,
            shows_surface: false,
            fluids: 1,
        }
    }

    /// Draws one frame into `target`, of the frame's size, and submits it.
    ///
    /// Returns the time of each pass that ran if [`FrameInput::timing`] is set, otherwise nothing. The call
    /// blocks on the device to read these times, and if the frame is so long that it is split into
    /// several submissions.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a value out of range, [`crate::Error::Limit`] for a picture
    /// that is too large, [`crate::Error::DeviceLost`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn render<'a>(
        &mut self,
        input: FrameInput<'_>,
        target: impl Into<Target<'a>>,
    ) -> Result<Vec<PassTime>> {
        let times = self.submit(input, target)?;
        times.map_or_else(|| Ok(Vec::new()), |times| pollster::block_on(times.finish(&self.gpu)))
    }

    /// As `Renderer::render`, without waiting for the times of the passes.
    ///
    /// # Errors
    /// As `Renderer::render`.
    pub fn submit<'a>(
        &mut self,
        input: FrameInput<'_>,
        target: impl Into<Target<'a>>,
    ) -> Result<Option<SubmittedTimes>> {
        self.submit_frame(input, target, false)
    }

    /// As [`Renderer::submit`]; the caller may know that the frame has the last one's splats, if that was drawn.
    pub(crate) fn submit_frame<'a>(
        &mut self,
        input: FrameInput<'_>,
        target: impl Into<Target<'a>>,
        has_last_splats: bool,
    ) -> Result<Option<SubmittedTimes>> {
        let mut frame = self.prepare_views(input, has_last_splats)?;
        let gpu = &self.gpu.clone();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let (mut timer, mut commands) = (self.timer(&frame), Commands::new(gpu, &mut encoder));
        self.record_views(&frame, &mut commands, &mut timer);
        if self.compiled != Some((frame.variant, self.camera_view.scene.variant)) {
            // The device starts drawing while the largest shaders compile.
            commands.submit();
        }
        self.prepare_picture(&mut frame);
        self.pending_rays = self.record_picture(&frame, &mut commands, &mut timer);
        let span = timer.span("tonemap");
        let target = self.tonemap.prepare(gpu, &input.scene.settings.tonemap, target.into());
        self.tonemap.record(gpu, commands.encoder, &self.picture.radiance, &target, span);
        let times = PendingTimes::record(gpu, timer, commands.encoder);
        commands.submit();

        self.submissions = commands.submissions;
        let submission = commands.last_submission();
        gpu.check()?;
        self.remember(frame);
        Ok(times.zip(submission).map(|(times, submission)| times.submitted(submission)))
    }

    /// Uploads what a frame needs and has not yet, and compiles missing pipelines, for [`Renderer::record`]. Waits for
    /// nothing, and submits nothing but uploads of more than half a million splats.
    ///
    /// Uploads take effect with the next submission to the queue: submit one frame before the next is
    /// prepared.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn prepare<'a>(&mut self, input: FrameInput<'a>) -> Result<PreparedFrame<'a>> {
        let mut frame = self.prepare_views(input, false)?;
        self.prepare_picture(&mut frame);
        Ok(frame)
    }

    /// Records a prepared frame into the caller's encoder: everything up to its linear radiance,
    /// [`Renderer::radiance`]. Submits, polls and waits for nothing; a frame that would occupy a slow device
    /// for long is not split.
    pub fn record(&mut self, frame: PreparedFrame<'_>, encoder: &mut wgpu::CommandEncoder) {
        let gpu = &self.gpu.clone();
        let (mut timer, mut commands) = (self.timer(&frame), Commands::within(gpu, encoder));
        self.record_views(&frame, &mut commands, &mut timer);
        self.pending_rays = self.record_picture(&frame, &mut commands, &mut timer);
        self.pending_times = PendingTimes::record(gpu, timer, encoder);
        self.remember(frame);
    }

    /// Records the tone mapping of the last recorded frame into `target`, of its size.
    pub fn tonemap<'a>(
        &mut self,
        settings: &settings::Tonemap,
        encoder: &mut wgpu::CommandEncoder,
        target: impl Into<Target<'a>>,
    ) {
        let target = self.tonemap.prepare(&self.gpu, settings, target.into());
        let (radiance, span) = (&self.picture.radiance, Span::default());
        self.tonemap.record(&self.gpu, encoder, radiance, &target, span);
    }

    /// Records the last recorded frame over what `target` contains, a view of its size in `format`, without
    /// exposure or curve: by its coverage, if that varies ([`settings::Refract::transparent`]), or in place
    /// of all. 32-bit floats need [`wgpu::Features::FLOAT32_BLENDABLE`].
    pub fn composite(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) {
        let linear = settings::Tonemap::default();
        let target = self.composite.prepare(&self.gpu, &linear, Target::View(target, format));
        let (radiance, span) = (&self.picture.radiance, Span::default());
        self.composite.record(&self.gpu, encoder, radiance, &target, span);
    }

    /// The linear picture of the last frame: RGB radiance and coverage, 32-bit floats. A frame of another
    /// size replaces the texture.
    pub fn radiance(&self) -> &wgpu::Texture {
        &self.picture.radiance.texture
    }

    /// Takes the linear picture of the last frame, as [`Renderer::radiance`], for a caller who reads it later or
    /// never. The next frame is drawn into `spare` if that has its size: one that was taken before.
    pub fn take_radiance(&mut self, spare: Option<wgpu::Texture>) -> wgpu::Texture {
        self.last.iter_mut().for_each(LastFrame::lose_radiance);
        self.picture.take_radiance(&self.gpu, spare)
    }

    /// The times of the passes of the last recorded frame, once the device has finished it; `None` before,
    /// without [`FrameInput::timing`], and after they were taken. Does not wait: the caller submits the frame
    /// before the first call and polls the device.
    pub fn take_pass_times(&mut self) -> Option<Vec<PassTime>> {
        let times = self.pending_times.as_mut()?.collect(&self.gpu)?;
        self.pending_times = None;
        Some(times)
    }

    /// How many rays of the last frame with a [host](FrameInput::host) its picture answered, once the device
    /// has finished it; as [`Renderer::take_pass_times`]. Counts the first ray of each pixel with liquid.
    pub fn take_host_rays(&mut self) -> Option<HostRays> {
        let counts = self.pending_rays.as_mut()?.collect()?;
        self.pending_rays = None;
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&counts);
        Some(HostRays { rays: counts[0], fallbacks: counts[1] })
    }

    /// Stores the inputs of a recorded frame for the next one.
    fn remember(&mut self, frame: PreparedFrame<'_>) {
        let PreparedFrame { input, last, dirty, config, .. } = frame;
        self.transparent = input.scene.settings.refract.transparent;
        self.shows_surface = frame.surface.is_some();
        self.fluids = input.scene.fluids.len().max(1);
        self.last = input.reuse.then(|| LastFrame::new(last, dirty, &input, config));
    }

    /// Fails if the inputs cannot be drawn.
    fn check(&self, input: &FrameInput<'_>) -> Result<()> {
        let FrameInput { scene, view, splats, size, .. } = *input;
        scene.check()?;
        view.check()?;
        self.gpu.check()?;
        if self.gpu.compiles_in_process() {
            memory::probe(COMPILING_MEMORY, "the shaders")?;
        }
        self.gpu.check_size(size)?;
        view_range::check_scale(splats, &view)?;
        input.host.map_or(Ok(()), |host| host.check(&view, splats.radius, size))?;
        if splats.opaque.is_some() && (input.host.is_some() || scene.is_opaque()) {
            let problem = "opaque fluids among others are drawn neither into a host's frame nor in an opaque liquid";
            return Err(Error::invalid("[[fluid]]", problem));
        }
        input.surface.map_or(Ok(()), |motion| motion.check(&view, splats))?;
        let Environment::Map { size, pixels } = &scene.environment else { return Ok(()) };
        self.gpu.check_image(*size, Limited::Environment)?;
        if pixels.is_empty() || pixels.len() != size.x as usize * size.y as usize {
            let problem = format!("{} pixels do not make a map of {size}", pixels.len());
            return Err(Error::invalid("environment", problem));
        }
        Ok(())
    }

    /// Resizes the passes' textures to the frame.
    fn resize(&mut self, frame: &PreparedFrame<'_>) {
        self.camera_view.resize(&self.gpu, frame.config);
        let size = (frame.config.size, frame.input.diagnose);
        if self.sized_for != size {
            self.picture = RefractImages::new(&self.gpu, size.0, size.1);
            (self.shaded, self.colored, self.clouded) = (None, None, None);
            self.sized_for = size;
        }
    }

    /// Checks a frame, resizes the images of its passes, uploads changed inputs, and compiles missing pipelines,
    /// except for refraction, which takes longest and is compiled later.
    fn prepare_views<'a>(
        &mut self,
        input: FrameInput<'a>,
        has_last_splats: bool,
    ) -> Result<PreparedFrame<'a>> {
        self.check(&input)?;
        let mut last = self.last.take().filter(|_| input.reuse);
        let is_same =
            |last: &LastFrame| has_last_splats || last.has_splats(input.splats, input.colors);
        let has_other_splats = !last.as_ref().is_some_and(is_same);
        if has_other_splats {
            self.splat_set.upload(&self.gpu, input.splats);
        }
        let input = FrameInput { view: drawn_view(&input, &self.splat_set.blocks)?, ..input };
        if input.view.is_orthographic() != self.camera_view.camera.is_orthographic() {
            self.camera_view = ViewPasses::new(&self.gpu, input.view.is_orthographic());
            last = None;
        }
        let mut frame =
            PreparedFrame::new(&self.gpu, input, &self.splat_set.blocks, last, has_other_splats);
        self.resize(&frame);
        self.prepare_spheres(&frame)?;
        let (gpu, eye) = (&self.gpu, input.view.eye);
        self.meshes.prepare(gpu, input.scene)?;
        let (splat_set, meshes, shadows) = (&self.splat_set, &self.meshes, self.shadows.as_ref());
        let inputs = frame.inputs(splat_set, meshes, shadows);
        let lights = match frame.dirty.lights {
            true => self.lights.prepare(gpu, frame.light_inputs(splat_set, meshes, shadows))?,
            false => Vec::new(),
        };
        let (views, maps) = (self.lights.views(), self.lights.maps());
        self.camera_view.upload(gpu, inputs, &frame.uniform, eye, views, maps);
        let surfaces = frame.dirty.surfaces;
        let view = surfaces.then(|| self.camera_view.prepare(gpu, inputs, &frame.uniform, eye));
        (frame.lights, frame.view) = (lights, view);
        self.background.prepare(gpu, input.scene.background.as_ref(), input.size)?;
        let ViewPasses { camera, images, .. } = &self.camera_view;
        let of_host =
            |host| HostPass::prepare(gpu, camera, host, frame.uniform.far, &images.gbuffer);
        frame.host = input.host.map(of_host);
        if frame.dirty.surfaces && frame.variant.mips() {
            let mut layers = vec![&self.camera_view.aggregate_layers().texture];
            layers.extend(self.camera_view.splash_layers().map(|splash| &splash.texture));
            let on_screen = frame.screen_solids || frame.config.host;
            layers.extend(on_screen.then_some(&images.gbuffer.planes));
            frame.mips = Some(Mips::prepare(gpu, &layers));
        }
        if let Some(motion) = input.surface {
            let FrameInput { view, size, .. } = input;
            let before = surface::Before::new(&view, motion, size, input.splats.radius);
            let spheres =
                self.diffuse.as_ref().map(|images| (images, frame.diffuse_params(images)));
            let request = surface::Request {
                velocities: !motion.velocities.is_empty(),
                splash: frame.config.splash,
                host: input.host.is_some(),
                samples: frame.variant.samples,
                spheres,
            };
            let (eye, kept) = (&self.camera_view, &mut self.surface);
            let surface = SurfacePass::prepare(gpu, eye, request, motion, &before, size, kept)?;
            frame.surface = Some(surface);
        }
        self.prepare_opaque(&mut frame)?;
        // Drivers may crash where they compile without memory.
        self.gpu.check()?;
        Ok(frame)
    }

    /// Prepares refraction, if the radiance is dirty.
    fn prepare_picture(&mut self, frame: &mut PreparedFrame<'_>) {
        if !frame.dirty.radiance {
            return;
        }
        self.prepare_body(frame);
        self.prepare_turbid(frame);
        self.prepare_diffuse(frame);
        let eye = &self.camera_view;
        let behind = match frame.input.host {
            Some(host) => Some(&host.color),
            None => self.background.view(),
        };
        let structure = frame.input.scene.settings.refract.structure;
        let params = &frame.refract_params(self.diffuse.as_ref());
        let alone = frame.shade.as_ref().and(self.shaded.as_ref()).map(|shaded| &shaded.radiance);
        let body = alone.or(self.opaque.as_ref().map(OpaqueFluids::radiance));
        let (turbid, diffuse, work) = (self.clouded.as_ref(), self.diffuse.as_ref(), frame.work);
        let inputs =
            refract::Inputs { eye, params, structure, behind, body, turbid, diffuse, work };
        frame.refract = Some(Refract::prepare(&self.gpu, frame.variant, inputs, &mut self.picture));
        self.compiled = Some((frame.variant, eye.scene.variant));
    }

    /// A timer for all passes of a frame.
    fn timer(&self, frame: &PreparedFrame<'_>) -> Timer {
        // Those of the views; then host, mips, color, shade, turbid, shadows and sums of spheres, refraction, surface and
        // tonemap, and the caustics of each light.
        let (opaque, views) = self
            .opaque
            .as_ref()
            .map_or((0, 0), |opaque| (OpaqueFluids::PASSES, opaque.light_views()));
        let of_lights = (PassNames::COUNT + 1) * (self.lights.views().len() + views);
        Timer::new(&self.gpu, frame.input.timing, PassNames::COUNT + 10 + opaque + of_lights)
    }

    /// Records the lights' maps, the layers and the G-buffer, as far as they are dirty.
    fn record_views(
        &self,
        frame: &PreparedFrame<'_>,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
    ) {
        if let Some(shadows) = self.shadows.as_ref().filter(|_| frame.dirty.lights) {
            shadows.record(commands, timer.span("sphere shadows"));
        }
        let shadows = self.shadows.as_ref();
        let inputs = frame.light_inputs(&self.splat_set, &self.meshes, shadows);
        self.lights.record(&frame.lights, commands, inputs, timer);
        if let Some(view) = &frame.view {
            self.camera_view.record(view, commands, timer, PassNames::CAMERA);
        }
        if let Some(host) = &frame.host {
            host.record(commands.encoder, &self.camera_view.camera, timer.span("host"));
        }
        let splats = frame.input.splats.opaque.as_deref();
        if let (Some(opaque), Some(prepared), Some(splats)) = (&self.opaque, &frame.opaque, splats)
        {
            opaque.record(prepared, splats, &self.meshes, commands, timer);
        }
        if let Some(mips) = &frame.mips {
            mips.record(commands.encoder, timer.span("mips"));
        }
    }

    /// Records refraction and the images of the first interface, as far as they are prepared, and the readback of the
    /// counts of rays with a host.
    fn record_picture(
        &self,
        frame: &PreparedFrame<'_>,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
    ) -> Option<Pending> {
        let eye = &self.camera_view;
        if let Some(color) = &frame.color {
            color.record(commands.encoder, timer.span("color"));
        }
        if let Some(shade) = &frame.shade {
            shade.record(commands, eye, timer.span("shade"));
        }
        if let Some(turbid) = &frame.turbid {
            turbid.record(commands, eye, timer.span("turbid"));
        }
        if let Some(diffuse) = &frame.diffuse {
            diffuse.record(commands, eye, timer.span("diffuse"));
        }
        if let Some(refract) = &frame.refract {
            refract.record(commands, eye, timer.span("refract"));
        }
        if let Some(surface) = &frame.surface {
            surface.record(commands, eye, timer.span("surface"));
        }
        frame.input.host.map(|_| self.picture.record_host_rays(&self.gpu, commands.encoder))
    }

    /// Discards the last frame, so that the next one runs all passes: for measuring the time of a
    /// complete frame.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// Number of submissions of the last frame: many, if a single one would occupy the device too long.
    pub fn submissions(&self) -> u32 {
        self.submissions
    }

    /// Indices of the last frame's lights without caustics, whose light is not refracted: point lights
    /// inside the liquid, and those from which it subtends more than 150 degrees.
    pub fn lights_without_caustics(&self) -> Vec<usize> {
        self.lights.without_caustics()
    }

    /// The intermediate images of the last frame.
    pub fn images(&self) -> Images {
        let (view, picture) = (&self.camera_view, &self.picture);
        Images {
            aggregate: view.images.splat.aggregate.clone(),
            smoothed: view.aggregate_layers().clone(),
            splash: view.splash_layers().cloned(),
            gbuffer: view.has_gbuffer().then(|| view.images.gbuffer.clone()),
            caustics: self.lights.caustic_maps(),
            surface: self.shows_surface.then(|| self.surface.images.clone()).flatten(),
            diffuse: self.diffuse.as_ref().map(DiffuseImages::pixel_sums),
            colors: self.colored.as_ref().and_then(ColorImages::by_value),
            fluids: self.fluids,
            radiance: picture.radiance.clone(),
            transparent: self.transparent,
            orthographic: view.camera.is_orthographic(),
            diagnostics: self.sized_for.1.then(|| picture.diagnostics.clone()),
        }
    }
}

/// The view to draw for a frame's: another if it is from very far away.
fn drawn_view(input: &FrameInput<'_>, blocks: &Blocks) -> Result<View> {
    let FrameInput { scene, view, splats, size, .. } = *input;
    let drawn = match input.host {
        Some(_) => view,
        None => view_range::from_near_by(view, scene, splats, size)?,
    };
    if drawn != view && input.surface.is_some() {
        let problem =
            "it is too far away for images beside the picture, which are measured from it";
        return Err(Error::invalid("camera", problem));
    }
    let support = scene.settings.classify.support;
    Ok(view_range::clear_of_liquid(drawn, splats, blocks, size, support))
}
