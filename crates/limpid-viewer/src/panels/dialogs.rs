//! Dialogs for opening and saving: the path is typed, or chosen in the system's file dialog, which runs
//! on its own thread.

use std::path::{Path, PathBuf};
#[cfg(not(target_arch = "wasm32"))]
use std::time::{Duration, Instant};

use eframe::egui;
use glam::UVec2;

use crate::Viewer;
#[cfg(not(target_arch = "wasm32"))]
use crate::backend::core::messages::Message;
#[cfg(not(target_arch = "wasm32"))]
use crate::model::document::Source;
use crate::model::shortcuts::{POINTER, SHORTCUTS};
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::camera_path::CameraPath;

/// A file dialog that returns sooner than this was never shown.
#[cfg(not(target_arch = "wasm32"))]
const MIN_DIALOG_TIME: Duration = Duration::from_millis(400);

/// The button that chooses a folder, in a browser.
const FOLDER: &str = "Folder…";

/// An open dialog.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Dialog {
    purpose: Purpose,
    path: String,
    size: UVec2,
    samples: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Open,
    Picture,
    #[cfg(not(target_arch = "wasm32"))]
    Film,
    Scene,
    LoadPath,
    SavePath,
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open",
            Self::Picture => "Save picture",
            #[cfg(not(target_arch = "wasm32"))]
            Self::Film => "Save film",
            Self::Scene => "Save scene",
            Self::LoadPath => "Load camera path",
            Self::SavePath => "Save camera path",
        }
    }

    fn saves(self) -> bool {
        !matches!(self, Self::Open | Self::LoadPath)
    }

    /// Whether a size is chosen.
    fn draws(self) -> bool {
        #[cfg(not(target_arch = "wasm32"))]
        if self == Self::Film {
            return true;
        }
        self == Self::Picture
    }

    #[cfg(not(target_arch = "wasm32"))]
    fn filter(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Open => ("Scenes and particles", &[]),
            Self::Picture => ("Pictures", &["png", "jpg", "webp", "exr"]),
            Self::Film => ("Films", &["mp4", "webm", "gif", "apng"]),
            Self::Scene | Self::LoadPath | Self::SavePath => ("TOML", &["toml"]),
        }
    }

    fn hint(self) -> &'static str {
        match self {
            #[cfg(target_arch = "wasm32")]
            Self::Open => {
                "The URL of a scene (.toml) or a particle file, a pattern as https://…/frame_{}.bgeo, or your own files"
            }
            #[cfg(not(target_arch = "wasm32"))]
            Self::Open => {
                "A scene (.toml), a particle file, a pattern as frame_{}.bgeo, or a folder"
            }
            Self::Picture => "Drawn as `limpid render` does",
            #[cfg(not(target_arch = "wasm32"))]
            Self::Film => {
                "All frames at the speed of playback; .mp4 and .webm need ffmpeg, .gif and .apng nothing"
            }
            Self::Scene => "What `limpid render` draws alike: particles, camera, every setting",
            Self::LoadPath | Self::SavePath => "Key frames, for `limpid render --camera-path`",
        }
    }
}

impl Dialog {
    fn new(purpose: Purpose, path: impl Into<String>) -> Self {
        Self { purpose, path: path.into(), size: UVec2::ZERO, samples: 1 }
    }

    /// The dialog for opening a source.
    pub(crate) fn open() -> Self {
        Self::new(Purpose::Open, "")
    }

    pub(crate) fn load_path() -> Self {
        Self::new(Purpose::LoadPath, "camera.toml")
    }

    pub(crate) fn save_path() -> Self {
        Self::new(Purpose::SavePath, "camera.toml")
    }
}

impl Viewer {
    pub(crate) fn save_picture_dialog(&self) -> Option<Dialog> {
        let samples = self.fine_scene().settings.refract.samples;
        let size = self.picture.viewport_size.max(UVec2::ONE);
        self.opened.document.as_ref()?;
        Some(Dialog { size, samples, ..Dialog::new(Purpose::Picture, "limpid.png") })
    }

    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn save_film_dialog(&self) -> Option<Dialog> {
        let samples = self.fine_scene().settings.refract.samples;
        self.opened.document.as_ref()?;
        Some(Dialog { size: self.film_size(), samples, ..Dialog::new(Purpose::Film, "limpid.mp4") })
    }

    pub(crate) fn save_scene_dialog(&self) -> Option<Dialog> {
        let stem = Path::new(self.opened.document.as_ref()?.name()).file_stem()?.to_string_lossy();
        Some(Dialog::new(Purpose::Scene, format!("{stem}_view.toml")))
    }

    pub(crate) fn show_dialog(&mut self, ctx: &egui::Context) {
        let Some(mut dialog) = self.interface.dialog.take() else { return };
        let purpose = dialog.purpose;
        let (mut done, mut cancelled, mut browse) = (false, false, None);
        let modal = egui::Modal::new(egui::Id::unique("dialog")).show(ctx, |ui| {
            ui.set_width(440.0);
            ui.heading(purpose.title());
            ui.weak(purpose.hint());
            ui.add_space(4.0);
            ui.horizontal(|ui| {
                let (label, buttons) = self.path_buttons(purpose);
                let label = ui.label(label);
                let width = ui.available_width() - 90.0 * buttons.len() as f32;
                let edit = egui::TextEdit::singleline(&mut dialog.path).desired_width(width);
                let response = ui.add(edit).labelled_by(label.id);
                if response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter)) {
                    done = true;
                } else if !response.has_focus() && ui.memory(|memory| memory.focused().is_none()) {
                    response.request_focus();
                }
                for &button in buttons {
                    let enabled = !self.interface.browsing;
                    if ui.add_enabled(enabled, egui::Button::new(button)).clicked() {
                        browse = Some(button);
                    }
                }
            });
            if purpose.draws() {
                ui.horizontal(|ui| {
                    ui.label("Size");
                    ui.add(egui::DragValue::new(&mut dialog.size.x).range(1..=16384).suffix(" px"));
                    ui.label("×");
                    ui.add(egui::DragValue::new(&mut dialog.size.y).range(1..=16384).suffix(" px"));
                    ui.add_space(8.0);
                    let label = ui.label("Rays per pixel");
                    let samples = egui::DragValue::new(&mut dialog.samples).range(1..=64);
                    ui.add(samples).labelled_by(label.id);
                });
            }
            ui.add_space(8.0);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let word = if purpose.saves() { "Save" } else { "Open" };
                done |= ui.add_enabled(!dialog.path.is_empty(), egui::Button::new(word)).clicked();
                cancelled = ui.button("Cancel").clicked();
            });
        });
        #[cfg(not(target_arch = "wasm32"))]
        if browse.is_some() {
            self.browse(&dialog);
        }
        #[cfg(target_arch = "wasm32")]
        if let Some(button) = browse {
            self.pick(button == FOLDER);
            return;
        }
        if done && !dialog.path.is_empty() {
            self.finish(&dialog);
        } else if !cancelled && !modal.should_close() {
            self.interface.dialog = Some(dialog);
        }
    }

    /// What the text of a dialog is, and the buttons that choose it elsewhere.
    fn path_buttons(&self, purpose: Purpose) -> (&'static str, &'static [&'static str]) {
        match (cfg!(target_arch = "wasm32"), purpose) {
            (false, _) => ("Path", &["Browse…"]),
            (true, Purpose::Open) => ("URL", &["Files…", FOLDER]),
            (true, _) => ("Name", &[]),
        }
    }

    /// Carries out the dialog's purpose.
    fn finish(&mut self, dialog: &Dialog) {
        let path = PathBuf::from(&dialog.path);
        match dialog.purpose {
            #[cfg(not(target_arch = "wasm32"))]
            Purpose::Open => self.open(Source::new(dialog.path.clone())),
            #[cfg(target_arch = "wasm32")]
            Purpose::Open => self.open_url(&dialog.path),
            Purpose::Picture => self.save_picture(path, dialog.size, dialog.samples),
            #[cfg(not(target_arch = "wasm32"))]
            Purpose::Film => self.save_film(path, dialog.size, dialog.samples),
            #[cfg(target_arch = "wasm32")]
            Purpose::LoadPath => {}
            #[cfg(target_arch = "wasm32")]
            Purpose::SavePath => self.download_path(&path),
            Purpose::Scene => self.save_scene(path),
            #[cfg(not(target_arch = "wasm32"))]
            Purpose::SavePath => {
                let keys = self.eye.path.clone();
                self.write(path, move |path| keys.save(path));
            }
            #[cfg(not(target_arch = "wasm32"))]
            Purpose::LoadPath => {
                let post = self.jobs.post.clone();
                std::thread::spawn(move || {
                    let keys = CameraPath::load(&path);
                    post.send(Message::Path(path, keys));
                });
            }
        }
    }

    /// Shows the system's file dialog on its own thread.
    #[cfg(not(target_arch = "wasm32"))]
    fn browse(&mut self, dialog: &Dialog) {
        self.interface.browsing = true;
        let (purpose, path, post) = (dialog.purpose, dialog.path.clone(), self.jobs.post.clone());
        std::thread::spawn(move || {
            let begun = Instant::now();
            let (name, extensions) = purpose.filter();
            let mut system = rfd::FileDialog::new().set_title(purpose.title());
            if !extensions.is_empty() {
                system = system.add_filter(name, extensions);
            }
            let chosen = match purpose.saves() {
                true => system.set_file_name(path).save_file(),
                false => system.pick_file(),
            };
            post.send(Message::Chosen(chosen, begun.elapsed()));
        });
    }

    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn chosen(&mut self, path: Option<PathBuf>, waited: Duration) {
        self.interface.browsing = false;
        match (path, &mut self.interface.dialog) {
            (Some(path), Some(dialog)) => dialog.path = path.to_string_lossy().into_owned(),
            (None, _) if waited < MIN_DIALOG_TIME => self.show_info(
                "this system shows no file dialogs (no desktop portal): type the path, or drop \
                 the file on the window"
                    .into(),
            ),
            _ => {}
        }
    }

    pub(crate) fn help_window(&mut self, ctx: &egui::Context) {
        let mut open = self.interface.help;
        egui::Window::new("Keys")
            .open(&mut open)
            .anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0])
            .resizable(false)
            .collapsible(false)
            .show(ctx, |ui| {
                let grid = |name| egui::Grid::new(name).num_columns(2).spacing([24.0, 4.0]);
                ui.horizontal_top(|ui| {
                    grid("keys").striped(true).show(ui, |ui| {
                        for shortcut in &SHORTCUTS {
                            ui.strong(shortcut.shown);
                            ui.label(shortcut.help);
                            ui.end_row();
                        }
                    });
                    ui.add_space(16.0);
                    ui.vertical(|ui| {
                        ui.strong("On the picture");
                        grid("pointer").show(ui, |ui| {
                            for (how, what) in POINTER {
                                ui.strong(how);
                                ui.label(what);
                                ui.end_row();
                            }
                        });
                    });
                });
            });
        self.interface.help = open;
    }
}
