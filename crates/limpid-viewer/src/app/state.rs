//! The viewer's state, grouped by the component that changes it.

use std::collections::{BTreeSet, VecDeque};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use eframe::egui;
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::bake::Progress;
use limpid_io::color_by::AttributeRange;
use web_time::Instant;

use crate::app::recent::Recent;
use crate::backend::frames::Frames;
use crate::model::coloring::Coloring;
use crate::model::document::{Document, Source};
use crate::model::notices::Notices;
use crate::panels::dialogs::Dialog;
use crate::panels::side::Tab;

/// The open document and its frames. Opening and growing simulations change it.
pub(crate) struct OpenDocument {
    pub(crate) document: Option<Arc<Document>>,
    pub(crate) opening: Option<Opening>,
    /// The previous opening while another source is being opened.
    pub(crate) before: Option<Opening>,
    /// Number of openings so far.
    pub(crate) openings: u64,
    pub(crate) frames: Frames,
    /// Indices of frame times that could not be loaded.
    pub(crate) failed: BTreeSet<usize>,
    /// Whether the notices on its first frame have been given.
    pub(crate) noticed: bool,
    /// The attributes of the files.
    pub(crate) attributes: Attributes,
    /// Further wishes of the user, once the source is open.
    pub(crate) wishes: Wishes,
}

/// The attributes of the particles' files.
#[derive(Debug, Default)]
pub(crate) enum Attributes {
    #[default]
    Unknown,
    /// They are being read, by the number of the request.
    Asked(u64),
    Known(Vec<AttributeRange>),
}

/// A source that is open or being opened; dropping this stops its bake after the current frame.
#[derive(Debug)]
pub(crate) struct Opening {
    pub(crate) number: u64,
    pub(crate) source: Source,
    pub(crate) since: Instant,
    /// Whether it takes the place of the same source with other adjustments.
    pub(crate) replaces: bool,
    /// Whether it is still to be read.
    pub(crate) pending: bool,
    /// Whether it has been read and is the open document.
    pub(crate) opened: bool,
    /// Progress of its bake; `None` if none is needed or it has ended.
    pub(crate) progress: Option<Progress>,
    /// Whether the user has ended its simulation.
    pub(crate) stopped: bool,
    /// Whether the folder is being searched for new frames.
    pub(crate) growing: bool,
    /// Whether more frames have been baked since that search began.
    pub(crate) again: bool,
    pub(crate) stop: Arc<AtomicBool>,
}

impl Drop for Opening {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl OpenDocument {
    pub(crate) fn new(frames: Frames) -> Self {
        Self {
            document: None,
            opening: None,
            before: None,
            openings: 0,
            frames,
            failed: BTreeSet::new(),
            noticed: false,
            attributes: Attributes::default(),
            wishes: Wishes::default(),
        }
    }

    /// The source that is being read.
    pub(crate) fn pending(&self) -> Option<&str> {
        let opening = self.opening.as_ref().filter(|opening| opening.pending)?;
        Some(&opening.source.input)
    }

    /// Whether a source is being read that takes the place of another one, which is shown until then.
    pub(crate) fn is_leaving(&self) -> bool {
        let opening = self.opening.as_ref().filter(|opening| opening.pending && !opening.replaces);
        opening.is_some() && self.document.is_some()
    }

    /// Whether frames are being simulated.
    pub(crate) fn simulates(&self) -> bool {
        self.opening.as_ref().is_some_and(|opening| opening.progress.is_some())
    }

    /// Whether more frames may follow.
    pub(crate) fn grows(&self) -> bool {
        let mut openings = [&self.opening, &self.before].into_iter().flatten();
        openings.any(|opening| opening.progress.is_some() || opening.growing || opening.pending)
    }

    /// The opening with this number, unless it has been dropped.
    pub(crate) fn opening_mut(&mut self, number: u64) -> Option<&mut Opening> {
        let all = [&mut self.opening, &mut self.before];
        all.into_iter().flatten().find(|opening| opening.number == number)
    }
}

/// Wishes in an address or a command besides the source, for when that is open.
#[derive(Debug, Clone, Default)]
pub(crate) struct Wishes {
    pub(crate) frame: Option<i64>,
    /// Whether it plays; `None` plays simulations alone.
    pub(crate) play: Option<bool>,
    pub(crate) camera: Option<Camera>,
    pub(crate) view: Option<Aov>,
    pub(crate) unrefined: bool,
    pub(crate) legend: bool,
    /// The settings and the colours to go back to.
    pub(crate) edits: Option<Box<([Scene; 2], Coloring)>>,
}

/// A picture that is being drawn and written.
#[derive(Debug)]
pub(crate) struct Saving {
    pub(crate) path: PathBuf,
    /// When that was asked for.
    pub(crate) since: Instant,
    /// How long it may take, by the picture on screen.
    pub(crate) expected: Option<Duration>,
}

impl Saving {
    /// Expected time until it is written; `None` if unknown, or if it takes longer.
    pub(crate) fn left(&self) -> Option<Duration> {
        self.expected?.checked_sub(self.since.elapsed())
    }
}

/// The state of panels, dialogs and notices.
pub(crate) struct Interface {
    pub(crate) notices: Notices,
    /// Whether the log of notices is shown.
    pub(crate) messages: bool,
    pub(crate) tab: Tab,
    /// Whether the panels are shown in a narrow window, and in a wide one.
    pub(crate) panels: [bool; 2],
    /// Whether the window is wide enough for panels beside the picture.
    pub(crate) is_wide: bool,
    /// The title of the window.
    pub(crate) title: String,
    pub(crate) help: bool,
    pub(crate) dialog: Option<Dialog>,
    /// Whether the system's dialog for files is open.
    pub(crate) browsing: bool,
    /// The folder that was saved in last.
    pub(crate) saved_in: Option<PathBuf>,
    /// Pictures that are being drawn and written, the next one first.
    pub(crate) saving: VecDeque<Saving>,
    pub(crate) recent: Recent,
    /// The demos' pictures, once they have been shown.
    pub(crate) demos: Vec<egui::TextureHandle>,
    pub(crate) dark: bool,
    /// Only the picture and the timeline are shown: within a page of somebody else.
    pub(crate) plain: bool,
    /// Nothing plays before the user says so.
    pub(crate) still: bool,
    /// Whether the picture says that files can be dropped on it.
    pub(crate) invites: bool,
    /// The graphics device that draws.
    pub(crate) adapter: Option<String>,
    /// When playback last advanced.
    pub(crate) ticked: Instant,
}

impl Interface {
    pub(crate) fn new(recent: Recent) -> Self {
        Self {
            notices: Notices::default(),
            messages: false,
            tab: Tab::default(),
            panels: [false, true],
            is_wide: true,
            title: String::new(),
            help: false,
            dialog: None,
            browsing: false,
            saved_in: None,
            saving: VecDeque::new(),
            recent,
            demos: Vec::new(),
            dark: true,
            plain: false,
            still: false,
            invites: false,
            adapter: None,
            ticked: Instant::now(),
        }
    }

    /// Whether the panels are shown.
    pub(crate) fn shows_panels(&self) -> bool {
        self.panels[usize::from(self.is_wide)]
    }

    /// Shows or hides the panels, in windows as wide as this one.
    pub(crate) fn toggle_panels(&mut self) {
        let shown = &mut self.panels[usize::from(self.is_wide)];
        *shown = !*shown;
    }
}
