//! Dialogs for opening and saving: the path is typed, or chosen in the system's file dialog.

use std::path::Path;

use eframe::egui;
use glam::UVec2;

use crate::model::platform::IN_BROWSER;
use crate::model::shortcuts::{POINTER, SHORTCUTS};

/// An open dialog.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Dialog {
    pub(crate) purpose: Purpose,
    pub(crate) path: String,
    /// How a picture or a film is drawn.
    pub(crate) drawing: Drawing,
    /// Size of the picture in the window, pixels.
    pub(crate) window: UVec2,
    /// Whether the sides of the size keep their ratio.
    pub(crate) locked: bool,
    /// Further facts on a film.
    pub(crate) facts: String,
    /// The path of a file that is there already, and whether it may be replaced.
    pub(crate) existing: Option<(String, bool)>,
}

/// How a picture or a film is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Drawing {
    /// Size in pixels.
    pub(crate) size: UVec2,
    /// Rays per pixel.
    pub(crate) samples: u32,
    /// Whether the background is left out: [`limpid::settings::Refract::transparent`].
    pub(crate) transparent: bool,
}

/// Sizes that are often wanted, pixels.
const SIZES: [(&str, UVec2); 3] = [
    ("1080p", UVec2::new(1920, 1080)),
    ("4K", UVec2::new(3840, 2160)),
    ("Square", UVec2::new(1080, 1080)),
];

/// Largest width and height, pixels.
const LARGEST: u32 = 16384;

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
        let drawing = Drawing { size: UVec2::ONE, samples: 1, transparent: false };
        Self::drawing(purpose, path, drawing)
    }

    /// The dialog for a picture or a film, drawn as the one in the window.
    pub(crate) fn drawing(purpose: Purpose, path: impl Into<String>, drawing: Drawing) -> Self {
        let (path, window, facts) = (path.into(), drawing.size, String::new());
        Self { purpose, path, drawing, window, locked: true, facts, existing: None }
    }

    /// Takes the path that was chosen in the system's dialog, which has asked whether a file may be replaced.
    pub(crate) fn choose(&mut self, path: String) {
        self.existing = Some((path.clone(), true));
        self.path = path;
    }

    /// Whether a file would be replaced; asks the user once.
    fn is_to_ask(&mut self) -> bool {
        let known = self.existing.as_ref().filter(|(path, _)| *path == self.path);
        if !self.purpose.saves() || known.is_some_and(|(_, replaced)| *replaced) {
            return false;
        }
        // A browser has no such file, and asks by itself.
        let exists = Path::new(&self.path).exists();
        self.existing = exists.then(|| (self.path.clone(), false));
        exists
    }

    /// Shows it; `browsing` if the system's dialog is open.
    pub(crate) fn show(&mut self, ctx: &egui::Context, browsing: bool) -> Outcome {
        let purpose = self.purpose;
        let (mut done, mut cancelled, mut browse) = (false, false, None);
        let modal = egui::Modal::new(egui::Id::unique("dialog")).show(ctx, |ui| {
            ui.set_width(520.0);
            ui.heading(purpose.title());
            ui.weak(purpose.hint());
            ui.add_space(4.0);
            self.path_line(ui, browsing, &mut done, &mut browse);
            if purpose.draws() {
                self.size_line(ui);
                self.quality_line(ui);
            }
            if !self.facts.is_empty() {
                ui.label(self.facts.as_str());
            }
            ui.add_space(8.0);
            let replaces = self.existing.clone().filter(|(path, _)| *path == self.path);
            let asks = replaces.is_some_and(|(_, replaced)| !replaced);
            if asks {
                ui.colored_label(
                    ui.visuals().warn_fg_color,
                    format!("{} exists. Replace it, or choose another name?", self.path),
                );
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let word = match purpose.saves() {
                    true if asks => "Replace",
                    true => "Save",
                    false => "Open",
                };
                let pressed = ui.add_enabled(!self.path.is_empty(), egui::Button::new(word));
                if pressed.clicked() {
                    done = true;
                    if asks {
                        self.existing = Some((self.path.clone(), true));
                    }
                }
                cancelled = ui.button("Cancel").clicked();
            });
        });
        if let Some(button) = browse {
            Outcome::Browse(button)
        } else if done && !self.path.is_empty() && !self.is_to_ask() {
            Outcome::Done
        } else if cancelled || modal.should_close() {
            Outcome::Cancelled
        } else {
            Outcome::Open
        }
    }

    /// The path, and the buttons that fill it.
    fn path_line(
        &mut self,
        ui: &mut egui::Ui,
        browsing: bool,
        done: &mut bool,
        browse: &mut Option<Browse>,
    ) {
        ui.horizontal(|ui| {
            let (label, buttons) = self.purpose.path_buttons();
            let label = ui.label(label);
            let width = ui.available_width() - 90.0 * buttons.len() as f32;
            let edit = egui::TextEdit::singleline(&mut self.path).desired_width(width);
            let response = ui.add(edit).labelled_by(label.id).on_hover_text(self.path.as_str());
            if response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter)) {
                *done = true;
            } else if !response.has_focus() && ui.memory(|memory| memory.focused().is_none()) {
                response.request_focus();
            }
            for &(text, button) in buttons {
                if ui.add_enabled(!browsing, egui::Button::new(text)).clicked() {
                    *browse = Some(button);
                }
            }
        });
    }

    /// Width and height, in a ratio that can be kept, and usual sizes.
    fn size_line(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            let Drawing { size, .. } = &mut self.drawing;
            let before = *size;
            ui.label("Size");
            for (name, side) in [("Width, pixels", &mut size.x), ("Height, pixels", &mut size.y)] {
                let drag = egui::DragValue::new(side).range(1..=LARGEST).suffix(" px");
                let response = ui.add(drag).on_hover_text(name);
                response
                    .widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, name));
                if name == "Width, pixels" {
                    ui.label("×");
                }
            }
            if self.locked && *size != before {
                *size = kept_ratio(before, *size);
            }
            ui.checkbox(&mut self.locked, "Keep ratio");
            if ui.button("Window").clicked() {
                *size = self.window;
            }
            for (name, usual) in SIZES {
                if ui.button(name).clicked() {
                    *size = usual;
                }
            }
            if self.purpose == Purpose::Film {
                // Videos have even sides.
                *size = (*size / 2 * 2).max(UVec2::splat(2));
            }
        });
    }

    fn quality_line(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            let label = ui.label("Rays per pixel");
            let samples = egui::DragValue::new(&mut self.drawing.samples).range(1..=64);
            ui.add(samples).labelled_by(label.id);
            // Films have no transparency.
            if self.purpose == Purpose::Picture {
                ui.add_space(8.0);
                ui.checkbox(&mut self.drawing.transparent, "Transparent background")
                    .on_hover_text("the liquid and solids alone; .png, .webp and .exr hold it");
            }
        });
    }
}

/// The size whose one side was changed, with the ratio of the size before.
fn kept_ratio(before: UVec2, changed: UVec2) -> UVec2 {
    let other = |new: u32, old: u32, other: u32| {
        let scaled = f64::from(new) * f64::from(other) / f64::from(old.max(1));
        (scaled.round() as u32).clamp(1, LARGEST)
    };
    if changed.x != before.x {
        UVec2::new(changed.x, other(changed.x, before.x, before.y))
    } else {
        UVec2::new(other(changed.y, before.y, before.x), changed.y)
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
