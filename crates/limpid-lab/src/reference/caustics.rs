//! Caustics in f64: light traced from a light, through the liquid, to the solids.
//!
//! A [`CausticMap`] has the texels of a [`LightView`]. [`beams`] splits the light into narrow beams
//! and distributes each over the texels by the exact area of overlap, so that no light is lost and
//! folds of either orientation add; [`photons`] counts single rays and shares only their paths with
//! it. Both use the liquid itself; [`beams_over_layers`] uses only a light's layers of it.

mod charts;
mod laying;
mod paths;

use std::ops::AddAssign;

use glam::{DVec2, DVec3, IVec2, UVec2};
use rayon::prelude::*;

use self::laying::{Grid, Ledger, Receivers, Sum, Triangle, lay_beams, over_rows, together};
use self::paths::{Beam, LayerTracer, Tracer};
use super::layers::{self, Layer, Pair};
use super::solids::{Side, SolidHit};
use super::surroundings::Surroundings;
use super::{Liquid, wide};
use limpid::light_view::LightView;
use limpid::scene::{self, Light, Scene};

/// Irradiance by light that has passed through liquid, on the solids that a view shows: all that a
/// light sees, or one face of a solid.
#[derive(Debug, Clone, PartialEq)]
pub struct CausticMap {
    /// The view that the texels belong to.
    pub view: LightView,
    /// The face that it shows; `None` for everything in view.
    face: Option<Side>,
    /// Mean irradiance, W/m², on the part of the texel's receiver that the texel shows, by light
    /// that has passed through liquid; 0 without a receiver.
    pub irradiance: Vec<DVec3>,
    /// The surface hit by the view's ray through the texel's centre, ignoring liquid.
    pub receivers: Vec<Option<Receiver>>,
    /// Where the light went; for several faces, in total.
    pub flux: Flux,
}

/// The view of a map, and the face that it shows.
#[derive(Debug, Clone, Copy)]
struct Chart {
    view: LightView,
    face: Option<Side>,
}

/// The surface that a texel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// The point on the ray through the texel's centre.
    pub spot: Spot,
    /// Area of the surface that the texel covers, m².
    pub area: f64,
    /// Whether a neighbour shows another surface: then the texel may show parts of both.
    edge: bool,
}

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Index of the solid in the scene; 0 if unknown.
    pub solid: usize,
    /// The part of a mesh ([`SolidHit::part`]); 0 of other solids.
    pub part: u32,
    /// The point, m; in the light's view space for maps over layers, otherwise in world space.
    pub point: DVec3,
    /// Unit normal, on the side that the light comes from.
    pub normal: DVec3,
}

/// Balance of the light that hit liquid, W per channel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flux {
    /// Light that hit liquid.
    pub sent: DVec3,
    /// Of this, the light left where its path ended, after reflection at the interfaces and
    /// absorption: the sum of all below.
    pub transmitted: DVec3,
    /// Light on the map.
    pub received: DVec3,
    /// Light on solids that the map's view does not show.
    pub hidden: DVec3,
    /// Light on solids outside the map's frame.
    pub outside: DVec3,
    /// Light that hit no solid.
    pub missed: DVec3,
    /// Light totally reflected inside the liquid, which is not traced.
    pub reflected: DVec3,
    /// Light left in the liquid, which would have crossed more interfaces than are traced.
    pub liquid: DVec3,
}

impl AddAssign for Flux {
    fn add_assign(&mut self, other: Self) {
        self.sent += other.sent;
        self.transmitted += other.transmitted;
        self.received += other.received;
        self.hidden += other.hidden;
        self.outside += other.outside;
        self.missed += other.missed;
        self.reflected += other.reflected;
        self.liquid += other.liquid;
    }
}

/// Distance from a surface that counts as rounding, m and relative: layers hold 32 bits.
const OFF: f64 = 1e-5;

impl Spot {
    fn of(hit: &SolidHit, direction: DVec3) -> Self {
        let normal = hit.facing(direction);
        Self { solid: hit.solid, part: hit.part, point: hit.point, normal }
    }

    /// Whether two points lie on one smooth surface: their chord is perpendicular to the mean of
    /// the normals.
    fn continues(&self, other: &Self) -> bool {
        let chord = other.point - self.point;
        let off = chord.dot(0.5 * (self.normal + other.normal)).abs();
        self.solid == other.solid
            && self.normal.dot(other.normal) > 0.5
            && off <= 0.5 * chord.length() + OFF * (1.0 + self.point.abs().max_element())
    }
}

impl Chart {
    /// Everything in view.
    fn whole(view: &LightView) -> Self {
        Self { view: *view, face: None }
    }

    /// Whether it may show a point, inside or outside its frame.
    fn takes(&self, spot: &Spot) -> bool {
        self.face.is_none_or(|face| face.takes(spot.solid, spot.part, spot.normal))
    }
}

impl CausticMap {
    /// Whether a point lies on the surface that it shows, inside or outside its frame.
    pub fn takes(&self, spot: &Spot) -> bool {
        Chart { view: self.view, face: self.face }.takes(spot)
    }

    /// Irradiance at a point of a solid, W/m²: bilinear between the neighbouring texels that show
    /// the same surface.
    pub fn at(&self, spot: &Spot) -> DVec3 {
        let (u, depth) = self.view.project(spot.point);
        if depth <= self.view.near {
            return DVec3::ZERO;
        }
        let (corner, f) = ((u - 0.5).floor(), (u - 0.5).fract_gl());
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let Some(i) = index(self.view.size, corner.as_ivec2() + IVec2::new(dx, dy)) else {
                continue;
            };
            if self.receivers[i].is_some_and(|receiver| receiver.spot.continues(spot)) {
                let along = |axis: usize, d: i32| if d == 0 { 1.0 - f[axis] } else { f[axis] };
                let weight = along(0, dx) * along(1, dy);
                sum += weight * self.irradiance[i];
                weights += weight;
            }
        }
        if weights > 0.0 { sum / weights } else { DVec3::ZERO }
    }

    /// Relative L1 difference to the true map of the same view: Σ |a − b| / Σ b over texels and
    /// channels; 0 if both are dark.
    pub fn relative_l1(&self, truth: &Self) -> f64 {
        let pairs = self.irradiance.iter().zip(&truth.irradiance);
        let difference: f64 = pairs.map(|(a, b)| (a - b).abs().element_sum()).sum();
        let total: f64 = truth.irradiance.iter().map(|b| b.element_sum()).sum();
        if difference == 0.0 { 0.0 } else { difference / total }
    }
}

/// The views that light is traced from and deposited in.
#[derive(Debug, Clone, Copy)]
pub struct Views<'a> {
    /// The light's own view, which covers everything that may send light to the map.
    pub light: &'a LightView,
    /// The map's view, whose rays may differ from the light's.
    pub map: &'a LightView,
}

impl<'a> From<&'a LightView> for Views<'a> {
    fn from(view: &'a LightView) -> Self {
        Self { light: view, map: view }
    }
}

/// Computes the caustics of one light by beams: `density` of them per texel and axis of the light's
/// view.
///
/// With `interfaces` = 1 only light on solids inside the liquid counts; with 2 also light that has
/// left the liquid once. Light that enters liquid again, and totally reflected light, is not
/// traced.
pub fn beams<'a>(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    light: &Light,
    views: impl Into<Views<'a>>,
    interfaces: u32,
    density: u32,
) -> CausticMap {
    let views = views.into();
    let charts = [Chart::whole(views.map)];
    let maps = on_charts(liquid, scene, light, &[*views.light], &charts, interfaces, density);
    maps.into_iter().next().expect("a map for the chart")
}

/// Computes the caustics of one light on all lit solids, by [`beams`]: an orthogonal map for each
/// face that light through liquid falls on. No face occludes another, whatever the direction of
/// light. `texels` texels of a map span the longest side of the liquid's bounding box, from
/// `bounds.0` to `bounds.1`, m.
///
/// Rays start at the light wherever it is: from a point light in the liquid or next to it they go
/// in all directions. A face's map is fitted to nine tenths of its light: it omits the outermost
/// hundredth along each side, and light that falls further away than the width of the fitted part.
/// A mesh is shown by its parts: connected triangles whose normals are within 26° of one's. Solids are not
/// shown from within, but sheets from both sides.
pub fn on_solids(
    liquid: &(impl Liquid + ?Sized),
    bounds: (DVec3, DVec3),
    scene: &Scene,
    light: &Light,
    interfaces: u32,
    texels: u32,
    density: u32,
) -> Vec<CausticMap> {
    let pixel = (bounds.1 - bounds.0).max_element() / f64::from(texels);
    let sources = charts::sources(light, bounds, pixel);
    let charts = charts::of_solids(liquid, scene, &sources, interfaces, pixel, 2 * texels);
    on_charts(liquid, scene, light, &sources, &charts, interfaces, density)
}

/// Deposits the light from `sources` on charts.
fn on_charts(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    light: &Light,
    sources: &[LightView],
    charts: &[Chart],
    interfaces: u32,
    density: u32,
) -> Vec<CausticMap> {
    let surroundings = Surroundings::new(scene);
    let receivers: Vec<_> =
        charts.iter().map(|chart| Receivers::new(chart, &surroundings)).collect();
    let mut sum = Sum::new(&receivers);
    for source in sources {
        let tracer = Tracer::new(liquid, scene, source, charts, interfaces);
        let grid = Grid::corners(source, density);
        lay_beams(source, light, &receivers, grid, &mut sum, |u| tracer.follow(u));
    }
    sum.finish(receivers)
}

/// Runs [`beams`] at a density (at least 2) and at half of it: returns the finer map, and the
/// relative L1 difference between the two. Doubling the density quarters the error, so the
/// remaining error of the finer map is about a third of the difference.
pub fn beams_with_error<'a>(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    light: &Light,
    views: impl Into<Views<'a>>,
    interfaces: u32,
    density: u32,
) -> (CausticMap, f64) {
    let views = views.into();
    let map = |density| beams(liquid, scene, light, views, interfaces, density);
    let fine = map(density.max(2));
    let error = map(density.max(2) / 2).relative_l1(&fine);
    (fine, error)
}

/// Counts the paths of [`beams`] by which light reaches the centre of each texel of the map: the
/// triangles between rays that land on one surface and contain the centre.
pub fn path_counts<'a>(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    views: impl Into<Views<'a>>,
    interfaces: u32,
    density: u32,
) -> Vec<u32> {
    let views = views.into();
    let charts = [Chart::whole(views.map)];
    let tracer = Tracer::new(liquid, scene, views.light, &charts, interfaces);
    let receivers = Receivers::new(&charts[0], &tracer.surroundings);
    let grid = Grid::corners(views.light, density);
    let mut counts = vec![0; views.map.size.element_product() as usize];
    let covered_texels = |triangles: &mut dyn Iterator<Item = Triangle<'_>>| -> Vec<usize> {
        let landed = triangles.filter(|triangle| together(triangle.corners));
        landed.flat_map(|triangle| centres_in(&receivers, triangle.corners)).collect()
    };
    over_rows(
        grid,
        |u| tracer.follow(u),
        covered_texels,
        |rows| {
            for texel in rows.into_iter().flatten() {
                counts[texel] += 1;
            }
        },
    );
    counts
}

/// The texels whose centres lie in the triangle between three landings.
fn centres_in(receivers: &Receivers<'_>, corners: [&Beam; 3]) -> Vec<usize> {
    let [Some(a), Some(b), Some(c)] = corners.map(Beam::landing) else { return Vec::new() };
    let ([Some(u), Some(v), Some(w)], spot) = ([a, b, c].map(|l| l.u), a.spot) else {
        return Vec::new();
    };
    let low = (u.min(v).min(w) - 0.5).ceil().as_ivec2();
    let high = (u.max(v).max(w) - 0.5).floor().as_ivec2();
    let mut texels = Vec::new();
    for y in low.y..=high.y {
        for x in low.x..=high.x {
            let texel = IVec2::new(x, y);
            let p = texel.as_dvec2() + 0.5;
            let sides = [(u, v), (v, w), (w, u)].map(|(a, b)| (b - a).perp_dot(p - a) >= 0.0);
            if sides[0] == sides[1] && sides[1] == sides[2] {
                texels.extend(receivers.shows(texel, p, &spot));
            }
        }
    }
    texels
}

/// Number of rays that one thread traces at a time, and that all threads trace before they are
/// summed.
const CHUNK: u32 = 1 << 13;
const BATCH: u32 = 1 << 20;

/// Computes the caustics of one light by `count` single rays, counted where they land. Their
/// positions follow Roberts' sequence (The unreasonable effectiveness of quasirandom sequences,
/// 2018), offset by `seed`.
pub fn photons<'a>(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    light: &Light,
    views: impl Into<Views<'a>>,
    interfaces: u32,
    count: u32,
    seed: u64,
) -> CausticMap {
    let views = views.into();
    let charts = [Chart::whole(views.map)];
    let tracer = Tracer::new(liquid, scene, views.light, &charts, interfaces);
    let receivers = vec![Receivers::new(&charts[0], &tracer.surroundings)];
    let size = views.light.size.as_dvec2();
    let share = power(light) * (size.element_product() / f64::from(count));
    // The plastic number: the positive root of x³ = x + 1.
    let plastic = 1.324_717_957_244_746_f64;
    let steps = DVec2::new(plastic.recip(), plastic.powi(-2));
    let mut state = seed;
    let offset = DVec2::from_array([0; 2].map(|_| limpid_sim::rng::splitmix64(&mut state)));

    let mut sum = Sum::new(&receivers);
    for batch in (0..count).step_by(BATCH as usize) {
        let end = count.min(batch.saturating_add(BATCH));
        let chunks = (batch..end).into_par_iter().step_by(CHUNK as usize);
        let ledgers: Vec<_> = chunks
            .map(|start| {
                let mut ledger = Ledger::new(&receivers);
                for i in start..end.min(start.saturating_add(CHUNK)) {
                    let place = (offset + f64::from(i) * steps).fract_gl() * size;
                    let beam = tracer.follow(place);
                    let sent = share * views.light.pixel_extent(place);
                    if let Some((landing, power)) = ledger.account(&beam, sent) {
                        ledger.lay_point(landing, power);
                    }
                }
                ledger
            })
            .collect();
        sum.add(ledgers);
    }
    sum.finish(receivers).into_iter().next().expect("a map for the chart")
}

/// Computes the caustics of one light by beams over the layers of its view: the best possible
/// result for a method that knows only these layers of the liquid.
///
/// `classes` are pairs of front and back layers, `solids` the planes of the solids, all in the
/// light's view, which is along its rays. Light enters at the nearest front, D(u) = π·ω(u), and is
/// then intersected with every texel that it crosses. Beams start at texel centres, or evenly
/// around them, where a texel's plane applies; half a beam along the frame is left out. The
/// liquid's normals are bilinear between texel centres. Light stays in the liquid if it would leave
/// it within `contact`, m, of the plane of the solid that it is heading for.
pub fn beams_over_layers(
    view: &LightView,
    (classes, solids): (&[&Pair], &Layer),
    light: &Light,
    liquid: &scene::Liquid,
    contact: f64,
    interfaces: u32,
    density: u32,
) -> CausticMap {
    let tracer = LayerTracer {
        view: layers::ViewSpace::of_light(view),
        classes,
        solids,
        ior: liquid.ior.into(),
        absorption: wide(liquid.absorption),
        contact,
        interfaces,
    };
    let receivers = vec![Receivers::of_planes(view, &tracer.view, solids)];
    let mut sum = Sum::new(&receivers);
    let grid = Grid::centres(view, density);
    lay_beams(view, light, &receivers, grid, &mut sum, |u| tracer.follow(u));
    sum.finish(receivers).into_iter().next().expect("a map for the view")
}

/// Irradiance of a sun, W/m², or intensity of a point light, W/sr.
fn power(light: &Light) -> DVec3 {
    match *light {
        Light::Sun { irradiance, .. } => wide(irradiance),
        Light::Point { intensity, .. } => wide(intensity),
    }
}

/// Index of a texel in a map's rows; `None` outside.
fn index(size: UVec2, texel: IVec2) -> Option<usize> {
    let inside = texel.cmpge(IVec2::ZERO).all() && texel.cmplt(size.as_ivec2()).all();
    inside.then(|| texel.y as usize * size.x as usize + texel.x as usize)
}
