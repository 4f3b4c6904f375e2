//! Actions of keys, buttons and menus.

use std::path::PathBuf;

use eframe::egui;
use glam::DVec3;
use serde_json::json;

use crate::app::Viewer;
use crate::model::document::Source;
use crate::model::playback::Speed;
use crate::model::shortcuts::{self, Action};
use crate::model::views::View;
use crate::panels::dialogs::{Dialog, Purpose};

impl Viewer {
    /// Opens the files that were dropped on the window: one, or a sequence.
    pub(crate) fn take_files(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        let paths: Vec<PathBuf> = dropped.iter().map(|file| file.path().to_owned()).collect();
        let Some((source, left_out)) = Source::of_files(&paths) else { return };
        if left_out > 0 {
            self.show_info(format!("{} is opened, {left_out} other files are not", source.input));
        }
        self.open(source);
    }

    /// Sets the title of the window, if it is another one.
    pub(crate) fn name_window(&mut self, ctx: &egui::Context) {
        let title = self.title();
        if self.interface.title != title {
            self.interface.title.clone_from(&title);
            ctx.send_viewport_cmd(egui::ViewportCommand::Title(title));
        }
    }

    /// The title of the window: the name of the document that is open.
    pub fn title(&self) -> String {
        match &self.opened.document {
            Some(document) => format!("{} - limpid", document.name()),
            None => "limpid".to_owned(),
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
            Action::Open => self.interface.dialog = Some(Dialog::new(Purpose::Open, "")),
            Action::Help => self.interface.help = !self.interface.help,
            Action::Close => {
                self.interface.help = false;
                self.interface.messages = false;
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
            Action::Panels => self.interface.toggle_panels(),
            _ if self.opened.document.is_none() => {}
            Action::Play => self.toggle_play(),
            Action::Reverse => self.stage.playback.backwards = !self.stage.playback.backwards,
            Action::Next => self.stage.playback.step_by(true),
            Action::Previous => self.stage.playback.step_by(false),
            Action::First => self.seek(0),
            Action::Last => self.seek(self.stage.playback.count().saturating_sub(1)),
            Action::Loop => self.stage.playback.looped = !self.stage.playback.looped,
            Action::Faster => self.set_speed(self.stage.playback.speed().next(true)),
            Action::Slower => self.set_speed(self.stage.playback.speed().next(false)),
            Action::Fit => self.fit(),
            Action::Home => self.home(),
            Action::Front => self.picture.look_from(DVec3::Z, &mut self.stage),
            Action::Side => self.picture.look_from(DVec3::X, &mut self.stage),
            Action::Top => self.picture.look_from(DVec3::Y, &mut self.stage),
            Action::In => self.stage.playback.mark_first(),
            Action::Out => self.stage.playback.mark_last(),
            Action::Undo => self.step_history(false),
            Action::Redo => self.step_history(true),
            Action::AddKey => self.add_key(),
            Action::NextView => {
                let all: Vec<View> = View::all().collect();
                let at = all.iter().position(|view| view.aov() == self.picture.view.aov());
                let next = all[(at.unwrap_or(0) + 1) % all.len()];
                self.picture.set_view(next, &mut self.log);
            }
            Action::Picture => {
                let view = match self.picture.view {
                    View::Picture => self.picture.view_before,
                    View::Image(..) => View::Picture,
                };
                self.picture.set_view(view, &mut self.log);
            }
            Action::Compare => {
                self.stage.editing.compare = self.stage.editing.compare.next();
            }
            Action::Swap => self.stage.editing.edited = 1 - self.stage.editing.edited,
            Action::SavePicture => {
                // Kept pictures play without their particles, which are loaded once it pauses.
                self.stage.playback.playing = false;
                self.interface.dialog = self.save_picture_dialog();
            }
            Action::SaveFilm => self.interface.dialog = self.save_film_dialog(),
            Action::SaveScene => self.interface.dialog = self.save_scene_dialog(),
            Action::Copy => self.copy(ctx),
        }
    }

    pub(crate) fn toggle_play(&mut self) {
        self.stage.playback.playing = !self.stage.playback.playing;
        self.log.event(if self.stage.playback.playing { "play" } else { "pause" }, json!({}));
    }

    pub(crate) fn seek(&mut self, index: usize) {
        if index != self.stage.playback.index() {
            self.stage.playback.seek(index);
            self.log.event("seek", json!({ "index": index }));
        }
    }

    pub(crate) fn set_speed(&mut self, speed: Speed) {
        let Some(document) = &self.opened.document else { return };
        // With missing frames, the same time may have different indices at the two speeds.
        let seconds = self.stage.frame_time().map_or(0.0, |at| document.seconds(at));
        let span = self.stage.playback.marked().map(|ends| {
            ends.map(|i| self.stage.frame_times.get(i).map_or(0.0, |&at| document.seconds(at)))
        });
        self.stage.frame_times = document.frame_times(speed).into();
        let span =
            span.map(|ends| ends.map(|seconds| document.nearest(&self.stage.frame_times, seconds)));
        let index = document.nearest(&self.stage.frame_times, seconds);
        for side in &mut self.picture.sides {
            side.at = None;
        }
        self.stage.playback.set_speed(speed, self.stage.frame_times.len(), index);
        self.stage.playback.mark(span);
        self.opened.failed.clear();
    }

    fn fit(&mut self) {
        if let Some(camera) = self.picture.fitted(&self.stage) {
            self.stage.eye.set(camera);
        }
    }

    fn home(&mut self) {
        if let Some(document) = &self.opened.document {
            self.stage.eye.set(document.project.camera_for(Default::default()));
        }
    }

    /// Adds a key at the current time, or for a still one second after the last key.
    fn add_key(&mut self) {
        let still = self.stage.playback.count() < 2;
        let time = if still { self.stage.eye.after_keys() } else { self.seconds() };
        self.stage.eye.add_key(time);
        let keys = self.stage.eye.path.keys.len();
        self.show_info(format!("key {keys} at {time:.2} s"));
    }
}
