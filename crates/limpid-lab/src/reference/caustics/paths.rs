//! Tracing of a light ray: through the liquid itself, or through layers of it.

use glam::{DVec2, DVec3, IVec2};

use super::{Chart, OFF, Spot};
use crate::reference::layers::{self, Layer, Pair};
use crate::reference::optics::{Interface, TOUCH, interface, transmittance};
use crate::reference::solids::SolidHit;
use crate::reference::surroundings::Surroundings;
use crate::reference::{Crossing, Liquid, Ray, wide};
use limpid::light_view::LightView;
use limpid::scene::Scene;

/// The result of tracing a light ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    pub(super) end: End,
    /// The share of its light that reached the end.
    pub(super) transmittance: DVec3,
    /// The points where it entered and left the liquid.
    pub(super) interfaces: [Option<Spot>; 2],
}

#[derive(Debug, Clone, Copy)]
pub(super) enum End {
    /// It hit no liquid.
    Dry,
    Landed(Landing),
    Missed,
    Reflected,
    Liquid,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Landing {
    pub(super) spot: Spot,
    /// Index of the chart that shows it.
    pub(super) chart: usize,
    /// Pixel position in the chart's view; `None` behind the view, or if no chart shows it.
    pub(super) u: Option<DVec2>,
}

impl Beam {
    pub(super) fn new() -> Self {
        Self { end: End::Dry, transmittance: DVec3::ONE, interfaces: [None; 2] }
    }

    pub(super) fn ending(mut self, end: End) -> Self {
        self.end = end;
        self
    }

    /// Passes an interface and returns the refracted direction.
    pub(super) fn refract(&mut self, spot: Spot, interface: &Interface) -> Option<DVec3> {
        self.interfaces[usize::from(self.interfaces[0].is_some())] = Some(spot);
        if interface.refracted.is_some() {
            self.transmittance *= 1.0 - interface.reflectance;
        }
        interface.refracted
    }

    pub(super) fn landing(&self) -> Option<Landing> {
        match self.end {
            End::Landed(landing) => Some(landing),
            _ => None,
        }
    }
}

/// Traces light rays through a liquid.
pub(super) struct Tracer<'a, L: ?Sized> {
    pub(super) liquid: &'a L,
    pub(super) surroundings: Surroundings,
    pub(super) light: &'a LightView,
    /// Whether the light is in the liquid.
    pub(super) inside: bool,
    pub(super) charts: &'a [Chart],
    pub(super) ior: f64,
    /// 1/m.
    pub(super) absorption: DVec3,
    pub(super) interfaces: u32,
}

pub(super) enum Ahead {
    Solid(SolidHit),
    Surface(Crossing),
    Nothing,
}

impl<'a, L: Liquid + ?Sized> Tracer<'a, L> {
    pub(super) fn new(
        liquid: &'a L,
        scene: &Scene,
        light: &'a LightView,
        charts: &'a [Chart],
        interfaces: u32,
    ) -> Self {
        Self {
            liquid,
            surroundings: Surroundings::new(scene),
            light,
            inside: !light.orthographic && liquid.contains(light.origin),
            charts,
            ior: scene.liquid.ior.into(),
            absorption: wide(scene.liquid.absorption),
            interfaces,
        }
    }

    pub(super) fn follow(&self, u: DVec2) -> Beam {
        let mut beam = Beam::new();
        let (origin, direction) = self.light.ray(u);
        let mut ray = Ray { origin, direction };
        if !self.inside {
            let Ahead::Surface(entry) = self.ahead(&ray, false) else { return beam };
            let Some(refracted) = self.pass(&mut beam, &ray, &entry, false) else {
                return beam.ending(End::Reflected);
            };
            ray = refracted;
        }
        let exit = match self.ahead(&ray, true) {
            Ahead::Solid(hit) => {
                beam.transmittance *= transmittance(self.absorption, hit.t);
                return self.land(beam, &hit, &ray);
            }
            Ahead::Surface(exit) if self.inside || self.interfaces >= 2 => exit,
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

    pub(super) fn ahead(&self, ray: &Ray, inside: bool) -> Ahead {
        let crossing = self.liquid.crossing(ray, inside);
        if let Some(hit) = self.surroundings.hit(ray)
            && crossing.as_ref().is_none_or(|c| hit.t <= c.t + TOUCH * (1.0 + c.t))
        {
            return Ahead::Solid(hit);
        }
        crossing.map_or(Ahead::Nothing, Ahead::Surface)
    }

    pub(super) fn pass(
        &self,
        beam: &mut Beam,
        ray: &Ray,
        crossing: &Crossing,
        inside: bool,
    ) -> Option<Ray> {
        let origin = ray.at(crossing.t);
        let spot = Spot { solid: 0, part: 0, point: origin, normal: crossing.shading };
        let eta = if inside { 1.0 / self.ior } else { self.ior };
        let direction = beam.refract(spot, &interface(ray, crossing, inside, eta))?;
        Some(Ray { origin, direction })
    }

    pub(super) fn land(&self, beam: Beam, hit: &SolidHit, ray: &Ray) -> Beam {
        let spot = Spot::of(hit, ray.direction);
        let chart = self.charts.iter().position(|chart| chart.takes(&spot));
        let u = chart.and_then(|chart| {
            let view = &self.charts[chart].view;
            let (u, depth) = view.project(hit.point);
            (depth > view.near).then_some(u)
        });
        beam.ending(End::Landed(Landing { spot, chart: chart.unwrap_or(0), u }))
    }
}

/// Traces light rays through layers, in view space.
pub(super) struct LayerTracer<'a> {
    pub(super) view: layers::ViewSpace,
    pub(super) classes: &'a [&'a Pair],
    pub(super) solids: &'a Layer,
    pub(super) ior: f64,
    /// 1/m.
    pub(super) absorption: DVec3,
    pub(super) contact: f64,
    pub(super) interfaces: u32,
}

impl LayerTracer<'_> {
    pub(super) fn follow(&self, u: DVec2) -> Beam {
        let mut beam = Beam::new();
        let view = &self.view;
        // The last row and column of beams lie on the frame's border.
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
        let normal = self.smooth_normal(
            layer,
            u,
            &Spot { solid: 0, part: 0, point, normal: view.normal(front) },
        );
        let spot = Spot { solid: 0, part: 0, point, normal: -normal };
        let entry = Interface::new(direction, facing(spot.normal, direction), self.ior);
        let Some(direction) = beam.refract(spot, &entry) else {
            return beam.ending(End::Reflected);
        };
        let solid = layers::entry(view, self.solids, point, direction, texel);
        let exit = layers::exit(view, self.classes, point, direction, texel);
        let exit = exit.map(|hit| {
            let point = view.point_at_depth(hit.u, hit.depth);
            let spot = Spot { solid: 0, part: 0, point, normal: view.normal(hit.plane) };
            let texel = hit.u.floor().as_ivec2();
            let layer =
                self.classes.iter().copied().flatten().find(|layer| layer.at(texel) == hit.plane);
            let normal = layer.map_or(spot.normal, |layer| self.smooth_normal(layer, hit.u, &spot));
            // Out of the liquid, like the ray.
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

    /// The normal, pointing away from the light, of a layer around a point on it: bilinear between
    /// the texels' centres. With per-texel normals light would pass each texel unfocused, and all
    /// focusing would happen at their borders.
    pub(super) fn smooth_normal(&self, layer: &Layer, u: DVec2, spot: &Spot) -> DVec3 {
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
            let other = Spot { solid: 0, part: 0, point, normal: self.view.normal(plane) };
            if other.continues(spot) {
                let along = |axis: usize, d: i32| if d == 0 { 1.0 - f[axis] } else { f[axis] };
                sum += along(0, dx) * along(1, dy) * other.normal;
            }
        }
        sum.normalize_or(spot.normal)
    }

    pub(super) fn landing(&self, hit: &layers::LayerHit, direction: DVec3) -> Landing {
        let point = self.view.point_at_depth(hit.u, hit.depth);
        let normal = facing(self.view.normal(hit.plane), direction);
        Landing { spot: Spot { solid: 0, part: 0, point, normal }, chart: 0, u: Some(hit.u) }
    }
}

/// Flips a normal against a direction.
pub(super) fn facing(normal: DVec3, direction: DVec3) -> DVec3 {
    if direction.dot(normal) > 0.0 { -normal } else { normal }
}
