//! The camera and its path.

use limpid::camera::{Camera, Lens};
use limpid_io::camera_path::{CameraPath, Key};

/// The camera and its path.
#[derive(Debug)]
pub(crate) struct Eye {
    pub(crate) camera: Camera,
    pub(crate) path: CameraPath,
    /// Whether playback takes the camera along the path.
    pub(crate) follow: bool,
    /// Time along the path of a still, s.
    pub(crate) path_seconds: f64,
}

impl Eye {
    pub(crate) fn new(camera: Camera) -> Self {
        Self { camera, path: CameraPath::default(), follow: false, path_seconds: 0.0 }
    }

    /// Sets the camera, which then leaves its path. Invalid cameras are ignored.
    pub(crate) fn set(&mut self, camera: Camera) {
        if camera != self.camera && camera.check().is_ok() {
            self.camera = camera;
            self.follow = false;
        }
    }

    /// Whether the camera follows a path.
    pub(crate) fn is_led(&self) -> bool {
        self.follow && !self.path.keys.is_empty()
    }

    /// Time one second after the last key, s.
    pub(crate) fn after_keys(&self) -> f64 {
        self.path.keys.last().map_or(0.0, |key| key.time + 1.0)
    }

    /// Adds a key at a time, s.
    pub(crate) fn add_key(&mut self, time: f64) {
        self.path.keys.retain(|key| key.time != time);
        self.path.keys.push(Key { time, camera: self.camera });
        self.order_keys();
    }

    /// Removes the key of an index.
    pub(crate) fn remove_key(&mut self, i: usize) {
        self.path.keys.remove(i);
        self.follow &= !self.path.keys.is_empty();
    }

    /// Sorts the keys and removes duplicate times.
    pub(crate) fn order_keys(&mut self) {
        self.path.keys.sort_by(|a, b| a.time.total_cmp(&b.time));
        self.path.keys.dedup_by(|a, b| a.time == b.time);
    }
}

/// A camera with parallel rays that shows this height, m.
#[must_use]
pub(crate) fn with_height(camera: &Camera, height: f64) -> Camera {
    let tangent = 0.5 * height / camera.eye.distance(camera.target).max(f64::MIN_POSITIVE);
    // That of a lens that shows about as much.
    let fov_y = (2.0 * tangent.atan().to_degrees()) as f32;
    Camera { fov_y, lens: Some(Lens::Orthographic { height }), ..*camera }
}
