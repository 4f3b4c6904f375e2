//! Dialogs for opening and saving: the path is typed, or chosen in the system's file dialog.

use eframe::egui;
use glam::UVec2;

use crate::model::platform::IN_BROWSER;
use crate::model::shortcuts::{POINTER, SHORTCUTS};

/// An open dialog.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Dialog {
    pub(crate) purpose: Purpose,
    pub(crate) path: String,
    /// Size of a picture or a film, pixels.
    pub(crate) size: UVec2,
    /// Rays per pixel.
    pub(crate) samples: u32,
}

/// Purpose of a dialog.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    Open,
    Picture,
    Film,
    Scene,
    LoadPath,
    SavePath,
}

/// A button that chooses the path elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Browse {
    /// The system's dialog, for files of the same purpose.
    System,
    /// The browser's, for files.
    Files,
    /// The same, for a folder.
    Folder,
}

/// Outcome of a dialog.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The dialog stays open.
    Open,
    Browse(Browse),
    Done,
    Cancelled,
}

impl Purpose {
    pub(crate) fn title(self) -> &'static str {
        match self {
            Self::Open => "Open",
            Self::Picture => "Save picture",
            Self::Film => "Save film",
            Self::Scene => "Save scene",
            Self::LoadPath => "Load camera path",
            Self::SavePath => "Save camera path",
        }
    }

    pub(crate) fn saves(self) -> bool {
        !matches!(self, Self::Open | Self::LoadPath)
    }

    /// Whether a size is chosen.
    fn draws(self) -> bool {
        matches!(self, Self::Picture | Self::Film)
    }

    fn hint(self) -> &'static str {
        match self {
            Self::Open if IN_BROWSER => {
                "The URL of a scene (.toml) or a particle file, a pattern as https://…/frame_{}.bgeo, or your own files"
            }
            Self::Open => {
                "A scene (.toml), a particle file, a pattern as frame_{}.bgeo, or a folder"
            }
            Self::Picture => "Drawn as `limpid render` does",
            Self::Film => {
                "All frames at the speed of playback; .mp4 and .webm need ffmpeg, .gif and .apng nothing"
            }
            Self::Scene => "What `limpid render` draws alike: particles, camera, every setting",
            Self::LoadPath | Self::SavePath => "Key frames, for `limpid render --camera-path`",
        }
    }

    /// Label of the text field, and the buttons that fill it.
    fn path_buttons(self) -> (&'static str, &'static [(&'static str, Browse)]) {
        match (IN_BROWSER, self) {
            (false, Self::Open) => {
                ("Path", &[("File…", Browse::System), ("Folder…", Browse::Folder)])
            }
            (false, _) => ("Path", &[("Browse…", Browse::System)]),
            (true, Self::Open) => {
                ("URL", &[("Files…", Browse::Files), ("Folder…", Browse::Folder)])
            }
            (true, _) => ("Name", &[]),
        }
    }
}

impl Dialog {
    pub(crate) fn new(purpose: Purpose, path: impl Into<String>) -> Self {
        Self { purpose, path: path.into(), size: UVec2::ZERO, samples: 1 }
    }

    /// The dialog for a picture or a film.
    pub(crate) fn drawing(purpose: Purpose, path: &str, size: UVec2, samples: u32) -> Self {
        Self { size, samples, ..Self::new(purpose, path) }
    }

    /// Shows it; `browsing` if the system's dialog is open.
    pub(crate) fn show(&mut self, ctx: &egui::Context, browsing: bool) -> Outcome {
        let purpose = self.purpose;
        let (mut done, mut cancelled, mut browse) = (false, false, None);
        let modal = egui::Modal::new(egui::Id::unique("dialog")).show(ctx, |ui| {
            ui.set_width(440.0);
            ui.heading(purpose.title());
            ui.weak(purpose.hint());
            ui.add_space(4.0);
            ui.horizontal(|ui| {
                let (label, buttons) = purpose.path_buttons();
                let label = ui.label(label);
                let width = ui.available_width() - 90.0 * buttons.len() as f32;
                let edit = egui::TextEdit::singleline(&mut self.path).desired_width(width);
                let response = ui.add(edit).labelled_by(label.id);
                if response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter)) {
                    done = true;
                } else if !response.has_focus() && ui.memory(|memory| memory.focused().is_none()) {
                    response.request_focus();
                }
                for &(text, button) in buttons {
                    if ui.add_enabled(!browsing, egui::Button::new(text)).clicked() {
                        browse = Some(button);
                    }
                }
            });
            if purpose.draws() {
                ui.horizontal(|ui| {
                    ui.label("Size");
                    ui.add(egui::DragValue::new(&mut self.size.x).range(1..=16384).suffix(" px"));
                    ui.label("×");
                    ui.add(egui::DragValue::new(&mut self.size.y).range(1..=16384).suffix(" px"));
                    ui.add_space(8.0);
                    let label = ui.label("Rays per pixel");
                    let samples = egui::DragValue::new(&mut self.samples).range(1..=64);
                    ui.add(samples).labelled_by(label.id);
                });
            }
            ui.add_space(8.0);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let word = if purpose.saves() { "Save" } else { "Open" };
                done |= ui.add_enabled(!self.path.is_empty(), egui::Button::new(word)).clicked();
                cancelled = ui.button("Cancel").clicked();
            });
        });
        if let Some(button) = browse {
            Outcome::Browse(button)
        } else if done && !self.path.is_empty() {
            Outcome::Done
        } else if cancelled || modal.should_close() {
            Outcome::Cancelled
        } else {
            Outcome::Open
        }
    }
}

/// Shows the list of keys while it is `open`.
pub(crate) fn help_window(ctx: &egui::Context, open: &mut bool) {
    egui::Window::new("Keys")
        .open(open)
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
}
