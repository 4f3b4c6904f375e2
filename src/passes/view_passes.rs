//! The passes of one view: the liquid's layers, splatted and smoothed, and the opaque scene.
//!
//! The camera and each light use the same passes.

use std::sync::Arc;

use glam::{DVec3, UVec2};

use super::bins::{AGGREGATES, BinBuffers, Bins, Listed};
use super::bounds::{self, Bounds};
use super::gaps::{self, GapImages, Gaps};
use super::gbuffer::GBuffer;
use super::mesh_buffers::MeshBuffers;
use super::mixture::{Mixture, MixtureImages, Shares};
use super::scene_binding::{LightMaps, SceneBinding};
use super::smooth::{self, Smooth, SmoothImages};
use super::sphere_shadows::Shadows;
use super::splat::{self, SplatImages, SplatPass};
use super::splat_buffers::SplatBuffers;
use super::tiles::{Sections, TileLists, Tiles};
use super::{CameraBinding, GBufferImages, Layers};
use crate::camera::CameraUniform;
use crate::gpu::{Commands, Gpu, Timer};
use crate::light_view::PlacedView;
use crate::liquid::blocks::Blocks;
use crate::liquid::classify::{Eye, Splats, seen_past_walls};
use crate::scene::Scene;
use crate::settings;

/// A frame's splats on the device.
#[derive(Debug)]
pub struct SplatSet {
    /// Bodies and sheets.
    pub aggregates: SplatBuffers,
    /// Droplets.
    pub splashes: SplatBuffers,
    /// Both by blocks.
    pub blocks: Blocks,
}

impl SplatSet {
    /// Creates empty lists.
    pub fn new(gpu: &Gpu) -> Self {
        let [aggregates, splashes] = [(); 2].map(|()| SplatBuffers::new(gpu));
        Self { aggregates, splashes, blocks: Blocks::default() }
    }

    /// Uploads a frame's splats.
    pub fn upload(&mut self, gpu: &Gpu, splats: &Splats) {
        match &splats.device {
            Some(device) => {
                self.aggregates.bind(gpu, device);
                match device.has_splashes {
                    true => self.splashes.bind(gpu, device),
                    false => self.splashes.upload(gpu, &[]),
                }
            }
            None => {
                self.aggregates.upload(gpu, &splats.aggregates);
                self.splashes.upload(gpu, &splats.splashes);
            }
        }
        self.blocks = Blocks::new(splats);
    }
}

/// Inputs of a frame to its views.
#[derive(Debug, Clone, Copy)]
pub struct FrameInputs<'a> {
    pub scene: &'a Scene,
    pub splats: &'a Splats,
    /// The same splats on the device.
    pub splat_set: &'a SplatSet,
    /// The solids' meshes on the device.
    pub meshes: &'a MeshBuffers,
    /// Parameters of each smoothing iteration.
    pub fits: &'a [smooth::Params],
    /// Shadows of foam, spray and bubbles.
    pub shadows: Option<&'a Shadows>,
}

/// A view: its bindings, and the images of its passes.
#[derive(Debug)]
pub struct ViewPasses {
    pub camera: CameraBinding,
    pub scene: SceneBinding,
    pub images: ViewImages,
    config: ViewConfig,
    /// Splats of this view alone, if it sees walls from behind.
    own_splats: Option<(Splats, SplatSet)>,
    /// The smoothing of the last frame, kept because its bindings are four tenths of a frame's preparation.
    kept_smooth: Option<(SmoothInputs, Arc<Smooth>)>,
}

/// Inputs of the smoothing beside the images.
#[derive(Debug, PartialEq)]
struct SmoothInputs {
    settings: settings::Smooth,
    fits: Vec<smooth::Params>,
    coverage: smooth::Coverage,
    splash: bool,
}

/// Outputs of a view's passes, and memory between them. Views of one configuration can share them: clones are the same
/// images.
#[derive(Debug, Clone)]
pub struct ViewImages {
    pub bins: BinBuffers,
    pub splat: SplatImages,
    pub mixture: MixtureImages,
    /// The same of scattering, for the camera's view.
    pub scattering: MixtureImages,
    pub gaps: GapImages,
    pub tiles: TileLists,
    pub smooth: SmoothImages,
    /// Of [`bounds::create_view`].
    pub bounds: wgpu::TextureView,
    pub gbuffer: GBufferImages,
}

/// A frame's passes of one view before light is traced, in order; `None` for passes that do not run.
#[derive(Debug)]
pub struct PreparedView {
    bins: Bins,
    /// By class.
    splat: Vec<SplatPass>,
    mixture: Option<Mixture>,
    scattering: Option<Mixture>,
    gaps: Option<Gaps>,
    tiles: Tiles,
    smooth: Option<Arc<Smooth>>,
    bounds: Option<Bounds>,
    gbuffer: Option<GBuffer>,
}

/// Configuration of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewConfig {
    /// Size in pixels.
    pub size: UVec2,
    /// The frame has splashes.
    pub splash: bool,
    /// Draw the mixture, because the fluids differ in absorption.
    pub mixture: bool,
    /// Draw the mixture's scattering, because the fluids differ in that.
    pub scattering: bool,
    /// Scattering attenuates light as absorption does: in the view of a light.
    pub attenuates: bool,
    /// Draw the opaque scene.
    pub gbuffer: bool,
    /// A host has drawn the opaque scene: its pass fills the G-buffer.
    pub host: bool,
    /// Mip levels.
    pub levels: u32,
    /// Draw backs, because light leaves the liquid as well as enters it.
    pub backs: bool,
    /// Gaps between liquid and liquid that a pixel distinguishes.
    pub gaps: u32,
    /// Smooth the layers of the aggregates, or flag their gaps.
    pub smooth: bool,
    /// Find the bounds of the layers in each tile.
    pub bounds: bool,
    /// Write the particle and fluid of each front.
    pub tags: bool,
    /// Division of the lists of tiles.
    pub sections: Sections,
}

/// The names of a view's passes in the timings.
#[derive(Debug, Clone, Copy)]
#[expect(missing_docs, reason = "each is the name of a pass")]
pub struct PassNames {
    pub splat: &'static str,
    pub splashes: &'static str,
    pub mixture: &'static str,
    pub scattering: &'static str,
    pub gaps: &'static str,
    pub tiles: &'static str,
    pub smooth: &'static str,
    pub smooth_gaps: &'static str,
    pub bounds: &'static str,
    pub gbuffer: &'static str,
}

impl PassNames {
    /// Number of a view's passes.
    pub const COUNT: usize = size_of::<Self>() / size_of::<&str>();

    /// The names of the camera's passes.
    pub const CAMERA: Self = Self {
        splat: "splat",
        splashes: "splat splashes",
        mixture: "mixture",
        scattering: "mixture of scattering",
        gaps: "gaps",
        tiles: "tiles",
        smooth: "smooth",
        smooth_gaps: "smooth gaps",
        bounds: "bounds",
        gbuffer: "gbuffer",
    };

    /// The names of the camera's passes of opaque fluids.
    pub const OPAQUE: Self = Self {
        splat: "opaque splat",
        splashes: "opaque splashes",
        mixture: "opaque mixture",
        scattering: "opaque mixture of scattering",
        gaps: "opaque gaps",
        tiles: "opaque tiles",
        smooth: "opaque smooth",
        smooth_gaps: "opaque smooth gaps",
        bounds: "opaque bounds",
        gbuffer: "opaque gbuffer",
    };

    /// The names of a light's passes.
    pub const LIGHT: Self = Self {
        splat: "light splat",
        splashes: "light splashes",
        mixture: "light mixture",
        scattering: "light mixture of scattering",
        gaps: "light gaps",
        tiles: "light tiles",
        smooth: "light smooth",
        smooth_gaps: "light smooth gaps",
        bounds: "light bounds",
        gbuffer: "light gbuffer",
    };
}

impl ViewImages {
    /// Creates the images of each pass, of one pixel for passes that do not run.
    pub fn new(gpu: &Gpu, config: ViewConfig) -> Self {
        let ViewConfig { size, splash, gaps, levels, tags, sections, .. } = config;
        let used = |on: bool| if on { (size, levels) } else { (UVec2::ONE, 1) };
        let splat = SplatImages::new(gpu, splat::Extent { size, gaps, levels, splash, tags });
        let (opaque_size, opaque_levels) = used(config.gbuffer || config.host);
        Self {
            bins: BinBuffers::new(gpu, size),
            mixture: MixtureImages::new(gpu, used(config.mixture).0),
            scattering: MixtureImages::new(gpu, used(config.scattering).0),
            gaps: GapImages::new(gpu, used(gaps > 0).0, sections),
            tiles: TileLists::new(gpu, size, sections),
            smooth: SmoothImages::new(gpu, &splat.aggregate),
            bounds: bounds::create_view(gpu, size),
            gbuffer: GBufferImages::new(gpu, opaque_size, opaque_levels),
            splat,
        }
    }
}

impl ViewPasses {
    /// Creates a perspective or an orthographic view of one pixel.
    pub fn new(gpu: &Gpu, orthographic: bool) -> Self {
        let config = ViewConfig {
            size: UVec2::ONE,
            splash: false,
            mixture: false,
            scattering: false,
            attenuates: false,
            gbuffer: false,
            host: false,
            levels: 1,
            backs: true,
            gaps: 0,
            smooth: false,
            bounds: false,
            tags: false,
            sections: Sections { tiles: 1, words: 2, count: 1 },
        };
        Self {
            camera: CameraBinding::new(gpu, orthographic),
            scene: SceneBinding::new(gpu),
            images: ViewImages::new(gpu, config),
            config,
            own_splats: None,
            kept_smooth: None,
        }
    }

    /// Replaces the images where another configuration needs others.
    pub fn resize(&mut self, gpu: &Gpu, config: ViewConfig) {
        let images =
            |config: ViewConfig| ViewConfig { backs: true, smooth: true, bounds: true, ..config };
        if images(config) != images(self.config) {
            self.images = ViewImages::new(gpu, config);
            self.kept_smooth = None;
        }
        self.config = config;
    }

    /// Draws into the images of another view of the same configuration, which is drawn before and no longer needed then.
    pub fn share(&mut self, other: &Self) {
        (self.config, self.images) = (other.config, other.images.clone());
        self.kept_smooth = None;
    }

    /// The configuration that the textures were made for.
    pub fn config(&self) -> ViewConfig {
        self.config
    }

    /// Uploads the view, and the scene relative to it with the lights' views and maps.
    pub fn upload(
        &mut self,
        gpu: &Gpu,
        frame: FrameInputs<'_>,
        camera: &CameraUniform,
        eye: DVec3,
        views: &[PlacedView],
        maps: Option<&LightMaps>,
    ) {
        self.camera.write(gpu, camera);
        let FrameInputs { scene, meshes, shadows, .. } = frame;
        self.scene.upload(gpu, (scene, meshes, shadows), eye, views, maps);
    }

    /// Prepares the passes of the view, which is uploaded before: allocates the lists of its splats, and compiles missing
    /// pipelines.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        frame: FrameInputs<'_>,
        uniform: &CameraUniform,
        eye: DVec3,
    ) -> PreparedView {
        self.choose_splats(gpu, frame, uniform, eye);
        let FrameInputs { scene, fits, .. } = frame;
        let Self { camera, images, config, own_splats, kept_smooth, .. } = self;
        let ViewConfig { backs, gaps, tags, .. } = *config;
        let (splats, set) = match own_splats {
            Some((splats, set)) => (&*splats, &*set),
            None => (frame.splats, frame.splat_set),
        };
        let device = splats.device.as_ref();
        let listed = [
            Listed {
                splats: &splats.aggregates,
                blocks: &set.blocks.aggregates,
                buffers: &set.aggregates,
                device,
            },
            Listed {
                splats: &splats.splashes,
                blocks: &set.blocks.splashes,
                buffers: &set.splashes,
                device: device.filter(|device| device.has_splashes),
            },
        ];
        let swell = if gaps > 0 { gaps::CLOSING } else { 1.0 };
        let kept = &mut images.bins;
        let bins = Bins::prepare(
            gpu,
            camera,
            uniform,
            listed,
            swell,
            config.mixture || config.scattering,
            kept,
        );

        let (sizes, radius) = (set.blocks.radii_differ, frame.splats.radius);
        let layers = [&images.splat.aggregate, &images.splat.splash];
        let layers = &layers[..if config.splash { 2 } else { 1 }];
        let splash = layers.get(1).copied();
        let drawn = splat::Drawn { backs, sizes, tags };
        let splat = |class| SplatPass::prepare(gpu, camera, &bins, class, &images.splat, drawn);
        let splat = (0..layers.len()).map(splat).collect();
        let mixed = |images, shares: Shares| {
            Mixture::prepare(gpu, camera, &bins, layers.len(), images, &shares, radius)
        };
        let mixture = config.mixture.then(|| {
            let shares =
                if config.attenuates { Shares::of_attenuation } else { Shares::of_absorption };
            mixed(&images.mixture, shares(scene))
        });
        let scattering =
            config.scattering.then(|| mixed(&images.scattering, Shares::of_scattering(scene)));
        let found = (gaps > 0).then(|| {
            Gaps::prepare(gpu, camera, &bins, layers, &images.gaps, (gaps, sizes), radius)
        });
        let tiles = Tiles::prepare(gpu, &images.tiles, layers[0], splash);
        let smooth = config.smooth.then(|| {
            let (tiles, gap_images) = (&images.tiles, &images.gaps);
            let inputs = smooth::Inputs { splatted: layers[0], splash, tiles, gaps: gap_images };
            let known = SmoothInputs {
                settings: scene.settings.smooth.clone(),
                fits: fits.to_vec(),
                coverage: smooth::Coverage { backs, gaps, sizes },
                splash: splash.is_some(),
            };
            if let Some((_, kept)) = kept_smooth.as_ref().filter(|(kept, _)| *kept == known) {
                return kept.clone();
            }
            let (settings, coverage) = (&known.settings, known.coverage);
            let new =
                Smooth::prepare(gpu, camera, inputs, &images.smooth, settings, fits, coverage);
            kept_smooth.insert((known, Arc::new(new))).1.clone()
        });
        let bounds = config.bounds.then(|| {
            let drawn = if config.smooth { &images.smooth.layers } else { layers[0] };
            Bounds::prepare(gpu, camera, &images.tiles, drawn, splash, &images.bounds)
        });
        let gbuffer = (config.gbuffer && !config.host)
            .then(|| GBuffer::prepare(gpu, camera, &self.scene, &images.gbuffer));
        PreparedView {
            bins,
            splat,
            mixture,
            scattering,
            gaps: found,
            tiles,
            smooth,
            bounds,
            gbuffer,
        }
    }

    /// Chooses the splats that this view draws: the frame's or, if some of them would show through a wall seen from
    /// behind, its own.
    fn choose_splats(
        &mut self,
        gpu: &Gpu,
        frame: FrameInputs<'_>,
        camera: &CameraUniform,
        eye: DVec3,
    ) {
        // Splats on the device stay as they are.
        if frame.splats.device.is_some() {
            self.own_splats = None;
            return;
        }
        // The third row of the rotation into view space points towards an orthographic view's eye.
        let [x, y, z] = camera.view_from_world.map(|column| f64::from(column[2]));
        let from = if camera.far > 0.0 { Eye::Towards(DVec3::new(x, y, z)) } else { Eye::At(eye) };
        let extent = frame.splat_set.blocks.extent(frame.splats.origin);
        let solids = &frame.scene.solids;
        let seen = extent.and_then(|extent| seen_past_walls(frame.splats, extent, solids, from));
        self.own_splats = seen.map(|seen| {
            let old = self.own_splats.take();
            let mut own = old.map_or_else(|| SplatSet::new(gpu), |(_, own)| own);
            own.upload(gpu, &seen);
            (seen, own)
        });
    }

    /// Records all passes of the view.
    pub fn record(
        &self,
        prepared: &PreparedView,
        commands: &mut Commands<'_>,
        timer: &mut Timer,
        names: PassNames,
    ) {
        let PreparedView { bins, splat, mixture, scattering, gaps, tiles, smooth, bounds, gbuffer } =
            prepared;
        let Self { camera, scene, .. } = self;
        let encoder = &mut *commands.encoder;
        for (class, splat) in splat.iter().enumerate() {
            let span = timer.span(if class == AGGREGATES { names.splat } else { names.splashes });
            bins.record(encoder, class, span.first());
            splat.record(encoder, camera, bins, span.last());
        }
        if let Some(mixture) = mixture {
            mixture.record(encoder, camera, bins, timer.span(names.mixture));
        }
        if let Some(scattering) = scattering {
            scattering.record(encoder, camera, bins, timer.span(names.scattering));
        }
        if let Some(gaps) = gaps {
            gaps.record(encoder, bins, timer.span(names.gaps));
        }
        tiles.record(encoder, timer.span(names.tiles));
        if let Some(smooth) = smooth {
            smooth.record(commands, timer.span(names.smooth));
            if gaps.is_some() {
                smooth.record_gaps(commands, timer.span(names.smooth_gaps));
            }
        }
        if let Some(bounds) = bounds {
            bounds.record(commands.encoder, camera, timer.span(names.bounds));
        }
        if let Some(gbuffer) = gbuffer {
            gbuffer.record(commands.encoder, camera, scene, timer.span(names.gbuffer));
        }
    }

    /// The layers that the liquid is drawn from: smoothed, if there was smoothing.
    pub fn aggregate_layers(&self) -> &Layers {
        let images = &self.images;
        if self.config.smooth { &images.smooth.layers } else { &images.splat.aggregate }
    }

    /// The layers of the splashes, if the frame has any.
    pub fn splash_layers(&self) -> Option<&Layers> {
        self.config.splash.then_some(&self.images.splat.splash)
    }

    /// Whether the G-buffer is filled.
    pub fn has_gbuffer(&self) -> bool {
        self.config.gbuffer || self.config.host
    }
}
