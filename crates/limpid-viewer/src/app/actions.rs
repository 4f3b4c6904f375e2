//! Actions of keys, buttons and menus.

use eframe::egui;
use serde_json::json;

#[cfg(not(target_arch = "wasm32"))]
use crate::model::document::Source;
use crate::model::playback::Speed;
use crate::model::shortcuts::{self, Action};
use crate::model::views::View;
use crate::panels::dialogs::Dialog;
use crate::picture::camera_controls;
use crate::{Compare, Viewer};
use limpid::camera::Camera;

impl Viewer {
    /// Opens a file that was dropped on the window. In a browser the page takes it.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn take_files(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        if let Some(file) = dropped.first() {
            self.open(Source::new(file.path().to_string_lossy()));
        }
    }

    pub(crate) fn handle_keys(&mut self, ctx: &egui::Context) {
        // The user may be typing a number or a path.
        if self.interface.dialog.is_some() || ctx.text_edit_focused() {
            return;
        }
        let pressed = ctx.input(|input| {
            let flying = input.pointer.secondary_down();
            let keys = input.events.iter().filter_map(|event| match event {
                egui::Event::Key { key, pressed: true, modifiers, .. } => {
                    shortcuts::action(*key, *modifiers)
                }
                _ => None,
            });
            // W, A, S, D, Q and E then fly the camera.
            if flying { Vec::new() } else { keys.collect::<Vec<_>>() }
        });
        for action in pressed {
            self.act(ctx, action);
        }
    }

    /// Performs the action of a key, a button or a menu.
    pub(crate) fn act(&mut self, ctx: &egui::Context, action: Action) {
        match action {
            Action::Open | Action::Panels | Action::SavePicture | Action::SaveScene
                if self.interface.plain => {}
            Action::Open => self.interface.dialog = Some(Dialog::open()),
            Action::Help => self.interface.help = !self.interface.help,
            Action::Close => {
                self.interface.help = false;
                self.interface.notices.clear();
            }
            Action::Quit => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Action::Theme => {
                self.interface.dark = !self.interface.dark;
                ctx.set_theme(if self.interface.dark {
                    egui::Theme::Dark
                } else {
                    egui::Theme::Light
                });
            }
            Action::Panels => self.interface.panels = !self.interface.panels,
            _ if self.opened.document.is_none() => {}
            Action::Play => self.toggle_play(),
            Action::Reverse => self.playback.backwards = !self.playback.backwards,
            Action::Next => self.playback.step_by(true),
            Action::Previous => self.playback.step_by(false),
            Action::First => self.seek(0),
            Action::Last => self.seek(self.playback.count().saturating_sub(1)),
            Action::Loop => self.playback.looped = !self.playback.looped,
            Action::Faster => self.set_speed(self.playback.speed().next(true)),
            Action::Slower => self.set_speed(self.playback.speed().next(false)),
            Action::Fit => self.fit(),
            Action::Home => self.home(),
            Action::AddKey => self.add_key(),
            Action::NextView => {
                let all: Vec<View> = View::all().collect();
                let at = all.iter().position(|view| view.aov() == self.picture.view.aov());
                self.set_view(all[(at.unwrap_or(0) + 1) % all.len()]);
            }
            Action::Picture => self.set_view(match self.picture.view {
                View::Picture => self.picture.view_before,
                View::Image(..) => View::Picture,
            }),
            Action::Compare => {
                let at = Compare::ALL.iter().position(|&c| c == self.editing.compare).unwrap_or(0);
                self.editing.compare = Compare::ALL[(at + 1) % Compare::ALL.len()];
            }
            Action::Swap => self.editing.edited = 1 - self.editing.edited,
            Action::SavePicture => {
                // Kept pictures play without their particles, which are loaded once it pauses.
                self.playback.playing = false;
                self.interface.dialog = self.save_picture_dialog();
            }
            #[cfg(target_arch = "wasm32")]
            Action::SaveFilm => {
                self.show_info("films are saved by the program: limpid render -o film.mp4".into());
            }
            #[cfg(not(target_arch = "wasm32"))]
            Action::SaveFilm => self.interface.dialog = self.save_film_dialog(),
            Action::SaveScene => self.interface.dialog = self.save_scene_dialog(),
            #[cfg(target_arch = "wasm32")]
            Action::Copy => self.copy_link(ctx),
            #[cfg(not(target_arch = "wasm32"))]
            Action::Copy => {
                if let Some(command) = self.command_line("limpid.png") {
                    ctx.copy_text(command.clone());
                    self.show_info(format!("copied: {command}"));
                }
            }
        }
    }

    pub(crate) fn toggle_play(&mut self) {
        self.playback.playing = !self.playback.playing;
        self.jobs.log.event(if self.playback.playing { "play" } else { "pause" }, json!({}));
    }

    pub(crate) fn seek(&mut self, index: usize) {
        if index != self.playback.index() {
            self.playback.seek(index);
            self.jobs.log.event("seek", json!({ "index": index }));
        }
    }

    pub(crate) fn set_speed(&mut self, speed: Speed) {
        let Some(document) = &self.opened.document else { return };
        // With missing frames, the same time may have different indices at the two speeds.
        let seconds = self.frame_time().map_or(0.0, |at| document.seconds(at));
        self.opened.frame_times = document.frame_times(speed).into();
        let index = document.nearest(&self.opened.frame_times, seconds);
        for side in &mut self.editing.sides {
            side.at = None;
        }
        self.playback.set_speed(speed, self.opened.frame_times.len(), index);
        self.opened.failed.clear();
    }

    pub(crate) fn set_view(&mut self, view: View) {
        if self.picture.view != View::Picture {
            self.picture.view_before = self.picture.view;
        }
        if self.picture.view != view {
            self.jobs.log.event("view", json!({ "view": view.label() }));
        }
        self.picture.view = view;
    }

    pub(crate) fn set_camera(&mut self, camera: Camera) {
        // Invalid cameras are ignored.
        if camera != self.eye.camera && camera.check().is_ok() {
            self.eye.camera = camera;
            self.eye.follow = false;
        }
    }

    pub(crate) fn fit(&mut self) {
        if let Some(loaded) = &self.editing.sides[self.editing.edited].loaded {
            let aspect = self.picture.viewport_size.as_dvec2();
            let aspect = if aspect.min_element() > 0.0 { aspect.x / aspect.y } else { 1.0 };
            let radius = f64::from(loaded.splats.radius);
            let (min, max) = loaded.bulk.bounds;
            let camera =
                camera_controls::fit(&self.eye.camera, (min - radius, max + radius), aspect);
            self.set_camera(camera);
        }
    }

    pub(crate) fn home(&mut self) {
        if let Some(document) = &self.opened.document {
            let camera = document.project.camera_for(Default::default());
            self.set_camera(camera);
        }
    }
}
