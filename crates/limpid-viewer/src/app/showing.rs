//! The panels and the viewport: their contents, and the effects of the user's commands.

use std::sync::Arc;
use std::time::Duration;

use eframe::egui::{self, Color32};
use limpid_io::frame_cache::CacheState;
use limpid_io::notice::thousands;

use crate::app::Viewer;
use crate::app::state::Attributes;
use crate::backend::core::truth;
use crate::model::demos::{DEMOS, Demo};
use crate::model::document::{Source, short_name};
use crate::model::platform::IN_BROWSER;
use crate::panels::dialogs::{Browse, Dialog, Purpose};
use crate::panels::error_plot::Present;
use crate::panels::first_screen::{self, FirstScreen};
use crate::panels::scene::ScenePanel;
use crate::panels::settings::SettingsPanel;
use crate::panels::side::{Tab, side_panel};
use crate::panels::timeline::Timeline;
use crate::panels::toolbar::Toolbar;
use crate::panels::{Command, camera_panel, notices};
use crate::picture::waiting::{self, LATE};

impl Viewer {
    pub(super) fn show_toolbar(&mut self, ui: &mut egui::Ui) {
        let mut commands = Vec::new();
        let toolbar = Toolbar {
            open: self.opened.document.is_some(),
            help: self.interface.help,
            dark: self.interface.dark,
            panels: self.interface.shows_panels(),
            view: self.picture.view,
            shown: self.shown().map_or(self.picture.view, |(view, _)| view),
            lights: self.stage.editing.scene().lights.len(),
            compare: &mut self.stage.editing.compare,
            recent: self.interface.recent.named(),
            can_step: self.history.can_step(),
        };
        toolbar.show(ui, &mut commands);
        self.obey(ui, commands);
    }

    pub(super) fn show_timeline(&mut self, ui: &mut egui::Ui) {
        let mut commands = Vec::new();
        let ahead = self.opened.frames.state();
        let kept = match self.picture.flipping.needed {
            true => self.picture.kept(&self.stage),
            false => Vec::new(),
        };
        let kept: Vec<usize> = (0..kept.len()).filter(|&i| kept[i]).collect();
        let timeline = Timeline {
            document: self.opened.document.as_deref(),
            opening: self.opened.pending(),
            playback: &self.stage.playback,
            frame_times: &self.stage.frame_times,
            shown: self.shown().and_then(|(_, at)| at),
            ahead: &ahead,
            failed: &self.opened.failed,
            kept: &kept,
            keys: &self.stage.eye.path.keys,
            facts: &self.facts(&ahead),
            films: self.filming.is_some(),
            simulates: self.opened.simulates(),
            messages: self.interface.notices.log().len(),
            adapter: self.interface.adapter.as_deref(),
        };
        timeline.show(ui, &mut commands);
        self.obey(ui, commands);
    }

    /// The status line.
    fn facts(&self, ahead: &CacheState) -> Vec<String> {
        let side = self.picture.edited(&self.stage);
        let mut facts = Vec::new();
        if let Some(loaded) = &side.loaded {
            facts.push(format!("{} particles", thousands(loaded.particles)));
            facts.push(format!("{} splashes", thousands(loaded.splashes)));
        } else if self.opened.document.is_some() {
            facts.push("loading".to_owned());
        }
        if let Some(shown) = &side.picture.shown {
            let (size, samples) = (shown.size, shown.samples);
            facts.push(format!("{} × {}, {samples} per pixel", size.x, size.y));
            facts.push(format!("drawn in {:.0} ms", shown.ms));
        }
        if let Some(progress) = self.opened.opening.as_ref().and_then(|opening| opening.progress) {
            facts.push(format!("simulating, {} of {}", progress.done, progress.frames));
        }
        if self.stage.frame_times.len() > 1 {
            let mebi = |bytes: u64| bytes >> 20;
            let (loaded, budget) = (mebi(ahead.bytes), mebi(ahead.budget));
            facts.push(format!("frames in memory {loaded} of {budget} MiB"));
        }
        facts.extend(self.picture.flipbook_status(&self.stage));
        if let Some(filming) = &self.filming {
            let left = filming.left.map(|left| format!(", {} left", duration(left)));
            let (done, all) = (filming.done, filming.pictures);
            facts.push(format!("film {done} of {all}{}", left.unwrap_or_default()));
        }
        if let Some(saving) = self.interface.saving.front() {
            let name = saving.path.file_name().unwrap_or_default().to_string_lossy();
            let left = saving.left().map(|left| format!(", about {} left", duration(left)));
            facts.push(format!("saving {name}{}", left.unwrap_or_default()));
        }
        facts
    }

    pub(super) fn show_side_panel(&mut self, ui: &mut egui::Ui) {
        let mut commands = Vec::new();
        let mut tab = self.interface.tab;
        side_panel(ui, &mut tab, |ui, tab| match tab {
            Tab::Scene => {
                let Some(document) = &self.opened.document else { return };
                let side = &self.picture.sides[self.stage.editing.edited];
                let panel = ScenePanel {
                    document,
                    loaded: side.loaded.as_deref(),
                    editing: &mut self.stage.editing,
                    colors: &mut self.stage.colors,
                    attributes: match &self.opened.attributes {
                        Attributes::Known(all) => Some(all),
                        _ => None,
                    },
                    size: self.picture.viewport_size,
                };
                panel.show(ui, &mut commands);
            }
            Tab::Settings => {
                let Some(document) = &self.opened.document else { return };
                let panel = SettingsPanel {
                    document,
                    editing: &mut self.stage.editing,
                    refine: &mut self.picture.refine,
                    processor: &mut self.stage.processor,
                    color_by: self.stage.colors.by.as_ref(),
                    log: &mut self.log,
                };
                panel.show(ui, &mut commands);
            }
            Tab::Camera => camera_panel(ui, &mut self.stage.eye, &mut commands),
            Tab::Times => {
                self.times.show(ui);
                // A browser has neither the threads nor the time for ground truth.
                if !IN_BROWSER {
                    ui.separator();
                    self.show_errors(ui, &mut commands);
                }
            }
        });
        self.interface.tab = tab;
        self.obey(ui, commands);
    }

    fn show_errors(&mut self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let scene = self.stage.editing.scene();
        let loaded = self.picture.edited(&self.stage).loaded.as_ref();
        let particles = loaded.map_or(0, |loaded| loaded.particles);
        let document = self.opened.document.as_ref();
        let at = self.stage.frame_time();
        let truth = self.errors.truth.as_ref();
        let present = Present {
            missing: document.and_then(|document| truth::missing(document, scene, particles)),
            is_loaded: loaded.is_some(),
            is_traced: truth.is_some_and(|truth| truth.fits(scene, &self.stage.eye.camera, at)),
            settings: &self.picture.fine_scene(&self.stage.editing).settings,
        };
        self.errors.show(ui, &present, commands);
    }

    pub(super) fn show_viewport(&mut self, ui: &mut egui::Ui) {
        let fill = match self.interface.dark {
            true => Color32::from_gray(12),
            false => Color32::from_gray(200),
        };
        let mut commands = Vec::new();
        egui::CentralPanel::default().frame(egui::Frame::NONE.fill(fill)).show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            if !self.picture.resize(ui.ctx(), rect, &mut self.log) {
                return;
            }
            let has_thumbnail = self.show_thumbnail(ui, rect);
            if self.opened.document.is_some() {
                self.picture.show(ui, rect, &mut self.stage, &mut self.log);
            }
            if self.opened.document.is_some() || has_thumbnail {
                self.show_opening(ui, rect);
            } else {
                let screen = FirstScreen {
                    opening: self.opened.pending(),
                    pictures: &mut self.interface.demos,
                    recent: self.interface.recent.named(),
                };
                screen.show(ui, rect, &mut commands);
            }
            if self.interface.invites {
                first_screen::invite(ui, rect, &mut commands);
            }
            notices::show(ui, rect, &mut self.interface.notices, &mut commands);
        });
        self.obey(ui, commands);
    }

    /// Shows the picture of a demo until its particles are there; returns whether it does.
    fn show_thumbnail(&mut self, ui: &egui::Ui, rect: egui::Rect) -> bool {
        let side = self.picture.edited(&self.stage);
        if side.loaded.is_some() || side.picture.shown.is_some() {
            return false;
        }
        let open = self.opened.document.as_ref().map(|document| document.source.input.as_str());
        let pending = self.opened.pending();
        let Some(demo) = pending.or(open).and_then(Demo::of) else { return false };
        let pictures = first_screen::pictures(ui.ctx(), &mut self.interface.demos);
        if let Some((_, picture)) =
            DEMOS.iter().zip(pictures).find(|(known, _)| known.name == demo.name)
        {
            let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            // It fills the picture, as far as its ratio allows.
            let size = picture.size_vec2();
            let scale = (rect.size() / size).min_elem();
            let place = egui::Rect::from_center_size(rect.center(), size * scale);
            ui.painter().image(picture.id(), place, whole, Color32::from_gray(190));
        }
        true
    }

    /// Says over the picture of the open document, or of a demo, that another one is being opened.
    fn show_opening(&self, ui: &egui::Ui, rect: egui::Rect) {
        let opening = self.opened.opening.as_ref();
        let Some(opening) = opening.filter(|opening| opening.pending && !opening.replaces) else {
            return;
        };
        waiting::wake(ui.ctx(), opening.since);
        if opening.since.elapsed() >= LATE {
            if self.opened.document.is_some() {
                ui.painter().rect_filled(rect, 0, Color32::from_black_alpha(140));
            }
            let words = format!("opening {}", short_name(&opening.source.input));
            waiting::note(ui, rect, &words, opening.since);
        }
    }

    /// Carries out the user's commands.
    fn obey(&mut self, ui: &egui::Ui, commands: Vec<Command>) {
        let ctx = ui.ctx().clone();
        for command in commands {
            match command {
                Command::Act(action) => self.act(&ctx, action),
                Command::Open(source) => self.open(source),
                Command::OpenDemo(demo) => match Demo::source(demo) {
                    Ok(source) => self.open(source),
                    Err(error) => self.fail(&error),
                },
                Command::Adjust(adjustments) => {
                    if let Some(document) = &self.opened.document {
                        self.reopen(Source { adjustments, ..document.source.clone() });
                    }
                }
                Command::SetRadius(radius) => {
                    if let Some(document) = &self.opened.document {
                        self.reopen(Source { radius, ..document.source.clone() });
                    }
                }
                Command::Select(select) => self.select(select),
                Command::OpenFolder => self.browse(Dialog::new(Purpose::Open, ""), Browse::Folder),
                Command::TurnSun(adjustments) => {
                    if let (Some(document), Some(sun)) =
                        (&mut self.opened.document, adjustments.sun)
                    {
                        let document = Arc::make_mut(document);
                        document.source.adjustments = adjustments;
                        let scenes = [&mut document.plain, &mut document.project.scene];
                        let edited = &mut self.stage.editing.scenes;
                        scenes.into_iter().chain(edited).for_each(|scene| sun.apply(scene));
                    }
                }
                Command::ColorBy(attribute) => self.color_by(attribute),
                Command::Recolor(map, range) => self.recolor(map, range),
                Command::ListAttributes => self.list_attributes(),
                Command::SetSpeed(speed) => self.set_speed(speed),
                Command::SetView(view) => self.picture.set_view(view, &mut self.log),
                Command::Seek(index) => self.seek(index),
                Command::GoTo(key) => {
                    self.stage.eye.set(key.camera);
                    if let Some(document) = &self.opened.document {
                        self.seek(document.nearest(&self.stage.frame_times, key.time));
                    }
                }
                Command::LoadPath => {
                    self.interface.dialog = Some(Dialog::new(Purpose::LoadPath, "camera.toml"));
                }
                Command::SavePath => {
                    let path = self.free_path("camera.toml");
                    self.interface.dialog = Some(Dialog::new(Purpose::SavePath, path));
                }
                Command::StopFilm => self.filming.iter().for_each(|filming| filming.stop()),
                Command::StopSimulation => self.stop_simulation(),
                Command::ShowMessages => self.interface.messages = true,
                Command::Trace => self.trace(),
            }
        }
    }
}

/// A time that is left, in words.
fn duration(left: Duration) -> String {
    match left.as_secs_f64().ceil() as u64 {
        seconds @ 0..100 => format!("{seconds} s"),
        seconds @ 100..6000 => format!("{} min", seconds.div_ceil(60)),
        seconds => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}
