//! The surroundings of the liquid, in f64: the scene's solids, lights and environment.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::mesh::{Mesh, MeshHit};
use super::view::View;
use super::{Ray, in_plane, wide};
use limpid::background::fitted;
use limpid::environment::Environment;
use limpid::mesh::{Placement, Texture};
use limpid::scene::{Light, Scene, Shape, Surface};

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

/// An intersection of a ray with a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidHit {
    /// Distance along the ray, m.
    pub t: f64,
    /// The point.
    pub point: DVec3,
    /// The unit normal: out of a box or sphere; a plane's own.
    pub normal: DVec3,
    /// Index of the solid in the scene.
    pub solid: usize,
    /// The triangle, if the solid is a mesh.
    pub on_mesh: Option<MeshHit>,
    /// The part of the mesh's surface; 0 if the solid is none.
    pub part: u32,
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

/// A part of a solid's surface that is completely visible from one direction: a side of a plane or
/// of a box, the sixth of a sphere around an axis, or connected triangles that face almost one way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Side {
    pub(super) solid: usize,
    /// The part of a mesh; 0 of other solids.
    pub(super) part: u32,
    /// Outward unit vector.
    pub(super) axis: DVec3,
    pub(super) form: SideForm,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SideForm {
    Flat,
    /// Of a sphere.
    Round {
        center: DVec3,
        radius: f64,
    },
    /// Of a mesh, up to this height along the axis from the world's origin, m.
    Uneven {
        top: f64,
    },
}

/// Cosine of the largest angle between the normals of a flat side, or of a part of a mesh, and its axis.
const ALIKE: f64 = 0.9;

impl Side {
    /// Whether a point of a solid, or of this part of it, with this unit normal belongs to the side.
    pub(super) fn takes(&self, solid: usize, part: u32, normal: DVec3) -> bool {
        let towards = match self.form {
            SideForm::Round { .. } => dominant(normal) == self.axis,
            // A sheet has two sides.
            SideForm::Uneven { .. } => normal.dot(self.axis) > 0.0,
            SideForm::Flat => normal.dot(self.axis) > ALIKE,
        };
        self.solid == solid && self.part == part && towards
    }
}

/// The signed coordinate axis nearest to a direction.
fn dominant(direction: DVec3) -> DVec3 {
    let axis = direction.abs().max_position();
    DVec3::AXES[axis] * direction[axis].signum()
}

/// Offset of shadow ray origins from the surface, m and relative.
const SHADOW: f64 = 1e-9;

#[derive(Debug, Clone)]
struct Solid {
    form: Form,
    surface: Surface,
    lit: bool,
}

#[derive(Debug, Clone)]
enum Form {
    Plane { origin: DVec3, normal: DVec3, half_extent: f64 },
    Box { min: DVec3, max: DVec3 },
    Sphere { center: DVec3, radius: f64 },
    Mesh(Arc<SolidMesh>),
}

/// A mesh in the world.
struct SolidMesh {
    /// The triangles, in the order of `source`.
    world: Mesh,
    source: Arc<limpid::mesh::Mesh>,
    placement: Placement,
    parts: Parts,
}

/// Connected triangles of a mesh that face almost one way.
struct Parts {
    /// The part of each triangle.
    of: Vec<u32>,
    /// The unit normal of each part's first triangle.
    axes: Vec<DVec3>,
}

impl Parts {
    /// Grows each part from a triangle that is in none yet, across edges.
    fn new(world: &Mesh) -> Self {
        const NONE: u32 = u32::MAX;
        // Files repeat vertices where attributes differ.
        let mut places: HashMap<[u64; 3], u32> = HashMap::new();
        let mut edges: HashMap<(u32, u32), Vec<u32>> = HashMap::new();
        let welded: Vec<[u32; 3]> = (world.triangles().iter())
            .map(|triangle| {
                triangle.map(|i| {
                    let key = world.vertices()[i as usize].to_array().map(|x| (x + 0.0).to_bits());
                    let next = places.len() as u32;
                    *places.entry(key).or_insert(next)
                })
            })
            .collect();
        let edges_of =
            |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b)));
        for (i, &triangle) in (0..).zip(&welded) {
            edges_of(triangle).into_iter().for_each(|edge| edges.entry(edge).or_default().push(i));
        }
        let mut of = vec![NONE; welded.len()];
        let mut axes = Vec::new();
        for seed in 0..welded.len() {
            if of[seed] != NONE {
                continue;
            }
            let axis = world.triangle_normal(seed);
            let part = axes.len() as u32;
            axes.push(axis);
            of[seed] = part;
            let mut rest = vec![seed];
            while let Some(triangle) = rest.pop() {
                for &next in edges_of(welded[triangle]).iter().flat_map(|edge| &edges[edge]) {
                    let next = next as usize;
                    if of[next] == NONE && world.triangle_normal(next).dot(axis) > ALIKE {
                        of[next] = part;
                        rest.push(next);
                    }
                }
            }
        }
        Self { of, axes }
    }
}

impl std::fmt::Debug for SolidMesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.source.fmt(f)
    }
}

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
    view: View,
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
    pub(super) fn before_background(mut self, scene: &Scene, view: View) -> Self {
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

impl Form {
    fn new(shape: &Shape) -> Self {
        let real = |x: f32| f64::from(x);
        match *shape {
            Shape::Plane { origin, normal, half_extent } => Self::Plane {
                origin: wide(origin),
                normal: wide(normal).normalize(),
                half_extent: real(half_extent),
            },
            Shape::Box { min, max } => Self::Box { min: wide(min), max: wide(max) },
            Shape::Sphere { center, radius } => {
                Self::Sphere { center: wide(center), radius: real(radius) }
            }
            Shape::Mesh { ref mesh, placement } => {
                let place = |x: &glam::Vec3| placement.world_from_mesh(mesh.origin() + wide(*x));
                let vertices = mesh.vertices().iter().map(place).collect();
                let world = Mesh::new(vertices, mesh.triangles().to_vec());
                let world = world.expect("a mesh of a scene is checked");
                let parts = Parts::new(&world);
                Self::Mesh(Arc::new(SolidMesh { world, source: mesh.clone(), placement, parts }))
            }
        }
    }

    /// Distance along the ray to the nearest intersection ahead.
    fn distance(&self, ray: &Ray) -> Option<f64> {
        match *self {
            Self::Mesh(ref mesh) => mesh.world.hit(ray, |_| true).map(|hit| hit.t),
            Self::Plane { origin, normal, half_extent } => {
                let t = (origin - ray.origin).dot(normal) / ray.direction.dot(normal);
                // For a ray parallel to the plane the distance is infinite or NaN.
                let ahead = t > 0.0 && t.is_finite();
                let beside = || in_plane(normal, ray.at(t) - origin).abs().max_element();
                (ahead && beside() <= half_extent).then_some(t)
            }
            Self::Box { min, max } => {
                let ((near, _), (far, _)) = box_span(ray, min, max)?;
                let t = if near > 0.0 { near } else { far };
                (t > 0.0).then_some(t)
            }
            Self::Sphere { center, radius } => {
                let (near, far) = sphere_span(ray.origin - center, ray.direction, radius)?;
                let t = if near > 0.0 { near } else { far };
                (t > 0.0).then_some(t)
            }
        }
    }

    /// A plane's origin, or the centre.
    fn middle(&self) -> DVec3 {
        match *self {
            Self::Plane { origin, .. } => origin,
            Self::Box { min, max } => 0.5 * (min + max),
            Self::Sphere { center, .. } => center,
            Self::Mesh(ref mesh) => mesh.placement.translate,
        }
    }

    fn contains(&self, point: DVec3) -> bool {
        match *self {
            Self::Plane { .. } => false,
            Self::Mesh(ref mesh) => {
                mesh.source.is_closed() && super::Liquid::contains(&mesh.world, point)
            }
            Self::Box { min, max } => point.cmpgt(min).all() && point.cmplt(max).all(),
            Self::Sphere { center, radius } => point.distance(center) < radius,
        }
    }

    fn normal(&self, point: DVec3) -> DVec3 {
        match *self {
            Self::Plane { normal, .. } => normal,
            Self::Box { min, max } => {
                let offset = point - 0.5 * (min + max);
                let face = offset.abs() - 0.5 * (max - min);
                let axis = face.max_position();
                DVec3::AXES[axis] * offset[axis].signum()
            }
            Self::Sphere { center, .. } => (point - center).normalize_or(DVec3::Y),
            Self::Mesh(_) => unreachable!("a hit on a mesh has its triangle's normal"),
        }
    }
}

impl SolidMesh {
    /// The nearest triangle of the parts that are kept.
    fn hit(&self, solid: usize, ray: &Ray, keep: impl Fn(u32) -> bool) -> Option<SolidHit> {
        let hit = self.world.hit(ray, |triangle| keep(self.parts.of[triangle]))?;
        let normal = self.world.triangle_normal(hit.triangle);
        let part = self.parts.of[hit.triangle];
        let (t, on_mesh) = (hit.t, Some(hit));
        Some(SolidHit { t, point: ray.at(t), normal, solid, on_mesh, part })
    }

    /// The greatest height of a part along an axis.
    fn top(&self, part: u32, axis: DVec3) -> f64 {
        let triangles = self.world.triangles().iter().zip(&self.parts.of);
        let corners = triangles.filter(|(_, of)| **of == part).flat_map(|(triangle, _)| triangle);
        let heights = corners.map(|&i| self.world.vertices()[i as usize].dot(axis));
        heights.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Corners of the triangle of a hit.
    fn corners(&self, hit: &MeshHit) -> [usize; 3] {
        self.source.triangles()[hit.triangle].map(|i| i as usize)
    }

    fn color(&self, hit: &MeshHit) -> DVec3 {
        let material = &self.source.materials()[self.source.material_of()[hit.triangle] as usize];
        let Some(texture) = &material.texture else { return wide(material.color) };
        let uv = self
            .corners(hit)
            .map(|i| self.source.coordinates().get(i).copied().unwrap_or_default().as_dvec2());
        let shares = hit.shares;
        wide(material.color)
            * looked_up(texture, shares.x * uv[0] + shares.y * uv[1] + shares.z * uv[2])
    }

    /// The interpolated normal of the file, if it has one at all corners.
    fn shading_normal(&self, hit: &MeshHit) -> Option<DVec3> {
        let normals = self.corners(hit).map(|i| self.source.normals().get(i).copied());
        let [a, b, c] = normals.map(|n| n.filter(|&n| n != glam::Vec3::ZERO));
        let (a, b, c) = (wide(a?), wide(b?), wide(c?));
        let sum = hit.shares.x * a + hit.shares.y * b + hit.shares.z * c;
        Some((self.placement.rotate * sum).normalize())
    }
}

/// Bilinear lookup of the linear colour of a repeating texture.
fn looked_up(texture: &Texture, uv: DVec2) -> DVec3 {
    let (width, height) = (i64::from(texture.size().x), i64::from(texture.size().y));
    let at = (uv - uv.floor()) * texture.size().as_dvec2() - 0.5;
    let (corner, f) = (at.floor(), at - at.floor());
    let linear = |c: u8| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let texel = |dx: i64, dy: i64| {
        let x = (corner.x as i64 + dx).rem_euclid(width);
        let y = (corner.y as i64 + dy).rem_euclid(height);
        let [r, g, b, _] = texture.pixels()[(y * width + x) as usize];
        DVec3::from([r, g, b].map(linear))
    };
    let top = texel(0, 0).lerp(texel(1, 0), f.x);
    top.lerp(texel(0, 1).lerp(texel(1, 1), f.x), f.y)
}

impl Solid {
    /// The normal that light falls on, on the side of `normal`, which faces the viewer.
    fn shading_normal(&self, hit: &SolidHit, normal: DVec3) -> DVec3 {
        let (Form::Mesh(mesh), Some(on_mesh)) = (&self.form, &hit.on_mesh) else { return normal };
        let Some(shading) = mesh.shading_normal(on_mesh) else { return normal };
        if shading.dot(normal) < 0.0 { -shading } else { shading }
    }

    /// The texture of a plane, box or sphere.
    fn textured(&self, texture: &Texture, tile: f64, point: DVec3, normal: DVec3) -> DVec3 {
        if let Form::Sphere { .. } = self.form {
            let longitude = normal.x.atan2(-normal.z) / TAU + 0.5;
            let latitude = normal.y.clamp(-1.0, 1.0).acos() / PI;
            return looked_up(texture, DVec2::new(longitude, latitude));
        }
        let a = normal.abs();
        let upright = if a.y >= a.x.max(a.z) { 1.0 } else { -1.0 };
        let at = in_plane(normal, point - self.form.middle()) / tile;
        let size = texture.size().as_dvec2();
        looked_up(texture, at * DVec2::new(1.0, upright * size.x / size.y) + 0.5)
    }

    fn color(&self, hit: &SolidHit) -> DVec3 {
        let (point, normal) = (hit.point, hit.normal);
        match self.surface {
            Surface::Own => match (&self.form, &hit.on_mesh) {
                (Form::Mesh(mesh), Some(on_mesh)) => mesh.color(on_mesh),
                _ => DVec3::ZERO,
            },
            Surface::Texture { ref texture, tile } => {
                self.textured(texture, f64::from(tile), point, normal)
            }
            Surface::Color(color) => wide(color),
            Surface::Checker { tile, even, odd } | Surface::Ground { tile, even, odd, .. } => {
                // Tiles are cubes on a sphere and squares elsewhere, counted from the world's
                // origin.
                let tile = f64::from(tile);
                let parity = match self.form {
                    Form::Sphere { .. } | Form::Mesh(_) => (point / tile).floor().element_sum(),
                    _ => (in_plane(normal, point) / tile).floor().element_sum(),
                };
                wide(if parity.rem_euclid(2.0) < 0.5 { even } else { odd })
            }
        }
    }
}

impl SolidHit {
    /// The normal facing a ray: both sides of a plane are visible and lit.
    pub fn facing(&self, direction: DVec3) -> DVec3 {
        if direction.dot(self.normal) > 0.0 { -self.normal } else { self.normal }
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

/// A ray parameter and the unit normal of the face crossed there.
pub(super) type Face = (f64, DVec3);

/// Intersects the line of a ray with an axis-aligned box: entry and exit.
pub(super) fn box_span(ray: &Ray, min: DVec3, max: DVec3) -> Option<(Face, Face)> {
    let mut near = (f64::NEG_INFINITY, DVec3::ZERO);
    let mut far = (f64::INFINITY, DVec3::ZERO);
    for (axis, normal) in DVec3::AXES.into_iter().enumerate() {
        let (o, d) = (ray.origin[axis], ray.direction[axis]);
        if d == 0.0 {
            if o < min[axis] || o > max[axis] {
                return None;
            }
            continue;
        }
        let (first, last) = if d > 0.0 { (min[axis], max[axis]) } else { (max[axis], min[axis]) };
        let (enter, leave) = ((first - o) / d, (last - o) / d);
        if enter > near.0 {
            near = (enter, -d.signum() * normal);
        }
        if leave < far.0 {
            far = (leave, d.signum() * normal);
        }
    }
    (near.0 <= far.0).then_some((near, far))
}

/// Intersects the line o + t d with a sphere around the origin: entry and exit; `d` may have any
/// length.
pub(super) fn sphere_span(o: DVec3, d: DVec3, radius: f64) -> Option<(f64, f64)> {
    // Measured from the point nearest to the centre: the squares of large distances would cancel.
    let d2 = d.length_squared();
    let middle = -o.dot(d) / d2;
    let miss = (o + middle * d).length();
    let half2 = (radius - miss) * (radius + miss) / d2;
    (half2 >= 0.0).then(|| (middle - half2.sqrt(), middle + half2.sqrt()))
}
