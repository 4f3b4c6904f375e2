//! The view from a light, in which its caustic map is drawn.

use glam::{DMat3, DVec2, DVec3, UVec2};

use crate::camera::CameraUniform;
use crate::scene::{Light, Shape, Solid};

/// A light's camera: orthographic for a sun, perspective for a point light.
///
/// It covers the liquid and a margin. View space, pixels and depth follow [`crate::camera::Camera`]. In
/// an orthographic view, the height above the far plane, far − z, replaces disparity: it too is linear
/// along straight lines of the image.
///
/// For a level surface the view looks along the light refracted by still water (a point light then
/// appears higher), so that it sees the receivers that light reaches under water. Such a view serves
/// only for caustic maps: whether liquid blocks the direct light is tested in a view along the
/// unrefracted light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightView {
    /// Origin of view space in world space, m: the point light, or a point in front of everything that
    /// the sun illuminates.
    pub origin: DVec3,
    /// World to view space, a rotation.
    pub view_from_world: DMat3,
    /// Half the image extent: m for a sun, tangents for a point light.
    pub half_extent: DVec2,
    /// Near plane, m.
    pub near: f64,
    /// Depth of the far plane of a sun's view, m; infinite for a point light.
    pub far: f64,
    /// Whether the light is a sun.
    pub orthographic: bool,
    /// Size in (square) pixels.
    pub size: UVec2,
    /// Height of the level surface that the view is refracted by, m, if any.
    pub level: Option<f64>,
}

/// Number of cube faces around a point light: [`LightView::face`].
pub const CUBE: usize = 6;

/// Largest half angle of a useful perspective view, radians.
const MAX_HALF_ANGLE: f64 = 75.0 * std::f64::consts::PI / 180.0;

/// Range of an orthographic view along its axis, as a multiple of the image extent.
const MAX_REACH: f64 = 1e3;

/// A view from a light, and its region in the map textures.
#[derive(Debug, Clone, Copy)]
pub struct PlacedView {
    /// The view.
    pub view: LightView,
    /// Index of the light.
    pub light: usize,
    /// Index of the view among those of the light: 0 is the caustic map's.
    pub slot: usize,
    /// Number of views along the unrefracted light.
    pub straight: u32,
    /// Texture layer of the region.
    pub layer: u32,
    /// First texel of the region.
    pub corner: UVec2,
    /// Whether the view is a cube face around a light in the liquid.
    pub wet: bool,
    /// Whether the view only tells which direct light the liquid blocks, since another has the light's caustic map.
    pub direct_only: bool,
}

impl LightView {
    /// Builds the view of liquid between `min` and `max`, m, extended by `margin` as a share of its
    /// extent, with `resolution` pixels along the longer side. `level` holds the height of a level
    /// surface, m, and the index of refraction.
    ///
    /// Returns `None` for a point light inside the liquid or so close that the liquid spans more than
    /// 150 degrees, and for liquid without extent.
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
                // Virtual image of the light for nearly vertical rays.
                let rise = level.map_or(0.0, |(height, ior)| (ior - 1.0) * (position.y - height));
                let position = position + rise.max(0.0) * DVec3::Y;
                (position, (position - middle).try_normalize()?, false)
            }
        };
        // Up is a fixed axis unless nearly parallel to the view: stable for a slowly moving light.
        let up = if back.y.abs() > 0.999 { DVec3::NEG_Z } else { DVec3::Y };
        let right = up.cross(back).normalize();
        let view_from_world = DMat3::from_cols(right, back.cross(right), back).transpose();
        let view = |x: DVec3| view_from_world * (x - origin);

        let liquid = corners(min, max).map(view);
        let screen = |x: DVec3| if orthographic { x.truncate() } else { x.truncate() / -x.z };
        if !orthographic {
            let widest = liquid.iter().any(|&x| -x.z <= x.length() * MAX_HALF_ANGLE.cos());
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
        // Snapped to a lattice, so that slightly moving liquid does not shift the map.
        let step = (extent.log2().ceil() - 6.0).exp2();
        low = ((low - margin * extent) / step).floor() * step;
        high = ((high + margin * extent) / step).ceil() * step;
        let centre = 0.5 * (low + high);
        // A perspective view stays centred on its axis; an orthographic one is recentred.
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
        // Depth range that contains all solids and the liquid.
        let mut z = liquid.map(|x| x.z).to_vec();
        let reach = MAX_REACH * extent;
        z.extend(
            solids.iter().flat_map(|solid| depths(solid, view_from_world, origin, (low, high))),
        );
        let z = z.iter().map(|z| z.clamp(-reach, reach));
        let top = z.clone().fold(f64::NEG_INFINITY, f64::max);
        let bottom = z.fold(f64::INFINITY, f64::min);
        let slack = 0.01 * (top - bottom).max(extent);
        // Keeps the near plane outside of liquid that extends beyond its box.
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

    /// Builds the view from a point light through one face of a cube around it: 90 degrees wide, with
    /// `resolution` texels along each side. Faces 0 to 5 are +x, −x, +y, −y, +z and −z.
    ///
    /// Returns `None` if no liquid between `min` and `max`, m, is in that direction, and for a sun.
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
        // The frustum holds points that are at least as far ahead as aside.
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

    /// Whether both views look along the same rays.
    pub fn has_same_rays_as(&self, other: &Self) -> bool {
        let rotation = (self.view_from_world.z_axis - other.view_from_world.z_axis).length()
            + (self.view_from_world.x_axis - other.view_from_world.x_axis).length();
        self.orthographic == other.orthographic
            && rotation < 1e-9
            && (self.orthographic || self.origin == other.origin)
    }

    /// Builds the camera uniform, with splat positions relative to the world-space point `origin`, m.
    pub fn uniform(&self, origin: DVec3) -> CameraUniform {
        let columns = self.view_from_world.to_cols_array_2d();
        CameraUniform {
            view_from_world: columns.map(|[x, y, z]| [x as f32, y as f32, z as f32, 0.0]),
            origin: (origin - self.origin).as_vec3(),
            near: self.near as f32,
            size: self.size.as_vec2(),
            tangent: self.half_extent.as_vec2(),
            far: if self.orthographic { self.far as f32 } else { 0.0 },
            pad: 0.0,
            shift: glam::Vec2::ZERO,
        }
    }

    /// Projects a world-space point: its pixel position, x right and y down, and its depth, m.
    pub fn project(&self, x: DVec3) -> (DVec2, f64) {
        let x = self.view_from_world * (x - self.origin);
        let depth = -x.z;
        let screen = if self.orthographic { x.truncate() } else { x.truncate() / depth };
        let ndc = screen / self.half_extent;
        let u = (0.5 * DVec2::new(ndc.x, -ndc.y) + 0.5) * self.size.as_dvec2();
        (u, depth)
    }

    /// Origin and unit direction in world space of the ray through a pixel position.
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

    /// Encodes a surface's tangent plane as a layer texel: π, and the depth at `x`, m. Position and
    /// unit normal are in world space; the sign of the normal does not matter.
    pub fn texel(&self, x: DVec3, normal: DVec3) -> [f32; 4] {
        let x = self.view_from_world * (x - self.origin);
        let normal = self.view_from_world * normal;
        let ray = if self.orthographic { DVec3::NEG_Z } else { x.normalize() };
        // Tilts edge-on planes to a cosine of at least 1e-3, for a finite slope.
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

    /// Extent of a pixel at `u`: its area, m², for a sun, its solid angle, sr, for a point light.
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

/// Depths that a solid reaches in an orthographic view of the rectangle `low` to `high`, m: those of the corners or ends.
fn depths(
    solid: &Solid,
    view_from_world: DMat3,
    origin: DVec3,
    (low, high): (DVec2, DVec2),
) -> Vec<f64> {
    let view = |x: DVec3| view_from_world * (x - origin);
    let around = |centre: DVec3, radius: f64| {
        let middle = view(centre).z;
        vec![middle - radius, middle + radius]
    };
    match solid.shape {
        Shape::Mesh { ref mesh, placement } => {
            let middle = placement.world_from_mesh(mesh.origin());
            around(middle, placement.scale * f64::from(mesh.reach()))
        }
        Shape::Box { min, max } => corners(min, max).map(|x| view(x).z).to_vec(),
        Shape::Sphere { center, radius } => around(center, radius.into()),
        Shape::Plane { origin: at, normal, .. } => {
            // Intersections of the view's corner rays with the plane.
            let (at, normal) = (view(at), view_from_world * normal.as_dvec3());
            let along = |corner: DVec2| (at - corner.extend(0.0)).dot(normal) / normal.z;
            let depth = |corner| Some(along(corner)).filter(|z| z.is_finite()).unwrap_or(0.0);
            corners_of(low, high).map(depth).to_vec()
        }
    }
}

/// Direction towards the light as seen from under still water (Snell); none unless the light is above.
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
