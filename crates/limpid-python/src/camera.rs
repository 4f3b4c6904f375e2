//! Cameras.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use limpid::camera::{self, Lens, View};
use limpid::liquid::Up;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors;
use crate::numbers::{length, number, places, short, vector};

/// Four rows of four numbers.
pub(crate) type Rows = [[f64; 4]; 4];

/// A camera that is aimed at a point: right-handed world, metres, degrees.
///
/// Parameters
/// ----------
/// eye : three numbers
///     Position, m.
/// target : three numbers
///     The point in the middle of the picture, m.
/// fov_y : float
///     Vertical field of view, degrees, above 0 and below 180.
/// up : three numbers
///     The direction that points up in the picture; not parallel to the view.
/// near : float, optional
///     Near plane, m; the eye counts as inside liquid nearer than this.
///
/// Raises
/// ------
/// SceneError
///     Naming the argument, if the values define no view.
#[pyclass(frozen, eq, module = "limpid")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Camera(pub(crate) Kind);

/// Parameters that a camera was made from.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there are few cameras")]
pub(crate) enum Kind {
    Aimed(camera::Camera),
    Matrices { view: View, rows: (Rows, Rows) },
}

/// An argument that may be left out.
type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

fn invalid(error: limpid::Error) -> PyErr {
    errors::raise(error.into())
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(
        signature = (eye, target, fov_y = None, up = None, near = None),
        text_signature = "(eye, target, fov_y=40.0, up=(0.0, 1.0, 0.0), near=None)"
    )]
    fn new(
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        fov_y: Given<'_, '_>,
        up: Given<'_, '_>,
        near: Given<'_, '_>,
    ) -> PyResult<Self> {
        let (eye, target) = (vector("eye", eye)?, vector("target", target)?);
        Self::aimed(eye, target, upwards(up)?, field_of_view(fov_y)?, near, None)
    }

    /// A camera with parallel rays.
    ///
    /// Parameters
    /// ----------
    /// eye, target, up, near : optional
    ///     As for `Camera`.
    /// height : float
    ///     Height of what the picture shows, m.
    #[staticmethod]
    #[pyo3(
        signature = (eye, target, height, up = None, near = None),
        text_signature = "(eye, target, height, up=(0.0, 1.0, 0.0), near=None)"
    )]
    fn orthographic(
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        height: &Bound<'_, PyAny>,
        up: Given<'_, '_>,
        near: Given<'_, '_>,
    ) -> PyResult<Self> {
        let (eye, target) = (vector("eye", eye)?, vector("target", target)?);
        let height = length("height", height)?;
        // As in a scene file, where the height decides the nearest field of view.
        let distance = eye.distance(target);
        let fov_y = 2.0 * (0.5 * height / distance.max(1e-300)).atan().to_degrees();
        let lens = Some(Lens::Orthographic { height });
        Self::aimed(eye, target, upwards(up)?, fov_y as f32, near, lens)
    }

    /// A camera on a sphere around its target.
    ///
    /// Parameters
    /// ----------
    /// target : three numbers
    ///     The point in the middle of the picture, m.
    /// distance : float
    ///     Of the eye from the target, m.
    /// azimuth : float
    ///     Direction of the eye, degrees: where y is up, from +z towards +x; where z is up, from -y
    ///     towards +x.
    /// elevation : float
    ///     Height of the eye above the horizon, degrees, -90 to 90.
    /// fov_y, up : optional
    ///     As for `Camera`.
    #[staticmethod]
    #[pyo3(
        signature = (target, distance, azimuth = None, elevation = None, fov_y = None, up = None),
        text_signature = "(target, distance, azimuth=25.0, elevation=20.0, fov_y=40.0, up=(0.0, 1.0, 0.0))"
    )]
    fn orbit(
        target: &Bound<'_, PyAny>,
        distance: &Bound<'_, PyAny>,
        azimuth: Given<'_, '_>,
        elevation: Given<'_, '_>,
        fov_y: Given<'_, '_>,
        up: Given<'_, '_>,
    ) -> PyResult<Self> {
        let (target, distance) = (vector("target", target)?, length("distance", distance)?);
        let direction = Direction::new(azimuth, elevation, up)?;
        let eye = target + distance * direction.back;
        Self::aimed(eye, target, direction.up, field_of_view(fov_y)?, None, None)
    }

    /// The camera that sees all points from a direction, and comes as near as it can.
    ///
    /// Parameters
    /// ----------
    /// points : (n, 3) array of floats, or Particles
    ///     m.
    /// azimuth, elevation, fov_y, up : optional
    ///     As for `Camera.orbit`.
    /// size : two integers
    ///     Width and height of the picture, pixels.
    #[staticmethod]
    #[pyo3(
        signature = (points, azimuth = None, elevation = None, fov_y = None, up = None, size = (1024, 768)),
        text_signature = "(points, azimuth=25.0, elevation=20.0, fov_y=40.0, up=(0.0, 1.0, 0.0), size=(1024, 768))"
    )]
    fn fit(
        points: &Bound<'_, PyAny>,
        azimuth: Given<'_, '_>,
        elevation: Given<'_, '_>,
        fov_y: Given<'_, '_>,
        up: Given<'_, '_>,
        size: (u32, u32),
    ) -> PyResult<Self> {
        let points = places("points", points)?;
        let direction = Direction::new(azimuth, elevation, up)?;
        let fov_y = field_of_view(fov_y)?;
        let aspect = f64::from(size.0.max(1)) / f64::from(size.1.max(1));
        let (eye, target) = direction.fit(&points, f64::from(fov_y), aspect);
        Self::aimed(eye, target, direction.up, fov_y, None, None)
    }

    /// The camera of a program that has matrices, which multiply columns. It may be perspective or orthographic,
    /// off-centre, and of reversed depth.
    ///
    /// Parameters
    /// ----------
    /// view : (4, 4) array
    ///     From the world to view space: x right, y up, looking down -z.
    /// projection : (4, 4) array
    ///     From view space to clip space.
    /// opengl : bool
    ///     Whether depth in clip space is from -1 to 1, and not from 0 to 1 as in WebGPU, Vulkan, Metal
    ///     and DirectX.
    #[staticmethod]
    #[pyo3(signature = (view, projection, *, opengl = false))]
    fn from_matrices(
        view: &Bound<'_, PyAny>,
        projection: &Bound<'_, PyAny>,
        opengl: bool,
    ) -> PyResult<Self> {
        let (view, projection) = (rows("view", view)?, rows("projection", projection)?);
        let matrix = |rows: &Rows| DMat4::from_cols_array_2d(rows).transpose();
        let mut clip_from_view = matrix(&projection);
        let mut rows = projection;
        if opengl {
            // From depths of −1 to 1 to those of 0 to 1.
            for column in 0..4 {
                rows[2][column] = 0.5 * (projection[2][column] + projection[3][column]);
            }
            clip_from_view = matrix(&rows);
        }
        let seen = View::from_matrices(matrix(&view), clip_from_view).map_err(invalid)?;
        Ok(Self(Kind::Matrices { view: seen, rows: (view, rows) }))
    }

    /// Position, m.
    #[getter]
    fn eye(&self) -> (f64, f64, f64) {
        match self.0 {
            Kind::Aimed(camera) => camera.eye.into(),
            Kind::Matrices { view, .. } => view.eye.into(),
        }
    }

    /// The point in the middle of the picture, m; `None` for a camera from matrices.
    #[getter]
    fn target(&self) -> Option<(f64, f64, f64)> {
        self.camera().map(|camera| camera.target.into())
    }

    /// The direction that points up in the picture; `None` for a camera from matrices.
    #[getter]
    fn up(&self) -> Option<(f64, f64, f64)> {
        self.camera().map(|camera| camera.up.to_array().map(short).into())
    }

    /// Vertical field of view, degrees; `None` for parallel rays and cameras from matrices.
    #[getter]
    fn fov_y(&self) -> Option<f64> {
        self.camera().filter(|camera| camera.lens.is_none()).map(|camera| short(camera.fov_y))
    }

    /// Height of what a picture with parallel rays shows, m; otherwise `None`.
    #[getter]
    fn height(&self) -> Option<f64> {
        match self.camera()?.lens {
            Some(Lens::Orthographic { height }) => Some(height),
            _ => None,
        }
    }

    /// Near plane, m, if it was given; see `Camera`.
    #[getter]
    fn near(&self) -> Option<f64> {
        match self.0 {
            Kind::Aimed(camera) => camera.near.map(short),
            Kind::Matrices { view, .. } => view.near.map(short),
        }
    }

    /// The camera turned by `degrees` about its target, counterclockwise as seen from above.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     For a camera from matrices, which has no target.
    fn turned(&self, degrees: f64) -> PyResult<Self> {
        let camera = self.with_target()?.turned(degrees.to_radians());
        camera.check().map_err(invalid)?;
        Ok(Self(Kind::Aimed(camera)))
    }

    /// The camera at its place, aimed at another point.
    ///
    /// Parameters
    /// ----------
    /// target : three numbers
    ///     The point, m.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     For a camera from matrices.
    fn look_at(&self, target: &Bound<'_, PyAny>) -> PyResult<Self> {
        let camera = camera::Camera { target: vector("target", target)?, ..self.with_target()? };
        camera.check().map_err(invalid)?;
        Ok(Self(Kind::Aimed(camera)))
    }

    fn __repr__(&self) -> String {
        let three = |x: DVec3| format!("({}, {}, {})", x.x, x.y, x.z);
        let single = |x: Vec3| format!("({}, {}, {})", x.x, x.y, x.z);
        match self.0 {
            Kind::Aimed(camera) => {
                let (eye, target) = (three(camera.eye), three(camera.target));
                let up = match camera.up == Vec3::Y {
                    true => String::new(),
                    false => format!(", up={}", single(camera.up)),
                };
                let near = camera.near.map_or(String::new(), |near| format!(", near={near}"));
                match camera.lens {
                    Some(Lens::Orthographic { height }) => {
                        format!("Camera.orthographic({eye}, {target}, {height}{up}{near})")
                    }
                    _ => format!("Camera({eye}, {target}, fov_y={}{up}{near})", camera.fov_y),
                }
            }
            Kind::Matrices { rows: (view, projection), .. } => {
                format!("Camera.from_matrices({view:?}, {projection:?})")
            }
        }
    }

    fn __hash__(&self) -> u64 {
        let (x, y, z) = self.eye();
        // Zeros of either sign are equal.
        let [x, y, z] = [x, y, z].map(|x| (x + 0.0).to_bits());
        x ^ y.rotate_left(21) ^ z.rotate_left(42)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, pyo3::types::PyTuple>)> {
        let class = py.get_type::<Self>();
        match self.0 {
            Kind::Aimed(camera) => {
                let maker = class.getattr("_parse")?;
                Ok((maker, (camera.to_string(),).into_pyobject(py)?))
            }
            Kind::Matrices { rows, .. } => {
                Ok((class.getattr("from_matrices")?, rows.into_pyobject(py)?))
            }
        }
    }

    /// The camera of a text as the program takes it: `eye=1,2,3 target=0,0,0 fov_y=40`.
    #[staticmethod]
    fn _parse(text: &str) -> PyResult<Self> {
        Ok(Self(Kind::Aimed(text.parse().map_err(invalid)?)))
    }
}

impl Camera {
    fn aimed(
        eye: DVec3,
        target: DVec3,
        up: DVec3,
        fov_y: f32,
        near: Given<'_, '_>,
        lens: Option<Lens>,
    ) -> PyResult<Self> {
        let near = near.map(|near| length("near", near)).transpose()?.map(|near| near as f32);
        let camera = camera::Camera { eye, target, up: up.as_vec3(), fov_y, near, lens };
        camera.check().map_err(invalid)?;
        Ok(Self(Kind::Aimed(camera)))
    }

    fn with_target(&self) -> PyResult<camera::Camera> {
        let no_target = || PyValueError::new_err("a camera from matrices has no target");
        self.camera().ok_or_else(no_target)
    }

    /// The aimed camera, if it is one.
    pub(crate) fn camera(&self) -> Option<camera::Camera> {
        if let Kind::Aimed(camera) = self.0 { Some(camera) } else { None }
    }

    pub(crate) fn view(&self) -> View {
        match self.0 {
            Kind::Aimed(camera) => View::from(&camera),
            Kind::Matrices { view, .. } => view,
        }
    }

    /// The axis that points up in the camera's world, if its own direction of up tells. Straight views from above are
    /// taken for views from the front where these are as likely.
    pub(crate) fn likely_up(&self) -> Option<Up> {
        const ALONG: f64 = 0.9;
        let up = self.camera()?.up.as_dvec3().normalize_or_zero();
        if up.z > ALONG { Some(Up::Z) } else { (up.y > ALONG).then_some(Up::Y) }
    }

    /// The camera in a world of y up, if this axis points up in its own.
    pub(crate) fn to_y_up(self, up: Up) -> Self {
        self.rotated(up, |x| DVec3::new(x.x, x.z, -x.y))
    }

    /// The camera in a world where this axis points up, if its own has y up.
    pub(crate) fn y_up_to(self, up: Up) -> Self {
        self.rotated(up, |x| DVec3::new(x.x, -x.z, x.y))
    }

    fn rotated(self, up: Up, rotate: impl Fn(DVec3) -> DVec3) -> Self {
        if up == Up::Y {
            return self;
        }
        // Without zeros that have a sign.
        let rotate = |x| rotate(x) + DVec3::ZERO;
        Self(match self.0 {
            Kind::Aimed(camera) => Kind::Aimed(camera::Camera {
                eye: rotate(camera.eye),
                target: rotate(camera.target),
                up: rotate(camera.up.as_dvec3()).as_vec3(),
                ..camera
            }),
            Kind::Matrices { view, rows: (view_rows, projection) } => {
                // A rotation's inverse is its transpose: axes of the new world in the old one.
                let new_from_old =
                    DMat3::from_cols(rotate(DVec3::X), rotate(DVec3::Y), rotate(DVec3::Z));
                let turned = View {
                    eye: rotate(view.eye),
                    view_from_world: view.view_from_world * new_from_old.transpose(),
                    ..view
                };
                let old = DMat4::from_cols_array_2d(&view_rows).transpose();
                let new = old * DMat4::from_mat3(new_from_old.transpose());
                let rows = new.transpose().to_cols_array_2d();
                Kind::Matrices { view: turned, rows: (rows, projection) }
            }
        })
    }
}

/// The argument `up`.
fn upwards(up: Given<'_, '_>) -> PyResult<DVec3> {
    up.map_or(Ok(DVec3::Y), |up| vector("up", up))
}

/// The argument `fov_y`.
fn field_of_view(fov_y: Given<'_, '_>) -> PyResult<f32> {
    let (range, expected) = (1e-4..=179.999, "above 0 and below 180 degrees");
    Ok(fov_y.map_or(Ok(40.0), |fov_y| number("fov_y", fov_y, &range, expected))? as f32)
}

/// A matrix of an argument.
fn rows(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Rows> {
    let problem = |_| errors::scene_error(format!("{name}: expected a matrix of shape (4, 4)"));
    value.extract().map_err(problem)
}

/// The direction that a camera looks from.
struct Direction {
    /// Towards the eye.
    back: DVec3,
    right: DVec3,
    /// The direction that points up in the picture: that of the world, but for a view from straight above or below.
    up: DVec3,
}

impl Direction {
    fn new(azimuth: Given<'_, '_>, elevation: Given<'_, '_>, up: Given<'_, '_>) -> PyResult<Self> {
        let angle = |name, given: Given<'_, '_>, default: f64, most: f64| {
            let expected = format!("degrees, {} to {most}", -most);
            given.map_or(Ok(default), |angle| number(name, angle, &(-most..=most), &expected))
        };
        let (sin, cos) = angle("azimuth", azimuth, 25.0, 1e6)?.to_radians().sin_cos();
        let (high, level) = angle("elevation", elevation, 20.0, 90.0)?.to_radians().sin_cos();
        let up = upwards(up)?;
        let turn = DQuat::from_rotation_arc(DVec3::Y, up.normalize_or(DVec3::Y));
        let is_straight = level < 1e-6;
        let ahead = turn * DVec3::new(-high * sin, level, -high * cos);
        Ok(Self {
            back: turn * DVec3::new(level * sin, high, level * cos),
            right: turn * DVec3::new(cos, 0.0, -sin),
            up: if is_straight { ahead } else { up },
        })
    }

    /// The nearest eye from which a picture with this field of view, degrees, and this ratio of its sides shows all
    /// points, with a margin, and its target among them.
    ///
    /// A point is left of the right edge of the picture if x - tz is less for it than for the eye, where t is the tangent of
    /// half the field of view and z grows towards the eye; so the points with the extreme values decide.
    fn fit(&self, points: &[DVec3], fov_y: f64, aspect: f64) -> (DVec3, DVec3) {
        /// Share of the picture's sides that the points may take.
        const SHARE: f64 = 0.95;
        let above = self.back.cross(self.right);
        let tangent = SHARE * (0.5 * fov_y).to_radians().tan();
        let most = |f: &dyn Fn(DVec3) -> f64| points.iter().map(|&x| f(x)).fold(f64::MIN, f64::max);
        let along = |axis: DVec3, tangent: f64| {
            let high = most(&|x| x.dot(axis) + tangent * x.dot(self.back));
            let low = most(&|x| -x.dot(axis) + tangent * x.dot(self.back));
            (0.5 * (high - low), 0.5 * (high + low) / tangent)
        };
        let (x, far_x) = along(self.right, tangent * aspect);
        let (y, far_y) = along(above, tangent);
        let nearest = most(&|x| x.dot(self.back));
        let farthest = -most(&|x| -x.dot(self.back));
        let middle = 0.5 * (nearest + farthest);
        // Far enough for the eye and the target to differ in 64-bit floats.
        let least = (1e-9 * points[0].abs().max_element()).max(1e-9);
        let z = far_x.max(far_y).max(middle + least);
        let level = x * self.right + y * above;
        (level + z * self.back, level + middle * self.back)
    }
}
