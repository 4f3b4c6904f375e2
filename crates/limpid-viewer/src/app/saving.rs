//! Opening and saving by dialogs.

use std::path::{Path, PathBuf, absolute};
use std::sync::Arc;
use std::time::Duration;

use eframe::egui;
use glam::UVec2;
use web_time::Instant;

use crate::app::Viewer;
use crate::app::command_line::command_line;
use crate::app::state::Saving;
use crate::backend::core::drawing::Pane;
use crate::model::platform::IN_BROWSER;
use crate::panels::dialogs::{Dialog, Drawing, Outcome, Purpose};
use limpid_io::error::Error;

/// A file dialog that returns sooner than this was never shown.
const MIN_DIALOG_TIME: Duration = Duration::from_millis(400);

/// Why a page saves no films.
pub(super) const NO_FILMS: &str = "films are saved by the program: limpid render -o film.mp4";

impl Viewer {
    pub(super) fn save_picture_dialog(&self) -> Option<Dialog> {
        self.opened.document.as_ref()?;
        let drawing = self.drawing(self.picture.viewport_size.max(UVec2::ONE));
        let path = self.free_path(&self.output_name("png"));
        Some(Dialog::drawing(Purpose::Picture, path, drawing))
    }

    /// The picture at rest, at this size.
    fn drawing(&self, size: UVec2) -> Drawing {
        let scene = self.picture.fine_scene(&self.stage.editing);
        let refract = &scene.settings.refract;
        Drawing { size, samples: refract.samples, transparent: refract.transparent }
    }

    /// A file name after the open document.
    fn output_name(&self, extension: &str) -> String {
        let name = self.opened.document.as_ref().map_or("limpid", |document| document.name());
        let stem = name.split('.').next().unwrap_or(name);
        let stem = stem.replace("{}", "");
        let stem = stem.trim_matches(|c: char| !c.is_alphanumeric());
        format!("{}.{extension}", if stem.is_empty() { "limpid" } else { stem })
    }

    /// The whole path of a new file in the folder that was saved in last: `name`, or with a number if that is taken. In a
    /// browser, which has no folders, the name.
    pub(super) fn free_path(&self, name: &str) -> String {
        let folder = self.interface.saved_in.clone().or_else(|| std::env::current_dir().ok());
        let Some(folder) = folder.filter(|_| !IN_BROWSER) else { return name.to_owned() };
        let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
        let numbered = |n: u32| folder.join(format!("{stem}-{n}.{extension}"));
        let mut paths = std::iter::once(folder.join(name)).chain((2..1000).map(numbered));
        let free = paths.find(|path| !path.exists()).unwrap_or_else(|| folder.join(name));
        free.to_string_lossy().into_owned()
    }

    pub(super) fn save_film_dialog(&mut self) -> Option<Dialog> {
        if IN_BROWSER {
            self.show_info(NO_FILMS.into());
            return None;
        }
        self.opened.document.as_ref()?;
        // Even, as videos must be.
        let size = (self.picture.viewport_size / 2 * 2).max(UVec2::splat(2));
        let path = self.free_path(&self.output_name("mp4"));
        let mut dialog = Dialog::drawing(Purpose::Film, path, self.drawing(size));
        dialog.facts = self.film_facts();
        Some(dialog)
    }

    pub(super) fn save_scene_dialog(&self) -> Option<Dialog> {
        let stem = Path::new(self.opened.document.as_ref()?.name()).file_stem()?.to_string_lossy();
        Some(Dialog::new(Purpose::Scene, self.free_path(&format!("{stem}_view.toml"))))
    }

    pub(super) fn show_dialog(&mut self, ctx: &egui::Context) {
        let Some(mut dialog) = self.interface.dialog.take() else { return };
        match dialog.show(ctx, self.interface.browsing) {
            Outcome::Browse(how) => self.browse(dialog, how),
            Outcome::Done => self.finish(&dialog),
            Outcome::Cancelled => {}
            Outcome::Open => self.interface.dialog = Some(dialog),
        }
    }

    /// Carries out the dialog's purpose.
    fn finish(&mut self, dialog: &Dialog) {
        // Notices name the whole path.
        let path = PathBuf::from(&dialog.path);
        let path = if IN_BROWSER { path } else { absolute(&path).unwrap_or(path) };
        if dialog.purpose.saves() {
            self.interface.saved_in = path.parent().map(Path::to_owned);
        }
        match dialog.purpose {
            Purpose::Open => self.open_typed(&dialog.path),
            Purpose::Picture => self.draw_picture(path, dialog.drawing),
            Purpose::Film => self.save_film(path, dialog.drawing.size, dialog.drawing.samples),
            Purpose::Scene => self.save_scene(path),
            Purpose::SavePath => self.save_path(path),
            Purpose::LoadPath => self.load_path(path),
        }
    }

    /// Takes the path that was chosen in the system's dialog, which was shown for a time.
    pub(super) fn chosen(&mut self, path: Option<PathBuf>, waited: Duration) {
        self.interface.browsing = false;
        match (path, &mut self.interface.dialog) {
            (Some(path), Some(dialog)) if dialog.purpose == Purpose::Open => {
                self.interface.dialog = None;
                self.open_typed(&path.to_string_lossy());
            }
            (Some(path), Some(dialog)) => dialog.choose(path.to_string_lossy().into_owned()),
            (None, _) if waited < MIN_DIALOG_TIME => self.show_info(
                "this system shows no file dialogs (no desktop portal): type the path, or drop \
                 the file on the window"
                    .into(),
            ),
            _ => {}
        }
    }

    /// The command that draws the picture at rest without a window; `None` if nothing is open.
    pub fn command_line(&self, output: &str) -> Option<String> {
        let document = self.opened.document.as_ref()?;
        let (scene, at) = (self.picture.fine_scene(&self.stage.editing), self.stage.frame_time()?);
        let size = self.picture.viewport_size.max(UVec2::ONE);
        let processor = self.stage.processor;
        let shown = (&scene, processor, &self.stage.colors);
        Some(command_line(document, shown, &self.stage.eye.camera, at, size, output))
    }

    /// Draws the picture at rest at `size` pixels and writes it in the format of the extension, in the
    /// background. Fails if the current frame is not loaded, because the one shown instead must not be
    /// saved under its name.
    pub fn save_picture(&mut self, path: PathBuf, size: UVec2, samples: u32) {
        self.draw_picture(path, Drawing { samples, ..self.drawing(size) });
    }

    /// The time that a picture may take: that of the one on screen, in proportion to the rays.
    fn expected_time(&self, drawing: Drawing) -> Option<Duration> {
        let shown = self.picture.edited(&self.stage).picture.shown.as_ref()?;
        let rays = |size: UVec2, samples: u32| {
            f64::from(size.x) * f64::from(size.y) * f64::from(samples.max(1))
        };
        let share = rays(drawing.size, drawing.samples) / rays(shown.size, shown.samples).max(1.0);
        Duration::try_from_secs_f64(1e-3 * shown.ms * share).ok()
    }

    /// As [`Viewer::save_picture`].
    fn draw_picture(&mut self, path: PathBuf, drawing: Drawing) {
        let Drawing { size, samples, transparent } = drawing;
        let side = self.picture.edited(&self.stage);
        let present = side.fits && side.at == Some(self.stage.playback.index());
        let Some(loaded) = side.loaded.clone().filter(|_| present) else {
            self.fail(&Error::Usage("not saved: this frame is not loaded".into()));
            return;
        };
        let mut scene = self.picture.fine_scene(&self.stage.editing);
        scene.settings.refract.samples = samples;
        scene.settings.refract.transparent = transparent;
        let colors = &self.stage.colors;
        let (scale, legend) = (colors.scale.clone(), colors.legend_of(&scene).is_some());
        let (scene, camera) = (Arc::new(scene), self.stage.eye.camera);
        let pane = Pane { scene, camera, loaded, size, scale, legend };
        self.check_legend(size);
        let (since, expected) = (Instant::now(), self.expected_time(drawing));
        self.interface.saving.push_back(Saving { path: path.clone(), since, expected });
        self.backend.save(pane, path, self.opened.document.clone());
    }
}
