//! The surroundings of the liquid, in f64: the scene's solids, lights and environment.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::image_plane::ImagePlane;
use super::solids::{Form, Side, SideForm, Solid, SolidHit, dominant};
use super::{Ray, wide};
use limpid::background::fitted;
use limpid::environment::Environment;
use limpid::scene::{Light, Scene, Surface};

/// The solids, lights and environment of a scene.
#[derive(Debug, Clone)]
pub struct Surroundings {
    solids: Vec<Solid>,
    lights: Vec<Lamp>,
    environment: Environment,
    /// The scene's picture behind everything, where a camera sees it.
    background: Option<Background>,
    /// Mean radiance of the environment: the ambient light of lit solids.
    ambient: DVec3,
}

/// Direct light arriving at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direct {
    /// Unit direction towards the light.
    pub towards: DVec3,
    /// Distance of the light, m; infinite for a sun.
    pub distance: f64,
    /// Irradiance on the surface, W/m², including the cosine.
    pub irradiance: DVec3,
}

/// Offset of shadow ray origins from the surface, m and relative.
const SHADOW: f64 = 1e-9;

#[derive(Debug, Clone, Copy)]
enum Lamp {
    /// Unit direction towards the sun, and irradiance on a surface that faces it.
    Sun {
        towards: DVec3,
        irradiance: DVec3,
    },
    Point {
        position: DVec3,
        intensity: DVec3,
    },
}

/// A picture at infinity, as a camera sees it.
#[derive(Debug, Clone)]
struct Background {
    view: ImagePlane,
    pixels: Vec<[f32; 4]>,
}

impl Background {
    fn radiance(&self, direction: DVec3) -> Option<DVec3> {
        let at = self.view.pixel(direction)?.as_uvec2();
        let texel = self.pixels.get((at.y * self.view.size.x as u32 + at.x) as usize)?;
        Some(DVec3::new(texel[0].into(), texel[1].into(), texel[2].into()))
    }
}

impl Surroundings {
    /// The opaque surroundings of a scene.
    pub fn new(scene: &Scene) -> Self {
        let solids = scene.solids.iter().map(|solid| Solid {
            form: Form::new(&solid.shape),
            surface: solid.surface.clone(),
            lit: solid.lit,
        });
        let lights = scene.lights.iter().map(|light| match *light {
            Light::Sun { direction, irradiance } => {
                Lamp::Sun { towards: -wide(direction).normalize(), irradiance: wide(irradiance) }
            }
            Light::Point { position, intensity } => {
                Lamp::Point { position: wide(position), intensity: wide(intensity) }
            }
        });
        Self {
            solids: solids.collect(),
            lights: lights.collect(),
            environment: scene.environment.clone(),
            background: None,
            ambient: wide(scene.environment.mean()),
        }
    }

    /// The same with the scene's background, as a view of pinhole cameras shows it.
    pub(super) fn before_background(mut self, scene: &Scene, view: ImagePlane) -> Self {
        let pixels = scene.background.as_ref().map(|file| fitted(file, view.size.as_uvec2()));
        self.background = pixels.map(|pixels| Background { view, pixels });
        self
    }

    /// The nearest solid ahead.
    pub fn hit(&self, ray: &Ray) -> Option<SolidHit> {
        let hits = (0..self.solids.len()).filter_map(|solid| self.hit_alone(solid, ray));
        hits.min_by(|a, b| a.t.total_cmp(&b.t))
    }

    /// Intersects a ray with one solid, ignoring occluders.
    fn hit_alone(&self, solid: usize, ray: &Ray) -> Option<SolidHit> {
        let form = &self.solids[solid].form;
        if let Form::Mesh(mesh) = form {
            return mesh.hit(solid, ray, |_| true);
        }
        let t = form.distance(ray)?;
        let point = ray.at(t);
        Some(SolidHit { t, point, normal: form.normal(point), solid, on_mesh: None, part: 0 })
    }

    /// Intersects a ray with a side's solid, of a mesh only with that part, ignoring occluders.
    pub(super) fn hit_side(&self, side: &Side, ray: &Ray) -> Option<SolidHit> {
        match &self.solids[side.solid].form {
            Form::Mesh(mesh) => mesh.hit(side.solid, ray, |part| part == side.part),
            _ => self.hit_alone(side.solid, ray),
        }
    }

    /// Whether the point just above a surface point lies inside a solid.
    pub(super) fn covers(&self, point: DVec3, normal: DVec3) -> bool {
        let above = point + SHADOW * (1.0 + point.abs().max_element()) * normal;
        self.solids.iter().any(|solid| solid.form.contains(above))
    }

    /// Returns the side of a solid, or of a part of a mesh, that has this normal.
    pub(super) fn side(&self, solid: usize, part: u32, normal: DVec3) -> Side {
        match &self.solids[solid].form {
            &Form::Sphere { center, radius } => Side {
                solid,
                part,
                axis: dominant(normal),
                form: SideForm::Round { center, radius },
            },
            Form::Mesh(mesh) => {
                let outwards = mesh.parts.axes[part as usize];
                let axis = if normal.dot(outwards) < 0.0 { -outwards } else { outwards };
                let top = mesh.top(part, axis);
                Side { solid, part, axis, form: SideForm::Uneven { top } }
            }
            _ => Side { solid, part, axis: normal, form: SideForm::Flat },
        }
    }

    /// Radiance seen along a ray without liquid.
    pub fn radiance(&self, ray: &Ray) -> DVec3 {
        match self.hit(ray) {
            Some(hit) => self.solid_radiance(&hit, ray.direction, DVec3::ONE, |_, direct| {
                direct.map_or(DVec3::ZERO, |direct| direct.irradiance)
            }),
            None => {
                let shown = self.background.as_ref().and_then(|seen| seen.radiance(ray.direction));
                shown.unwrap_or_else(|| self.environment(ray.direction))
            }
        }
    }

    /// Whether a solid is lit, or shows its colour independently of light.
    pub(super) fn is_lit(&self, solid: usize) -> bool {
        self.solids[solid].lit
    }

    /// Radiance of a solid seen along `direction`: its colour, or the Lambertian reflection of
    /// unshadowed lights and of the ambient light.
    ///
    /// `ambient` is the transmitted share of the ambient light: 1 without liquid. `arriving` maps a
    /// light, by its index, and its direct light without liquid (`None` in shadow) to the
    /// irradiance on the surface, W/m².
    pub fn solid_radiance(
        &self,
        hit: &SolidHit,
        direction: DVec3,
        ambient: DVec3,
        arriving: impl Fn(usize, Option<&Direct>) -> DVec3,
    ) -> DVec3 {
        let solid = &self.solids[hit.solid];
        let color = solid.color(hit);
        let fade = |radiance| match solid.surface {
            Surface::Ground { fade, .. } => {
                let offset = hit.point.distance(solid.form.middle()) / f64::from(fade);
                let level = direction.with_y(0.0).normalize_or_zero();
                self.environment(level).lerp(radiance, (-offset * offset).exp())
            }
            _ => radiance,
        };
        if !solid.lit {
            return fade(color);
        }
        let normal = solid.shading_normal(hit, hit.facing(direction));
        let irradiance: DVec3 = (0..self.lights.len())
            .map(|light| arriving(light, self.direct(light, hit.point, normal).as_ref()))
            .sum();
        fade(color * (ambient * self.ambient + irradiance / PI))
    }

    /// Computes the direct light at a point of a solid whose normal points towards the lit side;
    /// `None` if the surface faces away from the light or another solid blocks it.
    pub fn direct(&self, light: usize, point: DVec3, normal: DVec3) -> Option<Direct> {
        let direct = self.lights[light].direct(point, normal)?;
        // Offset by more than rounding, so that a solid does not shadow itself.
        let origin = point + SHADOW * (1.0 + point.abs().max_element()) * normal;
        let blocker = self.hit(&Ray { origin, direction: direct.towards });
        blocker.is_none_or(|hit| hit.t >= direct.distance).then_some(direct)
    }

    /// Radiance of the environment, seen along `direction`.
    pub fn environment(&self, direction: DVec3) -> DVec3 {
        match &self.environment {
            Environment::Constant(radiance) => wide(*radiance),
            Environment::Gradient { zenith, horizon, nadir } => {
                let end = if direction.y > 0.0 { zenith } else { nadir };
                wide(*horizon).lerp(wide(*end), direction.y.abs())
            }
            Environment::Sky { zenith, horizon, nadir, glows } => {
                let end = if direction.y > 0.0 { zenith } else { nadir };
                let rise = direction.y.abs();
                let gradient = wide(*horizon).lerp(wide(*end), rise * (2.0 - rise));
                glows.iter().fold(gradient, |sum, glow| {
                    let cosine = wide(glow.direction).dot(direction);
                    sum + wide(glow.radiance) * (f64::from(glow.sharpness) * (cosine - 1.0)).exp()
                })
            }
            Environment::Map { size, pixels } => {
                let longitude = direction.x.atan2(-direction.z) / TAU + 0.5;
                let latitude = direction.y.clamp(-1.0, 1.0).acos() / PI;
                // Texel centres are at half-integers; columns wrap around, rows end at the poles.
                let (width, height) = (i64::from(size.x), i64::from(size.y));
                let at = DVec2::new(longitude, latitude) * size.as_dvec2() - 0.5;
                let (corner, f) = (at.floor(), at - at.floor());
                let texel = |dx: i64, dy: i64| {
                    let x = (corner.x as i64 + dx).rem_euclid(width);
                    let y = (corner.y as i64 + dy).clamp(0, height - 1);
                    let [r, g, b, _] = pixels[(y * width + x) as usize];
                    wide([r, g, b].map(f64::from))
                };
                let top = texel(0, 0).lerp(texel(1, 0), f.x);
                let low = texel(0, 1).lerp(texel(1, 1), f.x);
                top.lerp(low, f.y)
            }
        }
    }
}

impl Lamp {
    fn direct(&self, point: DVec3, normal: DVec3) -> Option<Direct> {
        let (towards, distance, power) = match *self {
            Self::Sun { towards, irradiance } => (towards, f64::INFINITY, irradiance),
            Self::Point { position, intensity } => {
                let distance2 = position.distance_squared(point).max(1e-12);
                let towards = (position - point).normalize_or_zero();
                (towards, distance2.sqrt(), intensity / distance2)
            }
        };
        let cos = normal.dot(towards);
        (cos > 0.0).then_some(Direct { towards, distance, irradiance: cos * power })
    }
}
