//! Drawing for the screen: the same code as in `limpid render`, on a device that may be lost. Threads and browsers
//! share it: waiting blocks on a thread and yields in a browser.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::sync::Arc;
use std::task::Poll;

use eframe::egui::ColorImage;
use glam::UVec2;
use web_time::Instant;

use crate::backend::core::truth::{Point, Truth};
use crate::model::level::Level;
use crate::model::platform::IN_BROWSER;
use crate::model::views::{Legend, Values, View};
use limpid::Error::{Defect, DeviceLost};
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::{Gpu, PassTime};
use limpid::liquid::Colors;
use limpid::offscreen::{Offscreen, RenderedFrame};
use limpid::scene::Scene;
use limpid_io::color_by::ColorScale;
use limpid_io::error::{Error, Result};
use limpid_io::exr;
use limpid_io::input::Loaded;
use limpid_io::output::{PictureFormat, encode_picture};
use limpid_io::overlay::draw_legend;

/// The inputs of a picture.
#[derive(Debug, Clone)]
pub struct Pane {
    /// Everything around the liquid, and all settings.
    pub scene: Arc<Scene>,
    /// The camera.
    pub camera: Camera,
    /// The liquid.
    pub loaded: Arc<Loaded>,
    /// Size in pixels.
    pub size: UVec2,
    /// The values that the particles' colours show, if a map shows an attribute.
    pub scale: Option<ColorScale>,
    /// Whether saved pictures have a legend of them.
    pub legend: bool,
}

/// A request for the screen: one picture, or two to compare.
#[derive(Debug, Clone)]
pub struct Request {
    /// Identifies the request.
    pub number: u64,
    /// The pictures to draw.
    pub panes: Vec<Pane>,
    /// Their quality.
    pub level: Level,
    /// The view mode.
    pub view: View,
}

/// A request's pictures.
#[derive(Debug)]
pub struct Drawn {
    /// The request's number.
    pub number: u64,
    /// The request's level.
    pub level: Level,
    /// One picture for each pane.
    pub panes: Vec<Shown>,
}

/// A picture ready for the screen.
#[derive(Debug)]
pub struct Shown {
    /// The image to show.
    pub image: ColorImage,
    /// The meaning of its colours.
    pub legend: Legend,
    /// The values behind its colours; `None` for a picture.
    pub values: Option<Values>,
    /// The time of each pass.
    pub passes: Vec<PassTime>,
    /// Time from the request to the picture in memory, ms.
    pub ms: f64,
    /// Size in pixels.
    pub size: UVec2,
    /// Rays per pixel.
    pub samples: u32,
}

/// The error of a picture against a ground truth.
#[derive(Debug)]
pub struct Measured {
    pub(crate) truth: Arc<Truth>,
    pub(crate) point: Point,
}

/// A message from whoever draws.
#[derive(Debug)]
pub enum Answer {
    /// A device has been opened: its adapter's name.
    Adapter(String),
    /// The device has been lost, for this reason; another one is opened for the request.
    Lost(String),
    /// A request's pictures.
    Drawn(Drawn),
    /// The request of this number cannot be drawn.
    NotDrawn(u64, Error),
    /// A picture has been written.
    Saved(Result<PathBuf>),
    /// A picture has been compared with the ground truth.
    Measured(Result<Measured>),
}

/// Change of the device.
pub(crate) enum DeviceEvent {
    /// It has been opened: its adapter's name.
    Opened(String),
    /// It has been lost, for this reason; another one is opened for the request.
    Lost(String),
}

/// An offscreen renderer on a device from `open`: one for the first picture, and another after each loss.
pub(crate) struct Drawer<O> {
    open: O,
    offscreen: Option<Offscreen>,
}

/// Number of devices to try for one request before it fails.
const ATTEMPTS: usize = 3;

/// Delay between a loss and the next device, while the driver resets: on a thread, which may wait.
const PAUSE: std::time::Duration = std::time::Duration::from_millis(100);

impl<O: AsyncFnMut() -> Result<Gpu>> Drawer<O> {
    pub(crate) fn new(open: O) -> Self {
        Self { open, offscreen: None }
    }

    /// Runs `act` on the offscreen renderer; if its device is lost, again on another one.
    pub(crate) async fn attempt<T>(
        &mut self,
        told: &impl Fn(DeviceEvent),
        act: impl AsyncFn(&mut Offscreen) -> Result<T>,
    ) -> Result<T> {
        for left in (0..ATTEMPTS).rev() {
            // Every request must get an answer, even after a panic.
            let done = caught(async { act(self.offscreen(told).await?).await }).await;
            let defect = || Err(Error::from(Defect("a picture could not be drawn".into())));
            match done.unwrap_or_else(defect) {
                Err(Error::Render(DeviceLost(reason))) if left > 0 => {
                    self.offscreen = None;
                    told(DeviceEvent::Lost(reason));
                    if !IN_BROWSER {
                        std::thread::sleep(PAUSE);
                    }
                }
                Err(error) => {
                    if matches!(error, Error::Render(DeviceLost(_) | Defect(_))) {
                        self.offscreen = None;
                    }
                    return Err(error);
                }
                done => return done,
            }
        }
        unreachable!("the last attempt returns")
    }

    /// The offscreen renderer; opens a device if there is none.
    pub(crate) async fn offscreen(
        &mut self,
        told: &impl Fn(DeviceEvent),
    ) -> Result<&mut Offscreen> {
        let offscreen = match self.offscreen.take() {
            Some(offscreen) => offscreen,
            None => {
                let gpu = (self.open)().await?;
                told(DeviceEvent::Opened(gpu.adapter()));
                Offscreen::new(&gpu)
            }
        };
        Ok(self.offscreen.insert(offscreen))
    }
}

/// Runs a future; `None` if it panics.
pub(crate) async fn caught<T>(future: impl Future<Output = T>) -> Option<T> {
    let mut future = pin!(future);
    std::future::poll_fn(|context| {
        let polled = catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(context)));
        polled.map_or(Poll::Ready(None), |polled| polled.map(Some))
    })
    .await
}

/// Draws a picture as `limpid render` does; its other images, too, if they are asked for. Without `colors` the particles
/// have those that they were loaded with.
///
/// # Errors
/// As [`Offscreen::finish`].
pub async fn picture(
    offscreen: &mut Offscreen,
    pane: &Pane,
    colors: Option<&Colors>,
    diagnose: bool,
) -> Result<RenderedFrame> {
    let scene = pane.loaded.scene(&pane.scene);
    let input = pane.loaded.picture(&scene, &pane.camera, pane.size);
    let input = FrameInput { colors: colors.or(input.colors), ..input };
    Ok(offscreen.finish(FrameInput { diagnose, timing: true, reuse: true, ..input }).await?)
}

/// Draws the pictures of a request, each in its colours.
///
/// # Errors
/// As [`picture`].
pub(crate) async fn draw(
    offscreen: &mut Offscreen,
    request: &Request,
    colors: &[Option<Colors>],
) -> Result<Drawn> {
    let &Request { number, ref panes, level, view } = request;
    let diagnose = view != View::Picture;
    let mut drawn = Vec::new();
    for (pane, colors) in panes.iter().zip(colors) {
        let begun = Instant::now();
        let RenderedFrame { picture: rendered, passes, .. } =
            picture(offscreen, pane, colors.as_ref(), diagnose).await?;
        let (image, legend, values) = match view.aov() {
            None => {
                let size = [rendered.width() as usize, rendered.height() as usize];
                (ColorImage::from_rgb(size, rendered.as_raw()), Legend::Picture, None)
            }
            Some(aov) => view.shown(&offscreen.finish_images(&[aov]).await?, pane.size),
        };
        let ms = 1e3 * begun.elapsed().as_secs_f64();
        let (size, samples) = (pane.size, pane.scene.settings.refract.samples);
        drawn.push(Shown { image, legend, values, passes, ms, size, samples });
    }
    Ok(Drawn { number, level, panes: drawn })
}

/// Draws a picture in its colours, with their legend, and encodes it in the format of the extension of `path`, which
/// messages name.
///
/// # Errors
/// As [`picture`] and [`encode_picture`].
pub(crate) async fn encoded(
    offscreen: &mut Offscreen,
    pane: &Pane,
    colors: Option<&Colors>,
    path: &Path,
) -> Result<Vec<u8>> {
    let format = PictureFormat::of(path)?;
    let rendered = picture(offscreen, pane, colors, false).await?;
    if format == PictureFormat::Exr {
        let radiance = offscreen.finish_radiance().await?;
        return exr::to_bytes(vec![radiance]).map_err(|error| Error::io(path, "write", error));
    }
    let mut bytes = Cursor::new(Vec::new());
    let mut rendered = rendered.into_image();
    if let Some(scale) = pane.scale.as_ref().filter(|_| pane.legend) {
        draw_legend(&mut rendered, scale);
    }
    encode_picture(path, &rendered, &[], &mut bytes)?;
    Ok(bytes.into_inner())
}
