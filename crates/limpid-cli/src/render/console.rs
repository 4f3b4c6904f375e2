//! Messages of a run on standard error.

use std::mem::{Discriminant, discriminant};

use glam::UVec2;
use indicatif::ProgressBar;
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid::scene::Scene;
use limpid_io::input::{Loaded, RadiusFrom, UpFrom};
use limpid_io::notice::{self, Notice, brief, thousands};
use limpid_io::particles::{Array, Remark};

use crate::{remedy, terminal};

/// Prints messages above the progress bar, unless [silent](terminal::silence).
pub(super) struct Console {
    pub(super) bar: ProgressBar,
    /// The input that messages are about, if there are several.
    input: Option<String>,
    /// The kinds of notices already printed, which are not repeated for every frame.
    printed: Vec<Discriminant<Notice>>,
    /// The remarks on other files already printed.
    incomplete: Vec<String>,
    /// The remarks on files already printed, by their subjects.
    remarked: Vec<(Discriminant<Remark>, String)>,
    /// Whether the reason why a picture is empty has been told.
    told_why_empty: bool,
    /// Whether the particles have been described.
    described: bool,
}

impl Console {
    pub(super) fn new(bar: ProgressBar) -> Self {
        Self {
            bar,
            input: None,
            printed: Vec::new(),
            incomplete: Vec::new(),
            remarked: Vec::new(),
            told_why_empty: false,
            described: false,
        }
    }

    /// For messages about one of several inputs.
    pub(super) fn of(self, input: &str) -> Self {
        Self { input: Some(input.to_owned()), ..self }
    }

    pub(super) fn line(&self, line: &str) {
        // Messages on a file begin with its name.
        let input = self.input.as_ref().filter(|input| !line.starts_with(input.as_str()));
        let line = input.map_or_else(|| line.to_owned(), |input| format!("{input}: {line}"));
        self.bar.suspend(|| terminal::remark(line));
    }

    /// Whether a notice of this kind has been printed.
    fn has_told(&self, notice: &Notice) -> bool {
        self.printed.contains(&discriminant(notice))
    }

    pub(super) fn notice(&mut self, notice: &Notice) {
        if let Notice::Incomplete(remark) = notice {
            if !self.incomplete.contains(remark) {
                self.incomplete.push(remark.clone());
                self.line(remark);
            }
        } else if let Notice::Read(remark) = notice {
            let (kind, name) = remark.subject();
            let subject = (kind, name.to_owned());
            if !self.remarked.contains(&subject) {
                self.remarked.push(subject);
                self.line(&remedy::of_notice(notice));
            }
        } else if !self.has_told(notice) {
            self.printed.push(discriminant(notice));
            self.told_why_empty |=
                matches!(notice, Notice::Dots(_) | Notice::Vanishing(_) | Notice::Unseen { .. });
            self.line(&remedy::of_notice(notice));
        }
    }

    /// Prints messages about a loaded frame: for the first one with particles, how it is drawn; for
    /// every one, whether it is in the picture.
    pub(super) fn frame(
        &mut self,
        loaded: &Loaded,
        scene: &Scene,
        (camera, size): (&Camera, UVec2),
        camera_up: Up,
        adapter: &str,
    ) {
        if terminal::is_silent() {
            return;
        }
        if loaded.particles == 0 {
            return notice::of_reading(loaded).iter().for_each(|notice| self.notice(notice));
        }
        let in_view = notice::of_view(loaded, camera, size, camera_up);
        let of_frame = |notice| match (notice, &in_view) {
            (Notice::Scattered(radius), Some(Notice::Dots(_))) => Notice::Vanishing(radius),
            (notice, _) => notice,
        };
        if !self.described {
            self.described = true;
            self.line(&describe(loaded, adapter));
            let notices = notice::of_frame(loaded, scene).into_iter().map(of_frame);
            notices.chain(notice::of_scene(scene)).for_each(|notice| self.notice(&notice));
        } else {
            notice::of_reading(loaded).iter().for_each(|notice| self.notice(notice));
        }
        match in_view {
            Some(Notice::Dots(_)) if self.has_told(&Notice::Vanishing(0.0)) => {}
            Some(notice) => self.notice(&notice),
            None => {}
        }
    }

    /// Says that a picture with particles is empty, unless the reason has been told.
    pub(super) fn uncovered(&mut self) {
        if !self.told_why_empty {
            self.notice(&Notice::Uncovered);
        }
    }

    /// Prints the messages that follow the last picture.
    pub(super) fn end(&self) {
        if !self.described {
            self.line("no picture has particles; `limpid info` tells what the files hold");
        }
    }
}

/// Describes a loaded frame:
/// `40,368 particles, radius 0.025 m (guessed), velocity used, density ignored; llvmpipe`.
fn describe(loaded: &Loaded, adapter: &str) -> String {
    let from = match loaded.radius_from {
        RadiusFrom::File => "from the file",
        RadiusFrom::Option => "--radius",
        RadiusFrom::Scene => "from the scene",
        RadiusFrom::Guess => "guessed",
    };
    let particles = thousands(loaded.particles);
    let radius = match loaded.radius_from {
        RadiusFrom::Guess => brief(loaded.splats.radius),
        _ => loaded.splats.radius,
    };
    let mut text = format!("{particles} particles, radius {radius} m ({from})");
    match loaded.up {
        (Up::Y, UpFrom::Option | UpFrom::Scene | UpFrom::Guess | UpFrom::Default) => {}
        (up, UpFrom::Option) => text += &format!(", {up} up (--up)"),
        (up, UpFrom::Guess) => text += &format!(", {up} up (guessed, or else --up y)"),
        (up, from) => text += &format!(", {up} up ({})", from.word()),
    }
    // Unusable arrays have a line of their own.
    let has_remark = |name: &str| {
        let of_array =
            |remark: &Remark| matches!(remark, Remark::Unusable { array, .. } if array == name);
        loaded.remarks.iter().any(of_array)
    };
    for (used, word) in [(true, "used"), (false, "ignored")] {
        let is_used = |array: &&Array| array.used_as.is_some() || array.is_shown;
        let arrays = loaded.arrays.iter().filter(|array| is_used(array) == used);
        let arrays = arrays.filter(|array| used || !has_remark(&array.name));
        if let Some(names) = listed(arrays) {
            text += &format!(", {names} {word}");
        }
    }
    format!("{text}; {adapter}")
}

/// Lists the first arrays' names, each once; `None` without arrays.
fn listed<'a>(arrays: impl Iterator<Item = &'a Array>) -> Option<String> {
    const MAX_LISTED: usize = 8;
    let mut names: Vec<&str> = Vec::new();
    for array in arrays {
        if !names.contains(&array.name.as_str()) {
            names.push(&array.name);
        }
    }
    let more = match names.len().saturating_sub(MAX_LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    names.truncate(MAX_LISTED);
    (!names.is_empty()).then(|| names.join(", ") + &more)
}
