//! Liquids with an exact surface.

use glam::{DMat3, DVec2, DVec3, Vec3Swizzles as _};

use super::solids::{box_span, sphere_span};
use super::{Crossing, Liquid, Ray};
use limpid_sim::waves::Waves;

/// A sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// The centre, m.
    pub center: DVec3,
    /// The radius, m, above 0.
    pub radius: f64,
}

impl Liquid for Ball {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        let t = crossing_of_sphere(ray.origin - self.center, ray.direction, self.radius, inside)?;
        Some(smooth(t, (ray.at(t) - self.center).normalize_or(-ray.direction)))
    }

    fn contains(&self, point: DVec3) -> bool {
        point.distance(self.center) < self.radius
    }
}

/// An ellipsoid: all points centre + axes·s with |s| ≤ 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    center: DVec3,
    sphere_from_world: DMat3,
}

impl Ellipsoid {
    /// Creates an ellipsoid around `center`; the columns of `axes`, if orthogonal, are its
    /// semi-axes, m. `None` if they are coplanar.
    pub fn new(center: DVec3, axes: DMat3) -> Option<Self> {
        let sphere_from_world = axes.inverse();
        let usable = axes.determinant() != 0.0 && sphere_from_world.is_finite();
        usable.then_some(Self { center, sphere_from_world })
    }
}

impl Liquid for Ellipsoid {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        let o = self.sphere_from_world * (ray.origin - self.center);
        let d = self.sphere_from_world * ray.direction;
        let t = crossing_of_sphere(o, d, 1.0, inside)?;
        let normal = self.sphere_from_world.transpose() * (o + t * d);
        Some(smooth(t, normal.normalize_or(-ray.direction)))
    }

    fn contains(&self, point: DVec3) -> bool {
        self.level(point) < 1.0
    }
}

impl Ellipsoid {
    /// The level set function: 0 at the centre, 1 on the surface.
    fn level(&self, point: DVec3) -> f64 {
        (self.sphere_from_world * (point - self.center)).length()
    }
}

/// Ellipsoids that do not touch each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Drops(pub Vec<Ellipsoid>);

impl Liquid for Drops {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        if !inside {
            let entered = self.0.iter().filter_map(|drop| drop.crossing(ray, false));
            return entered.min_by(|a, b| a.t.total_cmp(&b.t));
        }
        // The ray starts in one of them, or just outside due to rounding.
        let level = |drop: &&Ellipsoid| drop.level(ray.origin);
        let own = self.0.iter().min_by(|a, b| level(a).total_cmp(&level(b)));
        own?.crossing(ray, true)
    }

    fn contains(&self, point: DVec3) -> bool {
        self.0.iter().any(|drop| drop.contains(point))
    }
}

/// An axis-aligned box; a slab if infinite along two axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// The corner with the smallest coordinates, m; may be infinite.
    pub min: DVec3,
    /// The corner with the largest.
    pub max: DVec3,
}

impl Liquid for Block {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        let (near, far) = box_span(ray, self.min, self.max)?;
        if inside {
            return far.0.is_finite().then(|| smooth(far.0.max(0.0), far.1));
        }
        (near.0 > 0.0).then(|| smooth(near.0, near.1))
    }

    fn contains(&self, point: DVec3) -> bool {
        point.cmpgt(self.min).all() && point.cmplt(self.max).all()
    }
}

/// Water below waves in a rectangle; its sides are vertical surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct Pool {
    /// The surface, y = height(x, z).
    pub waves: Waves,
    /// The rectangle's corner with the smallest (x, z), m.
    pub min: DVec2,
    /// The corner with the largest.
    pub max: DVec2,
    /// Height of the bottom, m; if −∞, a solid should end the water.
    pub bottom: f64,
}

/// Distance below which two crossings of waves are not separated, m.
const RESOLUTION: f64 = 1e-12;

/// Step of Newton's method after which the next would be rounding, m.
const NEAR: f64 = 1e-9;

/// Limit of Newton steps, mostly 4 are taken; a ray that needs more is so far away that only
/// rounding is left.
const MOST_STEPS: u32 = 64;

impl Liquid for Pool {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        let min = DVec3::new(self.min.x, self.bottom, self.min.y);
        let max = DVec3::new(self.max.x, f64::INFINITY, self.max.y);
        let (near, far) = box_span(ray, min, max)?;
        if far.0 < 0.0 && !inside {
            return None;
        }
        if !inside && near.0 > 0.0 && self.contains_below(ray.at(near.0)) {
            return Some(smooth(near.0, near.1));
        }
        if let Some((t, slope)) = self.surface(ray, near.0.max(0.0), far.0, inside) {
            return Some(smooth(t, DVec3::new(-slope.x, 1.0, -slope.y).normalize()));
        }
        (inside && far.0.is_finite()).then(|| smooth(far.0.max(0.0), far.1))
    }

    fn contains(&self, point: DVec3) -> bool {
        let at = point.xz();
        at.cmpgt(self.min).all()
            && at.cmplt(self.max).all()
            && point.y > self.bottom
            && self.contains_below(point)
    }
}

impl Pool {
    fn contains_below(&self, point: DVec3) -> bool {
        point.y < self.waves.bound() && point.y < self.waves.height(point.xz())
    }

    /// Finds where the ray, at `start` above the waves (or below if `inside`), first is on their
    /// other side, up to `end`; and their slope there.
    ///
    /// For the height g above the waves along the ray, |g''| is bounded by a known sum. Hence g +
    /// g' s − bound s²/2 is at most g at every s ahead, and the first crossing is not before its
    /// root. Stepping from root to root never passes a crossing and converges quadratically.
    fn surface(&self, ray: &Ray, start: f64, end: f64, inside: bool) -> Option<(f64, DVec2)> {
        // Turned upside down, leaving is entering.
        let sign = if inside { -1.0 } else { 1.0 };
        let (y, rise) = (sign * ray.origin.y, sign * ray.direction.y);
        let along = ray.direction.xz();
        let height = |t: f64| y + t * rise - sign * self.waves.height(ray.at(t).xz());
        let change = |t: f64| rise - sign * self.waves.slope(ray.at(t).xz()).dot(along);

        // Only between the highest crest and the lowest trough.
        let bound = self.waves.bound();
        let (at_crest, at_trough) = ((bound - y) / rise, (-bound - y) / rise);

        let steepest: f64 =
            self.waves.waves.iter().map(|w| (w.amplitude * w.k.dot(along)).abs()).sum();
        if rise > steepest {
            return None;
        }
        if -rise > steepest {
            // A ray steeper than any wave crosses them once: Newton's method, kept to a bracket.
            let (mut low, mut high) = (at_crest, at_trough);
            let mut t = -y / rise;
            let mut slope = DVec2::ZERO;
            for _ in 0..MOST_STEPS {
                let h;
                (h, slope) = self.waves.height_and_slope(ray.at(t).xz());
                let g = y + t * rise - sign * h;
                if g > 0.0 {
                    low = t;
                } else {
                    high = t;
                }
                let newton = t - g / (rise - sign * slope.dot(along));
                let next =
                    if low <= newton && newton <= high { newton } else { 0.5 * (low + high) };
                let close = (next - t).abs() <= NEAR + RESOLUTION * t.abs();
                t = next;
                if close {
                    break;
                }
            }
            return (t <= end).then_some((t.max(start), slope));
        }

        let (mut t, mut end) = (start, end);
        if rise < 0.0 {
            t = t.max(at_crest);
            end = end.min(at_trough + RESOLUTION * (1.0 + at_trough.abs()));
        } else if rise > 0.0 {
            end = end.min(at_crest);
        } else if y > bound {
            return None;
        }

        let curvature: f64 =
            self.waves.waves.iter().map(|w| w.amplitude.abs() * w.k.dot(along).powi(2)).sum();
        let mut g = height(t).max(0.0);
        while end - t > RESOLUTION {
            let slope = change(t);
            let root = (slope * slope + 2.0 * curvature * g).sqrt();
            let step =
                if slope < 0.0 { 2.0 * g / (root - slope) } else { (slope + root) / curvature };
            // NaN (0/0) for a ray that lies in flat water: it continues to the end.
            let step = if step.is_nan() { f64::INFINITY } else { step };
            let next = (t + step.max(RESOLUTION * (1.0 + t))).min(end);
            let g_next = height(next);
            if g_next < 0.0 {
                let t = t + (next - t) * (g / (g - g_next));
                return Some((t, self.waves.slope(ray.at(t).xz())));
            }
            (t, g) = (next, g_next);
        }
        None
    }
}

/// A crossing of a smooth surface.
fn smooth(t: f64, normal: DVec3) -> Crossing {
    Crossing { t, normal, shading: normal }
}

/// Finds where o + t d leaves a sphere around the origin (`inside`), or enters it.
fn crossing_of_sphere(o: DVec3, d: DVec3, radius: f64, inside: bool) -> Option<f64> {
    match (sphere_span(o, d, radius), inside) {
        (Some((_, leave)), true) => Some(leave.max(0.0)),
        // Off the sphere due to rounding at grazing incidence.
        (None, true) => Some(0.0),
        (Some((enter, _)), false) => (enter > 0.0).then_some(enter),
        (None, false) => None,
    }
}
