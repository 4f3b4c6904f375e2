//! Flicker: how much pictures change from frame to frame, against how much the truth does.
//!
//! Two short sequences: the camera orbits slowly, or the particles drift along their velocities. Surfaces or
//! intervals that appear and vanish change more than the truth; 1 is perfect.

use glam::DMat3;
use image::RgbImage;

use super::picture::{Effort, draw};
use super::rows::{ErrorKind, Row, RowKind};
use super::subjects::{Subject, size};
use crate::reference::Liquid;
use crate::reference::trace::{MAX_DEPTH, trace};
use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::renderer::Renderer;
use limpid::settings::{Layers, Refract, Settings};
use limpid_io::error::Result;

/// Angle of the orbit from frame to frame, degrees.
const ANGLE: f64 = 0.25;

/// Time from frame to frame, s.
const STEP: f64 = 1.0 / 240.0;

/// The compared methods: settings that distinguish them, settings.
fn methods() -> [(&'static str, Settings); 3] {
    [("4 samples", 2), ("4 samples, 1 interval", 1), ("4 samples, 3 intervals", 3)].map(
        |(text, intervals)| {
            let refract = Refract { samples: 4, ..Refract::default() };
            (text, Settings { layers: Layers { intervals }, refract, ..Settings::default() })
        },
    )
}

/// Measures both sequences of a scene without lights; the second if its particles have velocities.
///
/// # Errors
/// As [`Renderer::render`] and [`Subject::after`].
pub fn measure(
    gpu: &Gpu,
    renderer: &mut Renderer,
    subject: &Subject,
    effort: &Effort,
) -> Result<Vec<Row>> {
    let size = size(subject.name, effort.width);
    let frames = if effort.variants { 9 } else { 4 };
    let camera = subject.views[0].1;
    let cameras: Vec<Camera> = (0..frames).map(|i| orbited(&camera, i)).collect();
    let truth = |liquid: &dyn Liquid, camera: &Camera| {
        let samples = effort.truth_samples;
        trace(liquid, &subject.scene, camera, size, samples, MAX_DEPTH).to_srgb()
    };

    let truths: Vec<_> = cameras.iter().map(|camera| truth(&*subject.liquid, camera)).collect();
    let mut rows = Vec::new();
    for (text, settings) in methods() {
        let (scene, loaded) = subject.with(&settings)?;
        let mut picture =
            |camera| draw(gpu, renderer, loaded.picture(&scene, camera, size), 0).map(|p| p.0);
        let pictures: Vec<_> = cameras.iter().map(&mut picture).collect::<Result<_>>()?;
        rows.push(row(subject, text, &pictures, &truths, ErrorKind::ChangeInOrbit));
    }

    let times = (0..frames).map(|i| f64::from(i) * STEP);
    let moved = times.map(|t| subject.after(t)).collect::<Result<Option<Vec<_>>>>()?;
    let Some(moved) = moved else { return Ok(rows) };
    let truths: Vec<_> = moved.iter().map(|(_, mesh)| truth(mesh, &camera)).collect();
    for (text, settings) in methods() {
        let mut pictures = Vec::new();
        for (particles, _) in &moved {
            let (scene, loaded) = subject.prepared(particles, &settings)?;
            pictures.push(draw(gpu, renderer, loaded.picture(&scene, &camera, size), 0)?.0);
        }
        rows.push(row(subject, text, &pictures, &truths, ErrorKind::ChangeInPlay));
    }
    Ok(rows)
}

fn row(
    subject: &Subject,
    settings: &str,
    pictures: &[RgbImage],
    truths: &[RgbImage],
    kind: ErrorKind,
) -> Row {
    let ratio = change(pictures) / change(truths);
    Row::new(RowKind::Picture, subject.name, "limpid", settings).with_error(
        ratio,
        kind,
        subject.truth,
    )
}

/// The camera after `i` steps around its target and the vertical.
fn orbited(camera: &Camera, i: u32) -> Camera {
    let turn = DMat3::from_rotation_y((f64::from(i) * ANGLE).to_radians());
    Camera { eye: camera.target + turn * (camera.eye - camera.target), ..*camera }
}

/// Mean absolute change of all pixels and channels from picture to picture.
fn change(pictures: &[RgbImage]) -> f64 {
    let steps = pictures.windows(2).flat_map(|pair| pair[0].as_raw().iter().zip(pair[1].as_raw()));
    let (sum, count) = steps
        .fold((0_u64, 0_u64), |(sum, count), (a, b)| (sum + u64::from(a.abs_diff(*b)), count + 1));
    sum as f64 / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A picture that alternates between black and grey changes by the grey; one that stays, by nothing.
    #[test]
    fn change_is_the_mean_difference_of_neighbours() {
        let grey = |level| RgbImage::from_pixel(4, 3, Rgb([level; 3]));
        assert_eq!(change(&[grey(0), grey(8), grey(0)]), 8.0);
        assert_eq!(change(&[grey(5), grey(5)]), 0.0);
    }
}
