//! The window, and its replacement if its device is lost.
//!
//! egui draws the interface with its own device, which eframe opens and cannot replace. If that device
//! is lost, the window is closed and opened again with the same viewer: the document, the settings, the
//! camera and playback stay.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::rc::Rc;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use eframe::egui;

use crate::{Options, Viewer};
use limpid_io::error::{Error, Result};

/// Number of windows opened in quick succession before an error.
const ATTEMPTS: usize = 3;

/// A window that was open for longer resets the attempts.
const STEADY: Duration = Duration::from_secs(60);

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
            self.viewer.borrow_mut().jobs.log.close();
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
