//! Camera controls for pointer and keys: all moves are in proportion to the view, so that a drop of a
//! millimetre and a bay of ten kilometres feel the same.

use glam::{DQuat, DVec2, DVec3, Vec3};

use crate::model::eye::with_height;
use limpid::camera::{Camera, Lens};

/// Least angle between the view direction and `up`, radians.
const MIN_POLE_ANGLE: f64 = 0.01;

/// Range of the distance from eye to target, m, for 32-bit depths and 64-bit positions.
const DISTANCE: std::ops::RangeInclusive<f64> = 1e-5..=1e7;

/// The axes of a camera's picture: right, up, and back towards the eye.
pub fn axes(camera: &Camera) -> [DVec3; 3] {
    let back = (camera.eye - camera.target).normalize_or(DVec3::Z);
    let right = unit_up(camera).cross(back).normalize_or(back.any_orthonormal_vector());
    [right, back.cross(right), back]
}

/// Rotates the eye about the target by `angles` to the right and up, radians. Distance and horizon do not
/// change, and the eye stops at the poles.
#[must_use]
pub fn orbit(camera: &Camera, angles: DVec2) -> Camera {
    let offset = rotated(camera, camera.eye - camera.target, angles);
    Camera { eye: camera.target + offset, ..*camera }
}

/// Rotates the view about the eye by `angles` to the right and up, radians.
#[must_use]
pub fn look(camera: &Camera, angles: DVec2) -> Camera {
    let offset = rotated(camera, camera.eye - camera.target, -angles);
    Camera { target: camera.eye - offset, ..*camera }
}

/// Moves eye and target parallel to the picture, by `shift` of its height to the right and up, measured
/// at the target's distance.
#[must_use]
pub fn pan(camera: &Camera, shift: DVec2) -> Camera {
    let [right, up, _] = axes(camera);
    translated(camera, 2.0 * half_height(camera) * (shift.x * right + shift.y * up))
}

/// Moves the camera by `amount` e-foldings towards, or if negative away from, the point under `cursor` at
/// the target's distance. `cursor` is relative to the picture's centre, in half heights, right and up. A camera with
/// parallel rays shows less or more instead, and moves aside.
#[must_use]
pub fn zoom(camera: &Camera, amount: f64, cursor: DVec2) -> Camera {
    let [right, up, _] = axes(camera);
    let fixed = camera.target + half_height(camera) * (cursor.x * right + cursor.y * up);
    if let Some(Lens::Orthographic { height }) = camera.lens {
        let (wanted, range) = (height * (-amount).exp(), (*DISTANCE.start(), *DISTANCE.end()));
        let wanted = wanted.clamp(range.0.min(height), range.1.max(height));
        let aside = (1.0 - wanted / height) * (fixed - camera.target);
        return with_height(&translated(camera, aside), wanted);
    }
    let distance = camera.eye.distance(camera.target);
    let factor = (distance * (-amount).exp()).clamp(*DISTANCE.start(), *DISTANCE.end()) / distance;
    Camera {
        eye: fixed + factor * (camera.eye - fixed),
        target: fixed + factor * (camera.target - fixed),
        ..*camera
    }
}

/// Moves eye and target by `distance` to the right, up and ahead, m.
#[must_use]
pub fn fly(camera: &Camera, distance: DVec3) -> Camera {
    let [right, up, back] = axes(camera);
    translated(camera, distance.x * right + distance.y * up - distance.z * back)
}

/// Moves eye and target so that a box fills the picture, with the same view direction. `aspect` is width
/// over height.
#[must_use]
pub fn fit(camera: &Camera, (min, max): (DVec3, DVec3), aspect: f64) -> Camera {
    let [right, up, back] = axes(camera);
    let (target, half) = (0.5 * (min + max), 0.5 * (max - min));
    let corners = (0..8).map(|i| {
        let sign = |bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        half * DVec3::new(sign(0), sign(1), sign(2))
    });
    let off_axis = |corner: DVec3| corner.dot(up).abs().max(corner.dot(right).abs() / aspect);
    let least = (1e-12 * target.abs().max_element()).max(*DISTANCE.start());
    if let Some(Lens::Orthographic { .. }) = camera.lens {
        let height = 2.1 * corners.map(off_axis).fold(least, f64::max);
        // As far away as before, but outside.
        let distance = camera.eye.distance(camera.target).max(1.05 * half.length()).max(least);
        let moved = Camera { eye: target + distance * back, target, ..*camera };
        return with_height(&moved, height);
    }
    let tangent = tangent(camera);
    let needed = corners.map(|corner| corner.dot(back) + off_axis(corner) / tangent);
    let distance = 1.05 * needed.fold(least, f64::max);
    Camera { eye: target + distance * back, target, ..*camera }
}

/// Looks at the target from this direction, at the same distance, with y up in the picture. From above and below x points
/// to the right.
#[must_use]
pub fn from_direction(camera: &Camera, direction: DVec3) -> Camera {
    let offset = camera.eye.distance(camera.target) * direction.normalize_or(DVec3::Z);
    // The poles themselves have no azimuth.
    let least = MIN_POLE_ANGLE * offset.length();
    let is_level = DVec2::new(offset.x, offset.z).length() >= least;
    let offset = if is_level { offset } else { offset + DVec3::new(0.0, 0.0, least) };
    Camera { eye: camera.target + offset, up: Vec3::Y, ..*camera }
}

fn rotated(camera: &Camera, offset: DVec3, angles: DVec2) -> DVec3 {
    let up = unit_up(camera);
    let length = offset.length();
    let height = (offset.dot(up) / length).clamp(-1.0, 1.0).asin();
    let level = offset - offset.dot(up) * up;
    // Straight above or below, any direction will do.
    let level = level.try_normalize().unwrap_or(up.any_orthonormal_vector());
    let level = DQuat::from_axis_angle(up, angles.x) * level;
    let limit = std::f64::consts::FRAC_PI_2 - MIN_POLE_ANGLE;
    let (sin, cos) = (height + angles.y).clamp(-limit, limit).sin_cos();
    length * (cos * level + sin * up)
}

fn translated(camera: &Camera, by: DVec3) -> Camera {
    Camera { eye: camera.eye + by, target: camera.target + by, ..*camera }
}

fn unit_up(camera: &Camera) -> DVec3 {
    camera.up.as_dvec3().normalize_or(DVec3::Y)
}

/// Half the height of the view over the distance.
fn tangent(camera: &Camera) -> f64 {
    match camera.lens {
        Some(Lens::Pinhole { focal, size, .. }) => 0.5 * size.y / focal.y,
        _ => (0.5 * f64::from(camera.fov_y)).to_radians().tan(),
    }
}

/// Half the height of the view at the target's distance, m.
pub fn half_height(camera: &Camera) -> f64 {
    match camera.lens {
        Some(Lens::Orthographic { height }) => 0.5 * height,
        _ => camera.eye.distance(camera.target) * tangent(camera),
    }
}
