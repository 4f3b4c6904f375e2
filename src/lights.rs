//! What the lights of a frame see, and the caustic maps that are made of it.

use glam::{DVec3, UVec2, Vec3};

use crate::error::{Limited, Result};
use crate::gpu::{self, Commands, Gpu, Timer};
use crate::light_view::PlacedView;
use crate::light_view::{CUBE, LightView};
use crate::liquid::bulk::{self, Bulk};
use crate::liquid::classify::{Splat, Splats};
use crate::passes::Layers;
use crate::passes::caustics::{CausticMap, Caustics, Inputs, MapConfig, Output, Params};
use crate::passes::gbuffer::LightMaps;
use crate::passes::mixture;
use crate::passes::smooth;
use crate::passes::tiles::Sections;
use crate::passes::view_passes::{FrameInputs, ViewConfig, ViewPasses};
use crate::scene::{Light, Scene};
use crate::settings::{self, Method};

/// The views from one light.
#[derive(Debug, Clone, Default)]
pub struct LightViews {
    /// The view by which the caustic map is made; none where the light would see the liquid under
    /// too wide an angle.
    pub map: Option<LightView>,
    /// Views along the light itself, which tell where liquid is in its way: none if the map's is
    /// such a view, one, or the faces of a cube, of which those are none that see no liquid.
    pub straight: Vec<Option<LightView>>,
    /// Whether it is a point in the liquid.
    pub wet: bool,
}

/// The lights' own views and maps; nothing if nothing is lit.
#[derive(Debug, Default)]
pub struct Lights {
    /// How many lights the scene has that light anything.
    count: usize,
    views: Vec<PlacedView>,
    maps: Option<LightMaps>,
    /// A view's passes, in the order of the views; kept for the next frame.
    passes: Vec<LightPasses>,
}

#[derive(Debug)]
struct LightPasses {
    orthographic: bool,
    surfaces: ViewPasses,
    caustics: Caustics,
}

impl Lights {
    /// Chooses the views, makes room for the maps and compiles what is new.
    pub fn prepare(&mut self, gpu: &Gpu, frame: FrameInputs<'_>, culled: bool) -> Result<()> {
        let FrameInputs { scene, splats, .. } = frame;
        let settings = &scene.settings.caustics;
        (self.count, self.views) = (0, Vec::new());
        if !scene.is_lit() {
            return Ok(());
        }
        self.count = scene.lights.len();
        self.views = place(&light_views(scene, splats), settings.resolution);
        let Some(last) = self.views.last() else { return Ok(()) };
        let size = UVec2::splat(settings.resolution);
        gpu.check_image(size, Limited::CausticMap)?;
        let layers = gpu::array_layers(gpu, (last.layer + 1).max(self.count as u32));
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
        for (i, placed) in self.views.iter().enumerate() {
            let view = &placed.view;
            if self.passes.get(i).is_none_or(|passes| passes.orthographic != view.orthographic) {
                let surfaces = ViewPasses::new(gpu, view.orthographic);
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
            let config =
                ViewConfig { size, splash, mixture, gbuffer, levels: 1, backs, culled, sections };
            surfaces.resize(gpu, config);
            let uniform = view.uniform(splats.origin);
            surfaces.look_past_walls(gpu, scene, &uniform, view.origin, splats);
            surfaces.prepare(gpu, frame, &uniform, view.origin, &[], None);
            let own = settings_of(placed, settings);
            let (camera, bound) = (&surfaces.camera, &surfaces.scene);
            let config = MapConfig { settings: &own, splash, size };
            caustics.prepare(gpu, camera, bound, scene, config)?;
        }
        Ok(())
    }

    /// Draws what each light sees, and its maps.
    pub fn record(
        &self,
        gpu: &Gpu,
        commands: &mut Commands<'_>,
        frame: FrameInputs<'_>,
        timer: &mut Timer,
    ) {
        let FrameInputs { scene, splats, .. } = frame;
        for (placed, passes) in self.views.iter().zip(&self.passes) {
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
            surfaces.record(gpu, commands, frame, timer, names);
            let own = settings_of(placed, &scene.settings.caustics);
            let PlacedView { layer, corner, .. } = *placed;
            let light = &scene.lights[placed.light];
            let params = Params {
                wet: u32::from(placed.wet),
                corner: corner.to_array(),
                ..Params::new(light, &placed.view, &own)
            };
            let inputs = Inputs {
                camera: &surfaces.camera,
                scene: &surfaces.scene,
                aggregate: surfaces.aggregate_layers(),
                splash: surfaces.splash_layers(),
                gbuffer: &surfaces.gbuffer.images,
                mixture: Some(&surfaces.mixture.view),
                method: own.method,
                params: &params,
            };
            let output = Output { map: &maps.maps, receivers: &maps.receivers, layer };
            let radius = splats.radius;
            let span = timer.span("caustics");
            caustics.record(commands, scene, radius, inputs, output, span);
        }
    }

    /// The lights' views, as the maps hold them.
    pub fn views(&self) -> &[PlacedView] {
        &self.views
    }

    /// The maps, if any light has one.
    pub fn maps(&self) -> Option<&LightMaps> {
        self.maps.as_ref().filter(|_| !self.views.is_empty())
    }

    /// The caustic maps with the views that they were made by.
    pub fn caustic_maps(&self) -> Vec<Option<CausticMap>> {
        let mut found = vec![None; self.count];
        let Some(maps) = &self.maps else { return found };
        for placed in self.views.iter().filter(|placed| placed.slot == 0) {
            let (map, receivers) = (maps.maps.clone(), maps.receivers.clone());
            let (view, layer) = (placed.view, placed.layer);
            found[placed.light] = Some(CausticMap { view, map, receivers, layer });
        }
        found
    }

    /// Numbers, from 0, of the lights that shine through liquid straight, without caustics: those in
    /// the liquid and those that see it under more than 150 degrees.
    pub fn without_caustics(&self) -> Vec<usize> {
        let has_map = |light| self.views.iter().any(|view| view.light == light && view.slot == 0);
        (0..self.count).filter(|&light| !self.views.is_empty() && !has_map(light)).collect()
    }
}

/// The views that the caustic maps of a scene's lights are made by.
pub fn views(scene: &Scene, splats: &Splats) -> Vec<Option<LightView>> {
    light_views(scene, splats).into_iter().map(|views| views.map).collect()
}

/// All views of each of a scene's lights; none without liquid.
///
/// They show the bulk of the liquid: a splash far off would leave a few texels for the rest. Where a
/// point light has splashes around it, and so no view of the bulk, the caustic map shows the core.
pub fn light_views(scene: &Scene, splats: &Splats) -> Vec<LightViews> {
    let settings = &scene.settings.caustics;
    let bulk = bulk(splats);
    let within = |part| around(splats, part);
    let boxes = bulk.and_then(|bulk| Some((within(bulk.bounds)?, within(bulk.core)?)));
    let Some((bounds, core)) = boxes else {
        return vec![LightViews::default(); scene.lights.len()];
    };
    let margin = f64::from(settings.margin);
    let level = level(splats, bounds).map(|height| (height, f64::from(scene.liquid.ior)));
    let views = |light| {
        let view = |seen, level| {
            LightView::new(light, seen, &scene.solids, margin, settings.resolution, level)
        };
        let map = view(bounds, level).or_else(|| view(core, level));
        let along = view(bounds, None);
        let straight = match (map, along) {
            (Some(map), Some(along)) if map.looks_as(&along) => Vec::new(),
            (_, Some(along)) => vec![Some(along)],
            // The faces share a layer, three by two.
            (_, None) => {
                let texels = settings.resolution / 3;
                let face = |face| LightView::face(light, face, bounds, texels);
                (0..CUBE).map(face).collect()
            }
        };
        // Only one that sees it all round may be in it.
        let wet = straight.len() == CUBE && is_wet(light, splats);
        LightViews { map, straight, wet }
    };
    scene.lights.iter().map(views).collect()
}

/// Gives each view its place in maps of so many texels along either side: a layer for the caustic map
/// and one for the straight views.
fn place(lights: &[LightViews], resolution: u32) -> Vec<PlacedView> {
    let mut placed = Vec::new();
    let mut layer = 0;
    for (light, views) in lights.iter().enumerate() {
        let straight = views.straight.len() as u32;
        if let Some(view) = views.map {
            let (slot, corner) = (0, UVec2::ZERO);
            placed.push(PlacedView { view, light, slot, straight, layer, corner, wet: false });
            layer += 1;
        }
        let before = placed.len();
        for (i, view) in (0..).zip(&views.straight) {
            let Some(view) = *view else { continue };
            let corner = UVec2::new(i % 3, i / 3) * (resolution / 3);
            let slot = 1 + i as usize;
            let wet = views.wet;
            placed.push(PlacedView { view, light, slot, straight, layer, corner, wet });
        }
        layer += u32::from(placed.len() > before);
    }
    placed
}

/// The settings by which a view's map is made: a straight view has no caustics.
fn settings_of(placed: &PlacedView, settings: &settings::Caustics) -> settings::Caustics {
    match placed.slot {
        0 => settings.clone(),
        _ => settings::Caustics { method: Method::Straight, blur: 0.0, ..settings.clone() },
    }
}

/// By how much ellipsoids are grown to leave no gaps within a liquid.
const CLOSED: f64 = 1.3;

/// Whether a light is in the liquid: in any of its ellipsoids.
fn is_wet(light: &Light, splats: &Splats) -> bool {
    let Light::Point { position, .. } = *light else { return false };
    let position = position - splats.origin;
    splats.aggregates.iter().any(|splat| {
        let offset = position - centre(splat);
        let near = offset.length() <= CLOSED * splat.longest();
        near && (splat.axes().inverse() * offset).length() <= CLOSED
    })
}

/// The box around the bulk of a frame's splats, m; none without any.
pub fn bounds(splats: &Splats) -> Option<(DVec3, DVec3)> {
    around(splats, bulk(splats)?.bounds)
}

/// The bulk of the splats' centres, counted from their origin.
fn bulk(splats: &Splats) -> Option<Bulk> {
    let bodies = splats.aggregates.len();
    let splat = |i: usize| splats.aggregates.get(i).unwrap_or_else(|| &splats.splashes[i - bodies]);
    bulk::bulk(bodies + splats.splashes.len(), |i| centre(splat(i)))
}

/// The box around the splats whose centres, counted from their origin, are in a box, m.
fn around(splats: &Splats, (least, greatest): (DVec3, DVec3)) -> Option<(DVec3, DVec3)> {
    let all = splats.aggregates.iter().chain(&splats.splashes);
    let within = |x: DVec3| least.cmple(x).all() && x.cmple(greatest).all();
    let all = all.filter(|splat| within(centre(splat)));
    let (min, max) = all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), splat| {
        let (centre, radius) = (centre(splat), f64::from(splat.radius));
        (min.min(centre - radius), max.max(centre + radius))
    });
    min.is_finite().then_some((splats.origin + min, splats.origin + max))
}

/// A splat's centre, counted from the splats' origin.
fn centre(splat: &Splat) -> DVec3 {
    Vec3::from_array(splat.centre).as_dvec3()
}

/// Columns along either side of the grid by which [`level`] judges.
const COLUMNS: usize = 24;

/// The height of the liquid's surface, m, if it is level: if it fills its box, and the tops of its
/// columns differ little over its breadth.
fn level(splats: &Splats, (min, max): (DVec3, DVec3)) -> Option<f64> {
    let breadth = (max - min).with_y(0.0);
    let mut tops = [f64::NEG_INFINITY; COLUMNS * COLUMNS];
    let within = |x: &DVec3| min.cmple(*x).all() && x.cmple(max).all();
    let centres = splats.aggregates.iter().map(|splat| splats.origin + centre(splat));
    for centre in centres.filter(within) {
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
