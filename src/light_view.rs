//! The view from a light: what its caustic map shows, texel by texel.

use glam::{DMat3, DVec2, DVec3, UVec2};

use crate::camera::CameraUniform;
use crate::scene::{Light, Shape, Solid};

/// A light's own camera: orthographic for a sun, perspective for a point.
///
/// It shows the liquid and a margin around it. View space, pixels and depth are as a
/// [`crate::camera::Camera`]'s. In an orthographic view the place of disparity, which is linear along
/// straight lines of the picture, is taken by the height above the far plane, far − z.
///
/// Made for a level surface it looks along the light as still water would refract it (a point light
/// then seems to be higher): so it sees what light reaches under water, and not what a straight
/// line would. Such a view serves caustic maps alone: where liquid is in the light's own way is told
/// by a view along the light itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightView {
    /// The origin of view space in world space, m: the point light, or a point before all that the
    /// sun meets.
    pub origin: DVec3,
    /// World to view space, a rotation.
    pub view_from_world: DMat3,
    /// Half the picture's extent: m for a sun, tangents for a point light.
    pub half_extent: DVec2,
    /// Depth before which nothing is seen, m.
    pub near: f64,
    /// Depth of the far plane of a sun's view, m; infinite for a point light.
    pub far: f64,
    /// Whether the light is a sun.
    pub orthographic: bool,
    /// Pixels; they are square.
    pub size: UVec2,
    /// Height of the surface that the view is made for, m, if that is level.
    pub level: Option<f64>,
}

/// Faces of the cube that shows all that is around a point light: [`LightView::face`].
pub const CUBE: usize = 6;

/// Half the widest angle at which a point light's picture is still useful.
const WIDEST: f64 = 75.0 * std::f64::consts::PI / 180.0;

/// How far along a view surfaces are looked for, in extents of what is seen.
const FARTHEST: f64 = 1e3;

/// A view from a light, and the part of the maps that is made by it.
#[derive(Debug, Clone, Copy)]
pub struct PlacedView {
    /// The view.
    pub view: LightView,
    /// The light's number.
    pub light: usize,
    /// The number of the view among the light's: 0 is the caustic map's.
    pub slot: usize,
    /// How many straight views the light has.
    pub straight: u32,
    /// Layer of the maps.
    pub layer: u32,
    /// Where its texels begin there.
    pub corner: UVec2,
    /// Whether the light is in the liquid, and this one of the faces around it.
    pub wet: bool,
}

impl LightView {
    /// The view of a liquid between `min` and `max`, m, grown by `margin` as a share of its extent,
    /// with `resolution` pixels along the longer side. `level` is the height of its surface, m, and
    /// its index of refraction, where it is level.
    ///
    /// None for a point light in the liquid or so near that it is seen under more than 150 degrees,
    /// and for a liquid without extent.
    pub fn new(
        light: &Light,
        (min, max): (DVec3, DVec3),
        solids: &[Solid],
        margin: f64,
        resolution: u32,
        level: Option<(f64, f64)>,
    ) -> Option<Self> {
        let middle = 0.5 * (min + max);
        let height = level.map(|(height, _)| height);
        let (origin, back, orthographic) = match *light {
            Light::Sun { direction, .. } => {
                let towards = -direction.as_dvec3().normalize();
                let refracted = level.and_then(|(_, ior)| still_water(towards, ior));
                (middle, refracted.unwrap_or(towards), true)
            }
            Light::Point { position, .. } => {
                // Its image by rays that are nearly upright.
                let rise = level.map_or(0.0, |(height, ior)| (ior - 1.0) * (position.y - height));
                let position = position + rise.max(0.0) * DVec3::Y;
                (position, (position - middle).try_normalize()?, false)
            }
        };
        // The horizontal axis that the view is across most: steady for a light that moves little.
        let up = if back.y.abs() > 0.999 { DVec3::NEG_Z } else { DVec3::Y };
        let right = up.cross(back).normalize();
        let view_from_world = DMat3::from_cols(right, back.cross(right), back).transpose();
        let view = |x: DVec3| view_from_world * (x - origin);

        let liquid = corners(min, max).map(view);
        let screen = |x: DVec3| if orthographic { x.truncate() } else { x.truncate() / -x.z };
        if !orthographic {
            let widest = liquid.iter().any(|&x| -x.z <= x.length() * WIDEST.cos());
            if widest {
                return None;
            }
        }
        let mut low = DVec2::INFINITY;
        let mut high = DVec2::NEG_INFINITY;
        for x in liquid {
            low = low.min(screen(x));
            high = high.max(screen(x));
        }
        let extent = (high - low).max_element();
        if !(extent > 0.0 && extent.is_finite()) {
            return None;
        }
        // On a lattice, so that liquid that moves a little does not move the picture.
        let step = (extent.log2().ceil() - 6.0).exp2();
        low = ((low - margin * extent) / step).floor() * step;
        high = ((high + margin * extent) / step).ceil() * step;
        let centre = 0.5 * (low + high);
        // A point light's view stays around its axis; a sun's moves to the middle.
        let half = if orthographic { 0.5 * (high - low) } else { low.abs().max(high.abs()) };
        let pixel = 2.0 * half.max_element() / f64::from(resolution);
        let size = (2.0 * half / pixel - 1e-9).ceil().as_uvec2().max(UVec2::ONE);
        let half = 0.5 * pixel * size.as_dvec2();

        if !orthographic {
            let near = 1e-3 * liquid.iter().map(|x| x.length()).fold(f64::INFINITY, f64::min);
            let far = f64::INFINITY;
            return Some(Self {
                origin,
                view_from_world,
                half_extent: half,
                near,
                far,
                orthographic,
                size,
                level: height,
            });
        }
        // From before the first solid or liquid to behind the last.
        let mut z = liquid.map(|x| x.z).to_vec();
        let reach = FARTHEST * extent;
        for solid in solids {
            match solid.shape {
                Shape::Box { min, max } => z.extend(corners(min, max).map(|x| view(x).z)),
                Shape::Sphere { center, radius } => {
                    let radius = f64::from(radius);
                    z.extend([view(center).z - radius, view(center).z + radius]);
                }
                Shape::Plane { origin: at, normal, .. } => {
                    // Where the picture's corners meet it.
                    let (at, normal) = (view(at), view_from_world * normal.as_dvec3());
                    z.extend(corners_of(low, high).map(|c| {
                        let along = (at - c.extend(0.0)).dot(normal) / normal.z;
                        if along.is_finite() { along } else { 0.0 }
                    }));
                }
            }
        }
        let z = z.iter().map(|z| z.clamp(-reach, reach));
        let top = z.clone().fold(f64::NEG_INFINITY, f64::max);
        let bottom = z.fold(f64::INFINITY, f64::min);
        let slack = 0.01 * (top - bottom).max(extent);
        // Liquid that goes on beyond its box is still seen from outside.
        let top = top + extent;
        let origin = origin + view_from_world.transpose() * centre.extend(top);
        Some(Self {
            origin,
            view_from_world,
            half_extent: half,
            near: 0.0,
            far: top - bottom + slack,
            orthographic,
            size,
            level: height,
        })
    }

    /// The view from a point light through one face of a cube around it: 90 degrees wide, with
    /// `resolution` texels along either side. Faces are +x, −x, +y, −y, +z and −z, from 0.
    ///
    /// None where no liquid between `min` and `max`, m, is in that direction, and for a sun.
    pub fn face(
        light: &Light,
        face: usize,
        (min, max): (DVec3, DVec3),
        resolution: u32,
    ) -> Option<Self> {
        let Light::Point { position, .. } = *light else { return None };
        let axis = face / 2;
        let sign = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
        let back = -sign * DVec3::AXES[axis];
        let (low, high) = (min - position, max - position);
        // What is seen is as far ahead as it is aside, or farther.
        let ahead = (sign * low[axis]).max(sign * high[axis]);
        let aside = low.max(-high).max(DVec3::ZERO);
        let extent = (max - min).length();
        if !(extent > 0.0 && extent.is_finite()) {
            return None;
        }
        if ahead <= 0.0 || (0..3).any(|other| other != axis && aside[other] > ahead) {
            return None;
        }
        let up = if axis == 1 { DVec3::NEG_Z } else { DVec3::Y };
        let right = up.cross(back);
        Some(Self {
            origin: position,
            view_from_world: DMat3::from_cols(right, back.cross(right), back).transpose(),
            half_extent: DVec2::ONE,
            near: 1e-4 * extent,
            far: f64::INFINITY,
            orthographic: false,
            size: UVec2::splat(resolution.max(1)),
            level: None,
        })
    }

    /// Whether both look along the same rays.
    pub fn looks_as(&self, other: &Self) -> bool {
        let turned = (self.view_from_world.z_axis - other.view_from_world.z_axis).length()
            + (self.view_from_world.x_axis - other.view_from_world.x_axis).length();
        self.orthographic == other.orthographic
            && turned < 1e-9
            && (self.orthographic || self.origin == other.origin)
    }

    /// What the shaders need, with splats counted from `origin` in world space, m.
    pub fn uniform(&self, origin: DVec3) -> CameraUniform {
        let columns = self.view_from_world.to_cols_array_2d();
        CameraUniform {
            view_from_world: columns.map(|[x, y, z]| [x as f32, y as f32, z as f32, 0.0]),
            origin: (origin - self.origin).as_vec3(),
            near: self.near as f32,
            size: self.size.as_vec2(),
            tangent: self.half_extent.as_vec2(),
            far: if self.orthographic { self.far as f32 } else { 0.0 },
            pad: [0.0; 3],
        }
    }

    /// The pixel position of a point in world space, x right and y down, and its depth, m.
    pub fn project(&self, x: DVec3) -> (DVec2, f64) {
        let x = self.view_from_world * (x - self.origin);
        let depth = -x.z;
        let screen = if self.orthographic { x.truncate() } else { x.truncate() / depth };
        let ndc = screen / self.half_extent;
        let u = (0.5 * DVec2::new(ndc.x, -ndc.y) + 0.5) * self.size.as_dvec2();
        (u, depth)
    }

    /// The view's ray through a pixel position, in world space: where it starts, and its
    /// unit direction.
    pub fn ray(&self, u: DVec2) -> (DVec3, DVec3) {
        let ndc = 2.0 * u / self.size.as_dvec2() - 1.0;
        let screen = DVec2::new(ndc.x, -ndc.y) * self.half_extent;
        let world_from_view = self.view_from_world.transpose();
        if self.orthographic {
            (self.origin + world_from_view * screen.extend(0.0), -world_from_view.z_axis)
        } else {
            (self.origin, (world_from_view * screen.extend(-1.0)).normalize())
        }
    }

    /// The tangent plane of a surface as a layer's texel holds it: π, and the depth at `x`, m. Either
    /// orientation of the unit normal serves; both are in world space.
    pub fn texel(&self, x: DVec3, normal: DVec3) -> [f32; 4] {
        let x = self.view_from_world * (x - self.origin);
        let normal = self.view_from_world * normal;
        let ray = if self.orthographic { DVec3::NEG_Z } else { x.normalize() };
        // No plane is seen more edge-on than 1e-3: it would have no finite slope.
        let mut away = normal * normal.dot(ray).signum();
        away += (1e-3 - away.dot(ray)).max(0.0) * ray;
        let plane = if self.orthographic {
            let slope = away.truncate() / -away.z;
            slope.extend(slope.dot(x.truncate()) - (self.far + x.z))
        } else {
            away / away.dot(x)
        };
        [plane.x as f32, plane.y as f32, plane.z as f32, -x.z as f32]
    }

    /// The extent of one pixel around `u`: of a sun's view its area, m², of a point light's its solid
    /// angle, sr.
    pub fn pixel_extent(&self, u: DVec2) -> f64 {
        let size = self.size.as_dvec2();
        let area = (2.0 * self.half_extent / size).element_product();
        if self.orthographic {
            return area;
        }
        let ndc = 2.0 * u / size - 1.0;
        area / (1.0 + (ndc * self.half_extent).length_squared()).powf(1.5)
    }
}

/// The direction towards a light from under still water (Snell); none if the light is not above.
fn still_water(towards: DVec3, ior: f64) -> Option<DVec3> {
    let across = DVec3::new(towards.x, 0.0, towards.z) / ior;
    let up2 = 1.0 - across.length_squared();
    (towards.y > 0.0 && up2 > 0.0).then(|| across + up2.sqrt() * DVec3::Y)
}

fn corners(min: DVec3, max: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, axis: usize| if i >> bit & 1 == 0 { min[axis] } else { max[axis] };
        DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    })
}

fn corners_of(low: DVec2, high: DVec2) -> [DVec2; 4] {
    [low, DVec2::new(high.x, low.y), DVec2::new(low.x, high.y), high]
}
