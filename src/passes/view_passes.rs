//! The passes of one view: the liquid's layers, splatted and smoothed, and the opaque scene.
//!
//! The camera and each light use the same passes.

use glam::{DVec3, UVec2};

use super::bins::{AGGREGATES, Bins, Listed, SPLASHES};
use super::gaps::{self, Gaps};
use super::gbuffer::GBuffer;
use super::mesh_buffers::MeshBuffers;
use super::mixture::Mixture;
use super::scene_binding::{LightMaps, SceneBinding};
use super::smooth::{self, Smooth};
use super::splat::{self, Splat};
use super::splat_buffers::SplatBuffers;
use super::tiles::{Sections, Tiles};
use super::{CameraBinding, Layers};
use crate::camera::CameraUniform;
use crate::gpu::{Commands, Gpu, Timer};
use crate::light_view::PlacedView;
use crate::liquid::classify::{Eye, Splats, seen_past_walls};
use crate::scene::Scene;

/// A frame's splats on the device.
#[derive(Debug)]
pub struct SplatSet {
    /// Bodies and sheets.
    pub aggregates: SplatBuffers,
    /// Droplets.
    pub splashes: SplatBuffers,
    /// Whether there are bodies or sheets of particles of other radii than most.
    pub radii_differ: bool,
}

impl SplatSet {
    /// Creates empty lists.
    pub fn new(gpu: &Gpu) -> Self {
        let [aggregates, splashes] = [(); 2].map(|()| SplatBuffers::new(gpu));
        Self { aggregates, splashes, radii_differ: false }
    }

    /// Uploads a frame's splats.
    pub fn upload(&mut self, gpu: &Gpu, splats: &Splats) {
        self.aggregates.upload(gpu, &splats.aggregates);
        self.splashes.upload(gpu, &splats.splashes);
        let radius = splats.radius;
        self.radii_differ = splats.aggregates.iter().any(|splat| splat.radius != radius);
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
}

/// A view's passes before light is traced, and their outputs.
#[derive(Debug)]
pub struct ViewPasses {
    pub camera: CameraBinding,
    pub scene: SceneBinding,
    pub bins: Bins,
    pub splat: Splat,
    pub mixture: Mixture,
    pub gaps: Gaps,
    pub tiles: Tiles,
    pub smooth: Smooth,
    pub gbuffer: GBuffer,
    config: ViewConfig,
    smoothed: bool,
    /// Splats of this view alone, if it sees walls from behind.
    own_splats: Option<(Splats, SplatSet)>,
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
    pub gaps: &'static str,
    pub tiles: &'static str,
    pub smooth: &'static str,
    pub smooth_gaps: &'static str,
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
        gaps: "gaps",
        tiles: "tiles",
        smooth: "smooth",
        smooth_gaps: "smooth gaps",
        gbuffer: "gbuffer",
    };

    /// The names of a light's passes.
    pub const LIGHT: Self = Self {
        splat: "light splat",
        splashes: "light splashes",
        mixture: "light mixture",
        gaps: "light gaps",
        tiles: "light tiles",
        smooth: "light smooth",
        smooth_gaps: "light smooth gaps",
        gbuffer: "light gbuffer",
    };
}

impl ViewPasses {
    /// Compiles the passes for a perspective or an orthographic view.
    pub fn new(gpu: &Gpu, orthographic: bool) -> Self {
        let camera = CameraBinding::new(gpu, orthographic);
        let scene = SceneBinding::new(gpu);
        let bins = Bins::new(gpu, &camera);
        let splat = Splat::new(gpu);
        let mixture = Mixture::new(gpu);
        let gaps = Gaps::new(gpu);
        let tiles = Tiles::new(gpu);
        let smooth = Smooth::new(gpu, &camera, &splat.aggregate);
        let gbuffer = GBuffer::new(gpu);
        let config = ViewConfig {
            size: UVec2::ONE,
            splash: false,
            mixture: false,
            gbuffer: false,
            host: false,
            levels: 1,
            backs: true,
            gaps: 0,
            tags: false,
            sections: Sections { tiles: 1, words: 2, count: 1 },
        };
        Self {
            camera,
            scene,
            bins,
            splat,
            mixture,
            gaps,
            tiles,
            smooth,
            gbuffer,
            config,
            smoothed: false,
            own_splats: None,
        }
    }

    /// Resizes the textures of each pass, to one pixel for passes that do not run.
    pub fn resize(&mut self, gpu: &Gpu, config: ViewConfig) {
        let textures = |config: ViewConfig| ViewConfig { backs: true, ..config };
        let same = textures(config) == textures(self.config);
        self.config = config;
        if same {
            return;
        }
        let used = |on: bool| if on { (config.size, config.levels) } else { (UVec2::ONE, 1) };
        let ViewConfig { size, gaps, levels, splash, tags, .. } = config;
        self.bins.resize(gpu, size);
        self.splat.resize(gpu, splat::Extent { size, gaps, levels, splash, tags });
        self.mixture.resize(gpu, used(config.mixture).0);
        let size = if config.gaps > 0 { config.size } else { UVec2::ONE };
        self.gaps.resize(gpu, size, config.sections);
        self.tiles.resize(gpu, config.size, config.sections);
        self.smooth.resize(gpu, &self.splat.aggregate);
        let (size, levels) = used(self.has_gbuffer());
        self.gbuffer.resize(gpu, size, levels);
    }

    /// Draws into the textures of another view of the same configuration, which is drawn before and no longer needed then.
    pub fn share(&mut self, other: &Self) {
        self.config = other.config;
        self.bins.share(&other.bins);
        self.splat.share(&other.splat);
        self.mixture.share(&other.mixture);
        self.gaps.share(&other.gaps);
        self.tiles.share(&other.tiles);
        self.smooth.share(&other.smooth);
        self.gbuffer.share(&other.gbuffer);
    }

    /// The configuration that the textures were made for.
    pub fn config(&self) -> ViewConfig {
        self.config
    }

    /// Allocates the lists of the splats that this view draws: the frame's or, if some of them would show through a
    /// wall seen from behind, its own.
    pub fn list_splats(
        &mut self,
        gpu: &Gpu,
        frame: FrameInputs<'_>,
        camera: &CameraUniform,
        eye: DVec3,
    ) {
        // The third row of the rotation into view space points towards an orthographic view's eye.
        let [x, y, z] = camera.view_from_world.map(|column| f64::from(column[2]));
        let from = if camera.far > 0.0 { Eye::Towards(DVec3::new(x, y, z)) } else { Eye::At(eye) };
        let seen = seen_past_walls(frame.splats, &frame.scene.solids, from);
        self.own_splats = seen.map(|seen| {
            let old = self.own_splats.take();
            let mut own = old.map_or_else(|| SplatSet::new(gpu), |(_, own)| own);
            own.upload(gpu, &seen);
            (seen, own)
        });
        let (splats, set) = match &self.own_splats {
            Some((splats, set)) => (splats, set),
            None => (frame.splats, frame.splat_set),
        };
        let classes = [
            Listed { splats: &splats.aggregates, buffers: &set.aggregates },
            Listed { splats: &splats.splashes, buffers: &set.splashes },
        ];
        let swell = if self.config.gaps > 0 { gaps::CLOSING } else { 1.0 };
        self.bins.prepare(gpu, camera, classes, swell, self.config.mixture);
    }

    /// Uploads the view, and the scene relative to it with the lights' views and maps, and compiles
    /// missing pipelines.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        frame: FrameInputs<'_>,
        camera: &CameraUniform,
        eye: DVec3,
        views: &[PlacedView],
        maps: Option<&LightMaps>,
    ) {
        let FrameInputs { scene, splats, splat_set, meshes, fits } = frame;
        self.camera.write(gpu, camera);
        let sizes = self.seen_splats(splat_set).radii_differ;
        let drawn = splat::Frame { backs: self.config.backs, sizes, tags: self.config.tags };
        self.splat.prepare(gpu, &self.camera, &self.bins, drawn);
        self.scene.upload(gpu, scene, meshes, eye, views, maps);
        if self.config.mixture {
            self.mixture.prepare(gpu, &self.camera, &self.bins, scene, splats.radius);
        }
        if self.config.gaps > 0 {
            let gaps = self.config.gaps;
            self.gaps.prepare(gpu, &self.camera, &self.bins, gaps, splats.radius, sizes);
        }
        // Flags of texels with gaps are written with the smoothed layers.
        self.smoothed = !fits.is_empty() || self.config.gaps > 0;
        if self.smoothed {
            let settings = &scene.settings.smooth;
            let ViewConfig { backs, gaps, .. } = self.config;
            let coverage = smooth::Coverage { backs, gaps, sizes };
            self.smooth.prepare(gpu, &self.camera, settings, fits, coverage);
        }
        if self.config.gbuffer && !self.config.host {
            self.gbuffer.prepare(gpu, &self.camera, &self.scene);
        }
    }

    /// Records all passes of the view.
    pub fn record(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        frame: FrameInputs<'_>,
        timer: &mut Timer,
        names: PassNames,
    ) {
        let encoder = &mut *commands.encoder;
        let camera = &self.camera;
        let liquid = self.seen_splats(frame.splat_set);
        let classes = [&liquid.aggregates, &liquid.splashes];
        let classes = &classes[..if self.config.splash { 2 } else { 1 }];
        for (class, name) in [(AGGREGATES, names.splat), (SPLASHES, names.splashes)] {
            let Some(&splats) = classes.get(class) else { continue };
            let span = timer.span(name);
            self.bins.record(encoder, camera, class, splats, span.first());
            self.splat.record(gpu, encoder, camera, &self.bins, (class, splats), span.last());
        }
        if self.config.mixture {
            let span = timer.span(names.mixture);
            self.mixture.record(gpu, encoder, camera, &self.bins, classes, span);
        }
        if self.config.gaps > 0 {
            let layers = [&self.splat.aggregate, &self.splat.splash];
            let classes: Vec<_> = classes.iter().copied().zip(layers).collect();
            let span = timer.span(names.gaps);
            self.gaps.record(gpu, encoder, (camera, &self.bins), &self.tiles, &classes, span);
        }
        self.tiles.record(
            gpu,
            encoder,
            &self.splat.aggregate,
            self.splash_layers(),
            timer.span(names.tiles),
        );
        if self.smoothed {
            let lists = &self.tiles.lists;
            let (gaps, splash, span) = (&self.gaps, self.splash_layers(), timer.span(names.smooth));
            self.smooth.record(commands, camera, lists, gaps, splash, span);
            if self.config.gaps > 0 {
                let span = timer.span(names.smooth_gaps);
                self.smooth.record_gaps(gpu, commands, camera, &self.gaps, span);
            }
        }
        if self.config.gbuffer && !self.config.host {
            let encoder = &mut *commands.encoder;
            self.gbuffer.record(gpu, encoder, camera, &self.scene, timer.span(names.gbuffer));
        }
    }

    /// The splats that this view draws: its own, if it has any, or the frame's.
    pub fn seen_splats<'a>(&'a self, frame: &'a SplatSet) -> &'a SplatSet {
        self.own_splats.as_ref().map_or(frame, |(_, own)| own)
    }

    /// The layers that the liquid is drawn from: smoothed, if there was smoothing.
    pub fn aggregate_layers(&self) -> &Layers {
        if self.smoothed { &self.smooth.layers } else { &self.splat.aggregate }
    }

    /// The layers of the splashes, if the frame has any.
    pub fn splash_layers(&self) -> Option<&Layers> {
        self.config.splash.then_some(&self.splat.splash)
    }

    /// Whether the G-buffer is filled.
    pub fn has_gbuffer(&self) -> bool {
        self.config.gbuffer || self.config.host
    }
}
