//! Writing films, with a device of their own.

use std::path::Path;
use std::sync::Arc;

use glam::UVec2;
use image::DynamicImage;

use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::color_by::ColorScale;
use limpid_io::device;
use limpid_io::error::Result;
use limpid_io::film::{Film, Shot};
use limpid_io::input::{FrameTime, Loader};
use limpid_io::overlay::draw_legend;
use limpid_io::shared_classifier::SharedClassifier;

/// The contents of a film.
pub(crate) struct Script {
    pub(crate) input: Loader,
    pub(crate) scene: Scene,
    pub(crate) frame_times: Arc<[FrameTime]>,
    pub(crate) shots: Vec<Shot>,
    pub(crate) size: UVec2,
    pub(crate) fps: f64,
    /// The values of the legend, if there is to be one.
    pub(crate) legend: Option<ColorScale>,
}

/// Writes a film; `proceed` is called with the number of finished pictures and decides whether to go on. Returns
/// whether the film is whole.
pub(crate) fn write(
    script: &Script,
    path: &Path,
    mut proceed: impl FnMut(usize) -> bool,
) -> Result<bool> {
    let Script { input, scene, frame_times, shots, size, fps, legend } = script;
    let mut film = Film::create(path, *size, *fps)?;
    let gpu = device::open()?;
    let input = input.clone().classified(SharedClassifier::on(&gpu));
    let mut offscreen = Offscreen::new(&gpu);
    // A still is loaded once.
    let mut last = None;
    for (done, shot) in (1..).zip(shots) {
        let loaded = match last.take() {
            Some((frame, loaded)) if frame == shot.frame => loaded,
            _ => input.load(frame_times[shot.frame], scene)?,
        };
        let scene = loaded.scene(scene);
        let input = loaded.picture(&scene, &shot.camera, *size);
        let mut picture = DynamicImage::from(offscreen.draw(input)?.picture);
        if let Some(scale) = legend {
            draw_legend(&mut picture, scale);
        }
        film.push(&picture.into_rgb8())?;
        last = Some((shot.frame, loaded));
        if !proceed(done) {
            return Ok(false);
        }
    }
    film.finish()?;
    Ok(true)
}
