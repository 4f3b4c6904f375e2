//! What is said of a run on standard error.

use std::mem::{Discriminant, discriminant};

use glam::UVec2;
use indicatif::ProgressBar;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::input::{Loaded, RadiusFrom};
use limpid_io::notice::{self, Notice, thousands};
use limpid_io::particles::Array;

use crate::remedy;

/// Says lines beside the progress bar, unless nobody wants them.
pub(super) struct Console {
    pub(super) bar: ProgressBar,
    pub(super) quiet: bool,
    /// What has been said need not be said again for every frame.
    said: Vec<Discriminant<Notice>>,
    /// Whether the particles have been described.
    begun: bool,
}

impl Console {
    pub(super) fn new(bar: ProgressBar, quiet: bool) -> Self {
        Self { bar, quiet, said: Vec::new(), begun: false }
    }

    pub(super) fn line(&self, line: &str) {
        if !self.quiet {
            self.bar.suspend(|| crate::terminal::complain(line));
        }
    }

    pub(super) fn notice(&mut self, notice: &Notice) {
        let kind = discriminant(notice);
        if !self.said.contains(&kind) {
            self.said.push(kind);
            self.line(&remedy::of_notice(notice));
        }
    }

    /// What is known once a frame is loaded: of the first that has particles, what it is drawn as; of
    /// every one, whether it is in the picture.
    pub(super) fn frame(
        &mut self,
        loaded: &Loaded,
        scene: &Scene,
        (camera, size): (&Camera, UVec2),
        adapter: &str,
    ) {
        if self.quiet || loaded.particles == 0 {
            return;
        }
        if !self.begun {
            self.begun = true;
            self.line(&describe(loaded, adapter));
            let notices = notice::of_frame(loaded, scene).into_iter();
            notices.chain(notice::of_scene(scene)).for_each(|notice| self.notice(&notice));
        }
        if let Some(notice) = notice::of_view(loaded, camera, size) {
            self.notice(&notice);
        }
    }

    /// What is known once all pictures are drawn.
    pub(super) fn end(&self) {
        if !self.begun {
            self.line("no picture has particles");
        }
    }
}

/// `40,368 particles, radius 0.025 m (guessed), velocity used, density ignored; llvmpipe`.
fn describe(loaded: &Loaded, adapter: &str) -> String {
    let from = match loaded.radius_from {
        RadiusFrom::File => "from the file",
        RadiusFrom::Option => "--radius",
        RadiusFrom::Scene => "from the scene",
        RadiusFrom::Guess => "guessed",
    };
    let (particles, radius) = (thousands(loaded.particles), loaded.splats.radius);
    let mut text = format!("{particles} particles, radius {radius} m ({from})");
    for (used, word) in [(true, "used"), (false, "ignored")] {
        let arrays = loaded.arrays.iter().filter(|array| array.used_as.is_some() == used);
        if let Some(names) = listed(arrays) {
            text += &format!(", {names} {word}");
        }
    }
    format!("{text}; {adapter}")
}

/// Some of the arrays' names, each once.
fn listed<'a>(arrays: impl Iterator<Item = &'a Array>) -> Option<String> {
    const MOST: usize = 8;
    let mut names: Vec<&str> = Vec::new();
    for array in arrays {
        if !names.contains(&array.name.as_str()) {
            names.push(&array.name);
        }
    }
    let more = match names.len().saturating_sub(MOST) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    names.truncate(MOST);
    (!names.is_empty()).then(|| names.join(", ") + &more)
}
