//! Camera paths: camera keys in time, and their smooth interpolation.

use std::path::Path;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::camera_axes::CameraAxes;
use crate::error::{Error, Result, toml_error};
use crate::files;
use crate::output::{self, FileKind};
use limpid::camera::{Camera, is_position};
use limpid::liquid::Up;

/// A camera path through keys, which have a field of view and no other lens.
///
/// The file format, in TOML:
///
/// ```toml
/// [[key]]
/// time = 0.0               # s
/// eye = [3.0, 2.0, 4.0]    # m
/// target = [0.0, 1.0, 0.0] # m
/// up = [0.0, 1.0, 0.0]     # optional, with the axis that is up as the default
/// fov_y = 40.0             # degrees, optional, with this default
///
/// [[key]]
/// time = 2.5
/// eye = [-3.0, 2.0, 4.0]
/// target = [0.0, 1.0, 0.0]
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CameraPath {
    /// The keys, by ascending time.
    pub keys: Vec<Key>,
}

/// A camera at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// The time, s.
    pub time: f64,
    /// The camera. Its near plane, if given, applies until the next key.
    pub camera: Camera,
}

// The file format.

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PathFile {
    /// The axis that points up where the keys count; otherwise as of a scene's camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    up_axis: Option<Up>,
    #[serde(default)]
    key: Vec<KeyFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyFile {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    time: Option<f64>,
    eye: DVec3,
    target: DVec3,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    up: Option<Vec3>,
    #[serde(default = "fov_y")]
    fov_y: f32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    near: Option<f32>,
}

fn fov_y() -> f32 {
    40.0
}

/// The times and cameras of the keys in a file, which errors call `origin`; axes as for [`CameraPath::load_for`].
fn parse_keys(
    text: &str,
    origin: &str,
    files: Up,
    told: Option<Up>,
) -> Result<Vec<(Option<f64>, Camera)>> {
    let file: PathFile = toml::from_str(text).map_err(|e| toml_error(text, origin, &e))?;
    // All keys count in the same axes.
    let first = CameraAxes::in_file(file.up_axis, file.key.iter().find_map(|key| key.up));
    let axis = told.or(first.up);
    let keys = file.key.into_iter().map(|key| {
        let KeyFile { time, eye, target, up, fov_y, near } = key;
        let axes = CameraAxes { up: axis, is_level: up.is_none() };
        let up = up.unwrap_or(Vec3::Y);
        let camera = Camera { eye, target, up, fov_y, near, lens: None };
        (time, axes.to_world(camera, files))
    });
    Ok(keys.collect())
}

/// Reads the cameras of a path file's keys, for pictures of one frame from each of them. Their times do not count and may
/// be left out. Axes as for [`CameraPath::load_for`].
///
/// # Errors
/// As [`CameraPath::load`], but for the times.
pub fn load_views(path: &Path, files: Up, told: Option<Up>) -> Result<Vec<Camera>> {
    let origin = path.display().to_string();
    let keys = parse_keys(&files::read_text(path)?, &origin, files, told)?;
    let cameras: Vec<_> = keys.into_iter().map(|(_, camera)| camera).collect();
    let mut numbered = (1..).zip(&cameras);
    let checked = numbered.try_for_each(|(number, camera)| check_camera(number, camera));
    checked.and_then(|()| check_count(cameras.len())).map_err(|e| within(&origin, e))?;
    Ok(cameras)
}

/// The error of a key, counted from 1.
fn fail(number: usize, problem: String) -> Error {
    Error::Scene { origin: format!("[[key]] {number}"), problem }
}

/// The error of a part of a file.
fn within(file: &str, error: Error) -> Error {
    match error {
        Error::Scene { origin: part, problem } => {
            Error::Scene { origin: file.into(), problem: format!("{part}: {problem}") }
        }
        other => other,
    }
}

fn check_camera(number: usize, camera: &Camera) -> Result<()> {
    match camera.check() {
        Err(limpid::Error::Invalid { problem, .. }) => Err(fail(number, problem)),
        _ => Ok(()),
    }
}

fn check_count(keys: usize) -> Result<()> {
    if keys == 0 {
        let problem = "none; a camera path needs at least one".into();
        return Err(Error::Scene { origin: "[[key]]".into(), problem });
    }
    Ok(())
}

/// The keys of a camera path.
pub const FILE_KIND: FileKind =
    FileKind::new("a camera path", |file| CameraPath::load(file.path).is_ok());

impl CameraPath {
    /// Reads a path file.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Scene`] naming the file, the line or key, and the cause.
    pub fn load(path: &Path) -> Result<Self> {
        Self::parse(&files::read_text(path)?, &path.display().to_string())
    }

    /// As [`CameraPath::load`], of keys that count in the axes of particle files where `files` points up, unless the file
    /// says other axes, or `told` does.
    ///
    /// # Errors
    /// As [`CameraPath::load`].
    pub fn load_for(path: &Path, files: Up, told: Option<Up>) -> Result<Self> {
        let text = files::read_text(path)?;
        Self::parse_for(&text, &path.display().to_string(), files, told)
    }

    /// Parses the text of a path file, which errors call `origin`.
    ///
    /// # Errors
    /// As [`CameraPath::load`].
    pub fn parse(text: &str, origin: &str) -> Result<Self> {
        Self::parse_for(text, origin, Up::Y, None)
    }

    fn parse_for(text: &str, origin: &str, files: Up, told: Option<Up>) -> Result<Self> {
        let keys = parse_keys(text, origin, files, told)?;
        let timed = (1..).zip(keys).map(|(number, (time, camera))| {
            let missing = || fail(number, "without a time, which only views may lack".into());
            Ok(Key { time: time.ok_or_else(missing)?, camera })
        });
        let checked = timed.collect::<Result<_>>().and_then(|keys| {
            let path = Self { keys };
            path.check()?;
            Ok(path)
        });
        checked.map_err(|e| within(origin, e))
    }

    /// Writes a file that [`CameraPath::load`] reads back bit-identically.
    ///
    /// # Errors
    /// As [`CameraPath::check`] and [`output::write_atomically`].
    pub fn save(&self, path: &Path) -> Result<()> {
        let text = self.to_toml()?;
        output::write_atomically(path, FILE_KIND, |out| {
            std::io::Write::write_all(out, text.as_bytes())
        })
    }

    /// The text of a path file, which [`CameraPath::parse`] reads back bit-identically.
    ///
    /// # Errors
    /// As [`CameraPath::check`].
    pub fn to_toml(&self) -> Result<String> {
        self.check()?;
        let key = self.keys.iter().map(|&Key { time, camera }| {
            let Camera { eye, target, up, fov_y, near, lens: _ } = camera;
            KeyFile { time: Some(time), eye, target, up: Some(up), fov_y, near }
        });
        let first = self.keys.first().map(|key| key.camera.up);
        let up_axis = first.and_then(|up| CameraAxes::default().up_axis(up));
        let file = PathFile { up_axis, key: key.collect() };
        toml::to_string(&file).map_err(|e| Error::Usage(format!("the camera path: {e}")))
    }

    /// Checks that there is a key, that the times are finite and ascending, and every key's camera.
    ///
    /// # Errors
    /// [`Error::Scene`] naming the first invalid key, counted from 1.
    pub fn check(&self) -> Result<()> {
        let mut before = f64::NEG_INFINITY;
        for (number, Key { time, camera }) in (1..).zip(&self.keys) {
            if !time.is_finite() {
                return Err(fail(number, format!("a time of {time} s; expected a finite one")));
            }
            if *time <= before {
                let problem = format!("{time} s does not come after the key before, {before} s");
                return Err(fail(number, problem));
            }
            check_camera(number, camera)?;
            before = *time;
        }
        check_count(self.keys.len())
    }

    /// Time of the last key, s, or 0 if that is negative or there is none.
    pub fn duration(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.time.max(0.0))
    }

    /// The camera at `time`, s: a key's camera at its time, the first key's before all, the last key's
    /// after all, and between two keys a cubic in eye, target, up and field of view.
    ///
    /// The cubics are the Catmull-Rom spline whose knots are the times of the keys (E. Catmull, R.
    /// Rom: A class of local interpolating splines, 1974; P. Barry, R. Goldman: A recursive
    /// evaluation algorithm for a class of Catmull-Rom splines, 1988), here in Hermite form: the
    /// velocity at a key is that of the parabola through it and its two neighbours, and at the ends that
    /// of the parabola through the first or last three keys. Position and velocity are therefore
    /// continuous at any spacing of the keys, two keys are joined by a straight line, and motion at
    /// constant velocity or constant acceleration is reproduced exactly. (With tangents for evenly
    /// spaced keys, the camera would accelerate before a long interval and overshoot in a short one.)
    ///
    /// Where the cubic defines no view, because the eye passes through the target or up becomes parallel
    /// to the view direction, the affected direction is that of the nearest key.
    ///
    /// # Panics
    /// If there are no keys, which [`CameraPath::check`] reports.
    pub fn at(&self, time: f64) -> Camera {
        let next = self.keys.partition_point(|key| key.time <= time);
        let Some(i) = next.checked_sub(1) else { return self.keys[0].camera };
        let Some(b) = self.keys.get(next) else { return self.keys[i].camera };
        let a = &self.keys[i];
        if a.time == time {
            return a.camera;
        }
        let duration = b.time - a.time;
        let u = (time - a.time) / duration;
        let (from, to) = (a.values(), b.values());
        let (start, end) = (self.velocity(i), self.velocity(next));
        let [ex, ey, ez, tx, ty, tz, ux, uy, uz, fov_y] = std::array::from_fn(|c| {
            let difference = to[c] - from[c];
            // The Hermite cubic as an offset from the straight line, so that only small numbers are
            // multiplied far from the origin.
            let bend = (1.0 - u) * (start[c] * duration - difference)
                - u * (end[c] * duration - difference);
            from[c] + u * (difference + (1.0 - u) * bend)
        });
        // The cubic may overshoot the keys, but the field of view must stay valid.
        let (low, high) = self.keys.iter().fold((180f64, 0f64), |(low, high), key| {
            let fov_y = f64::from(key.camera.fov_y);
            (low.min(fov_y), high.max(fov_y))
        });
        let camera = Camera {
            eye: DVec3::new(ex, ey, ez),
            target: DVec3::new(tx, ty, tz),
            up: DVec3::new(ux, uy, uz).as_vec3(),
            fov_y: fov_y.clamp(0.5 * low, 0.5 * (high + 180.0)) as f32,
            near: a.camera.near,
            lens: None,
        };
        let nearest = if u < 0.5 { a } else { b };
        repaired(camera, &nearest.camera)
    }

    /// Derivatives of the [`Key::values`] at a key, per second.
    fn velocity(&self, key: usize) -> [f64; 10] {
        let last = self.keys.len() - 1;
        // Mean velocities of the two adjacent intervals.
        let mean = |i: usize| {
            let (a, b) = (&self.keys[i], &self.keys[i + 1]);
            let (from, to) = (a.values(), b.values());
            let duration = b.time - a.time;
            (duration, std::array::from_fn::<f64, 10, _>(|c| (to[c] - from[c]) / duration))
        };
        if last == 1 {
            return mean(0).1;
        }
        let middle = key.clamp(1, last - 1);
        let (before, v) = mean(middle - 1);
        let (after, w) = mean(middle);
        std::array::from_fn(|c| {
            let change = (w[c] - v[c]) / (before + after);
            match key {
                0 => v[c] - before * change,
                _ if key == last => w[c] + after * change,
                _ => v[c] + before * change,
            }
        })
    }
}

impl Key {
    /// The interpolated values: eye, target, up, field of view.
    fn values(&self) -> [f64; 10] {
        let Camera { eye, target, up, fov_y, .. } = self.camera;
        let up = up.as_dvec3();
        [eye.x, eye.y, eye.z, target.x, target.y, target.z, up.x, up.y, up.z, f64::from(fov_y)]
    }
}

/// Returns the camera, with the parts that define no view replaced by those of `key`.
fn repaired(camera: Camera, key: &Camera) -> Camera {
    if camera.check().is_ok() {
        return camera;
    }
    let mut camera = camera;
    let reach = key.target - key.eye;
    // Below this, the distance of the two is rounding error.
    let least = 1e-9 * reach.length();
    if is_position(camera.eye) && camera.eye.distance(camera.target) <= least {
        camera.target = camera.eye + reach;
    }
    let view = (camera.target - camera.eye).normalize_or(DVec3::NEG_Z);
    let ups = [camera.up, key.up, view.any_orthonormal_vector().as_vec3()];
    let mut cameras = ups.into_iter().map(|up| Camera { up, ..camera });
    cameras.find(|camera| camera.check().is_ok()).unwrap_or(*key)
}
