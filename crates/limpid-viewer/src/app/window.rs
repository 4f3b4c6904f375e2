//! The viewer in a window: features that only programs have, the window, and its replacement if its device is lost.
//!
//! egui draws the interface with its own device, which eframe opens and cannot replace. If that device
//! is lost, the window is closed and opened again with the same viewer: the document, the settings, the
//! camera and playback stay.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::{Duration, Instant};

use eframe::egui;

use crate::app::{Options, Viewer};
use crate::backend::core::messages::Post;
use crate::backend::native::Backend;
use crate::model::document::Source;
use crate::model::log::Log;
use crate::panels::dialogs::{Browse, Dialog, Purpose};
use limpid::gpu::Gpu;
use limpid_io::device;
use limpid_io::error::{Error, Result};
use limpid_io::project::Project;

/// Number of windows opened in quick succession before an error.
const ATTEMPTS: usize = 3;

/// A window that was open for longer resets the attempts.
const STEADY: Duration = Duration::from_secs(60);

impl Viewer {
    /// Creates the viewer and opens the options' source.
    ///
    /// # Errors
    /// [`limpid_io::Error::Io`] if the log cannot be written.
    pub fn new(options: Options) -> Result<Self> {
        Self::with_devices(options, device::open)
    }

    /// As [`Viewer::new`], with devices from `open`: one for the first picture, and another after each
    /// loss.
    ///
    /// # Errors
    /// As [`Viewer::new`].
    pub fn with_devices(
        options: Options,
        open: impl FnMut() -> Result<Gpu> + Send + 'static,
    ) -> Result<Self> {
        let (sender, messages) = mpsc::channel();
        let post = Post::new(sender);
        let backend = Backend::new(post.clone(), open);
        let log = Log::new(options.log.as_deref())?;
        Ok(Self::of(options, backend, (post, messages), log))
    }

    /// Opens the path that was typed.
    pub(super) fn open_typed(&mut self, path: &str) {
        self.open(Source::new(path));
    }

    /// Shows the system's dialog for files, or for a folder.
    pub(super) fn browse(&mut self, dialog: Dialog, how: Browse) {
        self.interface.browsing = true;
        let (purpose, path) = (dialog.purpose, dialog.path.clone());
        self.interface.dialog = Some(dialog);
        self.backend.choose(move || {
            let (name, extensions) = filter(purpose);
            let mut system = rfd::FileDialog::new().set_title(purpose.title());
            if !extensions.is_empty() {
                system = system.add_filter(name, extensions);
            }
            let path = std::path::absolute(&path).unwrap_or_else(|_| path.into());
            if let Some(folder) = path.parent().filter(|folder| folder.is_dir()) {
                system = system.set_directory(folder);
            }
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            match how {
                Browse::Folder => system.pick_folder(),
                _ if purpose.saves() => system.set_file_name(name).save_file(),
                _ => system.pick_file(),
            }
        });
    }

    /// Copies the command that draws this picture.
    pub(super) fn copy(&mut self, ctx: &egui::Context) {
        if let Some(command) = self.command_line("limpid.png") {
            ctx.copy_text(command.clone());
            self.show_info(format!("copied: {command}"));
        }
    }

    /// Writes the edited scene with the current camera, in the background.
    pub fn save_scene(&mut self, path: PathBuf) {
        let (Some(document), Some(at)) = (self.opened.document.clone(), self.stage.frame_time())
        else {
            return;
        };
        let (camera, processor) = (self.stage.eye.camera, self.stage.processor);
        let scene = self.picture.fine_scene(&self.stage.editing);
        let color_by = self.stage.colors.by.clone();
        // Writing an environment map takes time.
        self.backend.write(path, move |path| {
            document.check_scene_output(path)?;
            Project { processor, color_by, ..document.saved(scene, camera, at) }.save(path)
        });
    }

    /// Writes the camera path, in the background.
    pub(super) fn save_path(&mut self, path: PathBuf) {
        let keys = self.stage.eye.path.clone();
        self.backend.write(path, move |path| keys.save(path));
    }

    /// Reads a camera path, in the background.
    pub(super) fn load_path(&self, path: PathBuf) {
        self.backend.load_path(path);
    }
}

/// Filter of the system's dialog: a name, and extensions; all files without any.
fn filter(purpose: Purpose) -> (&'static str, &'static [&'static str]) {
    match purpose {
        Purpose::Open => ("Scenes and particles", &[]),
        Purpose::Picture => ("Pictures", &["png", "jpg", "webp", "exr"]),
        Purpose::Film => ("Films", &["mp4", "webm", "gif", "apng"]),
        Purpose::Scene | Purpose::LoadPath | Purpose::SavePath => ("TOML", &["toml"]),
    }
}

/// The viewer in a window.
struct Window {
    viewer: Rc<RefCell<Viewer>>,
    /// The reason for the loss of its device.
    lost: Arc<OnceLock<String>>,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        if self.lost.get().is_some() {
            // The lost device can no longer draw.
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
            return;
        }
        self.viewer.borrow_mut().ui(ui);
    }

    fn on_exit(&mut self) {
        if self.lost.get().is_none() {
            self.viewer.borrow_mut().close();
        }
    }
}

/// Shows the window until it is closed.
///
/// # Errors
/// [`Error::Io`] if the log cannot be written, [`Error::Window`] if there is no window system,
/// [`limpid::Error::DeviceLost`] if the window's device is lost repeatedly.
pub fn run(options: Options) -> Result<()> {
    let size = options.window.as_vec2();
    let viewer = Rc::new(RefCell::new(Viewer::new(options)?));
    let mut left = ATTEMPTS;
    loop {
        let begun = Instant::now();
        let lost = Arc::<OnceLock<String>>::default();
        let shown = catch_unwind(AssertUnwindSafe(|| show(viewer.clone(), size, lost.clone())));
        let reason = lost.get().map(|reason| format!("of the window: {reason}"));
        match (shown, reason) {
            (Ok(ended), None) => return ended,
            (Ok(_), Some(reason)) => {
                left = if begun.elapsed() > STEADY { ATTEMPTS } else { left - 1 };
                if left == 0 {
                    return Err(limpid::Error::DeviceLost(reason).into());
                }
                let mut viewer = viewer.borrow_mut();
                viewer.reset_for_new_window();
                viewer.handle_lost_device(&reason);
            }
            // egui_wgpu panics if the device is lost while a frame is drawn, and winit's event loop does
            // not run again after that.
            (Err(_), Some(reason)) => return Err(limpid::Error::DeviceLost(reason).into()),
            (Err(panic), None) => resume_unwind(panic),
        }
    }
}

/// Shows one window until it is closed or its device is `lost`.
fn show(viewer: Rc<RefCell<Viewer>>, size: glam::Vec2, lost: Arc<OnceLock<String>>) -> Result<()> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("limpid")
            .with_app_id("limpid")
            .with_inner_size([size.x, size.y])
            .with_min_inner_size([480.0, 320.0])
            .with_drag_and_drop(true)
            .with_icon(egui::IconData::default()),
        persist_window: false,
        ..Default::default()
    };
    let create = |creation: &eframe::CreationContext<'_>| {
        if let Some(state) = &creation.wgpu_render_state {
            watch(&state.device, &creation.egui_ctx, &lost);
        }
        Ok(Box::new(Window { viewer, lost }) as Box<dyn eframe::App>)
    };
    eframe::run_native("limpid", options, Box::new(create))
        .map_err(|e| Error::Window(e.to_string()))
}

/// Records in `lost` why the device fails, and repaints the window.
fn watch(device: &limpid::wgpu::Device, ctx: &egui::Context, lost: &Arc<OnceLock<String>>) {
    let (seen, context) = (lost.clone(), ctx.clone());
    device.set_device_lost_callback(move |reason, text| {
        // Closing a window destroys its device.
        if reason != limpid::wgpu::DeviceLostReason::Destroyed {
            seen.get_or_init(|| text);
        }
        context.request_repaint();
    });
    let (seen, context) = (lost.clone(), ctx.clone());
    device.on_uncaptured_error(Arc::new(move |error| {
        seen.get_or_init(|| error.to_string());
        context.request_repaint();
    }));
}
