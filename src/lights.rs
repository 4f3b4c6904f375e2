//! What the lights of a frame see, and the caustic maps that are made of it.

use glam::{DVec3, UVec2};

use crate::error::Result;
use crate::gpu::{self, Commands, Gpu, Timer};
use crate::light_view::LightView;
use crate::passes::Layers;
use crate::passes::caustics::{CausticMap, Caustics, Inputs, Output, Params};
use crate::passes::classify::Splats;
use crate::passes::gbuffer::LightMaps;
use crate::passes::mixture;
use crate::passes::smooth;
use crate::passes::surfaces::{Liquid, Surfaces, Wanted};
use crate::passes::tiles::Sections;
use crate::scene::Scene;

/// The lights' own views and maps; nothing if nothing is lit.
#[derive(Debug, Default)]
pub(crate) struct Lights {
    views: Vec<Option<LightView>>,
    maps: Option<LightMaps>,
    /// A view's passes, in the order of the lights; kept for the next frame.
    passes: Vec<LightPasses>,
}

#[derive(Debug)]
struct LightPasses {
    orthographic: bool,
    surfaces: Surfaces,
    caustics: Caustics,
}

impl Lights {
    /// Chooses the views, makes room for the maps and compiles what is new.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        liquid: &Liquid,
        splats: &Splats,
        culled: bool,
        fits: &[smooth::Params],
    ) -> Result<()> {
        let settings = &scene.settings.caustics;
        self.views.clear();
        if !scene.is_lit() {
            return Ok(());
        }
        self.views.extend(views(scene, splats));
        if self.views.iter().all(Option::is_none) {
            return Ok(());
        }
        let size = UVec2::splat(settings.resolution);
        gpu.check_image(size, "choose a smaller caustics.resolution")?;
        let layers = gpu::array_layers(gpu, scene.lights.len() as u32);
        let fits_maps = |maps: &LightMaps| {
            maps.maps.width() == size.x && maps.maps.depth_or_array_layers() == layers
        };
        if !self.maps.as_ref().is_some_and(fits_maps) {
            let usage = wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC;
            let new = |label| gpu::texture(gpu, label, size, layers, Layers::FORMAT, usage);
            self.maps =
                Some(LightMaps { maps: new("caustic maps"), receivers: new("caustic receivers") });
        }

        let splash = !splats.splashes.is_empty();
        let views = self.views.iter().flatten();
        for (i, view) in views.enumerate() {
            if self.passes.get(i).is_none_or(|passes| passes.orthographic != view.orthographic) {
                let surfaces = Surfaces::new(gpu, view.orthographic);
                let caustics = Caustics::new(gpu, &surfaces.camera);
                let passes = LightPasses { orthographic: view.orthographic, surfaces, caustics };
                self.passes.truncate(i);
                self.passes.push(passes);
            }
            let LightPasses { surfaces, caustics, .. } = &mut self.passes[i];
            let backs = settings.interfaces > 1;
            let size = view.size;
            let mixture = mixture::is_mixed(scene);
            let sections = Sections::for_work(gpu, size, smooth::work(&scene.settings.smooth));
            let gbuffer = true;
            let wanted =
                Wanted { size, splash, mixture, gbuffer, levels: 1, backs, culled, sections };
            surfaces.resize(gpu, wanted);
            let uniform = view.uniform(splats.origin);
            surfaces.prepare(
                gpu,
                scene,
                liquid,
                &uniform,
                view.origin,
                &[],
                None,
                splats.radius,
                fits,
            );
            caustics.prepare(gpu, &surfaces.camera, &surfaces.scene, scene, splash, view.size)?;
        }
        Ok(())
    }

    /// Draws what each light sees, and its map.
    #[expect(clippy::too_many_arguments, reason = "its inputs, each by its name")]
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        scene: &Scene,
        liquid: &Liquid,
        splats: &Splats,
        fits: &[smooth::Params],
        timer: &mut Timer,
    ) {
        let seen = self.views.iter().zip(&scene.lights).enumerate();
        let seen = seen.filter_map(|(i, (view, light))| Some((i, view.as_ref()?, light)));
        for ((layer, view, light), passes) in seen.zip(&self.passes) {
            let Some(maps) = &self.maps else { return };
            let LightPasses { surfaces, caustics, .. } = passes;
            let names = [
                "light splat",
                "light splashes",
                "light mixture",
                "light tiles",
                "light smooth",
                "light gbuffer",
            ];
            surfaces.record(gpu, commands, scene, liquid, fits, timer, names);
            let inputs = Inputs {
                camera: &surfaces.camera,
                scene: &surfaces.scene,
                aggregate: surfaces.aggregate_layers(),
                splash: surfaces.splash_layers(),
                gbuffer: &surfaces.gbuffer.images,
                mixture: Some(&surfaces.mixture.view),
            };
            let output =
                Output { map: &maps.maps, receivers: &maps.receivers, layer: layer as u32 };
            let params = Params::new(light, view, &scene.settings.caustics);
            let radius = splats.radius;
            let span = timer.span("caustics");
            caustics.record(gpu, commands, scene, radius, &params, inputs, output, span);
        }
    }

    /// Each light's view, if it has one.
    pub(crate) fn views(&self) -> &[Option<LightView>] {
        &self.views
    }

    /// The maps, if any light has one.
    pub(crate) fn maps(&self) -> Option<&LightMaps> {
        self.maps.as_ref().filter(|_| self.views.iter().any(Option::is_some))
    }

    /// The maps with the views that they were made by.
    pub(crate) fn caustic_maps(&self) -> Vec<Option<CausticMap>> {
        let map = |(layer, view): (u32, &Option<LightView>)| {
            let (view, maps) = ((*view)?, self.maps.as_ref()?);
            let (map, receivers) = (maps.maps.clone(), maps.receivers.clone());
            Some(CausticMap { view, map, receivers, layer })
        };
        (0..).zip(&self.views).map(map).collect()
    }
}

/// The view by which each light's map is made; none where a light has no use for one.
pub(crate) fn views(scene: &Scene, splats: &Splats) -> Vec<Option<LightView>> {
    let settings = &scene.settings.caustics;
    let Some(bounds) = bounds(splats) else { return vec![None; scene.lights.len()] };
    let margin = f64::from(settings.margin);
    let level = level(splats, bounds).map(|height| (height, f64::from(scene.liquid.ior)));
    let view =
        |light| LightView::new(light, bounds, &scene.solids, margin, settings.resolution, level);
    scene.lights.iter().map(view).collect()
}

/// The box around a frame's splats, m; none without any.
pub(crate) fn bounds(splats: &Splats) -> Option<(DVec3, DVec3)> {
    let all = splats.aggregates.iter().chain(&splats.splashes);
    let (min, max) = all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), splat| {
        let centre = glam::Vec3::from_array(splat.centre).as_dvec3();
        let radius = f64::from(splat.radius);
        (min.min(centre - radius), max.max(centre + radius))
    });
    min.is_finite().then_some((splats.origin + min, splats.origin + max))
}

/// Columns along either side of the grid by which [`level`] judges.
const COLUMNS: usize = 24;

/// The height of the liquid's surface, m, if it is level: if it fills its box, and the tops of its
/// columns differ little over its breadth.
fn level(splats: &Splats, (min, max): (DVec3, DVec3)) -> Option<f64> {
    let breadth = (max - min).with_y(0.0);
    let mut tops = [f64::NEG_INFINITY; COLUMNS * COLUMNS];
    for splat in &splats.aggregates {
        let centre = splats.origin + glam::Vec3::from_array(splat.centre).as_dvec3();
        let at = ((centre - min) / breadth.max(DVec3::splat(f64::MIN_POSITIVE))) * COLUMNS as f64;
        let column = |x: f64| (x as usize).min(COLUMNS - 1);
        let top = &mut tops[column(at.z) * COLUMNS + column(at.x)];
        *top = top.max(centre.y);
    }
    let mut tops: Vec<_> = tops.into_iter().filter(|top| top.is_finite()).collect();
    tops.sort_by(f64::total_cmp);
    let at = |share: f64| tops[((tops.len() - 1) as f64 * share) as usize];
    let filled = tops.len() as f64 >= FILLED * (COLUMNS * COLUMNS) as f64;
    let flat = filled && at(0.9) - at(0.1) <= FLAT * breadth.max_element();
    flat.then(|| at(0.5))
}

/// Share of the columns that a level surface fills: a round vessel fills π/4.
const FILLED: f64 = 0.6;

/// Difference in height of a level surface, without its highest and lowest tenths, over its breadth.
const FLAT: f64 = 0.1;
