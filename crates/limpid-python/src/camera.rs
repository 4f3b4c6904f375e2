//! Cameras.

use glam::{DMat3, DMat4, DVec3, Vec3};
use limpid::camera::{self, Lens, View};
use limpid::liquid::Up;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors;

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
///     If the values define no view.
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

fn invalid(error: limpid::Error) -> PyErr {
    errors::raise(error.into())
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (eye, target, fov_y = 40.0, up = [0.0, 1.0, 0.0], near = None))]
    fn new(
        eye: [f64; 3],
        target: [f64; 3],
        fov_y: f64,
        up: [f64; 3],
        near: Option<f64>,
    ) -> PyResult<Self> {
        Self::aimed(eye, target, up, fov_y as f32, near, None)
    }

    /// A camera with parallel rays; `height` is that of what the picture shows, m.
    #[staticmethod]
    #[pyo3(signature = (eye, target, height, up = [0.0, 1.0, 0.0], near = None))]
    fn orthographic(
        eye: [f64; 3],
        target: [f64; 3],
        height: f64,
        up: [f64; 3],
        near: Option<f64>,
    ) -> PyResult<Self> {
        if !(height > 0.0 && height < 1e18) {
            return Err(errors::scene_error(format!(
                "camera: height is {height}; expected above 0"
            )));
        }
        // As in a scene file, where the height decides the nearest field of view.
        let distance = DVec3::from(eye).distance(target.into());
        let fov_y = 2.0 * (0.5 * height / distance.max(1e-300)).atan().to_degrees();
        Self::aimed(eye, target, up, fov_y as f32, near, Some(Lens::Orthographic { height }))
    }

    /// The camera of a program that has matrices, of shape (4, 4), which multiply columns: `view` takes the world to
    /// view space (x right, y up, looking down -z), `projection` takes that to clip space as in WebGPU, Vulkan, Metal
    /// and DirectX (depth from 0 to 1), or with `opengl` from -1 to 1. It may be perspective or orthographic,
    /// off-centre, and of reversed depth.
    #[staticmethod]
    #[pyo3(signature = (view, projection, *, opengl = false))]
    fn from_matrices(view: Rows, projection: Rows, opengl: bool) -> PyResult<Self> {
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
        self.camera().map(|camera| camera.up.as_dvec3().into())
    }

    /// Vertical field of view, degrees; `None` for parallel rays and cameras from matrices.
    #[getter]
    fn fov_y(&self) -> Option<f64> {
        self.camera().filter(|camera| camera.lens.is_none()).map(|camera| camera.fov_y.into())
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
            Kind::Aimed(camera) => camera.near.map(f64::from),
            Kind::Matrices { view, .. } => view.near.map(f64::from),
        }
    }

    /// The camera turned by `degrees` about its target, counterclockwise as seen from above.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     For a camera from matrices, which has no target.
    fn turned(&self, degrees: f64) -> PyResult<Self> {
        let no_target =
            || PyValueError::new_err("a camera from matrices has no target to turn about");
        let camera = self.camera().ok_or_else(no_target)?.turned(degrees.to_radians());
        camera.check().map_err(invalid)?;
        Ok(Self(Kind::Aimed(camera)))
    }

    fn __repr__(&self) -> String {
        let three = |x: DVec3| format!("({}, {}, {})", x.x, x.y, x.z);
        match self.0 {
            Kind::Aimed(camera) => {
                let (eye, target) = (three(camera.eye), three(camera.target));
                let up = match camera.up == Vec3::Y {
                    true => String::new(),
                    false => format!(", up={}", three(camera.up.as_dvec3())),
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
        eye: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
        fov_y: f32,
        near: Option<f64>,
        lens: Option<Lens>,
    ) -> PyResult<Self> {
        let camera = camera::Camera {
            eye: eye.into(),
            target: target.into(),
            up: DVec3::from(up).as_vec3(),
            fov_y,
            near: near.map(|near| near as f32),
            lens,
        };
        camera.check().map_err(invalid)?;
        Ok(Self(Kind::Aimed(camera)))
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
