//! Caustics in f64: light followed from a light, through the liquid, to the solids.
//!
//! A [`CausticMap`] has the texels of a [`LightView`]. [`beams`] splits the light into narrow beams
//! and lays each on the texels by the exact area of their overlap, so that no light is lost and
//! folds of either sign add; [`photons`] counts single rays and shares only their paths with it.
//! Both know the liquid itself; [`beams_over_layers`] knows only what a light's layers show of it.

use std::ops::AddAssign;

use glam::{DVec2, DVec3, IVec2, UVec2};
use rayon::prelude::*;

use super::layers::{self, Layer, Pair};
use super::optics::{Interface, transmittance};
use super::surroundings::{SolidHit, Surroundings};
use super::trace::{TOUCH, interface};
use super::{Crossing, Liquid, Ray, wide};
use crate::light_view::LightView;
use crate::scene::{self, Light, Scene};

/// Light that has passed through liquid, where it falls on what a light sees of the solids.
#[derive(Debug, Clone, PartialEq)]
pub struct CausticMap {
    /// The light's view, whose texels these are.
    pub view: LightView,
    /// Mean irradiance, W/m², on the part of the texel's receiver that the light sees through the
    /// texel, by light that has passed through liquid; 0 where there is no receiver.
    pub irradiance: Vec<DVec3>,
    /// What the view's ray through the texel's centre meets, liquid ignored.
    pub receivers: Vec<Option<Receiver>>,
    /// Where the light went.
    pub flux: Flux,
}

/// What a texel shows of the solids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// The point on the ray through the texel's centre.
    pub spot: Spot,
    /// Area of the surface that the texel shows, m².
    pub area: f64,
    /// Whether a neighbour shows another surface: then this texel may show parts of both.
    edge: bool,
}

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Number of the solid in the scene; 0 where that is not known.
    pub solid: usize,
    /// The point, m; of maps over layers, in the light's view space, else in the world.
    pub point: DVec3,
    /// Unit normal, towards where the light comes from.
    pub normal: DVec3,
}

/// What became of the light that met liquid, W per channel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flux {
    /// What met liquid.
    pub sent: DVec3,
    /// What was left of it, after reflection at the interfaces and absorption, where its path
    /// ended: the sum of all below.
    pub transmitted: DVec3,
    /// What the map shows.
    pub received: DVec3,
    /// What fell on solids that the map's view does not show.
    pub hidden: DVec3,
    /// What fell on solids outside the map's frame.
    pub outside: DVec3,
    /// What met no solid.
    pub missed: DVec3,
    /// What was totally reflected inside the liquid, where it is not followed.
    pub reflected: DVec3,
    /// What was left in the liquid: it would have passed through more interfaces than are
    /// followed.
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

/// How far, m and relative, a point may be off a surface by rounding: layers hold 32 bits.
const OFF: f64 = 1e-5;

impl Spot {
    fn of(hit: &SolidHit, direction: DVec3) -> Self {
        Self { solid: hit.solid, point: hit.point, normal: hit.facing(direction) }
    }

    /// Whether two points are of one smooth surface: their chord is across the mean of the normals.
    fn continues(&self, other: &Self) -> bool {
        let chord = other.point - self.point;
        let off = chord.dot(0.5 * (self.normal + other.normal)).abs();
        self.solid == other.solid
            && self.normal.dot(other.normal) > 0.5
            && off <= 0.5 * chord.length() + OFF * (1.0 + self.point.abs().max_element())
    }
}

impl CausticMap {
    /// Irradiance at a point of a solid, W/m²: bilinear among the texels around it that show the
    /// same surface.
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

    /// The relative L1 difference to another map of the same view, which is taken for the truth:
    /// Σ |a − b| / Σ b over texels and channels; 0 if both are dark.
    pub fn relative_l1(&self, truth: &Self) -> f64 {
        let pairs = self.irradiance.iter().zip(&truth.irradiance);
        let difference: f64 = pairs.map(|(a, b)| (a - b).abs().element_sum()).sum();
        let total: f64 = truth.irradiance.iter().map(|b| b.element_sum()).sum();
        if difference == 0.0 { 0.0 } else { difference / total }
    }
}

/// Where light comes from, and where it is laid.
#[derive(Debug, Clone, Copy)]
pub struct Views<'a> {
    /// What the light sees along its own rays: all that may send light to the map.
    pub light: &'a LightView,
    /// The map's view. It may look along other rays than the light's.
    pub map: &'a LightView,
}

impl<'a> From<&'a LightView> for Views<'a> {
    fn from(view: &'a LightView) -> Self {
        Self { light: view, map: view }
    }
}

/// The caustics of one light by beams: `density` of them per texel and axis of the light's view.
///
/// With `interfaces` = 1 light counts that falls on solids inside the liquid; with 2 also light
/// that has left the liquid once. Light that meets liquid again, and light that is totally
/// reflected, is not followed.
pub fn beams<'a>(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    light: &Light,
    views: impl Into<Views<'a>>,
    interfaces: u32,
    density: u32,
) -> CausticMap {
    let views = views.into();
    let tracer = Tracer::new(liquid, scene, views, interfaces);
    let receivers = Receivers::new(views.map, &tracer.surroundings);
    let grid = Grid::corners(views.light, density);
    lay_beams(views.light, light, &receivers, grid, |u| tracer.follow(u))
}

/// [`beams`] at a density (at least 2) and at half of it: the finer map, and the relative L1
/// difference between the two. Twice the density has a quarter of the error, so what is left of it
/// in the finer map is about a third of the difference.
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

/// By how many paths of [`beams`] light comes to the centre of each texel of the map: of its
/// triangles between rays that land together, those that hold it.
pub fn path_counts<'a>(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    views: impl Into<Views<'a>>,
    interfaces: u32,
    density: u32,
) -> Vec<u32> {
    let views = views.into();
    let tracer = Tracer::new(liquid, scene, views, interfaces);
    let receivers = Receivers::new(views.map, &tracer.surroundings);
    let grid = Grid::corners(views.light, density);
    let row = |j: u32| -> Vec<Beam> {
        (0..=grid.cells.x).map(|i| tracer.follow(grid.at(i, j))).collect()
    };
    let mut counts = vec![0; views.map.size.element_product() as usize];
    let mut upper = row(0);
    for band in (0..grid.cells.y).step_by(BAND as usize) {
        let end = grid.cells.y.min(band + BAND);
        let mut rows = vec![upper];
        rows.par_extend((band + 1..=end).into_par_iter().map(row));
        let held = rows.par_windows(2).map(|pair| {
            let mut texels = Vec::new();
            for (above, below) in pair[0].windows(2).zip(pair[1].windows(2)) {
                let first = [&above[0], &above[1], &below[0]];
                let second = [&below[1], &below[0], &above[1]];
                for corners in [first, second].into_iter().filter(|&corners| together(corners)) {
                    texels.extend(centres_in(&receivers, corners));
                }
            }
            texels
        });
        for texel in held.collect::<Vec<_>>().into_iter().flatten() {
            counts[texel] += 1;
        }
        upper = rows.pop().unwrap_or_default();
    }
    counts
}

/// The texels whose centres the light between three rays falls on.
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

/// Rays that one thread follows at a time, and all threads before they are summed.
const CHUNK: u32 = 1 << 13;
const BATCH: u32 = 1 << 20;

/// The caustics of one light by `count` single rays, counted where they land. Their places are
/// those of Roberts' sequence (The unreasonable effectiveness of quasirandom sequences, 2018),
/// turned by `seed`.
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
    let tracer = Tracer::new(liquid, scene, views, interfaces);
    let receivers = Receivers::new(views.map, &tracer.surroundings);
    let size = views.light.size.as_dvec2();
    let share = power(light) * (size.element_product() / f64::from(count));
    // The plastic number: the positive root of x³ = x + 1.
    let plastic = 1.324_717_957_244_746_f64;
    let steps = DVec2::new(plastic.recip(), plastic.powi(-2));
    let mut state = seed;
    let turn = DVec2::from_array([0; 2].map(|_| crate::waves::splitmix64(&mut state)));

    let mut sum = Sum::new(views.map);
    for batch in (0..count).step_by(BATCH as usize) {
        let end = count.min(batch.saturating_add(BATCH));
        let chunks = (batch..end).into_par_iter().step_by(CHUNK as usize);
        let ledgers: Vec<_> = chunks
            .map(|start| {
                let mut ledger = Ledger::new(&receivers);
                for i in start..end.min(start.saturating_add(CHUNK)) {
                    let place = (turn + f64::from(i) * steps).fract_gl() * size;
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
    sum.finish(&receivers)
}

/// The caustics of one light by beams over what its view shows: the truth for whoever knows no more
/// of the liquid than these layers.
///
/// `classes` are pairs of front and back layers, `solids` the planes of the solids, all in the
/// light's view, which is along its rays. Light enters at the nearest front, D(u) = π·ω(u), and is
/// then intersected with every texel that it crosses. Beams start at texels' centres, or evenly
/// around them, where a texel's plane is its own; half a beam along the frame is left out. The
/// liquid's normals are bilinear between the texels' centres. It stays in the liquid where it would
/// leave that within `contact`, m, of the plane of a solid that it is heading for.
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
        view: layers::View::of_light(view),
        classes,
        solids,
        ior: liquid.ior.into(),
        absorption: wide(liquid.absorption),
        contact,
        interfaces,
    };
    let receivers = Receivers::of_planes(view, &tracer.view, solids);
    lay_beams(view, light, &receivers, Grid::centres(view, density), |u| tracer.follow(u))
}

/// W/m² of a sun, W/sr of a point.
fn power(light: &Light) -> DVec3 {
    match *light {
        Light::Sun { irradiance, .. } => wide(irradiance),
        Light::Point { intensity, .. } => wide(intensity),
    }
}

/// Where a texel is in a map's rows.
fn index(size: UVec2, texel: IVec2) -> Option<usize> {
    let inside = texel.cmpge(IVec2::ZERO).all() && texel.cmplt(size.as_ivec2()).all();
    inside.then(|| texel.y as usize * size.x as usize + texel.x as usize)
}

// Paths.

/// What became of a ray of light.
#[derive(Debug, Clone, Copy)]
struct Beam {
    end: End,
    /// The share of its light that came to the end.
    transmittance: DVec3,
    /// Where it entered the liquid and where it left.
    interfaces: [Option<Spot>; 2],
}

#[derive(Debug, Clone, Copy)]
enum End {
    /// It met no liquid.
    Dry,
    Landed(Landing),
    Missed,
    Reflected,
    Liquid,
}

#[derive(Debug, Clone, Copy)]
struct Landing {
    spot: Spot,
    /// Pixel position in the light's view; none behind it.
    u: Option<DVec2>,
}

impl Beam {
    fn new() -> Self {
        Self { end: End::Dry, transmittance: DVec3::ONE, interfaces: [None; 2] }
    }

    fn ending(mut self, end: End) -> Self {
        self.end = end;
        self
    }

    /// Goes through an interface: the direction beyond.
    fn refract(&mut self, spot: Spot, interface: &Interface) -> Option<DVec3> {
        self.interfaces[usize::from(self.interfaces[0].is_some())] = Some(spot);
        if interface.refracted.is_some() {
            self.transmittance *= 1.0 - interface.reflectance;
        }
        interface.refracted
    }

    fn landing(&self) -> Option<Landing> {
        match self.end {
            End::Landed(landing) => Some(landing),
            _ => None,
        }
    }
}

/// Rays through a liquid.
struct Tracer<'a, L: ?Sized> {
    liquid: &'a L,
    surroundings: Surroundings,
    views: Views<'a>,
    ior: f64,
    /// 1/m.
    absorption: DVec3,
    interfaces: u32,
}

enum Ahead {
    Solid(SolidHit),
    Surface(Crossing),
    Nothing,
}

impl<'a, L: Liquid + ?Sized> Tracer<'a, L> {
    fn new(liquid: &'a L, scene: &Scene, views: Views<'a>, interfaces: u32) -> Self {
        Self {
            liquid,
            surroundings: Surroundings::new(scene),
            views,
            ior: scene.liquid.ior.into(),
            absorption: wide(scene.liquid.absorption),
            interfaces,
        }
    }

    fn follow(&self, u: DVec2) -> Beam {
        let mut beam = Beam::new();
        let (origin, direction) = self.views.light.ray(u);
        let ray = Ray { origin, direction };
        let Ahead::Surface(entry) = self.ahead(&ray, false) else { return beam };
        let Some(ray) = self.pass(&mut beam, &ray, &entry, false) else {
            return beam.ending(End::Reflected);
        };
        let exit = match self.ahead(&ray, true) {
            Ahead::Solid(hit) => {
                beam.transmittance *= transmittance(self.absorption, hit.t);
                return self.land(beam, &hit, &ray);
            }
            Ahead::Surface(exit) if self.interfaces >= 2 => exit,
            _ => return beam.ending(End::Liquid),
        };
        beam.transmittance *= transmittance(self.absorption, exit.t);
        let Some(ray) = self.pass(&mut beam, &ray, &exit, true) else {
            return beam.ending(End::Reflected);
        };
        match self.ahead(&ray, false) {
            Ahead::Solid(hit) => self.land(beam, &hit, &ray),
            Ahead::Surface(_) => beam.ending(End::Liquid),
            Ahead::Nothing => beam.ending(End::Missed),
        }
    }

    fn ahead(&self, ray: &Ray, inside: bool) -> Ahead {
        let crossing = self.liquid.crossing(ray, inside);
        if let Some(hit) = self.surroundings.hit(ray)
            && crossing.as_ref().is_none_or(|c| hit.t <= c.t + TOUCH * (1.0 + c.t))
        {
            return Ahead::Solid(hit);
        }
        crossing.map_or(Ahead::Nothing, Ahead::Surface)
    }

    fn pass(&self, beam: &mut Beam, ray: &Ray, crossing: &Crossing, inside: bool) -> Option<Ray> {
        let origin = ray.at(crossing.t);
        let spot = Spot { solid: 0, point: origin, normal: crossing.shading };
        let eta = if inside { 1.0 / self.ior } else { self.ior };
        let direction = beam.refract(spot, &interface(ray, crossing, inside, eta))?;
        Some(Ray { origin, direction })
    }

    fn land(&self, beam: Beam, hit: &SolidHit, ray: &Ray) -> Beam {
        let (u, depth) = self.views.map.project(hit.point);
        let u = (depth > self.views.map.near).then_some(u);
        beam.ending(End::Landed(Landing { spot: Spot::of(hit, ray.direction), u }))
    }
}

/// Rays through layers, in view space.
struct LayerTracer<'a> {
    view: layers::View,
    classes: &'a [&'a Pair],
    solids: &'a Layer,
    ior: f64,
    /// 1/m.
    absorption: DVec3,
    contact: f64,
    interfaces: u32,
}

impl LayerTracer<'_> {
    fn follow(&self, u: DVec2) -> Beam {
        let mut beam = Beam::new();
        let view = &self.view;
        // The frame's last row and column of beams are on its border.
        let texel = u.min(view.size - 0.5).floor().as_ivec2();
        let omega = view.omega(u);
        let disparity = |plane: DVec3| plane.dot(omega);
        let fronts = self.classes.iter().map(|[front, _]| (front, front.at(texel)));
        let nearest = fronts.max_by(|a, b| disparity(a.1).total_cmp(&disparity(b.1)));
        let Some((layer, front)) = nearest else { return beam };
        if disparity(front) <= disparity(self.solids.at(texel)).max(0.0) {
            return beam;
        }
        let (_, direction) = view.ray(u);
        let point = view.point(u, disparity(front));
        let normal =
            self.smooth_normal(layer, u, &Spot { solid: 0, point, normal: view.normal(front) });
        let spot = Spot { solid: 0, point, normal: -normal };
        let entry = Interface::new(direction, facing(spot.normal, direction), self.ior);
        let Some(direction) = beam.refract(spot, &entry) else {
            return beam.ending(End::Reflected);
        };
        let solid = layers::entry(view, self.solids, point, direction, texel);
        let exit = layers::exit(view, self.classes, point, direction, texel);
        let exit = exit.map(|hit| {
            let point = view.point_at_depth(hit.u, hit.depth);
            let spot = Spot { solid: 0, point, normal: view.normal(hit.plane) };
            let texel = hit.u.floor().as_ivec2();
            let layer =
                self.classes.iter().copied().flatten().find(|layer| layer.at(texel) == hit.plane);
            let normal = layer.map_or(spot.normal, |layer| self.smooth_normal(layer, hit.u, &spot));
            // Out of the liquid, as the ray is.
            (hit, Spot { normal: -facing(normal, direction), ..spot })
        });
        if let Some(hit) = solid {
            let landing = self.landing(&hit, direction);
            let length = landing.spot.point.distance(point);
            let wet = exit.as_ref().is_none_or(|(_, exit)| {
                let off = (landing.spot.point - exit.point).dot(landing.spot.normal).abs();
                length <= exit.point.distance(point) || off <= self.contact
            });
            if wet {
                beam.transmittance *= transmittance(self.absorption, length);
                return beam.ending(End::Landed(landing));
            }
        }
        let Some((hit, exit)) = exit.filter(|_| self.interfaces >= 2) else {
            return beam.ending(End::Liquid);
        };
        beam.transmittance *= transmittance(self.absorption, exit.point.distance(point));
        let leaving = Interface::new(direction, facing(exit.normal, direction), 1.0 / self.ior);
        let Some(direction) = beam.refract(exit, &leaving) else {
            return beam.ending(End::Reflected);
        };
        let texel = hit.u.floor().as_ivec2();
        let distance =
            |hit: &layers::LayerHit| view.point_at_depth(hit.u, hit.depth).distance(exit.point);
        let again = self.classes.iter().filter_map(|[front, _]| {
            layers::entry(view, front, exit.point, direction, texel).map(|hit| distance(&hit))
        });
        let again = again.filter(|&t| t > OFF).fold(f64::INFINITY, f64::min);
        match layers::entry(view, self.solids, exit.point, direction, texel) {
            Some(hit) if distance(&hit) <= again => {
                beam.ending(End::Landed(self.landing(&hit, direction)))
            }
            _ if again < f64::INFINITY => beam.ending(End::Liquid),
            _ => beam.ending(End::Missed),
        }
    }

    /// The normal, away from the light, of a layer around a point on it: bilinear between the
    /// texels' centres. With the texels' own normals light would go through each texel unfocused,
    /// and all focusing would be at their borders.
    fn smooth_normal(&self, layer: &Layer, u: DVec2, spot: &Spot) -> DVec3 {
        let (corner, f) = ((u - 0.5).floor(), (u - 0.5).fract_gl());
        let mut sum = DVec3::ZERO;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let texel = corner.as_ivec2() + IVec2::new(dx, dy);
            let plane = layer.at(texel);
            let centre = texel.as_dvec2() + 0.5;
            let disparity = plane.dot(self.view.omega(centre));
            if disparity <= 0.0 {
                continue;
            }
            let point = self.view.point(centre, disparity);
            let other = Spot { solid: 0, point, normal: self.view.normal(plane) };
            if other.continues(spot) {
                let along = |axis: usize, d: i32| if d == 0 { 1.0 - f[axis] } else { f[axis] };
                sum += along(0, dx) * along(1, dy) * other.normal;
            }
        }
        sum.normalize_or(spot.normal)
    }

    fn landing(&self, hit: &layers::LayerHit, direction: DVec3) -> Landing {
        let point = self.view.point_at_depth(hit.u, hit.depth);
        let normal = facing(self.view.normal(hit.plane), direction);
        Landing { spot: Spot { solid: 0, point, normal }, u: Some(hit.u) }
    }
}

/// A normal turned against a direction.
fn facing(normal: DVec3, direction: DVec3) -> DVec3 {
    if direction.dot(normal) > 0.0 { -normal } else { normal }
}

// Where light falls.

/// What the texels of a light's view show, and for those at edges the solids themselves.
struct Receivers<'a> {
    view: &'a LightView,
    texels: Vec<Option<Receiver>>,
    surroundings: Option<&'a Surroundings>,
}

/// Points in a texel at an edge by which its parts are told.
const EDGE_SAMPLES: u32 = 256;

impl<'a> Receivers<'a> {
    fn new(view: &'a LightView, surroundings: &'a Surroundings) -> Self {
        let size = view.size;
        let width = size.x as usize;
        let texel = |i: usize| IVec2::new((i % width) as i32, (i / width) as i32);
        let spots: Vec<_> = (0..width * size.y as usize)
            .into_par_iter()
            .map(|i| seen(view, surroundings, texel(i).as_dvec2() + 0.5))
            .collect();
        let edge = |i: usize, spot: &Spot| {
            (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| IVec2::new(dx, dy))).any(|d| {
                let same = |j: usize| spots[j].is_some_and(|other| other.continues(spot));
                index(size, texel(i) + d).is_some_and(|j| !same(j))
            })
        };
        let receiver = |i: usize| {
            let spot = spots[i]?;
            let edge = edge(i, &spot);
            let corner = texel(i).as_dvec2();
            let area = patch_area(view, corner + 0.5, spot.point, spot.normal);
            let seen_at = |u: DVec2| seen(view, surroundings, u);
            let shown = |k: &u32| {
                // Hammersley's points.
                let n = f64::from(EDGE_SAMPLES);
                let reversed = f64::from(k.reverse_bits()) / 2f64.powi(32);
                let u = corner + DVec2::new((f64::from(*k) + 0.5) / n, reversed);
                seen_at(u).is_some_and(|other| other.continues(&spot))
            };
            let share = if edge {
                let count = (0..EDGE_SAMPLES).filter(shown).count().max(1);
                count as f64 / f64::from(EDGE_SAMPLES)
            } else {
                1.0
            };
            Some(Receiver { spot, area: share * area, edge })
        };
        let texels = (0..spots.len()).into_par_iter().map(receiver).collect();
        Self { view, texels, surroundings: Some(surroundings) }
    }

    fn of_planes(light: &'a LightView, view: &layers::View, planes: &Layer) -> Self {
        let width = light.size.x;
        let receiver = |i: u32| {
            let texel = UVec2::new(i % width, i / width);
            let u = texel.as_dvec2() + 0.5;
            let plane = planes.at(texel.as_ivec2());
            let disparity = plane.dot(view.omega(u));
            (disparity > 0.0).then(|| {
                let (_, direction) = view.ray(u);
                let point = view.point(u, disparity);
                let normal = facing(view.normal(plane), direction);
                let cos = -direction.dot(normal);
                let distance2 = if light.orthographic { 1.0 } else { point.length_squared() };
                let area = light.pixel_extent(u) * distance2 / cos;
                Receiver { spot: Spot { solid: 0, point, normal }, area, edge: false }
            })
        };
        let texels = (0..light.size.element_product()).into_par_iter().map(receiver).collect();
        Self { view: light, texels, surroundings: None }
    }

    /// The texel's number, if at `u` it shows the surface on which something landed.
    fn shows(&self, texel: IVec2, u: DVec2, spot: &Spot) -> Option<usize> {
        let i = index(self.view.size, texel)?;
        let receiver = self.texels[i]?;
        let there = match self.surroundings.filter(|_| receiver.edge) {
            Some(surroundings) => seen(self.view, surroundings, u)?.continues(spot),
            None => true,
        };
        (there && receiver.spot.continues(spot)).then_some(i)
    }
}

/// What the light sees straight through a pixel position.
fn seen(view: &LightView, surroundings: &Surroundings, u: DVec2) -> Option<Spot> {
    let (origin, direction) = view.ray(u);
    let hit = surroundings.hit(&Ray { origin, direction })?;
    Some(Spot::of(&hit, direction))
}

/// Area of the surface through a point that one pixel shows, m².
fn patch_area(view: &LightView, u: DVec2, point: DVec3, normal: DVec3) -> f64 {
    let (origin, direction) = view.ray(u);
    let distance2 = if view.orthographic { 1.0 } else { origin.distance_squared(point) };
    view.pixel_extent(u) * distance2 / -direction.dot(normal)
}

/// Rows of cells that are laid at once.
const BAND: u32 = 32;

/// The rays between which light is laid, in pixels.
#[derive(Clone, Copy)]
struct Grid {
    first: DVec2,
    cell: f64,
    cells: UVec2,
}

impl Grid {
    /// From border to border of the frame.
    fn corners(view: &LightView, density: u32) -> Self {
        let density = density.max(1);
        Self { first: DVec2::ZERO, cell: 1.0 / f64::from(density), cells: density * view.size }
    }

    /// In the middle of each beam: at density 1 in the texels' centres.
    fn centres(view: &LightView, density: u32) -> Self {
        let Self { cell, cells, .. } = Self::corners(view, density);
        Self { first: DVec2::splat(0.5 * cell), cell, cells: cells - 1 }
    }

    fn at(&self, i: u32, j: u32) -> DVec2 {
        self.first + self.cell * UVec2::new(i, j).as_dvec2()
    }
}

fn lay_beams(
    source: &LightView,
    light: &Light,
    receivers: &Receivers<'_>,
    grid: Grid,
    follow: impl Fn(DVec2) -> Beam + Sync,
) -> CausticMap {
    let Grid { cell, cells, .. } = grid;
    let power = power(light);
    let row = |j: u32| -> Vec<Beam> { (0..=cells.x).map(|i| follow(grid.at(i, j))).collect() };
    let mut sum = Sum::new(receivers.view);
    let mut last = row(0);
    for band in (0..cells.y).step_by(BAND as usize) {
        let end = cells.y.min(band + BAND);
        let mut rows = vec![last];
        rows.par_extend((band + 1..=end).into_par_iter().map(row));
        let ledgers: Vec<_> = (band..end)
            .into_par_iter()
            .map(|j| {
                let mut ledger = Ledger::new(receivers);
                let [upper, lower] = [0, 1].map(|k| &rows[(j - band + k) as usize]);
                for i in 0..cells.x {
                    let at = |k: u32| (i + k) as usize;
                    let corner = grid.at(i, j);
                    let first = [&upper[at(0)], &upper[at(1)], &lower[at(0)]];
                    let second = [&lower[at(1)], &lower[at(0)], &upper[at(1)]];
                    for (corners, third) in [(first, 1.0 / 3.0), (second, 2.0 / 3.0)] {
                        let middle = corner + third * cell;
                        let sent = power * (0.5 * cell * cell * source.pixel_extent(middle));
                        ledger.lay_triangle(corners, sent, cell);
                    }
                }
                ledger
            })
            .collect();
        sum.add(ledgers);
        last = rows.pop().unwrap_or_default();
    }
    sum.finish(receivers)
}

/// Power on each texel.
struct Sum {
    power: Vec<DVec3>,
    flux: Flux,
}

impl Sum {
    fn new(view: &LightView) -> Self {
        let texels = view.size.element_product() as usize;
        Self { power: vec![DVec3::ZERO; texels], flux: Flux::default() }
    }

    /// In order, so that the same numbers come of any number of threads.
    fn add(&mut self, ledgers: Vec<Ledger<'_>>) {
        for ledger in ledgers {
            self.flux += ledger.flux;
            for (texel, power) in ledger.deposits {
                self.power[texel as usize] += power;
            }
        }
    }

    fn finish(self, receivers: &Receivers<'_>) -> CausticMap {
        let irradiance = self.power.iter().zip(&receivers.texels);
        let irradiance =
            irradiance.map(|(&power, receiver)| receiver.map_or(DVec3::ZERO, |r| power / r.area));
        CausticMap {
            view: *receivers.view,
            irradiance: irradiance.collect(),
            receivers: receivers.texels.clone(),
            flux: self.flux,
        }
    }
}

/// What some of the light brought to which texel.
struct Ledger<'a> {
    receivers: &'a Receivers<'a>,
    deposits: Vec<(u32, DVec3)>,
    flux: Flux,
}

impl<'a> Ledger<'a> {
    fn new(receivers: &'a Receivers<'a>) -> Self {
        Self { receivers, deposits: Vec::new(), flux: Flux::default() }
    }

    /// Books a ray that carries some power; the power that is still to be laid where it landed.
    fn account(&mut self, beam: &Beam, sent: DVec3) -> Option<(Landing, DVec3)> {
        let left = beam.transmittance * sent;
        match beam.end {
            End::Dry => return None,
            End::Landed(_) => {}
            End::Missed => self.flux.missed += left,
            End::Reflected => self.flux.reflected += left,
            End::Liquid => self.flux.liquid += left,
        }
        self.flux.sent += sent;
        self.flux.transmitted += left;
        beam.landing().map(|landing| (landing, left))
    }

    /// Lays the light between three rays, `cell` apart, on the triangle between their landings; if
    /// these do not belong together, each ray's third around its own.
    fn lay_triangle(&mut self, corners: [&Beam; 3], sent: DVec3, cell: f64) {
        let thirds = corners.map(|beam| self.account(beam, sent / 3.0));
        if let [Some(a), Some(b), Some(c)] = thirds
            && let [Some(u), Some(v), Some(w)] = [a, b, c].map(|(landing, _)| landing.u)
            && together(corners)
        {
            self.lay(&[u, v, w], &a.0.spot, a.1 + b.1 + c.1);
            return;
        }
        for (landing, power) in thirds.into_iter().flatten() {
            let Some(u) = landing.u else {
                self.flux.outside += power;
                continue;
            };
            let square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
            self.lay(&square.map(|d| u + cell * DVec2::from(d)), &landing.spot, power);
        }
    }

    /// Spreads power evenly over a convex polygon in the map.
    fn lay(&mut self, polygon: &[DVec2], spot: &Spot, power: DVec3) {
        let low = polygon.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = polygon.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let centre = polygon.iter().sum::<DVec2>() / polygon.len() as f64;
        let size = self.receivers.view.size.as_dvec2();
        let framed = low.cmpge(DVec2::ZERO).all() && high.cmplt(size).all();
        if framed && low.floor() == high.floor() {
            self.deposit(low.floor().as_ivec2(), centre, spot, power);
            return;
        }
        let whole = Polygon::new(polygon);
        let area = whole.area();
        // A line or a point, at a perfect focus: its area would be rounding.
        if area <= 1e-7 * (high - low).length() {
            for &u in polygon {
                self.lay_at(u, spot, power / polygon.len() as f64);
            }
            return;
        }
        let first = low.max(DVec2::ZERO).floor();
        let last = high.min(size - 0.5).floor();
        let mut laid = 0.0;
        let mut y = first.y;
        while y <= last.y {
            let strip = whole.cut(1, y, 1.0).cut(1, y + 1.0, -1.0);
            let mut x = first.x;
            while x <= last.x {
                let piece = strip.cut(0, x, 1.0).cut(0, x + 1.0, -1.0);
                let share = piece.area() / area;
                if share > 0.0 {
                    laid += share;
                    let texel = DVec2::new(x, y).as_ivec2();
                    self.deposit(texel, piece.middle(), spot, share * power);
                }
                x += 1.0;
            }
            y += 1.0;
        }
        if !framed {
            self.flux.outside += (1.0 - laid).max(0.0) * power;
        }
    }

    fn lay_point(&mut self, landing: Landing, power: DVec3) {
        match landing.u {
            Some(u) => self.lay_at(u, &landing.spot, power),
            None => self.flux.outside += power,
        }
    }

    fn lay_at(&mut self, u: DVec2, spot: &Spot, power: DVec3) {
        if u.cmpge(DVec2::ZERO).all() && u.cmplt(self.receivers.view.size.as_dvec2()).all() {
            self.deposit(u.floor().as_ivec2(), u, spot, power);
        } else {
            self.flux.outside += power;
        }
    }

    fn deposit(&mut self, texel: IVec2, u: DVec2, spot: &Spot, power: DVec3) {
        match self.receivers.shows(texel, u, spot) {
            Some(i) => {
                self.flux.received += power;
                self.deposits.push((i as u32, power));
            }
            None => self.flux.hidden += power,
        }
    }
}

/// Whether neighbouring rays went through the same surfaces to the same one.
fn together(corners: [&Beam; 3]) -> bool {
    let spots = corners.map(|beam| {
        let [enter, leave] = beam.interfaces;
        [enter, leave, beam.landing().map(|landing| landing.spot)]
    });
    let pair = |i: usize, j: usize| {
        spots[i].iter().zip(&spots[j]).all(|pair| match pair {
            (Some(a), Some(b)) => a.continues(b),
            (None, None) => true,
            _ => false,
        })
    };
    pair(0, 1) && pair(1, 2) && pair(2, 0)
}

/// A convex polygon: at most a quadrilateral cut by the four sides of a texel. That has eight
/// corners, and where rounding doubles some a few more.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec2; 16],
    count: usize,
}

impl Polygon {
    fn new(corners: &[DVec2]) -> Self {
        let mut polygon = Self { corners: [DVec2::ZERO; 16], count: 0 };
        for &corner in corners {
            polygon.push(corner);
        }
        polygon
    }

    fn push(&mut self, corner: DVec2) {
        let repeated = self.corners().last() == Some(&corner);
        if !repeated && self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    /// The part on the positive (`side` = 1) or negative (−1) side of a line across an axis
    /// (Sutherland and Hodgman 1974).
    fn cut(&self, axis: usize, at: f64, side: f64) -> Self {
        let mut part = Self::new(&[]);
        let corners = self.corners();
        for (i, &b) in corners.iter().enumerate() {
            let a = corners[(i + corners.len() - 1) % corners.len()];
            let (da, db) = (side * (a[axis] - at), side * (b[axis] - at));
            if (da < 0.0) != (db < 0.0) {
                let mut border = a.lerp(b, da / (da - db));
                border[axis] = at;
                part.push(border);
            }
            if db >= 0.0 {
                part.push(b);
            }
        }
        part
    }

    fn area(&self) -> f64 {
        let corners = self.corners();
        let Some(&o) = corners.first() else { return 0.0 };
        // From one of its corners, so that it has its digits anywhere in the map.
        let sides = corners.windows(2).map(|ab| (ab[0] - o).perp_dot(ab[1] - o));
        0.5 * sides.sum::<f64>().abs()
    }

    fn middle(&self) -> DVec2 {
        self.corners().iter().sum::<DVec2>() / self.count.max(1) as f64
    }
}
