//! Exact intersection of layers: visits every texel that a ray crosses, in f64.
//!
//! This is the best that a screen-space intersector can find: its error is measured against this;
//! the error of the layers themselves is measured against the surfaces that they show.

use glam::{DVec2, DVec3, IVec2, UVec2};

use limpid::camera::CameraUniform;
use limpid::light_view::LightView;

/// A camera's view space, as in `shaders/common/camera.wgsl`, in perspective or orthographic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewSpace {
    /// Picture size, pixels.
    pub size: DVec2,
    /// Tangents of half the fields of view; of an orthographic view, half its extent, m.
    pub tangent: DVec2,
    /// Near plane, m.
    pub near: f64,
    /// Depth of an orthographic view's far plane, m.
    pub far: Option<f64>,
}

impl ViewSpace {
    /// Builds the view from the device's uniform.
    pub fn new(camera: &CameraUniform) -> Self {
        Self {
            size: camera.size.as_dvec2(),
            tangent: camera.tangent.as_dvec2(),
            near: camera.near.into(),
            far: (camera.far > 0.0).then(|| camera.far.into()),
        }
    }

    /// Builds a light's view.
    pub fn of_light(light: &LightView) -> Self {
        Self {
            size: light.size.as_dvec2(),
            tangent: light.half_extent,
            near: light.near,
            far: light.orthographic.then_some(light.far),
        }
    }

    /// The ray of unit depth through a pixel position; in an orthographic view, its x and y, and
    /// −1.
    pub fn omega(&self, u: DVec2) -> DVec3 {
        let ndc = 2.0 * u / self.size - 1.0;
        DVec3::new(ndc.x * self.tangent.x, -ndc.y * self.tangent.y, -1.0)
    }

    /// Projects a point in front of the eye to a pixel position.
    pub fn pixel(&self, x: DVec3) -> DVec2 {
        let scale = if self.far.is_some() { 1.0 } else { -x.z };
        let ndc = DVec2::new(x.x, -x.y) / (scale * self.tangent);
        (0.5 * ndc + 0.5) * self.size
    }

    /// The ray through a pixel position: its origin and its unit direction.
    pub fn ray(&self, u: DVec2) -> (DVec3, DVec3) {
        let omega = self.omega(u);
        match self.far {
            Some(_) => (omega.truncate().extend(0.0), DVec3::NEG_Z),
            None => (DVec3::ZERO, omega.normalize()),
        }
    }

    /// The point at a non-zero disparity π·ω.
    pub fn point(&self, u: DVec2, disparity: f64) -> DVec3 {
        let omega = self.omega(u);
        match self.far {
            Some(far) => omega.truncate().extend(disparity - far),
            None => omega / disparity,
        }
    }

    /// The point at a depth, m.
    pub fn point_at_depth(&self, u: DVec2, depth: f64) -> DVec3 {
        let omega = self.omega(u);
        match self.far {
            Some(_) => omega.truncate().extend(-depth),
            None => depth * omega,
        }
    }

    /// The unit normal of a texel's plane, pointing away from the eye.
    pub fn normal(&self, plane: DVec3) -> DVec3 {
        let away = if self.far.is_some() { plane.truncate().extend(-1.0) } else { plane };
        away.normalize()
    }

    /// A texel's plane as g·X = c, with g·X > c behind it and |g·X − c| of order 1 far from it.
    fn equation(&self, plane: DVec3) -> (DVec3, f64) {
        match self.far {
            Some(far) => (plane.truncate().extend(-1.0) / far, 1.0 + plane.z / far),
            None => (plane, 1.0),
        }
    }

    /// Whether a pixel position lies in the picture.
    pub fn holds(&self, u: DVec2) -> bool {
        u.cmpge(DVec2::ZERO).all() && u.cmplt(self.size).all()
    }
}

/// One layer: the plane π·X = 1 of each texel, rows from the top; 0 where empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Pixels.
    pub size: UVec2,
    /// π, 1/m.
    pub planes: Vec<DVec3>,
}

impl Layer {
    /// Creates a layer from texels in the device's format.
    ///
    /// # Panics
    /// If the number of texels is not the number of pixels.
    pub fn new(size: UVec2, texels: &[[f32; 4]]) -> Self {
        assert_eq!(texels.len(), size.element_product() as usize);
        let plane = |t: &[f32; 4]| DVec3::new(t[0].into(), t[1].into(), t[2].into());
        Self { size, planes: texels.iter().map(plane).collect() }
    }

    /// The plane of a texel; 0 outside the picture.
    pub fn at(&self, texel: IVec2) -> DVec3 {
        let inside = texel.cmpge(IVec2::ZERO).all() && texel.cmplt(self.size.as_ivec2()).all();
        if !inside {
            return DVec3::ZERO;
        }
        self.planes[texel.y as usize * self.size.x as usize + texel.x as usize]
    }
}

/// Front and back layer of one class.
pub type Pair = [Layer; 2];

/// An intersection of a ray with a layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerHit {
    /// Pixel position.
    pub u: DVec2,
    /// Depth, m.
    pub depth: f64,
    /// The plane of the texel.
    pub plane: DVec3,
}

/// Relative distance from a plane that counts as rounding: layers hold 32 bits.
const ROUNDING: f64 = 3e-6;

/// As `ROUNDING`, at a ray's origin, which lies on a plane that a neighbouring texel may not share.
const AT_START: f64 = 2e-3;

/// Finds where a ray that starts inside the liquid, in `texel`, leaves the union of the classes;
/// `None` if it leaves the picture first, or does not start inside. A ray that starts on a front
/// behind its back (smoothing makes them cross at rims) leaves immediately: there is no liquid
/// between the two.
pub fn exit(
    view: &ViewSpace,
    classes: &[&Pair],
    o: DVec3,
    d: DVec3,
    texel: IVec2,
) -> Option<LayerHit> {
    let mut last = None;
    for (index, step) in Walk::new(view, o, d, texel).enumerate() {
        let slack = if index == 0 { AT_START } else { ROUNDING };
        // The union of the classes' intervals, from the entry into this texel on.
        let mut end = None;
        for _ in classes {
            for pair in classes {
                let [front, back] = pair.each_ref().map(|layer| layer.at(step.texel));
                let from: f64 = end.map_or(step.begin, |(t, _): (f64, DVec3)| t);
                if let Some((t, plane)) = interval_end(view, [front, back], o, d, from, slack)
                    && (end.is_none() || t > from)
                {
                    end = Some((t, plane));
                }
            }
        }
        let Some((t, plane)) = end else {
            // Left between two texels: uses the last plane inside.
            let crossed = || classes.iter().find_map(|pair| crossed_back(view, pair, o, texel));
            let plane = if index == 0 { crossed() } else { last };
            return plane.map(|plane| hit_at(view, o, d, step.begin, plane));
        };
        if t <= step.end {
            return t.is_finite().then(|| hit_at(view, o, d, t, plane));
        }
        last = Some(plane);
    }
    None
}

/// Finds where a ray meets a layer from the front; `None` if it leaves the picture first. A ray
/// that enters a texel behind its plane, without having crossed it, continues hidden.
pub fn entry(
    view: &ViewSpace,
    layer: &Layer,
    o: DVec3,
    d: DVec3,
    texel: IVec2,
) -> Option<LayerHit> {
    for step in Walk::new(view, o, d, texel) {
        let plane = layer.at(step.texel);
        if plane == DVec3::ZERO {
            continue;
        }
        let (g, c) = view.equation(plane);
        let rate = g.dot(d);
        let t = (c - g.dot(o)) / rate;
        if rate > 0.0 && t >= step.begin * (1.0 - ROUNDING) && t <= step.end {
            return Some(hit_at(view, o, d, t, plane));
        }
    }
    None
}

fn hit_at(view: &ViewSpace, o: DVec3, d: DVec3, t: f64, plane: DVec3) -> LayerHit {
    let x = o + t * d;
    LayerHit { u: view.pixel(x), depth: -x.z, plane }
}

/// The back plane of a texel, if a point on its front is behind it.
fn crossed_back(view: &ViewSpace, pair: &Pair, o: DVec3, texel: IVec2) -> Option<DVec3> {
    let planes = pair.each_ref().map(|layer| layer.at(texel));
    if planes.contains(&DVec3::ZERO) {
        return None;
    }
    let [front, back] = planes.map(|plane| {
        let (g, c) = view.equation(plane);
        g.dot(o) - c
    });
    (front.abs() <= AT_START && back > AT_START).then_some(planes[1])
}

/// Finds where the interval between a front and a back that contains o + t d ends, and by which
/// plane; `None` if it does not contain the point.
fn interval_end(
    view: &ViewSpace,
    planes: [DVec3; 2],
    o: DVec3,
    d: DVec3,
    t: f64,
    slack: f64,
) -> Option<(f64, DVec3)> {
    if planes.contains(&DVec3::ZERO) {
        return None;
    }
    let [front, back] = planes.map(|plane| view.equation(plane));
    let behind = |(g, c): (DVec3, f64)| g.dot(o + t * d) - c;
    if behind(front) < -slack || behind(back) > slack {
        return None;
    }
    let meet = |(g, c): (DVec3, f64), outwards: bool, plane: DVec3| {
        let at = if outwards { (c - g.dot(o)) / g.dot(d) } else { f64::INFINITY };
        (at.max(t), plane)
    };
    let by_front = meet(front, front.0.dot(d) < 0.0, planes[0]);
    let by_back = meet(back, back.0.dot(d) > 0.0, planes[1]);
    Some(if by_front.0 < by_back.0 { by_front } else { by_back })
}

/// Iterates over the texels that a ray crosses, with the ray's parameter range on each.
struct Walk<'a> {
    view: &'a ViewSpace,
    o: DVec3,
    d: DVec3,
    texel: IVec2,
    t: f64,
    t_end: f64,
}

struct Step {
    texel: IVec2,
    begin: f64,
    end: f64,
}

impl<'a> Walk<'a> {
    fn new(view: &'a ViewSpace, o: DVec3, d: DVec3, texel: IVec2) -> Self {
        // At most up to the near plane.
        let t_end = if d.z > 0.0 { (-view.near - o.z) / d.z } else { f64::INFINITY };
        Self { view, o, d, texel, t: 0.0, t_end }
    }

    /// The ray parameter at the column or row border at `at` (pixels) of an axis.
    fn crossing(&self, axis: usize, at: f64) -> f64 {
        let mut u = 0.5 * self.view.size;
        u[axis] = at;
        let border = self.view.omega(u)[axis];
        if self.view.far.is_some() {
            return (border - self.o[axis]) / self.d[axis];
        }
        // The border and the eye span the plane n·X = 0.
        let value = |x: DVec3| x[axis] + border * x.z;
        -value(self.o) / value(self.d)
    }
}

impl Iterator for Walk<'_> {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        let inside = self.texel.cmpge(IVec2::ZERO).all()
            && self.texel.as_dvec2().cmplt(self.view.size).all();
        if !inside || self.t >= self.t_end {
            return None;
        }
        let (mut end, mut texel_step) = (self.t_end, IVec2::ZERO);
        for axis in 0..2 {
            for (border, step) in [(0, -1), (1, 1)] {
                let at = self.crossing(axis, f64::from(self.texel[axis] + border));
                // Crosses this border outwards: the ray's screen position moves towards it.
                let x = self.o + self.t * self.d;
                let motion = match self.view.far {
                    Some(_) => self.d[axis],
                    None => self.d[axis] * -x.z + x[axis] * self.d.z,
                };
                let motion = if axis == 1 { -motion } else { motion };
                if motion * f64::from(step) > 0.0 && at >= self.t && at < end {
                    end = at;
                    texel_step = IVec2::ZERO;
                    texel_step[axis] = step;
                }
            }
        }
        let step = Step { texel: self.texel, begin: self.t, end };
        self.texel += texel_step;
        self.t = if texel_step == IVec2::ZERO { self.t_end } else { end };
        Some(step)
    }
}
