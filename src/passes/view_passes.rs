//! What one view sees: the liquid's layers, splatted and smoothed, and the opaque scene.
//!
//! The same passes draw it for the camera and for each light.

use glam::{DVec3, UVec2};

use super::gbuffer::{GBuffer, LightMaps, SceneBinding};
use super::mixture::Mixture;
use super::smooth::{self, Smooth};
use super::splat::Splat;
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
}

impl SplatSet {
    /// Nothing to draw yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self { aggregates: SplatBuffers::new(gpu), splashes: SplatBuffers::new(gpu) }
    }

    /// Uploads a frame's splats.
    pub fn upload(&mut self, gpu: &Gpu, splats: &Splats) {
        self.aggregates.upload(gpu, &splats.aggregates);
        self.splashes.upload(gpu, &splats.splashes);
    }
}

/// One frame's input to the views.
#[derive(Debug, Clone, Copy)]
pub struct FrameInputs<'a> {
    pub scene: &'a Scene,
    pub splats: &'a Splats,
    /// The same on the device.
    pub splat_set: &'a SplatSet,
    /// The iterations of smoothing.
    pub fits: &'a [smooth::Params],
}

/// A view's passes up to the point where light is followed, and their outputs.
#[derive(Debug)]
pub struct ViewPasses {
    pub camera: CameraBinding,
    pub scene: SceneBinding,
    pub aggregate: Splat,
    pub splash: Splat,
    pub mixture: Mixture,
    pub tiles: Tiles,
    pub smooth: Smooth,
    pub gbuffer: GBuffer,
    config: ViewConfig,
    smoothed: bool,
    /// The splats of this view alone, where it looks at walls from behind.
    own: Option<SplatSet>,
}

/// What a view's textures are made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewConfig {
    /// Pixels.
    pub size: UVec2,
    /// The frame has splashes.
    pub splash: bool,
    /// Fluids of different absorption are to be told apart.
    pub mixture: bool,
    /// The opaque scene is to be drawn.
    pub gbuffer: bool,
    /// Mip levels.
    pub levels: u32,
    /// Light goes out of the liquid as well as in: backs are drawn.
    pub backs: bool,
    /// So many aggregates are hidden that they are left out.
    pub culled: bool,
    /// How the lists of tiles are divided.
    pub sections: Sections,
}

/// Names of the passes in the timings: splat, splashes, mixture, tiles, smooth, gbuffer.
pub type Names = [&'static str; 6];

impl ViewPasses {
    /// Compiles the passes for a perspective or an orthographic view.
    pub fn new(gpu: &Gpu, orthographic: bool) -> Self {
        let camera = CameraBinding::new(gpu, orthographic);
        let scene = SceneBinding::new(gpu);
        let aggregate = Splat::new(gpu, &camera);
        let splash = aggregate.another(gpu);
        let mixture = Mixture::new(gpu, &camera);
        let tiles = Tiles::new(gpu);
        let smooth = Smooth::new(gpu, &camera, &aggregate.layers);
        let gbuffer = GBuffer::new(gpu);
        let config = ViewConfig {
            size: UVec2::ONE,
            splash: false,
            mixture: false,
            gbuffer: false,
            levels: 1,
            backs: true,
            culled: false,
            sections: Sections { tiles: 1, words: 2, count: 1 },
        };
        Self {
            camera,
            scene,
            aggregate,
            splash,
            mixture,
            tiles,
            smooth,
            gbuffer,
            config,
            smoothed: false,
            own: None,
        }
    }

    /// Gives each pass what it needs at this size, and one pixel to those that do not run.
    pub fn resize(&mut self, gpu: &Gpu, config: ViewConfig) {
        let textures = |config: ViewConfig| ViewConfig { backs: true, ..config };
        let same = textures(config) == textures(self.config);
        self.config = config;
        if same {
            return;
        }
        let used = |on: bool| if on { (config.size, config.levels) } else { (UVec2::ONE, 1) };
        self.aggregate.resize(gpu, config.size, config.levels, config.culled);
        let (size, levels) = used(config.splash);
        self.splash.resize(gpu, size, levels, false);
        self.mixture.resize(gpu, used(config.mixture).0);
        self.tiles.resize(gpu, config.size, config.sections);
        self.smooth.resize(gpu, &self.aggregate.layers);
        let (size, levels) = used(config.gbuffer);
        self.gbuffer.resize(gpu, size, levels);
    }

    /// Uploads the splats as the view is to see them, where they are not to be seen through walls; of
    /// what has not moved since they are there.
    pub fn look_past_walls(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        camera: &CameraUniform,
        eye: DVec3,
        splats: &Splats,
    ) {
        // The third row of the rotation into view space points at an orthographic view's eye.
        let [x, y, z] = camera.view_from_world.map(|column| f64::from(column[2]));
        let from = if camera.far > 0.0 { Eye::Towards(DVec3::new(x, y, z)) } else { Eye::At(eye) };
        self.own = seen_past_walls(splats, &scene.solids, from).map(|seen| {
            let mut own = self.own.take().unwrap_or_else(|| SplatSet::new(gpu));
            own.upload(gpu, &seen);
            own
        });
    }

    /// Uploads the view and the scene as it sees it, with the lights' own views and maps, and
    /// compiles what is new.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        frame: FrameInputs<'_>,
        camera: &CameraUniform,
        eye: DVec3,
        views: &[PlacedView],
        maps: Option<&LightMaps>,
    ) {
        let FrameInputs { scene, splats, splat_set, fits } = frame;
        self.camera.write(gpu, camera);
        let splat_set = self.own.as_ref().unwrap_or(splat_set);
        if self.config.culled {
            self.aggregate.prepare_culled(gpu, &self.camera, &splat_set.aggregates);
        }
        self.scene.upload(gpu, scene, eye, views, maps);
        if self.config.mixture {
            self.mixture.prepare(gpu, &self.camera, scene, splats.radius);
        }
        self.smoothed = !fits.is_empty();
        if self.smoothed {
            let settings = &scene.settings.smooth;
            self.smooth.prepare(gpu, &self.camera, settings, fits, self.config.backs);
        }
        if self.config.gbuffer {
            self.gbuffer.prepare(gpu, &self.camera, &self.scene);
        }
    }

    /// Draws all of it.
    pub fn record(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        frame: FrameInputs<'_>,
        timer: &mut Timer,
        [splat, splashes, mixture, tiles, smooth, gbuffer]: Names,
    ) {
        let encoder = &mut commands.encoder;
        let camera = &self.camera;
        let liquid = self.own.as_ref().unwrap_or(frame.splat_set);
        let backs = self.config.backs;
        let (aggregates, span) = (&liquid.aggregates, timer.span(splat));
        if self.config.culled {
            self.aggregate.record_culled(gpu, encoder, camera, aggregates, backs, span);
        } else {
            self.aggregate.record(encoder, camera, aggregates, backs, span);
        }
        if self.config.splash {
            let span = timer.span(splashes);
            self.splash.record(encoder, camera, &liquid.splashes, backs, span);
        }
        if self.config.mixture {
            let classes = [&liquid.aggregates, &liquid.splashes];
            self.mixture.record(encoder, camera, classes, timer.span(mixture));
        }
        self.tiles.record(
            gpu,
            encoder,
            &self.aggregate.layers,
            self.splash_layers(),
            timer.span(tiles),
        );
        if self.smoothed {
            let lists = &self.tiles.lists;
            self.smooth.record(gpu, commands, camera, lists, timer.span(smooth));
        }
        if self.config.gbuffer {
            let encoder = &mut commands.encoder;
            self.gbuffer.record(gpu, encoder, camera, &self.scene, timer.span(gbuffer));
        }
    }

    /// What the liquid is drawn from: smoothed, if anything was.
    pub fn aggregate_layers(&self) -> &Layers {
        if self.smoothed { &self.smooth.layers } else { &self.aggregate.layers }
    }

    /// The layers of the splashes, if the frame has any.
    pub fn splash_layers(&self) -> Option<&Layers> {
        self.config.splash.then_some(&self.splash.layers)
    }

    /// Whether the opaque scene is drawn.
    pub fn has_gbuffer(&self) -> bool {
        self.config.gbuffer
    }
}
