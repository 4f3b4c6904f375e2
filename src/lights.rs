//! The views of a frame's lights, and the caustic maps made from them.

use glam::{DVec3, UVec2, Vec3};
use rayon::prelude::*;

use crate::error::{Limited, Result};
use crate::gpu::{Commands, Gpu, Timer};
use crate::light_view::{CUBE, LightView, PlacedView};
use crate::liquid::bulk::{self, Bulk};
use crate::liquid::classify::{Splat, Splats};
use crate::passes::Layers;
use crate::passes::caustics::{
    CausticBuffers, CausticMap, Caustics, Inputs, MapConfig, Output, Params,
};
use crate::passes::gaps;
use crate::passes::mixture::Shares;
use crate::passes::scene_binding::LightMaps;
use crate::passes::smooth;
use crate::passes::tiles::Sections;
use crate::passes::view_passes::{FrameInputs, PassNames, PreparedView, ViewConfig, ViewPasses};
use crate::scene::{Light, Scene};
use crate::settings::{self, Method};

/// The views from one light.
#[derive(Debug, Clone, Default)]
pub struct LightViews {
    /// The view of the caustic map; `None` if the liquid subtends too wide an angle from the light.
    pub map: Option<LightView>,
    /// Views along the unrefracted light, which show where liquid crosses its path: empty if the map's
    /// view is along it too, otherwise one view or the faces of a cube, `None` for faces without liquid.
    pub straight: Vec<Option<LightView>>,
    /// Whether the light is a point inside the liquid.
    pub wet: bool,
}

/// The views and maps of a frame's lights; empty if nothing is lit.
#[derive(Debug, Default)]
pub struct Lights {
    /// Number of the scene's lights; 0 if nothing is lit.
    count: usize,
    views: Vec<PlacedView>,
    maps: Option<LightMaps>,
    /// Passes of each view, in the order of the views; kept for the next frame.
    passes: Vec<ViewPasses>,
    caustic_buffers: CausticBuffers,
}

/// A frame's passes of one of the views.
#[derive(Debug)]
pub struct PreparedLight {
    surfaces: PreparedView,
    caustics: Caustics,
}

impl Lights {
    /// Chooses the views, allocates the maps and compiles missing pipelines; returns the passes in the order of the views.
    ///
    /// # Errors
    /// [`Error::Limit`](crate::Error::Limit) for maps that the adapter cannot hold.
    pub fn prepare(&mut self, gpu: &Gpu, frame: FrameInputs<'_>) -> Result<Vec<PreparedLight>> {
        let FrameInputs { scene, splats, .. } = frame;
        let settings = &scene.settings.caustics;
        (self.count, self.views) = (0, Vec::new());
        if !scene.is_lit() && frame.shadows.is_none() {
            return Ok(Vec::new());
        }
        self.count = scene.lights.len();
        self.views = place(&light_views(scene, splats), settings.resolution);
        let Some(last) = self.views.last() else { return Ok(Vec::new()) };
        let size = UVec2::splat(settings.resolution);
        gpu.check_image(size, Limited::CausticMap)?;
        let layers = gpu.array_layers((last.layer + 1).max(self.count as u32));
        let fits_maps = |maps: &LightMaps| {
            maps.maps.width() == size.x && maps.maps.depth_or_array_layers() == layers
        };
        if !self.maps.as_ref().is_some_and(fits_maps) {
            let usage = wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC;
            let new = |label| gpu.texture(label, size, layers, Layers::FORMAT, usage);
            self.maps =
                Some(LightMaps { maps: new("caustic maps"), receivers: new("caustic receivers") });
        }

        let splash = splats.has_splashes();
        let mut prepared = Vec::new();
        for (i, placed) in self.views.iter().enumerate() {
            let view = &placed.view;
            let fits = |passes: &ViewPasses| passes.camera.is_orthographic() == view.orthographic;
            if !self.passes.get(i).is_some_and(fits) {
                self.passes.truncate(i);
                self.passes.push(ViewPasses::new(gpu, view.orthographic));
            }
            let map_settings = settings_of(placed, scene);
            let backs = map_settings.interfaces > 1;
            let gaps = gaps::count(&scene.settings.layers, map_settings.interfaces, splats);
            let size = view.size;
            let mixture = Shares::of_attenuation(scene).are_mixed() && !scene.is_opaque();
            let sections = Sections::for_work(gpu, size, smooth::work(&scene.settings.smooth));
            let gbuffer = true;
            let config = ViewConfig {
                size,
                splash,
                mixture,
                scattering: false,
                attenuates: true,
                gbuffer,
                host: false,
                levels: 1,
                backs,
                gaps,
                smooth: !frame.fits.is_empty() || gaps > 0,
                bounds: false,
                tags: false,
                sections,
            };
            let (before, passes) = self.passes.split_at_mut(i);
            let surfaces = &mut passes[0];
            // A view's layers are no longer needed when its map is drawn.
            match before.iter().find(|before| before.config() == config) {
                Some(before) => surfaces.share(before),
                None => surfaces.resize(gpu, config),
            }
            let uniform = view.uniform(splats.origin);
            surfaces.upload(gpu, frame, &uniform, view.origin, &[], None);
            let passes = surfaces.prepare(gpu, frame, &uniform, view.origin);
            let (camera, bound) = (&surfaces.camera, &surfaces.scene);
            let config = MapConfig { settings: &map_settings, splash, gaps, size };
            let kept = &mut self.caustic_buffers;
            let caustics = Caustics::prepare(gpu, camera, bound, scene, config, kept)?;
            prepared.push(PreparedLight { surfaces: passes, caustics });
        }
        let maps: Vec<_> = prepared.iter().map(|light| &light.caustics).collect();
        self.caustic_buffers.keep(&maps);
        Ok(prepared)
    }

    /// Records the views of each light, and its maps.
    pub fn record(
        &self,
        prepared: &[PreparedLight],
        commands: &mut Commands<'_>,
        frame: FrameInputs<'_>,
        timer: &mut Timer,
    ) {
        let FrameInputs { scene, splats, .. } = frame;
        for ((placed, surfaces), passes) in self.views.iter().zip(&self.passes).zip(prepared) {
            let Some(maps) = &self.maps else { return };
            surfaces.record(&passes.surfaces, commands, timer, PassNames::LIGHT);
            let map_settings = settings_of(placed, scene);
            let PlacedView { layer, corner, .. } = *placed;
            let light = &scene.lights[placed.light];
            let params = Params {
                wet: u32::from(placed.wet),
                corner: corner.to_array(),
                number: placed.light as u32,
                ..Params::new(light, &placed.view, &map_settings)
            };
            let params = match scene.is_opaque() {
                true => Params { power: [0.0; 3], ..params },
                false => params,
            };
            let inputs = Inputs {
                camera: &surfaces.camera,
                scene: &surfaces.scene,
                aggregate: surfaces.aggregate_layers(),
                splash: surfaces.splash_layers(),
                gbuffer: &surfaces.images.gbuffer,
                mixture: Some(&surfaces.images.mixture.view),
                params: &params,
            };
            let output = Output { map: &maps.maps, receivers: &maps.receivers, layer };
            let radius = splats.radius;
            let span = timer.span("caustics");
            passes.caustics.record(commands, scene, radius, inputs, output, span);
        }
    }

    /// The lights' views, with their places in the maps.
    pub fn views(&self) -> &[PlacedView] {
        &self.views
    }

    /// The maps; `None` if no light has a view.
    pub fn maps(&self) -> Option<&LightMaps> {
        self.maps.as_ref().filter(|_| !self.views.is_empty())
    }

    /// The caustic map of each light, with its view; `None` for lights without caustics.
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

    /// Indices of the lights without caustics, whose light is not refracted: those inside the liquid,
    /// and those from which it subtends more than 150 degrees.
    pub fn without_caustics(&self) -> Vec<usize> {
        let has_map = |light| self.views.iter().any(|view| view.light == light && view.slot == 0);
        (0..self.count).filter(|&light| !self.views.is_empty() && !has_map(light)).collect()
    }
}

/// The view of each light's caustic map, if it has one.
pub fn views(scene: &Scene, splats: &Splats) -> Vec<Option<LightView>> {
    light_views(scene, splats).into_iter().map(|views| views.map).collect()
}

/// All views of each light of a scene; empty without liquid.
///
/// The views frame the bulk of the liquid: a distant splash would leave few texels for the rest. For a
/// point light among splashes, which has no view of the bulk, the caustic map frames the core.
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
            (Some(map), Some(along)) if map.has_same_rays_as(&along) => Vec::new(),
            (_, Some(along)) => vec![Some(along)],
            // The faces share a layer, three by two.
            (_, None) => {
                let texels = settings.resolution / 3;
                let face = |face| LightView::face(light, face, bounds, texels);
                (0..CUBE).map(face).collect()
            }
        };
        // Only a light with liquid all around can be inside it.
        let wet = straight.len() == CUBE && is_wet(light, splats);
        LightViews { map, straight, wet }
    };
    scene.lights.iter().map(views).collect()
}

/// Assigns each view its place in maps of `resolution` texels a side: for each light, one layer for the
/// caustic map and one for the straight views.
fn place(lights: &[LightViews], resolution: u32) -> Vec<PlacedView> {
    let mut placed = Vec::new();
    let mut layer = 0;
    for (light, views) in lights.iter().enumerate() {
        let place = |view, slot, layer, corner| PlacedView {
            view,
            light,
            slot,
            straight: views.straight.len() as u32,
            layer,
            corner,
            wet: slot > 0 && views.wet,
            direct_only: slot > 0 && views.map.is_some(),
        };
        if let Some(view) = views.map {
            placed.push(place(view, 0, layer, UVec2::ZERO));
            layer += 1;
        }
        let before = placed.len();
        for (i, view) in (0..).zip(&views.straight) {
            let Some(view) = *view else { continue };
            let corner = UVec2::new(i % 3, i / 3) * (resolution / 3);
            placed.push(place(view, 1 + i as usize, layer, corner));
        }
        layer += u32::from(placed.len() > before);
    }
    placed
}

/// The settings for a view's map: a straight view has no caustics, and one that only judges direct light needs fronts
/// alone. No light passes through an opaque body.
fn settings_of(placed: &PlacedView, scene: &Scene) -> settings::Caustics {
    let settings = &scene.settings.caustics;
    let opaque = scene.is_opaque();
    let interfaces = if placed.direct_only || opaque { 1 } else { settings.interfaces };
    match placed.slot {
        0 if !opaque => settings.clone(),
        _ => settings::Caustics {
            method: Method::Straight,
            blur: 0.0,
            interfaces,
            ..settings.clone()
        },
    }
}

/// Scale at which the ellipsoids leave no gaps inside the liquid.
const CLOSING_SCALE: f64 = 1.3;

/// Whether a light is a point inside the liquid: inside any of its scaled ellipsoids.
fn is_wet(light: &Light, splats: &Splats) -> bool {
    let Light::Point { position, .. } = *light else { return false };
    let position = position - splats.origin;
    splats.aggregates.iter().any(|splat| {
        let offset = position - centre(splat);
        let near = offset.length() <= CLOSING_SCALE * splat.longest();
        near && (splat.axes().inverse() * offset).length() <= CLOSING_SCALE
    })
}

/// The bounding box of the bulk of a frame's splats, m; `None` without splats.
pub fn bounds(splats: &Splats) -> Option<(DVec3, DVec3)> {
    around(splats, bulk(splats)?.bounds)
}

/// The bulk of the splats' centres, relative to their origin.
fn bulk(splats: &Splats) -> Option<Bulk> {
    if let Some(device) = &splats.device {
        let bounds = device.bounds;
        return Some(Bulk { bounds, outside: 0, lost: None, core: bounds });
    }
    let bodies = splats.aggregates.len();
    let splat = |i: usize| splats.aggregates.get(i).unwrap_or_else(|| &splats.splashes[i - bodies]);
    let place = |i: usize| centre(splat(i));
    let count = bodies + splats.splashes.len();
    let Some((min, max)) = splats.bulk else { return bulk::bulk(count, place, |_| false) };
    let (min, max) = (min - splats.origin, max - splats.origin);
    // Refined splats have moved by less than their size.
    let counts = |&i: &usize| {
        let (x, reach) = (place(i), splat(i).longest());
        x.cmpge(min - reach).all() && x.cmple(max + reach).all()
    };
    let kept: Vec<usize> = (0..count).filter(counts).collect();
    bulk::bulk(kept.len(), |i| place(kept[i]), |_| false)
}

/// The bounding box, m, of the splats whose centres lie in a box relative to their origin.
fn around(splats: &Splats, (least, greatest): (DVec3, DVec3)) -> Option<(DVec3, DVec3)> {
    if let Some(device) = &splats.device {
        let (min, max) = device.bounds;
        let (min, max) = (min.max(least), max.min(greatest));
        return min.cmple(max).all().then_some((splats.origin + min, splats.origin + max));
    }
    let all = splats.aggregates.par_iter().chain(&splats.splashes);
    let within = |x: DVec3| least.cmple(x).all() && x.cmple(greatest).all();
    let all = all.filter(|splat| within(centre(splat)));
    let boxes = all.map(|splat| {
        let (centre, radius) = (centre(splat), f64::from(splat.radius));
        (centre - radius, centre + radius)
    });
    let none = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = boxes.reduce(none, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    min.is_finite().then_some((splats.origin + min, splats.origin + max))
}

/// A splat's centre, relative to the splats' origin.
fn centre(splat: &Splat) -> DVec3 {
    Vec3::from_array(splat.centre).as_dvec3()
}

/// Splats that a thread looks at together.
const PART: usize = 1 << 14;

/// Columns along each side of the grid that [`level`] uses.
const COLUMNS: usize = 24;

/// The height of the liquid's surface, m, if it is level: if the liquid fills its box, and the heights
/// of its columns differ little relative to its breadth.
fn level(splats: &Splats, (min, max): (DVec3, DVec3)) -> Option<f64> {
    let breadth = (max - min).with_y(0.0);
    let none = || [f64::NEG_INFINITY; COLUMNS * COLUMNS];
    let within = |x: &DVec3| min.cmple(*x).all() && x.cmple(max).all();
    // Of large parts: each has its tops.
    let parts = splats.aggregates.par_chunks(PART).map(|part| {
        let mut tops = none();
        let centres = part.iter().map(|splat| splats.origin + centre(splat));
        for centre in centres.filter(within) {
            let at =
                ((centre - min) / breadth.max(DVec3::splat(f64::MIN_POSITIVE))) * COLUMNS as f64;
            let column = |x: f64| (x as usize).min(COLUMNS - 1);
            let top = &mut tops[column(at.z) * COLUMNS + column(at.x)];
            *top = top.max(centre.y);
        }
        tops
    });
    let higher = |a: [f64; COLUMNS * COLUMNS], b: [f64; COLUMNS * COLUMNS]| {
        std::array::from_fn(|i| a[i].max(b[i]))
    };
    let tops = parts.reduce(none, higher);
    let mut tops: Vec<_> = tops.into_iter().filter(|top| top.is_finite()).collect();
    tops.sort_by(f64::total_cmp);
    let at = |share: f64| tops[((tops.len() - 1) as f64 * share) as usize];
    let filled = tops.len() as f64 >= FILLED * (COLUMNS * COLUMNS) as f64;
    let flat = filled && at(0.9) - at(0.1) <= FLAT * breadth.max_element();
    flat.then(|| at(0.5))
}

/// Least share of the columns that a level surface fills: a round vessel fills π/4.
const FILLED: f64 = 0.6;

/// Greatest height difference of a level surface, without its top and bottom tenths, over its breadth.
const FLAT: f64 = 0.1;
