//! Opening and saving by dialogs.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use eframe::egui;
use glam::UVec2;

use crate::app::Viewer;
use crate::app::command_line::command_line;
use crate::backend::core::drawing::Pane;
use crate::model::platform::IN_BROWSER;
use crate::panels::dialogs::{Dialog, Outcome, Purpose};
use limpid_io::error::Error;

/// A file dialog that returns sooner than this was never shown.
const MIN_DIALOG_TIME: Duration = Duration::from_millis(400);

/// Why a page saves no films.
pub(super) const NO_FILMS: &str = "films are saved by the program: limpid render -o film.mp4";

impl Viewer {
    pub(super) fn save_picture_dialog(&self) -> Option<Dialog> {
        self.opened.document.as_ref()?;
        let scene = self.picture.fine_scene(&self.stage.editing);
        let size = self.picture.viewport_size.max(UVec2::ONE);
        let samples = scene.settings.refract.samples;
        Some(Dialog::drawing(Purpose::Picture, "limpid.png", size, samples))
    }

    pub(super) fn save_film_dialog(&mut self) -> Option<Dialog> {
        if IN_BROWSER {
            self.show_info(NO_FILMS.into());
            return None;
        }
        self.opened.document.as_ref()?;
        // Even, as videos must be.
        let size = (self.picture.viewport_size / 2 * 2).max(UVec2::splat(2));
        let samples = self.picture.fine_scene(&self.stage.editing).settings.refract.samples;
        Some(Dialog::drawing(Purpose::Film, "limpid.mp4", size, samples))
    }

    pub(super) fn save_scene_dialog(&self) -> Option<Dialog> {
        let stem = Path::new(self.opened.document.as_ref()?.name()).file_stem()?.to_string_lossy();
        Some(Dialog::new(Purpose::Scene, format!("{stem}_view.toml")))
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
        let path = PathBuf::from(&dialog.path);
        match dialog.purpose {
            Purpose::Open => self.open_typed(&dialog.path),
            Purpose::Picture => self.save_picture(path, dialog.size, dialog.samples),
            Purpose::Film => self.save_film(path, dialog.size, dialog.samples),
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
            (Some(path), Some(dialog)) => dialog.path = path.to_string_lossy().into_owned(),
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
        let side = self.picture.edited(&self.stage);
        let present = side.fits && side.at == Some(self.stage.playback.index());
        let Some(loaded) = side.loaded.clone().filter(|_| present) else {
            self.fail(&Error::Usage("not saved: this frame is not loaded".into()));
            return;
        };
        let mut scene = self.picture.fine_scene(&self.stage.editing);
        scene.settings.refract.samples = samples;
        let colors = &self.stage.colors;
        let (scale, legend) = (colors.scale.clone(), colors.legend_of(&scene).is_some());
        let (scene, camera) = (Arc::new(scene), self.stage.eye.camera);
        let pane = Pane { scene, camera, loaded, size, scale, legend };
        self.check_legend(size);
        self.backend.save(pane, path, self.opened.document.clone());
    }
}
